/* The calls of facet.h agree with each other: on floats and on doubles, in every tier. */
#include "check.h"
#include "facet.h"
#include "rng.h"

#include <math.h>

enum { N = 100 }; /* more than a vector, so that kernels run in place as well */

static void draw_wo(struct rng *rng, float wo[3][N])
{
    for (int k = 0; k < N; k++) {
        double z = 0.05 + 0.95 * rng_uniform(rng), phi = 6.28 * rng_uniform(rng),
               s = sqrt(1 - z * z);
        wo[0][k] = (float)(s * cos(phi));
        wo[1][k] = (float)(s * sin(phi));
        wo[2][k] = (float)z;
    }
}

static void widen(const float *from, double *to)
{
    for (int k = 0; k < N; k++) to[k] = from[k];
}

static void compare(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler, struct rng *rng)
{
    static float wo[3][N], u[2][N], wi[3][N], weight[N], pdf[N];
    static double o[3][N], v[2][N], i[3][N], w[N], p[N];
    draw_wo(rng, wo);
    for (int j = 0; j < 3; j++) widen(wo[j], o[j]);
    for (int j = 0; j < 2; j++) {
        for (int k = 0; k < N; k++) u[j][k] = (float)(0.01 + 0.98 * rng_uniform(rng));
        widen(u[j], v[j]);
    }
    facet_samples_float floats = {.wi = {wi[0], wi[1], wi[2]}, .weight = {weight}, .pdf = pdf};
    facet_samples doubles = {.wi = {i[0], i[1], i[2]}, .weight = {w}, .pdf = p};
    CHECK_INT(facet_sample_float(brdf, tier, sampler, (facet_vec3_in_float){wo[0], wo[1], wo[2]},
                                 u[0], u[1], N, &floats),
              FACET_OK);
    CHECK_INT(facet_sample(brdf, tier, sampler, (facet_vec3_in){o[0], o[1], o[2]}, v[0], v[1], N,
                           &doubles),
              FACET_OK);
    /* Away from the ends of u and from grazing views: twice what the loosest tier errs. */
    const double allowed = tier == FACET_DRAFT ? 1e-2 : 1e-3;
    for (int k = 0; k < N; k++) {
        for (int j = 0; j < 3; j++) CHECK(fabs(wi[j][k] - i[j][k]) <= allowed);
        if (fabs(i[2][k]) < 0.02) continue; /* either side of the horizon */
        CHECK(fabs(weight[k] - w[k]) <= allowed * (1 + w[k]));
        CHECK(fabs(pdf[k] - p[k]) <= 10 * allowed * p[k]);
    }
}

TEST(samples_on_floats_are_those_on_doubles)
{
    struct rng rng;
    rng_seed(&rng, 91);
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
        facet_material m = {.ndf = (facet_ndf)ndf,
                            .roughness = {.alpha_x = 0.4, .alpha_y = 0.3},
                            .fresnel = {.kind = FACET_FRESNEL_IDEAL, .channels = 1}};
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        for (int s = FACET_SAMPLER_AUTO; brdf && s < FACET_SAMPLER_COUNT; s++)
            for (int tier = 0;
                 facet_sampler_serves((facet_sampler)s, (facet_ndf)ndf) && tier < FACET_TIER_COUNT;
                 tier++)
                compare(brdf, (facet_tier)tier, (facet_sampler)s, &rng);
        facet_brdf_destroy(brdf);
    }
}

