/* Fits of sources whose answer is known in closed form. */
#include "check.h"
#include "closed.h"
#include "facet_fit.h"
#include "fit_backscatter.h"
#include "fit_pairs.h"
#include "slope_table.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

/* ---- Extraction ------------------------------------------------------------------------- */

TEST(power_iteration_is_exact_at_the_nodes)
{
    static const double alphas[] = {.01, .02, .05, .15};
    for (size_t k = 0; k < 4; k++) {
        struct closed closed = {FACET_BECKMANN, alphas[k], {.7, .7, .7}, k % 2, 0, 0, 0, 0};
        facet_fit_source source = closed_source(&closed);
        facet_fit_convention convention = k % 2 ? FACET_FIT_MASKING_ONLY : FACET_FIT_CORRELATED;
        struct fit_density density;
        double median, worst = 0, rms;
        CHECK_INT(facet_fit_median_slope(&source, &median), FACET_OK);
        CHECK_REL(median, alphas[k] * sqrt(log(2)), .05, 0);
        if (facet_fit_density_create(&source, FACET_SMITH, convention, 1.5 * median, 90,
                                     &density)) {
            CHECK(!"solved");
            return;
        }
        CHECK_REL(density.f0, .7, 1e-13, 0);
        for (size_t i = 0; i < density.count; i++) {
            double p = closed_slope_density(&closed, density.r[i]);
            if (p * PI * alphas[k] * alphas[k] < 1e-4) continue;
            worst = check_worse(worst, fabs(density.p[i] / p - 1));
        }
        CHECK(worst < 1e-12);
        CHECK_REL(facet_fit_alpha(&density, FACET_BECKMANN, &rms), alphas[k], 1e-8, 0);
        check_note("nodes", worst);
        facet_fit_density_clear(&density);
    }
}

TEST(alpha_comes_back_from_the_slope_distribution)
{
    static const double alphas[] = {1e-3, .01, .1, .5, 1};
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
        for (size_t k = 0; k < 10; k++) {
            struct closed closed = {(facet_ndf)ndf, alphas[k / 2], {.9, .9, .9}, k % 2, 0, 0, 0, 0};
            facet_fit_source source = closed_source(&closed);
            facet_fit_convention convention = k % 2 ? FACET_FIT_MASKING_ONLY : FACET_FIT_CORRELATED;
            struct fit_density density;
            double median, rms;
            CHECK_INT(facet_fit_median_slope(&source, &median), FACET_OK);
            CHECK_INT(facet_fit_density_create(&source, FACET_SMITH, convention, 1.5 * median, 90,
                                               &density),
                      FACET_OK);
            double alpha = facet_fit_alpha(&density, (facet_ndf)ndf, &rms);
            CHECK_REL(alpha, closed.alpha, 1e-6, 0);
            check_note("alpha", fabs(alpha / closed.alpha - 1));
            facet_fit_density_clear(&density);
        }
    }
}

static facet_status fit_isotropic(const facet_fit_source *source, size_t resolution, facet_fit *fit)
{
    facet_fit_options options = {FACET_SMITH, resolution, FACET_FIT_ALL, false, true, false};
    return facet_fit_create(source, &options, NULL, fit);
}

/* The candidate of this kind; an empty one, after a failure, where there is none. */
static const facet_fit_candidate *find(const facet_fit *fit, facet_ndf ndf,
                                       facet_fresnel_kind fresnel, bool diffuse)
{
    static const facet_fit_candidate none;
    for (size_t i = 0; i < fit->count; i++) {
        const facet_fit_candidate *c = &fit->candidate[i];
        if (c->material.ndf == ndf && c->material.fresnel.kind == fresnel &&
            c->has_diffuse == diffuse)
            return c;
    }
    CHECK(!"candidate found");
    return &none;
}

/* ---- Whole fits ---------------------------------------------------------------------------- */

