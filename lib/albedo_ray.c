#include "albedo_ray.h"

#include <math.h>

/* c by its own rounding only: next to c = 0 the shear's terms cancel. */
struct albedo_view facet_albedo_view_of(const struct albedo_surface *s, double x, double y,
                                        double z)
{
    const facet_roughness *r = &s->roughness;
    long double lean = (long double)r->slope_x * x + (long double)r->slope_y * y;
    return (struct albedo_view){
        .x = x,
        .y = y,
        .z = z,
        .a = (double)((long double)r->alpha_x * x + (long double)s->rho_alpha_y * y),
        .b = s->kappa_alpha_y * y,
        .c = (double)(z - lean),
    };
}

struct albedo_ray facet_albedo_ray_of(const struct albedo_surface *s,
                                      const struct albedo_view *view, double phi)
{
    const facet_roughness *r = &s->roughness;
    struct albedo_ray ray = {.cosine = cos(phi), .sine = sin(phi), .c = view->c};
    ray.dx = r->alpha_x * ray.cosine;
    ray.dy = s->rho_alpha_y * ray.cosine + s->kappa_alpha_y * ray.sine;
    ray.g = view->a * ray.cosine + view->b * ray.sine;
    ray.n[0] = 1 + r->slope_x * r->slope_x + r->slope_y * r->slope_y;
    ray.n[1] = 2 * (r->slope_x * ray.dx + r->slope_y * ray.dy);
    ray.n[2] = ray.dx * ray.dx + ray.dy * ray.dy;
    return ray;
}

/* Real roots of k0 + k1 r + k2 r^2, ascending; without cancellation. */
static size_t quadratic(double k0, double k1, double k2, double r[2])
{
    if (k2 == 0) {
        if (k1 == 0) return 0;
        r[0] = -k0 / k1;
        return 1;
    }
    double root2 = k1 * k1 - 4 * k0 * k2;
    if (!(root2 >= 0)) return 0;
    double sum = -0.5 * (k1 + copysign(sqrt(root2), k1));
    double first = sum / k2, second = sum != 0 ? k0 / sum : 0;
    r[0] = fmin(first, second);
    r[1] = fmax(first, second);
    return 2;
}

static double cubic_at(const double k[4], double r)
{
    return k[0] + r * (k[1] + r * (k[2] + r * k[3]));
}

#define ROOT_MAX 1e15

/* Roots in (0, ROOT_MAX) of a cubic, between its extrema by bisection: they only place the panels of a rule. */
static size_t cubic(const double k[4], double r[3])
{
    enum { STEPS = 100 };
    double ends[4] = {0}, extrema[2];
    size_t count = 1, found = 0, n = quadratic(k[1], 2 * k[2], 3 * k[3], extrema);
    for (size_t i = 0; i < n; i++)
        if (extrema[i] > 0) ends[count++] = extrema[i];
    ends[count] = ROOT_MAX;
    for (size_t i = 0; i < count; i++) {
        double low = ends[i], high = ends[i + 1];
        if (cubic_at(k, low) * cubic_at(k, high) > 0) continue;
        for (int step = 0; step < STEPS; step++) {
            double middle = high > 4 * low ? fmax(sqrt(low) * sqrt(high), high / 1024)
                                           : 0.5 * (low + high);
            if (cubic_at(k, low) * cubic_at(k, middle) > 0)
                low = middle;
            else
                high = middle;
        }
        r[found++] = 0.5 * (low + high);
    }
    return found;
}

bool facet_albedo_ray_lit(const struct albedo_ray *ray, const struct albedo_view *view, double *low,
                          double *high)
{
    double r[2], k0 = 2 * ray->c - view->z * ray->n[0], z = view->z;
    if (quadratic(k0, -2 * ray->g - z * ray->n[1], -z * ray->n[2], r) < 2) return false;
    *low = k0 > 0 ? 0 : fmax(r[0], 0);
    *high = r[1];
    return *high > *low;
}

size_t facet_albedo_ray_cosine(const struct albedo_ray *ray, double k, double r[2])
{
    double c = ray->c, g = ray->g;
    return quadratic(c * c - k * ray->n[0], -2 * c * g - k * ray->n[1], g * g - k * ray->n[2], r);
}

/* 2 q (1 + mean.s) = c_o N. */
size_t facet_albedo_ray_edge(const struct albedo_ray *ray, double r[2])
{
    double c = ray->c, g = ray->g, lean = 0.5 * ray->n[1];
    return quadratic(c * ray->n[0], -2 * g * ray->n[0], -2 * g * lean - c * ray->n[2], r);
}

/* cos theta_d - g = z_o sqrt(N), g^2 = n^2 - 1 + cos^2 theta_d: z^2 N - 2 z q + 1 - n^2 = 0. */
size_t facet_albedo_ray_refracted(const struct albedo_ray *ray, const struct albedo_view *view,
                                  double excess, double r[2])
{
    double z = view->z;
    return quadratic(z * z * ray->n[0] - 2 * z * ray->c - excess,
                     z * z * ray->n[1] + 2 * z * ray->g, z * z * ray->n[2], r);
}

