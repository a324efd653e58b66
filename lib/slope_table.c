#include "slope_table.h"

#include "slope_quantile.h"
#include "slope_ring.h"
#include "slope_sheet.h"
#include "slope_spline.h"

#include <math.h>
#include <stdlib.h>

#define SCALE_MIN 1e-8
#define SCALE_MAX 1e4
#define LOG_D_ZERO (-700.0) /* and below counts as D = 0 (facet_table.h) */
/* sigma is tabulated on so many cells, more until its errors are below the targets or they are too
 * many. */
#define PSI_CELLS_MIN 128
#define PSI_CELLS_MAX 2048
#define SIGMA_ERROR 2e-10
#define PSI_ERROR 2.5e-7
#define FAR_ERROR 1e-5
/*
 * A table whose scale is more than so many mean slopes may have all its sigma within one cell: where
 * that is not told, it is tabulated at so many mean slopes instead.
 */
#define SCALE_FAR 16.0
#define SCALE_OWN 4.0
/* A table is normalised to this, in so many passes at most. */
#define MASS_ERROR 1e-13
#define PASSES_MAX 3

/* ---- sigma ---------------------------------------------------------------------------- */

/* log_psi and its derivative by w at one node (kernels.h). */
struct psi_node {
    double y, slope;
};

/* w in (0, 1], b: psi_scale */
static struct psi_node psi_at(const struct slope_pieces *pieces, double b, double w)
{
    double derivative;
    double psi = facet_slope_pieces_psi(pieces, b * (1 - w) / w, &derivative);
    double y = log(psi / (b * w));
    if (!(y > KERNEL_LOG_ZERO)) return (struct psi_node){KERNEL_LOG_ZERO, 0};
    return (struct psi_node){y, -derivative / psi * b / (w * w) - 1 / w};
}

/* v to infinity: P = D(pi/2)/r^4 there, D(pi/2) = exp(log_q(1)) b^4, hence psi = D(pi/2) pi/(4 v). */
static double psi_limit(const struct slope_pieces *pieces, double b)
{
    const double *c = pieces->log_q.c + 4 * (pieces->log_q.cells - 1),
                 square = pieces->scale * pieces->scale;
    double y = c[0] + c[1] + c[2] + c[3] + log(FACET_PI / 4 * square * (square / (b * b)));
    return fmax(y, KERNEL_LOG_ZERO);
}

/* Values at w = (2 i + 1)/(2 cells), halfway between the nodes of cells cells. */
static void psi_between(const struct slope_pieces *pieces, double b, size_t cells,
                        struct psi_node *node)
{
    for (size_t i = 0; i < cells; i++)
        node[i] = psi_at(pieces, b, (2 * (double)i + 1) / (2 * (double)cells));
}

/* middle: log_psi halfway through the first cell, in place of the slope at w = 0, which is unknown. */
static void tabulate_psi(const struct psi_node *node, size_t cells, double middle, double *c)
{
    double h = 1 / (double)cells;
    for (size_t i = 0; i < cells; i++) {
        struct psi_node a = node[i], b = node[i + 1];
        if (slope_log_is_zero(a.y) || slope_log_is_zero(b.y)) {
            slope_ramp(a.y, b.y, c + 4 * i);
        } else {
            double m1 = b.slope * h, m0 = a.slope * h;
            if (i == 0) m0 = m1 + 8 * (middle - (a.y + b.y) / 2);
            slope_hermite(a.y, b.y, m0, m1, c + 4 * i);
        }
    }
}

/* Nothing is measured yet. */
static void forget_errors(facet_slope_table *table)
{
    table->sigma_error = table->psi_error = table->far_error = 0;
    table->near = table->reach = table->end = INFINITY;
}

