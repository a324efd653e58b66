/* What comes with a fit: the Pareto list, exports, the picture; and the diffuse part of a material. */
#include "ask.h"
#include "check.h"
#include "draw.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

static struct answer post(const char *path, const char *query, const char *accept, const char *body)
{
    return ask_with((struct api_request){.method = "POST",
                                         .path = path,
                                         .query = query,
                                         .accept = accept,
                                         .content_type = "application/json",
                                         .body = body,
                                         .body_size = strlen(body)});
}

static double at(const json_t *json, const char *first, const char *second)
{
    return answer_value(json_object_get(json_object_get(json, first), second));
}

#define GLOSSY                                                                                     \
    "{\"ndf\":\"ggx\",\"alpha\":0.25,\"fresnel\":{\"dielectric\":{\"eta\":1.5}},\"diffuse\":[0.5,0.2,0.1]}"
static const char glossy[] = "{\"source\":" GLOSSY ",\"tolerance\":1e-3}";

TEST(candidates_are_the_pareto_front)
{
    struct answer answer = post("/v1/fit", NULL, NULL, glossy);
    json_t *list = json_object_get(answer.json, "candidates"), *c;
    size_t i;
    double bytes = 0, rms = INFINITY;
    CHECK(json_array_size(list) >= 3);
    json_array_foreach(list, i, c)
    {
        CHECK(at(c, "error", "rms_log") < rms);
        CHECK(json_integer_value(json_object_get(c, "bytes")) > bytes);
        rms = at(c, "error", "rms_log");
        bytes = (double)json_integer_value(json_object_get(c, "bytes"));
        json_t *channels = json_object_get(json_object_get(c, "error"), "rms_log_channel");
        double sum = 0;
        for (size_t k = 0; k < 3; k++) sum += pow(answer_value(json_array_get(channels, k)), 2) / 3;
        CHECK_REL(sqrt(sum), rms, 1e-12, 0);
        json_t *worst = json_object_get(json_object_get(c, "error"), "worst");
        CHECK(answer_value(json_object_get(worst, "log")) >= rms);
    }
    CHECK(json_integer_value(json_object_get(answer.json, "considered")) >= 8);
    json_t *material = json_object_get(answer.json, "material");
    CHECK_STR(json_string_value(json_object_get(material, "ndf")), "ggx");
    for (size_t k = 0; k < 3; k++)
        CHECK_REL(answer_value(json_array_get(json_object_get(material, "diffuse"), k)),
                  k == 0   ? .5
                  : k == 1 ? .2
                           : .1,
                  2e-3, 0);
    answer_clear(&answer);
}

TEST(worst_pair_is_where_it_says)
{
    struct answer answer = post("/v1/fit", "model=beckmann&diffuse=false", NULL, glossy);
    json_t *error = json_object_get(answer.json, "error"), *worst = json_object_get(error, "worst");
    static char body[1 << 16];
    char *materials[2], *pair[2];
    double fr[2];
    const char *const names[] = {"wi", "wo"};
    for (int k = 0; k < 2; k++) {
        json_t *v = json_object_get(worst, names[k]);
        double x[3];
        for (size_t c = 0; c < 3; c++) x[c] = answer_value(json_array_get(v, c));
        pair[k] = malloc(100);
        snprintf(pair[k], 100, "[%.17g,%.17g,%.17g]", x[0], x[1], x[2]);
        size_t room = 1 << 15;
        materials[k] = calloc(1, room);
        if (k)
            json_dumpb(json_object_get(answer.json, "material"), materials[k], room - 1, 0);
        else
            strcpy(materials[k], GLOSSY);
    }
    double most = 0;
    for (size_t c = 0; c < 3; c++) {
        for (int k = 0; k < 2; k++) {
            snprintf(body, sizeof body,
                     "{\"material\":%s,\"wi\":[%s],\"wo\":[%s],\"outputs\":[\"fr_cos\"],"
                     "\"channels\":3,\"tier\":\"precise\"}",
                     materials[k], pair[0], pair[1]);
            struct answer e = post("/v1/eval", NULL, NULL, body);
            CHECK_INT(e.response.status, 200);
            fr[k] = answer_component(&e, "fr_cos", 0, c);
            answer_clear(&e);
        }
        most = check_worse(most, fabs(log((1e-3 + fr[0]) / (1e-3 + fr[1]))));
    }
    CHECK_REL(most, answer_value(json_object_get(worst, "log")), 1e-6, 0);
    for (int k = 0; k < 2; k++) free(pair[k]), free(materials[k]);
    answer_clear(&answer);
}

