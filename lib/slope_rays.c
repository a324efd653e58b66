#include "slope_rays.h"

#include "gauss.h"
#include "slope_sheet.h"
#include "slope_spline.h"

#include <math.h>
#include <stdlib.h>

enum { POINTS = 4 };

/* The four points' rule on [0, 1]. */
static const double node[POINTS] = {0.0694318442029737124, 0.330009478207571868,
                                    0.669990521792428132, 0.930568155797026288};
static const double gauss[POINTS] = {0.173927422568726929, 0.326072577431273071,
                                     0.326072577431273071, 0.173927422568726929};

/* From u0 to u1, inside one cell, along a ray: of P r dr and of P r^2 dr. */
struct ray_sums {
    double mass, moment;
};

static struct ray_sums integrate(const struct kernel_table *table, double azimuth, double u0,
                                 double u1)
{
    double b = table->slope_scale, h = u1 - u0;
    struct ray_sums sums = {0, 0};
    for (int k = 0; k < POINTS; k++) {
        double u = u0 + h * node[k],
               q = gauss[k] * u * exp(slope_sheet_at(table->turned_q, u, azimuth));
        sums.mass += (1 - u) * q;
        sums.moment += u * q;
    }
    return (struct ray_sums){h * b * b * sums.mass, h * b * b * b * sums.moment};
}

struct slope_rays *facet_slope_rays_create(const struct kernel_table *table, size_t rows)
{
    size_t cells = table->turned_q.cells, knots = cells + 1;
    struct slope_rays *rays = malloc(sizeof *rays + 2 * rows * knots * sizeof *rays->numbers);
    if (!rays) return NULL;
    rays->rows = rows;
    rays->cells = cells;
    rays->mass = rays->numbers;
    rays->moment = rays->numbers + rows * knots;
    for (size_t j = 0; j < rows; j++) {
        double *mass = rays->mass + j * knots, *moment = rays->moment + j * knots;
        mass[0] = moment[0] = 0;
        for (size_t i = 0; i < cells; i++) {
            struct ray_sums sums = integrate(table, (double)j / (double)rows,
                                             (double)i / (double)cells,
                                             ((double)i + 1) / (double)cells);
            mass[i + 1] = mass[i] + sums.mass;
            moment[i + 1] = moment[i] + sums.moment;
        }
    }
    return rays;
}

/* ---- One view ------------------------------------------------------------------------------- */

/* Where along a ray the normals turn away: c + g r = 0. */
static double end_of(const struct kernel_table *table, double c, double g)
{
    double b = table->slope_scale;
    return g < 0 ? c / (c - b * g) : 1; /* r = -c/g */
}

static size_t cell_of(const struct slope_rays *rays, double u)
{
    double x = u * (double)rays->cells;
    return x < (double)rays->cells ? (size_t)x : rays->cells - 1;
}

static double azimuth_of(double turn)
{
    return turn - floor(turn); /* P(-x) = P(x) */
}

/* The integral along a ray that is a row. */
static double along_row(const struct slope_ray_view *v, size_t k)
{
    const struct slope_rays *rays = v->rays;
    size_t row = k % rays->rows, knots = rays->cells + 1;
    double turn = (double)k / (double)rays->rows, g = v->s * cos(FACET_PI * (turn - v->psi)),
           end = end_of(v->table, v->c, g);
    const double *mass = rays->mass + row * knots, *moment = rays->moment + row * knots;
    if (end >= 1) return v->c * mass[rays->cells] + g * moment[rays->cells];
    size_t i = cell_of(rays, end);
    struct ray_sums last = integrate(v->table, azimuth_of(turn), (double)i / (double)rays->cells,
                                     end);
    return v->c * (mass[i] + last.mass) + g * (moment[i] + last.moment);
}

void facet_slope_ray_view(const struct kernel_table *table, const struct slope_rays *rays, double c,
                          double s, double psi, struct slope_ray_view *v)
{
    size_t n = 2 * rays->rows;
    v->table = table;
    v->rays = rays;
    v->c = c, v->s = s, v->psi = psi;
    for (size_t k = 0; k < n; k++) v->density[k] = fmax(along_row(v, k), 0);
    v->below[0] = 0;
    for (size_t k = 0; k < n; k++) { /* the integral of the cubic through four of them */
        double inner = v->density[k] + v->density[(k + 1) % n],
               outer = v->density[(k + n - 1) % n] + v->density[(k + 2) % n];
        v->below[k + 1] = v->below[k] + fmax(13 * inner - outer, 0) / 24;
    }
}

/* ---- One draw ------------------------------------------------------------------------------- */

