/*
 * slope_psi.c - psi of a distribution that is not radial to a relative error, however little it
 * is.  By rays, nothing of which cancels:
 *
 *   psi(v, phi) = integral of cos t F(phi + t, v/cos t) dt, |t| < pi/2,
 *   F(a, rho) = integral of (r - rho) P(r, a) r dr from rho on = b^3 (1 - u) E(a, u),
 *   E = G/(1 - u)^2,  G(a, u) = integral of x (x - u) exp(log_q(x, a)) dx from u to 1, u = rho/(b + rho).
 */
#include "gauss.h"
#include "slope_rays.h"
#include "slope_sheet.h"
#include "slope_spline.h"
#include "slope_turned.h"
#include "watch.h"

#include <math.h>
#include <stdlib.h>

/* E is tabulated at so many places along a ray at least. */
#define KNOTS 256
/* Next to t = pi/2, F falls within v over its width: the rule over t is right to rounding where that
 * is so many steps.  Where it is fewer that ray's own part is integrated apart, at so many places. */
#define LAYER 16.0
enum { ENDS = 96 };
/* What is left of the rays adds no more than this share. */
#define NEGLIGIBLE 1e-12

/* E along rays of azimuth pi (j + shift)/rows, as KERNEL_PSI_UNIT/(top - log E): cubics of n cells
 * in u. */
struct rays {
    const struct kernel_table *table;
    const facet_watch *watch;
    size_t n, rows;
    double shift, top;
    double mean;              /* the largest of the slopes along a ray */
    double *cubics;           /* [row][n][4] */
    double *seen, *sum, *own; /* [row]; own: what the rule makes of a ray's part at every t */
    double end[ENDS], weight[ENDS];
};

/* log E and its derivative at u = i/n, i < n; and at u = 1, where G is its own first terms. */
static void logarithms_along(struct rays *t, size_t j, double *y, double *slope)
{
    struct kernel_sheet q = t->table->turned_q;
    struct slope_tail m = {0, 0};
    double azimuth = ((double)j + t->shift) / (double)t->rows, h = 1 / (double)t->n;
    y[t->n] = slope_sheet_at(q, 1, azimuth) - log(2);
    slope[t->n] = (1 + (slope_sheet_at(q, 1, azimuth) - slope_sheet_at(q, 1 - h / 64, azimuth)) *
                           64 / h) /
                  3;
    for (size_t i = t->n; i-- > 0;) {
        double rest = 1 - (double)i * h;
        m = facet_slope_tail_add(t->table, azimuth, (double)i * h, ((double)i + 1) * h, m);
        y[i] = log(m.g / (rest * rest));
        slope[i] = 2 / rest - m.n / m.g;
    }
    t->mean = fmax(t->mean, t->table->slope_scale * m.g / (m.n - m.g));
    for (size_t i = 0; i <= t->n; i++) {
        if (y[i] > KERNEL_LOG_ZERO && isfinite(slope[i])) continue;
        y[i] = fmax(y[i], KERNEL_LOG_ZERO);
        slope[i] = 0;
    }
}

static facet_status add_rays(struct rays *t)
{
    size_t knots = t->n + 1;
    double *y = malloc(2 * t->rows * knots * sizeof *y), *slope = y + t->rows * knots;
    if (!y) return FACET_NO_MEMORY;
    t->top = -INFINITY;
    t->mean = 0;
    for (size_t j = 0; j < t->rows; j++) {
        if (facet_is_cancelled(t->watch)) {
            free(y);
            return FACET_CANCELLED;
        }
        logarithms_along(t, j, y + j * knots, slope + j * knots);
    }
    for (size_t k = 0; k < t->rows * knots; k++) t->top = fmax(t->top, y[k] + 2);
    for (size_t k = 0; k < t->rows * knots; k++) {
        y[k] = KERNEL_PSI_UNIT / (t->top - y[k]);
        slope[k] *= y[k] * y[k] / KERNEL_PSI_UNIT / (double)t->n;
    }
    for (size_t j = 0; j < t->rows; j++)
        for (size_t i = 0, k = j * knots; i < t->n; i++, k++)
            slope_hermite(y[k], y[k + 1], slope[k], slope[k + 1], t->cubics + 4 * (j * t->n + i));
    free(y);
    return FACET_OK;
}

/* exp(-top) E at u along every ray; returns the largest. */
static double look_along(const struct rays *t, double u)
{
    double x = u * (double)t->n, most = 0;
    size_t i = x < (double)t->n ? (size_t)x : t->n - 1;
    x -= (double)i;
    for (size_t j = 0; j < t->rows; j++) {
        const double *c = t->cubics + 4 * (j * t->n + i);
        double f = c[0] + x * (c[1] + x * (c[2] + x * c[3]));
        t->seen[j] = exp(-KERNEL_PSI_UNIT / fmax(f, KERNEL_PSI_LEAST));
        most = fmax(most, t->seen[j]);
    }
    return most;
}