/* min(1, 2 c_i/q, 2 c_o/q): 2 c_o = q, c_i = c_o, 2 c_i = q. */
size_t facet_albedo_ray_vgroove(const struct albedo_ray *ray, double r[5])
{
    double c = ray->c, g = ray->g, lean = 0.5 * ray->n[1];
    size_t count = 0;
    if (g != 0) r[count++] = -c / g;
    double bottom = g * lean + c * ray->n[2];
    if (bottom != 0) r[count++] = -(c * lean + g * ray->n[0]) / bottom;
    double k[4] = {c * ray->n[0], -2 * c * lean - 3 * g * ray->n[0],
                   -2 * g * lean - 3 * c * ray->n[2], g * ray->n[2]};
    return count + cubic(k, r + count);
}

double facet_albedo_pole(const struct albedo_surface *s, const struct albedo_view *view,
                         double *phi)
{
    const facet_roughness *m = &s->roughness;
    double scale = -1 / (1 + view->z);
    double x = (view->x * scale - m->slope_x) / m->alpha_x;
    double y = (view->y * scale - m->slope_y - s->rho_alpha_y * x) / s->kappa_alpha_y;
    *phi = atan2(y, x);
    return hypot(x, y);
}

/*
 * Rays that touch the horizon from outside: the discriminant of facet_albedo_ray_lit,
 * (g + z l)^2 + z k0 n2 with g, l linear and n2 quadratic in (cos, sin), vanishes.
 */
static size_t tangents(const struct albedo_surface *s, const struct albedo_view *v, double phi[2])
{
    const facet_roughness *r = &s->roughness;
    double n0 = 1 + r->slope_x * r->slope_x + r->slope_y * r->slope_y,
           k = v->z * (2 * v->c - v->z * n0);
    if (k > 0) return 0;
    double p = v->a + v->z * (r->slope_x * r->alpha_x + r->slope_y * s->rho_alpha_y);
    double q = v->b + v->z * r->slope_y * s->kappa_alpha_y;
    double cc = p * p + k * (r->alpha_x * r->alpha_x + s->rho_alpha_y * s->rho_alpha_y);
    double cs = p * q + k * s->rho_alpha_y * s->kappa_alpha_y;
    double ss = q * q + k * s->kappa_alpha_y * s->kappa_alpha_y;
    double root[2];
    size_t n = quadratic(cc, 2 * cs, ss, root);
    for (size_t i = 0; i < n; i++) phi[i] = atan(root[i]);
    return n;
}

static void insert(double *phi, size_t *count, double first, double turn, double angle)
{
    double offset = fmod(angle - first, 2 * FACET_PI);
    if (offset < 0) offset += 2 * FACET_PI;
    if (offset >= turn) return;
    size_t i = (*count)++;
    for (; i > 0 && phi[i - 1] > first + offset; i--) phi[i] = phi[i - 1];
    phi[i] = first + offset;
}

/*
 * Where grazing light comes in sideways, the far end of the ray passes from about z/side to
 * 1/(z alpha^2) within an angle of z/side times what the slope is worth: graded panels on both sides.
 */
static void grade(double *phi, size_t *count, double plane, double turn, double across,
                  double least)
{
    enum { STEPS = 10 };
    double width = fmax(least, 1e-9);
    insert(phi, count, plane, turn, across);
    for (int i = 0; i < STEPS && width < 0.5; i++, width *= 10) {
        insert(phi, count, plane, turn, across - width);
        insert(phi, count, plane, turn, across + width);
    }
}

size_t facet_albedo_azimuths(const struct albedo_surface *s, const struct albedo_view *v, bool half,
                             double phi[ALBEDO_AZIMUTHS_MAX])
{
    const facet_roughness *r = &s->roughness;
    double plane = v->a != 0 || v->b != 0 ? atan2(v->b, v->a) : 0,
           turn = half ? FACET_PI : 2 * FACET_PI;
    double x = r->alpha_x, y = s->rho_alpha_y, k = s->kappa_alpha_y, pole, touch[2];
    double axis = 0.5 * atan2(2 * y * k, x * x + y * y - k * k), side = hypot(v->a, v->b);
    /* 2 g + z n1 = 0: the end of the ray neither near nor far */
    double p = v->a + v->z * (r->slope_x * x + r->slope_y * y), q = v->b + v->z * r->slope_y * k;
    double level = p != 0 || q != 0 ? atan2(q, p) : 0;
    size_t count = 0;
    for (int i = 0; i < 2; i++) insert(phi, &count, plane, turn, plane + i * FACET_PI);
    for (int i = -1; i <= 1; i += 2)
        grade(phi, &count, plane, turn, level + i * FACET_PI / 2,
              v->z * fmin(1, s->alpha_1) / side);
    if (!half) {
        facet_albedo_pole(s, v, &pole);
        if (s->is_rough || s->is_careful) insert(phi, &count, plane, turn, pole);
        for (int i = 0; i < 4 && (s->is_thin || s->is_careful); i++)
            insert(phi, &count, plane, turn, axis + i * FACET_PI / 2);
        size_t touches = tangents(s, v, touch);
        for (size_t i = 0; i < 2 * touches; i++)
            insert(phi, &count, plane, turn, touch[i / 2] + (i % 2 ? FACET_PI : 0));
    }
    if (v->c < 0) { /* only the tail beyond |c|/side is seen, in a cone that narrow */
        double cone = fmin(8 * side / -v->c, FACET_PI / 4);
        insert(phi, &count, plane, turn, plane + FACET_PI - cone);
        insert(phi, &count, plane, turn, plane + FACET_PI + cone);
    }
    phi[count++] = plane + turn;
    return count;
}
