/* slope_table_turned.c - tables over (u, azimuth): two sheets, the second the projected area of the
 * first. */
#include "slope_rays.h"
#include "slope_sheet.h"
#include "slope_spline.h"
#include "slope_table.h"
#include "slope_turned.h"

#include <math.h>
#include <stdlib.h>

/* A turn is cut so finely, unless the patches become too many: sheets are cubic, their nodes of
 * degree 7. */
#define TURNS_FINE 128
#define PATCHES_MAX 65536
/* sigma is tabulated at so many cells along u and more, those of the table cut up where they are
 * fewer than the most, and so many times the azimuths. */
#define PSI_CELLS 64
#define PSI_CELLS_MAX 192
/* Twice as many, where its error is larger. */
#define SIGMA_ERROR 2e-7
#define PSI_FINER 2
/* So far above the largest of log_psi is what its sheet counts from. */
#define PSI_BELOW_TOP 2.0
/* A table is normalised to this, in so many passes at most. */
#define MASS_ERROR 1e-12
#define PASSES_MAX 3
/* Between the nodes its error is measured in one cell of so many. */
#define CHECK_STRIDE 3

/* Sums over the azimuth are right to rounding of the whole: a part of it of this share moves by
 * that much more. */
#define RAY_GAIN 1e6

struct sizes {
    size_t n, turns;
    size_t parts, turn_parts; /* of log_q's sheet; sigma's has PSI_FINER times as many azimuths */
    size_t psi_cells, psi_cells_most;
};

static struct sizes sizes_of(const double *y, size_t n, size_t turns)
{
    struct sizes s = {.n = n, .turns = turns, .parts = 1};
    for (size_t j = 0; j < turns; j++) {
        size_t parts = facet_slope_parts(y + j * n, n);
        if (parts > s.parts) s.parts = parts;
    }
    while (s.parts > 1 && s.parts * (n - 1) * turns > PATCHES_MAX) s.parts--;
    s.turn_parts = (TURNS_FINE + turns - 1) / turns;
    while (s.turn_parts > 1 && s.turn_parts * turns * s.parts * (n - 1) > PATCHES_MAX)
        s.turn_parts--;
    s.psi_cells = n - 1 < PSI_CELLS_MAX ? (PSI_CELLS + n - 2) / (n - 1) * (n - 1) : PSI_CELLS_MAX;
    s.psi_cells_most = 2 * s.psi_cells <= PSI_CELLS_MAX ? 2 * s.psi_cells : s.psi_cells;
    return s;
}

/* ---- Sheets --------------------------------------------------------------------------------- */

/* Rows refined along the azimuth, and their sheet. */
static facet_status tabulate_q(const double *y, const struct sizes *s, double *c,
                               struct kernel_sheet *sheet)
{
    size_t rows = s->turns * s->turn_parts;
    double *fine = malloc((s->n + 1) * rows * sizeof *fine), *first = fine + s->n * rows;
    if (!fine) return FACET_NO_MEMORY;
    for (size_t j = 0; j < rows; j++) first[j] = SLOPE_LOG_Q_START / (double)(s->n - 1);
    facet_status status = facet_slope_refine(y, s->n, s->turns, s->turn_parts, fine);
    if (!status) status = facet_slope_sheet(fine, s->n, rows, s->parts, first, c);
    *sheet = (struct kernel_sheet){c, (s->n - 1) * s->parts, rows};
    free(fine);
    return status;
}

/* log_psi from psi at u = i/cells along one azimuth. */
static void take_logarithms(const struct kernel_table *view, double azimuth, size_t cells,
                            double *y)
{
    double b = view->slope_scale;
    for (size_t i = 0; i < cells; i++) y[i] = y[i] / (b * (1 - (double)i / (double)cells));
    y[cells] = facet_slope_psi_limit(view, azimuth) / (b * b);
    for (size_t i = 0; i <= cells; i++) y[i] = fmax(log(y[i]), KERNEL_LOG_ZERO);
}

/* What the sheet holds (kernels.h).  first: its derivative per cell at v = 0, where that of psi is
 * -1/2. */
static void take_reciprocals(double top, size_t cells, double *y, double *first)
{
    *first = (1 - exp(-y[0]) / 2) / (double)cells;
    for (size_t i = 0; i <= cells; i++) y[i] = KERNEL_PSI_UNIT / (top - y[i]);
    *first *= y[0] * y[0] / KERNEL_PSI_UNIT;
}

