#include "ask.h"
#include "check.h"

#include <math.h>
#include <stdio.h>

static double number(const struct answer *a, const char *object, const char *member)
{
    return answer_value(json_object_get(json_object_get(a->json, object), member));
}

TEST(moments_come_back_in_every_form)
{
    struct answer a = ask_post(
        "/v1/material",
        "{\"material\":{\"ndf\":\"beckmann\",\"moments\":[0.1,-0.2,0.06,0.17,-0.015]}}");
    CHECK_INT(a.response.status, 200);
    CHECK_REL(number(&a, "bivariate", "alpha_x"), sqrt(2 * (0.06 - 0.01)), 1e-14, 0);
    CHECK_REL(number(&a, "bivariate", "alpha_y"), sqrt(2 * (0.17 - 0.04)), 1e-14, 0);
    CHECK_REL(number(&a, "bivariate", "rho"), (-0.015 + 0.02) / sqrt(0.05 * 0.13), 1e-14, 0);
    CHECK(answer_number(&a, "mean_slope", 0) == 0.1 && answer_number(&a, "mean_slope", 1) == -0.2);
    double length = sqrt(1 + 0.01 + 0.04);
    CHECK_REL(answer_number(&a, "mean_normal", 0), -0.1 / length, 1e-14, 0);
    CHECK_REL(answer_number(&a, "mean_normal", 2), 1 / length, 1e-14, 0);
    CHECK(answer_number(&a, "moments", 4) == -0.015);
    CHECK_INT(answer_count(&a, "clamped"), 0);
    answer_clear(&a);
}

TEST(parameters_give_moments_that_give_the_parameters)
{
    struct answer a = ask_post("/v1/material",
                               "{\"material\":{\"ndf\":\"beckmann\",\"alpha_x\":0.2,\"alpha_y\":"
                               "0.4,\"rho\":0.5,\"mean_slope\":[0.3,0.7]}}");
    char body[400];
    snprintf(body, sizeof body,
             "{\"material\":{\"ndf\":\"beckmann\",\"moments\":[%.17g,%.17g,%.17g,%.17g,%.17g]}}",
             answer_number(&a, "moments", 0), answer_number(&a, "moments", 1),
             answer_number(&a, "moments", 2), answer_number(&a, "moments", 3),
             answer_number(&a, "moments", 4));
    answer_clear(&a);
    a = ask_post("/v1/material", body);
    CHECK_REL(number(&a, "bivariate", "alpha_x"), 0.2, 1e-13, 0);
    CHECK_REL(number(&a, "bivariate", "alpha_y"), 0.4, 1e-13, 0);
    CHECK_REL(number(&a, "bivariate", "rho"), 0.5, 1e-13, 0);
    answer_clear(&a);
}

TEST(the_ellipse_comes_back)
{
    struct answer a = ask_post("/v1/material",
                               "{\"material\":{\"alpha_1\":0.5,\"alpha_2\":0.1,\"phi\":0.4}}");
    CHECK_INT(a.response.status, 200);
    CHECK_REL(number(&a, "ellipse", "alpha_1"), 0.5, 1e-14, 0);
    CHECK_REL(number(&a, "ellipse", "alpha_2"), 0.1, 1e-13, 0);
    CHECK_REL(number(&a, "ellipse", "phi"), 0.4, 1e-13, 0);
    /* NOTATION: the major axis lies at -phi, so the slopes correlate negatively. */
    CHECK(number(&a, "bivariate", "rho") < 0);
    CHECK(!json_object_get(a.json, "moments"));
    answer_clear(&a);
}

/* Sends the members of an object, or a list, back as they stand in the answer; the status. */
static int sent_back(const struct answer *a, const char *member)
{
    char body[500], head[20];
    snprintf(head, sizeof head, "\"%s\":", member);
    const char *text = strstr(a->response.body, head);
    const int at = (int)strlen(head);
    if (!text) return 0;
    const bool is_list = text[at] == '[';
    const char *from = is_list ? text : text + at + 1;
    snprintf(body, sizeof body, "{\"material\":{\"ndf\":\"beckmann\",%.*s}}",
             (int)(strchr(from, is_list ? ']' : '}') - from) + is_list, from);
    struct answer back = ask_post("/v1/material", body);
    const int status = back.response.status;
    if (status != 200) printf("  %s: %s\n", body, answer_text(&back, "detail"));
    answer_clear(&back);
    return status;
}

