/* Readers of measurements: UTIA and CSV written here, samples; what is fitted of them. */
#include "ask.h"
#include "check.h"
#include "facet_fit.h"
#include "measurement.h"
#include "reader.h"
#include "samples.h"
#include "utia.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

/* ---- UTIA ------------------------------------------------------------------------------------------ */

static double encode(double fr)
{
    double x = fr / 100;
    return 140 * (x > 0.0375 / 12.92 ? 1.055 * pow(x, 1 / 2.4) - 0.055 : x * 12.92);
}

/* GGX, correlated Smith, with a diffuse part; nothing shared with lib. */
static double ggx(double ax, double ay, const double i[3], const double o[3], double f0, double kd)
{
    double h[3] = {i[0] + o[0], i[1] + o[1], i[2] + o[2]};
    double length = sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]), cd = length / 2;
    double x = h[0] / h[2] / ax, y = h[1] / h[2] / ay, c = h[2] / length, a = 1 + x * x + y * y;
    double d = 1 / (PI * ax * ay * a * a * c * c * c * c), l[2];
    const double *k[2] = {i, o};
    for (int n = 0; n < 2; n++) {
        double s = hypot(ax * k[n][0], ay * k[n][1]) / k[n][2];
        l[n] = (sqrt(1 + s * s) - 1) / 2;
    }
    double f = f0 + (1 - f0) * pow(1 - cd, 5);
    return (1 - kd) * f * d / (1 + l[0] + l[1]) / (4 * i[2] * o[2]) + kd / PI;
}

static unsigned char *make_utia(double ax, double ay, double kd)
{
    unsigned char *bytes = malloc(UTIA_SIZE);
    for (size_t n = 0; bytes && n < 3 * UTIA_PLANE; n++) {
        size_t po = n % 48, to = n / 48 % 6, pi = n / (48 * 6) % 48, ti = n / (48 * 6 * 48) % 6;
        double i[3], o[3];
        reader_direction((double)ti * PI / 12, (double)pi * PI / 24, i);
        reader_direction((double)to * PI / 12, (double)po * PI / 24, o);
        double v = encode(ggx(ax, ay, i, o, .5, kd) * (1 - .2 * (double)(n / UTIA_PLANE)));
        memcpy(bytes + 8 * n, &v, 8);
    }
    return bytes;
}

TEST(utia_layout_and_interpolation)
{
    unsigned char *bytes = make_utia(.5, .3, .1);
    struct reader o;
    if (!bytes) return;
    double negative = -3, i[3], w[3], rgb[3], a[3], b[3];
    memcpy(bytes + 8 * 77, &negative, 8);
    CHECK(reader_open(&o, bytes, UTIA_SIZE, -1));
    CHECK_INT(o.m.format, FORMAT_UTIA);
    CHECK(o.m.source.anisotropic);
    CHECK_INT(o.m.counts.values, UTIA_PLANE);
    CHECK_INT(o.m.counts.negative, 1);
    for (int k = 0; k < 100; k++) { /* nodes */
        reader_direction((k % 6) * PI / 12, (k * 7 % 48) * PI / 24, i);
        reader_direction((k % 5) * PI / 12, (k * 11 % 48) * PI / 24 + 1e-9, w);
        CHECK(reader_ask(&o.m.source, i, w, rgb));
        for (int c = 0; c < 3; c++)
            CHECK_REL(rgb[c], ggx(.5, .3, i, w, .5, .1) * (1 - .2 * c), 1e-6, 0);
    }
    reader_direction(PI / 6, PI / 24 * 47.5, i); /* between the last azimuth and the first */
    reader_direction(PI / 12 * 2.5, 1, w);
    CHECK(reader_ask(&o.m.source, i, w, rgb));
    reader_direction(PI / 6, PI / 24 * 47, i);
    CHECK(reader_ask(&o.m.source, i, w, a));
    reader_direction(PI / 6, 0, i);
    CHECK(reader_ask(&o.m.source, i, w, b));
    CHECK_REL(rgb[1], (a[1] + b[1]) / 2, 1e-9, 0);
    reader_direction(76 * PI / 180, 0, i);
    CHECK(!reader_ask(&o.m.source, i, w, rgb));
    reader_close(&o);
    reader_refuses(bytes, UTIA_SIZE - 8, FORMAT_UTIA, "1990656");
    double bad = NAN;
    memcpy(bytes + 8 * 1000, &bad, 8);
    reader_refuses(bytes, UTIA_SIZE, -1, "number 1000");
    memset(bytes, 0, UTIA_SIZE);
    reader_refuses(bytes, UTIA_SIZE, -1, "no data");
    free(bytes);
}

