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

/* The rule integrates exp to 1e-9 where the logarithm varies by no more; to so many parts. */
#define VARIATION 1.0
enum { PARTS_MAX = 64 };

static int parts_of(const double line[4], double t0, double t1)
{
    double y0 = slope_cubic_at(line, t0), y1 = slope_cubic_at(line, (t0 + t1) / 2),
           y2 = slope_cubic_at(line, t1),
           variation = fmax(fabs(y2 - y0), fmax(fabs(y1 - y0), fabs(y2 - y1)));
    return (int)fmin(PARTS_MAX, fmax(1, ceil(variation / VARIATION)));
}

struct slope_tail facet_slope_tail_add(const struct kernel_table *table, double azimuth, double u0,
                                       double u1, struct slope_tail tail)
{
    double cells = (double)table->turned_q.cells, line[4];
    size_t i = (size_t)fmin(cells * ((u0 + u1) / 2), cells - 1);
    slope_sheet_line(table->turned_q, i, azimuth, line);
    int parts = parts_of(line, u0 * cells - (double)i, u1 * cells - (double)i);
    double h = (u1 - u0) / parts;
    for (int part = parts; part-- > 0;) {
        tail.g += h * tail.n;
        for (int k = 0; k < POINTS; k++) {
            double along = h * node[k], u = u0 + h * part + along,
                   q = h * gauss[k] * u * exp(slope_cubic_at(line, u * cells - (double)i));
            tail.n += q;
            tail.g += along * q;
        }
    }
    return tail;
}

static void fill_row(struct slope_rays *rays, const struct kernel_table *table, size_t j)
{
    size_t cells = rays->cells, first = j * (cells + 1);
    double *mass = rays->mass + first, *moment = rays->moment + first,
           azimuth = (double)j / (double)rays->rows, n = (double)cells;
    struct slope_tail *tail = rays->tail + first;
    mass[0] = moment[0] = 0;
    for (size_t i = 0; i < cells; i++) {
        struct ray_sums sums = integrate(table, azimuth, (double)i / n, ((double)i + 1) / n);
        mass[i + 1] = mass[i] + sums.mass;
        moment[i + 1] = moment[i] + sums.moment;
    }
    tail[cells] = (struct slope_tail){0, 0};
    for (size_t i = cells; i-- > 0;)
        tail[i] = facet_slope_tail_add(table, azimuth, (double)i / n, ((double)i + 1) / n,
                                       tail[i + 1]);
}

struct slope_rays *facet_slope_rays_create(const struct kernel_table *table, size_t rows)
{
    size_t cells = table->turned_q.cells, knots = rows * (cells + 1);
    struct slope_rays *rays = malloc(sizeof *rays + 4 * knots * sizeof *rays->numbers);
    if (!rays) return NULL;
    rays->rows = rows;
    rays->cells = cells;
    rays->mass = rays->numbers;
    rays->moment = rays->numbers + knots;
    rays->tail = (struct slope_tail *)(rays->numbers + 2 * knots);
    for (size_t j = 0; j < rows; j++) fill_row(rays, table, j);
    return rays;
}

/* ---- One view ------------------------------------------------------------------------------- */

