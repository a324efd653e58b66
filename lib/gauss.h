/*
 * gauss.h - Gauss-Legendre quadrature.
 */
#ifndef FACET_GAUSS_H
#define FACET_GAUSS_H

#include <stddef.h>

/* The n nodes and weights on [0, 1], nodes ascending. */
void facet_gauss_legendre(size_t n, double *node, double *weight);

#endif