static double evaluate_one(const facet_material *material, const double i[3], const double o[3],
                           int channel)
{
    facet_brdf *brdf;
    facet_outputs outputs = {0};
    double fr[3] = {NAN, NAN, NAN};
    if (facet_brdf_create(material, &brdf) != FACET_OK) return NAN;
    for (size_t c = 0; c < material->fresnel.channels; c++) outputs.of[FACET_FR][c] = &fr[c];
    facet_eval(brdf, FACET_PRECISE, (facet_vec3_in){&i[0], &i[1], &i[2]},
               (facet_vec3_in){&o[0], &o[1], &o[2]}, 1, &outputs);
    facet_brdf_destroy(brdf);
    return fr[material->fresnel.channels == 1 ? 0 : channel];
}

/* The number: backscatter at and between the nodes, down to 1e-4 of the peak. */
TEST(beckmann_backscatter_at_resolution_90)
{
    static const double alphas[] = {.01, .02, .05, .15};
    for (size_t k = 0; k < 4; k++) {
        struct closed closed = {
            FACET_BECKMANN, alphas[k], {.95, .64, .54}, CLOSED_CORRELATED, 0, 0, 0, 0};
        facet_fit_source source = closed_source(&closed);
        facet_fit fit;
        CHECK_INT(fit_isotropic(&source, 90, &fit), FACET_OK);
        const facet_fit_candidate *tabulated = find(&fit, FACET_TABULATED, FACET_FRESNEL_TABLE,
                                                    false);
        CHECK_INT(tabulated->material.ndf, FACET_TABULATED);
        CHECK_INT(tabulated->log_d_nodes, 91);
        double worst = 0,
               peak = closed_fr(&closed, (double[3]){0, 0, 1}, (double[3]){0, 0, 1}, .64);
        for (int i = 0; i < 90 * 7; i++) { /* every seventh is a node */
            double u = i / (90 * 7.), r = fit.table_scale * u / (1 - u), z = 1 / sqrt(1 + r * r);
            double o[3] = {r * z, 0, z}, exact = closed_fr(&closed, o, o, .64);
            if (exact < 1e-4 * peak) break;
            worst = check_worse(worst,
                                fabs(evaluate_one(&tabulated->material, o, o, 1) / exact - 1));
        }
        CHECK(worst <= 1e-4); /* asked: 1e-3 */
        CHECK(tabulated->error.backscatter_max <= 1e-4);
        CHECK_REL(
            find(&fit, FACET_BECKMANN, FACET_FRESNEL_SCHLICK, false)->material.roughness.alpha_x,
            alphas[k], 1e-6, 0);
        CHECK_INT(fit.convention, FACET_FIT_CORRELATED);
        check_note("backscatter", worst);
        facet_fit_clear(&fit);
    }
}

TEST(the_right_model_is_exact)
{
    static const double alphas[] = {.01, .1, .5, 1};
    for (size_t k = 0; k < 8; k++) {
        facet_ndf ndf = k < 4 ? FACET_GGX : FACET_BECKMANN;
        struct closed closed = {ndf, alphas[k % 4], {.95, .64, .04}, CLOSED_CORRELATED, 0, 0, 0, 0};
        facet_fit_source source = closed_source(&closed);
        facet_fit fit;
        CHECK_INT(fit_isotropic(&source, 90, &fit), FACET_OK);
        const facet_fit_candidate *right = find(&fit, ndf, FACET_FRESNEL_SCHLICK, false),
                                  *wrong = find(&fit, !ndf, FACET_FRESNEL_SCHLICK, false),
                                  *table = find(&fit, ndf, FACET_FRESNEL_TABLE, false),
                                  *slopes = find(&fit, FACET_TABULATED, FACET_FRESNEL_TABLE, false);
        CHECK_INT(right->material.ndf, ndf);
        CHECK_INT(right->bytes, 4 * sizeof(double));
        CHECK_REL(right->material.roughness.alpha_x, closed.alpha, 1e-6, 0);
        for (int c = 0; c < 3; c++) CHECK_REL(right->material.fresnel.f0[c], closed.f0[c], 1e-5, 0);
        CHECK(right->error.rms_log < 1e-5);
        CHECK(wrong->error.rms_log > .1);
        CHECK(slopes->error.rms_log < 5e-4); /* Fresnel linear between nodes 1 degree apart */
        CHECK(right->bytes < table->bytes && table->bytes < slopes->bytes);
        const facet_fresnel *f = &table->material.fresnel;
        for (size_t i = 0; i < f->count; i++) { /* the horizon, where nothing is seen, included */
            double q = 1 - f->cos_theta_d[i], schlick = .04 + .96 * q * q * q * q * q;
            CHECK_REL(f->values[2][i], schlick, 1e-2, 0);
            if (i) CHECK(f->cos_theta_d[i] > f->cos_theta_d[i - 1]);
        }
        CHECK(f->cos_theta_d[0] == 0 && f->cos_theta_d[f->count - 1] == 1);
        check_note("rms right", right->error.rms_log);
        check_note("rms tabulated", slopes->error.rms_log);
        facet_fit_clear(&fit);
    }
}

