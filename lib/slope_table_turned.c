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
/* A table is normalised to this, in so many passes at most. */
#define MASS_ERROR 1e-13
#define PASSES_MAX 3
/* Between the nodes its error is measured in one cell of so many. */
#define CHECK_STRIDE 3
/* Below this share of the scale it counts as 0: it is in front of the surface alone that it is
 * told. */
#define PSI_LEAST 1e-13

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

/* log_psi from psi at u = i/cells along one azimuth; first: its derivative at v = 0, where that of
 * psi is -1/2, per cell. */
static void take_logarithms(const struct kernel_table *view, double azimuth, size_t cells,
                            double *y, double *first)
{
    double b = view->slope_scale;
    for (size_t i = 0; i < cells; i++) y[i] = y[i] / (b * (1 - (double)i / (double)cells));
    y[cells] = facet_slope_psi_limit(view, azimuth) / (b * b);
    for (size_t i = 0; i <= cells; i++) y[i] = log(fmax(y[i], PSI_LEAST));
    *first = (1 - exp(-y[0]) / 2) / (double)cells;
}

/* Between the rows and the nodes, where it is interpolated, in every stride-th cell. */
static facet_status measure_between(facet_slope_table *table, size_t stride, double *y)
{
    const double shift = 0.5;
    struct kernel_sheet sheet = table->view.turned_psi;
    facet_status status = facet_slope_psi_rows(&table->view, sheet.cells, sheet.turns, shift,
                                               stride, y);
    for (size_t j = 0; j < sheet.turns && !status; j++) {
        double azimuth = ((double)j + shift) / (double)sheet.turns;
        for (size_t i = 0; i < sheet.cells; i += stride) {
            double u = ((double)i + shift) / (double)sheet.cells, w = 1 - u;
            double x = y[j * (sheet.cells + 1) + i] /
                       table->view.slope_scale; /* S = 1, |c| = u/w */
            double error = fabs(w * exp(slope_sheet_at(sheet, u, azimuth)) - x);
            table->sigma_error = fmax(table->sigma_error, error / (u / w + x));
        }
    }
    return status;
}

/*
 * psi(0) = E|x|/2, whose mean over the azimuth is E[r]/pi: by how much the rings of psi miss it, which
 * they do where a cell falls by many powers of e, is seen by nothing that takes the same rings.
 */
static double ring_error(const double *psi, size_t cells, size_t rows, double mean)
{
    double sum = 0;
    for (size_t j = 0; j < rows; j++) sum += psi[j * (cells + 1)];
    return fabs(sum / (double)rows / (mean / FACET_PI) - 1);
}

/* mean: E[r]; is_last: there are no more cells.  An error that stays is looked for in every cell. */
static facet_status fill_psi(facet_slope_table *table, size_t cells, double mean, bool is_last,
                             double *c)
{
    size_t rows = PSI_FINER * table->view.turned_q.turns;
    double *y = malloc((cells + 2) * rows * sizeof *y), *first = y + (cells + 1) * rows;
    if (!y) return FACET_NO_MEMORY;
    facet_status status = facet_slope_psi_rows(&table->view, cells, rows, 0, 1, y);
    if (!status) table->sigma_error = ring_error(y, cells, rows, mean);
    for (size_t j = 0; j < rows && !status; j++)
        take_logarithms(&table->view, (double)j / (double)rows, cells, y + j * (cells + 1),
                        &first[j]);
    if (!status) status = facet_slope_sheet(y, cells + 1, rows, 1, first, c);
    table->view.turned_psi = (struct kernel_sheet){c, cells, rows};
    if (!status) status = measure_between(table, CHECK_STRIDE, y);
    bool stays = is_last || table->sigma_error <= SIGMA_ERROR;
    if (!status && stays && table->sigma_error > SIGMA_ERROR / 2)
        status = measure_between(table, 1, y);
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
static facet_status normalise(facet_slope_table *table, const struct sizes *s, double *y,
                              struct slope_sums *sums)
{
    struct kernel_table *view = &table->view;
    const size_t n = s->n * s->turns;
    facet_status status = tabulate_q(y, s, table->coefficients, &view->turned_q);
    for (int pass = 0; !status; pass++) {
        *sums = facet_slope_sums(view);
        bool done = pass == PASSES_MAX || (pass > 0 && fabs(sums->mass - 1) <= MASS_ERROR);
        if (done) break;
        if (!facet_slope_normalise(sums->mass, y, n)) return FACET_BAD_TABLE;
        status = tabulate_q(y, s, table->coefficients, &view->turned_q);
        if (!falls_to_nothing(y, n)) break;
    }
    return status;
}

/* y: turns rows of n. */
static facet_status fill(facet_slope_table *table, const struct sizes *s, double *y)
{
    struct kernel_table *view = &table->view;
    struct slope_sums sums;
    facet_status status = normalise(table, s, y, &sums);
    if (status) return status;
    const double mean = sums.mean / sums.mass;
    if (view->slope_scale > FACET_TURNED_SCALE_FAR * mean) return FACET_BAD_TABLE;
    table->gain = sums.gain;
    table->quantile_gain = RAY_GAIN;
    table->near = table->reach = table->end = INFINITY; /* it is not seen from behind */
    double *c = table->coefficients + 16 * view->turned_q.cells * view->turned_q.turns;
    const bool may_grow = s->psi_cells_most > s->psi_cells;
    status = fill_psi(table, s->psi_cells, mean, !may_grow, c);
    bool again = may_grow && table->sigma_error > SIGMA_ERROR;
    if (!status && again) status = fill_psi(table, s->psi_cells_most, mean, true, c);
    if (!status) facet_slope_table_measure(table);
    return status;
}

facet_status facet_slope_table_create_turned(double scale, const double *log_d, size_t n,
                                             size_t turns, facet_slope_table **table)
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
        status = fill(made, &s, y);
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