static struct answer post(const char *query, const char *type, const void *body, size_t size)
{
    return ask_with((struct api_request){.method = "POST",
                                         .path = "/v1/fit",
                                         .query = query,
                                         .content_type = type,
                                         .body = body,
                                         .body_size = size});
}

static double number_of(const struct answer *answer, const char *first, const char *second)
{
    return answer_value(json_object_get(json_object_get(answer->json, first), second));
}

TEST(utia_is_fitted)
{
    unsigned char *bytes = make_utia(.6, .4, .1);
    if (!bytes) return;
    struct answer answer = post("model=ggx&tolerance=0.001", NULL, bytes, UTIA_SIZE);
    CHECK_INT(answer.response.status, 200);
    CHECK_REL(number_of(&answer, "material", "alpha_x"), .6, 1e-3,
              0); /* coloured as a whole, which Schlick is not */
    CHECK_REL(number_of(&answer, "material", "alpha_y"), .4, 1e-3, 0);
    CHECK(fabs(number_of(&answer, "material", "rho")) < 1e-4);
    CHECK(number_of(&answer, "error", "rms_log") < 5e-3);
    check_note("rms_log", number_of(&answer, "error", "rms_log"));
    check_note("ms", answer_value(json_object_get(answer.json, "timing_ms")));
    answer_clear(&answer);
    free(bytes);
}

/* ---- CSV and samples ---------------------------------------------------------------------------------- */

static double fraction(unsigned *state)
{
    *state = *state * 1664525u + 1013904223u;
    return (*state >> 8) / 16777216.;
}

/* So many lines of GGX; the caller frees. */
static char *make_csv(size_t n, double ax, double ay, double kd)
{
    char *text = malloc(n * 160 + 100), *at = text;
    unsigned state = 1;
    at += sprintf(at, "theta_i,phi_i,theta_o,phi_o,r,g,b\n# a comment\n");
    for (size_t k = 0; k < n; k++) {
        double ti = 1.4 * fraction(&state), pi = 6 * fraction(&state), i[3], o[3];
        double to = fmin(fabs(ti + .8 * (fraction(&state) - .5)), 1.4);
        double po = pi + PI + 2 * (fraction(&state) - .5);
        reader_direction(ti, pi, i);
        reader_direction(to, po, o);
        at += sprintf(at, "%.12g,%.12g,%.12g,%.12g", ti, pi, to, po);
        for (int c = 0; c < 3; c++) at += sprintf(at, ",%.12g", ggx(ax, ay, i, o, .9 - .3 * c, kd));
        at += sprintf(at, "%s\n", k % 2 ? "\r" : "");
    }
    return text;
}

TEST(csv_is_fitted)
{
    char *text = make_csv(3000, .2, .2, .15);
    struct answer answer = post("tolerance=0.01", "text/csv", text, strlen(text));
    CHECK_INT(answer.response.status, 200);
    CHECK_REL(number_of(&answer, "material", "alpha"), .2, 1e-4, 0);
    CHECK_STR(json_string_value(json_object_get(json_object_get(answer.json, "data"), "format")),
              "csv");
    CHECK_INT(number_of(&answer, "data", "values"), 3000);
    CHECK(number_of(&answer, "error", "rms_log") < 1e-4);
    answer_clear(&answer);
    free(text);
    text = make_csv(3000, .3, .1, 0);
    answer = post("tolerance=0.01", NULL, text, strlen(text));
    CHECK_REL(number_of(&answer, "material", "alpha_x"), .3, 1e-4, 0);
    CHECK_REL(number_of(&answer, "material", "alpha_y"), .1, 1e-4, 0);
    answer_clear(&answer);
    free(text);
}

