#include "ask.h"
#include "check.h"
#include "random.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static void check_refused(const char *body, const char *pointer)
{
    struct answer a = ask_post("/v1/sample", body);
    CHECK_INT(a.response.status, 422);
    CHECK_STR(answer_error(&a, "pointer"), pointer);
    answer_clear(&a);
}

#define GGX "\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3}"

TEST(samples_have_the_pdf_that_pdf_says)
{
    static const char *const materials[] = {
        "{\"ndf\":\"ggx\",\"alpha_x\":0.2,\"alpha_y\":0.5,\"rho\":0.3}",
        "{\"ndf\":\"beckmann\",\"alpha\":0.4,\"mean_slope\":[0.2,0.1]}"};
    for (int m = 0; m < 2; m++) {
        char body[600];
        snprintf(body, sizeof body,
                 "{\"material\":%s,\"wo\":[[-0.6,0,0.8]],\"n\":50,\"seed\":3,\"tolerance\":1e-9}",
                 materials[m]);
        struct answer s = ask_post("/v1/sample", body);
        CHECK_INT(s.response.status, 200);
        CHECK_INT(answer_count(&s, "wi"), 50);
        long long wasted = 0;
        for (size_t i = 0; i < 50; i++) {
            double x = answer_component(&s, "wi", i, 0), y = answer_component(&s, "wi", i, 1);
            double z = answer_component(&s, "wi", i, 2), weight = answer_number(&s, "weight", i);
            wasted += z <= 0;
            CHECK_REL(sqrt(x * x + y * y + z * z), 1, 1e-8, 0);
            CHECK(weight >= 0 && weight <= 1 + 1e-9 && (weight > 0) == (z > 0));
            snprintf(body, sizeof body,
                     "{\"material\":%s,\"wi\":[[%.17g,%.17g,%.17g]],\"wo\":[[-0.6,0,0.8]],"
                     "\"outputs\":[\"pdf\",\"fr_cos\"],\"tolerance\":1e-9}",
                     materials[m], x, y, z);
            struct answer e = ask_post("/v1/eval", body);
            /* wi carries 1e-9 of absolute error, which the density feels through 1/alpha. */
            CHECK_REL(answer_number(&s, "pdf", i), answer_number(&e, "pdf", 0), 1e-7, 1e-30);
            CHECK_REL(weight * answer_number(&s, "pdf", i), answer_number(&e, "fr_cos", 0), 1e-7,
                      1e-9);
            answer_clear(&e);
        }
        CHECK_INT(json_integer_value(json_object_get(s.json, "wasted")), wasted);
        answer_clear(&s);
    }
}

/* All slopes of this table lie within its first cell: its samples' density had a sigma of its own. */
TEST(samples_of_a_table_far_wider_than_its_slopes)
{
    static const double wo[][3] = {{.6, 0, .8}, {.995, 0, .0998749}};
    char slopes[400 * 24] = "", body[sizeof slopes + 600];
    for (int i = 0; i < 399; i++) {
        double r = 1e4 * i / (399. - i);
        sprintf(slopes + strlen(slopes), "%.6g,", fmax(2 * log1p(r * r) - r * r, -1e4));
    }
    for (int k = 0; k < 2; k++) {
        snprintf(body, sizeof body,
                 "{\"material\":{\"ndf\":\"tabulated\",\"alpha\":0.3,\"slopes\":{\"scale\":1e4,"
                 "\"log_D\":[%s-1e4]}},\"wo\":[[%g,%g,%g]],\"n\":20,\"tolerance\":1e-7}",
                 slopes, wo[k][0], wo[k][1], wo[k][2]);
        struct answer s = ask_post("/v1/sample", body);
        CHECK_INT(s.response.status, 200);
        for (size_t i = 0; i < 20; i++) {
            double z = answer_component(&s, "wi", i, 2), pdf = answer_number(&s, "pdf", i);
            if (z <= 0) continue;
            snprintf(body, sizeof body,
                     "{\"material\":{\"ndf\":\"tabulated\",\"alpha\":0.3,\"slopes\":{\"scale\":1e4,"
                     "\"log_D\":[%s-1e4]}},\"wo\":[[%g,%g,%g]],\"wi\":[[%.17g,%.17g,%.17g]],"
                     "\"outputs\":[\"fr_cos\",\"pdf\"],\"tolerance\":1e-6}",
                     slopes, wo[k][0], wo[k][1], wo[k][2], answer_component(&s, "wi", i, 0),
                     answer_component(&s, "wi", i, 1), z);
            struct answer e = ask_post("/v1/eval", body);
            CHECK_INT(e.response.status, 200);
            /* wi is right to 1e-7, which the slopes feel 1/alpha and 1/z times. */
            CHECK_REL(pdf, answer_number(&e, "pdf", 0), 1e-4, 0);
            CHECK_REL(answer_number(&s, "weight", i) * pdf, answer_number(&e, "fr_cos", 0), 1e-4,
                      0);
            answer_clear(&e);
        }
        answer_clear(&s);
    }
}

