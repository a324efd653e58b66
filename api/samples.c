#include "samples.h"

#include "limits.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* No radiance comes near, and sums of squares stay finite. */
#define NUMBER_MAX 1e30

const struct field api_samples_fields[] = {
    DIRECTIONS_FIELD(struct samples, wi, FIELD_MUST, "towards the light"),
    DIRECTIONS_FIELD(struct samples, wo, FIELD_MUST, "towards the viewer, as many as wi"),
    {MEMBER(struct samples, fr), FIELD_MATRIX, FIELD_MUST, .min = -NUMBER_MAX, .max = NUMBER_MAX,
     .width = 1, .doc = "a number or [r,g,b] per pair; below 0 counts as 0"},
    {0},
};

/* The measurement of n pairs: columns wi x, y, z, wo x, y, z, fr r, g, b in the arena. */
static bool finish(double *const column[9], size_t n, struct arena *arena, struct problem *problem,
                   struct measurement *m)
{
    facet_fit_samples *samples = api_arena_array(arena, 1, sizeof *samples);
    if (!samples) return api_problem_memory(problem);
    if (n < FACET_FIT_SAMPLES_MIN)
        return api_problem(problem, 422,
                           "%zu samples determine no material; at least %d are needed", n,
                           FACET_FIT_SAMPLES_MIN);
    *samples = (facet_fit_samples){.count = n,
                                   .wi = {column[0], column[1], column[2]},
                                   .wo = {column[3], column[4], column[5]},
                                   .fr = {column[6], column[7], column[8]}};
    struct data_counts counts = api_count_samples(samples);
    m->counts.values += counts.values;
    m->counts.negative += counts.negative;
    m->source = (facet_fit_source){NULL, NULL, INFINITY, true, samples};
    for (size_t i = 0; i < n; i++)
        if (column[6][i] > 0 || column[7][i] > 0 || column[8][i] > 0) return true;
    return api_problem(problem, 422, "the samples hold no data: no value is positive");
}

static bool allocate(struct arena *arena, size_t n, double *column[9])
{
    for (int k = 0; k < 9; k++)
        if (!(column[k] = api_arena_doubles(arena, n))) return false;
    return true;
}

/* ---- JSON ------------------------------------------------------------------------------------ */

static bool above(const double *z, size_t n, const struct place *place, struct decoder *decoder)
{
    for (size_t i = 0; i < n; i++) {
        struct place at = {place, NULL, i};
        if (!(z[i] > 0))
            return api_problem_at(decoder->problem, &at,
                                  "lies at or below the horizon (z = %g); f_r is needed above it",
                                  z[i]);
    }
    return true;
}

bool api_samples_open(const struct samples *samples, const struct place *place,
                      struct decoder *decoder, struct measurement *m)
{
    struct place wi_at = {place, "wi", 0}, wo_at = {place, "wo", 0}, fr_at = {place, "fr", 0};
    struct plan wi, wo;
    double *column[9];
    *m = (struct measurement){.format = -1};
    if (!api_plan(&samples->wi, &wi_at, decoder, &wi) ||
        !api_plan(&samples->wo, &wo_at, decoder, &wo))
        return false;
    const struct matrix *fr = &samples->fr;
    if (wi.count != wo.count)
        return api_problem_at(decoder->problem, &wo_at, "has %zu elements, wi has %zu", wo.count,
                              wi.count);
    if (fr->rows != wi.count)
        return api_problem_at(decoder->problem, &fr_at, "has %zu elements, wi has %zu", fr->rows,
                              wi.count);
    if (fr->columns != 1 && fr->columns != 3)
        return api_problem_at(decoder->problem, &fr_at, "must hold numbers or [r,g,b]");
    size_t n = wi.count;
    if (!allocate(decoder->arena, n, column)) return api_problem_memory(decoder->problem);
    api_plan_fill(&wi, 0, n, column[0], column[1], column[2]);
    api_plan_fill(&wo, 0, n, column[3], column[4], column[5]);
    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++)
            column[6 + c][i] = fr->values[i * fr->columns + (fr->columns == 3 ? c : 0)];
    return above(column[2], n, &wi_at, decoder) && above(column[5], n, &wo_at, decoder) &&
           finish(column, n, decoder->arena, decoder->problem, m);
}

