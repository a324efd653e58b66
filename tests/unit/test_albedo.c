/* Albedo against a model and a quadrature of its own (textbook.h). */
#include "ask.h"
#include "check.h"
#include "draw.h"
#include "facet_albedo.h"
#include "facet_table.h"
#include "integrate.h"
#include "textbook.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static facet_status albedo_of(const facet_material *m, const double o[3], double tolerance,
                              facet_albedo_value *value)
{
    facet_albedo_options options = {.tolerance = tolerance, .evaluations_max = 1 << 22};
    return facet_albedo(m, (facet_vec3_in){&o[0], &o[1], &o[2]}, 1, &options, value, NULL);
}

static const double nodes[3] = {0.2, 0.7, 0.9}, values[3] = {1, 0.3, 0.6};

static const facet_fresnel terms[] = {
    {.kind = FACET_FRESNEL_IDEAL, .channels = 1},
    {.kind = FACET_FRESNEL_SCHLICK, .channels = 1, .f0 = {0.04}},
    {.kind = FACET_FRESNEL_DIELECTRIC, .channels = 1, .eta = {1.5}},
    {.kind = FACET_FRESNEL_DIELECTRIC, .channels = 1, .eta = {0.8}},
    {.kind = FACET_FRESNEL_TABLE,
     .channels = 1,
     .count = 3,
     .cos_theta_d = nodes,
     .values = {values}},
};

static const facet_roughness surfaces[] = {
    {.alpha_x = 0.3, .alpha_y = 0.3},
    {.alpha_x = 1.7, .alpha_y = 1.7},
    {.alpha_x = 0.2, .alpha_y = 0.5, .rho = 0.7},
    {.alpha_x = 0.3, .alpha_y = 0.2, .rho = -0.2, .slope_x = 0.3, .slope_y = -0.5},
};

/* One of the axes at a time from a plain material, all of both from time to time. */
TEST(directional_albedo_is_the_reference)
{
    static const double views[][2] = {{0, 0}, {0.8, 1}, {1.4, 4}, {1.569, 2}}; /* theta, phi */
    size_t kinds = sizeof terms / sizeof *terms;
    double worst = 0;
    for (size_t k = 0; k < draw_count(20); k++) {
        facet_material m = {.ndf = (facet_ndf)((k / 2 + k / 8) % 2),
                            .roughness = surfaces[(k + k / 4) % 4],
                            .masking = (facet_masking)(k % 4),
                            .fresnel = terms[k % kinds]};
        const double *view = views[(k + k / 4 + k / 16) % 4];
        double s = sin(view[0]), o[3] = {s * cos(view[1]), s * sin(view[1]), cos(view[0])};
        facet_albedo_value value;
        CHECK_INT(albedo_of(&m, o, 1e-9, &value), FACET_OK);
        double exact = textbook_albedo(&m, o, 1e-12), error = fabs(value.value[0] - exact);
        worst = check_worse(worst, error);
        if (!(error <= 1e-10 && error <= value.error[0] + 1e-11 && value.error[0] <= 1e-9 * exact))
            check_fail(__FILE__, __LINE__,
                       "albedo %.14g, reported to %.2g, is %.14g: %s, theta %g phi %g",
                       value.value[0], value.error[0], exact, draw_text(&m), view[0], view[1]);
    }
    check_note("albedo error", worst);
}

/*
 * From the pole everything is a function of theta_h alone: at slope t the weight of masking is
 * known, and u = P's own quantile.
 */
struct polar {
    facet_ndf ndf;
    double alpha;
};

static double at_polar(void *user, double s)
{
    const struct polar *p = user;
    double x = exp(s), t = p->alpha * x; /* standard and real slope */
    if (!(t < 1)) return 0;
    double zi = (1 - t) * (1 + t) / (1 + t * t), si = 2 * t / (1 + t * t) * p->alpha;
    struct textbook_stretched i = {zi, si}, o = {1, 0};
    double weight = textbook_area(p->ndf, o) * zi /
                    (textbook_area(p->ndf, o) * zi + (textbook_area(p->ndf, i) - zi));
    double density = p->ndf == FACET_GGX ? 2 * x / pow(1 + x * x, 2) : 2 * x * exp(-x * x);
    return weight * density * x;
}

