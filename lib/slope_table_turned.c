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
/* sigma is tabulated at so many cells along u, and so many times the azimuths. */
#define PSI_CELLS 96
#define PSI_FINER 2
/* And measured at so many, none of them a node but the first, by so many points on lines, along so
 * many azimuths. */
#define CHECK_CELLS 37
#define CHECK_POINTS 192
#define CHECK_ROWS 4
/* Below this share of the scale it counts as 0: it is in front of the surface alone that it is
 * told. */
#define PSI_LEAST 1e-13

/* Sums over the azimuth are right to rounding of the whole: a part of it of this share moves by
 * that much more. */
#define RAY_GAIN 1e6

struct sizes {
    size_t n, turns;
    size_t parts, turn_parts; /* of log_q's sheet; sigma's has PSI_FINER times as many azimuths */
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

/* log_psi from psi at u = i/PSI_CELLS along one azimuth; first: its derivative at v = 0, where that
 * of psi is -1/2, per cell. */
static void take_logarithms(const struct kernel_table *view, double azimuth, double *y,
                            double *first)
{
    double b = view->slope_scale;
    for (size_t i = 0; i < PSI_CELLS; i++) y[i] = y[i] / (b * (1 - (double)i / PSI_CELLS));
    y[PSI_CELLS] = facet_slope_psi_limit(view, azimuth) / (b * b);
    for (size_t i = 0; i <= PSI_CELLS; i++) y[i] = log(fmax(y[i], PSI_LEAST));
    *first = (1 - exp(-y[0]) / 2) / PSI_CELLS;
}

/* Between the rows and the nodes, against a quadrature that shares nothing with the one that made
 * them. */
static void measure_psi(facet_slope_table *table, struct slope_spread spread)
{
    double exact[CHECK_CELLS + 1], b = table->view.slope_scale;
    size_t rows = table->view.turned_psi.turns;
    for (size_t row = 0; row < CHECK_ROWS; row++) {
        double azimuth = ((double)(row * rows / CHECK_ROWS) + 0.5) / (double)rows;
        facet_slope_psi(&table->view, spread, azimuth, CHECK_CELLS, CHECK_POINTS, exact);
        for (size_t i = 0; i < CHECK_CELLS; i++) {
            double u = (double)i / CHECK_CELLS, w = 1 - u, x = exact[i] / b; /* S = 1, |c| = u/w */
            double error = fabs(w * exp(slope_sheet_at(table->view.turned_psi, u, azimuth)) - x);
            table->sigma_error = fmax(table->sigma_error, error / (u / w + x));
        }
    }
}

static facet_status fill_psi(facet_slope_table *table, const struct slope_sums *sums, double *c)
{
    size_t rows = PSI_FINER * table->view.turned_q.turns;
    double *y = malloc((PSI_CELLS + 2) * rows * sizeof *y), *first = y + (PSI_CELLS + 1) * rows;
    if (!y) return FACET_NO_MEMORY;
    facet_status status = facet_slope_psi_rows(&table->view, PSI_CELLS, PSI_FINER, y);
    for (size_t j = 0; j < rows && !status; j++)
        take_logarithms(&table->view, (double)j / (double)rows, y + j * (PSI_CELLS + 1), &first[j]);
    if (!status) status = facet_slope_sheet(y, PSI_CELLS + 1, rows, 1, first, c);
    table->view.turned_psi = (struct kernel_sheet){c, PSI_CELLS, rows};
    if (!status) measure_psi(table, facet_slope_spread(sums->mean));
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

/* y: turns rows of n. */
static facet_status fill(facet_slope_table *table, const struct sizes *s, double *y)
{
    struct kernel_table *view = &table->view;
    facet_status status = tabulate_q(y, s, table->coefficients, &view->turned_q);
    if (status) return status;
    struct slope_sums sums = facet_slope_sums(view);
    if (!facet_slope_normalise(sums.mass, y, s->n * s->turns)) return FACET_BAD_TABLE;
    status = tabulate_q(y, s, table->coefficients, &view->turned_q);
    if (status) return status;
    table->turned_gain = sums.gain;
    table->quantile_gain = RAY_GAIN;
    return fill_psi(table, &sums,
                    table->coefficients + 16 * view->turned_q.cells * view->turned_q.turns);
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
    size_t patches = (s.parts * (n - 1) + PSI_FINER * PSI_CELLS) * s.turn_parts * turns;
    facet_slope_table *made = calloc(1, sizeof *made + 16 * patches * sizeof(double));
    facet_status status = FACET_NO_MEMORY;
    if (made) {
        made->view.slope_scale = scale;
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