/* A tier without the thesis's forms takes the next one, never another model. */
TEST(the_thesis_is_never_replaced)
{
    static float wi[3][N], wo[3][N];
    static double i[3][N], o[3][N], exact[N], fr[N];
    struct rng rng;
    rng_seed(&rng, 92);
    for (int masking = FACET_SMITH; masking <= FACET_SMITH_UNCORRELATED; masking++)
        for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
            facet_material m = {
                .ndf = (facet_ndf)ndf,
                .masking = (facet_masking)masking,
                .shear = FACET_THESIS,
                .roughness = {.alpha_x = 0.4, .alpha_y = 0.3, .slope_x = 0.3, .slope_y = -0.2},
                .fresnel = {.kind = FACET_FRESNEL_IDEAL, .channels = 1}};
            facet_brdf *brdf = NULL;
            CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
            draw_wo(&rng, wi);
            draw_wo(&rng, wo);
            for (int j = 0; j < 3; j++) widen(wi[j], i[j]), widen(wo[j], o[j]);
            facet_vec3_in in = {i[0], i[1], i[2]}, out = {o[0], o[1], o[2]};
            for (int tier = FACET_PRECISE; brdf && tier >= 0; tier--) {
                facet_outputs outputs = {0};
                outputs.of[FACET_FR][0] = tier == FACET_PRECISE ? exact : fr;
                CHECK_INT(facet_eval(brdf, (facet_tier)tier, in, out, N, &outputs), FACET_OK);
                for (int k = 0; tier < FACET_PRECISE && k < N; k++)
                    CHECK_REL(fr[k], exact[k], 1e-6, 0);
            }
            facet_brdf_destroy(brdf);
        }
}

/* fr and pdf of one call, which may be one loop, and of a call each. */
static void compare_joint(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                          struct rng *rng)
{
    static float i[3][N], o[3][N], fr[2][N], pdf[2][N];
    static double di[3][N], d_o[3][N], d_fr[2][N], d_pdf[2][N];
    draw_wo(rng, i), draw_wo(rng, o);
    for (int k = 0; k < N; k += 3) i[2][k] = -i[2][k];
    for (int j = 0; j < 3; j++) widen(i[j], di[j]), widen(o[j], d_o[j]);
    const facet_vec3_in_float wi = {i[0], i[1], i[2]}, wo = {o[0], o[1], o[2]};
    const facet_vec3_in dwi = {di[0], di[1], di[2]}, dwo = {d_o[0], d_o[1], d_o[2]};
    const facet_outputs_float both = {.of = {[FACET_FR] = {fr[0]}, [FACET_PDF] = {pdf[0]}}},
                              alone = {.of = {[FACET_FR] = {fr[1]}}};
    const facet_outputs d_both = {.of = {[FACET_FR] = {d_fr[0]}, [FACET_PDF] = {d_pdf[0]}}},
                        d_alone = {.of = {[FACET_FR] = {d_fr[1]}}};
    CHECK_INT(facet_eval_sampled_float(brdf, tier, sampler, wi, wo, N, &both), FACET_OK);
    CHECK_INT(facet_eval_float(brdf, tier, wi, wo, N, &alone), FACET_OK);
    CHECK_INT(facet_pdf_float(brdf, tier, sampler, wi, wo, N, pdf[1]), FACET_OK);
    CHECK_INT(facet_eval_sampled(brdf, tier, sampler, dwi, dwo, N, &d_both), FACET_OK);
    CHECK_INT(facet_eval(brdf, tier, dwi, dwo, N, &d_alone), FACET_OK);
    CHECK_INT(facet_pdf(brdf, tier, sampler, dwi, dwo, N, d_pdf[1]), FACET_OK);
    for (int k = 0; k < N; k++) {
        CHECK(fr[0][k] == fr[1][k] && pdf[0][k] == pdf[1][k]);
        CHECK(d_fr[0][k] == d_fr[1][k] && d_pdf[0][k] == d_pdf[1][k]);
    }
}

