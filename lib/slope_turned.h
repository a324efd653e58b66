/*
 * slope_turned.h - sums over a slope distribution that is not radial, as its sheet tabulates it
 * (internal).
 */
#ifndef FACET_SLOPE_TURNED_H
#define FACET_SLOPE_TURNED_H

#include "facet.h"
#include "kernel/kernels.h"

struct slope_sums {
    double mass, mean; /* integrals of P, which need not be 1, and of r P */
    double gain; /* largest derivative of log D by log tan theta or the azimuth, down to FACET_FLOOR
                    of its peak */
};
/* CANCELLED, or OK. */
facet_status facet_slope_sums(const struct kernel_table *table, const facet_watch *watch,
                              struct slope_sums *sums);

/*
 * psi(v) = E[max(x - v, 0)] of the component x along an azimuth, at v = scale u/(1 - u), u =
 * i/cells, i < cells: rows (even) of cells + 1, row j along the azimuth pi j/rows.  is_check: between
 * those, at u = (i + 1/2)/cells, i = 0, stride .., azimuth pi (j + 1/2)/rows, from rays there, so that it
 * errs otherwise.
 */
facet_status facet_slope_psi_rows(const struct kernel_table *table, size_t cells, size_t rows,
                                  bool is_check, size_t stride, const facet_watch *watch,
                                  double *psi);

/* v psi(v) for v to infinity; azimuth in units of pi. */
double facet_slope_psi_limit(const struct kernel_table *table, double azimuth);

#endif
