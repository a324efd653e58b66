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
 * A tabulated radial slope distribution at alpha = 1.  With r = tan theta and b = slope_scale,
 *   u = r / (b + r)              P(r) = exp(log_q(u)) (1 - u)^4,  D(theta) = P (1 + r^2)^2,
 * free of division by h_z: with R the length of the standard slopes times H_z,
 *   u = R / (b H_z + R)          D = |H|^4 exp(log_q(u)) b^4 / (det (b H_z + R)^4).
 * With a direction k = (s, 0, c), S = b s,
 *   w = S / (S + |c|)            sigma(k) = max(c, 0) + S w exp(log_psi(w)).
 * (log_q, not log D, because it is smooth at the scale b alone; the b in w
 * resolves sigma of narrow tables; the factor w leaves log_psi smooth at 0.)
 * Where D or sigma - max(c, 0) counts as 0 the cubics lie at KERNEL_LOG_ZERO:
 * exp must answer 0 there, and is never handed less.
 */
#define KERNEL_LOG_ZERO (-800.0)

struct kernel_table {
    double slope_scale;
    struct kernel_cubic log_q, log_psi;
};

#endif
