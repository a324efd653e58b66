/* What is promised of extraction and fits: the slope distribution everywhere, roughness, Fresnel. */
#include "check.h"
#include "closed.h"
#include "draw.h"
#include "facet_fit.h"
#include "fit_backscatter.h"
#include "slope_table.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define PI 3.14159265358979323846
#define SCALE_PER_MEDIAN 1.5

static double ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/*
 * Worst relative error of D to 1e-4 of its peak, at 3001 slopes: of the equation's own
 * interpolation, and of a table of n intervals.
 */
static void extraction_error(const struct closed *closed, size_t n, double *everywhere,
                             double *table_error)
{
    enum { POINTS = 3001 };
    facet_fit_source source = closed_source(closed);
    facet_fit_convention convention = closed->masking == CLOSED_CORRELATED ? FACET_FIT_CORRELATED
                                                                           : FACET_FIT_MASKING_ONLY;
    struct fit_density density;
    double median, *log_d = calloc(POINTS + n + 1, sizeof *log_d), *nodes = log_d + POINTS;
    *everywhere = *table_error = HUGE_VAL;
    if (!log_d || facet_fit_median_slope(&source, &median) != FACET_OK) return;
    double scale = SCALE_PER_MEDIAN * median;
    double start = ms();
    CHECK_INT(facet_fit_density_create(&source, FACET_SMITH, convention, scale, n, &density),
              FACET_OK);
    check_note(n == 90 ? "ms of 90" : "ms of 360", ms() - start);
    facet_slope_table *table = NULL;
    facet_fit_density_table(&source, FACET_SMITH, convention, &density, POINTS, log_d);
    facet_fit_density_table(&source, FACET_SMITH, convention, &density, n + 1, nodes);
    CHECK_INT(facet_slope_table_create(scale, nodes, n + 1, &table), FACET_OK);
    *everywhere = *table_error = 0;
    for (int i = 0; i < POINTS - 1; i++) {
        double u = i / (POINTS - 1.), r = scale * u / (1 - u), s = 1 + r * r;
        double d = closed_slope_density(closed, r) * s * s;
        if (d < 1e-4 * closed_slope_density(closed, 0)) break;
        *everywhere = check_worse(*everywhere, fabs(exp(log_d[i]) / d - 1));
        *table_error = check_worse(*table_error,
                                   fabs(exp(facet_slope_table_log_d(table, r)) / d - 1));
    }
    facet_slope_table_destroy(table);
    facet_fit_density_clear(&density);
    free(log_d);
}

TEST(slope_distribution_everywhere)
{
    static const struct {
        facet_ndf ndf;
        double alpha, at_90, at_360;
    } rows[] = {
        {FACET_BECKMANN, .01, 1e-6, 1e-6}, {FACET_BECKMANN, .02, 1e-6, 1e-6},
        {FACET_BECKMANN, .05, 1e-6, 1e-6}, {FACET_BECKMANN, .15, 1e-6, 1e-6},
        {FACET_BECKMANN, .4, 1e-4, 1e-6},  {FACET_BECKMANN, 1, 1e-4, 1e-6},
        {FACET_GGX, .01, 1e-4, 1e-6},      {FACET_GGX, .1, 1e-4, 1e-6},
        {FACET_GGX, .5, 1e-4, 1e-6},       {FACET_GGX, 1, 1e-4, 1e-6},
        {FACET_GGX, .001, 1e-2, 1e-2},
    };
    for (size_t k = 0; k < sizeof rows / sizeof *rows; k++) {
        for (int masking = CLOSED_CORRELATED; masking <= CLOSED_HOT_SPOT; masking++) {
            struct closed closed = {rows[k].ndf, rows[k].alpha, {.9, .7, .2}, masking, 0, 0, 0, 0};
            double at_90, at_360, table_90, table_360;
            char name[40];
            extraction_error(&closed, 90, &at_90, &table_90);
            extraction_error(&closed, 360, &at_360, &table_360);
            CHECK(at_90 <= rows[k].at_90);
            CHECK(at_360 <= rows[k].at_360);
            CHECK(table_90 <= rows[k].at_90);
            CHECK(table_360 <= rows[k].at_360);
            snprintf(name, sizeof name, "%s%g", rows[k].ndf == FACET_GGX ? "g" : "b",
                     rows[k].alpha);
            check_note(name, at_90);
            check_note(rows[k].at_90 < 1e-5 ? "table of 90" : "wide table of 90", table_90);
            check_note("at 360", fmax(at_360, table_360));
        }
    }
}

/* ---- Roughness --------------------------------------------------------------------------------- */

