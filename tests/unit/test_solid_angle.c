/* The solid angle of a sample: by its definition, against 1/(N pdf), and in sum. */
#include "ask.h"
#include "check.h"
#include "facet_solid_angle.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

static double solid_angle(const facet_roughness *r, double samples, const double i[3],
                          const double o[3])
{
    double out;
    const facet_vec3_in wi = {i, i + 1, i + 2}, wo = {o, o + 1, o + 2};
    facet_solid_angle(r, samples, wi, wo, 1, &out);
    return out;
}

/* wo mirrored at the normal with slopes x, y. */
static void mirror(const double o[3], double x, double y, double i[3])
{
    const double n = sqrt(1 + x * x + y * y), h[3] = {-x / n, -y / n, 1 / n};
    const double d = 2 * (o[0] * h[0] + o[1] * h[1] + o[2] * h[2]);
    for (int k = 0; k < 3; k++) i[k] = d * h[k] - o[k];
}

/* Of the triangle of three directions (Van Oosterom & Strackee 1983). */
static double triangle(const double a[3], const double b[3], const double c[3])
{
    const double det = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) +
                       a[2] * (b[0] * c[1] - b[1] * c[0]);
    double ab = 0, bc = 0, ca = 0;
    for (int k = 0; k < 3; k++) ab += a[k] * b[k], bc += b[k] * c[k], ca += c[k] * a[k];
    return 2 * fabs(atan2(det, 1 + ab + bc + ca));
}

/* What a small square of slopes, of the area the formula names, reflects to. */
TEST(a_square_of_slopes_reflects_to_it)
{
    static const double angles[] = {0, 0.5, 1, 1.4};
    for (int a = 0; a < 4; a++)
        for (int s = 0; s < 9; s++) {
            const double o[3] = {sin(angles[a]), 0, cos(angles[a])}, side = 1e-4;
            const double x = (s % 3 - 1) * 0.6, y = (s / 3 - 1) * 0.6;
            double i[3], corner[4][3];
            mirror(o, x, y, i);
            if (o[0] * -x + o[2] <= 0.05) continue; /* seen from behind */
            for (int k = 0; k < 4; k++)
                mirror(o, x + side * ((k == 1 || k == 2) - 0.5), y + side * ((k > 1) - 0.5),
                       corner[k]);
            const double area = triangle(corner[0], corner[1], corner[2]) +
                                triangle(corner[0], corner[2], corner[3]);
            const facet_roughness r = {
                .alpha_x = 0.2, .alpha_y = 0.2, .slope_x = 0.3, .slope_y = -0.1};
            CHECK_REL(solid_angle(&r, PI * 0.04 / (side * side), i, o), area, 1e-5, 0);
        }
}

