/*
 * kernels.h - the only interface to the compiled kernels.
 *
 * kernel.c is compiled once per (tier, isa) and exports one table of these;
 * everything else in it is static, and it calls nothing.
 */
#ifndef FACET_KERNELS_H
#define FACET_KERNELS_H

#include "facet.h"

/* Piecewise cubic on uniform cells of [0, 1]: c[4 i + j] multiplies t^j, t in [0, 1] local to cell i. */
struct kernel_cubic {
    const double *c;
    size_t cells;
};

/*
 * A tabulated radial slope distribution at alpha = 1.  With r = tan theta,
 *   u = r / (scale + r)          log D(theta)  = log_d(u)
 * and with a direction k = (s, 0, c), v = |c| / s,
 *   w = s / (s + |c|)            sigma(k) = max(c, 0) + s exp(log_psi(w)).
 */
struct kernel_table {
    double scale;
    struct kernel_cubic log_d, log_psi;
};

#endif
