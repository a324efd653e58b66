/*
 * Ten million calls at the ends of every range, in every tier, on floats and
 * doubles: no NaN, no infinity, nothing negative; every sample has a positive
 * density and a weight that energy allows.  No reference: that is what
 * test_extremes.c and tests/accuracy are for.  FACET_TEST_SCALE=100 is the soak.
 */
#include "check.h"
#include "draw.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PAIRS = 512 };

static const char *const names[] = {
#define QUANTITY(id, name, coloured, doc) name,
#include "quantities.def"
#undef QUANTITY
};

static size_t pick(struct rng *rng, size_t n)
{
    return (size_t)(rng_uniform(rng) * (double)n);
}

#define ANY(rng, values) values[pick(rng, sizeof values / sizeof *values)]

static facet_material any_material(struct rng *rng)
{
    static const double alphas[] = {1e-8, 1e-6, 1e-4, 1e-3, 0.03, 0.3, 1, 10, 1e4};
    static const double rhos[] = {0, 0, 0.5, -0.99, 1 - 1e-12, -1 + 1e-12};
    static const double slopes[] = {0, 0, 1e-9, 0.3, -1, 1e3, -1e6, 1e6};
    facet_material m = {.ndf = pick(rng, 2) ? FACET_GGX : FACET_BECKMANN};
    m.masking = (facet_masking)pick(rng, FACET_MASKING_COUNT);
    if (m.masking <= FACET_SMITH_UNCORRELATED && pick(rng, 4) == 0) m.shear = FACET_THESIS;
    m.roughness = (facet_roughness){.alpha_x = ANY(rng, alphas),
                                    .alpha_y = ANY(rng, alphas),
                                    .rho = ANY(rng, rhos),
                                    .slope_x = ANY(rng, slopes),
                                    .slope_y = ANY(rng, slopes)};
    if (pick(rng, 2))
        m.roughness = (facet_roughness){.alpha_x = m.roughness.alpha_x,
                                        .alpha_y = m.roughness.alpha_x};
    draw_fresnel(rng, (facet_fresnel_kind)pick(rng, FACET_FRESNEL_COUNT), &m.fresnel);
    m.fresnel.channels = 1;
    return m;
}

static void any_direction(struct rng *rng, double k[3])
{
    static const double cosines[] = {1,     1 - 1e-15, 0.999, 0.5,   1e-3, 1e-6,
                                     1e-12, 1e-30,     0,     -1e-9, -0.3};
    static const double azimuths[] = {0, 1.5707963267948966, 3.1415926535897931, 0.7, 4};
    double z = pick(rng, 3) ? ANY(rng, cosines) : rng_uniform(rng), phi = ANY(rng, azimuths);
    double s = sqrt((1 - z) * (1 + z));
    k[0] = s * cos(phi), k[1] = s * sin(phi), k[2] = z;
}

/* Both types hold the same numbers. */
struct pairs {
    double d[6][PAIRS];
    float f[6][PAIRS];
};

static void fill(struct rng *rng, struct pairs *p)
{
    for (size_t k = 0; k < PAIRS; k++) {
        double w[2][3];
        any_direction(rng, w[0]);
        any_direction(rng, w[1]);
        size_t kind = pick(rng, 6); /* equal, opposite, mirrored, or as they are */
        for (int j = 0; j < 3 && kind < 3; j++)
            w[0][j] = kind == 0 ? w[1][j] : kind == 1 ? -w[1][j] : (j < 2 ? -1 : 1) * w[1][j];
        for (int j = 0; j < 6; j++) {
            p->f[j][k] = (float)w[j / 3][j % 3];
            p->d[j][k] = pick(rng, 2) ? p->f[j][k] : w[j / 3][j % 3];
        }
    }
}

/* Whether the batch holds something that no answer may hold. */
static bool any_bad(const double *d, const float *f, size_t n, size_t *where)
{
    for (size_t k = 0; k < n; k++) {
        double y = d ? d[k] : (double)f[k];
        if (y >= 0 && y <= (d ? DBL_MAX : (double)FLT_MAX)) continue;
        *where = k;
        return true;
    }
    return false;
}

static void complain(const char *what, double value, facet_tier tier, bool floats,
                     const facet_material *m, const struct pairs *p, size_t k)
{
    check_fail(__FILE__, __LINE__,
               "%s is %g, %s %s\n    %s\n    wi {%.17g, %.17g, %.17g} wo {%.17g, %.17g, %.17g}",
               what, value, facet_tier_name(tier), floats ? "float" : "double", draw_text(m),
               p->d[0][k], p->d[1][k], p->d[2][k], p->d[3][k], p->d[4][k], p->d[5][k]);
}

