/* height_scale, jacobian and base of a material, against the definitions on a sum of slopes. */
#include "ask.h"
#include "check.h"
#include "facet_leadr.h"
#include "material.h"

#include <math.h>
#include <stdio.h>

static const double e[5] = {0.1, -0.2, 0.06, 0.17, -0.015};

/* alpha_x, alpha_y, rho, mean slope of /v1/material. */
static bool material(const char *members, double out[5])
{
    char body[600];
    snprintf(body, sizeof body, "{\"material\":{\"ndf\":\"beckmann\",%s}}", members);
    struct answer a = ask_post("/v1/material", body);
    const json_t *b = json_object_get(a.json, "bivariate");
    const bool ok = a.response.status == 200;
    out[0] = answer_value(json_object_get(b, "alpha_x"));
    out[1] = answer_value(json_object_get(b, "alpha_y"));
    out[2] = answer_value(json_object_get(b, "rho"));
    out[3] = answer_number(&a, "mean_slope", 0);
    out[4] = answer_number(&a, "mean_slope", 1);
    answer_clear(&a);
    return ok;
}

/* square - a b without the rounding of the product, which a long double would still have. */
static long double central(double square, double a, double b)
{
    const double product = a * b;
    return ((long double)square - product) - fma(a, b, -product);
}

/* xx, yy, xy by transforming the covariance in long double, from second moments as sent. */
static void exact_covariance(const double m[5], double beta, const double j[4],
                             const double base[3], long double c[3])
{
    const long double ux = (long double)j[0] * beta, uy = (long double)j[1] * beta;
    const long double vx = (long double)j[2] * beta, vy = (long double)j[3] * beta;
    const long double xx = central(m[2], m[0], m[0]), yy = central(m[3], m[1], m[1]);
    const long double xy = central(m[4], m[0], m[1]);
    c[0] = ux * ux * xx + 2 * ux * vx * xy + vx * vx * yy + (long double)base[0] * base[0] / 2;
    c[1] = uy * uy * xx + 2 * uy * vy * xy + vy * vy * yy + (long double)base[1] * base[1] / 2;
    c[2] = ux * uy * xx + (ux * vy + uy * vx) * xy + vx * vy * yy +
           (long double)base[2] * base[0] * base[1] / 2;
}

/* alpha_x, alpha_y, rho and the mean slope. */
static void expected(const double m[5], double beta, const double j[4], const double base[3],
                     double out[5])
{
    long double c[3];
    exact_covariance(m, beta, j, base, c);
    out[0] = (double)sqrtl(2 * c[0]);
    out[1] = (double)sqrtl(2 * c[1]);
    out[2] = (double)(c[2] / sqrtl(c[0] * c[1]));
    out[3] = (double)(((long double)j[0] * m[0] + (long double)j[2] * m[1]) * beta);
    out[4] = (double)(((long double)j[1] * m[0] + (long double)j[3] * m[1]) * beta);
}

static void check_same(const char *members, const double want[5])
{
    double got[5] = {0};
    CHECK(material(members, got));
    for (int k = 0; k < 5; k++) CHECK_REL(got[k], want[k], 1e-14, 0.1);
}

#define MOMENTS "\"moments\":[0.1,-0.2,0.06,0.17,-0.015]"

TEST(height_scale_and_jacobian)
{
    const double one[4] = {1, 0, 0, 1}, shear[4] = {2, 0.5, -0.25, 1.5}, none[3] = {0};
    double want[5];
    expected(e, 1, one, none, want);
    check_same(MOMENTS, want);
    expected(e, 3, one, none, want);
    check_same(MOMENTS ",\"height_scale\":3", want);
    expected(e, 1, shear, none, want);
    check_same(MOMENTS ",\"jacobian\":[2,0.5,-0.25,1.5]", want);
    expected(e, -0.5, shear, none, want);
    check_same(MOMENTS ",\"jacobian\":[2,0.5,-0.25,1.5],\"height_scale\":-0.5", want);
}

TEST(base_is_a_process_below)
{
    const double shear[4] = {2, 0.5, -0.25, 1.5}, base[3] = {0.3, 0.2, -0.4};
    double want[5];
    expected(e, 2, shear, base, want);
    check_same(MOMENTS ",\"jacobian\":[2,0.5,-0.25,1.5],\"height_scale\":2,"
                       "\"base\":{\"alpha_x\":0.3,\"alpha_y\":0.2,\"rho\":-0.4}",
               want);
    /* A surface of its own on a sheared base. */
    const double alone[5] = {sqrt(0.25 + 0.09), sqrt(0.25 + 0.09), 0, 0.25, 0.5};
    check_same("\"alpha\":0.5,\"mean_slope\":[0.125,0.25],"
               "\"base\":{\"alpha\":0.3,\"mean_slope\":[0.125,0.25]}",
               alone);
    /* A flat map takes the base's roughness. */
    const double flat[5] = {0.3, 0.3, 0, 0, 0};
    check_same("\"moments\":[0,0,0,0,0],\"base\":{\"alpha\":0.3}", flat);
}

