/*
 * slope_harmonics.c - psi of a distribution that is not radial, along many azimuths at once: on a
 * ring of slopes r it is the convolution of P with max(r cos - v, 0), whose harmonics are closed.
 */
#include "gauss.h"
#include "slope_sheet.h"
#include "slope_turned.h"

#include <math.h>
#include <stdlib.h>

/* Rings of a cell: for v below it, and for v in it, where they are analytic in the root of
 * the distance. */
enum { PLAIN = 4, NEAR = 8, RINGS = PLAIN + NEAR };

struct harmonics {
    const struct kernel_table *table;
    size_t cells, count, rows; /* count: of harmonics, from 0; rows: samples in half a turn, even */
    double shift;              /* of the samples, in rows, and of v, in cells */
    size_t stride;             /* of the cells that v is in */
    double *r;                 /* [cell][RINGS] */
    double *even, *odd; /* [cell][RINGS][count]: of P r^2 dr, by cosine and sine of 2 k azimuth */
    double *cosine, *sine; /* of 2 pi j/rows */
    double *value;         /* room for the samples of a ring */
};

static void add_ring(const struct harmonics *h, size_t ring, double u, double du)
{
    double b = h->table->slope_scale, rest = 1 - u, r = b * u / rest;
    /* P = exp(log_q) rest^4, dr = b du/rest^2 */
    double weight = rest * rest * b * du * r * r * 2 / (double)h->rows;
    double *even = h->even + ring * h->count, *odd = h->odd + ring * h->count;
    h->r[ring] = r;
    for (size_t j = 0; j < h->rows; j++) {
        double azimuth = ((double)j + h->shift) / (double)h->rows;
        h->value[j] = weight * exp(slope_sheet_at(h->table->turned_q, u, azimuth));
    }
    /* j and rows - j share a cosine and, but for its sign, a sine */
    size_t half = h->rows / 2;
    for (size_t j = 1; j < half; j++) {
        double before = h->value[j], after = h->value[h->rows - j];
        h->value[j] = before + after;
        h->value[h->rows - j] = before - after;
    }
    for (size_t k = 0; k < h->count; k++) {
        double c = h->value[0] + (k % 2 ? -1 : 1) * h->value[half], s = 0;
        for (size_t j = 1, at = k; j < half; j++) {
            c += h->value[j] * h->cosine[at];
            s += h->value[h->rows - j] * h->sine[at];
            at += k;
            if (at >= h->rows) at -= h->rows;
        }
        even[k] = k ? c : c / 2;
        odd[k] = s;
    }
}

static void add_rings(const struct harmonics *h)
{
    double node[PLAIN], weight[PLAIN], root[NEAR], near[NEAR], step = 1 / (double)h->cells;
    facet_gauss_legendre(PLAIN, node, weight);
    facet_gauss_legendre(NEAR, root, near);
    for (size_t i = 0; i < h->cells; i++) {
        for (size_t k = 0; k < PLAIN; k++)
            add_ring(h, i * RINGS + k, ((double)i + node[k]) * step, weight[k] * step);
        for (size_t k = 0; k < NEAR && i % h->stride == 0; k++)
            add_ring(h, i * RINGS + PLAIN + k,
                     ((double)i + h->shift + (1 - h->shift) * root[k] * root[k]) * step,
                     near[k] * 2 * root[k] * (1 - h->shift) * step);
    }
}

/*
 * The harmonics 2 k of max(cos - t, 0) are, with t = cos a, 2 (sin a - a cos a) for k = 0 and
 * sin((2k-1)a)/(2k-1) + sin((2k+1)a)/(2k+1) - 2 t sin(2k a)/(2k).
 */
static void add_seen(const struct harmonics *h, size_t ring, double v, double *even, double *odd)
{
    double t = fmin(v / h->r[ring], 1), a = acos(t), twice = 2 * cos(2 * a);
    double below = -sin(a), low = sin(a), last = 0, middle = sin(2 * a), kernel = 2 * (low - a * t);
    const double *e = h->even + ring * h->count, *o = h->odd + ring * h->count;
    for (size_t k = 0;;) {
        even[k] += kernel * e[k];
        odd[k] += kernel * o[k];
        if (++k == h->count) return;
        double m = 2 * (double)k,
               high = twice * low - below; /* sin((m - 1) a) is low, sin((m + 1) a) high */
        kernel = low / (m - 1) + high / (m + 1) - 2 * t * middle / m;
        double next = twice * middle - last;
        below = low, low = high, last = middle, middle = next;
    }
}

static void sum_rows(const struct harmonics *h, size_t i, const double *even, const double *odd,
                     double *psi)
{
    for (size_t j = 0; j < h->rows; j++) {
        double sum = 0;
        for (size_t k = 0, at = 0; k < h->count; k++) {
            sum += even[k] * h->cosine[at] + odd[k] * h->sine[at];
            at += j;
            if (at >= h->rows) at -= h->rows;
        }
        psi[j * (h->cells + 1) + i] = fmax(sum, 0); /* what rounding leaves of nothing */
    }
}

static void fill(const struct harmonics *h, double *even, double *odd, double *psi)
{
    for (size_t j = 0; j < h->rows; j++) {
        h->cosine[j] = cos(2 * FACET_PI * (double)j / (double)h->rows);
        h->sine[j] = sin(2 * FACET_PI * (double)j / (double)h->rows);
        psi[j * (h->cells + 1) + h->cells] = 0;
    }
    add_rings(h);
    for (size_t i = 0; i < h->cells; i += h->stride) {
        double u = ((double)i + h->shift) / (double)h->cells,
               v = h->table->slope_scale * u / (1 - u);
        for (size_t k = 0; k < h->count; k++) even[k] = odd[k] = 0;
        for (size_t k = 0; k < NEAR; k++) add_seen(h, i * RINGS + PLAIN + k, v, even, odd);
        for (size_t cell = i + 1; cell < h->cells; cell++)
            for (size_t k = 0; k < PLAIN; k++) add_seen(h, cell * RINGS + k, v, even, odd);
        sum_rows(h, i, even, odd, psi);
    }
}

facet_status facet_slope_psi_rows(const struct kernel_table *table, size_t cells, size_t rows,
                                  double shift, size_t stride, double *psi)
{
    struct harmonics h = {
        .table = table, .cells = cells, .rows = rows, .shift = shift, .stride = stride};
    /* Half of what samples tell, the others being their aliases'; a check takes all. */
    h.count = (rows - 1) / (shift > 0 ? 2 : 4) + 1;
    size_t rings = cells * RINGS;
    double *room = malloc((rings * (1 + 2 * h.count) + 3 * h.rows + 2 * h.count) * sizeof *room);
    if (!room) return FACET_NO_MEMORY;
    h.r = room;
    h.even = h.r + rings;
    h.odd = h.even + rings * h.count;
    h.cosine = h.odd + rings * h.count;
    h.sine = h.cosine + h.rows;
    h.value = h.sine + h.rows;
    fill(&h, h.value + h.rows, h.value + h.rows + h.count, psi);
    free(room);
    return FACET_OK;
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
