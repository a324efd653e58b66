/* Tabulated materials: a table of GGX's or Beckmann's D is that surface, to the table's own
 * accuracy. */
#include "check.h"
#include "draw.h"
#include "facet_table.h"
#include "normals.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NODES = 400 };

/* log D(theta) at alpha = 1 at the nodes u = tan / (scale + tan), the last one the horizon. */
static facet_slope_table *table_of(facet_ndf ndf, double scale)
{
    static double log_d[NODES];
    const double log_pi = log(acos(-1));
    for (int k = 0; k < NODES; k++) {
        double u = (double)k / (NODES - 1), r = u < 1 ? scale * u / (1 - u) : INFINITY;
        /* D = P (1 + r^2)^2 */
        log_d[k] = ndf == FACET_GGX ? -log_pi
                   : k == NODES - 1 ? -1e4
                                    : 2 * log1p(r * r) - r * r - log_pi;
    }
    facet_slope_table *table = NULL;
    CHECK_INT(facet_slope_table_create(scale, log_d, NODES, &table), FACET_OK);
    return table;
}

static const facet_roughness roughness[] = {
    {.alpha_x = 0.3, .alpha_y = 0.3},
    {.alpha_x = 1e-3, .alpha_y = 1e-3},
    {.alpha_x = 0.05, .alpha_y = 0.8},
    {.alpha_x = 0.4, .alpha_y = 0.7, .rho = -0.9, .slope_x = 0.5, .slope_y = -1},
};
enum { SURFACES = sizeof roughness / sizeof *roughness };

static double integral(const facet_brdf *brdf, const struct normals_rule *rule,
                       facet_quantity quantity, const double *factor)
{
    double *y = malloc(rule->n * sizeof *y), sum = 0;
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    outputs.of[quantity][0] = y;
    if (y) {
        CHECK_INT(
            facet_eval(brdf, FACET_PRECISE, (facet_vec3_in){rule->i[0], rule->i[1], rule->i[2]},
                       (facet_vec3_in){rule->o[0], rule->o[1], rule->o[2]}, rule->n, &outputs),
            FACET_OK);
        for (size_t k = 0; k < rule->n; k++)
            sum += y[k] * rule->weight[k] * (factor ? factor[k] : 1);
    }
    free(y);
    return sum;
}

static void check_integrals(const facet_material *m, facet_ndf source, int surface)
{
    static const double views[][3] = {
        {0, 0, 1}, {0.6, 0, 0.8}, {0.28, 0.96, 1e-3}, {-0.48, 0.64, 0.6}};
    facet_brdf *brdf = NULL;
    CHECK_INT(facet_brdf_create(m, &brdf), FACET_OK);
    if (!brdf) return;
    facet_material shape = *m; /* the rule that suits the source */
    shape.ndf = source;
    struct normals_rule rule;
    if (normals_rule_create(&shape, NULL, 4, &rule)) {
        double whole = integral(brdf, &rule, FACET_D, rule.h[2]);
        check_note("D", fabs(whole - 1));
        if (!(fabs(whole - 1) < 1e-6))
            check_fail(__FILE__, __LINE__, "D cos is %.12g: source %d surface %d", whole,
                       (int)source, surface);
        normals_rule_destroy(&rule);
    }
    for (int v = 0; v < 4; v++) {
        if (!normals_rule_create(&shape, views[v], 4, &rule)) continue;
        double seen = integral(brdf, &rule, FACET_D_VIS, NULL);
        check_note("D_vis", fabs(seen - 1));
        if (!(fabs(seen - 1) < 1e-6))
            check_fail(__FILE__, __LINE__, "D_vis is %.12g: source %d surface %d view %d", seen,
                       (int)source, surface, v);
        normals_rule_destroy(&rule);
    }
    facet_brdf_destroy(brdf);
}

TEST(tables_integrate_to_one)
{
    for (int source = FACET_GGX; source <= FACET_BECKMANN; source++) {
        facet_slope_table *table = table_of((facet_ndf)source, 1);
        for (int s = 0; s < SURFACES && table; s++) {
            facet_material m = {.ndf = FACET_TABULATED, .roughness = roughness[s], .table = table};
            m.fresnel.channels = 1;
            check_integrals(&m, (facet_ndf)source, s);
        }
        facet_slope_table_destroy(table);
    }
}

/* What the table answers against what it was made of: random pairs, where D is within 1e-4 of its
 * peak. */
TEST(tables_answer_as_their_source)
{
    enum { N = 32 };
    struct rng rng;
    rng_seed(&rng, 61);
    static double i[3][N], o[3][N], y[2][FACET_QUANTITY_COUNT][N];
    for (int source = FACET_GGX; source <= FACET_BECKMANN; source++) {
        facet_slope_table *table = table_of((facet_ndf)source, 1);
        for (size_t round = draw_count(200); round-- && table;) {
            facet_material m[2] = {{.ndf = (facet_ndf)source},
                                   {.ndf = FACET_TABULATED, .table = table}};
            draw_roughness(&rng, &draw_ordinary, &m[0].roughness);
            m[1].roughness = m[0].roughness;
            for (size_t k = 0; k < N; k++) {
                double wi[3], wo[3];
                draw_direction(&rng, 0.05, wi);
                draw_direction(&rng, 0.05, wo);
                for (int j = 0; j < 3; j++) i[j][k] = wi[j], o[j][k] = wo[j];
            }
            for (int which = 0; which < 2; which++) {
                facet_brdf *brdf = NULL;
                facet_outputs outputs;
                memset(&outputs, 0, sizeof outputs);
                for (int q = 0; q < FACET_QUANTITY_COUNT; q++) outputs.of[q][0] = y[which][q];
                m[which].fresnel.channels = 1;
                CHECK_INT(facet_brdf_create(&m[which], &brdf), FACET_OK);
                if (brdf)
                    CHECK_INT(facet_eval(brdf, FACET_PRECISE, (facet_vec3_in){i[0], i[1], i[2]},
                                         (facet_vec3_in){o[0], o[1], o[2]}, N, &outputs),
                              FACET_OK);
                facet_brdf_destroy(brdf);
            }
            double peak = 1 / (m[0].roughness.alpha_x * m[0].roughness.alpha_y);
            for (size_t k = 0; k < N; k++) {
                double c = o[2][k] - o[0][k] * m[0].roughness.slope_x -
                           o[1][k] * m[0].roughness.slope_y;
                if (y[0][FACET_D][k] > 1e-4 * peak)
                    CHECK_REL(y[1][FACET_D][k], y[0][FACET_D][k], 1e-6, 0);
                if (c > 0) CHECK_REL(y[1][FACET_SIGMA_O][k], y[0][FACET_SIGMA_O][k], 1e-6, 0);
            }
        }
        facet_slope_table_destroy(table);
    }
}