/* ---- Exports --------------------------------------------------------------------------------------- */

static const char metal[] =
    "{\"source\":{\"ndf\":\"ggx\",\"alpha_1\":0.4,\"alpha_2\":0.1,\"phi\":0.5,"
    "\"fresnel\":{\"schlick\":{\"f0\":[0.9,0.6,0.3]}}}}";

static double number_after(const char *text, const char *mark)
{
    const char *found = text ? strstr(text, mark) : NULL;
    return found ? strtod(found + strlen(mark), NULL) : NAN;
}

TEST(exports_hold_the_material)
{
    static const char *const tools[] = {"mitsuba", "pbrt", "gltf", "materialx", "glsl"};
    for (int k = 0; k < 5; k++) {
        char query[40];
        snprintf(query, sizeof query, "export=%s", tools[k]);
        struct answer answer = post("/v1/fit", query, NULL, metal);
        json_t *export = json_object_get(answer.json, "export");
        const char *text = json_string_value(json_object_get(export, "text"));
        CHECK_STR(json_string_value(json_object_get(export, "tool")), tools[k]);
        CHECK(json_string_value(json_object_get(export, "lost")) != NULL);
        double lost = answer_value(json_object_get(export, "rms_log"));
        if (k == 0) CHECK_REL(number_after(text, "alpha_u\" value=\""), .4, 1e-6, 0);
        if (k == 0) CHECK_REL(number_after(text, "alpha_v\" value=\""), .1, 1e-6, 0);
        if (k == 1) CHECK_REL(number_after(text, "uroughness\" [ "), .4, 1e-6, 0);
        if (k == 2) { /* alpha_b = roughness^2, alpha_t = mix(alpha_b, 1, strength^2) */
            double roughness = number_after(text, "roughnessFactor\": "), b = roughness * roughness;
            double strength = number_after(text, "anisotropyStrength\": ");
            CHECK_REL(b, .1, 1e-6, 0);
            CHECK_REL(b + (1 - b) * strength * strength, .4, 1e-6, 0);
            CHECK_REL(number_after(text, "anisotropyRotation\": "), -.5, 1e-6, 0);
            CHECK(lost < 1e-6); /* the same model */
            json_t *parsed = json_loads(text, 0, NULL);
            CHECK(parsed != NULL);
            json_decref(parsed);
        }
        if (k == 3) CHECK_REL(number_after(text, "type=\"vector2\" value=\""), .4, 1e-6, 0);
        if (k == 4) CHECK(strstr(text, "vec3 facet_fr(") && lost < 1e-9);
        if (k < 2) CHECK(lost > 1e-3 && lost < .5); /* another Fresnel term, uncorrelated masking */
        check_note(tools[k], lost);
        answer_clear(&answer);
    }
    struct answer answer = post("/v1/fit", "export=gltf&model=beckmann", NULL,
                                "{\"source\":{\"ndf\":\"beckmann\",\"alpha\":0.3}}");
    CHECK_INT(answer.response.status, 422);
    CHECK_STR(answer_error(&answer, "pointer"), "/export");
    answer_clear(&answer);
}

