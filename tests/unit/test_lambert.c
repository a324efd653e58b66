/* ndf "lambert": what it answers, and what it has not. */
#include "ask.h"
#include "check.h"

#include <stdio.h>

static const double pi = 3.14159265358979323846;

static void check_refused(const char *path, const char *body, const char *pointer)
{
    struct answer a = ask_post(path, body);
    CHECK_INT(a.response.status, 422);
    if (a.response.status != 422 || strcmp(answer_error(&a, "pointer"), pointer))
        check_fail(__FILE__, __LINE__, "%s: %.300s", body, (char *)a.response.body);
    answer_clear(&a);
}

TEST(members_of_microfacets_are_refused)
{
    static const char *const members[][2] = {
        {"\"slopes\":{\"scale\":1,\"log_D\":[0,0,0,0]}", "slopes"},
        {"\"alpha\":0.3", "alpha"},
        {"\"alpha_x\":0.3", "alpha_x"},
        {"\"alpha_y\":0.3", "alpha_y"},
        {"\"rho\":0", "rho"},
        {"\"alpha_1\":0.3", "alpha_1"},
        {"\"alpha_2\":0.3", "alpha_2"},
        {"\"phi\":0", "phi"},
        {"\"moments\":[0,0,1,1,0]", "moments"},
        {"\"height_scale\":1", "height_scale"},
        {"\"jacobian\":[1,0,0,1]", "jacobian"},
        {"\"base\":{\"alpha\":0.1}", "base"},
        {"\"mean_slope\":[0,0]", "mean_slope"},
        {"\"masking\":\"vgroove\"", "masking"},
        {"\"shear\":\"thesis\"", "shear"},
        {"\"fresnel\":{\"schlick\":{\"f0\":0.04}}", "fresnel"},
        {"\"diffuse\":0.1", "diffuse"},
        {"\"transmission\":true", "transmission"},
        {"\"transport\":\"radiance\"", "transport"},
    };
    for (size_t i = 0; i < sizeof members / sizeof *members; i++) {
        char body[300], pointer[80];
        snprintf(body, sizeof body, "{\"material\":{\"ndf\":\"lambert\",\"reflectance\":0.5,%s}}",
                 members[i][0]);
        snprintf(pointer, sizeof pointer, "/material/%s", members[i][1]);
        check_refused("/v1/material", body, pointer);
    }
}

TEST(a_reflectance_is_lamberts_and_lambert_has_one)
{
    check_refused("/v1/material", "{\"material\":{\"ndf\":\"lambert\"}}", "/material/reflectance");
    check_refused("/v1/material", "{\"material\":{\"ndf\":\"lambert\",\"reflectance\":1.5}}",
                  "/material/reflectance");
    check_refused("/v1/material", "{\"material\":{\"alpha\":0.3,\"reflectance\":0.5}}",
                  "/material/reflectance");
    check_refused("/v1/material",
                  "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3,\"base\":{\"ndf\":\"lambert\","
                  "\"alpha\":1}}}",
                  "/material/base/ndf");
    check_refused("/v1/fit", "{\"source\":{\"ndf\":\"lambert\",\"reflectance\":0.5}}",
                  "/source/ndf");
    check_refused("/v1/sample",
                  "{\"material\":{\"ndf\":\"lambert\",\"reflectance\":0.5},\"wo\":[0,0,1],\"n\":1,"
                  "\"sampler\":\"ndf\"}",
                  "/sampler");
    check_refused("/v1/sample",
                  "{\"material\":{\"ndf\":\"lambert\",\"reflectance\":0.5},\"wo\":[0,0,1],\"n\":1,"
                  "\"solid_angle\":true}",
                  "/solid_angle");
}

/* In every tier, which are all the same arithmetic. */
TEST(fr_and_pdf_are_within_their_bound)
{
    static const char *const tiers[] = {"draft", "fast", "exact32", "precise"};
    for (size_t i = 0; i < 4; i++) {
        char body[400];
        snprintf(body, sizeof body,
                 "{\"material\":{\"ndf\":\"lambert\",\"reflectance\":[0,0.5,1]},\"wi\":{\"theta\":["
                 "1.57],\"phi\":[1]},"
                 "\"wo\":[0,0,1],\"tier\":\"%s\",\"tolerance\":1e-12,\"outputs\":[\"fr\",\"fr_"
                 "cos\",\"pdf\"]}",
                 tiers[i]);
        struct answer a = ask_post("/v1/eval", body);
        double bound = answer_bound(&a);
        CHECK_INT(a.response.status, 200);
        CHECK(bound > 0 && bound <= 1e-12);
        CHECK(answer_component(&a, "fr", 0, 0) == 0);
        CHECK_REL(answer_component(&a, "fr", 0, 1), 0.5 / pi, bound, 0);
        CHECK_REL(answer_component(&a, "fr_cos", 0, 2), cos(1.57) / pi, bound, 0);
        CHECK_REL(answer_number(&a, "pdf", 0), cos(1.57) / pi, bound, 0);
        answer_clear(&a);
    }
}

/* Of samples too: what is returned is evaluated as it stands. */
TEST(samples_evaluate_to_their_weight_and_pdf)
{
    struct answer a = ask_post(
        "/v1/sample", "{\"material\":{\"ndf\":\"lambert\",\"reflectance\":0.7},\"wo\":[0.6,0,0.8],"
                      "\"n\":1000,\"outputs\":[\"wi\",\"weight\",\"pdf\",\"h\"]}");
    CHECK_INT(answer_count(&a, "wi"), 1000);
    double bound = answer_bound(&a), mean = 0;
    for (size_t i = 0; i < answer_count(&a, "wi"); i++) {
        double z = answer_component(&a, "wi", i, 2), x = answer_component(&a, "wi", i, 0) + 0.6;
        double y = answer_component(&a, "wi", i, 1),
               h = sqrt(x * x + y * y + (z + 0.8) * (z + 0.8));
        CHECK_REL(answer_number(&a, "pdf", i), z / pi, bound, 0);
        CHECK_REL(answer_number(&a, "weight", i), 0.7, bound, 0);
        CHECK_REL(answer_component(&a, "h", i, 2), (z + 0.8) / h, 1e-13, 0);
        mean += z / 1000;
    }
    CHECK(fabs(mean - 2.0 / 3) < 4 * sqrt(1.0 / 18 / 1000)); /* of the cosine: variance 1/18 */
    answer_clear(&a);
}

TEST(below_the_horizon_there_is_nothing)
{
    struct answer a = ask_post(
        "/v1/eval", "{\"material\":{\"ndf\":\"lambert\",\"reflectance\":0.7},"
                    "\"wi\":[[0,0,1],[0,0,-1],[0,0,-1]],\"wo\":[[0,0,-1],[0,0,1],[0,0,-1]]}");
    CHECK_INT(answer_count(&a, "fr"), 3);
    for (size_t i = 0; i < 3; i++) CHECK(answer_number(&a, "fr", i) == 0);
    answer_clear(&a);
}

TEST(black_is_a_reflectance)
{
    struct answer a = ask_post(
        "/v1/eval", "{\"material\":{\"ndf\":\"lambert\",\"reflectance\":0},\"wi\":[[0.6,0,0.8]],"
                    "\"wo\":[0,0,1],\"outputs\":[\"fr\",\"pdf\"]}");
    CHECK(answer_number(&a, "fr", 0) == 0);
    CHECK_REL(answer_number(&a, "pdf", 0), 0.8 / pi, answer_bound(&a), 0);
    answer_clear(&a);
}
