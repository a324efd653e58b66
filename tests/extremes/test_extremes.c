/* Whatever facet.h allows in: no NaN, nothing negative, nothing infinite that should not be. */
#include "../accuracy/reference.h"
#include "check.h"
#include "draw.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { N = 24 };

static const char *const names[] = {
#define QUANTITY(id, name, coloured, doc) name,
#include "quantities.def"
#undef QUANTITY
};

static facet_material any_material(struct rng *rng)
{
    facet_material m = {.ndf = rng_uniform(rng) < 0.5 ? FACET_GGX : FACET_BECKMANN};
    m.masking = (facet_masking)(int)(rng_uniform(rng) * FACET_MASKING_COUNT);
    if (m.masking <= FACET_SMITH_UNCORRELATED)
        m.shear = rng_uniform(rng) < 0.5 ? FACET_ENERGY_SAFE : FACET_THESIS;
    draw_roughness(rng, &draw_everywhere, &m.roughness);
    if (rng_uniform(rng) < 0.2) m.roughness.alpha_x = FACET_ALPHA_MIN;
    if (rng_uniform(rng) < 0.2) m.roughness.alpha_y = FACET_ALPHA_MAX;
    if (rng_uniform(rng) < 0.1) m.roughness.rho = -FACET_RHO_MAX;
    if (rng_uniform(rng) < 0.1) m.roughness.slope_x = -FACET_MEAN_SLOPE_MAX;
    draw_fresnel(rng, (facet_fresnel_kind)(int)(rng_uniform(rng) * FACET_FRESNEL_COUNT),
                 &m.fresnel);
    return m;
}

static void hard_pair(struct rng *rng, const facet_material *m, size_t k, double wi[3],
                      double wo[3])
{
    draw_pair(rng, &draw_everywhere, m, wi, wo);
    switch (k) {
    case 0: memcpy(wi, wo, 3 * sizeof *wi); break; /* equal */
    case 1:                                        /* opposite */
        for (int j = 0; j < 3; j++) wi[j] = -wo[j];
        break;
    case 2: /* both on the horizon */
        wi[0] = -(wo[0] = 1), wi[1] = wo[1] = wi[2] = wo[2] = 0;
        break;
    case 3: /* both on the pole */ wi[0] = wo[0] = wi[1] = wo[1] = 0, wi[2] = wo[2] = 1; break;
    case 4: wo[2] = 1e-30; break;
    case 5: wi[2] = 5e-324; break;
    case 6: /* both below */ wi[0] = wo[0] = wi[1] = wo[1] = 0, wi[2] = wo[2] = -1; break;
    default: break;
    }
}

/* Largest true value that must come out finite: float overflows past 3e38. */
static double finite_up_to(facet_tier tier)
{
    return tier == FACET_PRECISE ? 1e300 : 1e37;
}

TEST(evaluation_stays_finite)
{
    struct rng rng;
    rng_seed(&rng, 21);
    for (size_t round = draw_count(2000); round--;) {
        facet_material m = any_material(&rng);
        facet_tier tier = (facet_tier)(round % FACET_TIER_COUNT);
        static double i[3][N], o[3][N], y[FACET_QUANTITY_COUNT][N];
        for (size_t k = 0; k < N; k++) {
            double wi[3], wo[3];
            hard_pair(&rng, &m, k, wi, wo);
            for (int j = 0; j < 3; j++) {
                i[j][k] = wi[j];
                o[j][k] = wo[j];
            }
        }
        facet_brdf *brdf = NULL;
        facet_outputs outputs;
        memset(&outputs, 0, sizeof outputs);
        for (int q = 0; q < FACET_QUANTITY_COUNT; q++) outputs.of[q][0] = y[q];
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (!brdf) continue;
        CHECK_INT(facet_eval(brdf, tier, (facet_vec3_in){i[0], i[1], i[2]},
                             (facet_vec3_in){o[0], o[1], o[2]}, N, &outputs),
                  FACET_OK);
        facet_brdf_destroy(brdf);
        for (size_t k = 0; k < N; k++) {
            const double wi[3] = {i[0][k], i[1][k], i[2][k]}, wo[3] = {o[0][k], o[1][k], o[2][k]};
            struct reference x;
            bool known = false;
            for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
                double got = y[q][k];
                if (got >= 0 && got <= 1e300) continue;
                if (!known) reference_eval(&m, wi, wo, &x);
                known = true;
                if (got > 0 && x.of[q][0] > finite_up_to(tier)) continue;
                if (got > 0 && x.condition > 1e6) continue;
                check_fail(__FILE__, __LINE__,
                           "%s is %g, not %g, %s\n    %s\n    wi {%.17g, %.17g, %.17g} wo {%.17g, "
                           "%.17g, %.17g}",
                           names[q], got, (double)x.of[q][0], facet_tier_name(tier), draw_text(&m),
                           wi[0], wi[1], wi[2], wo[0], wo[1], wo[2]);
            }
        }
    }
}

