/* Every model integrates to what it must, by deterministic quadrature over the normals. */
#include "check.h"
#include "normals.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const facet_roughness roughness[] = {
    {.alpha_x = 0.3, .alpha_y = 0.3},
    {.alpha_x = 1e-3, .alpha_y = 1e-3},
    {.alpha_x = 4, .alpha_y = 4},
    {.alpha_x = 0.05, .alpha_y = 0.8},
    {.alpha_x = 0.4, .alpha_y = 0.7, .rho = -0.95},
    {.alpha_x = 0.3, .alpha_y = 0.3, .slope_x = 0.5, .slope_y = -0.2},
    {.alpha_x = 0.5, .alpha_y = 0.2, .rho = 0.6, .slope_x = -2, .slope_y = 1},
    {.alpha_x = 0.1, .alpha_y = 0.1, .slope_x = 3},
    {.alpha_x = 0.02, .alpha_y = 0.3, .rho = 0.3, .slope_x = 0.1, .slope_y = 5},
};
enum { SURFACES = sizeof roughness / sizeof *roughness };

static facet_material material(facet_ndf ndf, int surface, facet_masking masking)
{
    facet_material m = {.ndf = ndf, .roughness = roughness[surface], .masking = masking};
    m.fresnel.kind = FACET_FRESNEL_IDEAL;
    m.fresnel.channels = 1;
    return m;
}

/* The integral of quantity * factor over the solid angles of h; factor NULL is 1. */
static double integral(const facet_material *m, facet_tier tier, const struct normals_rule *rule,
                       facet_quantity quantity, const double *factor)
{
    double *y = malloc(rule->n * sizeof *y), sum = 0;
    facet_brdf *brdf = NULL;
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    outputs.of[quantity][0] = y;
    CHECK_INT(facet_brdf_create(m, &brdf), FACET_OK);
    if (brdf && y) {
        facet_vec3_in wi = {rule->i[0], rule->i[1], rule->i[2]};
        facet_vec3_in wo = {rule->o[0], rule->o[1], rule->o[2]};
        CHECK_INT(facet_eval(brdf, tier, wi, wo, rule->n, &outputs), FACET_OK);
        for (size_t k = 0; k < rule->n; k++)
            sum += rule->weight[k] * y[k] * (factor ? factor[k] : 1);
    }
    facet_brdf_destroy(brdf);
    free(y);
    return sum;
}

static double tolerance(facet_tier tier)
{
    static const double of[FACET_TIER_COUNT] = {1e-3, 1e-4, 1e-8, 1e-9};
    return of[tier];
}

static void expect(const char *what, double got, double wanted, facet_tier tier,
                   const facet_material *m, int surface)
{
    check_note(facet_tier_name(tier), fabs(got - wanted));
    if (!(fabs(got - wanted) <= tolerance(tier)))
        check_fail(__FILE__, __LINE__, "%s is %.15g, not %g: %s, ndf %d, surface %d, masking %d",
                   what, got, wanted, facet_tier_name(tier), (int)m->ndf, surface, (int)m->masking);
}

/* Slopes: mean, and their spread, E|x~ - x| = alpha_x (GGX), E(x~ - x)^2 = alpha_x^2/2 (Beckmann). */
static void check_moments(const facet_material *m, facet_tier tier, int surface,
                          const struct normals_rule *rule, double *factor)
{
    const facet_roughness *r = &m->roughness;
    double scale = m->ndf == FACET_GGX ? r->alpha_x : r->alpha_x * r->alpha_x / 2;
    for (size_t k = 0; k < rule->n; k++) {
        double off = -rule->h[0][k] / rule->h[2][k] - r->slope_x;
        factor[k] = rule->h[2][k] * (m->ndf == FACET_GGX ? fabs(off) : off * off) / scale;
    }
    double spread = integral(m, tier, rule, FACET_D, factor);
    check_note("spread", fabs(spread - 1));
    if (!(fabs(spread - 1) < 1e-3)) expect("spread of x", spread, 1, tier, m, surface);
    if (m->ndf != FACET_BECKMANN) return;
    scale = r->alpha_x * r->alpha_y / 2;
    for (size_t k = 0; k < rule->n; k++) {
        double x = -rule->h[0][k] / rule->h[2][k] - r->slope_x;
        double y = -rule->h[1][k] / rule->h[2][k] - r->slope_y;
        factor[k] = rule->h[2][k] * x * y / scale;
    }
    expect("covariance", integral(m, tier, rule, FACET_D, factor), r->rho, tier, m, surface);
}

