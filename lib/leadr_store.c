#include "leadr_store.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

size_t facet_plane_count(facet_moment_model model)
{
    return model == FACET_LEADR ? 5 : 3;
}

/*
 * A piece of a row, near enough to be at hand from one step to the next: what is to be
 * stored, in double, plane after plane, then the variance.
 */
enum { PIECE = 256 };
typedef double exact_piece[(FACET_PLANES_MAX + 1) * PIECE];

/* ---- Rounding ------------------------------------------------------------------------------ */

#define HALF_MAX 65504.0
#define HALF_MIN 0x1p-14 /* below it steps are even, 2^-24 */

/* Nearest value of binary16, ties to even, in one rounding. */
static double to_half(double x)
{
    /* 53 - 42 = 11 bits are kept; a carry runs into the exponent, as it should. */
    const uint64_t below = ((uint64_t)1 << 42) - 1;
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits = (bits + (below >> 1) + (bits >> 42 & 1)) & ~below;
    double normal;
    memcpy(&normal, &bits, sizeof normal);
    const double magic = 0x1.8p28; /* its last bit is 2^-24 */
    const double subnormal = (x + magic) - magic;
    const double y = fabs(x) < HALF_MIN ? subnormal : normal;
    return fabs(y) <= HALF_MAX ? y : copysign(INFINITY, y);
}

static void round_row(const double *exact, size_t n, facet_storage storage, float *restrict out)
{
    if (storage == FACET_HALF)
        for (size_t i = 0; i < n; i++) out[i] = (float)to_half(exact[i]);
    else
        for (size_t i = 0; i < n; i++) out[i] = (float)exact[i];
}

/* ---- What is stored, in double -------------------------------------------------------------- */

/* Five planes, and the variance after them. */
static void leadr_row(const struct leadr_store *s, size_t n, const double *const at[CENTRAL_COUNT],
                      exact_piece exact)
{
    const double ux = s->unit_x, uy = s->unit_y;
    const double uxx = ux * ux, uyy = uy * uy, uxy = ux * uy;
    const facet_covariance base = s->options->base;
    const double raw = s->options->form == FACET_RAW ? 1 : 0;
    const double *x = at[0], *y = at[1], *xx = at[2], *yy = at[3], *xy = at[4];
    double *restrict e1 = exact, *restrict e2 = e1 + n, *restrict e3 = e2 + n,
                     *restrict e4 = e3 + n, *restrict e5 = e4 + n, *restrict v = e5 + n;
    for (size_t i = 0; i < n; i++) {
        const double a = ux * x[i], b = uy * y[i];
        const double v11 = uxx * xx[i] + base.xx, v22 = uyy * yy[i] + base.yy;
        e1[i] = a;
        e2[i] = b;
        e3[i] = v11 + raw * (a * a);
        e4[i] = v22 + raw * (b * b);
        e5[i] = uxy * xy[i] + base.xy + raw * (a * b);
        v[i] = v11 + v22;
    }
}

/* Three planes, and the variance where the others have it. */
static void clean_row(const struct leadr_store *s, size_t n, const double *const at[CENTRAL_COUNT],
                      exact_piece e)
{
    const double ux = s->unit_x, uy = s->unit_y;
    const facet_covariance base = s->options->base;
    const bool raw = s->options->form == FACET_RAW, max = s->options->model == FACET_CLEAN_MAX;
    for (size_t i = 0; i < n; i++) {
        const double a = ux * at[0][i], b = uy * at[1][i];
        const facet_covariance c = {ux * ux * at[2][i] + base.xx, uy * uy * at[3][i] + base.yy,
                                    ux * uy * at[4][i] + base.xy};
        const double alpha2 = max ? 2 * facet_covariance_largest(&c) : c.xx + c.yy;
        e[i] = a;
        e[n + i] = b;
        e[2 * n + i] = raw ? alpha2 + (a * a + b * b) : alpha2;
        e[5 * n + i] = alpha2;
    }
}

