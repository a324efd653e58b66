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
 *   u = r / (slope_scale + r)    log D(theta)  = log_d(u)
 * and with a direction k = (s, 0, c), S = slope_scale s,
 *   w = S / (S + |c|)            sigma(k) = max(c, 0) + S w exp(log_psi(w)).
 * (The scale in w resolves sigma of narrow tables; the factor w leaves a
 * log_psi that is smooth at w = 0 for every D that is finite at the horizon.)
 * Where D or sigma - max(c, 0) counts as 0 the cubics lie at KERNEL_LOG_ZERO:
 * exp must answer 0 there, and is never handed less.
 */
#define KERNEL_LOG_ZERO (-800.0)

struct kernel_table {
    double slope_scale;
    struct kernel_cubic log_d, log_psi;
};

#endif
