/* slope_lines.c - psi of a distribution that is not radial by its density along lines: every term
 * is positive. */
#include "gauss.h"
#include "slope_sheet.h"
#include "slope_turned.h"

#include <math.h>

#define PI 3.14159265358979323846

static double density(const struct kernel_table *table, double x, double y)
{
    double b = table->slope_scale, r = sqrt(x * x + y * y), near = b / (b + r),
           azimuth = atan2(y, x) / PI;
    if (azimuth < 0) azimuth += 1;
    return exp(slope_sheet_at(table->turned_q, r / (b + r), azimuth)) * (near * near) *
           (near * near);
}

/* Lines across one azimuth, and where to look along them: about `centre` of the distance, out by
 * tangents. */
struct lines {
    const struct kernel_table *table;
    double cos, sin, centre, width, along;
    size_t points;
    double tangent[SLOPE_POINTS_MAX];
};

static struct lines open_lines(const struct kernel_table *table, struct slope_spread f,
                               double azimuth, size_t points)
{
    struct lines l = {
        .table = table, .cos = cos(PI * azimuth), .sin = sin(PI * azimuth), .points = points};
    double xx = l.cos * l.cos * f.xx + 2 * l.cos * l.sin * f.xy + l.sin * l.sin * f.yy;
    double xy = l.cos * l.sin * (f.yy - f.xx) + (l.cos - l.sin) * (l.cos + l.sin) * f.xy,
           least = 1e-6 * (f.xx + f.yy);
    xx = fmax(xx, least);
    l.along = sqrt(xx);
    l.centre = xy / xx;
    l.width = sqrt(fmax(f.xx * f.yy - f.xy * f.xy, least * least) / xx);
    for (size_t k = 0; k < points; k++)
        l.tangent[k] = tan(PI * (((double)k + 0.5) / (double)points - 0.5));
    return l;
}

/* The density of the component x: GGX needs two points here, whatever its ellipse. */
static double marginal(const struct lines *l, double x)
{
    double width = l->width * hypot(1, x / l->along), sum = 0;
    for (size_t k = 0; k < l->points; k++) {
        double t = l->tangent[k], y = l->centre * x + width * t;
        sum += density(l->table, l->cos * x - l->sin * y, l->sin * x + l->cos * y) * (1 + t * t);
    }
    return sum * width * PI / (double)l->points;
}

void facet_slope_psi(const struct kernel_table *table, struct slope_spread spread, double azimuth,
                     size_t cells, size_t points, double *psi)
{
    enum { POINTS = 4 };
    double node[POINTS], weight[POINTS], b = table->slope_scale, h = 1 / (double)cells, mass = 0,
                                         next = 0;
    struct lines l = open_lines(table, spread, azimuth, points);
    facet_gauss_legendre(POINTS, node, weight);
    psi[cells] = 0;
    for (size_t i = cells; i-- > 0;) {
        double u0 = (double)i * h, v = b * u0 / (1 - u0), inside = 0;
        psi[i] = psi[i + 1] + (i + 1 < cells ? mass * (next - v) : 0);
        for (int k = 0; k < POINTS; k++) {
            double u = u0 + h * node[k], rest = 1 - u, x = b * u / rest,
                   p = h * weight[k] * b / (rest * rest) * marginal(&l, x);
            psi[i] += p * (x - v);
            inside += p;
        }
        mass += inside;
        next = v;
    }
}

/* P = scale^4 exp(log_q(1)) / r^4 there. */
double facet_slope_psi_limit(const struct kernel_table *table, double azimuth)
{
    enum { POINTS = 256 };
    double b = table->slope_scale, sum = 0;
    for (int k = 0; k < POINTS; k++) {
        double t = (k + 0.5) / POINTS - 0.5, at = azimuth + t, c = cos(PI * t);
        sum += exp(slope_sheet_at(table->turned_q, 1, at - floor(at))) * c * c;
    }
    return b * b * b * b / 2 * sum * PI / POINTS;
}
