#include "ask.h"
#include "check.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double pi = 3.14159265358979323846;

#define GGX "\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3}"
#define PAIR "\"wi\":[[0.6,0,0.8]],\"wo\":[[-0.6,0,0.8]]"

/* Pointer of the first error of a body that must be refused with 422. */
static void check_refused(const char *body, const char *pointer)
{
    struct answer a = ask_post("/v1/eval", body);
    CHECK_INT(a.response.status, 422);
    if (a.response.status != 422 || strcmp(answer_error(&a, "pointer"), pointer))
        check_fail(__FILE__, __LINE__, "%s: %.300s", body, (char *)a.response.body);
    answer_clear(&a);
}

TEST(the_example_of_the_contract)
{
    struct answer a = ask_post("/v1/eval", "{" GGX "," PAIR ",\"tolerance\":1e-12}");
    CHECK_INT(a.response.status, 200);
    CHECK_STR(a.response.content_type, "application/json");
    CHECK_REL(answer_number(&a, "fr", 0), 1 / (pi * 0.09 * 2.624), 1e-12, 0);
    CHECK_INT(answer_count(&a, "fr"), 1);
    CHECK(answer_bound(&a) > 0 && answer_bound(&a) <= 1e-12);
    CHECK_INT(json_object_size(a.json), 3); /* nothing that was not asked */
    answer_clear(&a);
}

TEST(numbers_carry_the_digits_of_their_bound)
{
    struct answer a = ask_post("/v1/eval", "{" GGX "," PAIR ",\"tolerance\":0.01}");
    const char *from = strstr(a.response.body, "\"fr\":[");
    CHECK_REL(answer_number(&a, "fr", 0), 1 / (pi * 0.09 * 2.624), answer_bound(&a), 0);
    CHECK(from && strcspn(from + 6, "]") <= 12);
    answer_clear(&a);
    a = ask_post("/v1/eval", "{" GGX "," PAIR "}");
    CHECK(answer_bound(&a) <= 1e-6);
    CHECK_REL(answer_number(&a, "fr", 0), 1 / (pi * 0.09 * 2.624), answer_bound(&a), 0);
    answer_clear(&a);
}

TEST(outputs_are_those_asked_for_and_only_they)
{
    struct answer a = ask_post(
        "/v1/eval",
        "{" GGX "," PAIR ",\"outputs\":[\"D\",\"pdf\",\"F\",\"sigma_o\"],\"sampler\":\"caps\","
        "\"tolerance\":1e-10}");
    CHECK_REL(answer_number(&a, "D", 0), 1 / (pi * 0.09), 1e-10, 0);
    CHECK_REL(answer_number(&a, "sigma_o", 0), (0.8 + 0.82) / 2, 1e-10, 0);
    CHECK_REL(answer_number(&a, "pdf", 0), 1 / (pi * 0.09) / (4 * 0.81), 1e-10, 0);
    CHECK_REL(answer_number(&a, "F", 0), 1, 1e-10, 0);
    CHECK(!json_object_get(a.json, "fr"));
    answer_clear(&a);
}

TEST(colours)
{
    static const char *const gold =
        "{\"material\":{\"alpha\":0.3,\"fresnel\":{\"conductor\":{\"metal\":\"Au\"}}}," PAIR
        ",\"outputs\":[\"F\",\"D\"],\"tolerance\":1e-10%s}";
    char body[400];
    snprintf(body, sizeof body, gold, "");
    struct answer a = ask_post("/v1/eval", body);
    double red = answer_component(&a, "F", 0, 0), blue = answer_component(&a, "F", 0, 2);
    CHECK(red > 0.85 && red < 1 && blue > 0.3 && blue < red);
    CHECK(json_is_number(json_array_get(json_object_get(a.json, "D"), 0)));
    answer_clear(&a);
    snprintf(body, sizeof body, gold, ",\"flat\":true");
    a = ask_post("/v1/eval", body);
    CHECK_INT(answer_count(&a, "F"), 3);
    CHECK(answer_number(&a, "F", 0) == red && answer_number(&a, "F", 2) == blue);
    answer_clear(&a);
    snprintf(body, sizeof body, gold, ",\"channels\":1");
    check_refused(body, "/channels");
    check_refused("{" GGX "," PAIR ",\"channels\":2}", "/channels");
    a = ask_post("/v1/eval", "{" GGX "," PAIR ",\"channels\":3,\"tolerance\":1e-10}");
    CHECK(answer_component(&a, "fr", 0, 0) == answer_component(&a, "fr", 0, 2));
    CHECK_REL(answer_component(&a, "fr", 0, 1), 1 / (pi * 0.09 * 2.624), 1e-10, 0);
    answer_clear(&a);
}

