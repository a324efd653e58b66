#include "slope_table.h"

#include "slope_quantile.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

#define SCALE_MIN 1e-8
#define SCALE_MAX 1e4
#define LOG_D_ZERO (-700.0) /* and below counts as D = 0 (facet_table.h) */
/* sigma is tabulated on so many cells, more until its errors are below the targets or they are too
 * many. */
#define PSI_CELLS_MIN 128
#define PSI_CELLS_MAX 2048
#define SIGMA_ERROR 2e-10
#define PSI_ERROR 2.5e-7

/* ---- log_q: spline ----------------------------------------------------------------- */

/* The cubic on [0, 1] with values y0, y1 and derivatives m0, m1 at its ends. */
static void hermite(double y0, double y1, double m0, double m1, double c[4])
{
    c[0] = y0;
    c[1] = m0;
    c[2] = 3 * (y1 - y0) - 2 * m0 - m1;
    c[3] = m0 + m1 - 2 * (y1 - y0);
}

/* From one value to the other with level ends: no overshoot. */
static void ramp(double y0, double y1, double c[4])
{
    hermite(y0, y1, 0, 0, c);
}

/*
 * Derivatives m of the cubic spline through y[0 .. n-1], unit spacing, with the
 * derivative *start at its start; where start is NULL and at its end it is
 * not-a-knot (de Boor 1978, ch. IV).  work holds n.
 */
static void spline_slopes(const double *y, size_t n, const double *start, double *m, double *work)
{
    if (n < 3 || (n == 3 && !start)) {
        for (size_t i = 0; i < n; i++) { /* the polynomial through all of them */
            double back = i > 0 ? y[i] - y[i - 1] : 0, ahead = i + 1 < n ? y[i + 1] - y[i] : 0;
            double bend = n == 3 ? y[2] - 2 * y[1] + y[0] : 0;
            m[i] = i == 0 ? ahead - bend / 2 : back + bend / 2;
        }
        if (start) m[0] = *start;
        return;
    }
    /* m[i-1] + 4 m[i] + m[i+1] = 3 (y[i+1] - y[i-1]), forward elimination into work and m */
    work[0] = start ? 0 : 2;
    m[0] = start ? *start : (y[2] + 4 * y[1] - 5 * y[0]) / 2;
    for (size_t i = 1; i + 1 < n; i++) {
        double pivot = 4 - work[i - 1];
        work[i] = 1 / pivot;
        m[i] = (3 * (y[i + 1] - y[i - 1]) - m[i - 1]) / pivot;
    }
    size_t e = n - 1;
    m[e] = ((5 * y[e] - 4 * y[e - 1] - y[e - 2]) / 2 - 2 * m[e - 1]) / (1 - 2 * work[e - 1]);
    for (size_t i = e; i-- > 0;) m[i] -= work[i] * m[i + 1];
}

/*
 * Where log_q moves by more than 1 from node to node, a spline may swing by e
 * and more: keep its slopes within the range in which a cubic stays between its
 * ends (Fritsch & Carlson 1980).  Smooth tables are not touched.
 */
static void limit_slopes(const double *y, size_t n, double *m)
{
    for (size_t i = 0; i < n; i++) {
        double back = i > 0 ? y[i] - y[i - 1] : y[1] - y[0];
        double ahead = i + 1 < n ? y[i + 1] - y[i] : back;
        if (fmax(fabs(m[i]), fmax(fabs(back), fabs(ahead))) <= 1) continue;
        double limit = 3 * fmin(fabs(back), fabs(ahead));
        if (back * ahead > 0 && m[i] * back < 0) limit = 0;
        m[i] = fmax(-limit, fmin(limit, m[i]));
    }
}

static bool is_zero(double y)
{
    return y == KERNEL_LOG_ZERO;
}

/*
 * A smooth surface has dD/dr = 0 at r = 0, where log_q = log D - 4 log(1 - u) + O(u^2):
 * its derivative by u there.
 */
#define START_SLOPE 4.0

/* A step this high, and so many times that of a cell beside it, is an edge and not a slope. */
#define CLIFF_STEP 20.0
#define CLIFF_RATIO 16.0

/* Does the cell from node i to i + 1 break the spline?  At nodes with D = 0 and at cliffs. */
static bool breaks(const double *y, size_t n, size_t i)
{
    if (is_zero(y[i]) || is_zero(y[i + 1])) return true;
    double step = fabs(y[i + 1] - y[i]), beside = INFINITY;
    if (i > 0 && !is_zero(y[i - 1])) beside = fmin(beside, fabs(y[i] - y[i - 1]));
    if (i + 2 < n && !is_zero(y[i + 2])) beside = fmin(beside, fabs(y[i + 2] - y[i + 1]));
    return step > CLIFF_STEP && beside < INFINITY && step > CLIFF_RATIO * beside;
}