/* A bound of .5 supports one digit, with which no direction has length 1. */
TEST(coarse_directions_are_taken_again)
{
    static const char *const tiers[] = {"draft", "fast"};
    static const double lengths[] = {2e-4, 1e-6};
    for (int t = 0; t < 2; t++) {
        char body[300];
        snprintf(
            body, sizeof body,
            "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.001,\"mean_slope\":[5,0.1]},"
            "\"wo\":[[0,0,1]],\"n\":50,\"outputs\":[\"wi\",\"h\"],\"flat\":true,\"tier\":\"%s\"}",
            tiers[t]);
        struct answer a = ask_post("/v1/sample", body);
        CHECK_INT(a.response.status, 200);
        CHECK(answer_value(json_object_get(json_object_get(a.json, "accuracy"), "bound")) > 0.1);
        for (size_t i = 0; i < 2 * 50; i++) {
            const char *name = i % 2 ? "wi" : "h";
            double v[3];
            for (size_t k = 0; k < 3; k++) v[k] = answer_number(&a, name, 3 * (i / 2) + k);
            CHECK_REL(sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), 1, lengths[t], 0);
        }
        answer_clear(&a);
    }
}

TEST(a_seed_means_the_documented_numbers)
{
    char body[600];
    struct answer by_seed = ask_post("/v1/sample",
                                     "{" GGX ",\"wo\":[[-0.6,0,0.8],[0,0,1]],\"n\":2,\"seed\":42,"
                                     "\"outputs\":[\"wi\",\"h\"],\"tolerance\":1e-9}");
    double r[8];
    for (unsigned k = 0; k < 8; k++) r[k] = api_random(42, k);
    snprintf(body, sizeof body,
             "{" GGX ",\"wo\":[[-0.6,0,0.8],[-0.6,0,0.8],[0,0,1],[0,0,1]],\"outputs\":[\"wi\","
             "\"h\"],\"tolerance\":1e-9,"
             "\"u\":[[%.17g,%.17g],[%.17g,%.17g],[%.17g,%.17g],[%.17g,%.17g]]}",
             r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7]);
    struct answer by_list = ask_post("/v1/sample", body);
    CHECK_INT(by_list.response.status, 200);
    CHECK(json_equal(json_object_get(by_seed.json, "wi"), json_object_get(by_list.json, "wi")));
    CHECK(json_equal(json_object_get(by_seed.json, "h"), json_object_get(by_list.json, "h")));
    CHECK(!json_object_get(by_seed.json, "weight"));
    answer_clear(&by_seed);
    answer_clear(&by_list);
}

TEST(random_is_splitmix64)
{
    /* First outputs for seed 1234567 as published with the algorithm. */
    CHECK(api_random(1234567, 0) == (double)(6457827717110365317ULL >> 11) * 0x1p-53);
    CHECK(api_random(1234567, 1) == (double)(3203168211198807973ULL >> 11) * 0x1p-53);
}

TEST(bad_requests)
{
    check_refused("{" GGX ",\"wo\":[[0,0,1]]}", "/u");
    check_refused("{" GGX ",\"wo\":[[0,0,1]],\"n\":1,\"u\":[[0,0]]}", "/n");
    check_refused("{" GGX ",\"wo\":[[0,0,1]],\"seed\":1,\"u\":[[0,0]]}", "/seed");
    check_refused("{" GGX ",\"wo\":[[0,0,1]],\"u\":[[0,1]]}", "/u/0/1");
    check_refused("{" GGX ",\"wo\":[[0,0,1]],\"u\":[[-0.1,0]]}", "/u/0/0");
    check_refused("{" GGX ",\"wo\":[[0,0,1]],\"u\":[0,0,0]}", "/u");
    check_refused("{" GGX ",\"wo\":[[0,0,1],[0,0,1]],\"u\":[[0,0],[0,0],[0,0]]}", "/wo");
    check_refused("{" GGX ",\"wo\":[[0,0,1]],\"n\":10000000}", "/n");
    check_refused("{" GGX ",\"wo\":{\"random\":{\"n\":2000}},\"n\":2000}", "/n");
    check_refused("{" GGX ",\"n\":1}", "/wo");
    check_refused(
        "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3},\"wo\":[[0,0,1]],\"n\":1,\"sampler\":\"caps\"}",
        "/sampler");
    check_refused("{" GGX ",\"wo\":[[0,0,1]],\"n\":1,\"sampler\":\"tables\"}", "/sampler");
    check_refused("{\"material\":{\"ndf\":\"tabulated\",\"slopes\":{\"scale\":1,\"log_D\":[0,0,0,0]"
                  "}},\"wo\":[[0,0,1]],\"n\":1,\"sampler\":\"caps\"}",
                  "/sampler");
}

TEST(the_ends_of_u_work)
{
    struct answer a = ask_post("/v1/sample",
                               "{" GGX ",\"wo\":[[-0.6,0,0.8]],\"u\":[[0,0],[0.9999999999999999,0."
                               "9999999999999999],[0,0.9999999999999999]]}");
    CHECK_INT(a.response.status, 200);
    CHECK_INT(answer_count(&a, "wi"), 3);
    answer_clear(&a);
}