TEST(fresnel_terms)
{
    static const struct {
        const char *term;
        double value; /* at cos theta_d = 0.8 */
    } cases[] = {
        {"\"ideal\"", 1},
        {"{\"schlick\":{\"f0\":0.04}}", 0.04 + 0.96 * 0.2 * 0.2 * 0.2 * 0.2 * 0.2},
        {"{\"table\":{\"cos_theta_d\":[0,0.6,1],\"values\":[1,0.5,0.25]}}", 0.375},
        {"{\"conductor\":{\"eta\":1.5,\"k\":0}}", -1},
        {"{\"dielectric\":{\"eta\":1.5}}", -1},
    };
    double equal[2] = {0, 1};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char body[400];
        snprintf(body, sizeof body,
                 "{\"material\":{\"alpha\":0.3,\"fresnel\":%s}," PAIR
                 ",\"outputs\":[\"F\"],\"tolerance\":1e-9}",
                 cases[i].term);
        struct answer a = ask_post("/v1/eval", body);
        CHECK_INT(a.response.status, 200);
        if (cases[i].value >= 0)
            CHECK_REL(answer_number(&a, "F", 0), cases[i].value, 1e-9, 0);
        else
            equal[i - 3] = answer_number(&a, "F", 0);
        answer_clear(&a);
    }
    /* A conductor that absorbs nothing is a dielectric. */
    CHECK_REL(equal[0], equal[1], 2e-9, 0);
}