TEST(the_pole_is_right_for_every_alpha)
{
    for (int ndf = 0; ndf < 2; ndf++)
        for (double alpha = 1e-8; alpha <= 1.1e4; alpha *= 10) {
            facet_material m = {.ndf = (facet_ndf)ndf,
                                .roughness = {.alpha_x = alpha, .alpha_y = alpha},
                                .fresnel = terms[0]};
            struct polar p = {(facet_ndf)ndf, alpha};
            const double o[3] = {0, 0, 1};
            facet_albedo_value value;
            CHECK_INT(albedo_of(&m, o, 1e-9, &value), FACET_OK);
            double end = log(1 / alpha), start = fmin(end, 0) - 40, exact = 0;
            for (double a = start; a < end; a += 0.5)
                exact += textbook_piece(at_polar, &p, a, fmin(a + 0.5, end));
            CHECK_REL(value.value[0], exact, 1e-9, 0);
            CHECK(value.error[0] <= 1e-9 * value.value[0]);
            m.masking = FACET_NONE;
            CHECK_INT(albedo_of(&m, o, 1e-9, &value), FACET_OK);
            double closed = ndf ? -expm1(-1 / (alpha * alpha)) : 1 / (1 + alpha * alpha);
            CHECK_REL(value.value[0], closed, 1e-9, 0);
        }
}

TEST(closed_forms)
{
    facet_material m = {.roughness = {.alpha_x = 1, .alpha_y = 1}, .fresnel = terms[0]};
    const double pole[3] = {0, 0, 1};
    facet_albedo_value value;
    CHECK_INT(albedo_of(&m, pole, 1e-12, &value), FACET_OK);
    CHECK_REL(value.value[0], 1 - log(2), 1e-12, 0); /* GGX, alpha = 1, Smith */
    m.masking = FACET_NONE;                          /* half of all normals, from everywhere */
    for (double theta = 0; theta < 1.57; theta += 0.3) {
        const double o[3] = {sin(theta), 0, cos(theta)};
        CHECK_INT(albedo_of(&m, o, 1e-11, &value), FACET_OK);
        CHECK_REL(value.value[0], 0.5, 1e-11, 0);
    }
}

/* Whatever the material and the direction: finite, honest, and no more work than allowed. */
TEST(errors_are_honest_everywhere)
{
    struct rng rng;
    rng_seed(&rng, 11);
    double worst = 0;
    size_t met = 0, count = draw_count(250);
    for (size_t k = 0; k < count; k++) {
        facet_material m = {.ndf = (facet_ndf)(k % 2),
                            .masking = (facet_masking)(k / 2 % 4),
                            .shear = k % 8 < 4 && k % 3 == 0 ? FACET_THESIS : FACET_ENERGY_SAFE};
        draw_roughness(&rng, &draw_everywhere, &m.roughness);
        draw_fresnel(&rng, (facet_fresnel_kind)(k % FACET_FRESNEL_COUNT), &m.fresnel);
        double o[3];
        draw_direction(&rng, 1e-9, o);
        facet_albedo_value rough, fine;
        facet_albedo_options options = {.tolerance = 1e-4, .evaluations_max = 200000};
        size_t spent;
        facet_vec3_in wo = {&o[0], &o[1], &o[2]};
        CHECK_INT(facet_albedo(&m, wo, 1, &options, &rough, &spent), FACET_OK);
        options.tolerance = 1e-8;
        CHECK_INT(facet_albedo(&m, wo, 1, &options, &fine, NULL), FACET_OK);
        met += rough.error[0] <= 1e-4 * rough.value[0] || rough.value[0] < 1e-30;
        for (size_t c = 0; c < m.fresnel.channels; c++) {
            double difference = fabs(rough.value[c] - fine.value[c]);
            CHECK(isfinite(rough.value[c]) && rough.value[c] >= 0 && rough.error[c] >= 0);
            bool promised = rough.error[c] < 0.1 * rough.value[c] &&
                            fine.error[c] < 0.1 * fine.value[c];
            double allowed = rough.error[c] + fine.error[c] + 1e-30;
            if (promised) worst = check_worse(worst, difference / allowed);
            if (promised && !(difference <= allowed))
                check_fail(__FILE__, __LINE__,
                           "albedo %.10g +- %.2g, then %.10g +- %.2g: %s, wo %.17g %.17g %.17g",
                           rough.value[c], rough.error[c], fine.value[c], fine.error[c],
                           draw_text(&m), o[0], o[1], o[2]);
        }
        CHECK(spent < 600000);
    }
    check_note("difference over promised", worst);
    check_note("share of random corners that meet 1e-4", (double)met / (double)count);
    CHECK(met > count * 3 / 4);
}

struct mean {
    const facet_material *m;
    double tolerance;
};

static double mean_at(void *user, double mu)
{
    const struct mean *mean = user;
    const double o[3] = {sqrt((1 - mu) * (1 + mu)), 0, mu};
    facet_albedo_value value = {.value = {NAN}};
    albedo_of(mean->m, o, mean->tolerance, &value);
    return 2 * mu * value.value[0];
}

