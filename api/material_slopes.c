#include "material_slopes.h"

#include "facet_table.h"
#include "limits.h"

#include <math.h>
#include <stdio.h>

const struct field api_slopes_fields[] = {
    {MEMBER(struct slopes, scale), FIELD_NUMBER, FIELD_MUST, .min = FACET_ALPHA_MIN,
     .max = FACET_ALPHA_MAX,
     .doc =
         "the nodes are uniform in u = tan theta / (scale + tan theta), 0 to 1; of rows at most 64 "
         "mean slopes"},
    {MEMBER(struct slopes, log_D), FIELD_MATRIX, FIELD_MUST, .min = -1e4, .max = 1e3,
     .min_items = FACET_TABLE_NODES_MIN, .max_items = LIMIT_TABLE_NODES, .width = 1,
     .doc =
         "log of the normal distribution at the nodes; -700 and below count as D = 0. Rows of nodes: row j of m at "
         "azimuth pi j/m of the normal, and of its opposite, in the slopes that the roughness stretches; all rows "
         "begin with the same number"},
    {0},
};

/* Of slopes over the azimuth; field tables know one dimension. */
bool api_slopes_check(void *object, const struct place *place, struct decoder *decoder)
{
    const struct matrix *m = &((const struct slopes *)object)->log_D;
    struct place nodes = {place, "log_D", 0};
    if (m->columns == 1) return true;
    if (m->rows < FACET_TABLE_TURNS_MIN || m->rows > LIMIT_TABLE_AZIMUTHS)
        return api_problem_at(decoder->problem, &nodes, "has %zu rows, must have between %d and %d",
                              m->rows, FACET_TABLE_TURNS_MIN, LIMIT_TABLE_AZIMUTHS);
    if (m->columns < FACET_TABLE_NODES_MIN || m->columns > LIMIT_TABLE_ROWS_NODES / m->rows)
        return api_problem_at(decoder->problem, &nodes,
                              "has %zu rows of %zu nodes; such rows must have between %d and %zu",
                              m->rows, m->columns, FACET_TABLE_NODES_MIN,
                              LIMIT_TABLE_ROWS_NODES / m->rows);
    for (size_t j = 1; j < m->rows; j++) {
        struct place row = {&nodes, NULL, j}, first = {&row, NULL, 0};
        if (m->values[j * m->columns] != m->values[0])
            return api_problem_at(
                decoder->problem, &first,
                "%.17g is not %.17g: the rows meet at theta = 0, and must agree there",
                m->values[j * m->columns], m->values[0]);
    }
    return true;
}

static void destroy_table(void *table)
{
    facet_slope_table_destroy(table);
}

/* Each number has been checked, what is left is their integral. */
static bool refuse_slopes(const struct slopes *slopes, const struct place *at,
                          struct decoder *decoder)
{
    const struct matrix *m = &slopes->log_D;
    double most = -INFINITY, least_mean = slopes->scale / FACET_TURNED_SCALE_FAR;
    char far[160] = "";
    for (size_t i = 0; i < m->rows * m->columns; i++) most = fmax(most, m->values[i]);
    if (m->columns > 1)
        snprintf(far, sizeof far, ", or the mean slope of its rows is below %.6g, scale %.6g / %d",
                 least_mean, slopes->scale, FACET_TURNED_SCALE_FAR);
    return api_problem_at(
        decoder->problem, at,
        "log_D describes no surface: D is 0 at all slopes (-700 and below count as 0), or too large to "
        "be normalised%s; the largest log_D is %.6g, and a constant added to all changes nothing",
        far, most);
}

bool api_slopes_open(const struct slopes *slopes, const struct place *place,
                     struct decoder *decoder, facet_material *material)
{
    facet_slope_table *table;
    struct place at = {place, "slopes", 0};
    const struct matrix *m = &slopes->log_D;
    facet_status status = m->columns > 1
                              ? facet_slope_table_create_turned(slopes->scale, m->values,
                                                                m->columns, m->rows,
                                                                &decoder->watch, &table)
                              : facet_slope_table_create(slopes->scale, m->values, m->rows, &table);
    if (status == FACET_BAD_TABLE) return refuse_slopes(slopes, &at, decoder);
    if (status) return api_problem_status(decoder->problem, status, &at);
    material->table = table;
    return api_arena_defer(decoder->arena, destroy_table, table) ||
           api_problem_memory(decoder->problem);
}