TEST(colour_and_flat)
{
    struct answer a = ask_post("/v1/sample",
                               "{\"material\":{\"alpha\":0.3,\"fresnel\":{\"schlick\":{\"f0\":[0.9,"
                               "0.5,0.1]}}},\"wo\":[[0,0,1]],\"u\":[[0.5,0.5]],"
                               "\"outputs\":[\"wi\",\"weight\"],\"flat\":true}");
    CHECK_INT(answer_count(&a, "wi"), 3);
    CHECK_INT(answer_count(&a, "weight"), 3);
    CHECK(answer_number(&a, "weight", 0) > answer_number(&a, "weight", 2));
    answer_clear(&a);
}

/* Each method by its name, its density as /v1/pdf has it. */
TEST(samplers_by_name)
{
    static const struct {
        const char *ndf, *sampler;
    } cases[] = {{"ggx", "caps"},         {"ggx", "bounded"},    {"ggx", "slope"},
                 {"ggx", "ndf"},          {"ggx", "cosine"},     {"ggx", "vcavity"},
                 {"beckmann", "vcavity"}, {"beckmann", "slope"}, {"beckmann", "ndf"},
                 {"beckmann", "cosine"}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        char body[600];
        const char
            *material = "\"material\":{\"ndf\":\"%s\",\"alpha_x\":0.5,\"alpha_y\":0.3,\"rho\":0.2},"
                        "\"sampler\":\"%s\",\"tolerance\":1e-9,";
        char start[300];
        snprintf(start, sizeof start, material, cases[c].ndf, cases[c].sampler);
        snprintf(body, sizeof body, "{%s\"wo\":[[-0.6,0,0.8]],\"n\":20,\"seed\":3}", start);
        struct answer s = ask_post("/v1/sample", body);
        CHECK_INT(s.response.status, 200);
        CHECK_STR(answer_text(&s, "sampler"), cases[c].sampler);
        for (size_t i = 0; i < 20; i++) {
            double x = answer_component(&s, "wi", i, 0), y = answer_component(&s, "wi", i, 1);
            double z = answer_component(&s, "wi", i, 2), own = answer_number(&s, "pdf", i);
            snprintf(body, sizeof body, "{%s\"wi\":[[%.17g,%.17g,%.17g]],\"wo\":[[-0.6,0,0.8]]}",
                     start, x, y, z);
            struct answer p = ask_post("/v1/pdf", body);
            CHECK_STR(answer_text(&p, "sampler"), cases[c].sampler);
            CHECK_REL(own, answer_number(&p, "pdf", 0), 1e-6, 1e-30);
            snprintf(
                body, sizeof body,
                "{\"material\":{\"ndf\":\"%s\",\"alpha_x\":0.5,\"alpha_y\":0.3,\"rho\":0.2},"
                "\"wi\":[[%.17g,%.17g,%.17g]],\"wo\":[[-0.6,0,0.8]],\"outputs\":[\"fr_cos\"],\"tolerance\":1e-9}",
                cases[c].ndf, x, y, z);
            struct answer e = ask_post("/v1/eval", body);
            CHECK_REL(answer_number(&s, "weight", i) * own, answer_number(&e, "fr_cos", 0), 1e-6,
                      1e-9);
            answer_clear(&p);
            answer_clear(&e);
        }
        answer_clear(&s);
    }
}

static long long wasted_by(const char *sampler, const char *alpha, const char *wo)
{
    char body[400];
    snprintf(
        body, sizeof body,
        "{\"material\":{\"ndf\":\"ggx\",\"alpha\":%s},\"wo\":[%s],\"n\":5000,\"sampler\":\"%s\","
        "\"outputs\":[\"pdf\"]}",
        alpha, wo, sampler);
    struct answer a = ask_post("/v1/sample", body);
    CHECK_INT(a.response.status, 200);
    long long n = json_integer_value(json_object_get(a.json, "wasted"));
    answer_clear(&a);
    return n;
}

TEST(bounded_wastes_nothing_at_normal_incidence_and_less_elsewhere)
{
    static const char *const alphas[] = {"0.01", "0.1", "0.4", "1", "1.5", "4"};
    for (int k = 0; k < 6; k++) {
        CHECK_INT(wasted_by("bounded", alphas[k], "[0,0,1]"), 0);
        CHECK(wasted_by("bounded", alphas[k], "[-0.6,0,0.8]") <=
              wasted_by("caps", alphas[k], "[-0.6,0,0.8]"));
    }
    CHECK(wasted_by("caps", "1", "[0,0,1]") > 2000);
}

TEST(a_refused_sampler_names_those_there_are)
{
    struct answer a = ask_post(
        "/v1/sample", "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3},\"wo\":[[0,0,1]],"
                      "\"n\":1,\"sampler\":\"bounded\"}");
    CHECK_INT(a.response.status, 422);
    CHECK_STR(
        answer_error(&a, "detail"),
        "\"bounded\" does not sample beckmann, which has: auto, slope, ndf, cosine, vcavity, table");
    answer_clear(&a);
}
