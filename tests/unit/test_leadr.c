/* Height maps to pyramids, against sums straight from the definitions. */
#include "check.h"
#include "facet_leadr.h"
#include "pfm.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const facet_leadr_options plain = {.scale = 1, .texel = 1};

static float *noise(size_t width, size_t height, unsigned long long seed)
{
    struct rng rng;
    rng_seed(&rng, seed);
    float *z = malloc(width * height * sizeof *z);
    for (size_t i = 0; z && i < width * height; i++) z[i] = (float)rng_uniform(&rng);
    return z;
}

/* ---- The definitions ------------------------------------------------------------- */

static long double along(const facet_height_map *m, facet_border border, long p, long q);

/* Clamp: the parabola through the last three texels, written as Lagrange's interpolation. */
static long double beyond(const facet_height_map *m, long p, long q, bool column)
{
    const long n = (long)(column ? m->width : m->height), i = column ? p : q;
    const long nodes = n < 3 ? n : 3, start = i < 0 ? 0 : n - nodes;
    long double sum = 0;
    for (long a = start; a < start + nodes; a++) {
        long double w = 1;
        for (long b = start; b < start + nodes; b++)
            if (b != a) w *= (long double)(i - b) / (long double)(a - b);
        sum += w * along(m, FACET_CLAMP, column ? a : p, column ? q : a);
    }
    return sum;
}

static long double along(const facet_height_map *m, facet_border border, long p, long q)
{
    const long w = (long)m->width, h = (long)m->height;
    const bool outside_x = p < 0 || p >= w, outside_y = q < 0 || q >= h;
    if (border == FACET_CLAMP && outside_y) return beyond(m, p, q, false);
    if (border == FACET_CLAMP && outside_x) return beyond(m, p, q, true);
    if (border == FACET_PERIODIC) p = (p + w) % w, q = (q + h) % h;
    if (border == FACET_MIRROR) {
        p = p < 0 ? -1 - p : p >= w ? 2 * w - 1 - p : p;
        q = q < 0 ? -1 - q : q >= h ? 2 * h - 1 - q : q;
    }
    return m->heights[q * w + p];
}

/* Moments of the bilinear cell by Gauss's two points each way: exact for squares of linear slopes. */
static void cell_moments(const facet_height_map *m, facet_border b, long p, long q, double k,
                         double ky, long double e[5])
{
    const long double at[2] = {0.5L - 0.5L / sqrtl(3), 0.5L + 0.5L / sqrtl(3)};
    const long double z00 = along(m, b, p, q), z10 = along(m, b, p + 1, q);
    const long double z01 = along(m, b, p, q + 1), z11 = along(m, b, p + 1, q + 1);
    for (int i = 0; i < 5; i++) e[i] = 0;
    for (int i = 0; i < 4; i++) {
        const long double u = at[i & 1], v = at[i >> 1];
        const long double x = k * ((z10 - z00) * (1 - v) + (z11 - z01) * v);
        const long double y = ky * ((z01 - z00) * (1 - u) + (z11 - z10) * u);
        const long double t[5] = {x, y, x * x, y * y, x * y};
        for (int j = 0; j < 5; j++) e[j] += t[j] / 4;
    }
}

static void texel_moments(const facet_height_map *m, const facet_leadr_options *o, long p, long q,
                          long double e[5])
{
    const double k = o->scale / o->texel, ky = o->y_up ? -k : k;
    const facet_border b = o->border;
    const long offset = b == FACET_TRIM && o->stencil == FACET_CENTRAL;
    p += offset, q += offset;
    if (o->stencil == FACET_BILINEAR) {
        cell_moments(m, b, p, q, k, ky, e);
        return;
    }
    long double x = along(m, b, p + 1, q), y = along(m, b, p, q + 1);
    if (o->stencil == FACET_FORWARD) {
        x = k * (x - along(m, b, p, q));
        y = ky * (y - along(m, b, p, q));
    } else {
        x = k * (x - along(m, b, p - 1, q)) / 2;
        y = ky * (y - along(m, b, p, q - 1)) / 2;
    }
    e[0] = x, e[1] = y, e[2] = x * x, e[3] = y * y, e[4] = x * y;
}

/* Mean over [x0, x1) x [y0, y1) of level 0, texels split by area. */
static void footprint(const facet_height_map *m, const facet_leadr_options *o, double x0, double x1,
                      double y0, double y1, long double mean[5])
{
    for (int k = 0; k < 5; k++) mean[k] = 0;
    for (long q = (long)floor(y0); q < y1; q++)
        for (long p = (long)floor(x0); p < x1; p++) {
            const double w = fmax(0, fmin(x1, p + 1.0) - fmax(x0, p)) *
                             fmax(0, fmin(y1, q + 1.0) - fmax(y0, q));
            long double e[5];
            if (w > 1e-9) {
                texel_moments(m, o, p, q, e);
                for (int k = 0; k < 5; k++) mean[k] += w * e[k] / ((x1 - x0) * (y1 - y0));
            }
        }
}