/* Where along a ray the normals turn away, or, from behind, begin to be seen: c + g r = 0. */
static double end_of(const struct kernel_table *table, double c, double g)
{
    double b = table->slope_scale;
    if (c <= 0) return g > 0 ? c / (c - b * g) : 1;
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

/* The integral from u on along a row that is seen from behind. */
static double beyond(const struct slope_ray_view *v, size_t row, double g, double u)
{
    double b = v->table->slope_scale, cells = (double)v->rays->cells;
    size_t i = cell_of(v->rays, u);
    if (u >= 1) return 0;
    struct slope_tail tail = facet_slope_tail_add(
        v->table, (double)row / (double)v->rays->rows, u, ((double)i + 1) / cells,
        v->rays->tail[row * (v->rays->cells + 1) + i + 1]);
    return g * b * b * b * tail.g / (1 - u);
}

/* The integral along a ray that is a row. */
static double along_row(const struct slope_ray_view *v, size_t k)
{
    const struct slope_rays *rays = v->rays;
    size_t row = k % rays->rows, knots = rays->cells + 1;
    double turn = (double)k / (double)rays->rows, g = v->s * cos(FACET_PI * (turn - v->psi)),
           end = end_of(v->table, v->c, g);
    const double *mass = rays->mass + row * knots, *moment = rays->moment + row * knots;
    if (v->c <= 0) return beyond(v, row, g, end);
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
    const double *d = v->density;
    v->table = table;
    v->rays = rays;
    v->c = c, v->s = s, v->psi = psi;
    for (size_t k = 0; k < n; k++) v->density[k] = fmax(along_row(v, k), 0);
    v->below[0] = 0;
    for (size_t k = 0; k < n; k++) { /* the integral of the polynomial through six of them */
        double inner = d[k] + d[(k + 1) % n], middle = d[(k + n - 1) % n] + d[(k + 2) % n],
               outer = d[(k + n - 2) % n] + d[(k + 3) % n];
        v->below[k + 1] = v->below[k] + fmax(802 * inner - 93 * middle + 11 * outer, 0) / 1440;
    }
}

/* ---- One draw ------------------------------------------------------------------------------- */

/* Of the CDF between two rows, over its rise: its derivatives at both ends. */
struct rise {
    double m0, m1, a0, a1;
};

/* Where those of the second order are not small they are the cubic's, made monotone. */
static struct rise rise_of(const struct slope_ray_view *v, size_t k)
{
    size_t n = 2 * v->rays->rows;
    const double *d = v->density;
    double rise = v->below[k + 1] - v->below[k], before = d[(k + n - 1) % n], d0 = d[k],
           d1 = d[(k + 1) % n], after = d[(k + 2) % n];
    struct rise r = {fmin(d0 / rise, 3), fmin(d1 / rise, 3),
                     (8 * (d1 - before) - (after - d[(k + n - 2) % n])) / (12 * rise),
                     (8 * (after - d0) - (d[(k + 3) % n] - before)) / (12 * rise)};
    if (fabs(r.a0) <= 1 && fabs(r.a1) <= 1) return r;
    r.a0 = 6 - 4 * r.m0 - 2 * r.m1;
    r.a1 = -6 + 2 * r.m0 + 4 * r.m1;
    return r;
}

/* t in [0, 1] where the polynomial of degree 5 that has these is `target`. */
static double invert_rise(struct rise r, double target)
{
    double low = 0, high = 1, t = target;
    double c2 = r.a0 / 2, c3 = 10 - 6 * r.m0 - 4 * r.m1 - 1.5 * r.a0 + r.a1 / 2,
           c4 = -15 + 8 * r.m0 + 7 * r.m1 + 1.5 * r.a0 - r.a1,
           c5 = 6 - 3 * r.m0 - 3 * r.m1 - (r.a0 - r.a1) / 2;
    for (int step = 0; step < 60; step++) {
        double y = t * (r.m0 + t * (c2 + t * (c3 + t * (c4 + t * c5)))) - target,
               slope = r.m0 + t * (2 * c2 + t * (3 * c3 + t * (4 * c4 + t * 5 * c5)));
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
    double rise = v->below[low + 1] - v->below[low],
           t = rise > 0 ? invert_rise(rise_of(v, low), (target - v->below[low]) / rise) : 0.5;
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

/* From behind: cell by cell, twice, for they need not fall. */
static double draw_beyond(const struct ray *ray, double u2)
{
    const struct slope_rays *rays = ray->view->rays;
    double cells = (double)rays->cells, start = end_of(ray->view->table, ray->view->c, ray->g),
           sum = 0;
    size_t first = cell_of(rays, start), i = first;
    for (; i < rays->cells; i++)
        sum += fmax(within(ray, fmax(start, (double)i / cells), ((double)i + 1) / cells), 0);
    double target = u2 * sum, from = start, mass = 0;
    for (i = first; i < rays->cells; i++, target -= mass) {
        from = fmax(start, (double)i / cells);
        mass = fmax(within(ray, from, ((double)i + 1) / cells), 0);
        if (mass > target || i + 1 == rays->cells) break;
    }
    double share = mass > 0 ? fmax(0, fmin(1, target / mass)) : 0;
    return invert_within(ray, from, ((double)i + 1) / cells, share);
}

static double draw_along(const struct ray *ray, double u2)
{
    const struct slope_ray_view *v = ray->view;
    double cells = (double)v->rays->cells, end = end_of(v->table, v->c, ray->g);
    size_t last = cell_of(v->rays, end), low = 0, high = last + 1;
    double tail = within(ray, (double)last / cells, end), target = u2 * (up_to(ray, last) + tail);
    while (high - low > 1) {
        size_t middle = (low + high) / 2;
        *(up_to(ray, middle) <= target ? &low : &high) = middle;
    }
    double start = up_to(ray, low), mass = low == last ? tail : up_to(ray, low + 1) - start;
    double share = mass > 0 ? fmax(0, fmin(1, (target - start) / mass)) : 0;
    return invert_within(ray, (double)low / cells, low == last ? end : ((double)low + 1) / cells,
                         share);
}

struct slope_ray_place facet_slope_ray_draw(const struct slope_ray_view *v, double u1, double u2)
{
    double turn = draw_turn(v, u1);
    struct ray ray = ray_at(v, turn);
    double u = v->c > 0 ? draw_along(&ray, u2) : draw_beyond(&ray, u2);
    return (struct slope_ray_place){FACET_PI * turn, u,
                                    exp(slope_sheet_at(v->table->turned_q, u, ray.azimuth))};
}
