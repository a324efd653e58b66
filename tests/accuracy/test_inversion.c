/*
 * |CDF(x(u)) - u| of every sampler: the direction it hands out goes back through the CDF of each
 * dimension, in quadruple precision, to the u it came from: within 1e-12 (precise, all of them) and
 * 1e-6 (fast, but for a share of each sampler's that hangs on a float's last bits).
 */
#include "check.h"
#include "draw.h"
#include "reference_samplers.h"

#include <math.h>
#include <stdio.h>

enum { N = 64 };

/*
 * For each tier and sampler: what is asked, what share of draws may pass it, and what none of these may.
 * Of forty times as many, fast caps pass 1e-6 in 5e-4 (the worst by 1.9e-5), ndf in 6e-5 (9e-6) and
 * vcavity in 3e-5 (2.3e-6).
 */
static const struct limits {
    double asked, share, most;
} precise_limits = {1e-12, 0, 1e-12}, fast_limits[FACET_SAMPLER_COUNT] = {
    [FACET_SAMPLER_CAPS] = {1e-6, 1e-3, 4e-6}, [FACET_SAMPLER_BOUNDED] = {1e-6, 1e-3, 4e-6},
    [FACET_SAMPLER_SLOPE] = {1e-6, 0, 1e-6},   [FACET_SAMPLER_NDF] = {1e-6, 1e-4, 4e-6},
    [FACET_SAMPLER_COSINE] = {1e-6, 0, 1e-6},  [FACET_SAMPLER_VCAVITY] = {1e-6, 1e-4, 4e-6},
};

static const double alphas[] = {1e-3, 0.1, 0.4, 1, 4}, degrees[] = {0, 30, 60, 85, 89.9};
enum { ALPHAS = sizeof alphas / sizeof *alphas, VIEWS = sizeof degrees / sizeof *degrees, SHAPES = 3 };

/* Isotropic, anisotropic, sheared. */
static facet_material material(facet_ndf ndf, int shape, double alpha)
{
    facet_material m = {.ndf = ndf, .roughness = {.alpha_x = alpha, .alpha_y = alpha}, .fresnel = {.channels = 1}};
    if (shape == 1) m.roughness.alpha_y = 0.5 * alpha, m.roughness.rho = 0.7;
    if (shape == 2) m.roughness.slope_x = 0.3, m.roughness.slope_y = -0.2;
    return m;
}

static struct limits limits_of(facet_tier tier, facet_sampler sampler)
{
    return tier == FACET_PRECISE ? precise_limits : fast_limits[sampler];
}

/* Which u is an azimuth, if one is: just below a whole turn is just above 0. */
static int azimuth_of(facet_sampler sampler, facet_ndf ndf)
{
    if (sampler == FACET_SAMPLER_NDF || sampler == FACET_SAMPLER_COSINE) return 1;
    return ndf == FACET_GGX && (sampler == FACET_SAMPLER_CAPS || sampler == FACET_SAMPLER_BOUNDED) ? 0 : -1;
}

static double difference(double u, quad found, bool is_azimuth)
{
    double d = fabs((double)(found - u));
    return is_azimuth && d > 0.5 ? fabs(1 - d) : d;
}

/*
 * The largest error, and of how many it passes what is asked: an azimuth next to its pole, the rim of a
 * cap opposite wo (where m = C + k' is short) and a slope about a mean one hang on the last bits.
 */
struct worst {
    double error; /* NaN as soon as one is */
    size_t crowded;
};

static struct worst worst_of(const facet_material *m, facet_tier tier, facet_sampler sampler, const double wo[3],
                             double asked, struct rng *rng)
{
    static double o[3][N], u[2][N], wi[3][N], h[3][N];
    facet_brdf *brdf = NULL;
    struct worst worst = {0, 0};
    for (int k = 0; k < N; k++) {
        for (int j = 0; j < 3; j++) o[j][k] = wo[j];
        for (int j = 0; j < 2; j++) u[j][k] = tier == FACET_PRECISE ? rng_uniform(rng) : (float)rng_uniform(rng);
        if (tier != FACET_PRECISE) u[0][k] = fmin(u[0][k], 1 - 0x1p-24), u[1][k] = fmin(u[1][k], 1 - 0x1p-24);
    }
    facet_samples s = {.wi = {wi[0], wi[1], wi[2]}, .h = {h[0], h[1], h[2]}};
    CHECK_INT(facet_brdf_create(m, &brdf), FACET_OK);
    CHECK_INT(facet_sample(brdf, tier, sampler, (facet_vec3_in){o[0], o[1], o[2]}, u[0], u[1], N, &s), FACET_OK);
    facet_brdf_destroy(brdf);
    for (int k = 0; k < N; k++) {
        bool beyond = false;
        quad found[2], i[3] = {wi[0][k], wi[1][k], wi[2][k]}, n[3] = {h[0][k], h[1][k], h[2][k]};
        reference_uniforms(sampler, m, wo, i, n, found);
        for (int j = 0; j < 2; j++) {
            double error = difference(u[j][k], found[j], j == azimuth_of(sampler, m->ndf));
            worst.error = check_worse(worst.error, error);
            beyond |= !(error <= asked);
        }
        worst.crowded += beyond;
    }
    return worst;
}

/* A float's h tells slopes about the mean one apart to 6e-8 slope/alpha only. */
static bool resolves(facet_tier tier, int shape, double alpha)
{
    return tier == FACET_PRECISE || shape != 2 || alpha >= 0.1;
}

/* All shapes, alphas and angles of one sampler and distribution. */
static void invert(facet_tier tier, facet_sampler sampler, facet_ndf ndf, size_t rounds, struct rng *rng)
{
    enum { GRID = SHAPES * ALPHAS * VIEWS };
    struct limits limits = limits_of(tier, sampler);
    size_t crowded = 0, drawn = 0;
    char name[48], share[64];
    snprintf(name, sizeof name, "%s/%s", ndf == FACET_GGX ? "ggx" : "beckmann", facet_sampler_name(sampler));
    for (size_t k = 0; k < rounds * GRID; k++) {
        int shape = (int)(k % SHAPES), view = (int)(k / SHAPES % VIEWS);
        double alpha = alphas[k / SHAPES / VIEWS % ALPHAS], theta = degrees[view] * acos(-1) / 180;
        /* Before the mean facet: its slopes rise toward azimuth -0.588. */
        const double wo[3] = {-sin(theta) * cos(0.7), sin(theta) * sin(0.7), cos(theta)};
        facet_material m = material(ndf, shape, alpha);
        if (!resolves(tier, shape, alpha)) continue;
        struct worst w = worst_of(&m, tier, sampler, wo, limits.asked, rng);
        check_note(name, w.error);
        crowded += w.crowded;
        drawn += N;
        if (!(w.error <= limits.most))
            check_fail(__FILE__, __LINE__, "%s %s: off by %.3g at theta %g: %s", name, facet_tier_name(tier),
                       w.error, degrees[view], draw_text(&m));
    }
    snprintf(share, sizeof share, "%s beyond", name);
    if (crowded) check_note(share, (double)crowded / (double)drawn);
    CHECK(drawn >= rounds * GRID * N / 2);
    double expected = limits.share * (double)drawn; /* and three deviations of such a count */
    if (!((double)crowded <= expected + 3 * sqrt(expected)))
        check_fail(__FILE__, __LINE__, "%s %s: %zu of %zu are beyond %g", name, facet_tier_name(tier), crowded, drawn, limits.asked);
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
