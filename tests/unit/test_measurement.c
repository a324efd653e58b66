/* Readers of measurements: RGL .bsdf against its own reader, UTIA and CSV written here, samples. */
#include "ask.h"
#include "bsdf.h"
#include "check.h"
#include "facet_fit.h"
#include "measurement.h"
#include "samples.h"
#include "utia.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

/* ---- Help ------------------------------------------------------------------------------------- */

struct opened {
    struct arena arena;
    struct problem problem;
    struct measurement m;
};

static bool open_bytes(struct opened *o, const void *bytes, size_t size, int format)
{
    memset(o, 0, sizeof *o);
    api_arena_open(&o->arena, (size_t)1 << 28);
    return api_measurement_open(bytes, size, format, &o->arena, &o->problem, &o->m);
}

static void close_bytes(struct opened *o)
{
    api_arena_close(&o->arena);
}

static void direction(double theta, double phi, double v[3])
{
    v[0] = sin(theta) * cos(phi), v[1] = sin(theta) * sin(phi), v[2] = cos(theta);
}

static bool ask_one(const facet_fit_source *source, const double i[3], const double o[3],
                    double rgb[3])
{
    double *const fr[3] = {rgb, rgb + 1, rgb + 2};
    bool valid = false;
    CHECK_INT(source->evaluate(source->user, (facet_vec3_in){i, i + 1, i + 2},
                               (facet_vec3_in){o, o + 1, o + 2}, 1, fr, &valid),
              FACET_OK);
    return valid;
}

static void check_refused(const void *bytes, size_t size, int format, const char *says)
{
    struct opened o;
    CHECK(!open_bytes(&o, bytes, size, format));
    CHECK_INT(o.problem.status, 422);
    if (!strstr(o.problem.detail, says))
        check_fail(__FILE__, __LINE__, "\"%s\" does not say \"%s\"", o.problem.detail, says);
    close_bytes(&o);
}

/* ---- RGL ------------------------------------------------------------------------------------------ */

/* reference/rgl_powitacq_golden.csv: f_r cos theta_o by RGL's own reader, angles in degrees. */
TEST(bsdf_as_its_own_reader)
{
    const char *csv = check_data("reference/rgl_powitacq_golden.csv");
    FILE *file = csv ? fopen(csv, "r") : NULL;
    if (!file) {
        check_skip("no shared data");
        return;
    }
    char line[400], name[100], last[100] = "";
    unsigned char *bytes = NULL;
    struct opened o = {0};
    size_t rows = 0, size;
    double worst = 0;
    while (fgets(line, sizeof line, file)) {
        double a[4], rgb[3], ours[3], i[3], w[3];
        if (sscanf(line, "%99[^,],%lf,%lf,%lf,%lf,%lf,%lf,%lf", name, a, a + 1, a + 2, a + 3, rgb,
                   rgb + 1, rgb + 2) != 8)
            continue;
        if (strcmp(name, last)) {
            char path[200];
            if (bytes) close_bytes(&o);
            free(bytes);
            snprintf(path, sizeof path, "brdf/rgl/%s", name);
            const char *found = check_data(path); /* of some the file is not there */
            bytes = found ? check_read_file(found, &size) : NULL;
            strcpy(last, name);
            if (bytes) {
                CHECK(open_bytes(&o, bytes, size, -1));
                CHECK_INT(o.m.format, FORMAT_BSDF);
                CHECK(!o.m.source.anisotropic);
            }
        }
        if (!bytes || o.problem.status) continue;
        direction(a[0] * PI / 180, a[1] * PI / 180, i);
        direction(a[2] * PI / 180, a[3] * PI / 180, w);
        if (!ask_one(&o.m.source, i, w, ours)) continue;
        for (int c = 0; c < 3; c++) {
            double fr_cos = ours[c] * w[2], expected = fmax(rgb[c], 0);
            worst = check_worse(worst, fabs(fr_cos - expected) / fmax(expected, 1e-2));
        }
        rows++;
    }
    CHECK(rows >= 700);
    CHECK(worst < 5e-4); /* it works in floats: narrow distributions lose digits */
    check_note("rows", (double)rows);
    check_note("error", worst);
    if (bytes) close_bytes(&o);
    free(bytes);
    fclose(file);
}