/* Error of sigma at t in cell i, where log_psi is y, in front of and behind the horizon. */
static void measure_at(facet_slope_table *table, size_t i, double t, double y)
{
    struct kernel_cubic log_psi = table->view.log_psi;
    const double *c = log_psi.c + 4 * i;
    double b = table->view.psi_scale, cells = (double)log_psi.cells;
    double w = ((double)i + t) / cells, begins = b * (cells / ((double)i + 1) - 1);
    double exact = w * exp(y); /* S = 1, |c| = (1-w)/w */
    double error = fabs(w * exp(c[0] + t * (c[1] + t * (c[2] + t * c[3]))) - exact);
    table->sigma_error = fmax(table->sigma_error, error / ((1 - w) / w + exact));
    if (exact >= FACET_FLOOR) {
        table->psi_error = fmax(table->psi_error, error / exact);
        return;
    }
    table->near = fmin(table->near, begins);
    if (exact >= SLOPE_FAINT)
        table->far_error = fmax(table->far_error, error / exact);
    else
        table->reach = fmin(table->reach, begins);
    if (exact == 0) table->end = fmin(table->end, b * (cells / (double)i - 1));
}

/*
 * Where the middle of a cell says little: in the first, which was made to go through it, and in the last,
 * where sigma begins at small slopes.  Those below a quarter of the first piece are all alike.
 */
static void measure_ends(facet_slope_table *table, const struct slope_pieces *pieces)
{
    double b = table->view.psi_scale, cells = (double)table->view.log_psi.cells;
    double least = ring_slope(pieces->scale, pieces->piece[0].u1) / 4;
    for (double t = .25; t > .02; t /= 2) {
        measure_at(table, 0, t, psi_at(pieces, b, t / cells).y);
        measure_at(table, 0, 1 - t, psi_at(pieces, b, (1 - t) / cells).y);
    }
    for (double rest = .75; b * rest / cells > least; rest /= 2)
        measure_at(table, table->view.log_psi.cells - 1, 1 - rest,
                   psi_at(pieces, b, 1 - rest / cells).y);
}

static bool is_told(const facet_slope_table *table)
{
    return table->sigma_error <= SIGMA_ERROR && table->psi_error <= PSI_ERROR;
}

/* Doubles the cells until sigma is right to SIGMA_ERROR.  node and between hold PSI_CELLS_MAX + 1. */
static void tabulate_sigma(facet_slope_table *table, const struct slope_pieces *pieces, double *c,
                           struct psi_node *node, struct psi_node *between)
{
    double b = table->view.psi_scale;
    size_t cells = PSI_CELLS_MIN;
    node[0] = (struct psi_node){psi_limit(pieces, b), 0};
    for (size_t i = 1; i <= cells; i++) node[i] = psi_at(pieces, b, (double)i / (double)cells);
    for (;; cells *= 2) {
        bool most = 2 * cells > PSI_CELLS_MAX;
        psi_between(pieces, b, cells, between);
        tabulate_psi(node, cells, between[0].y, c);
        table->view.log_psi = (struct kernel_cubic){c, cells};
        forget_errors(table);
        for (size_t i = 0; i < cells; i++) measure_at(table, i, 0.5, between[i].y);
        bool enough = is_told(table) && table->far_error <= FAR_ERROR;
        if (most || enough) measure_ends(table, pieces);
        if (most || (enough && is_told(table))) return;
        for (size_t i = cells + 1; i-- > 0;) {
            node[2 * i] = node[i];
            if (i < cells) node[2 * i + 1] = between[i];
        }
    }
}

/* At the table's own scale, or at that of its slopes, whichever tells more. */
static void choose_sigma(facet_slope_table *table, const struct slope_pieces *pieces, double *c,
                         struct psi_node *node, struct psi_node *between)
{
    double b = pieces->scale, mean = pieces->piece[0].moment[0];
    table->view.psi_scale = b;
    tabulate_sigma(table, pieces, c, node, between);
    if (is_told(table) || !(b > SCALE_FAR * mean)) return;
    double sigma_error = table->sigma_error;
    table->view.psi_scale = SCALE_OWN * mean;
    tabulate_sigma(table, pieces, c, node, between);
    if (is_told(table) || table->sigma_error <= sigma_error) return;
    table->view.psi_scale = b;
    tabulate_sigma(table, pieces, c, node, between);
}