/*
 * Whether the model itself gives so large a weight as no double holds: the thesis's shear divides by the
 * sigma of wi, which behind a sheared Beckmann surface is as little as exp(-v^2), or by a difference.
 */
static bool weight_has_no_bound(const facet_material *m, const double wi[3], const double wo[3])
{
    struct reference x;
    if (m->shear != FACET_THESIS) return false;
    if (m->masking != FACET_SMITH_UNCORRELATED) {
        reference_eval(m, wi, wo, &x);
        return x.condition > 1e6;
    }
    return wi[2] > 1e290 * reference_sigma(m, wi);
}

/* Every u of [0, 1), its ends included, gives a unit direction and a sane weight. */
TEST(samples_stay_finite)
{
    static const double ends[] = {0, 0x1p-1074, 0x1p-53, 0.25, 0.5, 1 - 0x1p-53};
    struct rng rng;
    rng_seed(&rng, 22);
    for (size_t round = draw_count(4000); round--;) {
        facet_material m = any_material(&rng);
        facet_tier tier = (facet_tier)(round % FACET_TIER_COUNT);
        static double o[3][N], u1[N], u2[N], wi[3][N], h[3][N], weight[N], pdf[N];
        for (size_t k = 0; k < N; k++) {
            double a[3], b[3];
            hard_pair(&rng, &m, k, a, b);
            for (int j = 0; j < 3; j++) o[j][k] = b[j];
            u1[k] = rng_uniform(&rng) < 0.5 ? rng_uniform(&rng)
                                            : ends[(int)(6 * rng_uniform(&rng))];
            u2[k] = rng_uniform(&rng) < 0.5 ? rng_uniform(&rng)
                                            : ends[(int)(6 * rng_uniform(&rng))];
        }
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (!brdf) continue;
        double bound = 1; /* where nothing is promised, finite must do */
        facet_sampler sampler;
        do sampler = (facet_sampler)(int)(rng_uniform(&rng) * FACET_SAMPLER_COUNT);
        while (!facet_sampler_serves(sampler, m.ndf));
        if (!facet_sample_bound(brdf, tier, sampler, 0, &bound)) bound = 1;
        /* The densities of other than visible normals may be next to 0 where fr is not. */
        bool is_bounded = sampler < FACET_SAMPLER_NDF;
        facet_samples s = {{wi[0], wi[1], wi[2]}, {h[0], h[1], h[2]}, {weight, NULL, NULL}, pdf};
        CHECK_INT(
            facet_sample(brdf, tier, sampler, (facet_vec3_in){o[0], o[1], o[2]}, u1, u2, N, &s),
            FACET_OK);
        facet_brdf_destroy(brdf);
        for (size_t k = 0; k < N; k++) {
            double size = hypot(hypot(wi[0][k], wi[1][k]), wi[2][k]);
            double hsize = hypot(hypot(h[0][k], h[1][k]), h[2][k]);
            double osize = hypot(hypot(o[0][k], o[1][k]), o[2][k]); /* 1, but for the hard ones */
            if (sampler == FACET_SAMPLER_COSINE) osize = 1;
            bool sane = fabs(size - osize) < 1e-12 + 4 * bound &&
                        fabs(hsize - 1) < 1e-12 + 4 * bound &&
                        (sampler == FACET_SAMPLER_COSINE || h[2][k] >= 0) && weight[k] >= 0 &&
                        weight[k] <= DBL_MAX && pdf[k] >= 0 && !(wi[2][k] <= 0 && weight[k] != 0);
            const double i[3] = {wi[0][k], wi[1][k], wi[2][k]}, wo[3] = {o[0][k], o[1][k], o[2][k]};
            sane &= !is_bounded || weight[k] <= 1e300 || weight_has_no_bound(&m, i, wo);
            if (sane) continue;
            check_fail(
                __FILE__, __LINE__,
                "%s: wi {%g, %g, %g} h {%g, %g, %g} weight %g pdf %g, %s\n    %s\n    wo {%.17g, "
                "%.17g, %.17g} u %.17g %.17g",
                facet_sampler_name(sampler), wi[0][k], wi[1][k], wi[2][k], h[0][k], h[1][k],
                h[2][k], weight[k], pdf[k], facet_tier_name(tier), draw_text(&m), o[0][k], o[1][k],
                o[2][k], u1[k], u2[k]);
        }
    }
}