static void check_pyramid(const facet_height_map *m, const facet_leadr_options *o)
{
    facet_leadr *leadr = NULL;
    CHECK_INT(facet_leadr_create(m, o, NULL, NULL, &leadr), FACET_OK);
    if (!leadr) return;
    const size_t trim = o->border != FACET_TRIM ? 0 : o->stencil == FACET_CENTRAL ? 2 : 1;
    const size_t w0 = m->width - trim, h0 = m->height - trim;
    const size_t count = facet_leadr_level_count(leadr);
    CHECK(!facet_leadr_level_at(leadr, count));
    for (size_t l = 0; l < count; l++) {
        const facet_leadr_level *level = facet_leadr_level_at(leadr, l);
        const size_t w = w0 >> l ? w0 >> l : 1, h = h0 >> l ? h0 >> l : 1;
        CHECK(level->width == w && level->height == h);
        CHECK((w == 1 && h == 1) == (l == count - 1));
        for (size_t i = 0; i < w * h; i++) {
            const double x = (double)w0 / (double)w, y = (double)h0 / (double)h;
            const double p = (double)(i % w), q = (double)(i / w);
            long double want[5];
            footprint(m, o, p * x, (p + 1) * x, q * y, (q + 1) * y, want);
            for (int k = 0; k < 5; k++)
                CHECK_REL(level->plane[k][i], (double)want[k], 6.1e-8, 1e-6);
        }
        const facet_moments *all = &facet_leadr_summary_of(leadr)->mean;
        long double want[5];
        footprint(m, o, 0, (double)w0, 0, (double)h0, want);
        const double got[5] = {all->e1, all->e2, all->e3, all->e4, all->e5};
        for (int k = 0; k < 5; k++) CHECK_REL(got[k], (double)want[k], 1e-13, 1e-2);
    }
    facet_leadr_destroy(leadr);
}

static facet_moments mean_of(const facet_height_map *m, const facet_leadr_options *o)
{
    facet_leadr *leadr = NULL;
    facet_moments mean = {NAN, NAN, NAN, NAN, NAN};
    CHECK_INT(facet_leadr_create(m, o, NULL, NULL, &leadr), FACET_OK);
    if (leadr) mean = facet_leadr_summary_of(leadr)->mean;
    facet_leadr_destroy(leadr);
    return mean;
}

/* ---- Tests ----------------------------------------------------------------------- */