/* At u = w, S = 1, |c| = u/w; x: what should be there. */
static void measure_at(facet_slope_table *table, double u, double azimuth, double x)
{
    double w = 1 - u, error = fabs(w * exp(slope_log_psi_at(&table->view, u, azimuth)) - x),
           *psi_error = &table->psi_error_to[(size_t)(u * SLOPE_DEPTHS)];
    table->sigma_error = fmax(table->sigma_error, error / (u / w + x));
    *psi_error = fmax(*psi_error, error / fmax(x, FACET_FLOOR));
}

/* |c|/s at u, INFINITY from 1 on. */
static double depth_at(const facet_slope_table *table, double u)
{
    return u < 1 ? table->view.slope_scale * fmax(u, 0) / (1 - u) : INFINITY;
}

/* Nothing is measured yet. */
static void forget_errors(facet_slope_table *table)
{
    table->sigma_error = 0;
    for (size_t k = 0; k < SLOPE_DEPTHS; k++) table->psi_error_to[k] = 0;
}

/* Between the rows and the nodes, where it is interpolated, in every stride-th cell. */
static facet_status measure_between(facet_slope_table *table, size_t stride,
                                    const facet_watch *watch, double *y)
{
    struct kernel_sheet sheet = table->view.turned_psi;
    facet_status status = facet_slope_psi_rows(&table->view, sheet.cells, sheet.turns, true, stride,
                                               watch, y);
    double cells = (double)sheet.cells, step = (double)stride / cells, faint = 1, seen = 0;
    for (size_t j = 0; j < sheet.turns && !status; j++) {
        double azimuth = ((double)j + 0.5) / (double)sheet.turns;
        for (size_t i = 0; i < sheet.cells; i += stride) {
            double u = ((double)i + 0.5) / cells,
                   x = y[j * (sheet.cells + 1) + i] / table->view.slope_scale;
            measure_at(table, u, azimuth, x);
            if (x < FACET_FLOOR) faint = fmin(faint, u - step);
            if (x > 0) seen = fmax(seen, u + step);
        }
    }
    for (size_t k = 1; k < SLOPE_DEPTHS; k++)
        table->psi_error_to[k] = fmax(table->psi_error_to[k], table->psi_error_to[k - 1]);
    table->near = 0;
    table->reach = depth_at(table, faint);
    table->end = depth_at(table, seen);
    return status;
}

double facet_slope_turned_psi_error(const facet_slope_table *table, double depth)
{
    /* Two more: what is measured lies up to a stride before the end of an interval. */
    double u = depth < INFINITY ? depth / (table->view.slope_scale + depth) : 1,
           at = fmin(floor(u * SLOPE_DEPTHS) + 2, SLOPE_DEPTHS - 1);
    return table->psi_error_to[(size_t)at];
}

/*
 * psi(0) = E|x|/2, whose mean over the azimuth is E[r]/pi: by how much the rays of psi miss it, which
 * they do where a cell falls by many powers of e, is seen by nothing that takes the same rays.
 */
static double ray_error(const double *psi, size_t cells, size_t rows, double mean)
{
    double sum = 0;
    for (size_t j = 0; j < rows; j++) sum += psi[j * (cells + 1)];
    return fabs(sum / (double)rows / (mean / FACET_PI) - 1);
}

/* What the kernels read, from psi at the nodes in y.  first: room for the rows. */
static facet_status tabulate_psi(facet_slope_table *table, size_t cells, double *y, double *first,
                                 double *c)
{
    struct kernel_table *view = &table->view;
    size_t rows = PSI_FINER * view->turned_q.turns, knots = cells + 1;
    for (size_t j = 0; j < rows; j++)
        take_logarithms(view, (double)j / (double)rows, cells, y + j * knots);
    view->psi_top = -INFINITY;
    for (size_t k = 0; k < rows * knots; k++)
        view->psi_top = fmax(view->psi_top, y[k] + PSI_BELOW_TOP);
    for (size_t j = 0; j < rows; j++)
        take_reciprocals(view->psi_top, cells, y + j * knots, &first[j]);
    view->turned_psi = (struct kernel_sheet){c, cells, rows};
    return facet_slope_sheet(y, knots, rows, 1, first, c);
}

/* mean: E[r]; is_last: there are no more cells.  An error that stays is looked for in every cell. */
static facet_status fill_psi(facet_slope_table *table, size_t cells, double mean, bool is_last,
                             const facet_watch *watch, double *c)
{
    size_t rows = PSI_FINER * table->view.turned_q.turns, knots = cells + 1;
    double *y = malloc((knots + 1) * rows * sizeof *y);
    if (!y) return FACET_NO_MEMORY;
    facet_status status = facet_slope_psi_rows(&table->view, cells, rows, false, 1, watch, y);
    forget_errors(table);
    const double lost = status ? 0 : ray_error(y, cells, rows, mean);
    if (!status) status = tabulate_psi(table, cells, y, y + knots * rows, c);
    if (!status) status = measure_between(table, CHECK_STRIDE, watch, y);
    table->sigma_error = fmax(table->sigma_error, lost);
    bool stays = is_last || table->sigma_error <= SIGMA_ERROR;
    if (!status && stays && table->sigma_error > SIGMA_ERROR / 2)
        status = measure_between(table, 1, watch, y);
    free(y);
    return status;
}

