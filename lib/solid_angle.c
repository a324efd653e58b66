/* solid_angle.c - how much of the incident sphere a sample stands for (Dupuy section 3.4). */
#include "facet_solid_angle.h"

#include <math.h>

void facet_solid_angle(const facet_roughness *roughness, double samples, facet_vec3_in wi,
                       facet_vec3_in wo, size_t n, double *solid_angle)
{
    const double alpha = facet_roughness_to_ellipse(roughness).alpha_1;
    const double area = FACET_PI / samples * alpha * alpha;
    for (size_t i = 0; i < n; i++) {
        const double x = wi.x[i] + wo.x[i], y = wi.y[i] + wo.y[i], z = wi.z[i] + wo.z[i];
        const double length2 = x * x + y * y + z * z, cos3 = fabs(z) * (z * z);
        /* <o,h> = |H|/2 and cos theta_h = H_z/|H|; wi = -wo has no h. */
        solid_angle[i] = length2 > 0 ? 2 * area * (cos3 / length2) : 0;
    }
}