TEST(every_level_is_the_mean_of_its_footprint)
{
    static const size_t sizes[][2] = {{1, 1},
                                      {1, 2},
                                      {2, 1},
                                      {2, 2},
                                      {3, 1},
                                      {3, 3},
                                      {4, 4},
                                      {5, 7},
                                      {8, 16},
                                      {13, 6},
                                      {21, 1},
                                      {17, 31},
                                      /* batches of 2, 4 and 8 rows, the last one shorter */
                                      {7, 521},
                                      {4, 1030},
                                      {3, 2053}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        for (int s = 0; s < FACET_STENCIL_COUNT; s++)
            for (int b = 0; b < FACET_BORDER_COUNT; b++) {
                facet_leadr_options o = plain;
                o.stencil = (facet_stencil)s;
                o.border = (facet_border)b;
                o.scale = 0.75;
                o.texel = 0.4;
                o.y_up = i % 2;
                facet_height_map m = {NULL, sizes[i][0], sizes[i][1]};
                if (b == FACET_TRIM && (m.width < 3 || m.height < 3)) continue;
                float *z = noise(m.width, m.height, i + 1);
                m.heights = z;
                if (z) check_pyramid(&m, &o);
                free(z);
            }
}

TEST(flat_is_zero)
{
    float z[7 * 5];
    for (int i = 0; i < 35; i++) z[i] = 0.3f;
    const facet_height_map m = {z, 7, 5};
    for (int s = 0; s < FACET_STENCIL_COUNT * FACET_BORDER_COUNT; s++) {
        facet_leadr_options o = plain;
        o.stencil = (facet_stencil)(s % FACET_STENCIL_COUNT);
        o.border = (facet_border)(s / FACET_STENCIL_COUNT);
        facet_leadr *leadr = NULL;
        CHECK_INT(facet_leadr_create(&m, &o, NULL, NULL, &leadr), FACET_OK);
        for (size_t l = 0; leadr && l < facet_leadr_level_count(leadr); l++) {
            const facet_leadr_level *level = facet_leadr_level_at(leadr, l);
            for (size_t i = 0; i < 5 * level->width * level->height; i++)
                CHECK(level->plane[0][i] == 0);
            CHECK(level->loss.variance == 0 && level->loss.stored == 0 && level->loss.lost == 0);
        }
        facet_leadr_destroy(leadr);
    }
}

/* Dyadic slopes on a plane: every stencil, clamped, gives them exactly in every texel. */
TEST(plane_keeps_its_slope_when_clamped)
{
    float z[9 * 6];
    for (int i = 0; i < 54; i++) z[i] = 3 + 0.375f * (float)(i % 9) - 1.25f * (float)(i / 9);
    const facet_height_map m = {z, 9, 6};
    for (int s = 0; s < FACET_STENCIL_COUNT; s++) {
        facet_leadr_options o = plain;
        o.stencil = (facet_stencil)s;
        o.border = FACET_CLAMP;
        o.texel = 0.5;
        facet_leadr *leadr = NULL;
        CHECK_INT(facet_leadr_create(&m, &o, NULL, NULL, &leadr), FACET_OK);
        for (size_t l = 0; leadr && l < facet_leadr_level_count(leadr); l++) {
            const facet_leadr_level *v = facet_leadr_level_at(leadr, l);
            for (size_t i = 0; i < v->width * v->height; i++) {
                CHECK(v->plane[0][i] == 0.75f && v->plane[1][i] == -2.5f);
                CHECK(v->plane[2][i] == 0.5625f && v->plane[3][i] == 6.25f);
                CHECK(v->plane[4][i] == -1.875f);
            }
        }
        facet_leadr_destroy(leadr);
    }
}

/* A whole number of waves: the mean slope is 0 and the mean square closed, border included. */
TEST(periodic_wave)
{
    enum { N = 64 };
    float *z = malloc(N * N * sizeof *z);
    if (!z) return;
    const double k = 2 * acos(-1) * 3 / N;
    for (int i = 0; i < N * N; i++) z[i] = (float)cos(k * (i % N));
    const facet_height_map m = {z, N, N};
    const double expected[] = {sin(k) * sin(k) / 2, 2 * sin(k / 2) * sin(k / 2),
                               2 * sin(k / 2) * sin(k / 2)};
    for (int s = 0; s < FACET_STENCIL_COUNT; s++) {
        facet_leadr_options o = plain;
        o.stencil = (facet_stencil)s;
        const facet_moments mean = mean_of(&m, &o);
        CHECK_REL(mean.e1, 0, 1e-15, 1);
        CHECK_REL(mean.e3, expected[s], 1e-7, 0); /* the heights are floats */
        CHECK(mean.e2 == 0 && mean.e4 == 0 && mean.e5 == 0);
    }
    free(z);
}

TEST(base_roughness_is_a_process_below)
{
    float *z = noise(12, 10, 3);
    const facet_height_map m = {z, 12, 10};
    facet_leadr_options o = plain;
    const facet_moments bare = mean_of(&m, &o);
    const facet_roughness base = {.alpha_x = 0.3, .alpha_y = 0.2, .rho = 0.4};
    o.base = facet_covariance_from_roughness(&base);
    const facet_moments below = facet_moments_from_roughness(&base);
    const facet_moments want = facet_moments_add(&bare, &below);
    facet_leadr *leadr = NULL;
    CHECK_INT(facet_leadr_create(&m, &o, NULL, NULL, &leadr), FACET_OK);
    const facet_leadr_level *last = facet_leadr_level_at(leadr, facet_leadr_level_count(leadr) - 1);
    CHECK_REL(facet_leadr_summary_of(leadr)->mean.e3, want.e3, 1e-14, 0);
    CHECK_REL(facet_leadr_summary_of(leadr)->mean.e4, want.e4, 1e-14, 0);
    CHECK_REL(facet_leadr_summary_of(leadr)->mean.e5, want.e5, 1e-14, 0.01);
    CHECK_REL(last->plane[2][0], want.e3, 6.1e-8, 0);
    CHECK_REL(last->plane[3][0], want.e4, 6.1e-8, 0);
    CHECK_REL(last->plane[4][0], want.e5, 6.1e-8, 0.01);
    facet_leadr_destroy(leadr);
    o.form = FACET_CENTRED;
    CHECK_INT(facet_leadr_create(&m, &o, NULL, NULL, &leadr), FACET_OK);
    last = facet_leadr_level_at(leadr, facet_leadr_level_count(leadr) - 1);
    CHECK_REL(last->plane[0][0], want.e1, 6.1e-8, 0.01);
    CHECK_REL(last->plane[1][0], want.e2, 6.1e-8, 0.01);
    CHECK_REL(last->plane[2][0], want.e3 - want.e1 * want.e1, 6.1e-8, 0);
    CHECK_REL(last->plane[3][0], want.e4 - want.e2 * want.e2, 6.1e-8, 0);
    CHECK_REL(last->plane[4][0], want.e5 - want.e1 * want.e2, 6.1e-8, 0.01);
    facet_leadr_destroy(leadr);
    free(z);
}

/* Steep slope, little roughness: raw half loses it and says so; centred keeps it. */
TEST(variance_lost_to_the_type_is_told)
{
    enum { N = 32 };
    float *z = noise(N, N, 4);
    for (int i = 0; i < N * N; i++) z[i] = 4.0f * (float)(i % N) + 0.1f * z[i];
    const facet_height_map m = {z, N, N};
    facet_leadr_options o = plain;
    o.border = FACET_CLAMP;
    double worst[2][2];
    for (int type = 0; type < 2; type++)
        for (int form = 0; form < 2; form++) {
            o.storage = (facet_storage)type;
            o.form = (facet_moment_form)form;
            facet_leadr *leadr = NULL;
            CHECK_INT(facet_leadr_create(&m, &o, NULL, NULL, &leadr), FACET_OK);
            const facet_leadr_level *v = facet_leadr_level_at(leadr, 2);
            worst[type][form] = v->loss.worst;
            const double drift = fabs(v->loss.stored - v->loss.variance) / v->loss.variance;
            CHECK(drift <= v->loss.worst);
            CHECK((v->loss.lost > 0) == (type == FACET_HALF && form == FACET_RAW));
            /* What the planes say is what was told. */
            double sum = 0;
            for (size_t i = 0; i < v->width * v->height; i++) {
                const double a = v->plane[0][i], b = v->plane[1][i];
                sum += (double)v->plane[2][i] + v->plane[3][i];
                if (form == FACET_RAW) sum -= a * a + b * b;
            }
            CHECK_REL(v->loss.stored, sum / (double)(v->width * v->height), 1e-9, 0);
            facet_leadr_destroy(leadr);
        }
    check_note("worst loss raw float", worst[FACET_FLOAT][FACET_RAW]);
    check_note("worst loss raw half", worst[FACET_HALF][FACET_RAW]);
    CHECK(worst[FACET_FLOAT][FACET_CENTRED] < 1e-6);
    CHECK(worst[FACET_HALF][FACET_CENTRED] < 1e-2);
    CHECK(worst[FACET_HALF][FACET_RAW] > 1);
    free(z);
}

/* Rounding to half, value by value: nearest, ties to even, subnormals, overflow. */
TEST(half)
{
    static const struct {
        float height, stored;
    } cases[] = {{1, 1},
                 {1 + 0x1p-11f, 1},
                 {1 + 0x1.8p-10f, 1 + 0x1p-9f},
                 {1 + 0x1.02p-11f, 1 + 0x1p-10f},
                 {0x1p-24f, 0x1p-24f},
                 {0x1p-25f, 0},
                 {0x1.8p-24f, 0x1p-23f},
                 {-3.3f, -3.30078125f},
                 {65504 / 256.f, 65504 / 256.f}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const float z[4] = {0, cases[i].height, 0, cases[i].height};
        const facet_height_map m = {z, 2, 2};
        facet_leadr_options o = plain;
        o.border = FACET_TRIM;
        o.stencil = FACET_FORWARD;
        o.storage = FACET_HALF;
        facet_leadr *leadr = NULL;
        CHECK_INT(facet_leadr_create(&m, &o, NULL, NULL, &leadr), FACET_OK);
        if (leadr) CHECK(facet_leadr_level_at(leadr, 0)->plane[0][0] == cases[i].stored);
        facet_leadr_destroy(leadr);
    }
    const float z[4] = {0, 256, 0, 256}; /* E3 = 65536 */
    const facet_height_map m = {z, 2, 2};
    facet_leadr_options o = plain;
    o.stencil = FACET_FORWARD;
    o.storage = FACET_HALF;
    facet_map_flaw flaw = {9, 9, 9};
    facet_leadr *leadr = NULL;
    CHECK_INT(facet_leadr_create(&m, &o, NULL, &flaw, &leadr), FACET_BAD_DATA);
    CHECK(!leadr && flaw.count == 0);
    o.storage = FACET_FLOAT;
    CHECK_INT(facet_leadr_create(&m, &o, NULL, &flaw, &leadr), FACET_OK);
    facet_leadr_destroy(leadr);
}

static bool stop_at_once(void *user)
{
    ++*(int *)user;
    return true;
}

TEST(refusals)
{
    float z[12] = {0};
    const facet_height_map m = {z, 4, 3};
    facet_leadr *leadr = NULL;
    facet_map_flaw flaw;
    z[5] = NAN;
    z[9] = -INFINITY;
    CHECK_INT(facet_leadr_create(&m, &plain, NULL, &flaw, &leadr), FACET_BAD_DATA);
    CHECK(!leadr && flaw.count == 2 && flaw.column == 1 && flaw.row == 1);
    z[5] = z[9] = 0;

    const facet_height_map none = {z, 0, 3}, wide = {z, FACET_MAP_SIDE_MAX + 1, 1};
    const facet_height_map large = {z, 8192, 8193}, huge = {z, (size_t)1 << 40, (size_t)1 << 40};
    CHECK_INT(facet_leadr_create(&none, &plain, NULL, &flaw, &leadr), FACET_BAD_SIZE);
    CHECK_INT(facet_leadr_create(&wide, &plain, NULL, &flaw, &leadr), FACET_BAD_SIZE);
    CHECK_INT(facet_leadr_create(&large, &plain, NULL, &flaw, &leadr), FACET_BAD_SIZE);
    CHECK_INT(facet_leadr_create(&huge, &plain, NULL, &flaw, &leadr), FACET_BAD_SIZE);

    facet_leadr_options o = plain;
    o.border = FACET_TRIM;
    const facet_height_map two = {z, 2, 3}, line = {z, 12, 1};
    CHECK_INT(facet_leadr_create(&two, &o, NULL, &flaw, &leadr), FACET_BAD_SIZE);
    CHECK_INT(facet_leadr_create(&line, &o, NULL, &flaw, &leadr), FACET_BAD_SIZE);
    o = plain;
    o.texel = 0;
    CHECK_INT(facet_leadr_create(&m, &o, NULL, &flaw, &leadr), FACET_BAD_SIZE);
    o.texel = NAN;
    CHECK_INT(facet_leadr_create(&m, &o, NULL, &flaw, &leadr), FACET_BAD_SIZE);
    o = plain;
    o.base.xx = -1;
    CHECK_INT(facet_leadr_create(&m, &o, NULL, &flaw, &leadr), FACET_BAD_ALPHA);

    int asked = 0;
    const facet_watch watch = {stop_at_once, &asked};
    CHECK_INT(facet_leadr_create(&m, &plain, &watch, &flaw, &leadr), FACET_CANCELLED);
    CHECK(!leadr && asked == 1);
    facet_leadr_destroy(NULL);
}

/* Real surfaces: trimmed forward differences give the rms slopes another project published. */
TEST(microsurfaces_have_their_known_slopes)
{
    for (int i = 0; i < 3; i++) {
        const char *path = check_data(microsurfaces[i].path);
        facet_height_map m;
        float *z = path ? pfm_read(path, &m.width, &m.height) : NULL;
        if (!z) {
            check_skip("no shared data");
            return;
        }
        m.heights = z;
        facet_leadr_options o = plain;
        o.texel = microsurfaces[i].texel;
        o.stencil = FACET_FORWARD;
        o.border = FACET_TRIM;
        facet_leadr *leadr = NULL;
        CHECK_INT(facet_leadr_create(&m, &o, NULL, NULL, &leadr), FACET_OK);
        const facet_leadr_level *last = facet_leadr_level_at(leadr,
                                                             facet_leadr_level_count(leadr) - 1);
        const double rms = sqrt((double)last->plane[2][0] + last->plane[3][0]);
        CHECK_REL(rms, microsurfaces[i].rms_slope, 1e-7, 0);
        check_note("error of the rms slope", fabs(rms / microsurfaces[i].rms_slope - 1));
        facet_leadr_destroy(leadr);
        free(z);
    }
}

/* Every texel of every level of a measured surface, against direct sums. */
TEST(microsurfaces_at_every_level)
{
    for (int i = 0; i < 3; i++) {
        const char *path = check_data(microsurfaces[i].path);
        facet_height_map m;
        float *z = path ? pfm_read(path, &m.width, &m.height) : NULL;
        if (!z) {
            check_skip("no shared data");
            return;
        }
        m.heights = z;
        facet_leadr_options o = plain;
        o.texel = microsurfaces[i].texel;
        o.stencil = (facet_stencil)((i + 1) % FACET_STENCIL_COUNT);
        o.border = (facet_border)i;
        check_pyramid(&m, &o);
        free(z);
    }
}