TEST(a_ggx_base_says_what_it_became)
{
    struct answer a = ask_post("/v1/material",
                               "{\"material\":{\"ndf\":\"beckmann\",\"moments\":[0,0,0,0,0],"
                               "\"base\":{\"ndf\":\"ggx\",\"alpha\":0.3}}}");
    CHECK_INT(a.response.status, 200);
    CHECK(answer_text(&a, "note"));
    CHECK_REL(answer_value(json_object_get(json_object_get(a.json, "bivariate"), "alpha_x")),
              0.3 * FACET_BECKMANN_OF_GGX, 1e-14, 0);
    CHECK_REL(answer_number(&a, "moments", 2), pow(0.3 * FACET_BECKMANN_OF_GGX, 2) / 2, 1e-14, 0);
    answer_clear(&a);
}

/* A map's moments sent at any level evaluate like the roughness they stand for. */
TEST(it_evaluates)
{
    double want[5];
    const double shear[4] = {2, 0.5, -0.25, 1.5}, base[3] = {0.1, 0.1, 0};
    expected(e, 0.5, shear, base, want);
    char body[600];
    snprintf(
        body, sizeof body,
        "{\"material\":{\"ndf\":\"beckmann\",\"alpha_x\":%.17g,\"alpha_y\":%.17g,\"rho\":%.17g,"
        "\"mean_slope\":[%.17g,%.17g]},\"wi\":[[0.6,0,0.8]],\"wo\":[[0,0.6,0.8]],"
        "\"tolerance\":1e-9}",
        want[0], want[1], want[2], want[3], want[4]);
    struct answer a = ask_post("/v1/eval", body);
    struct answer b = ask_post("/v1/eval", "{\"material\":{\"ndf\":\"beckmann\"," MOMENTS
                                           ",\"jacobian\":[2,0.5,-0.25,1.5],\"height_scale\":0.5,"
                                           "\"base\":{\"alpha\":0.1}},\"wi\":[[0.6,0,0.8]],"
                                           "\"wo\":[[0,0.6,0.8]],\"tolerance\":1e-9}");
    CHECK_INT(a.response.status, 200);
    CHECK_INT(b.response.status, 200);
    CHECK(answer_number(&a, "fr", 0) > 0);
    CHECK_REL(answer_number(&b, "fr", 0), answer_number(&a, "fr", 0), 2e-9, 0);
    answer_clear(&a);
    answer_clear(&b);
}

/* Thin ellipses: what rounding of the parameters may do to fr counts, so a tolerance that plain
 * moments meet is refused. */
TEST(ill_conditioned_moments_promise_less)
{
    static const char *const tails[] = {"}",
                                        ",\"jacobian\":[20,19,-19,-18.5],\"height_scale\":0.05}"};
    for (int i = 0; i < 2; i++) {
        char body[400];
        snprintf(body, sizeof body,
                 "{\"material\":{\"ndf\":\"beckmann\"," MOMENTS
                 "%s,\"wi\":[[0.6,0,0.8]],\"wo\":[[0,0.6,0.8]],\"tolerance\":%s}",
                 tails[i], "5e-12");
        struct answer a = ask_post("/v1/eval", body);
        CHECK_INT(a.response.status, i ? 422 : 200);
        answer_clear(&a);
    }
}

static void refused(const char *members, const char *pointer)
{
    char body[600];
    snprintf(body, sizeof body, "{\"material\":{%s}}", members);
    struct answer a = ask_post("/v1/material", body);
    CHECK_INT(a.response.status, 422);
    CHECK_STR(answer_error(&a, "pointer"), pointer);
    answer_clear(&a);
}