TEST(hot_spot_is_recognised)
{
    static const double alphas[] = {.3, .6, 1};
    for (size_t k = 0; k < 6; k++) {
        struct closed closed = {k < 3 ? FACET_GGX : FACET_BECKMANN,
                                alphas[k % 3],
                                {.9, .9, .9},
                                CLOSED_HOT_SPOT,
                                0,
                                0,
                                0,
                                0};
        facet_fit_source source = closed_source(&closed);
        facet_fit fit;
        CHECK_INT(fit_isotropic(&source, 90, &fit), FACET_OK);
        /* Beckmann at .3 masks nothing down to 1e-4 of its peak: nobody could tell */
        bool visible = closed.ndf == FACET_GGX || closed.alpha > .5;
        CHECK_INT(fit.convention, visible ? FACET_FIT_MASKING_ONLY : FACET_FIT_CORRELATED);
        double alpha = find(&fit, closed.ndf, FACET_FRESNEL_SCHLICK, false)
                           ->material.roughness.alpha_x;
        CHECK_REL(alpha, closed.alpha, .03, 0); /* taken for correlated: 10 to 18 % */
        check_note("alpha", fabs(alpha / closed.alpha - 1));
        facet_fit_clear(&fit);
    }
}

/* Each value of a Fresnel table is the least-squares one, also where the model is wrong. */
TEST(fresnel_is_the_least_squares)
{
    enum { GROUPS = 6 };
    struct closed closed = {FACET_GGX, .3, {.6, .5, .2}, CLOSED_HOT_SPOT, 0, 0, 0, 0};
    facet_fit_source source = closed_source(&closed);
    double theta_h[] = {0, .05, .1, .2, .4, .8}, theta_d[GROUPS] = {0, .3, .6, .9, 1.2, 1.5};
    struct fit_grid grid = {theta_h, theta_d, 6, GROUPS, 3, 1, NULL, NULL};
    static const double none[3] = {0, 0, 0};
    struct fit_pairs pairs;
    facet_material wrong = {.ndf = FACET_GGX,
                            .roughness = {.alpha_x = .35, .alpha_y = .35},
                            .fresnel = {.kind = FACET_FRESNEL_IDEAL, .channels = 1}};
    double table[3][GROUPS], *values[3] = {table[0], table[1], table[2]};
    CHECK_INT(facet_fit_pairs_create(&source, &grid, &pairs), FACET_OK);
    CHECK_INT(facet_fit_pairs_model(&pairs, &wrong, pairs.model), FACET_OK);
    CHECK(facet_fit_fresnel_table(&pairs, none, values));
    double best = facet_fit_residual(&pairs, none, values);
    for (int k = 0; k < 3 * GROUPS; k++) {
        double *value = &table[k / GROUPS][k % GROUPS], kept = *value;
        for (int sign = -1; sign <= 1; sign += 2) {
            *value = kept * (1 + sign * 1e-3);
            CHECK(facet_fit_residual(&pairs, none, values) > best);
        }
        *value = kept;
    }
    facet_fit_pairs_clear(&pairs);
}