/* At the ends of every range an answer is a request again; what it lost is in it. */
TEST(every_form_is_taken_again)
{
    static const char *const alphas[] = {"1e-8", "1e4", "1", "1.2345678901234567e-8"};
    static const char *const rhos[] = {"0.999999999999", "-0.999999999999", "0.5", "0"};
    static const char *const slopes[] = {"0", "1e-9", "0.1", "1e6"};
    for (int i = 0; i < 4 * 4 * 4 * 4; i++) {
        char body[300];
        snprintf(body, sizeof body,
                 "{\"material\":{\"ndf\":\"beckmann\",\"alpha_x\":%s,\"alpha_y\":%s,\"rho\":%s,"
                 "\"mean_slope\":[%s,0.01]}}",
                 alphas[i % 4], alphas[i / 4 % 4], rhos[i / 16 % 4], slopes[i / 64]);
        struct answer a = ask_post("/v1/material", body);
        CHECK_INT(a.response.status, 200);
        CHECK_INT(sent_back(&a, "bivariate"), 200);
        CHECK(number(&a, "error", "bivariate") == 0); /* it is what was sent */
        static const char *const forms[] = {"ellipse", "moments"};
        for (int k = 0; k < 2; k++) {
            if (!json_object_get(a.json, forms[k])) {
                CHECK(strstr(answer_text(&a, "note"), forms[k]));
                continue;
            }
            CHECK_INT(sent_back(&a, forms[k]), 200);
            CHECK(number(&a, "error", forms[k]) <= 0.1);
        }
        answer_clear(&a);
    }
}

TEST(what_a_form_loses_is_told)
{
    struct answer a = ask_post(
        "/v1/material",
        "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":1e-8,\"mean_slope\":[0.1,0]}}");
    /* E3 = .01 + 5e-17, whose last digit is 1.7e-18 */
    CHECK(number(&a, "error", "moments") > 1e-3 && number(&a, "error", "moments") < 2e-2);
    CHECK(number(&a, "error", "ellipse") == 0);
    answer_clear(&a);
    a = ask_post("/v1/material",
                 "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":1e-8,\"mean_slope\":[1,0]}}");
    CHECK(!json_object_get(a.json, "moments"));
    CHECK(strstr(answer_text(&a, "note"), "no moments"));
    answer_clear(&a);
    /* 1 - rho^2 is 2e-12, of which a double rho tells 1e-16 */
    a = ask_post("/v1/material",
                 "{\"material\":{\"alpha_1\":1e4,\"alpha_2\":0.01,\"phi\":0.78539816339}}");
    CHECK(number(&a, "error", "bivariate") > 1e-6 && number(&a, "error", "bivariate") < 1e-4);
    CHECK(number(&a, "error", "ellipse") == 0);
    answer_clear(&a);
}

TEST(an_ellipse_out_of_range_says_what_it_makes)
{
    struct answer a = ask_post("/v1/material", "{\"material\":{\"alpha_1\":12000,\"alpha_2\":1}}");
    CHECK_STR(answer_error(&a, "pointer"), "/material/alpha_1");
    CHECK_STR(answer_error(&a, "detail"),
              "alpha_x 12000, alpha_y 1, rho 0: alpha_x and alpha_y must lie in [1e-8, 1e4]");
    answer_clear(&a);
}

TEST(flags)
{
    struct answer a = ask_post(
        "/v1/material",
        "{\"material\":{\"alpha\":0.3,\"fresnel\":{\"schlick\":{\"f0\":[1,1,0.5]}}}}");
    CHECK(json_is_true(json_object_get(a.json, "isotropic")));
    CHECK(json_is_true(json_object_get(a.json, "central")));
    CHECK(json_is_true(json_object_get(a.json, "coloured")));
    CHECK_STR(answer_text(&a, "ndf"), "ggx");
    answer_clear(&a);
}

TEST(a_covariance_that_is_not_positive_is_named)
{
    struct answer a = ask_post("/v1/material",
                               "{\"material\":{\"ndf\":\"beckmann\",\"moments\":[1,0,1,1,0]}}");
    CHECK_INT(a.response.status, 422);
    CHECK_STR(answer_error(&a, "pointer"), "/material/moments");
    CHECK_STR(answer_error(&a, "detail"),
              "the covariance [[0, 0], [0, 1]] is not positive definite");
    answer_clear(&a);
    a = ask_post("/v1/material", "{\"material\":{\"ndf\":\"beckmann\",\"moments\":[0,0,1,1,1]}}");
    CHECK_STR(answer_error(&a, "detail"),
              "the covariance [[1, 1], [1, 1]] is not positive definite");
    answer_clear(&a);
}