TEST(csv_rules)
{
    struct reader o;
    char text[4000] = "r,g,b,theta_i,phi_i,theta_o,phi_o\n", *at = text + strlen(text);
    for (int k = 0; k < 20; k++)
        at += sprintf(at, "%s;%d ; 2,0.%d 0.1\t0.3 , 0\n",
                      k == 3   ? "nan"
                      : k == 4 ? ""
                               : "1",
                      k == 5 ? -1 : 1, k + 1);
    at += sprintf(at, "1;-nan,0,0.1,0.3,0.1,0\nNan;+NAN,nAn,0.1,0.3,0.1,0\n");
    CHECK(reader_open(&o, text, strlen(text), FORMAT_CSV));
    CHECK_INT(o.m.counts.values, 22);
    CHECK_INT(o.m.counts.missing, 4);
    CHECK_INT(o.m.counts.negative, 1);
    CHECK_INT(o.m.source.samples->count, 18);
    CHECK_REL(o.m.source.samples->wi.z[0], cos(.1), 1e-15, 0);
    CHECK_REL(o.m.source.samples->fr[2][0], 2, 0, 0);
    reader_close(&o);
    reader_refuses("", 0, FORMAT_CSV, "0 samples");
    reader_refuses("", 0, -1, "0 bytes");
    reader_refuses("0.1,0,0.2,0,1,1,1\n", 18, FORMAT_CSV, "1 samples");
    reader_refuses("0.1,0,0.2,0,1,1\n", 16, FORMAT_CSV, "6 cells");
    reader_refuses("0.1,0,0.2,0,1,1,1,1\n", 20, FORMAT_CSV, "more than 7");
    reader_refuses("0.1,0,1.6,0,1,1,1\n", 18, FORMAT_CSV, "theta_o 1.6");
    reader_refuses("0.1,0,x,0,1,1,1\n", 16, FORMAT_CSV, "\"x\"");
    reader_refuses("0.1,0,0.2,0,inf,1,1\n", 20, FORMAT_CSV, "r inf is outside [-1e30, 1e30]");
    reader_refuses("0.1,0,0.2,0,1,-1e308,1\n", 23, FORMAT_CSV,
                   "line 1: g -1e308 is outside [-1e30, 1e30]");
    reader_refuses("nan,0,0.2,0,1,1,1\n", 18, FORMAT_CSV, "\"nan\" is not a number for theta_i");
    reader_refuses("theta_i,phi_i,theta_o,phi_o,r,g,x\n", 34, FORMAT_CSV, "\"x\"");
    reader_refuses("theta_i,phi_i,theta_o,phi_o,r,g,g\n", 34, FORMAT_CSV, "there twice");
    reader_refuses("theta_i,phi_i\n", 14, FORMAT_CSV, "2 columns");
}