static facet_status mean_of(const facet_material *m, double tolerance, facet_albedo_value *value)
{
    facet_albedo_options options = {.tolerance = tolerance, .evaluations_max = 1 << 26};
    return facet_albedo_average(m, &options, value, NULL);
}

TEST(the_mean_is_the_mean)
{
    facet_albedo_value value;
    bool is_full = draw_count(10) >= 10; /* a short run has a thinner reference, not fewer cases */
    double tolerance = is_full ? 1e-8 : 1e-6;
    for (int k = 0; k < 4; k += 3) {
        facet_material m = {
            .ndf = (facet_ndf)(k % 2), .roughness = surfaces[k / 2], .fresnel = terms[k]};
        struct mean mean = {&m, tolerance / 100};
        CHECK_INT(mean_of(&m, tolerance, &value), FACET_OK);
        double exact = textbook_integral(mean_at, &mean, 0, 0.1, mean.tolerance) +
                       textbook_integral(mean_at, &mean, 0.1, 1, mean.tolerance);
        check_note("error over claimed", fabs(value.value[0] - exact) / value.error[0]);
        CHECK(fabs(value.value[0] - exact) <= value.error[0] + (is_full ? 0 : mean.tolerance));
        CHECK(value.error[0] <= tolerance * exact);
    }
    /* Without masking and with alpha = 1 every direction has 1/2; turned axes change nothing. */
    facet_material m = {.roughness = {.alpha_x = 1, .alpha_y = 1, .rho = 1e-9},
                        .masking = FACET_NONE,
                        .fresnel = terms[0]};
    CHECK_INT(mean_of(&m, 1e-5, &value), FACET_OK);
    CHECK_REL(value.value[0], 0.5, 1e-6, 0);
}

/* Over wo, whose albedo bends where the mean facet is left behind, this took 9e7 evaluations, then 2.7e7. */
TEST(the_mean_of_a_sheared_surface_is_had_at_1e_6)
{
    facet_material m = {
        .ndf = FACET_BECKMANN,
        .roughness = {.alpha_x = 0.3, .alpha_y = 0.3, .slope_x = 0.2, .slope_y = 0.1},
        .fresnel = {.channels = 1}};
    bool is_full = draw_count(10) >= 10; /* 20 million evaluations */
    facet_albedo_options options = {.tolerance = is_full ? 1e-6 : 1e-2, .evaluations_max = 1 << 25};
    facet_albedo_value value;
    CHECK_INT(facet_albedo_average(&m, &options, &value, NULL), FACET_OK);
    CHECK(value.error[0] <= options.tolerance * value.value[0]);
    CHECK_REL(value.value[0], 0.943487892381, is_full ? 1e-9 : 1e-3, 0);
}

/*
 * A tilted mirror reflects what lies between the horizon and its mirror image: of the flux the projections
 * of two half discs, (1 + cos 2 beta)/2 = 1/(1 + slope^2).  A narrow Gaussian is that to alpha^2; GGX also
 * shows tails to those who see it from behind, whatever alpha is (0.8283(8) by 240,000 samples of caps).
 */
TEST(the_mean_of_a_narrow_sheared_surface_is_a_mirrors)
{
    static const double exact[] = {0.828715, 0.8};
    bool is_full = draw_count(10) >= 10;
    double tolerance = is_full ? 1e-3 : 1e-2;
    for (int ndf = 0; ndf < 2; ndf++) {
        facet_material m = {.ndf = (facet_ndf)ndf,
                            .roughness = {.alpha_x = 1e-5, .alpha_y = 1e-5, .slope_y = -0.5},
                            .fresnel = {.channels = 1}};
        facet_albedo_options options = {.tolerance = tolerance, .evaluations_max = 1 << 26};
        facet_albedo_value value;
        CHECK_INT(facet_albedo_average(&m, &options, &value, NULL), FACET_OK);
        CHECK(value.error[0] <= tolerance * value.value[0]);
        CHECK_REL(value.value[0], exact[ndf], is_full ? 1e-5 : 1e-3, 0);
    }
}

static bool give_up(void *user)
{
    return ++*(int *)user > 3;
}

