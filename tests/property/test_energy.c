/* No surface sends back more than it gets. */
#include "check.h"
#include "draw.h"
#include "normals.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { N = 64 };

struct pairs {
    double i[3][N], o[3][N], u1[N], u2[N];
    double fr_cos[3][N], f[3][N], pdf[N], weight[3][N], x[3][N];
};

static facet_vec3_in in(const double v[3][N])
{
    return (facet_vec3_in){v[0], v[1], v[2]};
}

/* A Smith material whose shear form is energy-safe. */
static facet_material safe_material(struct rng *rng)
{
    facet_material m = {.ndf = rng_uniform(rng) < 0.5 ? FACET_GGX : FACET_BECKMANN};
    m.masking = rng_uniform(rng) < 0.5 ? FACET_SMITH : FACET_SMITH_UNCORRELATED;
    draw_roughness(rng, &draw_everywhere, &m.roughness);
    draw_fresnel(rng, (facet_fresnel_kind)(int)(rng_uniform(rng) * FACET_FRESNEL_COUNT),
                 &m.fresnel);
    return m;
}

static void draw_pairs(struct rng *rng, const facet_material *m, struct pairs *p)
{
    for (size_t k = 0; k < N; k++) {
        double wi[3], wo[3];
        draw_pair(rng, &draw_everywhere, m, wi, wo);
        for (int j = 0; j < 3; j++) p->i[j][k] = wi[j], p->o[j][k] = wo[j];
    }
}

static void eval(const facet_brdf *brdf, facet_tier tier, const facet_material *m, struct pairs *p,
                 const double wi[3][N])
{
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    outputs.of[FACET_PDF][0] = p->pdf;
    for (size_t c = 0; c < m->fresnel.channels; c++) {
        outputs.of[FACET_FR_COS][c] = p->fr_cos[c];
        outputs.of[FACET_F][c] = p->f[c];
    }
    CHECK_INT(facet_eval(brdf, tier, in(wi), in(p->o), N, &outputs), FACET_OK);
}

/* The slack of a comparison between numbers the tier made; 0 where it promises nothing. */
static double slack(const facet_brdf *brdf, facet_tier tier)
{
    double sum = 0;
    static const facet_quantity used[] = {FACET_FR_COS, FACET_F, FACET_PDF};
    for (int k = 0; k < 3; k++) {
        double bound;
        if (!facet_bound(brdf, tier, used[k], 0, &bound)) return 0;
        sum += bound;
    }
    return 1.01 * sum;
}

/* fr cos <= F pdf: the weight of every sample, drawn or not, is at most the Fresnel term. */
TEST(fr_cos_never_exceeds_fresnel_times_pdf)
{
    struct rng rng;
    rng_seed(&rng, 11);
    static struct pairs p;
    size_t checked = 0;
    for (size_t round = draw_count(2500); round--;) {
        facet_material m = safe_material(&rng);
        facet_tier tier = (facet_tier)(round % FACET_TIER_COUNT);
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (!brdf) continue;
        draw_pairs(&rng, &m, &p);
        eval(brdf, tier, &m, &p, p.i);
        double loose = slack(brdf, tier);
        facet_brdf_destroy(brdf);
        if (!(loose > 0 && loose < 0.1)) continue;
        for (size_t k = 0; k < N; k++)
            for (size_t c = 0; c < m.fresnel.channels; c++) {
                double most = p.f[c][k] * p.pdf[k] * (1 + loose) + 2 * FACET_FLOOR;
                checked++;
                if (p.fr_cos[c][k] <= most) continue;
                check_fail(__FILE__, __LINE__,
                           "fr_cos %.17g, F %.17g, pdf %.17g, %s\n    %s\n    wi {%.17g, %.17g, "
                           "%.17g} wo {%.17g, %.17g, %.17g}",
                           p.fr_cos[c][k], p.f[c][k], p.pdf[k], facet_tier_name(tier),
                           draw_text(&m), p.i[0][k], p.i[1][k], p.i[2][k], p.o[0][k], p.o[1][k],
                           p.o[2][k]);
            }
    }
    check_note("checked", (double)checked);
    if (draw_count(100) >= 100) CHECK(checked >= 100000);
}