/*
 * The uncorrelated weight of the thesis's shear is z_i / sigma_i, here exp(41000): no double holds it, and it is the
 * largest one times F.
 */
TEST(a_weight_without_bound_is_the_largest_number)
{
    facet_material m = {.ndf = FACET_BECKMANN,
                        .masking = FACET_SMITH_UNCORRELATED,
                        .shear = FACET_THESIS,
                        .roughness = {.alpha_x = 4938.7212706640412,
                                      .alpha_y = 0.54222031831995121,
                                      .slope_x = -1e6},
                        .fresnel = {.kind = FACET_FRESNEL_SCHLICK, .channels = 1, .f0 = {0.5}}};
    const double o[3] = {-0.20290501415729523, 0.9791983962059021, 1.7307735689087167e-08},
                 u1 = 0x1p-53, u2 = 0.30092207204344767;
    double wi[3], h[3], weight, pdf;
    facet_samples s = {
        {&wi[0], &wi[1], &wi[2]}, {&h[0], &h[1], &h[2]}, {&weight, NULL, NULL}, &pdf};
    facet_brdf *brdf = NULL;
    CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
    for (int tier = 0; brdf && tier < FACET_TIER_COUNT; tier++) {
        CHECK_INT(facet_sample(brdf, (facet_tier)tier, FACET_SAMPLER_AUTO,
                               (facet_vec3_in){&o[0], &o[1], &o[2]}, &u1, &u2, 1, &s),
                  FACET_OK);
        CHECK(wi[2] > 0 && weight_has_no_bound(&m, wi, o));
        CHECK(weight > 0.25 * DBL_MAX && weight <= DBL_MAX);
    }
    facet_brdf_destroy(brdf);
}