/* rms_log again, from the definition in facet_fit.h. */
TEST(stated_error_is_the_error)
{
    struct closed closed = {FACET_GGX, .3, {.9, .5, .2}, CLOSED_HOT_SPOT, 0, 0, 0, 0};
    facet_fit_source source = closed_source(&closed);
    facet_fit fit;
    CHECK_INT(fit_isotropic(&source, 40, &fit), FACET_OK);
    for (size_t k = 0; k < fit.count; k += 2) {
        double sum = 0, count = 0;
        for (int a = 0; a < 45; a++) {
            for (int b = 0; b < 40; b++) {
                for (int c = 0; c < 12; c++) {
                    double th = PI / 2 * pow((a + .5) / 45, 2), td = PI / 2 * (b + .5) / 40,
                           pd = PI * (c + .5) / 12;
                    double d[3] = {sin(td) * cos(pd), sin(td) * sin(pd), cos(td)};
                    double h[3] = {sin(th), 0, cos(th)}, i[3], o[3];
                    i[0] = cos(th) * d[0] + sin(th) * d[2];
                    i[1] = d[1];
                    i[2] = -sin(th) * d[0] + cos(th) * d[2];
                    for (int m = 0; m < 3; m++) o[m] = 2 * d[2] * h[m] - i[m];
                    if (i[2] < 1e-3 || o[2] < 1e-3) continue;
                    count++;
                    for (int m = 0; m < 3; m++) {
                        double f = closed_fr(&closed, i, o, closed.f0[m]) * i[2];
                        double kd = fit.candidate[k].diffuse[m];
                        double e = ((1 - kd) * evaluate_one(&fit.candidate[k].material, i, o, m) +
                                    kd / PI) *
                                   i[2];
                        double x = log((1e-3 + f) / (1e-3 + e));
                        sum += x * x;
                    }
                }
            }
        }
        CHECK_INT(fit.pairs, (long)count);
        CHECK_REL(sqrt(sum / (3 * count)), fit.candidate[k].error.rms_log, 1e-9, 0);
    }
    facet_fit_clear(&fit);
}

/* ---- Refusals ------------------------------------------------------------------------------- */

static facet_status evaluate_useless(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                                     double *const fr[3], bool *valid)
{
    int kind = *(const int *)user;
    for (size_t i = 0; i < n; i++) {
        valid[i] = kind != 0;
        for (int c = 0; c < 3; c++) fr[c][i] = kind == 1 ? 0 : kind == 2 ? -1 : NAN;
    }
    (void)wi, (void)wo;
    return kind == 4 ? FACET_UNSUPPORTED : FACET_OK;
}

TEST(useless_sources_are_refused)
{
    for (int kind = 0; kind < 5; kind++) {
        facet_fit_source source = {evaluate_useless, &kind, INFINITY, false, NULL};
        facet_fit fit;
        CHECK_INT(fit_isotropic(&source, 90, &fit), kind == 4 ? FACET_UNSUPPORTED : FACET_BAD_DATA);
        CHECK(fit.owned == NULL);
        facet_fit_clear(&fit);
    }
}

static bool countdown(void *user)
{
    return --*(int *)user < 0;
}

TEST(arguments_and_cancellation)
{
    struct closed closed = {FACET_GGX, .3, {1, 1, 1}, CLOSED_CORRELATED, 0, 0, 0, 0};
    facet_fit_source source = closed_source(&closed);
    facet_fit fit;
    CHECK_INT(fit_isotropic(&source, FACET_FIT_RESOLUTION_MIN - 1, &fit), FACET_BAD_SIZE);
    CHECK_INT(fit_isotropic(&source, FACET_FIT_RESOLUTION_MAX + 1, &fit), FACET_BAD_SIZE);
    facet_fit_options bad[] = {
        {FACET_SMITH_UNCORRELATED, 90, FACET_FIT_ALL, false, false, false},
        {FACET_SMITH, 90, 0, false, false, false},
        {FACET_SMITH, 90, 8, false, false, false},
        {FACET_SMITH, 90, FACET_FIT_ALL, true, false, false}, /* from an isotropic source */
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++)
        CHECK_INT(facet_fit_create(&source, &bad[k], NULL, &fit), FACET_UNSUPPORTED);
    for (int asks = 0; asks < 12; asks += 3) {
        int left = asks;
        facet_watch watch = {countdown, &left};
        facet_fit_options options = {FACET_SMITH, 20, FACET_FIT_ALL, false, true, false};
        CHECK_INT(facet_fit_create(&source, &options, &watch, &fit), FACET_CANCELLED);
        CHECK(fit.owned == NULL);
    }
}