/* A method whose weight is at most the Fresnel term; V-cavities for VCAVITY. */
static facet_sampler exact_sampler(struct rng *rng, facet_material *m)
{
    double which = rng_uniform(rng);
    if (which < 0.3) return FACET_SAMPLER_AUTO;
    if (which < 0.4) return FACET_SAMPLER_SLOPE;
    if (which < 0.7 && m->ndf == FACET_GGX) return FACET_SAMPLER_BOUNDED;
    m->masking = FACET_VGROOVE;
    return FACET_SAMPLER_VCAVITY;
}

/* The same of the weights the sampler hands out: at most 1, or the largest value of a table. */
TEST(weights_never_exceed_fresnel)
{
    struct rng rng;
    rng_seed(&rng, 12);
    static struct pairs p;
    size_t checked = 0;
    for (size_t round = draw_count(1200); round--;) {
        facet_material m = safe_material(&rng);
        facet_tier tier = (facet_tier)(round % FACET_TIER_COUNT);
        facet_sampler sampler = exact_sampler(&rng, &m);
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (!brdf) continue;
        for (size_t k = 0; k < N; k++) {
            double wi[3], wo[3];
            draw_pair(&rng, &draw_everywhere, &m, wi, wo);
            for (int j = 0; j < 3; j++) p.o[j][k] = wo[j];
            p.u1[k] = rng_uniform(&rng);
            p.u2[k] = rng_uniform(&rng);
        }
        facet_samples s = {.wi = {p.x[0], p.x[1], p.x[2]},
                           .weight = {p.weight[0], p.weight[1], p.weight[2]}};
        CHECK_INT(facet_sample(brdf, tier, sampler, in(p.o), p.u1, p.u2, N, &s), FACET_OK);
        eval(brdf, tier, &m, &p, p.x);
        double bound = 0, loose = slack(brdf, tier);
        if (!facet_sample_bound(brdf, tier, sampler, 0, &bound)) loose = 0;
        facet_brdf_destroy(brdf);
        if (!(loose > 0 && loose < 0.1)) continue;
        loose += bound;
        double most = 1; /* F itself hangs on the rounded wi: only its largest value is sure */
        for (size_t k = 0; m.fresnel.kind == FACET_FRESNEL_TABLE && k < m.fresnel.count; k++)
            for (int c = 0; c < 3; c++) most = fmax(most, m.fresnel.values[c][k]);
        for (size_t k = 0; k < N; k++)
            for (size_t c = 0; c < m.fresnel.channels; c++) {
                double w = p.weight[c][k];
                checked++;
                check_note("weight", w / most);
                if (w >= 0 && w <= most * (1 + loose) && !(p.x[2][k] <= 0 && w != 0)) continue;
                check_fail(__FILE__, __LINE__,
                           "weight %.17g (most %g), wi_z %.3g, %s\n    %s\n    wo {%.17g, %.17g, "
                           "%.17g} u %.17g %.17g",
                           w, most, p.x[2][k], facet_tier_name(tier), draw_text(&m), p.o[0][k],
                           p.o[1][k], p.o[2][k], p.u1[k], p.u2[k]);
            }
    }
    check_note("checked", (double)checked);
    if (draw_count(100) >= 100) CHECK(checked >= 100000);
}

/*
 * Above the horizon bounded caps are never thinner than caps: fr cos / pdf is never larger, and so
 * neither is any variance.
 */