TEST(normals_cover_the_plane)
{
    for (int tier = 0; tier < FACET_TIER_COUNT; tier++)
        for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++)
            for (int s = 0; s < SURFACES; s++) {
                facet_material m = material((facet_ndf)ndf, s, FACET_SMITH);
                struct normals_rule rule;
                if (!normals_rule_create(&m, NULL, 3, &rule)) continue;
                double got = integral(&m, (facet_tier)tier, &rule, FACET_D, rule.h[2]);
                expect("D cos", got, 1, (facet_tier)tier, &m, s);
                check_moments(&m, (facet_tier)tier, s, &rule, rule.cosine);
                normals_rule_destroy(&rule);
            }
}

/* From above, at grazing and, on the sheared surfaces, from behind the mean facet (c < 0). */
static const double views[][3] = {
    {0, 0, 1}, {0.6, 0, 0.8}, {-0.48, 0.64, 0.6}, {0.28, 0.96, 1e-3}, {0.936, -0.352, 0},
};
enum { VIEWS = sizeof views / sizeof *views };

static bool normalises(facet_masking masking, double c)
{
    /* V-cavities seen from behind the mean facet show nothing; a normal map is seen from all sides.
     */
    return masking != FACET_VGROOVE || c > 1e-6;
}

TEST(visible_normals_fill_the_view)
{
    size_t behind = 0;
    for (int tier = 0; tier < FACET_TIER_COUNT; tier++)
        for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++)
            for (int s = 0; s < SURFACES; s++)
                for (int v = 0; v < VIEWS; v++)
                    for (int g = FACET_SMITH; g <= FACET_SMITH_UNCORRELATED; g++) {
                        facet_material m = material((facet_ndf)ndf, s, (facet_masking)g);
                        struct normals_map map = normals_map(&m, views[v]);
                        struct normals_rule rule;
                        if (!normals_rule_create(&m, views[v], 3, &rule)) continue;
                        behind += map.c < 0;
                        double got = integral(&m, (facet_tier)tier, &rule, FACET_D_VIS, NULL);
                        expect("D_vis", got, 1, (facet_tier)tier, &m, s);
                        for (size_t k = 0; k < rule.n; k++) rule.cosine[k] *= 4; /* dwi / dwh */
                        got = integral(&m, (facet_tier)tier, &rule, FACET_PDF, rule.cosine);
                        expect("pdf", got, 1, (facet_tier)tier, &m, s);
                        normals_rule_destroy(&rule);
                    }
    CHECK(behind >= 20);
}

/*
 * V-cavities: where both sides of a groove are seen D_vis is <o,h> D / c, else one side stands for
 * both: a kink the rule crosses, hence more panels and less accuracy.  A normal map sees every
 * normal that faces wo, so its D_vis = D h_z integrates to the share of those.
 */
TEST(visible_normals_of_other_maskings)
{
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++)
        for (int s = 0; s < SURFACES; s++)
            for (int v = 0; v < VIEWS; v++) {
                facet_material m = material((facet_ndf)ndf, s, FACET_VGROOVE);
                struct normals_map map = normals_map(&m, views[v]);
                struct normals_rule rule;
                if (!normals_rule_create(&m, views[v], 16, &rule)) continue;
                if (normalises(FACET_VGROOVE, map.c)) {
                    double got = integral(&m, FACET_PRECISE, &rule, FACET_D_VIS, NULL);
                    check_note("vgroove", fabs(got - 1));
                    if (!(fabs(got - 1) < 2e-3))
                        check_fail(__FILE__, __LINE__, "vgroove %.9g: ndf %d surface %d view %d",
                                   got, ndf, s, v);
                }
                m.masking = FACET_NONE;
                double edge = map.s > 0 ? map.c / map.s : INFINITY;
                double seen = ndf == FACET_GGX ? (1 + sin(atan(edge))) / 2 : erfc(-edge) / 2;
                expect("normal map", integral(&m, FACET_PRECISE, &rule, FACET_D_VIS, NULL), seen,
                       FACET_PRECISE, &m, s);
                normals_rule_destroy(&rule);
            }
}
