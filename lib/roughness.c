/* roughness.c - the two forms of a roughness (Dupuy eqs. 2.25-2.34; signs: lib/NOTATION.md). */
#include "facet.h"

#include <math.h>

facet_status facet_roughness_check(const facet_roughness *r)
{
    if (!(r->alpha_x >= FACET_ALPHA_MIN && r->alpha_x <= FACET_ALPHA_MAX)) return FACET_BAD_ALPHA;
    if (!(r->alpha_y >= FACET_ALPHA_MIN && r->alpha_y <= FACET_ALPHA_MAX)) return FACET_BAD_ALPHA;
    if (!(fabs(r->rho) <= FACET_RHO_MAX)) return FACET_BAD_RHO;
    if (!(fabs(r->slope_x) <= FACET_MEAN_SLOPE_MAX)) return FACET_BAD_MEAN_SLOPE;
    if (!(fabs(r->slope_y) <= FACET_MEAN_SLOPE_MAX)) return FACET_BAD_MEAN_SLOPE;
    return FACET_OK;
}

/*
 * alpha_x^2 = (a1^2 + a2^2 + (a1^2 - a2^2) cos 2phi)/2 and so on, written as sums
 * of squares; rho has the sign that agrees with 2.25 (2.31 prints the other).
 */
facet_status facet_roughness_from_ellipse(const facet_ellipse *e, double slope_x, double slope_y,
                                          facet_roughness *r)
{
    if (!(e->alpha_1 >= FACET_ALPHA_MIN && e->alpha_1 <= FACET_ALPHA_MAX)) return FACET_BAD_ALPHA;
    if (!(e->alpha_2 >= FACET_ALPHA_MIN && e->alpha_2 <= FACET_ALPHA_MAX)) return FACET_BAD_ALPHA;
    if (!isfinite(e->phi)) return FACET_BAD_ALPHA;
    double c = cos(e->phi), s = sin(e->phi), a1 = e->alpha_1, a2 = e->alpha_2;
    double ax = hypot(a1 * c, a2 * s), ay = hypot(a1 * s, a2 * c);
    *r = (facet_roughness){ .alpha_x = ax, .alpha_y = ay, .slope_x = slope_x, .slope_y = slope_y,
                            .rho = (a2 - a1) * (a2 + a1) * c * s / (ax * ay) };
    return facet_roughness_check(r);
}

/* alpha_2 by the determinant (2.33 cancels), phi by atan2 (2.34 is 0/0 at rho = 0). */
facet_ellipse facet_roughness_to_ellipse(const facet_roughness *r)
{
    double ax = r->alpha_x, ay = r->alpha_y;
    double difference = (ax - ay) * (ax + ay), cross = 2 * r->rho * ax * ay;
    double a1 = sqrt(0.5 * (ax * ax + ay * ay + hypot(difference, cross)));
    double det = ax * ay * sqrt((1 - r->rho) * (1 + r->rho));
    double phi = difference == 0 && cross == 0 ? 0 : -0.5 * atan2(cross, difference);
    return (facet_ellipse){ a1, det / a1, phi };
}