/* wo should be of length 1; of any other length nothing is promised but numbers. */
TEST(samples_of_any_length_are_numbers)
{
    static const double lengths[] = {0, 1e-30, 1e-3, 0.5, 0.999, 1.001, 2, 30};
    enum { LENGTHS = sizeof lengths / sizeof *lengths };
    struct rng rng;
    rng_seed(&rng, 23);
    for (size_t round = draw_count(4000); round--;) {
        facet_material m = any_material(&rng);
        facet_tier tier = (facet_tier)(round % FACET_TIER_COUNT);
        static double o[3][N], u1[N], u2[N], wi[3][N], h[3][N], weight[N], pdf[N], again[N];
        if (round % 2) m.ndf = FACET_GGX, m.roughness.slope_x = m.roughness.slope_y = 0;
        if (round % 4 == 1)
            m.roughness.alpha_y = m.roughness.alpha_x, m.roughness.rho = 0; /* the tighter cap */
        for (size_t k = 0; k < N; k++) {
            double a[3], b[3];
            hard_pair(&rng, &m, k, a, b);
            for (int j = 0; j < 3; j++) o[j][k] = lengths[k % LENGTHS] * b[j];
            u1[k] = rng_uniform(&rng), u2[k] = rng_uniform(&rng);
        }
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        for (int s = 0; brdf && s < FACET_SAMPLER_TABLE; s++) {
            if (!facet_sampler_serves((facet_sampler)s, m.ndf)) continue;
            facet_samples out = {
                {wi[0], wi[1], wi[2]}, {h[0], h[1], h[2]}, {weight, NULL, NULL}, pdf};
            const facet_vec3_in wo = {o[0], o[1], o[2]}, drawn = {wi[0], wi[1], wi[2]};
            CHECK_INT(facet_sample(brdf, tier, (facet_sampler)s, wo, u1, u2, N, &out), FACET_OK);
            CHECK_INT(facet_pdf(brdf, tier, (facet_sampler)s, drawn, wo, N, again), FACET_OK);
            for (size_t k = 0; k < N; k++)
                if (isnan(wi[0][k] + wi[1][k] + wi[2][k]) || isnan(h[0][k] + h[1][k] + h[2][k]) ||
                    !(weight[k] >= 0) || !(pdf[k] >= 0) || !(again[k] >= 0))
                    check_fail(
                        __FILE__, __LINE__,
                        "%s: wi {%g, %g, %g} h {%g, %g, %g} weight %g pdf %g %g, %s\n    %s\n    wo {%.17g, %.17g, %.17g} u %.17g %.17g",
                        facet_sampler_name((facet_sampler)s), wi[0][k], wi[1][k], wi[2][k], h[0][k],
                        h[1][k], h[2][k], weight[k], pdf[k], again[k], facet_tier_name(tier),
                        draw_text(&m), o[0][k], o[1][k], o[2][k], u1[k], u2[k]);
        }
        facet_brdf_destroy(brdf);
    }
}

/* What is refused is refused at creation, by its own status, and nothing is made. */
TEST(materials_out_of_range_are_refused)
{
    static const double nan = NAN;
    const struct {
        facet_roughness r;
        facet_status status;
    } cases[] = {
        {{0, 1, 0, 0, 0, {0, 0, 0}}, FACET_BAD_ALPHA},
        {{1, -1, 0, 0, 0, {0, 0, 0}}, FACET_BAD_ALPHA},
        {{nan, 1, 0, 0, 0, {0, 0, 0}}, FACET_BAD_ALPHA},
        {{1, INFINITY, 0, 0, 0, {0, 0, 0}}, FACET_BAD_ALPHA},
        {{0.99e-8, 1, 0, 0, 0, {0, 0, 0}}, FACET_BAD_ALPHA},
        {{1, 1.01e4, 0, 0, 0, {0, 0, 0}}, FACET_BAD_ALPHA},
        {{1, 1, 1, 0, 0, {0, 0, 0}}, FACET_BAD_RHO},
        {{1, 1, -1, 0, 0, {0, 0, 0}}, FACET_BAD_RHO},
        {{1, 1, nan, 0, 0, {0, 0, 0}}, FACET_BAD_RHO},
        {{1, 1, 0, 1.1e6, 0, {0, 0, 0}}, FACET_BAD_MEAN_SLOPE},
        {{1, 1, 0, 0, nan, {0, 0, 0}}, FACET_BAD_MEAN_SLOPE},
        {{1, 1, 0.5, 0, 0, {1e-15, 0, 0}}, FACET_BAD_ALPHA},
        {{1, 1, 0.5, 0, 0, {0, nan, 0}}, FACET_BAD_ALPHA},
        {{1, 1, 0.5, 0, 0, {0, 0, -1e-15}}, FACET_BAD_RHO},
        {{1, 1, 0, 0, 0, {0, 0, 1e-300}}, FACET_BAD_RHO},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        facet_material m = {.roughness = cases[k].r, .fresnel = {.channels = 1}};
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), cases[k].status);
        CHECK(!brdf);
    }
    facet_material thesis = {.roughness = {.alpha_x = 1, .alpha_y = 1}, .fresnel = {.channels = 1}};
    thesis.masking = FACET_VGROOVE;
    thesis.shear = FACET_THESIS;
    facet_brdf *brdf = NULL;
    CHECK_INT(facet_brdf_create(&thesis, &brdf), FACET_UNSUPPORTED);
    CHECK(!brdf);
    facet_brdf_destroy(NULL);
}