/* Splines between the breaks, ramps across them: a spline across would ring far into both sides. */
static void tabulate_log_q(const double *y, size_t n, double *c, double *m, double *work)
{
    double first = START_SLOPE / (double)(n - 1);
    for (size_t start = 0, end; start < n; start = end + 1) {
        for (end = start; end + 1 < n && !breaks(y, n, end); end++) continue;
        if (end > start) {
            size_t nodes = end - start + 1;
            spline_slopes(y + start, nodes, start == 0 ? &first : NULL, m, work);
            limit_slopes(y + start, nodes, m);
            for (size_t i = 0; i + 1 < nodes; i++)
                hermite(y[start + i], y[start + i + 1], m[i], m[i + 1], c + 4 * (start + i));
        }
        if (end + 1 < n) ramp(y[end], y[end + 1], c + 4 * end);
    }
}

/* ---- sigma ---------------------------------------------------------------------------- */

/* log_psi and its derivative by w at one node (kernels.h). */
struct psi_node {
    double y, slope;
};

/* w in (0, 1] */
static struct psi_node psi_at(const struct slope_pieces *pieces, double w)
{
    double b = pieces->scale, derivative;
    double psi = facet_slope_pieces_psi(pieces, b * (1 - w) / w, &derivative);
    double y = log(psi / (b * w));
    if (!(y > KERNEL_LOG_ZERO)) return (struct psi_node){KERNEL_LOG_ZERO, 0};
    return (struct psi_node){y, -derivative / psi * b / (w * w) - 1 / w};
}

/* v to infinity: P = D(pi/2)/r^4 there, D(pi/2) = exp(log_q(1)) b^4, hence psi = D(pi/2) pi/(4 v).
 */
static double psi_limit(const struct slope_pieces *pieces)
{
    const double *c = pieces->log_q.c + 4 * (pieces->log_q.cells - 1);
    double y = c[0] + c[1] + c[2] + c[3] + log(PI / 4 * pieces->scale * pieces->scale);
    return fmax(y, KERNEL_LOG_ZERO);
}

/* Values at w = (2 i + 1)/(2 cells), halfway between the nodes of cells cells. */
static void psi_between(const struct slope_pieces *pieces, size_t cells, struct psi_node *node)
{
    for (size_t i = 0; i < cells; i++)
        node[i] = psi_at(pieces, (2 * (double)i + 1) / (2 * (double)cells));
}

/* middle: log_psi halfway through the first cell, in place of the slope at w = 0, which is unknown.
 */
static void tabulate_psi(const struct psi_node *node, size_t cells, double middle, double *c)
{
    double h = 1 / (double)cells;
    for (size_t i = 0; i < cells; i++) {
        struct psi_node a = node[i], b = node[i + 1];
        if (is_zero(a.y) || is_zero(b.y)) {
            ramp(a.y, b.y, c + 4 * i);
        } else {
            double m1 = b.slope * h, m0 = a.slope * h;
            if (i == 0) m0 = m1 + 8 * (middle - (a.y + b.y) / 2);
            hermite(a.y, b.y, m0, m1, c + 4 * i);
        }
    }
}

/* Error of sigma halfway between the nodes, in front of and behind the horizon. */
static void measure_psi(facet_slope_table *table, const struct psi_node *between)
{
    struct kernel_cubic log_psi = table->view.log_psi;
    table->sigma_error = table->psi_error = 0;
    for (size_t i = 0; i < log_psi.cells; i++) {
        const double *c = log_psi.c + 4 * i;
        double w = ((double)i + 0.5) / (double)log_psi.cells;
        double exact = w * exp(between[i].y); /* S = 1, |c| = (1-w)/w */
        double error = fabs(w * exp(c[0] + c[1] / 2 + c[2] / 4 + c[3] / 8) - exact);
        table->sigma_error = fmax(table->sigma_error, error / ((1 - w) / w + exact));
        table->psi_error = fmax(table->psi_error, error / fmax(exact, FACET_FLOOR));
    }
}

/* Doubles the cells until sigma is right to SIGMA_ERROR.  node and between hold PSI_CELLS_MAX + 1.
 */
static void tabulate_sigma(facet_slope_table *table, const struct slope_pieces *pieces, double *c,
                           struct psi_node *node, struct psi_node *between)
{
    size_t cells = PSI_CELLS_MIN;
    node[0] = (struct psi_node){psi_limit(pieces), 0};
    for (size_t i = 1; i <= cells; i++) node[i] = psi_at(pieces, (double)i / (double)cells);
    for (;; cells *= 2) {
        psi_between(pieces, cells, between);
        tabulate_psi(node, cells, between[0].y, c);
        table->view.log_psi = (struct kernel_cubic){c, cells};
        measure_psi(table, between);
        bool good = table->sigma_error <= SIGMA_ERROR && table->psi_error <= PSI_ERROR;
        if (good || 2 * cells > PSI_CELLS_MAX) return;
        for (size_t i = cells + 1; i-- > 0;) {
            node[2 * i] = node[i];
            if (i < cells) node[2 * i + 1] = between[i];
        }
    }
}

/* ---- The table -------------------------------------------------------------------------- */