struct file {
    unsigned char bytes[1 << 16];
    size_t fields, size; /* size: of the header so far, then of all */
    size_t data;
};

static void put(unsigned char *at, uint64_t value, int n)
{
    for (int k = 0; k < n; k++) at[k] = (unsigned char)(value >> (8 * k));
}

static void begin(struct file *f)
{
    memset(f, 0, sizeof *f);
    memcpy(f->bytes, "tensor_file", 12);
    f->bytes[12] = 1;
    f->size = 18;
    f->data = 2048;
}

static float *add_field(struct file *f, const char *name, unsigned type, int n, const size_t *shape)
{
    size_t length = strlen(name), count = 1;
    unsigned char *at = f->bytes + f->size;
    for (int k = 0; k < n; k++) count *= shape[k];
    put(at, length, 2);
    memcpy(at + 2, name, length);
    at += 2 + length;
    put(at, (uint64_t)n, 2);
    at[2] = (unsigned char)type;
    put(at + 3, f->data, 8);
    for (int k = 0; k < n; k++) put(at + 11 + 8 * k, shape[k], 8);
    f->size += 2 + length + 11 + 8 * (size_t)n;
    put(f->bytes + 14, ++f->fields, 4);
    float *data = (float *)(void *)(f->bytes + f->data);
    f->data += (count * (type == 1 ? 1 : 4) + 7) & ~(size_t)7;
    return data;
}

static void add_floats(struct file *f, const char *name, size_t n, const float *values)
{
    memcpy(add_field(f, name, 10, 1, &n), values, n * sizeof *values);
}

static void fill(float *to, size_t n, float value)
{
    for (size_t i = 0; i < n; i++) to[i] = value;
}

/* f_r cos theta_o = (1 + phi_i) (nm/500) (1 + u + 2 v), u and v of h: the vndf is flat. */
static void make_anisotropic(struct file *f)
{
    static const float phis[] = {-3.2f, -1, 1, 3.2f}, thetas[] = {0, .8f, 1.6f},
                       nm[] = {400, 500, 600, 700};
    begin(f);
    add_floats(f, "phi_i", 4, phis);
    add_floats(f, "theta_i", 3, thetas);
    add_floats(f, "wavelengths", 4, nm);
    fill(add_field(f, "ndf", 10, 2, (size_t[]){2, 2}), 4, 1);
    fill(add_field(f, "sigma", 10, 2, (size_t[]){2, 2}), 4, 1);
    fill(add_field(f, "vndf", 10, 4, (size_t[]){4, 3, 2, 2}), 48, 3);
    float *data = add_field(f, "spectra", 10, 5, (size_t[]){4, 3, 4, 2, 2});
    for (size_t k = 0; k < 4 * 3 * 4 * 4; k++)
        data[k] = (5 + phis[k / 48]) * nm[k / 4 % 4] / 500 * (1 + (float)(k % 2) + 2 * (float)(k / 2 % 2));
    f->size = f->data;
}

TEST(bsdf_anisotropic_and_spectral)
{
    static struct file f;
    static const double nm[3] = {630, 532, 465};
    struct opened o;
    make_anisotropic(&f);
    CHECK(open_bytes(&o, f.bytes, f.size, -1));
    CHECK(o.m.source.anisotropic);
    CHECK_INT(o.m.counts.values, 48);
    for (int k = 0; k < 200; k++) {
        double i[3], w[3], rgb[3], phi_i = -3.1 + .031 * k;
        direction(.01 + .007 * k, phi_i, i);
        direction(1.5 - .007 * k, 2 + .05 * k, w);
        CHECK(ask_one(&o.m.source, i, w, rgb));
        double x = i[0] + w[0], y = i[1] + w[1], z = i[2] + w[2];
        double u = sqrt(atan2(hypot(x, y), z) * 2 / PI), v = (atan2(y, x) + PI) / (2 * PI);
        for (int c = 0; c < 3; c++)
            CHECK_REL(rgb[c] * w[2], (5 + phi_i) * nm[c] / 500 * (1 + u + 2 * v), 1e-5, 0);
    }
    close_bytes(&o);
}

