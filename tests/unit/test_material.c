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
