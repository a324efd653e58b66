/* POST /v1/fit through the api's door. */
#include "ask.h"
#include "check.h"
#include "facet_fit.h"
#include "measured.h"
#include "merl.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define PI 3.14159265358979323846

static bool is_cancelled(void *user)
{
    return *(int *)user != 0;
}

static struct answer post(const char *path, const char *query, const char *type, const void *body,
                          size_t size, int *cancel)
{
    return ask_with((struct api_request){.method = "POST",
                                         .path = path,
                                         .query = query,
                                         .content_type = type,
                                         .body = body,
                                         .body_size = size,
                                         .cancelled = cancel ? is_cancelled : NULL,
                                         .user = cancel});
}

/* What was answered, which must have this status; to be decref'd. */
static json_t *answer_of(struct answer answer, int status)
{
    CHECK_INT(answer.response.status, status);
    if (!answer.json) check_fail(__FILE__, __LINE__, "the answer is not JSON");
    if (answer.response.status != status)
        printf("  %.300s\n", answer.response.body ? (char *)answer.response.body : "");
    json_t *json = json_incref(answer.json);
    answer_clear(&answer);
    return json;
}

static json_t *fit_json(const char *body, int status)
{
    return answer_of(post("/v1/fit", NULL, "application/json", body, strlen(body), NULL), status);
}

static double number_at(const json_t *json, const char *first, const char *second)
{
    json_t *at = json_object_get(json, first);
    return answer_value(second ? json_object_get(at, second) : at);
}

static const char *text_at(const json_t *json, const char *first, const char *second)
{
    json_t *at = json_object_get(json, first);
    return json_string_value(second ? json_object_get(at, second) : at);
}

/* fr of a material at these pairs by /v1/eval: [row][3]; to be decref'd. */
static json_t *evaluate(json_t *material, json_t *wi, json_t *wo)
{
    if (!json_is_object(material)) return NULL; /* what failed has been said */
    json_t *request = json_pack("{s:O,s:O,s:O,s:s,s:i}", "material", material, "wi", wi, "wo", wo,
                                "tier", "precise", "channels", 3);
    size_t size = json_dumpb(request, NULL, 0, 0); /* json_dumps would use the api's allocator */
    char *body = calloc(1, size + 1);
    json_dumpb(request, body, size, 0);
    json_t *answer = answer_of(post("/v1/eval", NULL, "application/json", body, size, NULL), 200);
    json_t *fr = json_incref(json_object_get(answer, "fr"));
    free(body);
    json_decref(request);
    json_decref(answer);
    return fr;
}

static void append(json_t *list, const double v[3])
{
    json_array_append_new(list, json_pack("[f,f,f]", v[0], v[1], v[2]));
}

static double channel(const json_t *fr, size_t row, size_t c)
{
    return answer_value(json_array_get(json_array_get(fr, row), c));
}

/* The pairs of facet_fit.h's definition, every skip-th of those above the horizon. */
static void error_pairs(json_t *wi, json_t *wo, size_t skip)
{
    size_t at = 0;
    for (int a = 0; a < 45; a++) {
        for (int b = 0; b < 40; b++) {
            for (int c = 0; c < 12; c++) {
                double th = PI / 2 * pow((a + .5) / 45, 2), td = PI / 2 * (b + .5) / 40,
                       pd = PI * (c + .5) / 12;
                double d[3] = {sin(td) * cos(pd), sin(td) * sin(pd), cos(td)},
                       h[3] = {sin(th), 0, cos(th)};
                double i[3] = {cos(th) * d[0] + sin(th) * d[2], d[1],
                               -sin(th) * d[0] + cos(th) * d[2]},
                       o[3];
                for (int m = 0; m < 3; m++) o[m] = 2 * d[2] * h[m] - i[m];
                if (i[2] < 1e-3 || o[2] < 1e-3 || at++ % skip) continue;
                append(wi, i);
                append(wo, o);
            }
        }
    }
}