TEST(refusals)
{
    refused("\"alpha\":0.3,\"base\":{\"alpha\":0.3}", "/material/base");
    refused("\"ndf\":\"beckmann\",\"alpha\":0.3,\"height_scale\":2", "/material/height_scale");
    refused("\"ndf\":\"beckmann\",\"alpha\":0.3,\"jacobian\":[1,0,0,1]", "/material/jacobian");
    refused("\"ndf\":\"beckmann\"," MOMENTS ",\"jacobian\":[1,0,0]", "/material/jacobian");
    refused("\"ndf\":\"beckmann\"," MOMENTS ",\"jacobian\":[1,1,1,1]", "/material/moments");
    refused("\"ndf\":\"beckmann\"," MOMENTS ",\"height_scale\":0", "/material/moments");
    refused("\"ndf\":\"beckmann\"," MOMENTS ",\"height_scale\":1e9", "/material/moments");
    refused("\"ndf\":\"beckmann\",\"alpha\":0.3,\"base\":{}", "/material/base");
    refused("\"ndf\":\"beckmann\",\"alpha\":0.3,\"base\":{\"ndf\":\"tabulated\",\"alpha\":0.3}",
            "/material/base/ndf");
    refused("\"ndf\":\"beckmann\",\"alpha\":0.3,\"base\":{\"alpha\":0.3,\"masking\":\"none\"}",
            "/material/base/masking");
}

/*
 * What rounding does to the covariance is within the error handed on: random moments,
 * thin and sheared, against long double.  An error of the covariance C counts in its own
 * metric: the slopes that matter lie within a few ellipses.
 */
static double uniform_in(struct rng *rng, double low, double high)
{
    return low + (high - low) * rng_uniform(rng);
}

static bool open_random(struct rng *rng, double *relative, double *promised)
{
    double m[5], j[4], beta = exp(uniform_in(rng, -5, 5));
    const double ax = exp(uniform_in(rng, -6, 1)), ay = exp(uniform_in(rng, -6, 1));
    const double rho = uniform_in(rng, -1, 1) * (1 - exp(uniform_in(rng, -12, 0)));
    m[0] = uniform_in(rng, -2, 2), m[1] = uniform_in(rng, -2, 2);
    m[2] = ax * ax / 2 + m[0] * m[0], m[3] = ay * ay / 2 + m[1] * m[1];
    m[4] = rho * ax * ay / 2 + m[0] * m[1];
    for (int k = 0; k < 4; k++) j[k] = uniform_in(rng, -1, 1) * exp(uniform_in(rng, -4, 4));

    struct arena arena;
    struct problem problem = {0};
    struct decoder decoder = {.arena = &arena, .problem = &problem};
    struct material material = {0}, base = {0};
    struct surface surface;
    api_field_clear(api_material_fields, &material);
    api_field_clear(api_base_fields, &base);
    base.alpha = exp(uniform_in(rng, -9, 0));
    material.ndf = FACET_BECKMANN;
    material.moments = (struct numbers){5, m};
    material.jacobian = (struct numbers){4, j};
    material.height_scale = beta;
    if (rng_uniform(rng) < 0.5) material.base = &base;
    api_arena_open(&arena, 1 << 20);
    const bool ok = api_material_open(&material, NULL, &decoder, &surface);
    if (ok) {
        double want[5];
        long double c[3], got[3];
        const double b = material.base ? base.alpha : 0, below[3] = {b, b, 0};
        exact_covariance(m, beta, j, below, c);
        expected(m, beta, j, below, want);
        const facet_roughness *r = &surface.facet.roughness;
        got[0] = (long double)r->alpha_x * r->alpha_x / 2;
        got[1] = (long double)r->alpha_y * r->alpha_y / 2;
        got[2] = (long double)r->rho * r->alpha_x * r->alpha_y / 2;
        const long double det = c[0] * c[1] - c[2] * c[2];
        const long double minor = sqrtl(2 * det / (c[0] + c[1]));
        *relative = (double)((fabsl(got[0] - c[0]) * c[1] + fabsl(got[1] - c[1]) * c[0] +
                              2 * fabsl(got[2] - c[2]) * fabsl(c[2])) /
                                 det / 2 +
                             (fabsl(r->slope_x - want[3]) + fabsl(r->slope_y - want[4])) / minor);
        *promised = surface.parameter_error / api_slope_gain(FACET_BECKMANN);
    }
    api_arena_close(&arena);
    return ok;
}

TEST(rounding_of_the_parameters_is_in_the_bound)
{
    struct rng rng;
    double worst = 0;
    int opened = 0;
    rng_seed(&rng, 4);
    for (int i = 0; i < 20000; i++) {
        double relative, promised;
        if (!open_random(&rng, &relative, &promised)) continue;
        opened++;
        worst = check_worse(worst, relative / promised);
        if (!(relative <= promised))
            check_fail(__FILE__, __LINE__, "case %d: %g, promised %g", i, relative, promised);
    }
    CHECK(opened > 5000);
    check_note("error over promise", worst);
}
