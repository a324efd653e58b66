#include "ellipse_rows.h"

#include "check.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

/* D of an ellipse at tan theta = r along phi; up to a factor that the table takes out. */
static double log_ellipse(facet_ndf ndf, const facet_roughness *a, double u, double scale,
                          double phi)
{
    double x = cos(phi) / a->alpha_x,
           y = (sin(phi) / a->alpha_y - a->rho * x) / sqrt((1 - a->rho) * (1 + a->rho));
    double k = x * x + y * y, r = scale * u / (1 - u);
    if (u == 1) return ndf == FACET_GGX ? -2 * log(k) : -1e4;
    return 2 * log1p(r * r) - (ndf == FACET_GGX ? 2 * log1p(r * r * k) : r * r * k);
}

double ellipse_rows_scale(const facet_roughness *ellipse)
{
    return 1.5 * sqrt(ellipse->alpha_x * ellipse->alpha_y);
}

facet_slope_table *ellipse_rows(facet_ndf ndf, const facet_roughness *a, size_t n, size_t turns)
{
    double *log_d = malloc(n * turns * sizeof *log_d), scale = ellipse_rows_scale(a);
    facet_slope_table *table = NULL;
    for (size_t k = 0; k < n * turns; k++)
        log_d[k] = log_ellipse(ndf, a, (double)(k % n) / (double)(n - 1), scale,
                               PI * (double)(k / n) / (double)turns);
    CHECK_INT(facet_slope_table_create_turned(scale, log_d, n, turns, NULL, &table), FACET_OK);
    free(log_d);
    return table;
}