TEST(source_comes_back)
{
    static const char *const bodies[] = {
        "{\"source\":{\"ndf\":\"ggx\",\"alpha\":0.3,\"fresnel\":{\"schlick\":{\"f0\":[0.95,0.64,0."
        "54]}}}}",
        "{\"source\":{\"ndf\":\"beckmann\",\"alpha\":0.15},\"model\":\"beckmann\"}",
    };
    for (int k = 0; k < 2; k++) {
        json_t *fit = fit_json(bodies[k], 200);
        CHECK_STR(text_at(fit, "chosen", "model"), k ? "beckmann" : "ggx");
        CHECK_STR(text_at(fit, "chosen", "fresnel"), "schlick");
        CHECK(json_is_true(json_object_get(json_object_get(fit, "chosen"), "meets_tolerance")));
        CHECK_STR(text_at(fit, "source_convention", NULL), "correlated");
        CHECK_REL(number_at(fit, "material", "alpha"), k ? .15 : .3, 1e-6, 0);
        CHECK(number_at(fit, "error", "rms_log") < 1e-5);
        CHECK_INT(json_array_size(json_object_get(fit, "candidates")),
                  1); /* nothing larger is better */
        CHECK(number_at(fit, "timing_ms", NULL) > 0);
        json_decref(fit);
    }
}

/* The number, through the wire and back through /v1/eval. */
TEST(beckmann_tabulated_at_resolution_90)
{
    static const double alphas[] = {.01, .02, .05, .15};
    for (int k = 0; k < 4; k++) {
        char body[200];
        snprintf(body, sizeof body,
                 "{\"source\":{\"ndf\":\"beckmann\",\"alpha\":%g},\"model\":\"tabulated\","
                 "\"resolution\":90}",
                 alphas[k]);
        json_t *fit = fit_json(body, 200), *material = json_object_get(fit, "material");
        json_t *slopes = json_object_get(material, "slopes"), *o = json_array();
        CHECK_INT(json_array_size(json_object_get(slopes, "log_D")), 91);
        CHECK(json_is_number(json_array_get(json_object_get(slopes, "log_D"), 0)));
        double scale = number_at(slopes, "scale", NULL), worst = 0;
        for (int i = 0; i < 500; i++) {
            double u = i / 500., r = scale * u / (1 - u), z = 1 / sqrt(1 + r * r);
            append(o, (double[3]){r * z, 0, z});
        }
        json_t *source = json_pack("{s:s,s:f}", "ndf", "beckmann", "alpha", alphas[k]);
        json_t *exact = evaluate(source, o, o), *got = evaluate(material, o, o);
        double peak = channel(exact, 0, 0);
        for (size_t i = 0; i < 500 && channel(exact, i, 0) > 1e-4 * peak; i++)
            worst = check_worse(worst, fabs(channel(got, i, 0) / channel(exact, i, 0) - 1));
        CHECK(peak > 0 && worst <= 1e-4); /* asked: 1e-3 */
        check_note("backscatter", worst);
        json_decref(exact);
        json_decref(got);
        json_decref(source);
        json_decref(o);
        json_decref(fit);
    }
}

/* rms_log of the answer's material, evaluated again by /v1/eval. */
TEST(stated_error_is_the_error)
{
    static const char source_text[] = "{\"ndf\":\"ggx\",\"alpha\":0.4,\"fresnel\":{\"conductor\":{"
                                      "\"metal\":\"Au\"}},\"masking\":\"vgroove\"}";
    static const char *const models[] = {"ggx", "tabulated"};
    for (int k = 0; k < 2; k++) {
        char body[400];
        snprintf(body, sizeof body, "{\"source\":%s,\"model\":\"%s\"}", source_text, models[k]);
        json_t *fit = fit_json(body, 200), *wi = json_array(), *wo = json_array();
        error_pairs(wi, wo, 1);
        CHECK_INT(json_array_size(wi), json_integer_value(json_object_get(fit, "pairs")));
        json_t *source = json_loads(source_text, 0, NULL);
        json_t *f = evaluate(source, wi, wo),
               *g = evaluate(json_object_get(fit, "material"), wi, wo);
        double sum = 0;
        for (size_t i = 0; i < json_array_size(wi); i++) {
            for (size_t c = 0; c < 3; c++) {
                double z = channel(wi, i, 2);
                double x = log((1e-3 + channel(f, i, c) * z) / (1e-3 + channel(g, i, c) * z));
                sum += x * x;
            }
        }
        CHECK_REL(sqrt(sum / (3. * (double)json_array_size(wi))),
                  number_at(fit, "error", "rms_log"), 1e-6, 0);
        check_note("rms_log", number_at(fit, "error", "rms_log"));
        json_decref(f);
        json_decref(g);
        json_decref(source);
        json_decref(wi);
        json_decref(wo);
        json_decref(fit);
    }
}