/* alpha of the fit by the source's own model, without a diffuse part. */
static double fitted_alpha(const struct closed *closed, facet_fit_convention *convention)
{
    facet_fit_source source = closed_source(closed);
    facet_fit_options options = {FACET_SMITH, 90, 1u << closed->ndf, false, false, false};
    facet_fit fit;
    if (facet_fit_create(&source, &options, NULL, &fit) != FACET_OK) return NAN;
    double alpha = fit.candidate[0].material.roughness.alpha_x;
    *convention = fit.convention;
    facet_fit_clear(&fit);
    return alpha;
}

TEST(alpha_whatever_the_masking)
{
    static const double alphas[] = {.01, .1, .4, 1};
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
        for (size_t k = 0; k < 4; k++) {
            for (int masking = CLOSED_CORRELATED; masking <= CLOSED_SMALLER; masking++) {
                struct closed closed = {
                    (facet_ndf)ndf, alphas[k], {.9, .7, .2}, masking, 0, 0, 0, 0};
                facet_fit_convention convention;
                double error = fabs(fitted_alpha(&closed, &convention) / alphas[k] - 1);
                CHECK(error <= (ndf == FACET_GGX ? 1e-3 : 1e-6));
                check_note(ndf == FACET_GGX ? "ggx" : "beckmann", error);
            }
        }
    }
}

/* 3 % of each value and 1e-4 of the peak: rms error of alpha over the trials.
 * FACET_TEST_SCALE=17 makes them 200 and more of each distribution. */
TEST(alpha_of_noisy_data)
{
    static const double alphas[] = {.05, .2, .5};
    int trials = (int)draw_count(4);
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
        double sum = 0, count = 0;
        for (int k = 0; k < 3; k++) {
            for (int i = 0; i < trials; i++) {
                struct closed closed = {
                    (facet_ndf)ndf, alphas[k], {.9, .7, .2},           CLOSED_CORRELATED, .03,
                    1e-4,           0,         (unsigned)(i + 100 * k)};
                facet_fit_convention convention;
                double error = fitted_alpha(&closed, &convention) / alphas[k] - 1;
                sum += error * error;
                count++;
            }
        }
        CHECK(sqrt(sum / count) < 5e-3);
        check_note(ndf == FACET_GGX ? "ggx" : "beckmann", sqrt(sum / count));
        check_note("trials", count);
    }
}

/* One value in fifty a hundredfold: least squares alone would follow them. */
TEST(outliers_do_not_matter)
{
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
        struct closed closed = {(facet_ndf)ndf, .2, {.9, .7, .2}, CLOSED_CORRELATED, 0, 0, .02, 3};
        facet_fit_convention convention;
        double error = fabs(fitted_alpha(&closed, &convention) / .2 - 1);
        CHECK(error < 2e-3); /* without the loss 7e-3 */
        check_note(ndf == FACET_GGX ? "ggx" : "beckmann", error);
    }
}

/* ---- Fresnel ------------------------------------------------------------------------------------ */

TEST(fresnel_table_to_84_degrees)
{
    static const double alphas[] = {.02, .1, .4};
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
        for (size_t k = 0; k < 3; k++) {
            struct closed closed = {
                (facet_ndf)ndf, alphas[k], {.9, .3, .04}, CLOSED_CORRELATED, 0, 0, 0, 0};
            facet_fit_source source = closed_source(&closed);
            facet_fit_options options = {FACET_SMITH, 90, FACET_FIT_TABULATED, false, false, false};
            facet_fit fit;
            CHECK_INT(facet_fit_create(&source, &options, NULL, &fit), FACET_OK);
            const facet_fresnel *f = &fit.candidate[0].material.fresnel;
            double worst = 0;
            for (size_t i = 0; i < f->count; i++) {
                if (f->cos_theta_d[i] < cos(84 * PI / 180)) continue;
                for (int c = 0; c < 3; c++) {
                    double q = 1 - f->cos_theta_d[i],
                           exact = closed.f0[c] + (1 - closed.f0[c]) * q * q * q * q * q;
                    worst = check_worse(worst, fabs(f->values[c][i] / exact - 1));
                }
            }
            CHECK(worst <= 1e-2);
            check_note("error", worst);
            facet_fit_clear(&fit);
        }
    }
}

/* ---- Anisotropic --------------------------------------------------------------------------------- */

static facet_status evaluate_brdf(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                                  double *const fr[3], bool *valid)
{
    facet_outputs outputs = {0};
    for (size_t c = 0; c < 3; c++) outputs.of[FACET_FR][c] = fr[c];
    for (size_t i = 0; i < n; i++) valid[i] = true;
    return facet_eval(user, FACET_PRECISE, wi, wo, n, &outputs);
}

