/* opposite.h - Smith's masking between directions on opposite sides of a surface (internal). */
#ifndef FACET_OPPOSITE_H
#define FACET_OPPOSITE_H

#include <stddef.h>

/*
 * Gamma(1 + a) Gamma(1 + b) / Gamma(1 + a + b), a and b >= 0, either may be infinite; in [0, 1].
 * With a = 1 + Lambda(o) and b = Lambda(i) it is G2/G1(o) of the height-correlated Smith model
 * for a transmitted ray: a facet high up is seen from one side and hidden from the other, so that
 * G2 is the integral of u^Lambda(o) (1 - u)^Lambda(i) over u in [0, 1], B(1 + Lambda(o), 1 +
 * Lambda(i)) (Heitz et al. 2016, sec. 5.4).  Relative error: at most OPPOSITE_ERROR(|log|) of the
 * arguments given.  Of n pairs, by the precise kernels (kernel/crossing.h).
 */
void facet_opposite(const double *a, const double *b, size_t n, double *to);

#define OPPOSITE_ERROR(log_size) (8e-15 + 6e-16 * (log_size))

#endif