/* ---- The table -------------------------------------------------------------------------- */

bool facet_slope_nodes_valid(double scale, const double *log_d, size_t n)
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

void facet_slope_start_nodes(double scale, const double *log_d, size_t n, size_t rows, double *y)
{
    double peak = -INFINITY;
    for (size_t i = 0; i < rows * n; i++) {
        y[i] = log_d[i] - log_d_over_q(scale, (double)(i % n) / (double)(n - 1));
        peak = fmax(peak, y[i]);
    }
    for (size_t i = 0; i < rows * n; i++) {
        y[i] -= peak;
        if (log_d[i] <= LOG_D_ZERO || y[i] <= LOG_D_ZERO) y[i] = KERNEL_LOG_ZERO;
    }
}

bool facet_slope_normalise(double norm, double *y, size_t n)
{
    if (!(norm > 0) || !isfinite(norm)) return false;
    for (size_t i = 0; i < n; i++)
        if (!slope_log_is_zero(y[i])) y[i] = fmax(y[i] - log(norm), KERNEL_LOG_ZERO);
    return true;
}

static facet_status fill(facet_slope_table *table, const double *log_d, size_t n, double *work)
{
    double *c = table->coefficients, *y = work, *rest = work + n,
           first = SLOPE_LOG_Q_START / (double)(n - 1);
    struct psi_node *node = (struct psi_node *)(work + 3 * n), *between = node + PSI_CELLS_MAX + 1;
    struct slope_pieces *pieces = &table->pieces;
    facet_slope_start_nodes(table->view.slope_scale, log_d, n, 1, y);
    size_t parts = facet_slope_parts(y, n), cells = (n - 1) * parts;
    table->view.log_q = (struct kernel_cubic){c, cells};
    for (int pass = 0;; pass++) { /* pass 0 finds the norm */
        facet_slope_spline(y, n, parts, &first, c, rest);
        facet_status status = facet_slope_pieces_create(table->view.slope_scale, table->view.log_q,
                                                        pieces);
        if (status != FACET_OK) return status;
        double norm = pieces->piece[0].mass;
        /* Nodes of 0 stay: what falls to them has changed, by much less each time. */
        if (pass == PASSES_MAX || (pass > 0 && fabs(norm - 1) <= MASS_ERROR)) break;
        facet_slope_pieces_clear(pieces);
        if (!facet_slope_normalise(norm, y, n)) return FACET_BAD_TABLE;
    }
    table->quantile_gain = facet_slope_quantile_gain(pieces);
    choose_sigma(table, pieces, c + 4 * cells, node, between);
    facet_slope_table_measure(table);
    return FACET_OK;
}

facet_status facet_slope_table_create(double scale, const double *log_d, size_t n,
                                      facet_slope_table **table)
{
    *table = NULL;
    if (n < FACET_TABLE_NODES_MIN || n > FACET_TABLE_NODES_MAX) return FACET_BAD_SIZE;
    if (!facet_slope_nodes_valid(scale, log_d, n)) return FACET_BAD_TABLE;
    facet_slope_table *made = calloc(
        1, sizeof *made + 4 * (SLOPE_PARTS_MAX * (n - 1) + PSI_CELLS_MAX) * sizeof(double));
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
    if (table) {
        facet_slope_pieces_clear(&table->pieces);
        free(table->rays);
        free(table->view.floats);
    }
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

double facet_slope_table_log_d_along(const facet_slope_table *table, double r, double azimuth)
{
    double u = r / (table->view.slope_scale + r);
    return slope_sheet_at(table->view.turned_q, u, azimuth) +
           log_d_over_q(table->view.slope_scale, u);
}