TEST(anisotropic_roughness)
{
    static const double rows[3][3] = {{.05, .5, 0}, {.2, .2, .9}, {.4, .1, -.9}};
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
        for (size_t k = 0; k < 3; k++) {
            facet_material material = {
                .ndf = (facet_ndf)ndf,
                .roughness = {.alpha_x = rows[k][0], .alpha_y = rows[k][1], .rho = rows[k][2]},
                .fresnel = {.kind = FACET_FRESNEL_SCHLICK, .channels = 3, .f0 = {.9, .6, .1}}};
            facet_brdf *brdf;
            CHECK_INT(facet_brdf_create(&material, &brdf), FACET_OK);
            facet_fit_source source = {evaluate_brdf, brdf, INFINITY, true, NULL};
            facet_fit_options options = {FACET_SMITH, 90, 1u << ndf, true, false, false};
            facet_fit fit;
            double start = ms();
            CHECK_INT(facet_fit_create(&source, &options, NULL, &fit), FACET_OK);
            check_note("ms", ms() - start);
            const facet_fit_candidate *found = NULL;
            for (size_t i = 0; i < fit.count; i++)
                if (fit.candidate[i].anisotropic && !found) found = &fit.candidate[i];
            CHECK(found != NULL);
            facet_ellipse a = facet_roughness_to_ellipse(&material.roughness),
                          b = found ? facet_roughness_to_ellipse(&found->material.roughness) : a;
            CHECK_REL(b.alpha_1, a.alpha_1, 1e-6, 0); /* asked: 1 % */
            CHECK_REL(b.alpha_2, a.alpha_2, 1e-6, 0);
            CHECK(fabs(sin(b.phi - a.phi)) < 1e-6); /* an axis, so modulo pi; asked: .2 degrees */
            facet_fit_clear(&fit);
            facet_brdf_destroy(brdf);
        }
    }
}

/* The same surface where backscatter is masked only: the smaller of the two G1 in place of G. */
static facet_status evaluate_masked(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                                    double *const fr[3], bool *valid)
{
    double *g = malloc(3 * n * sizeof *g);
    facet_outputs outputs = {0};
    if (!g) return FACET_NO_MEMORY;
    outputs.of[FACET_G][0] = g;
    outputs.of[FACET_G1_I][0] = g + n;
    outputs.of[FACET_G1_O][0] = g + 2 * n;
    facet_status status = evaluate_brdf(user, wi, wo, n, fr, valid);
    if (status == FACET_OK) status = facet_eval(user, FACET_PRECISE, wi, wo, n, &outputs);
    for (size_t i = 0; status == FACET_OK && i < n; i++)
        for (int c = 0; c < 3 && g[i] > 0; c++) fr[c][i] *= fmin(g[n + i], g[2 * n + i]) / g[i];
    free(g);
    return status;
}

TEST(anisotropic_hot_spot_is_recognised)
{
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
        facet_material material = {
            .ndf = (facet_ndf)ndf,
            .roughness = {.alpha_x = .6, .alpha_y = .2, .rho = -.5},
            .fresnel = {.kind = FACET_FRESNEL_SCHLICK, .channels = 3, .f0 = {.9, .6, .1}}};
        facet_brdf *brdf;
        CHECK_INT(facet_brdf_create(&material, &brdf), FACET_OK);
        for (int masked = 0; masked < 2; masked++) {
            facet_fit_source source = {masked ? evaluate_masked : evaluate_brdf, brdf, INFINITY,
                                       true, NULL};
            facet_fit_options options = {FACET_SMITH, 90, 1u << ndf, true, false, false};
            facet_fit fit;
            CHECK_INT(facet_fit_create(&source, &options, NULL, &fit), FACET_OK);
            if (!fit.has_convention ||
                fit.convention != (masked ? FACET_FIT_MASKING_ONLY : FACET_FIT_CORRELATED))
                check_fail(__FILE__, __LINE__, "ndf %d masked %d: has %d convention %d", ndf,
                           masked, fit.has_convention, (int)fit.convention);
            facet_fit_clear(&fit);
        }
        facet_brdf_destroy(brdf);
    }
}

/* ---- Other maskings -------------------------------------------------------------------------------- */