TEST(bsdf_damaged)
{
    static struct file f;
    static unsigned char copy[sizeof f.bytes];
    make_anisotropic(&f);
    for (size_t n = 0; n < f.size; n += n < 700 ? 1 : 97) check_refused(f.bytes, n, FORMAT_BSDF, "");
    for (size_t at = 12; at < 700; at++) { /* any one byte */
        for (int bit = 0; bit < 8; bit += 7) {
            struct opened o;
            memcpy(copy, f.bytes, f.size);
            copy[at] ^= (unsigned char)(1 << bit);
            if (!open_bytes(&o, copy, f.size, FORMAT_BSDF)) CHECK_INT(o.problem.status, 422);
            close_bytes(&o);
        }
    }
    check_refused("tensor_file", 12, -1, "12");
    memcpy(copy, f.bytes, f.size);
    unsigned char *shape = copy + 18 + 2 + 5 + 11; /* of phi_i, the first field */
    put(shape, (uint64_t)1 << 32, 8);
    check_refused(copy, f.size, -1, "impossible");
    memcpy(copy, f.bytes, f.size);
    put(copy + 2048, 0x7fc00000, 4); /* NaN */
    check_refused(copy, f.size, -1, "not finite");
}

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
        direction((double)ti * PI / 12, (double)pi * PI / 24, i);
        direction((double)to * PI / 12, (double)po * PI / 24, o);
        double v = encode(ggx(ax, ay, i, o, .5, kd) * (1 - .2 * (double)(n / UTIA_PLANE)));
        memcpy(bytes + 8 * n, &v, 8);
    }
    return bytes;
}

TEST(utia_layout_and_interpolation)
{
    unsigned char *bytes = make_utia(.5, .3, .1);
    struct opened o;
    if (!bytes) return;
    double negative = -3, i[3], w[3], rgb[3], a[3], b[3];
    memcpy(bytes + 8 * 77, &negative, 8);
    CHECK(open_bytes(&o, bytes, UTIA_SIZE, -1));
    CHECK_INT(o.m.format, FORMAT_UTIA);
    CHECK(o.m.source.anisotropic);
    CHECK_INT(o.m.counts.values, UTIA_PLANE);
    CHECK_INT(o.m.counts.negative, 1);
    for (int k = 0; k < 100; k++) { /* nodes */
        direction((k % 6) * PI / 12, (k * 7 % 48) * PI / 24, i);
        direction((k % 5) * PI / 12, (k * 11 % 48) * PI / 24 + 1e-9, w);
        CHECK(ask_one(&o.m.source, i, w, rgb));
        for (int c = 0; c < 3; c++) CHECK_REL(rgb[c], ggx(.5, .3, i, w, .5, .1) * (1 - .2 * c), 1e-6, 0);
    }
    direction(PI / 6, PI / 24 * 47.5, i); /* between the last azimuth and the first */
    direction(PI / 12 * 2.5, 1, w);
    CHECK(ask_one(&o.m.source, i, w, rgb));
    direction(PI / 6, PI / 24 * 47, i);
    CHECK(ask_one(&o.m.source, i, w, a));
    direction(PI / 6, 0, i);
    CHECK(ask_one(&o.m.source, i, w, b));
    CHECK_REL(rgb[1], (a[1] + b[1]) / 2, 1e-9, 0);
    direction(76 * PI / 180, 0, i);
    CHECK(!ask_one(&o.m.source, i, w, rgb));
    close_bytes(&o);
    check_refused(bytes, UTIA_SIZE - 8, FORMAT_UTIA, "1990656");
    double bad = NAN;
    memcpy(bytes + 8 * 1000, &bad, 8);
    check_refused(bytes, UTIA_SIZE, -1, "number 1000");
    memset(bytes, 0, UTIA_SIZE);
    check_refused(bytes, UTIA_SIZE, -1, "no data");
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
    return json_number_value(json_object_get(json_object_get(answer->json, first), second));
}