static bool nodes_are_valid(double scale, const double *log_d, size_t n)
{
    if (!(scale >= SCALE_MIN && scale <= SCALE_MAX)) return false;
    double peak = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        if (isnan(log_d[i]) || log_d[i] == INFINITY) return false;
        peak = fmax(peak, log_d[i]);
    }
    return peak > LOG_D_ZERO;
}

/* log(D/Q) at u = r/(b + r), Q = P (1 + r/b)^4 = P/(1 - u)^4: 2 log((1 + r^2)(1 - u)^2). */
static double log_d_over_q(double scale, double u)
{
    return 2 * log((1 - u) * (1 - u) + scale * u * (scale * u));
}

/* log_q at the nodes relative to the peak, so that no exp overflows before the table is normalised.
 */
static void start_nodes(double scale, const double *log_d, size_t n, double *y)
{
    double peak = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        y[i] = log_d[i] - log_d_over_q(scale, (double)i / (double)(n - 1));
        peak = fmax(peak, y[i]);
    }
    for (size_t i = 0; i < n; i++) {
        y[i] -= peak;
        if (log_d[i] <= LOG_D_ZERO || y[i] <= LOG_D_ZERO) y[i] = KERNEL_LOG_ZERO;
    }
}

static void measure_log_q(facet_slope_table *table)
{
    enum { STEPS = 4 };
    double floor_ = log(FACET_FLOOR), cells = (double)table->view.log_q.cells;
    for (size_t i = 0; i < table->view.log_q.cells; i++) {
        const double *c = table->view.log_q.c + 4 * i;
        for (int k = 0; k <= STEPS; k++) {
            double t = (double)k / STEPS, y = c[0] + t * (c[1] + t * (c[2] + t * c[3]));
            if (y < floor_) continue;
            double slope = (c[1] + t * (2 * c[2] + t * 3 * c[3])) * cells;
            table->log_q_max = fmax(table->log_q_max, fabs(y));
            table->log_q_slope = fmax(table->log_q_slope, fabs(slope));
        }
    }
}

static facet_status fill(facet_slope_table *table, const double *log_d, size_t n, double *work)
{
    size_t cells = n - 1;
    double *c = table->coefficients, *y = work, *m = work + n, *rest = work + 2 * n;
    struct psi_node *node = (struct psi_node *)(work + 3 * n), *between = node + PSI_CELLS_MAX + 1;
    struct slope_pieces *pieces = &table->pieces;
    table->view.log_q = (struct kernel_cubic){c, cells};
    start_nodes(table->view.slope_scale, log_d, n, y);
    for (int pass = 0; pass < 2; pass++) { /* pass 0 finds the norm */
        tabulate_log_q(y, n, c, m, rest);
        facet_status status =
            facet_slope_pieces_create(table->view.slope_scale, table->view.log_q, pieces);
        if (status != FACET_OK) return status;
        if (pass == 1) break;
        double norm = pieces->piece[0].mass;
        facet_slope_pieces_clear(pieces);
        if (!(norm > 0) || !isfinite(norm)) return FACET_BAD_TABLE;
        for (size_t i = 0; i < n; i++)
            if (!is_zero(y[i])) y[i] = fmax(y[i] - log(norm), KERNEL_LOG_ZERO);
    }
    measure_log_q(table);
    table->quantile_gain = facet_slope_quantile_gain(pieces);
    tabulate_sigma(table, pieces, c + 4 * cells, node, between);
    return FACET_OK;
}

facet_status facet_slope_table_create(double scale, const double *log_d, size_t n,
                                      facet_slope_table **table)
{
    *table = NULL;
    if (n < FACET_TABLE_NODES_MIN || n > FACET_TABLE_NODES_MAX) return FACET_BAD_SIZE;
    if (!nodes_are_valid(scale, log_d, n)) return FACET_BAD_TABLE;
    facet_slope_table *made =
        calloc(1, sizeof *made + 4 * (n - 1 + PSI_CELLS_MAX) * sizeof(double));
    double *work = malloc((3 * n + 4 * (PSI_CELLS_MAX + 1)) * sizeof *work);
    facet_status status = FACET_NO_MEMORY;
    if (made && work) {
        made->view.slope_scale = scale;
        status = fill(made, log_d, n, work);
    }
    free(work);
    if (status == FACET_OK)
        *table = made;
    else
        facet_slope_table_destroy(made);
    return status;
}

void facet_slope_table_destroy(facet_slope_table *table)
{
    if (table) facet_slope_pieces_clear(&table->pieces);
    free(table);
}

double facet_slope_table_log_d(const facet_slope_table *table, double r)
{
    struct kernel_cubic log_q = table->view.log_q;
    double u = r / (table->view.slope_scale + r), x = u * (double)log_q.cells;
    size_t i = x < (double)log_q.cells ? (size_t)x : log_q.cells - 1;
    const double *c = log_q.c + 4 * i;
    double t = x - (double)i;
    return c[0] + t * (c[1] + t * (c[2] + t * c[3])) + log_d_over_q(table->view.slope_scale, u);
}