static size_t evaluate(const facet_brdf *brdf, const facet_material *m, const struct pairs *p)
{
    static double d[FACET_QUANTITY_COUNT][PAIRS];
    static float f[FACET_QUANTITY_COUNT][PAIRS];
    facet_outputs out = {{{NULL}}};
    facet_outputs_float out_f = {{{NULL}}};
    size_t bad;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) out.of[q][0] = d[q], out_f.of[q][0] = f[q];
    for (int t = 0; t < FACET_TIER_COUNT; t++) {
        facet_eval(brdf, (facet_tier)t, (facet_vec3_in){p->d[0], p->d[1], p->d[2]},
                   (facet_vec3_in){p->d[3], p->d[4], p->d[5]}, PAIRS, &out);
        facet_eval_float(brdf, (facet_tier)t, (facet_vec3_in_float){p->f[0], p->f[1], p->f[2]},
                         (facet_vec3_in_float){p->f[3], p->f[4], p->f[5]}, PAIRS, &out_f);
        for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
            if (any_bad(d[q], NULL, PAIRS, &bad))
                complain(names[q], d[q][bad], (facet_tier)t, false, m, p, bad);
            if (any_bad(NULL, f[q], PAIRS, &bad))
                complain(names[q], (double)f[q][bad], (facet_tier)t, true, m, p, bad);
        }
    }
    return 2 * FACET_TIER_COUNT * FACET_QUANTITY_COUNT * PAIRS;
}

TEST(evaluations_at_the_ends_of_every_range)
{
    static struct pairs p;
    struct rng rng;
    rng_seed(&rng, 31);
    size_t calls = 0;
    for (size_t round = draw_count(250); round--;) {
        facet_material m = any_material(&rng);
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (!brdf) continue;
        fill(&rng, &p);
        calls += evaluate(brdf, &m, &p);
        facet_brdf_destroy(brdf);
    }
    check_note("calls", (double)calls);
}

/* ---- samples ---------------------------------------------------------------------------- */

static void any_uniform(struct rng *rng, double *u)
{
    static const double ends[] = {0, 0x1p-53, 0x1p-24, 0.5, 1 - 0x1p-24, 1 - 0x1p-53};
    *u = pick(rng, 3) ? ANY(rng, ends) : rng_uniform(rng);
}

/* Of facets that cannot be seen at all (grazing along a mirror-like surface from behind) nothing is asked. */
static bool sees(const facet_material *m, double x, double y, double z)
{
    const facet_roughness *r = &m->roughness;
    return z > 1e-6 && z - x * r->slope_x - y * r->slope_y > 1e-6;
}

/* Of samplers that draw other than visible normals only that they stay finite; those owe more. */
static size_t draw_samples(struct rng *rng, const facet_brdf *brdf, const facet_material *m,
                           facet_tier tier, const struct pairs *p)
{
    facet_sampler sampler = pick(rng, 2) ? FACET_SAMPLER_AUTO
                                         : (facet_sampler)pick(rng, FACET_SAMPLER_COUNT);
    if (sampler == FACET_SAMPLER_TABLE && pick(rng, 32))
        sampler = FACET_SAMPLER_AUTO; /* a hundred times as long */
    if (!facet_sampler_serves(sampler, m->ndf)) sampler = FACET_SAMPLER_AUTO;
    static double u[2][PAIRS], wi[3][PAIRS], weight[PAIRS], pdf[PAIRS];
    for (size_t k = 0; k < PAIRS; k++) any_uniform(rng, &u[0][k]), any_uniform(rng, &u[1][k]);
    facet_samples s = {.wi = {wi[0], wi[1], wi[2]}, .weight = {weight}, .pdf = pdf};
    double bound = 0;
    bool promised = sampler < FACET_SAMPLER_NDF &&
                    facet_sample_bound(brdf, tier, sampler, 0, &bound) && bound < 0.1;
    if (facet_sample(brdf, tier, sampler, (facet_vec3_in){p->d[3], p->d[4], p->d[5]}, u[0], u[1],
                     PAIRS, &s) != FACET_OK)
        return 0;
    bool energy = m->shear == FACET_ENERGY_SAFE && m->masking == FACET_SMITH &&
                  m->fresnel.kind != FACET_FRESNEL_TABLE;
    for (size_t k = 0; k < PAIRS; k++) {
        double size = hypot(hypot(wi[0][k], wi[1][k]), wi[2][k]);
        bool fine = isfinite(size) && pdf[k] >= 0 && pdf[k] <= DBL_MAX && weight[k] >= 0 &&
                    weight[k] <= DBL_MAX;
        if (promised && sees(m, p->d[3][k], p->d[4][k], p->d[5][k])) fine = fine && pdf[k] > 0;
        if (promised && energy) fine = fine && weight[k] <= 1 + bound;
        if (!fine)
            check_fail(
                __FILE__, __LINE__,
                "wi {%g, %g, %g} weight %g pdf %g, %s\n    %s\n    wo {%.17g, %.17g, %.17g} u %.17g %.17g",
                wi[0][k], wi[1][k], wi[2][k], weight[k], pdf[k], facet_tier_name(tier),
                draw_text(m), p->d[3][k], p->d[4][k], p->d[5][k], u[0][k], u[1][k]);
    }
    return PAIRS;
}

TEST(samples_at_the_ends_of_every_range)
{
    static struct pairs p;
    struct rng rng;
    rng_seed(&rng, 32);
    size_t calls = 0;
    for (size_t round = draw_count(250); round--;) {
        facet_material m = any_material(&rng);
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (!brdf) continue;
        fill(&rng, &p);
        for (int t = 0; t < FACET_TIER_COUNT; t++)
            calls += draw_samples(&rng, brdf, &m, (facet_tier)t, &p);
        facet_brdf_destroy(brdf);
    }
    check_note("samples", (double)calls);
}