/* Of a ray at an angle t whose cosine this is. */
static double weight_of(const struct rays *t, double cosine, double v)
{
    double b = t->table->slope_scale;
    return cosine * (b * cosine / (b * cosine + v));
}

/* sum and own at one v, by steps of one row. */
static void sum_rays(const struct rays *t, double v)
{
    size_t rows = t->rows;
    double b = t->table->slope_scale, step = FACET_PI / (double)rows;
    for (size_t j = 0; j < rows; j++) t->sum[j] = t->own[j] = 0;
    for (size_t m = 0; 2 * m < rows; m++) {
        double cosine = cos(step * (double)m), weight = step * weight_of(t, cosine, v),
               least = INFINITY;
        double most = weight * look_along(t, v / (b * cosine + v));
        for (size_t j = 0; j < rows; j++) {
            double both = m ? t->seen[(j + m) % rows] + t->seen[(j + rows - m) % rows] : t->seen[j];
            t->sum[j] += weight * both;
            t->own[j] += weight * (m ? 2 : 1) * t->seen[j];
            least = fmin(least, t->sum[j]);
        }
        if (most * (double)rows < NEGLIGIBLE * least) break; /* F falls, and so does its weight */
    }
}

/* The part of the ray at t = pi/2, as if it were at every t, as it is in place of what the rule makes
 * of it: what is left is even about it, and smooth to the third order. */
static void mend_ends(const struct rays *t, double v)
{
    size_t rows = t->rows;
    double b = t->table->slope_scale;
    for (size_t k = 0; k < ENDS; k++) {
        double cosine = sin(FACET_PI / 2 * t->end[k] * t->end[k] * t->end[k]),
               weight = 3 * FACET_PI * t->end[k] * t->end[k] * t->weight[k] *
                        weight_of(t, cosine, v);
        look_along(t, v / (b * cosine + v));
        for (size_t j = 0; j < rows; j++) t->own[j] -= weight * t->seen[j];
    }
    for (size_t j = 0; j < rows; j++) t->sum[j] -= t->own[(j + rows / 2) % rows];
}

static facet_status fill(const struct rays *t, size_t cells, size_t stride, double *psi)
{
    double b = t->table->slope_scale, least = LAYER * FACET_PI / (double)t->rows * t->mean,
           unit = b * b * b * exp(t->top);
    for (size_t i = 0; i < cells; i += stride) {
        double u = ((double)i + t->shift) / (double)cells, v = b * u / (1 - u);
        if (facet_is_cancelled(t->watch)) return FACET_CANCELLED;
        sum_rays(t, v);
        if (v < least) mend_ends(t, v);
        for (size_t j = 0; j < t->rows; j++) psi[j * (cells + 1) + i] = unit * fmax(t->sum[j], 0);
    }
    return FACET_OK;
}

facet_status facet_slope_psi_rows(const struct kernel_table *table, size_t cells, size_t rows,
                                  bool is_check, size_t stride, const facet_watch *watch,
                                  double *psi)
{
    struct rays t = {.table = table, .watch = watch, .rows = rows, .shift = is_check ? 0.5 : 0};
    size_t parts = (KNOTS + table->turned_q.cells - 1) / table->turned_q.cells;
    t.n = parts * table->turned_q.cells;
    facet_gauss_legendre(ENDS, t.end, t.weight);
    double *room = malloc((4 * t.n + 3) * rows * sizeof *room);
    if (!room) return FACET_NO_MEMORY;
    t.cubics = room;
    t.seen = t.cubics + 4 * t.n * rows;
    t.sum = t.seen + rows;
    t.own = t.sum + rows;
    facet_status status = add_rays(&t);
    if (!status) status = fill(&t, cells, stride, psi);
    free(room);
    return status;
}

/* P = scale^4 exp(log_q(1)) / r^4 there. */
double facet_slope_psi_limit(const struct kernel_table *table, double azimuth)
{
    enum { POINTS = 256 };
    double b = table->slope_scale, sum = 0;
    for (int k = 0; k < POINTS; k++) {
        double t = (k + 0.5) / POINTS - 0.5, at = azimuth + t, c = cos(FACET_PI * t);
        sum += exp(slope_sheet_at(table->turned_q, 1, at - floor(at))) * c * c;
    }
    return b * b * b * b / 2 * sum * FACET_PI / POINTS;
}
