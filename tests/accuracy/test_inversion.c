/*
 * |CDF(x(u)) - u| of every sampler: the direction it hands out goes back through the CDF of each
 * dimension, in quadruple precision, to the u it came from: within 1e-12 (precise) and 1e-6 (fast), all of them; in
 * precise, rounding h to doubles may come on top of a sheared surface (next to the pole of a narrow one, 1e-13).
 */
#include "check.h"
#include "draw.h"
#include "reference_samplers.h"

#include <math.h>
#include <stdio.h>

enum { N = 64 };

static const double alphas[] = {1e-3, 0.1, 0.4, 1, 4}, degrees[] = {0, 30, 60, 85, 89.9};
enum {
    ALPHAS = sizeof alphas / sizeof *alphas,
    VIEWS = sizeof degrees / sizeof *degrees,
    SHAPES = 3
};

/* Isotropic, anisotropic, sheared. */
static facet_material material(facet_ndf ndf, int shape, double alpha)
{
    facet_material m = {
        .ndf = ndf, .roughness = {.alpha_x = alpha, .alpha_y = alpha}, .fresnel = {.channels = 1}};
    if (shape == 1) m.roughness.alpha_y = 0.5 * alpha, m.roughness.rho = 0.7;
    if (shape == 2) m.roughness.slope_x = 0.3, m.roughness.slope_y = -0.2;
    return m;
}

static double asked_of(facet_tier tier)
{
    return tier == FACET_PRECISE ? 1e-12 : 1e-6;
}

/* Which u is an azimuth, if one is: just below a whole turn is just above 0. */
static int azimuth_of(facet_sampler sampler, facet_ndf ndf)
{
    if (sampler == FACET_SAMPLER_NDF || sampler == FACET_SAMPLER_COSINE) return 1;
    return ndf == FACET_GGX && (sampler == FACET_SAMPLER_CAPS || sampler == FACET_SAMPLER_BOUNDED)
               ? 0
               : -1;
}

static double difference(double u, quad found, bool is_azimuth)
{
    double d = fabs((double)(found - u));
    return is_azimuth && d > 0.5 ? fabs(1 - d) : d;
}

/* By how much the u of h change where its components do by their rounding to doubles. */
static double rounded_away(facet_sampler sampler, const facet_material *m, const double wo[3],
                           const quad wi[3], const quad h[3], const quad found[2])
{
    double sum = 0;
    for (int j = 0; j < 3; j++) {
        quad moved[2], n[3] = {h[0], h[1], h[2]};
        n[j] *= 1 + (quad)0x1p-53;
        reference_uniforms(sampler, m, wo, wi, n, moved);
        sum += fmax(fabs((double)(moved[0] - found[0])), fabs((double)(moved[1] - found[1])));
    }
    return sum;
}

/* The largest error of N draws; NaN as soon as one is. */
static double worst_of(const facet_material *m, facet_tier tier, facet_sampler sampler,
                       const double wo[3], struct rng *rng)
{
    static double o[3][N], u[2][N], wi[3][N], h[3][N];
    facet_brdf *brdf = NULL;
    const bool is_sheared = m->roughness.slope_x != 0 || m->roughness.slope_y != 0;
    double worst = 0;
    for (int k = 0; k < N; k++) {
        for (int j = 0; j < 3; j++) o[j][k] = wo[j];
        for (int j = 0; j < 2; j++)
            u[j][k] = tier == FACET_PRECISE ? rng_uniform(rng) : (float)rng_uniform(rng);
        if (tier != FACET_PRECISE)
            u[0][k] = fmin(u[0][k], 1 - 0x1p-24), u[1][k] = fmin(u[1][k], 1 - 0x1p-24);
    }
    facet_samples s = {.wi = {wi[0], wi[1], wi[2]}, .h = {h[0], h[1], h[2]}};
    CHECK_INT(facet_brdf_create(m, &brdf), FACET_OK);
    CHECK_INT(
        facet_sample(brdf, tier, sampler, (facet_vec3_in){o[0], o[1], o[2]}, u[0], u[1], N, &s),
        FACET_OK);
    facet_brdf_destroy(brdf);
    for (int k = 0; k < N; k++) {
        quad found[2], i[3] = {wi[0][k], wi[1][k], wi[2][k]}, n[3] = {h[0][k], h[1][k], h[2][k]};
        reference_uniforms(sampler, m, wo, i, n, found);
        double least = tier == FACET_PRECISE && is_sheared
                           ? rounded_away(sampler, m, wo, i, n, found)
                           : 0;
        for (int j = 0; j < 2; j++)
            worst = check_worse(
                worst, difference(u[j][k], found[j], j == azimuth_of(sampler, m->ndf)) - least);
    }
    return worst;
}

/* All shapes, alphas and angles of one sampler and distribution, sheared from before the mean facet and from behind. */
static void invert(facet_tier tier, facet_sampler sampler, facet_ndf ndf, size_t rounds,
                   struct rng *rng)
{
    enum { GRID = SHAPES * ALPHAS * VIEWS * 2 };
    char name[48];
    snprintf(name, sizeof name, "%s/%s", ndf == FACET_GGX ? "ggx" : "beckmann",
             facet_sampler_name(sampler));
    for (size_t k = 0; k < rounds * GRID; k++) {
        int shape = (int)(k % SHAPES), view = (int)(k / SHAPES % VIEWS);
        double theta = degrees[view] * acos(-1) / 180, alpha = alphas[k / SHAPES / VIEWS % ALPHAS];
        bool behind = shape == 2 && k / (GRID / 2) % 2;
        /* The mean slope rises toward azimuth -0.588. */
        const double azimuth = behind ? -0.7 : acos(-1) - 0.7;
        const double wo[3] = {sin(theta) * cos(azimuth), sin(theta) * sin(azimuth), cos(theta)};
        facet_material m = material(ndf, shape, alpha);
        /* Where Beckmann's tail is 0 in quadruple precision its CDF has no reference. */
        if (behind && ndf == FACET_BECKMANN && sampler == FACET_SAMPLER_SLOPE && alpha < 0.1)
            continue;
        double worst = worst_of(&m, tier, sampler, wo, rng);
        check_note(name, worst);
        if (!(worst <= asked_of(tier)))
            check_fail(__FILE__, __LINE__, "%s %s: off by %.3g at theta %g: %s", name,
                       facet_tier_name(tier), worst, degrees[view], draw_text(&m));
    }
}

static void invert_all(facet_tier tier, size_t rounds)
{
    struct rng rng;
    rng_seed(&rng, 61);
    for (int sampler = FACET_SAMPLER_CAPS; sampler <= FACET_SAMPLER_VCAVITY; sampler++)
        for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++)
            if (facet_sampler_serves((facet_sampler)sampler, (facet_ndf)ndf))
                invert(tier, (facet_sampler)sampler, (facet_ndf)ndf, rounds, &rng);
}

TEST(precise_samples_return_to_their_u)
{
    invert_all(FACET_PRECISE, draw_count(1));
}

TEST(fast_samples_return_to_their_u)
{
    invert_all(FACET_FAST, draw_count(1));
}
