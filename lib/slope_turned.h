/*
 * slope_turned.h - sums over a slope distribution that is not radial, as its sheet tabulates it
 * (internal).
 */
#ifndef FACET_SLOPE_TURNED_H
#define FACET_SLOPE_TURNED_H

#include "facet.h"
#include "kernel/kernels.h"

/* The quadratic form that is nearest the squares of these widths along four axes, 45 degrees apart.
 */
struct slope_spread {
    double xx, yy, xy;
};
struct slope_spread facet_slope_spread(const double width[4]);

struct slope_sums {
    double mass;    /* integral of P, which need not be 1 */
    double mean[4]; /* of |component of the slope|, along those axes */
    double gain; /* largest derivative of log D by log tan theta or the azimuth, down to FACET_FLOOR
                    of its peak */
};
struct slope_sums facet_slope_sums(const struct kernel_table *table);

/*
 * psi(v) = E[max(x - v, 0)] of the component x along an azimuth, at v = scale u/(1 - u), u =
 * i/cells, i <= cells. Along `finer` times as many azimuths as the table's own sheet has, a row of
 * cells + 1 each; right to rounding of the largest.
 */
facet_status facet_slope_psi_rows(const struct kernel_table *table, size_t cells, size_t finer,
                                  double *psi);

/* The same along one azimuth (in units of pi), with a density by `points` points on lines across,
 * suited to the spread. */
void facet_slope_psi(const struct kernel_table *table, struct slope_spread spread, double azimuth,
                     size_t cells, size_t points, double *psi);

/* v psi(v) for v to infinity. */
double facet_slope_psi_limit(const struct kernel_table *table, double azimuth);

enum { SLOPE_POINTS_MAX = 192 };

#endif