TEST(work_is_bounded_and_can_be_stopped)
{
    facet_material m = {.roughness = surfaces[3], .fresnel = terms[0]};
    int asked = 0;
    facet_albedo_options options = {
        .tolerance = 1e-12, .evaluations_max = 1 << 26, .watch = {give_up, &asked}};
    facet_albedo_value value;
    CHECK_INT(facet_albedo_average(&m, &options, &value, NULL), FACET_CANCELLED);
    CHECK_INT(asked, 4);
    options = (facet_albedo_options){.tolerance = 1e-12, .evaluations_max = 1000};
    size_t spent;
    CHECK_INT(facet_albedo_average(&m, &options, &value, &spent), FACET_OK);
    CHECK(value.error[0] > 1e-12 * value.value[0]);
    CHECK(spent < 40000000);
}

TEST(a_table_of_ggx_is_ggx)
{
    enum { N = 1024 };
    double *log_d = malloc(N * sizeof *log_d);
    facet_slope_table *table = NULL;
    for (int i = 0; i < N; i++) {
        double u = (double)i / (N - 1), r = u < 1 ? 0.4 * u / (1 - u) : 0, x = r / 0.3,
               s = 1 + r * r;
        log_d[i] = u < 1 ? 2 * log(s) - 2 * log(1 + x * x) : 4 * log(0.3);
    }
    CHECK_INT(facet_slope_table_create(0.4, log_d, N, &table), FACET_OK);
    facet_material ggx = {.roughness = surfaces[0], .fresnel = terms[1]};
    facet_material tabulated = {.ndf = FACET_TABULATED,
                                .roughness = {.alpha_x = 1, .alpha_y = 1},
                                .fresnel = terms[1],
                                .table = table};
    for (double theta = 0; theta < 1.57; theta += 0.3) {
        const double o[3] = {sin(theta), 0, cos(theta)};
        facet_albedo_value a, b;
        CHECK_INT(albedo_of(&ggx, o, 1e-9, &a), FACET_OK);
        CHECK_INT(albedo_of(&tabulated, o, 1e-9, &b), FACET_OK);
        CHECK_REL(b.value[0], a.value[0], 1e-7, 0);
        CHECK(b.error[0] <= 2e-9 * b.value[0]);
    }
    facet_slope_table_destroy(table);
    free(log_d);
}

static facet_status power(void *user, const double at[INTEGRATE_POINTS],
                          struct integral of[INTEGRATE_POINTS])
{
    for (int i = 0; i < INTEGRATE_POINTS; i++) of[i].value[0] = pow(at[i], *(double *)user);
    return FACET_OK;
}

TEST(the_rule_is_kronrods)
{
    const double ends[] = {0, 1};
    for (double n = 0; n <= 22; n++) { /* exact to degree 22 */
        struct integrate_panel panel;
        struct integral sum;
        struct integrate rule = {
            .fn = power, .user = &n, .values = 1, .relative = 1, .panel = &panel, .panels = 1};
        CHECK_INT(facet_integrate(&rule, ends, 2, &sum), FACET_OK);
        CHECK_REL(sum.value[0], 1 / (n + 1), 1e-14, 0);
    }
}

/* ---- Over the wire ---------------------------------------------------------------------------- */

/* f = (1 - kd) specular + kd / pi: the albedo of a mirror-like half and of a white half. */
TEST(a_diffuse_part_counts)
{
    struct answer plain = ask_post(
        "/v1/albedo",
        "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[0.6,0,0.8]],\"tolerance\":1e-7}");
    struct answer mixed = ask_post(
        "/v1/albedo",
        "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3,\"diffuse\":0.25},\"wo\":[[0.6,0,0.8]],\"tolerance\":1e-7}");
    double specular = answer_number(&plain, "albedo", 0);
    CHECK(specular > 0.5 && specular < 1);
    CHECK_REL(answer_number(&mixed, "albedo", 0), 0.75 * specular + 0.25, 2e-7, 0);
    answer_clear(&plain);
    answer_clear(&mixed);
}