TEST(bounded_caps_are_never_thinner_than_caps)
{
    struct rng rng;
    rng_seed(&rng, 14);
    static struct pairs p;
    static double caps[N], bounded[N];
    size_t thicker = 0;
    for (size_t round = draw_count(1500); round--;) {
        facet_material m = safe_material(&rng);
        facet_tier tier = (facet_tier)(round % FACET_TIER_COUNT);
        m.ndf = FACET_GGX;
        if (round & 4) m.roughness.slope_x = m.roughness.slope_y = 0;
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (!brdf) continue;
        draw_pairs(&rng, &m, &p);
        CHECK_INT(facet_pdf(brdf, tier, FACET_SAMPLER_CAPS, in(p.i), in(p.o), N, caps), FACET_OK);
        CHECK_INT(facet_pdf(brdf, tier, FACET_SAMPLER_BOUNDED, in(p.i), in(p.o), N, bounded),
                  FACET_OK);
        double bound = 0;
        bool promised = facet_pdf_bound(brdf, tier, FACET_SAMPLER_BOUNDED, 0, &bound) &&
                        bound < 0.1;
        facet_brdf_destroy(brdf);
        for (size_t k = 0; promised && k < N; k++) {
            if (!(p.i[2][k] > 0)) continue;
            thicker += bounded[k] > 1.01 * caps[k];
            if (bounded[k] >= caps[k] * (1 - 2 * bound) - 2 * FACET_FLOOR) continue;
            check_fail(__FILE__, __LINE__,
                       "bounded %.17g caps %.17g, %s\n    %s\n    wo {%.17g, %.17g, %.17g}",
                       bounded[k], caps[k], facet_tier_name(tier), draw_text(&m), p.o[0][k],
                       p.o[1][k], p.o[2][k]);
        }
    }
    check_note("thicker", (double)thicker);
    CHECK(thicker > draw_count(1000));
}

static double albedo(const facet_brdf *brdf, const struct normals_rule *rule, double *y)
{
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    outputs.of[FACET_FR_COS][0] = y;
    facet_vec3_in wi = {rule->i[0], rule->i[1], rule->i[2]};
    facet_vec3_in wo = {rule->o[0], rule->o[1], rule->o[2]};
    CHECK_INT(facet_eval(brdf, FACET_PRECISE, wi, wo, rule->n, &outputs), FACET_OK);
    double sum = 0;
    for (size_t k = 0; k < rule->n; k++) sum += y[k] * 4 * rule->cosine[k] * rule->weight[k];
    return sum;
}

/* In a white furnace an ideal surface gives back at most what it gets, near all of it if smooth. */
TEST(white_furnace)
{
    const struct draw_domain domain = {
        .alpha_min = 1e-3, .alpha_max = 10, .rho_max = 0.95, .slope_max = 3, .cosine_min = 1e-3};
    static const facet_masking maskings[] = {FACET_SMITH, FACET_SMITH_UNCORRELATED, FACET_VGROOVE};
    struct rng rng;
    rng_seed(&rng, 13);
    for (size_t round = draw_count(120); round--;) {
        facet_material m = {.ndf = round & 1 ? FACET_GGX : FACET_BECKMANN,
                            .masking = maskings[round / 2 % 3]};
        m.fresnel.channels = 1;
        draw_roughness(&rng, &domain, &m.roughness);
        double wo[3];
        draw_direction(&rng, domain.cosine_min, wo);
        struct normals_rule rule;
        if (!normals_rule_create(&m, wo, 4, &rule)) continue;
        facet_brdf *brdf = NULL;
        double *y = malloc(rule.n * sizeof *y);
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (brdf && y) {
            double a = albedo(brdf, &rule, y);
            check_note("albedo", a);
            bool smooth = m.roughness.alpha_x < 0.02 && m.roughness.alpha_y < 0.02 && wo[2] > 0.5 &&
                          m.roughness.slope_x == 0 && m.roughness.slope_y == 0;
            if (!(a >= 0 && a <= 1 + 2e-3 && (!smooth || a > 0.99)))
                check_fail(__FILE__, __LINE__, "albedo %.9g: %s wo {%.9g, %.9g, %.9g}", a,
                           draw_text(&m), wo[0], wo[1], wo[2]);
        }
        free(y);
        facet_brdf_destroy(brdf);
        normals_rule_destroy(&rule);
    }
}