/* ---- What was stored against it -------------------------------------------------------------- */

/* The variance the rounded planes say, `stride` apart. */
static void stored_variance(const struct leadr_store *s, size_t n, const float *r, size_t stride,
                            double *restrict out)
{
    const bool raw = s->options->form == FACET_RAW, clean = s->plane_count == 3;
    for (size_t i = 0; i < n; i++) {
        const double a = r[i], b = r[stride + i], squares = a * a + b * b;
        const double sum = (double)r[2 * stride + i] + (clean ? 0 : (double)r[3 * stride + i]);
        out[i] = raw ? sum - squares : sum;
    }
}

/*
 * A variance below this share of the squared mean is rounding of the sums in double
 * (relative 1e-16, squared), not surface.
 */
#define NOISE 1e-28

static void add_loss(size_t n, const double *exact, const double *stored, const float *e1,
                     const float *e2, facet_leadr_loss *loss)
{
    double variance = loss->variance, kept = loss->stored, worst = loss->worst;
    size_t lost = 0;
    for (size_t i = 0; i < n; i++) {
        const double a = e1[i], b = e2[i];
        const bool counts = exact[i] > NOISE * (a * a + b * b);
        const double error = counts ? fabs(stored[i] - exact[i]) / exact[i] : 0;
        worst = error > worst ? error : worst;
        lost += counts && !(stored[i] > 0);
        variance += exact[i];
        kept += stored[i];
    }
    *loss = (facet_leadr_loss){variance, kept, worst, loss->lost + lost};
}

void facet_leadr_loss_add(facet_leadr_loss *to, const facet_leadr_loss *loss)
{
    to->variance += loss->variance;
    to->stored += loss->stored;
    to->lost += loss->lost;
    to->worst = loss->worst > to->worst ? loss->worst : to->worst;
}

/* x * 0 is 0 for every finite x. */
static bool all_finite(const float *values, size_t n)
{
    float sum = 0;
    for (size_t i = 0; i < n; i++) sum += values[i] * 0;
    return sum == 0;
}

struct leadr_stored facet_leadr_store_row(const struct leadr_store *s, size_t width,
                                          double *const at[CENTRAL_COUNT], float *planes)
{
    struct leadr_stored row = {{0, 0, 0, 0}, false};
    exact_piece exact;
    for (size_t start = 0, n; start < width; start += n) {
        n = width - start < PIECE ? width - start : PIECE;
        const double *const from[] = {at[0] + start, at[1] + start, at[2] + start, at[3] + start,
                                      at[4] + start};
        float *to = planes + start;
        if (s->plane_count == 3)
            clean_row(s, n, from, exact);
        else
            leadr_row(s, n, from, exact);
        for (size_t k = 0; k < s->plane_count; k++) {
            round_row(exact + k * n, n, s->options->storage, to + k * width);
            if (!all_finite(to + k * width, n)) row.overflow = true;
        }
        /* Over the planes in double, which are not needed any more. */
        stored_variance(s, n, to, width, exact);
        add_loss(n, exact + 5 * n, exact, to, to + width, &row.loss);
    }
    return row;
}

facet_moments facet_moments_of_texel(const float *v, facet_moment_form form,
                                     facet_moment_model model)
{
    const double a = v[0], b = v[1];
    facet_moments m = {a, b, v[2], 0, 0};
    if (model != FACET_LEADR) {
        const double alpha2 = form == FACET_RAW ? fma(-a, a, fma(-b, b, m.e3)) : m.e3;
        return (facet_moments){a, b, alpha2 / 2 + a * a, alpha2 / 2 + b * b, a * b};
    }
    m.e4 = v[3];
    m.e5 = v[4];
    if (form == FACET_RAW) return m;
    return (facet_moments){a, b, fma(a, a, m.e3), fma(b, b, m.e4), fma(a, b, m.e5)};
}