TEST(a_pdf_beside_fr_is_the_pdf_alone)
{
    static const double shapes[3][2] = {{0.4, 0}, {0.3, 0}, {0.3, 0.2}}; /* alpha_y, slope_x */
    struct rng rng;
    rng_seed(&rng, 93);
    for (int k = 0; k < 6; k++) {
        facet_material m = {
            .ndf = k < 3 ? FACET_GGX : FACET_BECKMANN,
            .roughness = {.alpha_x = 0.4, .alpha_y = shapes[k % 3][0], .slope_x = shapes[k % 3][1]},
            .fresnel = {.kind = FACET_FRESNEL_IDEAL, .channels = 1}};
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        for (int s = FACET_SAMPLER_AUTO; brdf && s < FACET_SAMPLER_COUNT; s++)
            for (int tier = 0;
                 facet_sampler_serves((facet_sampler)s, m.ndf) && tier < FACET_TIER_COUNT; tier++)
                compare_joint(brdf, (facet_tier)tier, (facet_sampler)s, &rng);
        facet_brdf_destroy(brdf);
    }
}

/* AUTO is the sampler that it stands for, in every call. */
TEST(auto_is_what_it_stands_for)
{
    static const struct {
        facet_material m;
        facet_sampler sampler;
    } cases[] = {
        {{.ndf = FACET_GGX, .roughness = {.alpha_x = 0.1, .alpha_y = 0.1}}, FACET_SAMPLER_BOUNDED},
        {{.ndf = FACET_GGX, .roughness = {.alpha_x = 0.09, .alpha_y = 0.5}}, FACET_SAMPLER_CAPS},
        {{.ndf = FACET_GGX, .roughness = {.alpha_x = 1, .alpha_y = 1, .slope_y = 0.1}},
         FACET_SAMPLER_CAPS},
        {{.ndf = FACET_BECKMANN, .roughness = {.alpha_x = 0.4, .alpha_y = 0.4}},
         FACET_SAMPLER_SLOPE},
        {{.ndf = FACET_BECKMANN,
          .roughness = {.alpha_x = 0.4, .alpha_y = 0.4},
          .masking = FACET_VGROOVE},
         FACET_SAMPLER_VCAVITY},
    };
    static float o[3][N], u[2][N], wi[2][3][N], weight[2][N], pdf[4][N];
    struct rng rng;
    rng_seed(&rng, 94);
    draw_wo(&rng, o);
    const facet_vec3_in_float wo = {o[0], o[1], o[2]};
    for (int k = 0; k < N; k++) u[0][k] = (float)k / N, u[1][k] = (float)(N - k) / (2 * N);
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        facet_material m = cases[c].m;
        m.fresnel.channels = 1;
        CHECK_INT(facet_sampler_auto(&m), cases[c].sampler);
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        double bound[2][2];
        for (int j = 0; brdf && j < 2; j++) {
            facet_sampler sampler = j ? cases[c].sampler : FACET_SAMPLER_AUTO;
            const facet_samples_float out = {
                .wi = {wi[j][0], wi[j][1], wi[j][2]}, .weight = {weight[j]}, .pdf = pdf[j]};
            CHECK_INT(facet_sample_float(brdf, FACET_FAST, sampler, wo, u[0], u[1], N, &out),
                      FACET_OK);
            CHECK_INT(facet_pdf_float(brdf, FACET_FAST, sampler,
                                      (facet_vec3_in_float){wi[0][0], wi[0][1], wi[0][2]}, wo, N,
                                      pdf[2 + j]),
                      FACET_OK);
            CHECK(facet_pdf_bound(brdf, FACET_FAST, sampler, 0, &bound[j][0]));
            CHECK(facet_sample_bound(brdf, FACET_FAST, sampler, 0, &bound[j][1]));
        }
        for (int k = 0; brdf && k < N; k++) {
            CHECK(wi[0][2][k] == wi[1][2][k] && weight[0][k] == weight[1][k]);
            CHECK(pdf[0][k] == pdf[1][k] && pdf[2][k] == pdf[3][k]);
        }
        CHECK(bound[0][0] == bound[1][0] && bound[0][1] == bound[1][1]);
        facet_brdf_destroy(brdf);
    }
}