TEST(vgroove_and_normal_map)
{
    static const facet_masking maskings[] = {FACET_VGROOVE, FACET_NONE};
    static const double alphas[] = {.05, .3, .8};
    for (int k = 0; k < 12; k++) {
        facet_ndf ndf = k % 2 ? FACET_BECKMANN : FACET_GGX;
        double alpha = alphas[k / 4];
        facet_material material = {
            .ndf = ndf,
            .roughness = {.alpha_x = alpha, .alpha_y = alpha},
            .masking = maskings[k / 2 % 2],
            .fresnel = {.kind = FACET_FRESNEL_SCHLICK, .channels = 3, .f0 = {.9, .6, .1}}};
        facet_brdf *brdf;
        CHECK_INT(facet_brdf_create(&material, &brdf), FACET_OK);
        facet_fit_source source = {evaluate_brdf, brdf, INFINITY, false, NULL};
        facet_fit_options options = {
            material.masking, 90, FACET_FIT_TABULATED | 1u << ndf, false, false, false};
        facet_fit fit;
        CHECK_INT(facet_fit_create(&source, &options, NULL, &fit), FACET_OK);
        CHECK(!fit.has_convention);
        const facet_fit_candidate *first = &fit.candidate[0], *last = &fit.candidate[fit.count - 1];
        CHECK_REL(first->material.roughness.alpha_x, alpha, 1e-6, 0);
        CHECK_INT(last->material.ndf, FACET_TABULATED);
        CHECK(last->error.backscatter_max < 1e-4 && last->error.rms_log < 1e-3);
        check_note("backscatter", last->error.backscatter_max);
        check_note("rms_log", last->error.rms_log);
        facet_fit_clear(&fit);
        facet_brdf_destroy(brdf);
    }
}

/* Lobes along two axes, which are no ellipse; kd of it diffuse. */
struct two_lobes {
    facet_brdf *brdf;
    facet_slope_table *table;
    double kd;
};

static facet_status evaluate_two_lobes(const void *user, facet_vec3_in wi, facet_vec3_in wo,
                                       size_t n, double *const fr[3], bool *valid)
{
    const struct two_lobes *lobes = user;
    facet_status status = evaluate_brdf(lobes->brdf, wi, wo, n, fr, valid);
    for (size_t c = 0; c < 3; c++)
        for (size_t i = 0; i < n; i++) fr[c][i] = (1 - lobes->kd) * fr[c][i] + lobes->kd / PI;
    return status;
}

static struct two_lobes two_lobes_of(double kd)
{
    enum { N = 61, ROWS = 40 };
    static double log_d[ROWS][N];
    struct two_lobes lobes = {.kd = kd};
    for (int j = 0; j < ROWS; j++)
        for (int i = 0; i < N; i++) {
            double u = i / (N - 1.), phi = PI * j / ROWS;
            log_d[j][i] = -9 * u + u * u * (.4 * cos(2 * phi) + cos(4 * phi - 1));
        }
    CHECK_INT(facet_slope_table_create_turned(.4, log_d[0], N, ROWS, NULL, &lobes.table), FACET_OK);
    facet_material material = {
        .ndf = FACET_TABULATED,
        .roughness = {.alpha_x = .9, .alpha_y = .4, .rho = .3},
        .fresnel = {.kind = FACET_FRESNEL_SCHLICK, .channels = 3, .f0 = {1, 1, 1}},
        .table = lobes.table};
    CHECK_INT(facet_brdf_create(&material, &lobes.brdf), FACET_OK);
    return lobes;
}

/* The least rms of the candidates with rows, with fewer of them, and of all others. */
static void check_two_lobes(double kd, double rows_most, double compact_most, double others_least)
{
    struct two_lobes lobes = two_lobes_of(kd);
    facet_fit_source source = {evaluate_two_lobes, &lobes, INFINITY, true, NULL};
    facet_fit_options options = {FACET_SMITH, 90, FACET_FIT_ALL, true, kd > 0, true};
    facet_fit fit;
    double start = ms(), rows = INFINITY, compact = INFINITY, others = INFINITY;
    CHECK_INT(facet_fit_create(&source, &options, NULL, &fit), FACET_OK);
    check_note("ms", ms() - start);
    for (size_t i = 0; i < fit.count; i++) {
        const facet_fit_candidate *c = &fit.candidate[i];
        bool has_rows = c->log_d_rows > 1 && c->has_diffuse == (kd > 0);
        double *of = !has_rows ? &others : c->log_d_rows == FACET_FIT_ROWS ? &rows : &compact;
        if (c->error.rms_log < *of) {
            *of = c->error.rms_log;
            for (size_t k = 0; k < 3 && has_rows; k++) CHECK(fabs(c->diffuse[k] - kd) <= .2 * kd);
        }
        if (c->log_d_rows > 1) CHECK(c->bytes > c->log_d_rows * c->log_d_nodes * sizeof(double));
    }
    check_note("rows", rows);
    check_note("compact", compact);
    check_note("others", others);
    CHECK(rows < rows_most);
    CHECK(compact < compact_most);
    CHECK(others > others_least);
    facet_fit_clear(&fit);
    facet_brdf_destroy(lobes.brdf);
    facet_slope_table_destroy(lobes.table);
}

TEST(what_is_no_ellipse_is_told_by_rows)
{
    check_two_lobes(0, 2e-4, .01, .1);
}

TEST(what_is_no_ellipse_on_a_diffuse_ground_is_told_by_rows)
{
    check_two_lobes(.2, .2, .2, .205); /* .29 the best ellipse, .213 its table */
}
