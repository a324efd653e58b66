/* Maps row by row: symmetry, what is kept of small variances, slope maps, CLEAN, the GGX base. */
#include "check.h"
#include "facet_leadr.h"
#include "pfm.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const facet_leadr_options plain = {.scale = 1, .texel = 1};

static float *noise(size_t n, unsigned long long seed)
{
    struct rng rng;
    rng_seed(&rng, seed);
    float *z = malloc(n * sizeof *z);
    for (size_t i = 0; z && i < n; i++) z[i] = (float)rng_uniform(&rng);
    return z;
}

static facet_leadr *filter(const float *z, size_t w, size_t h, const facet_leadr_options *o)
{
    const facet_height_map m = {z, w, h};
    facet_leadr *leadr = NULL;
    CHECK_INT(facet_leadr_create(&m, o, NULL, NULL, &leadr), FACET_OK);
    return leadr;
}

/* ---- Symmetry ------------------------------------------------------------------------------ */

/* Every level of the mirrored map is the mirrored level with the slopes across turned, bit for bit. */
static void check_mirrored(const facet_leadr *a, const facet_leadr *b, bool along_x)
{
    for (size_t l = 0; l < facet_leadr_level_count(a); l++) {
        const facet_leadr_level *va = facet_leadr_level_at(a, l), *vb = facet_leadr_level_at(b, l);
        const size_t w = va->width, h = va->height;
        size_t wrong = 0;
        for (size_t i = 0; i < w * h; i++) {
            const size_t p = i % w, q = i / w;
            const size_t j = along_x ? q * w + w - 1 - p : (h - 1 - q) * w + p;
            for (int k = 0; k < 5; k++) {
                const bool turns = k == (along_x ? 0 : 1) || k == 4;
                if (!(va->plane[k][i] == (turns ? -vb->plane[k][j] : vb->plane[k][j]))) wrong++;
            }
        }
        CHECK_INT(wrong, 0);
    }
}

TEST(mirrored_maps_give_mirrored_levels_bit_for_bit)
{
    static const size_t sizes[][2] = {{64, 64}, {63, 47}, {1, 9}, {130, 5}, {75, 305}, {6, 2053}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++)
        for (int c = 0; c < 2 * (FACET_BORDER_COUNT + 1); c++) {
            const size_t w = sizes[s][0], h = sizes[s][1];
            const bool along_x = c % 2;
            facet_leadr_options o = plain;
            o.border = (facet_border)(c / 2 % FACET_BORDER_COUNT);
            /* Cells of the bilinear surface lie between texels: whole in a trimmed map. */
            if (c / 2 == FACET_BORDER_COUNT) o.stencil = FACET_BILINEAR, o.border = FACET_TRIM;
            o.form = s % 2 ? FACET_RAW : FACET_CENTRED;
            o.texel = 0.3;
            if (o.border == FACET_TRIM && (w < 3 || h < 3)) continue;
            float *z = noise(w * h, s + 1), *m = malloc(w * h * sizeof *m);
            for (size_t i = 0; z && m && i < w * h; i++)
                m[i] = z[along_x ? i / w * w + w - 1 - i % w : (h - 1 - i / w) * w + i % w];
            facet_leadr *a = filter(z, w, h, &o), *b = filter(m, w, h, &o);
            if (a && b) check_mirrored(a, b, along_x);
            facet_leadr_destroy(a);
            facet_leadr_destroy(b);
            free(z);
            free(m);
        }
}

/* The slopes around a periodic map sum to nothing: exactly where halves are whole. */
TEST(a_periodic_map_has_no_mean_slope)
{
    static const size_t sizes[][2] = {{64, 64}, {63, 47}, {100, 7}};
    for (size_t s = 0; s < 3; s++)
        for (int stencil = 0; stencil < FACET_STENCIL_COUNT; stencil++) {
            facet_leadr_options o = plain;
            o.stencil = (facet_stencil)stencil;
            o.texel = 0.3;
            float *z = noise(sizes[s][0] * sizes[s][1], 7);
            facet_leadr *leadr = filter(z, sizes[s][0], sizes[s][1], &o);
            const facet_moments *mean = &facet_leadr_summary_of(leadr)->mean;
            CHECK(fabs(mean->e1) <= (s ? 1e-16 : 0) && fabs(mean->e2) <= (s ? 1e-16 : 0));
            facet_leadr_destroy(leadr);
            free(z);
        }
}