TEST(picture)
{
    struct answer answer = post("/v1/fit", NULL, "image/svg+xml", glossy);
    CHECK_INT(answer.response.status, 200);
    CHECK_STR(answer.response.content_type, "image/svg+xml");
    const char *svg = answer.response.body;
    CHECK(!strncmp(svg, "<svg ", 5) && strstr(svg, "</svg>") && strstr(svg, "stroke-dasharray"));
    CHECK(!strstr(svg, "nan") && !strstr(svg, "inf"));
    size_t lines = 0;
    for (const char *p = svg; (p = strstr(p, "<polyline")); p++) lines++;
    CHECK_INT(lines, 3 * 3 * 2); /* views, channels, source and fit */
    answer_clear(&answer);
}

/* ---- What tells a lobe ----------------------------------------------------------------------------- */

/* A diffuse .2 with a faint GGX lobe and noise upon it, in logarithms, at directions of chance. */
enum { FAINT = 160 };
struct faint {
    double cos_i[FAINT], fr[FAINT];
    char body[FAINT * 200];
};

static void make_faint(struct faint *faint, double lobe, double noise, double tolerance)
{
    struct rng rng;
    char *text[3] = {calloc(1, sizeof faint->body), calloc(1, sizeof faint->body),
                     calloc(1, sizeof faint->body)};
    rng_seed(&rng, 7);
    for (size_t i = 0; i < FAINT; i++) {
        double k[2][3], h[3], a = .4;
        for (int side = 0; side < 2; side++) draw_direction(&rng, .1, k[side]);
        for (int c = 0; c < 3; c++) h[c] = k[0][c] + k[1][c];
        double z = h[2] * h[2] / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
        double d = a * a / pow(1 + (a * a - 1) * z, 2); /* pi D */
        double chance = rng_uniform(&rng) + rng_uniform(&rng) + rng_uniform(&rng) - 1.5;
        faint->cos_i[i] = k[0][2];
        faint->fr[i] = .2 * (1 + lobe * d) * exp(noise * chance);
        for (int m = 0; m < 2; m++)
            sprintf(text[m] + strlen(text[m]), "%s[%.17g,%.17g,%.17g]", i ? "," : "", k[m][0],
                    k[m][1], k[m][2]);
        sprintf(text[2] + strlen(text[2]), "%s%.17g", i ? "," : "", faint->fr[i]);
    }
    snprintf(faint->body, sizeof faint->body,
             "{\"samples\":{\"wi\":[%s],\"wo\":[%s],\"fr\":[%s]},\"tolerance\":%g}", text[0],
             text[1], text[2], tolerance);
    for (int m = 0; m < 3; m++) free(text[m]);
}

static double lambert_rms(const struct faint *faint, double kd)
{
    double sum = 0;
    for (size_t i = 0; i < FAINT; i++) {
        double z = faint->cos_i[i];
        sum += pow(log((1e-3 + faint->fr[i] * z) / (1e-3 + kd / PI * z)), 2);
    }
    return sqrt(sum / FAINT);
}

/* rms_log of the best Lambertian surface, by golden sections of its reflectance. */
static double flat_rms(const struct faint *faint)
{
    double low = 0, high = 1, g = .6180339887498949;
    for (int step = 0; step < 60; step++) {
        double a = high - g * (high - low), b = low + g * (high - low);
        if (lambert_rms(faint, a) < lambert_rms(faint, b))
            high = b;
        else
            low = a;
    }
    return lambert_rms(faint, low);
}

/*
 * What a Lambertian surface meets to the tolerance has a lobe where one leaves less than half
 * its error; what it does not meet, where one leaves less than .9.
 */
