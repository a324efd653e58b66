/* The MERL reader: layout, units, interpolation, holes; damaged files; a real slice. */
#include "check.h"
#include "measured.h"
#include "merl.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

enum { PLANE = 90 * 90 * 180 };

static unsigned char *make_file(double value)
{
    static const int dims[3] = {90, 90, 180};
    unsigned char *bytes = malloc(MERL_SIZE);
    if (!bytes) return NULL;
    memcpy(bytes, dims, sizeof dims); /* tests run on little-endian machines */
    for (size_t i = 0; i < 3 * PLANE; i++) memcpy(bytes + 12 + 8 * i, &value, sizeof value);
    return bytes;
}

static void put(unsigned char *bytes, int plane, int h, int d, int p, double value)
{
    size_t index = (size_t)(plane * PLANE + p + 180 * (d + 90 * h));
    memcpy(bytes + 12 + 8 * index, &value, sizeof value);
}

/* Directions of Rusinkiewicz angles, half vector at azimuth phi_h. */
static void directions(double th, double td, double pd, double phi_h, double wi[3], double wo[3])
{
    double d[3] = {sin(td) * cos(pd), sin(td) * sin(pd), cos(td)}, x, z;
    x = cos(th) * d[0] + sin(th) * d[2];
    z = -sin(th) * d[0] + cos(th) * d[2];
    wi[0] = cos(phi_h) * x - sin(phi_h) * d[1];
    wi[1] = sin(phi_h) * x + cos(phi_h) * d[1];
    wi[2] = z;
    double h[3] = {sin(th) * cos(phi_h), sin(th) * sin(phi_h), cos(th)};
    for (int k = 0; k < 3; k++) wo[k] = 2 * cos(td) * h[k] - wi[k];
}

static bool look_up(const struct merl *merl, double th, double td, double pd, double phi_h,
                    double rgb[3])
{
    double wi[3], wo[3];
    bool valid;
    directions(th, td, pd, phi_h, wi, wo);
    double *fr[3] = {&rgb[0], &rgb[1], &rgb[2]};
    CHECK_INT(api_merl_evaluate(merl, (facet_vec3_in){&wi[0], &wi[1], &wi[2]},
                                (facet_vec3_in){&wo[0], &wo[1], &wo[2]}, 1, fr, &valid),
              FACET_OK);
    return valid;
}

static double half_angle(double index)
{
    return PI / 2 * (index / 90) * (index / 90);
}

TEST(layout_and_units)
{
    unsigned char *bytes = make_file(1500);
    struct merl merl;
    struct data_counts counts = {0};
    struct problem problem = {0};
    double rgb[3];
    if (!bytes) return;
    CHECK(api_merl_matches(bytes, MERL_SIZE));
    CHECK(api_merl_open(bytes, MERL_SIZE, &merl, &counts, &problem));
    CHECK(look_up(&merl, .3, .4, 1, 0, rgb));
    CHECK_REL(rgb[0], 1, 1e-12, 0);
    CHECK_REL(rgb[1], 1.15, 1e-12, 0);
    CHECK_REL(rgb[2], 1.66, 1e-12, 0);
    put(bytes, 1, 30, 20, 45, 4500);
    for (int turn = 0; turn < 5;
         turn++) { /* isotropic: phi_h does not matter; phi_d mod pi: reciprocity */
        double phi_h = turn * 1.3;
        CHECK(look_up(&merl, half_angle(30), PI / 2 * 20 / 90, PI * 45 / 180, phi_h, rgb));
        CHECK_REL(rgb[1], 3 * 1.15, 1e-9, 0);
        CHECK(look_up(&merl, half_angle(30), PI / 2 * 20 / 90, PI * 45 / 180 + PI, phi_h, rgb));
        CHECK_REL(rgb[1], 3 * 1.15, 1e-9, 0);
        CHECK(look_up(&merl, half_angle(30.5), PI / 2 * 20 / 90, PI * 45 / 180, phi_h, rgb));
        CHECK_REL(rgb[1], 2 * 1.15, 1e-9, 0);
        CHECK(look_up(&merl, half_angle(30), PI / 2 * 20.25 / 90, PI * 45 / 180, phi_h, rgb));
        CHECK_REL(rgb[1], 2.5 * 1.15, 1e-9, 0);
        CHECK(look_up(&merl, half_angle(30), PI / 2 * 20 / 90, PI * 45.75 / 180, phi_h, rgb));
        CHECK_REL(rgb[1], 1.5 * 1.15, 1e-9, 0);
    }
    put(bytes, 0, 30, 20, 0, 3000); /* phi_d is periodic: half way from 179 to 180 = 0 */
    CHECK(look_up(&merl, half_angle(30), PI / 2 * 20 / 90, PI * 179.5 / 180, 0, rgb));
    CHECK_REL(rgb[0], 1.5, 1e-9, 0);
    CHECK(look_up(&merl, 0, 0, 0, 0, rgb));                /* straight down */
    CHECK(look_up(&merl, half_angle(89.7), 0, 0, 0, rgb)); /* past the last row */
    CHECK_REL(rgb[0], 1, 1e-12, 0);
    CHECK_REL(api_merl_slope_max(), tan(half_angle(89)), 1e-12, 0);
    free(bytes);
}