/* ---- CSV --------------------------------------------------------------------------------------- */

enum { COLUMNS = 7, CELL_MAX = 40 };
static const char *const names[COLUMNS] = {"theta_i", "phi_i", "theta_o", "phi_o", "r", "g", "b"};

static bool is_digit(unsigned char c)
{
    return c >= '0' && c <= '9';
}

/* Text whose first character, blanks aside, starts a number, a comment or a name of a column. */
bool api_csv_matches(const unsigned char *bytes, size_t size)
{
    size_t i = 0;
    while (i < size &&
           (bytes[i] == ' ' || bytes[i] == '\t' || bytes[i] == '\n' || bytes[i] == '\r'))
        i++;
    if (i == size) return false;
    for (size_t k = i; k < size && k < i + 64; k++)
        if (bytes[k] == 0 || bytes[k] > 126) return false;
    unsigned char c = bytes[i];
    return is_digit(c) || c == '-' || c == '.' || c == '#' || c == 't' || c == 'p';
}

struct csv {
    const char *at, *end;
    size_t line; /* from 1 */
    int order[COLUMNS];
    struct problem *problem;
};

static bool is_separator(char c)
{
    return c == ',' || c == ';';
}

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

/* The next cell of a line into text; false at its end. */
static bool next_cell(const char **at, const char *end, bool *first, char text[CELL_MAX])
{
    size_t n = 0;
    while (*at < end && is_blank(**at)) ++*at;
    if (*at == end && (*first || !is_separator((*at)[-1]))) return false;
    if (*at == end && !*first && is_separator((*at)[-1])) {
        *first = true; /* an empty last cell, once */
        text[0] = 0;
        return true;
    }
    while (*at < end && !is_separator(**at) && !is_blank(**at)) {
        if (n < CELL_MAX - 1) text[n++] = **at;
        ++*at;
    }
    text[n] = 0;
    while (*at < end && is_blank(**at)) ++*at;
    *first = false;
    if (*at < end && is_separator(**at)) ++*at;
    return true;
}

static int split(const char *at, const char *end, char cell[COLUMNS + 1][CELL_MAX])
{
    int n = 0;
    bool first = false;
    if (at == end) return 0;
    while (n <= COLUMNS && next_cell(&at, end, &first, cell[n])) n++;
    return n;
}

/* The next line that counts: its ends, carriage return and comment lines aside. */
static bool next_line(struct csv *csv, const char **at, const char **end)
{
    while (csv->at < csv->end) {
        const char *feed = memchr(csv->at, '\n', (size_t)(csv->end - csv->at));
        *at = csv->at;
        *end = feed ? feed : csv->end;
        csv->at = feed ? feed + 1 : csv->end;
        csv->line++;
        while (*at < *end && is_blank(**at)) ++*at;
        while (*end > *at && is_blank((*end)[-1])) --*end;
        if (*at < *end && **at != '#') return true;
    }
    return false;
}

/* A line of names sets the order; true if it was one. */
static bool read_names(struct csv *csv, char cell[COLUMNS + 1][CELL_MAX], int n, bool *is_names)
{
    *is_names = n > 0 && cell[0][0] >= 'a' && cell[0][0] <= 'z' && strncmp(cell[0], "nan", 3) != 0;
    if (!*is_names) return true;
    bool seen[COLUMNS] = {false};
    for (int k = 0; k < n && k < COLUMNS; k++) {
        int which = 0;
        while (which < COLUMNS && strcmp(cell[k], names[which]) != 0) which++;
        if (which == COLUMNS || seen[which])
            return api_problem(csv->problem, 422,
                               "line %zu: \"%s\" is %s; the columns are theta_i, phi_i, theta_o, "
                               "phi_o, r, g, b",
                               csv->line, cell[k], which == COLUMNS ? "no column" : "there twice");
        csv->order[k] = which;
        seen[which] = true;
    }
    return n == COLUMNS || api_problem(csv->problem, 422, "line %zu names %d columns, not %d",
                                       csv->line, n, COLUMNS);
}