TEST(utia_is_fitted)
{
    unsigned char *bytes = make_utia(.6, .4, .1);
    if (!bytes) return;
    struct answer answer = post("model=ggx&tolerance=0.001", NULL, bytes, UTIA_SIZE);
    CHECK_INT(answer.response.status, 200);
    CHECK_REL(number_of(&answer, "material", "alpha_x"), .6, 1e-3, 0); /* coloured as a whole, which Schlick is not */
    CHECK_REL(number_of(&answer, "material", "alpha_y"), .4, 1e-3, 0);
    CHECK(fabs(number_of(&answer, "material", "rho")) < 1e-4);
    CHECK(number_of(&answer, "error", "rms_log") < 5e-3);
    check_note("rms_log", number_of(&answer, "error", "rms_log"));
    check_note("ms", json_number_value(json_object_get(answer.json, "timing_ms")));
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
        direction(ti, pi, i);
        direction(to, po, o);
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
    CHECK_STR(json_string_value(json_object_get(json_object_get(answer.json, "data"), "format")), "csv");
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
    struct opened o;
    char text[4000] = "r,g,b,theta_i,phi_i,theta_o,phi_o\n", *at = text + strlen(text);
    for (int k = 0; k < 20; k++)
        at += sprintf(at, "%s;%d ; 2,0.%d 0.1\t0.3 , 0\n", k == 3 ? "nan" : k == 4 ? "" : "1",
                      k == 5 ? -1 : 1, k + 1);
    CHECK(open_bytes(&o, text, strlen(text), FORMAT_CSV));
    CHECK_INT(o.m.counts.values, 20);
    CHECK_INT(o.m.counts.missing, 2);
    CHECK_INT(o.m.counts.negative, 1);
    CHECK_INT(o.m.source.samples->count, 18);
    CHECK_REL(o.m.source.samples->wi.z[0], cos(.1), 1e-15, 0);
    CHECK_REL(o.m.source.samples->fr[2][0], 2, 0, 0);
    close_bytes(&o);
    check_refused("", 0, FORMAT_CSV, "0 samples");
    check_refused("", 0, -1, "0 bytes");
    check_refused("0.1,0,0.2,0,1,1,1\n", 18, FORMAT_CSV, "1 samples");
    check_refused("0.1,0,0.2,0,1,1\n", 16, FORMAT_CSV, "6 cells");
    check_refused("0.1,0,0.2,0,1,1,1,1\n", 20, FORMAT_CSV, "more than 7");
    check_refused("0.1,0,1.6,0,1,1,1\n", 18, FORMAT_CSV, "theta_o 1.6");
    check_refused("0.1,0,x,0,1,1,1\n", 16, FORMAT_CSV, "\"x\"");
    check_refused("0.1,0,0.2,0,inf,1,1\n", 20, FORMAT_CSV, "\"inf\"");
    check_refused("theta_i,phi_i,theta_o,phi_o,r,g,x\n", 34, FORMAT_CSV, "\"x\"");
    check_refused("theta_i,phi_i,theta_o,phi_o,r,g,g\n", 34, FORMAT_CSV, "there twice");
    check_refused("theta_i,phi_i\n", 14, FORMAT_CSV, "2 columns");
}

TEST(samples_of_json)
{
    char *body = malloc(1 << 20), *at = body;
    unsigned state = 7;
    at += sprintf(at, "{\"tolerance\":1e-3,\"anisotropic\":false,\"samples\":{\"wi\":[");
    double v[400][6];
    for (int k = 0; k < 400; k++) {
        direction(1.2 * fraction(&state), 6 * fraction(&state), v[k]);
        direction(1.2 * fraction(&state), 6 * fraction(&state), v[k] + 3);
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
        double to = k % 2 ? fmin(1.4, fabs(ti + .1 * (fraction(&state) - .5))) : 1.3 * fraction(&state);
        double po = k % 2 ? pi + .1 * (fraction(&state) - .5) : 6 * fraction(&state);
        direction(ti, pi, i);
        direction(to, po, o);
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
    static const char *const names[] = {"brdf/alta/retro-3M-jaune.dat", "brdf/alta/retro-gray-tape.dat"};
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