TEST(auto_takes_the_smallest_that_meets_the_tolerance)
{
    static const char *const tolerances[] = {"10", "0.005", "1e-9"};
    double bytes[3];
    for (int k = 0; k < 3; k++) {
        char body[300];
        snprintf(body, sizeof body,
                 "{\"source\":{\"ndf\":\"ggx\",\"alpha\":0.4,\"fresnel\":{\"dielectric\":{\"eta\":"
                 "1.5}}},\"tolerance\":%s}",
                 tolerances[k]);
        json_t *fit = fit_json(body, 200), *chosen = json_object_get(fit, "chosen"), *candidate;
        const char *model = json_string_value(json_object_get(chosen, "model"));
        const char *fresnel = json_string_value(json_object_get(chosen, "fresnel"));
        bool meets = json_is_true(json_object_get(chosen, "meets_tolerance"));
        double rms = number_at(fit, "error", "rms_log"), tolerance = atof(tolerances[k]);
        size_t index, found = 0;
        CHECK(meets == (rms <= tolerance));
        CHECK(meets == (k < 2));
        CHECK(strstr(json_string_value(json_object_get(chosen, "why")),
                     meets ? "smallest" : "no candidate") != NULL);
        json_array_foreach(json_object_get(fit, "candidates"), index, candidate)
        {
            double size = number_at(candidate, "bytes", NULL),
                   error = number_at(candidate, "error", "rms_log");
            bool same = !strcmp(text_at(candidate, "model", NULL), model) &&
                        !strcmp(text_at(candidate, "fresnel", NULL), fresnel) && error == rms;
            CHECK(number_at(candidate, "ns_per_eval", NULL) > 0);
            if (same) {
                found++;
                bytes[k] = size;
                CHECK_REL(error, rms, 1e-12, 0);
            }
        }
        json_array_foreach(json_object_get(fit, "candidates"), index, candidate)
        {
            double size = number_at(candidate, "bytes", NULL),
                   error = number_at(candidate, "error", "rms_log");
            if (meets && error <= tolerance) CHECK(size >= bytes[k]);
            if (!meets) CHECK(error >= rms);
        }
        CHECK_INT(found, 1);
        json_decref(fit);
    }
    CHECK(bytes[0] < bytes[1]); /* Schlick is not the dielectric: it takes a table */
}

static void check_refused(const char *body, const char *pointer)
{
    json_t *problem = fit_json(body, 422);
    json_t *error = json_array_get(json_object_get(problem, "errors"), 0);
    CHECK_STR(json_string_value(json_object_get(error, "pointer")), pointer);
    json_decref(problem);
}

/* A source at either end of the range of alpha is fitted, within it. */
TEST(ends_of_alpha)
{
    static const char *const ndfs[] = {"ggx", "beckmann"};
    static const double alphas[] = {FACET_ALPHA_MIN, 1e3, FACET_ALPHA_MAX};
    for (int n = 0; n < 2; n++) {
        for (int k = 0; k < 3; k++) {
            char body[128];
            snprintf(body, sizeof body, "{\"source\":{\"ndf\":\"%s\",\"alpha\":%g}}", ndfs[n],
                     alphas[k]);
            json_t *fit = fit_json(body, 200);
            CHECK_STR(text_at(fit, "material", "ndf"), ndfs[n]);
            double alpha = number_at(fit, "material", "alpha");
            CHECK(alpha >= FACET_ALPHA_MIN && alpha <= FACET_ALPHA_MAX);
            CHECK_REL(alpha, alphas[k], 1e-6, 0);
            json_decref(fit);
        }
    }
}

TEST(refusals_name_the_member)
{
    check_refused("{}", "/source");
    check_refused("{\"source\":{\"ndf\":\"ggx\",\"alpha\":0.3,\"mean_slope\":[0.1,0]}}", "/source");
    check_refused("{\"source\":{\"ndf\":\"ggx\",\"alpha\":-1}}", "/source/alpha");
    check_refused("{\"samples\":{\"wi\":[],\"wo\":[],\"fr\":[]}}", "/samples/wi");
    check_refused("{\"source\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"anisotropic\":true}",
                  "/anisotropic");
    check_refused("{\"source\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"masking\":\"smith_uncorrelated\"}",
                  "/masking");
    check_refused("{\"source\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"model\":\"phong\"}", "/model");
    check_refused("{\"source\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"resolution\":2}", "/resolution");
    check_refused("{\"source\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"tolerance\":0}", "/tolerance");
    check_refused("{\"source\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"format\":\"merl\"}", "/format");
}

