/* RGL .bsdf: against its own reader, written here, damaged. */
#include "bsdf.h"
#include "check.h"
#include "facet_fit.h"
#include "reader.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

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
    struct reader o = {0};
    size_t rows = 0, size;
    double worst = 0;
    while (fgets(line, sizeof line, file)) {
        double a[4], rgb[3], ours[3], i[3], w[3];
        if (sscanf(line, "%99[^,],%lf,%lf,%lf,%lf,%lf,%lf,%lf", name, a, a + 1, a + 2, a + 3, rgb,
                   rgb + 1, rgb + 2) != 8)
            continue;
        if (strcmp(name, last)) {
            char path[200];
            if (bytes) reader_close(&o);
            free(bytes);
            snprintf(path, sizeof path, "brdf/rgl/%s", name);
            const char *found = check_data(path); /* of some the file is not there */
            bytes = found ? check_read_file(found, &size) : NULL;
            strcpy(last, name);
            if (bytes) {
                CHECK(reader_open(&o, bytes, size, -1));
                CHECK_INT(o.m.format, FORMAT_BSDF);
                CHECK(!o.m.source.anisotropic);
            }
        }
        if (!bytes || o.problem.status) continue;
        reader_direction(a[0] * PI / 180, a[1] * PI / 180, i);
        reader_direction(a[2] * PI / 180, a[3] * PI / 180, w);
        if (!reader_ask(&o.m.source, i, w, ours)) continue;
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
    if (bytes) reader_close(&o);
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
        data[k] = (5 + phis[k / 48]) * nm[k / 4 % 4] / 500 *
                  (1 + (float)(k % 2) + 2 * (float)(k / 2 % 2));
    f->size = f->data;
}

TEST(bsdf_anisotropic_and_spectral)
{
    static struct file f;
    static const double nm[3] = {630, 532, 465};
    struct reader o;
    make_anisotropic(&f);
    CHECK(reader_open(&o, f.bytes, f.size, -1));
    CHECK(o.m.source.anisotropic);
    CHECK_INT(o.m.counts.values, 48);
    for (int k = 0; k < 200; k++) {
        double i[3], w[3], rgb[3], phi_i = -3.1 + .031 * k;
        reader_direction(.01 + .007 * k, phi_i, i);
        reader_direction(1.5 - .007 * k, 2 + .05 * k, w);
        CHECK(reader_ask(&o.m.source, i, w, rgb));
        double x = i[0] + w[0], y = i[1] + w[1], z = i[2] + w[2];
        double u = sqrt(atan2(hypot(x, y), z) * 2 / PI), v = (atan2(y, x) + PI) / (2 * PI);
        for (int c = 0; c < 3; c++)
            CHECK_REL(rgb[c] * w[2], (5 + phi_i) * nm[c] / 500 * (1 + u + 2 * v), 1e-5, 0);
    }
    reader_close(&o);
}

TEST(bsdf_damaged)
{
    static struct file f;
    static unsigned char copy[sizeof f.bytes];
    make_anisotropic(&f);
    for (size_t n = 0; n < f.size; n += n < 700 ? 1 : 97)
        reader_refuses(f.bytes, n, FORMAT_BSDF, "");
    for (size_t at = 12; at < 700; at++) { /* any one byte */
        for (int bit = 0; bit < 8; bit += 7) {
            struct reader o;
            memcpy(copy, f.bytes, f.size);
            copy[at] ^= (unsigned char)(1 << bit);
            if (!reader_open(&o, copy, f.size, FORMAT_BSDF)) CHECK_INT(o.problem.status, 422);
            reader_close(&o);
        }
    }
    reader_refuses("tensor_file", 12, -1, "12");
    memcpy(copy, f.bytes, f.size);
    unsigned char *shape = copy + 18 + 2 + 5 + 11; /* of phi_i, the first field */
    put(shape, (uint64_t)1 << 32, 8);
    reader_refuses(copy, f.size, -1, "impossible");
    memcpy(copy, f.bytes, f.size);
    put(copy + 2048, 0x7fc00000, 4); /* NaN */
    reader_refuses(copy, f.size, -1, "not finite");
}
