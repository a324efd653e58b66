/* reference_ellipse.c - a roughness beside the ellipse it was made from. */
#include "reference.h"

#include <quadmath.h>

/* [xx xy; xy yy] = R diag(alpha_1^2, alpha_2^2) R^T, the major axis at -phi. */
struct shape {
    quad xx, yy, xy;
};

static struct shape exact_shape(const facet_ellipse *e)
{
    quad c = cosq(e->phi), s = sinq(-(quad)e->phi), one = (quad)e->alpha_1 * e->alpha_1,
         two = (quad)e->alpha_2 * e->alpha_2;
    return (struct shape){one * c * c + two * s * s, one * s * s + two * c * c,
                          (one - two) * c * s};
}

double reference_shape_error(const facet_roughness *r, const facet_ellipse *e)
{
    struct shape s = exact_shape(e);
    struct reference_roughness a = reference_roughness(r);
    quad det = (quad)e->alpha_1 * e->alpha_1 * e->alpha_2 * e->alpha_2;
    quad xx = fabsq(a.alpha_x * a.alpha_x - s.xx), yy = fabsq(a.alpha_y * a.alpha_y - s.yy);
    quad xy = fabsq(a.rho * a.alpha_x * a.alpha_y - s.xy);
    return (double)((xx * s.yy + yy * s.xx + 2 * xy * fabsq(s.xy)) / (2 * det));
}