TEST(requests)
{
    struct answer a = ask_post(
        "/v1/albedo", "{\"material\":{\"alpha\":1},\"wo\":[[0,0,1],[0,0,-1]],\"average\":true,"
                      "\"tolerance\":1e-9}");
    CHECK_INT(a.response.status, 200);
    CHECK_REL(answer_number(&a, "albedo", 0), 1 - log(2), 1e-9, 0);
    CHECK(answer_number(&a, "albedo", 1) == 0);
    CHECK(answer_bound(&a) <= 1e-9);
    double average = answer_value(json_object_get(a.json, "average"));
    CHECK(average > 0.3 && average < 0.6);
    answer_clear(&a);
    a = ask_post("/v1/albedo",
                 "{\"material\":{\"alpha\":0.2,\"fresnel\":{\"conductor\":{\"metal\":\"Au\"}}},"
                 "\"wo\":{\"theta\":[0,1,1.5],\"phi\":[0]}}");
    CHECK_INT(answer_count(&a, "albedo"), 3);
    CHECK(answer_component(&a, "albedo", 1, 0) > answer_component(&a, "albedo", 1, 2));
    CHECK(!json_object_get(a.json, "average"));
    answer_clear(&a);
    static const struct {
        const char *body, *pointer;
    } bad[] = {
        {"{\"material\":{\"alpha\":1}}", "/wo"},
        {"{\"material\":{\"alpha\":1},\"wo\":[[0,0,1]],\"tolerance\":1e-15}", "/tolerance"},
        {"{\"material\":{\"alpha\":1},\"wo\":[[0,0,1]],\"tolerance\":0}", "/tolerance"},
        {"{\"material\":{\"alpha\":1},\"wo\":{\"random\":{\"n\":5000,\"seed\":1}}}", "/wo"},
        {"{\"material\":{\"alpha\":1},\"wo\":[[0,0,1]],\"average\":1}", "/average"},
        {"{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.01,\"mean_slope\":[5,0]},"
         "\"wo\":[[0.999,0,0.044710177812216]]}",
         "/tolerance"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        a = ask_post("/v1/albedo", bad[i].body);
        CHECK_INT(a.response.status, 422);
        CHECK_STR(answer_error(&a, "pointer"), bad[i].pointer);
        answer_clear(&a);
    }
}

static void lean(facet_material *m, bool leans)
{
    m->roughness.slope_x = leans ? .2 : 0;
    m->roughness.slope_y = leans ? -.1 : 0;
}

static void compare_albedos(facet_material m[2], bool leans)
{
    static const double views[][3] = {{0, 0, 1}, {.6, 0, .8}, {-.48, .8, .36}};
    for (int v = 0; v < 3; v++) {
        facet_albedo_value value[2];
        for (int k = 0; k < 2; k++) {
            lean(&m[k], leans);
            m[k].fresnel = terms[1];
            CHECK_INT(albedo_of(&m[k], views[v], 1e-6, &value[k]), FACET_OK);
        }
        double off = fabs(value[0].value[0] / value[1].value[0] - 1);
        check_note(leans ? "leaning" : "albedo", off);
        CHECK(off <= 2e-5);
    }
}

static void compare_means(facet_material m[2], bool leans)
{
    facet_albedo_options options = {.tolerance = 1e-3, .evaluations_max = 1 << 24};
    facet_albedo_value mean[2];
    for (int k = 0; k < 2; k++) {
        lean(&m[k], leans);
        CHECK_INT(facet_albedo_average(&m[k], &options, &mean[k], NULL), FACET_OK);
    }
    double off = fabs(mean[0].value[0] - mean[1].value[0]);
    check_note(leans ? "leaning mean" : "mean", off);
    CHECK(off <= mean[0].error[0] + mean[1].error[0]);
}

/* GGX of an ellipse as slopes over the azimuth: no ray of standard slopes is like another, and neither half. */
TEST(a_table_over_the_azimuth_has_the_albedo_of_its_source)
{
    enum { N = 61, ROWS = 60 };
    static double log_d[ROWS][N];
    const double ax = .3, ay = .15, rho = .4, scale = .3, pi = acos(-1),
                 kappa = sqrt(1 - rho * rho);
    for (int j = 0; j < ROWS; j++) {
        double x = cos(pi * j / ROWS) / ax, y = (sin(pi * j / ROWS) / ay - rho * x) / kappa,
               k = x * x + y * y;
        for (int i = 0; i < N; i++) {
            double u = i / (N - 1.), r = scale * u / (1 - u);
            log_d[j][i] = i == N - 1 ? -2 * log(k) : 2 * log((1 + r * r) / (1 + r * r * k));
        }
    }
    facet_material m[2] = {
        {.ndf = FACET_TABULATED, .roughness = {.alpha_x = 1, .alpha_y = 1}},
        {.ndf = FACET_GGX, .roughness = {.alpha_x = ax, .alpha_y = ay, .rho = rho}}};
    facet_slope_table *table;
    CHECK_INT(facet_slope_table_create_turned(scale, log_d[0], N, ROWS, NULL, &table), FACET_OK);
    m[0].table = table;
    for (int k = 0; k < 2 * FACET_MASKING_COUNT && table; k++) {
        m[0].masking = m[1].masking = (facet_masking)(k / 2);
        compare_albedos(m, k % 2);
    }
    m[0].masking = m[1].masking = FACET_SMITH;
    for (int leans = 0; leans < 2 && table; leans++) compare_means(m, leans);
    facet_slope_table_destroy(table);
}