TEST(bad_materials)
{
    static const char *const cases[][2] = {
        {"{}", "/material"},
        {"{\"ndf\":\"lambertian\",\"alpha\":1}", "/material/ndf"},
        {"{\"alpha\":-1}", "/material/alpha"},
        {"{\"alpha\":0}", "/material/alpha"},
        {"{\"alpha\":0.3,\"diffuse\":1.5}", "/material/diffuse"},
        {"{\"alpha\":0.3,\"diffuse\":[0.5,-0.1,0]}", "/material/diffuse/1"},
        {"{\"alpha\":0.3,\"alpha_x\":0.3,\"alpha_y\":0.3}", "/material"},
        {"{\"alpha_x\":0.3}", "/material/alpha_y"},
        {"{\"alpha_2\":0.3}", "/material/alpha_1"},
        {"{\"alpha\":0.3,\"rho\":0.5}", "/material"},
        {"{\"alpha\":0.3,\"alpha_x\":0.3}", "/material"},
        {"{\"rho\":0.3}", "/material/alpha_x"},
        {"{\"alpha_x\":0.3,\"alpha_y\":0.3,\"rho\":1}", "/material/rho"},
        {"{\"alpha_x\":0.3,\"alpha_y\":0.3,\"rho\":-1}", "/material/rho"},
        {"{\"alpha\":0.3,\"mean_slope\":[0]}", "/material/mean_slope"},
        {"{\"moments\":[0,0,1,1,0]}", "/material/moments"},
        {"{\"ndf\":\"beckmann\",\"moments\":[0,0,1,1,1]}", "/material/moments"},
        {"{\"ndf\":\"beckmann\",\"moments\":[1,0,1,1,0]}", "/material/moments"},
        {"{\"ndf\":\"beckmann\",\"moments\":[0,0,1,1,0],\"mean_slope\":[0,0]}",
         "/material/moments"},
        {"{\"ndf\":\"tabulated\",\"alpha\":1}", "/material/slopes"},
        {"{\"ndf\":\"ggx\",\"alpha\":1,\"slopes\":{\"scale\":1,\"log_D\":[0,0,0,0]}}",
         "/material/slopes"},
        {"{\"alpha\":0.3,\"masking\":\"vgroove\",\"shear\":\"thesis\"}", "/material/shear"},
        {"{\"alpha\":0.3,\"fresnel\":\"schlick\"}", "/material/fresnel"},
        {"{\"alpha\":0.3,\"fresnel\":{}}", "/material/fresnel"},
        {"{\"alpha\":0.3,\"fresnel\":{\"schlick\":{\"f0\":1},\"dielectric\":{\"eta\":1.5}}}",
         "/material/fresnel"},
        {"{\"alpha\":0.3,\"fresnel\":{\"schlick\":{\"f0\":[1,1.5,1]}}}",
         "/material/fresnel/schlick/f0/1"},
        {"{\"alpha\":0.3,\"fresnel\":{\"conductor\":{\"metal\":\"Xx\"}}}",
         "/material/fresnel/conductor/metal"},
        {"{\"alpha\":0.3,\"fresnel\":{\"conductor\":{\"eta\":1}}}", "/material/fresnel/conductor"},
        {"{\"alpha\":0.3,\"fresnel\":{\"conductor\":{\"eta\":1,\"k\":1,\"metal\":\"Au\"}}}",
         "/material/fresnel/conductor"},
        {"{\"alpha\":0.3,\"fresnel\":{\"table\":{\"cos_theta_d\":[0,1],\"values\":[1]}}}",
         "/material/fresnel/table/values"},
        {"{\"alpha\":0.3,\"fresnel\":{\"table\":{\"cos_theta_d\":[0,1],\"values\":[[1,1],[1,1]]}}}",
         "/material/fresnel/table/values"},
        {"{\"alpha\":0.3,\"fresnel\":{\"table\":{\"cos_theta_d\":[0,1,1],\"values\":[1,1,1]}}}",
         "/material/fresnel/table/cos_theta_d/2"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char body[400];
        snprintf(body, sizeof body, "{\"material\":%s," PAIR "}", cases[i][0]);
        check_refused(body, cases[i][1]);
    }
}

TEST(bad_directions)
{
    static const char *const cases[][2] = {
        {"\"wi\":[[0,0,1]]", "/wo"},
        {"\"wo\":[[0,0,1]]", "/wi"},
        {"\"h\":[[0,0,1]]", "/d"},
        {PAIR ",\"h\":[[0,0,1]]", "/wi"},
        {"\"wi\":[],\"wo\":[[0,0,1]]", "/wi"},
        {"\"wi\":[[0,0,1],[0,0,0]],\"wo\":[[0,0,1]]", "/wi/1"},
        {"\"wi\":[[0,0,1],[0,0,1],[0,0,1],[0.6,0,0.9]],\"wo\":[[0,0,1]]", "/wi/3"},
        {"\"wi\":[[0,0,1],[0,0,1]],\"wo\":[[0,0,1],[0,0,1],[0,0,1]]", "/wi"},
        {"\"wi\":[[0,0]],\"wo\":[[0,0,1]]", "/wi/0"},
        {"\"wi\":[0,0,1,0],\"wo\":[[0,0,1]]", "/wi"},
        {"\"wi\":{\"theta\":[0.1]},\"wo\":[[0,0,1]]", "/wi/phi"},
        {"\"wi\":{\"theta\":[0.1,0.2],\"phi\":[1,2,3]},\"wo\":[[0,0,1]]", "/wi/phi"},
        {"\"wi\":{\"theta\":[4],\"phi\":[1]},\"wo\":[[0,0,1]]", "/wi/theta/0"},
        {"\"wi\":{},\"wo\":[[0,0,1]]", "/wi"},
        {"\"wi\":{\"grid\":{\"theta\":4,\"phi\":4},\"random\":{\"n\":1}},\"wo\":[[0,0,1]]", "/wi"},
        {"\"wi\":{\"grid\":{\"theta\":0,\"phi\":4}},\"wo\":[[0,0,1]]", "/wi/grid/theta"},
        {"\"wi\":{\"grid\":{\"theta\":60000,\"phi\":60000}},\"wo\":[[0,0,1]]", "/wi/grid"},
        {"\"wi\":{\"random\":{\"n\":10000000}},\"wo\":[[0,0,1]]", "/wi/random/n"},
        {"\"wi\":{\"random\":{\"n\":1,\"seed\":-1}},\"wo\":[[0,0,1]]", "/wi/random/seed"},
        {"\"wi\":{\"random\":{\"n\":10000}},\"wo\":{\"random\":{\"n\":10000}},\"pairing\":"
         "\"outer\"",
         "/pairing"},
        {PAIR ",\"outputs\":[\"fr\",\"D_viz\"]", "/outputs/1"},
        {PAIR ",\"tolerance\":0", "/tolerance"},
        {PAIR ",\"tier\":\"exactly\"", "/tier"},
        {PAIR ",\"x/~y\":1", "/x~1~0y"},
        {"\"wi\":{\"random\":{\"n\":2000000}},\"wo\":[[0,0,1]],\"outputs\":[\"D\",\"F\",\"G\","
         "\"pdf\",\"fr\"]",
         "/outputs"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char body[400];
        snprintf(body, sizeof body, "{" GGX ",%s}", cases[i][0]);
        check_refused(body, cases[i][1]);
    }
}

TEST(a_tolerance_no_tier_can_promise)
{
    struct answer a = ask_post("/v1/eval", "{" GGX "," PAIR ",\"tolerance\":1e-15}");
    CHECK_INT(a.response.status, 422);
    CHECK_STR(answer_error(&a, "pointer"), "/tolerance");
    CHECK(strstr(answer_error(&a, "detail"), "the best bound is "));
    answer_clear(&a);
}

TEST(a_tier_can_be_forced)
{
    static const char *const tiers[] = {"fast", "precise"};
    for (int i = 0; i < 2; i++) {
        char body[300];
        snprintf(body, sizeof body, "{" GGX "," PAIR ",\"tier\":\"%s\"}", tiers[i]);
        struct answer a = ask_post("/v1/eval", body);
        CHECK_STR(json_string_value(json_object_get(json_object_get(a.json, "accuracy"), "tier")),
                  tiers[i]);
        CHECK_STR(a.response.trace.tier, tiers[i]);
        CHECK_REL(answer_number(&a, "fr", 0), 1 / (pi * 0.09 * 2.624), answer_bound(&a), 0);
        answer_clear(&a);
    }
    check_refused("{" GGX "," PAIR ",\"tier\":\"fast\",\"tolerance\":1e-12}", "/tier");
}

TEST(outer_pairs_have_the_first_list_slow)
{
    struct answer a = ask_post(
        "/v1/eval",
        "{" GGX ",\"wi\":[[0,0,1],[0.6,0,0.8]],\"wo\":[[0,0,1],[0,0.6,0.8],[-0.6,0,0.8]],"
        "\"pairing\":\"outer\",\"outputs\":[\"G1_i\",\"G1_o\"],\"tolerance\":1e-9}");
    double tilted = 0.8 / 0.81;
    CHECK_INT(answer_count(&a, "G1_i"), 6);
    for (size_t k = 0; k < 6; k++) {
        CHECK_REL(answer_number(&a, "G1_i", k), k / 3 ? tilted : 1, 1e-9, 0);
        CHECK_REL(answer_number(&a, "G1_o", k), k % 3 ? tilted : 1, 1e-9, 0);
    }
    answer_clear(&a);
}

/* The same surface in three forms: the answers agree within the sum of their bounds. */
TEST(forms_of_roughness_agree)
{
    double c = cos(0.4), s = sin(0.4), a1 = 0.5, a2 = 0.2;
    double xx = a1 * a1 * c * c + a2 * a2 * s * s, yy = a1 * a1 * s * s + a2 * a2 * c * c;
    double xy = (a2 * a2 - a1 * a1) * c * s;
    char materials[3][200];
    snprintf(materials[0], sizeof materials[0], "\"alpha_x\":%.17g,\"alpha_y\":%.17g,\"rho\":%.17g",
             sqrt(xx), sqrt(yy), xy / sqrt(xx * yy));
    snprintf(materials[1], sizeof materials[1], "\"alpha_1\":0.5,\"alpha_2\":0.2,\"phi\":0.4");
    snprintf(materials[2], sizeof materials[2], "\"moments\":[0,0,%.17g,%.17g,%.17g]", xx / 2,
             yy / 2, xy / 2);
    double d[3];
    for (int i = 0; i < 3; i++) {
        char body[900];
        snprintf(body, sizeof body,
                 "{\"material\":{\"ndf\":\"beckmann\",%s},\"wi\":[[0.36,0.48,0.8]],\"wo\":[[0.48,-"
                 "0.6,0.64]],\"outputs\":[\"fr\"],\"tolerance\":5e-12}",
                 materials[i]);
        struct answer a = ask_post("/v1/eval", body);
        CHECK_INT(a.response.status, 200);
        d[i] = answer_number(&a, "fr", 0);
        answer_clear(&a);
    }
    CHECK_REL(d[1], d[0], 1e-13, 0);
    CHECK_REL(d[2], d[0], 1e-13, 0);
}

TEST(moments_meet_tight_tolerances)
{
    struct answer a = ask_post(
        "/v1/eval", "{\"material\":{\"ndf\":\"beckmann\",\"moments\":[0,0,0.045,0.045,0]}," PAIR
                    ",\"outputs\":[\"D\"],\"tolerance\":1e-12}");
    CHECK_INT(a.response.status, 200);
    CHECK_REL(answer_number(&a, "D", 0), 1 / (pi * 0.09), 1e-12, 0);
    answer_clear(&a);
}

TEST(one_direction_goes_with_all)
{
    struct answer a = ask_post("/v1/eval",
                               "{" GGX ",\"wi\":[[0,0,1]],\"wo\":[0,0,1,0,0.6,0.8,-0.6,0,0.8],"
                               "\"outputs\":[\"G1_o\"],\"tolerance\":1e-9}");
    CHECK_INT(answer_count(&a, "G1_o"), 3);
    CHECK_REL(answer_number(&a, "G1_o", 0), 1, 1e-9, 0);
    CHECK_REL(answer_number(&a, "G1_o", 2), 0.8 / 0.81, 1e-9, 0);
    answer_clear(&a);
}

TEST(half_and_difference_vectors)
{
    /* d at the pole: wi = wo = h.  h at the pole: wi and wo are mirror images, at d. */
    struct answer a = ask_post("/v1/eval",
                               "{" GGX ",\"h\":[[0.6,0,0.8],[0,0,1]],\"d\":[[0,0,1],[0.6,0,0.8]],"
                               "\"outputs\":[\"D\",\"G1_i\",\"G1_o\",\"fr\"],\"tolerance\":1e-9}");
    CHECK_INT(a.response.status, 200);
    CHECK_REL(answer_number(&a, "G1_i", 0), 0.8 / 0.81, 1e-9, 0);
    CHECK_REL(answer_number(&a, "G1_o", 0), 0.8 / 0.81, 1e-9, 0);
    double t = 0.64 + 0.36 / 0.09; /* cos^2 + sin^2 / alpha^2 */
    CHECK_REL(answer_number(&a, "D", 0), 1 / (pi * 0.09 * t * t), 1e-9, 0);
    CHECK_REL(answer_number(&a, "fr", 1), 1 / (pi * 0.09 * 2.624), 1e-9, 0);
    answer_clear(&a);
}

/* Elements around the ends of chunks equal those evaluated alone. */
TEST(chunks_join_without_a_seam)
{
    enum { N = 20000 };
    struct answer all = ask_post(
        "/v1/eval",
        "{" GGX
        ",\"wi\":{\"grid\":{\"theta\":100,\"phi\":200}},\"wo\":[[-0.6,0,0.8]],\"tolerance\":1e-9}");
    CHECK_INT(answer_count(&all, "fr"), N);
    CHECK_INT(all.response.trace.evaluations, N);
    CHECK(all.response.trace.compute_us > 0 && all.response.trace.encode_us > 0);
    static const size_t at[] = {0, 1, 8191, 8192, 8193, 16383, 16384, N - 1};
    for (size_t i = 0; i < sizeof at / sizeof *at; i++) {
        double theta = ((double)(at[i] / 200) + 0.5) * (pi / 2) / 100;
        double phi = ((double)(at[i] % 200) + 0.5) * (2 * pi) / 200;
        char body[300];
        snprintf(body, sizeof body,
                 "{" GGX ",\"wi\":[[%.17g,%.17g,%.17g]],\"wo\":[[-0.6,0,0.8]],\"tolerance\":1e-9}",
                 sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta));
        struct answer one = ask_post("/v1/eval", body);
        CHECK_REL(answer_number(&all, "fr", at[i]), answer_number(&one, "fr", 0), 2e-9, 1e-30);
        answer_clear(&one);
    }
    answer_clear(&all);
}

TEST(random_directions_are_uniform_and_repeatable)
{
    static const char *const body = "{" GGX ",\"wi\":[[0,0,1]],\"wo\":{\"random\":{\"n\":20000,"
                                    "\"seed\":%d}},\"outputs\":[\"sigma_o\"]}";
    char text[300];
    snprintf(text, sizeof text, body, 7);
    struct answer a = ask_post("/v1/eval", text), again = ask_post("/v1/eval", text);
    snprintf(text, sizeof text, body, 8);
    struct answer other = ask_post("/v1/eval", text);
    CHECK(json_equal(json_object_get(a.json, "sigma_o"), json_object_get(again.json, "sigma_o")));
    CHECK(!json_equal(json_object_get(a.json, "sigma_o"), json_object_get(other.json, "sigma_o")));
    /* Mean over the hemisphere of sigma = (z + sqrt(alpha^2 (1 - z^2) + z^2)) / 2, z uniform. */
    double sum = 0, exact = 0;
    for (size_t i = 0; i < 20000; i++) sum += answer_number(&a, "sigma_o", i) / 20000;
    for (int i = 0; i < 10000; i++) {
        double z = (i + 0.5) / 10000;
        exact += (z + sqrt(0.09 * (1 - z * z) + z * z)) / 2 / 10000;
    }
    CHECK_REL(sum, exact, 5 * 0.3 / sqrt(20000), 1);
    answer_clear(&a);
    answer_clear(&again);
    answer_clear(&other);
}

TEST(lengths_within_a_thousandth_are_normalised)
{
    struct answer near = ask_post(
        "/v1/eval",
        "{" GGX ",\"wi\":[[0.6003,0,0.8004]],\"wo\":[[-0.6,0,0.8]],\"tolerance\":1e-9}");
    CHECK_REL(answer_number(&near, "fr", 0), 1 / (pi * 0.09 * 2.624), 1e-9, 0);
    answer_clear(&near);
    /* Within a millionth: the numbers as given. */
    struct answer given = ask_post(
        "/v1/eval",
        "{" GGX ",\"wi\":[[0.6,0,0.8000005]],\"wo\":[[-0.6,0,0.8]],\"tolerance\":1e-9}");
    double z = 0.8000005, ri = sqrt(0.09 * 0.36 + z * z);
    CHECK_REL(answer_number(&given, "fr", 0), 1 / (pi * 0.09) / (2 * (0.82 * z + ri * 0.8)), 1e-9,
              0);
    answer_clear(&given);
}

TEST(below_the_horizon_is_zero)
{
    struct answer a = ask_post(
        "/v1/eval",
        "{" GGX
        ",\"wi\":[[0.6,0,-0.8],[0,0,-1]],\"wo\":[[-0.6,0,0.8]],\"outputs\":[\"fr\",\"fr_cos\"]}");
    for (size_t i = 0; i < 2; i++)
        CHECK(answer_number(&a, "fr", i) == 0 && answer_number(&a, "fr_cos", i) == 0);
    answer_clear(&a);
}

TEST(shear_by_the_thesis_has_a_larger_bound)
{
    static const char
        *const body = "{\"material\":{\"alpha\":0.3,\"mean_slope\":[0.5,0],\"shear\":\"%s\"}," PAIR
                      ",\"tier\":\"precise\"}";
    char text[300];
    snprintf(text, sizeof text, body, "thesis");
    struct answer thesis = ask_post("/v1/eval", text);
    snprintf(text, sizeof text, body, "energy_safe");
    struct answer safe = ask_post("/v1/eval", text);
    CHECK_INT(thesis.response.status, 200);
    CHECK(answer_bound(&thesis) > answer_bound(&safe));
    answer_clear(&thesis);
    answer_clear(&safe);
}

static bool always(void *asked)
{
    ++*(int *)asked;
    return true;
}

static void check_ends(const char *path, const char *body)
{
    int asked = 0;
    struct answer a = ask_with((struct api_request){.method = "POST",
                                                    .path = path,
                                                    .body = body,
                                                    .body_size = strlen(body),
                                                    .cancelled = always,
                                                    .user = &asked});
    CHECK_INT(a.response.status, 503);
    CHECK_INT(asked, 1);
    answer_clear(&a);
}

TEST(cancelled_requests_end)
{
    check_ends("/v1/eval", "{" GGX ",\"wi\":{\"random\":{\"n\":100000}},\"wo\":[[0,0,1]]}");
}

/* The look at computed directions, before a tier is chosen (none would serve), ends as well. */
TEST(cancelled_surveys_end)
{
    check_ends("/v1/sample",
               "{" GGX ",\"wo\":{\"theta\":[0.5],\"phi\":[1]},\"n\":10,\"tolerance\":1e-15}");
}

/* A table over the azimuth takes up to 3 s to make. */
TEST(cancelled_tables_end)
{
    check_ends("/v1/eval",
               "{\"material\":{\"ndf\":\"tabulated\",\"alpha\":0.3,\"slopes\":{\"scale\":1,"
               "\"log_D\":[[0,0,0,0],[0,1,0,0],[0,2,0,0],[0,0,1,0]]}}," PAIR "}");
}

TEST(a_table_of_the_ggx_shape_is_ggx)
{
    /* log D of GGX with alpha 1 is constant in theta: -log pi. */
    static const char *const body =
        "{\"material\":{\"ndf\":\"tabulated\",\"alpha\":0.3,\"slopes\":{\"scale\":1,\"log_D\":[0,0,"
        "0,0,0,0,0,0]}}," PAIR ",\"outputs\":[\"D\"],\"tolerance\":1e-3}";
    struct answer a = ask_post("/v1/eval", body);
    CHECK_INT(a.response.status, 200);
    CHECK_REL(answer_number(&a, "D", 0), 1 / (pi * 0.09), answer_bound(&a), 0);
    answer_clear(&a);
}
