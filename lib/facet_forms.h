/*
 * facet_forms.h - a roughness as doubles in its other forms: an ellipse, moments.
 *
 * Each form loses something: an angle next to pi/2 is told to 1e-16 where the
 * ellipse may be a million times thinner, raw moments cancel beside a mean slope.
 * What is written here is read back by the functions that read requests, and by
 * how much it then differs is known.
 */
#ifndef FACET_FORMS_H
#define FACET_FORMS_H

#include "facet_leadr.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Of alpha_1 and alpha_2: what alpha_x, alpha_y and rho within their ranges reach as an ellipse. */
#define FACET_AXIS_MIN 9.9e-15 /* 1e-8 sqrt(1e-12) */
#define FACET_AXIS_MAX 14143.0 /* 1e4 sqrt(2) */

/*
 * By how much the slopes of b are wider or narrower than those of a, relatively, in the direction
 * where that is most; mean slopes aside.
 */
double facet_roughness_difference(const facet_roughness *a, const facet_roughness *b);

/*
 * facet_roughness_to_ellipse and facet_moments_from_roughness, but so that facet_roughness_from_ellipse
 * and facet_roughness_from_covariance take the doubles: where rounding would carry them past an end of
 * the ranges, they are those of a roughness as little inside as serves.  *difference: of what is read
 * back.  False: doubles do not hold the form within 0.1.
 */
bool facet_ellipse_readable(const facet_roughness *roughness, facet_ellipse *ellipse,
                            double *difference);
bool facet_moments_readable(const facet_roughness *roughness, facet_moments *moments,
                            double *difference);

#ifdef __cplusplus
}
#endif

#endif
