/* roughness.h - a roughness in pairs of doubles, for what cancels where an ellipse is thin (internal). */
#ifndef FACET_ROUGHNESS_H
#define FACET_ROUGHNESS_H

#include "double_double.h"
#include "facet.h"

/*
 * The map to slopes (facet.h) as x~ = alpha_x x, y~ = correlated x + conditional y.  alpha_x is a
 * double: all three share the factor, within half an ulp of 1, by which rounding moved it, so that the
 * ellipse keeps its shape.
 */
struct roughness_form {
    double alpha_x;
    struct pair correlated, conditional; /* rho alpha_y, sqrt(1 - rho^2) alpha_y */
};

struct roughness_form facet_roughness_form(const facet_roughness *roughness);

/* A roughness in range, `by` inside of every end of the ranges; the variance that rho leaves by 4 `by`. */
facet_roughness facet_roughness_inside(const facet_roughness *roughness, double by);
/* A form of a roughness that differs by more does not hold it. */
#define FORM_NEAR 0.1

#endif