/* At the mirror direction N pdf omega is G1 times alpha_1/alpha_2: the slope density has its peak there. */
TEST(it_is_the_mean_of_the_samples_at_the_peak)
{
    static const facet_roughness roughness[] = {
        {.alpha_x = 0.3, .alpha_y = 0.3},
        {.alpha_x = 0.02, .alpha_y = 0.02},
        {.alpha_x = 0.6, .alpha_y = 0.15},
    };
    for (int c = 0; c < 2 * 3 * 4; c++) {
        const facet_material m = {.ndf = c % 2 ? FACET_BECKMANN : FACET_GGX,
                                  .roughness = roughness[c / 2 % 3],
                                  .fresnel.channels = 1};
        const double t = 0.45 * (c / 6), o[3] = {sin(t), 0, cos(t)}, i[3] = {-sin(t), 0, cos(t)};
        const facet_vec3_in wi = {i, i + 1, i + 2}, wo = {o, o + 1, o + 2};
        facet_brdf *brdf = NULL;
        double pdf = 0, g1 = 0;
        facet_outputs out = {0};
        out.of[FACET_PDF][0] = &pdf;
        out.of[FACET_G1_O][0] = &g1;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        CHECK_INT(facet_eval(brdf, FACET_PRECISE, wi, wo, 1, &out), FACET_OK);
        facet_brdf_destroy(brdf);
        const double ratio = m.roughness.alpha_x / m.roughness.alpha_y;
        CHECK_REL(64 * pdf * solid_angle(&m.roughness, 64, i, o), g1 * ratio, 1e-13, 0);
    }
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

enum { N = 4096 };

/* Visible normals by their plain density. */
static struct answer ask_samples(const char *ndf, double alpha, double theta, const char *more)
{
    const char *sampler = strcmp(ndf, "ggx") ? "slope" : "caps";
    char body[500];
    snprintf(
        body, sizeof body,
        "{\"material\":{\"ndf\":\"%s\",\"alpha\":%g},\"wo\":{\"theta\":[%.17g],\"phi\":[0]},\"n\":%d,"
        "\"sequence\":\"sobol\",\"solid_angle\":true,\"tolerance\":1e-7,\"sampler\":\"%s\"%s}",
        ndf, alpha, theta, N, sampler, more);
    struct answer a = ask_post("/v1/sample", body);
    CHECK_INT(a.response.status, 200);
    CHECK_INT(answer_count(&a, "solid_angle"), N);
    return a;
}

/*
 * The median of omega N pdf, from above P/P(0) at the median normal: 1/4 of GGX, 1/2 of Beckmann.  It
 * stays near that from every side (with theta_o for theta_h, as printed, it would fall like cos^2 theta_o).
 */
TEST(the_share_of_the_median_sample_hardly_depends_on_wo)
{
    static const double degrees[] = {0, 30, 60, 80, 88};
    for (int c = 0; c < 2 * 2 * 5; c++) {
        struct answer a = ask_samples(c % 2 ? "beckmann" : "ggx", c / 2 % 2 ? 0.5 : 0.1,
                                      degrees[c / 4] * PI / 180, "");
        double ratio[N];
        for (size_t k = 0; k < N; k++)
            ratio[k] = N * answer_number(&a, "pdf", k) * answer_number(&a, "solid_angle", k);
        qsort(ratio, N, sizeof *ratio, ascending);
        const bool is_ggx = c % 2 == 0;
        CHECK(ratio[N / 2] > (is_ggx ? 0.08 : 0.49) && ratio[N / 2] < (is_ggx ? 0.26 : 0.8));
        if (c < 4) CHECK_REL(ratio[N / 2], is_ggx ? 0.25 : 0.5, 2e-3, 0);
        answer_clear(&a);
    }
}

/*
 * From above: the sum over all samples is 4 pi alpha^2 E[cos^4 theta_h], for GGX of alpha 1, whose
 * normals have the density cos theta_h/pi, 4 pi/3; and 1/(N pdf) sums to the sphere they reflect to.
 */
TEST(solid_angles_in_sum)
{
    struct answer a = ask_samples("ggx", 1, 0, "");
    double sum = 0, sphere = 0;
    for (size_t k = 0; k < N; k++) {
        sum += answer_number(&a, "solid_angle", k);
        sphere += 1 / (N * answer_number(&a, "pdf", k));
    }
    CHECK_REL(sum, 4 * PI / 3, 1e-3, 0);
    CHECK_REL(sphere, 4 * PI, 1e-6, 0);
    answer_clear(&a);
}

/* At the wi returned, whoever computes it; N is the samples of each wo. */
TEST(over_the_api)
{
    const char *material =
        "{\"ndf\":\"ggx\",\"alpha_x\":0.2,\"alpha_y\":0.5,\"rho\":0.3,\"mean_slope\":[0.1,-0.2]}";
    const facet_roughness r = {
        .alpha_x = 0.2, .alpha_y = 0.5, .rho = 0.3, .slope_x = 0.1, .slope_y = -0.2};
    static const double wo[2][3] = {{-0.6, 0, 0.8}, {0, 0.8, 0.6}};
    char body[400];
    for (int form = 0; form < 3; form++) {
        static const char *const of[] = {
            "\"n\":5", "\"u\":[[0.1,0.2],[0.7,0.3],[0.5,0.9]],\"pairing\":\"outer\"",
            "\"u\":[[0.1,0.2],[0.7,0.3]]"};
        static const size_t each[] = {5, 3, 1};
        snprintf(body, sizeof body,
                 "{\"material\":%s,\"wo\":[[-0.6,0,0.8],[0,0.8,0.6]],%s,\"solid_angle\":true,"
                 "\"outputs\":[\"wi\"],\"tolerance\":1e-12}",
                 material, of[form]);
        struct answer a = ask_post("/v1/sample", body);
        CHECK_INT(a.response.status, 200);
        CHECK_INT(answer_count(&a, "solid_angle"), 2 * each[form]);
        for (size_t k = 0; k < 2 * each[form]; k++) {
            const double i[3] = {answer_component(&a, "wi", k, 0), answer_component(&a, "wi", k, 1),
                                 answer_component(&a, "wi", k, 2)};
            CHECK_REL(answer_number(&a, "solid_angle", k),
                      solid_angle(&r, (double)each[form], i, wo[k / each[form]]), 1e-10, 0);
        }
        answer_clear(&a);
    }
    struct answer a = ask_post("/v1/sample",
                               "{\"material\":{\"alpha\":0.3},\"wo\":[[0,0,1]],\"n\":2}");
    CHECK(!json_object_get(a.json, "solid_angle"));
    answer_clear(&a);
}

/* wi = -wo has no half vector, and a normal seen from behind is one all the same. */
TEST(corners)
{
    const facet_roughness r = {.alpha_x = 0.3, .alpha_y = 0.3};
    const double o[3] = {0.6, 0, 0.8}, back[3] = {-0.6, 0, -0.8}, below[3] = {-0.8, 0, -0.9};
    CHECK(solid_angle(&r, 1, back, o) == 0);
    CHECK(solid_angle(&r, 1, below, o) > 0);
}