TEST(holes)
{
    unsigned char *bytes = make_file(1500);
    struct merl merl;
    struct data_counts counts = {0};
    struct problem problem = {0};
    double rgb[3];
    if (!bytes) return;
    put(bytes, 2, 30, 20, 45, -1); /* one colour is enough */
    CHECK(api_merl_open(bytes, MERL_SIZE, &merl, &counts, &problem));
    double td = PI / 2 * 20 / 90, pd = PI * 45 / 180;
    CHECK(!look_up(&merl, half_angle(30), td, pd, 0, rgb));
    CHECK(!look_up(&merl, half_angle(30.4), td, pd, 0, rgb));
    CHECK(look_up(&merl, half_angle(30.6), td, pd, 0, rgb));
    CHECK_REL(rgb[2], 1.66, 1e-12, 0); /* the hole does not pull down its neighbours */
    free(bytes);
}

static void check_refused(const unsigned char *bytes, size_t size, const char *word)
{
    struct merl merl;
    struct data_counts counts = {0};
    struct problem problem = {0};
    CHECK(!api_merl_open(bytes, size, &merl, &counts, &problem));
    CHECK_INT(problem.status, 422);
    if (!strstr(problem.detail, word))
        check_fail(__FILE__, __LINE__, "no \"%s\" in: %s", word, problem.detail);
}

TEST(damaged_files)
{
    unsigned char *bytes = make_file(1);
    if (!bytes) return;
    static const size_t sizes[] = {0, 1, 11, 12, 13, MERL_SIZE - 1};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        unsigned char *cut = malloc(sizes[i] ? sizes[i]
                                             : 1); /* an overrun is seen by the sanitizer */
        if (!cut) return;
        memcpy(cut, bytes, sizes[i]);
        CHECK(api_merl_matches(cut, sizes[i]) == (sizes[i] >= 12));
        check_refused(cut, sizes[i], "34992012");
        free(cut);
    }
    check_refused(bytes, MERL_SIZE + 1, "34992013");
    put(bytes, 1, 2, 3, 4, NAN);
    check_refused(bytes, MERL_SIZE, "colour plane 1, theta_h 2, theta_d 3, phi_d 4");
    put(bytes, 1, 2, 3, 4, -INFINITY);
    check_refused(bytes, MERL_SIZE, "not a finite number");
    bytes[0] = 91;
    CHECK(api_merl_matches(bytes, MERL_SIZE));
    check_refused(bytes, MERL_SIZE, "with 91, 90, 180");
    bytes[3] = 0xff;
    check_refused(bytes, MERL_SIZE, "90, 90, 180");
    free(bytes);
    bytes = make_file(-1);
    if (!bytes) return;
    check_refused(bytes, MERL_SIZE, "no data");
    free(bytes);
}

/*
 * A slice of the original pink-felt (theta_d 20 degrees, phi_d 90 degrees) against the network
 * trained on it: within rms 0.0023.  A wrong scale factor or a linear theta_h is off by ten times
 * that.
 */
TEST(real_slice_fixes_the_scale_factors)
{
    const char *path = check_data("brdf/alta/pink-felt-1d.alta");
    FILE *slice = path ? fopen(path, "r") : NULL;
    size_t size = 0;
    unsigned char *bytes = slice ? measured_merl("pink-felt", &size) : NULL;
    if (!bytes) {
        if (slice) fclose(slice);
        check_skip("no shared data or tools, or no cc");
        return;
    }
    CHECK_INT(size, MERL_SIZE);
    struct merl merl = {bytes};
    double cos_theta_h, rgb[3], at[3], sum[3] = {0, 0, 0};
    char line[256];
    int rows = 0;
    while (fgets(line, sizeof line, slice)) {
        if (sscanf(line, "%lf %lf %lf %lf", &cos_theta_h, &rgb[0], &rgb[1], &rgb[2]) != 4) continue;
        CHECK(look_up(&merl, acos(cos_theta_h), PI / 9, PI / 2, 0, at));
        for (int c = 0; c < 3; c++) sum[c] += (at[c] - rgb[c]) * (at[c] - rgb[c]);
        rows++;
    }
    CHECK_INT(rows, 90);
    for (int c = 0; c < 3; c++) {
        CHECK(sqrt(sum[c] / rows) < .003);
        check_note("rms", sqrt(sum[c] / rows));
    }
    fclose(slice);
    free(bytes);
}