/* ---- The table ------------------------------------------------------------------------------ */

static bool agree_at_normal(const double *log_d, size_t n, size_t turns)
{
    for (size_t j = 1; j < turns; j++)
        if (log_d[j * n] != log_d[0]) return false;
    return true;
}

static bool falls_to_nothing(const double *y, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (slope_log_is_zero(y[i])) return true;
    return false;
}

/* log_q of a whole of 1.  Nodes of 0 stay: what falls to them has changed, by much less each time. */
static facet_status normalise(facet_slope_table *table, const struct sizes *s,
                              const facet_watch *watch, double *y, struct slope_sums *sums)
{
    struct kernel_table *view = &table->view;
    const size_t n = s->n * s->turns;
    facet_status status = tabulate_q(y, s, table->coefficients, &view->turned_q);
    for (int pass = 0; !status; pass++) {
        if ((status = facet_slope_sums(view, watch, sums))) break;
        bool done = pass == PASSES_MAX || (pass > 0 && fabs(sums->mass - 1) <= MASS_ERROR);
        if (done) break;
        if (!facet_slope_normalise(sums->mass, y, n)) return FACET_BAD_TABLE;
        status = tabulate_q(y, s, table->coefficients, &view->turned_q);
        if (!falls_to_nothing(y, n)) break;
    }
    return status;
}

/* y: turns rows of n. */
static facet_status fill(facet_slope_table *table, const struct sizes *s, const facet_watch *watch,
                         double *y)
{
    struct kernel_table *view = &table->view;
    struct slope_sums sums;
    facet_status status = normalise(table, s, watch, y, &sums);
    if (status) return status;
    const double mean = sums.mean / sums.mass;
    if (view->slope_scale > FACET_TURNED_SCALE_FAR * mean) return FACET_BAD_TABLE;
    table->gain = sums.gain;
    table->quantile_gain = RAY_GAIN;
    double *c = table->coefficients + 16 * view->turned_q.cells * view->turned_q.turns;
    const bool may_grow = s->psi_cells_most > s->psi_cells;
    status = fill_psi(table, s->psi_cells, mean, !may_grow, watch, c);
    bool again = may_grow && table->sigma_error > SIGMA_ERROR;
    if (!status && again) status = fill_psi(table, s->psi_cells_most, mean, true, watch, c);
    if (!status) facet_slope_table_measure(table);
    return status;
}

facet_status facet_slope_table_create_turned(double scale, const double *log_d, size_t n,
                                             size_t turns, const facet_watch *watch,
                                             facet_slope_table **table)
{
    *table = NULL;
    if (n < FACET_TABLE_NODES_MIN || turns < FACET_TABLE_TURNS_MIN ||
        turns > FACET_TABLE_TURNS_MAX || n > FACET_TURNED_NODES_MAX / turns)
        return FACET_BAD_SIZE;
    if (!facet_slope_nodes_valid(scale, log_d, n * turns) || !agree_at_normal(log_d, n, turns))
        return FACET_BAD_TABLE;
    double *y = malloc(n * turns * sizeof *y);
    if (!y) return FACET_NO_MEMORY;
    facet_slope_start_nodes(scale, log_d, n, turns, y);
    struct sizes s = sizes_of(y, n, turns);
    size_t patches = (s.parts * (n - 1) + PSI_FINER * s.psi_cells_most) * s.turn_parts * turns;
    facet_slope_table *made = calloc(1, sizeof *made + 16 * patches * sizeof(double));
    facet_status status = FACET_NO_MEMORY;
    if (made) {
        made->view.slope_scale = made->view.psi_scale = scale;
        status = fill(made, &s, watch, y);
    }
    free(y);
    if (status)
        facet_slope_table_destroy(made);
    else
        *table = made;
    return status;
}

const struct slope_rays *facet_slope_table_rays(const facet_slope_table *table)
{
    /* It is a cache: the table that callers see does not change. */
    _Atomic(struct slope_rays *) *kept = (_Atomic(struct slope_rays *) *)&table->rays;
    struct slope_rays *rays = atomic_load(kept), *none = NULL;
    if (rays) return rays;
    rays = facet_slope_rays_create(&table->view, table->view.turned_psi.turns);
    if (!rays || atomic_compare_exchange_strong(kept, &none, rays)) return rays;
    free(rays); /* another thread was first */
    return none;
}