TEST(lobe_is_told_from_chance)
{
    static const struct {
        double lobe, noise, tolerance, least, most; /* share of the Lambertian's error left */
        bool fits;
    } cases[] = {
        {.02, .015, .05, .35, .48, true},  {.02, .028, .05, .52, .65, false},
        {.02, .028, .001, .52, .65, true}, /* no Lambertian surface will do */
        {.02, .065, .001, .77, .87, true}, {.02, .24, .001, .92, .98, false},
    };
    struct faint *faint = calloc(1, sizeof *faint);
    for (size_t k = 0; faint && k < sizeof cases / sizeof *cases; k++) {
        make_faint(faint, cases[k].lobe, cases[k].noise, cases[k].tolerance);
        struct answer answer = post("/v1/fit", NULL, NULL, faint->body);
        json_t *list = json_object_get(answer.json, "candidates"); /* the last is the best */
        double best = at(json_array_get(list, json_array_size(list) - 1), "error", "rms_log");
        double share = best / flat_rms(faint);
        CHECK(share > cases[k].least && share < cases[k].most);
        CHECK(json_is_true(json_object_get(answer.json, "fits")) == cases[k].fits);
        const char *why = answer_text(&answer, "fits_why");
        CHECK(cases[k].fits ? !why : why && strstr(why, "nothing here tells a lobe"));
        answer_clear(&answer);
    }
    free(faint);
}

/* ---- Diffuse part -------------------------------------------------------------------------------------- */

TEST(diffuse_materials_are_sampled)
{
    static const char *const materials[] = {
        "{\"ndf\":\"ggx\",\"alpha\":0.2,\"fresnel\":{\"schlick\":{\"f0\":0.04}},\"diffuse\":0.5}",
        "{\"ndf\":\"beckmann\",\"alpha\":0.5,\"diffuse\":[0.3,0.3,0.3]}"};
    enum { N = 16000 };
    for (int k = 0; k < 2; k++) {
        char body[600];
        snprintf(body, sizeof body, "{\"material\":%s,\"wo\":[[0.6,0,0.8]],\"n\":%d,\"seed\":3}",
                 materials[k], N);
        struct answer s = post("/v1/sample", NULL, NULL, body);
        CHECK_INT(s.response.status, 200);
        double mean = 0, below = 0;
        for (size_t i = 0; i < N; i++) {
            mean += k ? answer_component(&s, "weight", i, 1) : answer_number(&s, "weight", i);
            below += answer_component(&s, "wi", i, 2) <= 0;
        }
        /* the same integral over a grid of equal solid angles */
        snprintf(
            body, sizeof body,
            "{\"material\":%s,\"wo\":[[0.6,0,0.8]],\"wi\":{\"grid\":{\"theta\":200,\"phi\":60,\"uniform\":"
            "\"cosine\"}},\"outputs\":[\"fr_cos\",\"pdf\"],\"tolerance\":1e-4}",
            materials[k]);
        struct answer e = post("/v1/eval", NULL, NULL, body);
        CHECK_INT(e.response.status, 200);
        double albedo = 0, total = 0;
        for (size_t i = 0; i < 12000; i++) {
            albedo += k ? answer_component(&e, "fr_cos", i, 1) : answer_number(&e, "fr_cos", i);
            total += answer_number(&e, "pdf", i);
        }
        CHECK_REL(mean / N, albedo * 2 * PI / 12000, .02, 0);
        CHECK_REL(total * 2 * PI / 12000, 1 - below / N, .02, 0); /* what is above the horizon */
        check_note("albedo", mean / N);
        /* pdf and weight are those of the wi returned */
        char pair[1400];
        double bound = answer_bound(&s);
        for (size_t i = 0; i < 20; i++) {
            if (answer_component(&s, "wi", i, 2) <= 0) continue;
            snprintf(pair, sizeof pair,
                     "{\"material\":%s,\"wo\":[[0.6,0,0.8]],\"wi\":[[%.17g,%.17g,%.17g]]}",
                     materials[k], answer_component(&s, "wi", i, 0),
                     answer_component(&s, "wi", i, 1), answer_component(&s, "wi", i, 2));
            struct answer p = post("/v1/pdf", NULL, NULL, pair);
            CHECK_REL(answer_number(&s, "pdf", i), answer_number(&p, "pdf", 0),
                      bound + answer_bound(&p), 1e-30);
            answer_clear(&p);
        }
        answer_clear(&s);
        answer_clear(&e);
    }
}