TEST(cancelled)
{
    static const char body[] = "{\"source\":{\"ndf\":\"ggx\",\"alpha\":0.3}}";
    int cancel = 1;
    json_decref(
        answer_of(post("/v1/fit", NULL, "application/json", body, strlen(body), &cancel), 503));
}

/* ---- Measurements --------------------------------------------------------------------------- */

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

TEST(damaged_measurements)
{
    unsigned char bytes[100] = {90, 0, 0, 0, 90, 0, 0, 0, 180};
    json_t *problem = answer_of(post("/v1/fit", "model=ggx", NULL, bytes, sizeof bytes, NULL), 422);
    CHECK(strstr(text_at(problem, "detail", NULL), "34992012") != NULL);
    json_decref(problem);
    problem = answer_of(post("/v1/fit", NULL, "application/x-merl-brdf", bytes, 3, NULL), 422);
    json_decref(problem);
    bytes[0] = 1;
    problem = answer_of(post("/v1/fit", NULL, NULL, bytes, sizeof bytes, NULL), 422);
    CHECK(strstr(text_at(problem, "detail", NULL), "01 00 00 00") != NULL);
    json_decref(problem);
    problem = answer_of(
        post("/v1/fit", "alpha=1", "application/x-merl-brdf", bytes, sizeof bytes, NULL), 422);
    CHECK(strstr(text_at(problem, "detail", NULL), "alpha") != NULL);
    json_decref(problem);
    unsigned char *full = calloc(1, MERL_SIZE); /* right size, no dimensions */
    if (!full) return;
    problem = answer_of(post("/v1/fit", NULL, NULL, full, MERL_SIZE, NULL), 422);
    CHECK(strstr(text_at(problem, "detail", NULL), "dimensions") != NULL);
    json_decref(problem);
    memcpy(full, (int[]){90, 90, 180}, 12); /* all 0: data, but black */
    problem = answer_of(post("/v1/fit", NULL, NULL, full, MERL_SIZE, NULL), 422);
    json_decref(problem);
    free(full);
}

/* False: not to be had. */
static bool fit_measured(const char *name)
{
    size_t size = 0;
    unsigned char *bytes = measured_merl(name, &size);
    if (!bytes) return false;
    CHECK_INT(size, MERL_SIZE);
    double start = seconds();
    json_t *fit = answer_of(post("/v1/fit", "model=auto&tolerance=0.05",
                                 "application/x-www-form-urlencoded", bytes, size, NULL),
                            200);
    check_note(name, seconds() - start);
    json_t *wi = json_array(), *wo = json_array();
    error_pairs(wi, wo, 1);
    size_t n = json_array_size(wi), used = 0;
    json_t *g = evaluate(json_object_get(fit, "material"), wi, wo);
    double sum = 0, *x = calloc(n, 9 * sizeof *x + 1), *fr[3] = {x + 6 * n, x + 7 * n, x + 8 * n};
    bool *valid = (bool *)(x + 9 * n);
    for (size_t i = 0; i < n; i++) {
        for (size_t c = 0; c < 3; c++) {
            x[c * n + i] = channel(wi, i, c);
            x[(3 + c) * n + i] = channel(wo, i, c);
        }
    }
    struct merl merl = {bytes};
    api_merl_evaluate(&merl, (facet_vec3_in){x, x + n, x + 2 * n},
                      (facet_vec3_in){x + 3 * n, x + 4 * n, x + 5 * n}, n, fr, valid);
    for (size_t i = 0; i < n; i++) {
        if (!valid[i]) continue;
        used++;
        for (size_t c = 0; c < 3; c++) {
            double z = x[2 * n + i], d = log((1e-3 + fr[c][i] * z) / (1e-3 + channel(g, i, c) * z));
            sum += d * d;
        }
    }
    CHECK_INT(used, json_integer_value(json_object_get(fit, "pairs")));
    CHECK_REL(sqrt(sum / (3. * (double)used)), number_at(fit, "error", "rms_log"), 1e-6, 0);
    CHECK(number_at(fit, "error", "rms_log") < .6); /* no microfacet model, but not nonsense */
    free(x);
    json_decref(g);
    json_decref(wi);
    json_decref(wo);
    json_decref(fit);
    free(bytes);
    return true;
}

TEST(measured_materials)
{
    static const char *const names[] = {"gold-metallic-paint", "pink-felt", "chrome-steel",
                                        "nickel"};
    for (int i = 0; i < 4; i++) {
        if (fit_measured(names[i])) continue;
        check_skip("no shared data, no ../shared/tools/make_merl.c, or no cc");
        return;
    }
}