/* t in [0, 1] where the cubic with these ends and slopes, made monotone, is `target`. */
static double invert_cubic(double y0, double y1, double m0, double m1, double target)
{
    double c[4], low = 0, high = 1, rise = y1 - y0;
    if (!(rise > 0)) return 0.5;
    slope_hermite(0, 1, fmin(m0 / rise, 3), fmin(m1 / rise, 3), c);
    double f = (target - y0) / rise, t = f;
    for (int step = 0; step < 60; step++) {
        double y = c[0] + t * (c[1] + t * (c[2] + t * c[3])) - f,
               slope = c[1] + t * (2 * c[2] + t * 3 * c[3]);
        *(y > 0 ? &high : &low) = t;
        double next = t - y / slope;
        if (!(next > low && next < high)) next = (low + high) / 2;
        if (fabs(next - t) < 1e-16) break;
        t = next;
    }
    return t;
}

static double draw_turn(const struct slope_ray_view *v, double u1)
{
    size_t low = 0, high = 2 * v->rays->rows;
    double target = u1 * v->below[high];
    while (high - low > 1) {
        size_t middle = (low + high) / 2;
        *(v->below[middle] <= target ? &low : &high) = middle;
    }
    double t = invert_cubic(v->below[low], v->below[low + 1], v->density[low],
                            v->density[(low + 1) % (2 * v->rays->rows)], target);
    return ((double)low + t) / (double)v->rays->rows;
}

/* Between rows: Lagrange weights of six of them; four would leave 1.3e-6 in the CDF along a ray. */
enum { ROWS_NEAR = 6 };
struct ray {
    const struct slope_ray_view *view;
    size_t row[ROWS_NEAR];
    double share[ROWS_NEAR], g, azimuth;
};

static struct ray ray_at(const struct slope_ray_view *v, double turn)
{
    size_t rows = v->rays->rows, k = (size_t)(turn * (double)rows);
    double t = turn * (double)rows - (double)k + ROWS_NEAR / 2 - 1;
    struct ray ray = {
        .view = v, .g = v->s * cos(FACET_PI * (turn - v->psi)), .azimuth = azimuth_of(turn)};
    for (size_t j = 0; j < ROWS_NEAR; j++) {
        ray.row[j] = (k + ROWS_NEAR * rows + j - (ROWS_NEAR / 2 - 1)) % rows;
        ray.share[j] = 1;
        for (size_t i = 0; i < ROWS_NEAR; i++)
            if (i != j) ray.share[j] *= (t - (double)i) / ((double)j - (double)i);
    }
    return ray;
}

static double up_to(const struct ray *ray, size_t i)
{
    const struct slope_rays *rays = ray->view->rays;
    double sum = 0;
    for (size_t j = 0; j < ROWS_NEAR; j++) {
        size_t at = ray->row[j] * (rays->cells + 1) + i;
        sum += ray->share[j] * (ray->view->c * rays->mass[at] + ray->g * rays->moment[at]);
    }
    return sum;
}

static double within(const struct ray *ray, double u0, double u1)
{
    struct ray_sums sums = integrate(ray->view->table, ray->azimuth, u0, u1);
    return ray->view->c * sums.mass + ray->g * sums.moment;
}

/* u in [u0, u1], one cell or its start, below which lies this share of it. */
static double invert_within(const struct ray *ray, double u0, double u1, double share)
{
    const struct kernel_table *table = ray->view->table;
    double b = table->slope_scale, low = u0, high = u1, u = u0 + share * (u1 - u0);
    double target = share * within(ray, u0, u1);
    for (int step = 0; step < 60 && target > 0; step++) {
        double y = within(ray, u0, u) - target, rest = 1 - u;
        double slope = b * b * u * exp(slope_sheet_at(table->turned_q, u, ray->azimuth)) *
                       (ray->view->c * rest + ray->g * b * u);
        *(y > 0 ? &high : &low) = u;
        double next = u - y / slope;
        if (!(next > low && next < high)) next = (low + high) / 2;
        if (fabs(next - u) < 1e-15) break;
        u = next;
    }
    return u;
}

struct slope_ray_place facet_slope_ray_draw(const struct slope_ray_view *v, double u1, double u2)
{
    double turn = draw_turn(v, u1), cells = (double)v->rays->cells;
    struct ray ray = ray_at(v, turn);
    double end = end_of(v->table, v->c, ray.g);
    size_t last = cell_of(v->rays, end), low = 0, high = last + 1;
    double tail = within(&ray, (double)last / cells, end), target = u2 * (up_to(&ray, last) + tail);
    while (high - low > 1) {
        size_t middle = (low + high) / 2;
        *(up_to(&ray, middle) <= target ? &low : &high) = middle;
    }
    double start = up_to(&ray, low), mass = low == last ? tail : up_to(&ray, low + 1) - start;
    double share = mass > 0 ? fmax(0, fmin(1, (target - start) / mass)) : 0;
    double u = invert_within(&ray, (double)low / cells,
                             low == last ? end : ((double)low + 1) / cells, share);
    return (struct slope_ray_place){FACET_PI * turn, u,
                                    exp(slope_sheet_at(v->table->turned_q, u, ray.azimuth))};
}