TEST(samples_of_json)
{
    char *body = malloc(1 << 20), *at = body;
    unsigned state = 7;
    at += sprintf(at, "{\"tolerance\":1e-3,\"anisotropic\":false,\"samples\":{\"wi\":[");
    double v[400][6];
    for (int k = 0; k < 400; k++) {
        reader_direction(1.2 * fraction(&state), 6 * fraction(&state), v[k]);
        reader_direction(1.2 * fraction(&state), 6 * fraction(&state), v[k] + 3);
        at += sprintf(at, "%s[%.15g,%.15g,%.15g]", k ? "," : "", v[k][0], v[k][1], v[k][2]);
    }
    at += sprintf(at, "],\"wo\":[");
    for (int k = 0; k < 400; k++)
        at += sprintf(at, "%s[%.15g,%.15g,%.15g]", k ? "," : "", v[k][3], v[k][4], v[k][5]);
    at += sprintf(at, "],\"fr\":[");
    for (int k = 0; k < 400; k++)
        at += sprintf(at, "%s%.15g", k ? "," : "", ggx(.4, .4, v[k], v[k] + 3, .5, .3));
    sprintf(at, "]}}");
    struct answer answer = post(NULL, "application/json", body, strlen(body));
    CHECK_INT(answer.response.status, 200);
    CHECK_REL(number_of(&answer, "material", "alpha"), .4, 1e-6, 0);
    CHECK_REL(number_of(&answer, "material", "diffuse"), .3, 1e-6, 0);
    answer_clear(&answer);
    answer = post("model=tabulated", "application/json", body, strlen(body));
    CHECK_INT(answer.response.status, 422);
    CHECK_STR(answer_error(&answer, "pointer"), "/model");
    answer_clear(&answer);
    static const char *const bad[][2] = {
        {"{\"samples\":{\"wi\":[[0,0,1]],\"wo\":[[0,0,-1]],\"fr\":[1]}}", "/samples/wo/0"},
        {"{\"samples\":{\"wi\":[[0,0,1]],\"wo\":[[0,0,1]],\"fr\":[1,2]}}", "/samples/fr"},
        {"{\"samples\":{\"wi\":[[0,0,1]],\"wo\":[[0,0,1],[0,0,1]],\"fr\":[1]}}", "/samples/wo"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        answer = post(NULL, "application/json", bad[k][0], strlen(bad[k][0]));
        CHECK_INT(answer.response.status, 422);
        CHECK_STR(answer_error(&answer, "pointer"), bad[k][1]);
        answer_clear(&answer);
    }
    static const char one[] = "{\"samples\":{\"wi\":[[0,0,1]],\"wo\":[[0,0,1]],\"fr\":[1]}}";
    answer = post(NULL, "application/json", one, sizeof one - 1);
    CHECK_INT(answer.response.status, 422);
    CHECK(strstr(answer_text(&answer, "detail"), "1 samples determine no material; at least 16"));
    answer_clear(&answer);
    free(body);
}

/* ---- No microfacet surface ------------------------------------------------------------------------ */

/* f_r of wi and wo in degrees apart: a retro-reflector, noise, a lamp. */
static struct answer fit_absurd(int kind)
{
    enum { N = 2000 };
    char *text = malloc(N * 160), *at = text;
    unsigned state = 5;
    for (int k = 0; k < N; k++) {
        double ti = 1.3 * fraction(&state), pi = 6 * fraction(&state), i[3], o[3];
        double to = k % 2 ? fmin(1.4, fabs(ti + .1 * (fraction(&state) - .5)))
                          : 1.3 * fraction(&state);
        double po = k % 2 ? pi + .1 * (fraction(&state) - .5) : 6 * fraction(&state);
        reader_direction(ti, pi, i);
        reader_direction(to, po, o);
        double apart = acos(fmin(1, i[0] * o[0] + i[1] * o[1] + i[2] * o[2]));
        double fr = kind == 0   ? 30 * exp(-apart * apart / .005) + .05
                    : kind == 1 ? exp(8 * (fraction(&state) - .5))
                                : 1e6;
        at += sprintf(at, "%.12g,%.12g,%.12g,%.12g,%g,%g,%g\n", ti, pi, to, po, fr, fr, fr);
    }
    struct answer answer = post(NULL, "text/csv", text, strlen(text));
    free(text);
    return answer;
}

TEST(what_is_no_microfacet_surface_is_not_fitted)
{
    for (int kind = 0; kind < 3; kind++) {
        struct answer answer = fit_absurd(kind);
        CHECK_INT(answer.response.status, 200);
        CHECK(json_is_false(json_object_get(answer.json, "fits")));
        CHECK(!json_object_get(answer.json, "material"));
        CHECK(answer_text(&answer, "fits_why") != NULL);
        CHECK(number_of(&answer, "error", "rms_log") > .3);
        check_note("rms_log", number_of(&answer, "error", "rms_log"));
        answer_clear(&answer);
    }
}

/* alta/retro-*.dat: theta_l, theta_v (cos, sin) dphi, f_r, here with cos theta_v in one of them. */
TEST(measured_retro_reflectors)
{
    static const char *const names[] = {"brdf/alta/retro-3M-jaune.dat",
                                        "brdf/alta/retro-gray-tape.dat"};
    for (int k = 0; k < 2; k++) {
        const char *path = check_data(names[k]);
        FILE *file = path ? fopen(path, "r") : NULL;
        char line[400], *text = malloc(1 << 20), *at = text;
        double tl, a, b, fr;
        if (!file) {
            free(text);
            check_skip("no shared data");
            return;
        }
        while (fgets(line, sizeof line, file)) {
            if (*line == '#' || sscanf(line, "%lf %lf %lf %lf", &tl, &a, &b, &fr) != 4) continue;
            double tv = hypot(a, b);
            if (tv > 1.55 || tl > 1.55) continue;
            if (k == 0) fr /= cos(tv);
            at += sprintf(at, "%.9g,0,%.9g,%.9g,%.9g,%.9g,%.9g\n", tl, tv, atan2(b, a), fr, fr, fr);
        }
        fclose(file);
        struct answer answer = post(NULL, "text/csv", text, strlen(text));
        CHECK(json_is_false(json_object_get(answer.json, "fits")));
        check_note("rms_log", number_of(&answer, "error", "rms_log"));
        answer_clear(&answer);
        free(text);
    }
}