/* ---- Small variances on large slopes -------------------------------------------------------- */

/* Variance of texel (p, q) of level l by central differences of the heights, in long double. */
static double direct_variance(const float *z, size_t w, size_t p, size_t q, size_t side)
{
    long double s[2] = {0, 0}, ss[2] = {0, 0};
    for (size_t i = 0; i < side * side; i++) {
        const size_t x = p * side + i % side, y = q * side + i / side;
        const long double d[2] = {((long double)z[y * w + x + 1] - z[y * w + x - 1]) / 2,
                                  ((long double)z[(y + 1) * w + x] - z[(y - 1) * w + x]) / 2};
        for (int k = 0; k < 2; k++) s[k] += d[k], ss[k] += d[k] * d[k];
    }
    const long double n = (long double)(side * side);
    return (double)((ss[0] - s[0] * s[0] / n + ss[1] - s[1] * s[1] / n) / n);
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median relative error of the stored variance over the inner texels of a level. */
static double median_error(const float *z, size_t n, const facet_leadr *leadr, size_t l, bool raw)
{
    const facet_leadr_level *v = facet_leadr_level_at(leadr, l);
    double *errors = malloc(v->width * v->height * sizeof *errors);
    size_t count = 0;
    for (size_t q = 1; errors && q + 1 < v->height; q++)
        for (size_t p = 1; p + 1 < v->width; p++) {
            const size_t i = q * v->width + p;
            double stored = (double)v->plane[2][i] + v->plane[3][i];
            if (raw)
                stored -= (double)v->plane[0][i] * v->plane[0][i] +
                          (double)v->plane[1][i] * v->plane[1][i];
            const double exact = direct_variance(z, n, p, q, (size_t)1 << l);
            errors[count++] = fabs(stored - exact) / exact;
        }
    qsort(errors, count, sizeof *errors, by_value);
    const double median = errors[count / 2];
    free(errors);
    return median;
}

/* Slope 4, sigma .01: raw float keeps a percent, raw half nothing; central float keeps it all. */
TEST(steep_terrain_keeps_its_variance)
{
    enum { N = 256 };
    float *z = noise(N * N, 11);
    /* Uniform heights of width 1 have central slopes of sigma sqrt(1/24). */
    const float amplitude = (float)(0.01 / sqrt(1.0 / 24));
    for (int i = 0; i < N * N; i++) z[i] = 4 * (float)(i % N) + amplitude * z[i];
    for (int raw = 0; raw < 2; raw++)
        for (int half = 0; half < 2; half++) {
            facet_leadr_options o = plain;
            o.border = FACET_CLAMP;
            o.form = raw ? FACET_RAW : FACET_CENTRED;
            o.storage = half ? FACET_HALF : FACET_FLOAT;
            facet_leadr *leadr = filter(z, N, N, &o);
            const double error = median_error(z, N, leadr, 1, raw);
            check_note(raw ? half ? "raw half" : "raw float" : half ? "half" : "float", error);
            if (!raw) CHECK(error <= (half ? 1e-3 : 1e-7));
            if (raw && half) CHECK(error > 1 && facet_leadr_summary_of(leadr)->loss[1].lost > 0);
            facet_leadr_destroy(leadr);
        }
    free(z);
}

/* ---- Slope maps ----------------------------------------------------------------------------- */

struct slopes {
    float *rows; /* of each row: along x, then along y */
    size_t width;
};

static const float *slope_row(void *user, size_t row)
{
    const struct slopes *s = user;
    return s->rows + 2 * row * s->width;
}

/* The slopes that central differences see, given as a slope map, give the same levels. */
TEST(slopes_are_filtered_like_heights)
{
    enum { W = 37, H = 20 };
    float *z = noise(W * H, 5);
    struct slopes slopes = {malloc(2 * W * H * sizeof(float)), W};
    for (int i = 0; slopes.rows && i < W * H; i++) {
        const int p = i % W, q = i / W;
        slopes.rows[2 * q * W + p] = 0.5f * (z[q * W + (p + 1) % W] - z[q * W + (p + W - 1) % W]);
        slopes.rows[(2 * q + 1) * W + p] = 0.5f *
                                           (z[(q + 1) % H * W + p] - z[(q + H - 1) % H * W + p]);
    }
    const facet_map_source source = {FACET_SLOPES, W, H, slope_row, &slopes};
    facet_leadr_options o = plain;
    o.scale = 2;
    facet_leadr_summary s;
    CHECK_INT(facet_leadr_filter(&source, &o, NULL, NULL, NULL, &s), FACET_OK);
    facet_leadr *leadr = filter(z, W, H, &o);
    const facet_leadr_summary *t = facet_leadr_summary_of(leadr);
    CHECK(s.level_count == t->level_count && !s.has_stencil[0]);
    CHECK_REL(s.mean.e3, t->mean.e3, 1e-7, 0);
    CHECK_REL(s.mean.e4, t->mean.e4, 1e-7, 0);
    CHECK_REL(s.mean.e5, t->mean.e5, 1e-6, 1e-3);
    CHECK_REL(s.loss[2].variance, t->loss[2].variance, 1e-6, 0);
    slopes.rows[2 * 3 * W + 5] = NAN;
    slopes.rows[2 * 9 * W + 2] = INFINITY;
    CHECK_INT(facet_leadr_filter(&source, &o, NULL, NULL, NULL, &s), FACET_BAD_DATA);
    CHECK(s.flaw.count == 2 && s.flaw.column == 5 && s.flaw.row == 3);
    facet_leadr_destroy(leadr);
    free(slopes.rows);
    free(z);
}

/* ---- CLEAN ---------------------------------------------------------------------------------- */

TEST(clean_is_the_mean_or_the_larger_alpha)
{
    enum { N = 33 };
    float *z = noise(N * N, 9);
    for (int i = 0; i < N * N; i++) z[i] *= 1 + (float)(i / N) / N;
    facet_leadr_options o = plain;
    o.stencil = FACET_BILINEAR;
    o.form = FACET_CENTRED;
    facet_leadr *full = filter(z, N, N, &o);
    for (int model = FACET_CLEAN; model <= FACET_CLEAN_MAX; model++)
        for (int form = 0; form < 2; form++) {
            o.model = (facet_moment_model)model;
            o.form = (facet_moment_form)form;
            facet_leadr *clean = filter(z, N, N, &o);
            CHECK_INT(facet_leadr_summary_of(clean)->plane_count, 3);
            for (size_t l = 0; l < facet_leadr_level_count(clean); l++) {
                const facet_leadr_level *a = facet_leadr_level_at(full, l),
                                        *b = facet_leadr_level_at(clean, l);
                for (size_t i = 0; i < a->width * a->height; i++) {
                    const double x = a->plane[0][i], y = a->plane[1][i];
                    const double xx = a->plane[2][i], yy = a->plane[3][i], xy = a->plane[4][i];
                    const double half = (xx - yy) / 2;
                    double want = xx + yy;
                    if (model == FACET_CLEAN_MAX) want += 2 * sqrt(half * half + xy * xy);
                    if (form == FACET_RAW) want += x * x + y * y;
                    CHECK(b->plane[0][i] == a->plane[0][i] && !b->plane[3]);
                    CHECK_REL(b->plane[2][i], want, 2e-7, 0);
                    const float texel[3] = {b->plane[0][i], b->plane[1][i], b->plane[2][i]};
                    const facet_moments m = facet_moments_of_texel(texel, o.form, o.model);
                    const facet_covariance c = facet_covariance_from_moments(&m);
                    if (form == FACET_CENTRED) CHECK_REL(c.xx + c.yy, texel[2], 1e-6, 1e-3);
                    CHECK(fabs(c.xy) < 1e-12 && fabs(c.xx - c.yy) < 1e-12);
                }
            }
            facet_leadr_destroy(clean);
        }
    facet_leadr_destroy(full);
    free(z);
}

/* ---- GGX ----------------------------------------------------------------------------------- */

/* Squared difference of the standard GGX slope density and Beckmann's of alpha c, over the plane,
 * by the midpoint rule in u = r^2/(1 + r^2). */
static double distance(double c)
{
    enum { CELLS = 200000 };
    double sum = 0;
    for (int i = 0; i < CELLS; i++) {
        const double u = (i + 0.5) / CELLS, r2 = u / (1 - u);
        const double difference = 1 / ((1 + r2) * (1 + r2)) -
                                  exp(-r2 / (c * c)) / (c * c); /* times 1/pi each */
        sum += difference * difference / ((1 - u) * (1 - u));
    }
    return sum / CELLS;
}

TEST(the_beckmann_of_ggx_is_the_nearest)
{
    const double c = FACET_BECKMANN_OF_GGX, h = 1e-4;
    CHECK(distance(c) < distance(c - h) && distance(c) < distance(c + h));
    const double slope = (distance(c + h) - distance(c - h)) / (2 * h);
    const double bend = (distance(c + h) - 2 * distance(c) + distance(c - h)) / (h * h);
    CHECK(fabs(slope / bend) < 1e-7); /* how far the minimum is */
    check_note("off by", slope / bend);
}

/* ---- Sizes
 * --------------------------------------------------------------------------------------- */

TEST(lines_and_wide_maps)
{
    static const size_t sizes[][2] = {{1, 1},     {1, 1000},  {1000, 1},
                                      {65537, 1}, {65537, 2}, {2, 65537}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        const size_t n = sizes[s][0] * sizes[s][1];
        float *z = noise(n, 3);
        facet_leadr_options o = plain;
        o.stencil = FACET_BILINEAR;
        facet_leadr *leadr = filter(z, sizes[s][0], sizes[s][1], &o);
        const facet_leadr_level *last = facet_leadr_level_at(leadr,
                                                             facet_leadr_level_count(leadr) - 1);
        CHECK(last->width == 1 && last->height == 1);
        long double sum = 0;
        for (size_t i = 0; i < n; i++) {
            const size_t w = sizes[s][0], p = i % w, q = i / w, r = (q + 1) % sizes[s][1];
            const long double a = (long double)z[q * w + (p + 1) % w] - z[i],
                              b = (long double)z[r * w + (p + 1) % w] - z[r * w + p];
            sum += (a * a + a * b + b * b) / 3;
        }
        CHECK_REL(last->plane[2][0], (double)(sum / n), 6.1e-8, 1e-30);
        facet_leadr_destroy(leadr);
        free(z);
    }
}

/* ---- Ends ------------------------------------------------------------------------------------ */

struct countdown {
    size_t left, rows;
};

static bool take_some(void *user, size_t level, size_t row,
                      const float *const plane[FACET_PLANES_MAX])
{
    struct countdown *c = user;
    (void)level, (void)row, (void)plane;
    c->rows++;
    return c->left-- > 1;
}

static const float *height_row(void *user, size_t row)
{
    return (const float *)user + 16 * row;
}

TEST(a_sink_that_refuses_ends_the_work)
{
    float *z = noise(16 * 16, 1);
    const facet_map_source source = {FACET_HEIGHTS, 16, 16, height_row, z};
    for (size_t left = 1; left <= 31; left += 10) {
        struct countdown c = {left, 0};
        const facet_leadr_sink sink = {.row = take_some, .user = &c};
        facet_leadr_summary s;
        CHECK_INT(facet_leadr_filter(&source, &plain, NULL, NULL, &sink, &s), FACET_NO_MEMORY);
        CHECK_INT(c.rows, left);
    }
    /* 16 + 8 + 4 + 2 + 1 rows, each once. */
    struct countdown c = {32, 0};
    const facet_leadr_sink sink = {.row = take_some, .user = &c};
    facet_leadr_summary s;
    CHECK_INT(facet_leadr_filter(&source, &plain, NULL, NULL, &sink, &s), FACET_OK);
    CHECK_INT(c.rows, 31);
    free(z);
}

/* The last row is looked at first around a periodic border, and counted once. */
TEST(flaws_in_the_last_row)
{
    float *z = noise(16 * 16, 1);
    const facet_map_source source = {FACET_HEIGHTS, 16, 16, height_row, z};
    z[15 * 16 + 4] = NAN;
    z[15 * 16 + 9] = -INFINITY;
    for (int b = 0; b < FACET_BORDER_COUNT; b++) {
        facet_leadr_options o = plain;
        facet_leadr_summary s;
        o.border = (facet_border)b;
        CHECK_INT(facet_leadr_filter(&source, &o, NULL, NULL, NULL, &s), FACET_BAD_DATA);
        CHECK(s.flaw.count == 2 && s.flaw.column == 4 && s.flaw.row == 15);
    }
    free(z);
}
