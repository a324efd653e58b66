/*
 * facet_leadr.h - slope moments (LEAN/LEADR): what a displaced surface looks
 * like from far away.
 *
 * Moments are linear, so they filter: average them over texels, then turn the
 * mean into a Beckmann roughness (Dupuy 2015, chapter 3).  Slopes are
 * x~ = dz/dx, y~ = dz/dy of the height z (the normal is (-x~, -y~, 1)).
 */
#ifndef FACET_LEADR_H
#define FACET_LEADR_H

#include "facet.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Moments ----------------------------------------------------------------- */

/* e1 = E[x~], e2 = E[y~], e3 = E[x~^2], e4 = E[y~^2], e5 = E[x~ y~]. */
typedef struct facet_moments {
    double e1, e2, e3, e4, e5;
} facet_moments;

/*
 * Beckmann roughness to moments (Dupuy eqs. 3.10-3.14): E3 = alpha_x^2/2 +
 * E1^2 and so on.  Exact but for rounding.
 */
facet_moments facet_moments_from_roughness(const facet_roughness *roughness);

/*
 * Moments to Beckmann roughness.  The covariance must be positive: where it is
 * not, or where a principal alpha lies below alpha_floor, the principal alphas
 * are raised to alpha_floor (the mean and the axes stay; rho is never clamped)
 * and *floored is set.  An ellipse too thin for FACET_RHO_MAX is fattened to
 * alpha_2 = 1e-6 alpha_1, which also counts as floored.
 * alpha_floor 0 refuses instead: BAD_ALPHA for a variance that is not positive,
 * BAD_RHO for an ellipse too thin.  floored may be NULL.
 */
facet_status facet_moments_to_roughness(const facet_moments *moments, double alpha_floor,
                                        facet_roughness *roughness, bool *floored);

/* Moments of the sum of two independent processes, such as a base roughness below a map. */
facet_moments facet_moments_add(const facet_moments *a, const facet_moments *b);

/* Moments after the heights are multiplied by beta. */
facet_moments facet_moments_scale(const facet_moments *moments, double beta);

/*
 * Moments after a change of parametrisation (Dupuy section 3.4): given the
 * slopes along (u, v), those along (x, y), where
 * jacobian = { du/dx, du/dy, dv/dx, dv/dy }.
 */
facet_moments facet_moments_transform(const facet_moments *moments, const double jacobian[4]);

#ifdef __cplusplus
}
#endif
#endif