/* Decimal or not, strtod knows; the whole cell must be one finite number. */
static bool read_number(const struct csv *csv, const char *cell, const char *name, double *value)
{
    char *end;
    *value = strtod(cell, &end);
    if (end == cell || *end || isnan(*value))
        return api_problem(csv->problem, 422, "line %zu: \"%s\" is not a number for %s", csv->line,
                           cell, name);
    return fabs(*value) <= NUMBER_MAX ||
           api_problem(csv->problem, 422, "line %zu: %s %s is outside [-1e30, 1e30]", csv->line,
                       name, cell);
}

/* Nothing, or what programs print for NaN: nan, NaN, -nan, ... */
static bool is_missing(const char *cell)
{
    return !*cell || !strcasecmp(cell + (*cell == '-' || *cell == '+'), "nan");
}

/* One line's numbers in the order of names; missing where a colour is. */
static bool read_row(struct csv *csv, char cell[COLUMNS + 1][CELL_MAX], double v[COLUMNS],
                     bool *missing)
{
    *missing = false;
    for (int k = 0; k < COLUMNS; k++) {
        int which = csv->order[k];
        if (which >= 4 && is_missing(cell[k])) {
            *missing = true;
            v[which] = 0;
            continue;
        }
        if (!read_number(csv, cell[k], names[which], &v[which])) return false;
    }
    for (int k = 0; k < 4; k += 2)
        if (!(v[k] >= 0 && cos(v[k]) > 0 && v[k] < 1.5707963267948966))
            return api_problem(csv->problem, 422,
                               "line %zu: %s %g is not above the horizon; [0, pi/2) in radians is "
                               "needed",
                               csv->line, names[k], v[k]);
    return true;
}

static void store(const double v[COLUMNS], double *const column[9], size_t i)
{
    for (int k = 0; k < 2; k++) {
        double s = sin(v[2 * k]);
        column[3 * k][i] = s * cos(v[2 * k + 1]);
        column[3 * k + 1][i] = s * sin(v[2 * k + 1]);
        column[3 * k + 2][i] = cos(v[2 * k]);
    }
    for (int c = 0; c < 3; c++) column[6 + c][i] = v[4 + c];
}

static size_t count_lines(const char *at, const char *end)
{
    size_t n = 1;
    for (; at < end; at++) n += *at == '\n';
    return n;
}

bool api_csv_open(const void *bytes, size_t size, struct arena *arena, struct problem *problem,
                  struct measurement *m)
{
    struct csv csv = {.at = bytes, .end = (const char *)bytes + size, .problem = problem};
    char cell[COLUMNS + 1][CELL_MAX];
    const char *at, *end;
    double *column[9], v[COLUMNS];
    size_t n = 0, lines = count_lines(csv.at, csv.end);
    if (lines > LIMIT_SAMPLES)
        return api_problem(problem, 422, "%zu lines are outside [1, %d]", lines, LIMIT_SAMPLES);
    if (!allocate(arena, lines, column)) return api_problem_memory(problem);
    for (int k = 0; k < COLUMNS; k++) csv.order[k] = k;
    for (bool first = true; next_line(&csv, &at, &end); first = false) {
        int cells = split(at, end, cell);
        bool missing, is_names = false;
        if (first && !read_names(&csv, cell, cells, &is_names)) return false;
        if (is_names) continue;
        if (cells != COLUMNS)
            return api_problem(problem, 422,
                               "line %zu has %s%d cells; %d are needed: theta_i, "
                               "phi_i, theta_o, phi_o, r, g, b",
                               csv.line, cells > COLUMNS ? "more than " : "",
                               cells > COLUMNS ? COLUMNS : cells, COLUMNS);
        if (!read_row(&csv, cell, v, &missing)) return false;
        m->counts.missing += missing;
        m->counts.values += missing;
        if (!missing) store(v, column, n++);
    }
    return finish(column, n, arena, problem, m);
}
