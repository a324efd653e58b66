/*
 * slope_spline.h - log_q between the nodes of a slope table (internal).
 *
 * Where the nodes lie on a smooth curve, polynomials of degree 7 through the 8 about each cell, handed out
 * as the cubics a kernel reads: several to a cell where one would miss them.  Where they do not
 * (noise, edges), a cubic spline that does not ring.
 */
#ifndef FACET_SLOPE_SPLINE_H
#define FACET_SLOPE_SPLINE_H

#include "kernel/kernels.h"

#include <stdbool.h>

enum { SLOPE_PARTS_MAX = 4 };

/* The cubic on [0, 1] with values y0, y1 and derivatives m0, m1 at its ends. */
static inline void slope_hermite(double y0, double y1, double m0, double m1, double c[4])
{
    c[0] = y0;
    c[1] = m0;
    c[2] = 3 * (y1 - y0) - 2 * m0 - m1;
    c[3] = m0 + m1 - 2 * (y1 - y0);
}

/* From one value to the other with level ends: no overshoot. */
static inline void slope_ramp(double y0, double y1, double c[4])
{
    slope_hermite(y0, y1, 0, 0, c);
}

static inline bool slope_log_is_zero(double y)
{
    return y == KERNEL_LOG_ZERO;
}

/* Cubics to a cell, 1 to SLOPE_PARTS_MAX, with which y, log_q at n nodes, is told where it matters. */
size_t facet_slope_parts(const double *y, size_t n);

/*
 * A smooth surface has dD/dr = 0 at r = 0, where log_q = log D - 4 log(1 - u) + O(u^2):
 * its derivative by u there.
 */
#define SLOPE_LOG_Q_START 4.0

/* Coefficients of (n - 1) parts cubics.  first: the derivative, per cell, at the first node; NULL: unknown.  work holds 2 n. */
void facet_slope_spline(const double *y, size_t n, size_t parts, const double *first, double *c,
                        double *work);

#endif
