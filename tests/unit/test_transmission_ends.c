/*
 * Rough dielectrics at the ends of the ranges: every tier gives numbers, none negative, no weight beyond 1 and
 * its rounding, no wi whose length is not 1.
 */
#include "check.h"
#include "draw.h"
#include "facet_transmission.h"

#include <float.h>
#include <math.h>
#include <stdio.h>

enum { EXTREMES = 19 }; /* more than a vector */

static void draw_extremes(struct rng *rng, double v[6][EXTREMES], double u[3][EXTREMES])
{
    for (int k = 0; k < EXTREMES; k++) {
        double a[3], b[3];
        draw_direction(rng, 0, a);
        draw_direction(rng, 0, b);
        int kind = (int)(rng_uniform(rng) * 6);
        for (int j = 0; j < 3; j++) v[j][k] = kind == 0 ? -b[j] : a[j], v[3 + j][k] = b[j];
        const double grazing[] = {0.6, -0.8, kind == 1 ? 0 : kind == 2 ? DBL_TRUE_MIN : -DBL_MIN};
        for (int j = 0; j < 3 && kind > 0 && kind < 4; j++)
            v[(kind == 2 ? 3 : 0) + j][k] = grazing[j];
        double turn = rng_uniform(rng) < 0.5 ? -1 : 1;
        for (int j = 0; j < 6; j++) v[j][k] *= turn;
        for (int j = 0; j < 3; j++)
            u[j][k] = rng_uniform(rng) < 0.1   ? 0
                      : rng_uniform(rng) < 0.1 ? nextafter(1, 0)
                                               : rng_uniform(rng);
    }
}

static void run_extreme(const facet_bsdf *bsdf, facet_tier tier, double v[6][EXTREMES],
                        double u[3][EXTREMES])
{
    enum { N = EXTREMES };
    const double rounding = tier < FACET_EXACT32 ? 2e-3 : tier == FACET_EXACT32 ? 1e-8 : 1e-12;
    double out[FACET_QUANTITY_COUNT][N], wi[3][N], weight[N], pdf[N], h[3][N];
    facet_outputs outputs = {0};
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) outputs.of[q][0] = out[q];
    facet_vec3_in i = {v[0], v[1], v[2]}, o = {v[3], v[4], v[5]};
    facet_samples samples = {
        .wi = {wi[0], wi[1], wi[2]}, .h = {h[0], h[1], h[2]}, .weight = {weight}, .pdf = pdf};
    CHECK_INT(facet_bsdf_eval(bsdf, tier, i, o, N, &outputs), FACET_OK);
    CHECK_INT(facet_bsdf_sample(bsdf, tier, FACET_SAMPLER_AUTO, o, u[0], u[1], u[2], N, &samples),
              FACET_OK);
    for (int k = 0; k < N; k++) {
        for (int q = 0; q < FACET_QUANTITY_COUNT; q++) CHECK(isfinite(out[q][k]) && out[q][k] >= 0);
        double size = sqrt(wi[0][k] * wi[0][k] + wi[1][k] * wi[1][k] + wi[2][k] * wi[2][k]);
        char name[64];
        snprintf(name, sizeof name, "%s: |wi| - 1", facet_tier_name(tier));
        check_note(name, fabs(size - 1));
        snprintf(name, sizeof name, "%s: weight - 1", facet_tier_name(tier));
        check_note(name, weight[k] - 1);
        CHECK(isfinite(pdf[k]) && pdf[k] >= 0 && weight[k] >= 0 && weight[k] <= 1 + rounding &&
              fabs(size - 1) < fmax(1e-9, rounding));
    }
}

TEST(extremes_are_numbers)
{
    static const double ends[] = {1e-3, 1 - 1e-12, 1 + 1e-12, 1 + DBL_EPSILON, 1 - DBL_EPSILON / 2,
                                  1e3,  0.125,     8,         63. / 64,        65. / 64,
                                  0.7,  1.5};
    enum { ENDS = sizeof ends / sizeof *ends };
    struct rng rng;
    size_t ran = 0, rounds = draw_count(4000);
    rng_seed(&rng, 5);
    for (size_t k = 0; k < rounds; k++) {
        facet_material m = {.ndf = rng_uniform(&rng) < 0.5 ? FACET_GGX : FACET_BECKMANN,
                            .fresnel = {.kind = FACET_FRESNEL_DIELECTRIC, .channels = 1}};
        m.fresnel.eta[0] = ends[(size_t)(rng_uniform(&rng) * ENDS)];
        m.masking = rng_uniform(&rng) < 0.5 ? FACET_SMITH : FACET_SMITH_UNCORRELATED;
        draw_roughness(&rng, &draw_everywhere, &m.roughness);
        facet_bsdf *bsdf = NULL;
        facet_status status = facet_bsdf_create(&m, FACET_IMPORTANCE, &bsdf);
        if (status == FACET_UNSUPPORTED && m.ndf == FACET_BECKMANN) continue; /* leans too much */
        CHECK_INT(status, FACET_OK);
        double v[6][EXTREMES], u[3][EXTREMES];
        draw_extremes(&rng, v, u);
        for (int t = 0; t < FACET_TIER_COUNT && !status; t++)
            run_extreme(bsdf, (facet_tier)t, v, u);
        ran += !status;
        facet_bsdf_destroy(bsdf);
    }
    check_note("of all", (double)ran / (double)rounds);
    CHECK(ran * 2 > rounds);
}
