/*
 * table_sample.c - draws from tabulated distributions: visible normals (Heitz & d'Eon 2014, supplement, section 5, by exact
 * inversion in place of its tables) and all normals (Walter et al. 2007).
 *
 * One search and a few Newton steps per sample do not vectorise: scalar, in double.
 */
#include "table_sample.h"

#include "brdf.h"
#include "slope_quantile.h"
#include "slope_rays.h"
#include "slope_sheet.h"
#include "slope_table.h"

#include <float.h>
#include <math.h>

struct viewer {
    double x, y, z;
    double a, b, s, c; /* the stretched direction (masking.h's) */
};

static struct viewer viewer_at(const struct kernel_surface *f, const struct kernel_job *job,
                               size_t k)
{
    struct viewer o = {.x = ((const double *)job->wo[0])[k],
                       .y = ((const double *)job->wo[1])[k],
                       .z = ((const double *)job->wo[2])[k]};
    o.a = f->alpha_x * o.x + f->rho_alpha_y * o.y;
    o.b = f->kappa_alpha_y * o.y;
    o.s = hypot(o.a, o.b);
    o.c = facet_mean_cosine(f, o.x, o.y, o.z);
    return o;
}

/* A standard normal, not of length 1, and exp(log_q) there. */
struct drawn {
    double x, y, z, q;
};

/* The affine map, reflection, and the density D/area (D h_z/(4 wo.h) where area is 0: all normals). */
static void put(const struct kernel_surface *f, const struct kernel_job *job, size_t k,
                struct viewer o, struct drawn m, double area)
{
    double hx = f->alpha_x * m.x - f->slope_x * m.z;
    double hy = f->rho_alpha_y * m.x + f->kappa_alpha_y * m.y - f->slope_y * m.z;
    double largest = fmax(fmax(fabs(hx), fabs(hy)), m.z), scale = largest > 0 ? 1 / largest : 0;
    double h[3] = {hx * scale, hy * scale, largest > 0 ? m.z * scale : 1};
    double hh = h[0] * h[0] + h[1] * h[1] + h[2] * h[2], length = sqrt(hh);
    double dot = o.x * h[0] + o.y * h[1] + o.z * h[2], twice = 2 * dot / hh;
    const double wo[3] = {o.x, o.y, o.z};
    for (int j = 0; j < 3; j++) {
        ((double *)job->sampled_wi[j])[k] = twice * h[j] - wo[j];
        if (job->sampled_h[0]) ((double *)job->sampled_h[j])[k] = h[j] / length;
    }
    if (!job->sampled_pdf) return;
    double size = largest * largest * hh / f->root_det, d = size * size * m.q;
    double share = area > 0 ? area : 4 * fabs(dot) / h[2];
    double pdf = share > 0 ? fmin(d / share, DBL_MAX) : 0;
    ((double *)job->sampled_pdf)[k] = d > 0 ? pdf : 0;
}

static struct slope_share share_at(const struct kernel_job *job, int which, size_t k)
{
    double u = ((const double *)job->u[which])[k];
    return (struct slope_share){u, 1 - u};
}

/* Where no visible normal has a density that a double holds: any that are seen will do. */
static struct drawn towards(struct viewer o)
{
    if (!(o.s > 0)) return (struct drawn){1, 0, 0, 0};
    return (struct drawn){o.a / o.s, o.b / o.s, 0, 0};
}

static struct drawn visible(const struct slope_view *view, struct viewer o, struct slope_share u1,
                            struct slope_share u2)
{
    if (!(view->sigma > 0)) return towards(o);
    double b = view->pieces->scale;
    struct slope_place ring = facet_slope_ring(view, u1);
    double radius = b * ring.u, ca = o.s > 0 ? o.a / o.s : 1, cb = o.s > 0 ? o.b / o.s : 0;
    struct slope_turn turn = facet_slope_along_ring(o.c * ring.rest, o.s * radius, u2);
    double along = radius * turn.cos, across = radius * turn.sin;
    return (struct drawn){along * ca - across * cb, along * cb + across * ca, ring.rest,
                          exp(ring.log_q)};
}

/* One view after the other; what it needs of the table is found once where it stays the same. */
static size_t draw_table(const struct kernel_surface *f, const struct kernel_job *job, size_t n)
{
    const struct slope_pieces *pieces = &((const facet_slope_table *)f->table)->pieces;
    struct slope_view view = {.c = NAN};
    for (size_t k = 0; k < n; k++) {
        struct viewer o = viewer_at(f, job, k);
        if (!(view.c == o.c && view.s == o.s)) facet_slope_view(pieces, o.c, o.s, &view);
        struct drawn m = visible(&view, o, share_at(job, 0, k), share_at(job, 1, k));
        put(f, job, k, o, m, 4 * fmax(view.sigma, DBL_MIN));
    }
    return 0;
}

static size_t draw_any(const struct kernel_surface *f, const struct kernel_job *job, size_t n)
{
    const struct slope_pieces *pieces = &((const facet_slope_table *)f->table)->pieces;
    for (size_t k = 0; k < n; k++) {
        struct slope_place ring = facet_slope_any_ring(pieces, share_at(job, 0, k));
        double turn = 2 * acos(-1) * ((const double *)job->u[1])[k],
               radius = pieces->scale * ring.u;
        struct drawn m = {radius * cos(turn), radius * sin(turn), ring.rest, exp(ring.log_q)};
        put(f, job, k, viewer_at(f, job, k), m, 0);
    }
    return 0;
}

/* ---- Over the azimuth --------------------------------------------------------------------------- */

static double turned_sigma(const struct kernel_table *table, struct viewer o, double azimuth)
{
    double length = table->psi_scale * o.s, whole = fmax(length + fabs(o.c), DBL_MIN);
    return fmax(o.c, 0) +
           length * (length / whole) * exp(slope_log_psi_at(table, fabs(o.c) / whole, azimuth));
}

static struct drawn turned(const struct slope_ray_view *view, const struct kernel_job *job,
                           size_t k)
{
    struct slope_ray_place p = facet_slope_ray_draw(view, ((const double *)job->u[0])[k],
                                                    ((const double *)job->u[1])[k]);
    double radius = view->table->slope_scale * p.u;
    return (struct drawn){radius * cos(p.azimuth), radius * sin(p.azimuth), 1 - p.u, p.q};
}

static size_t draw_turned(const struct kernel_surface *f, const struct kernel_job *job, size_t n)
{
    const struct slope_rays *rays = facet_slope_table_rays((const facet_slope_table *)f->table);
    struct slope_ray_view view = {.c = NAN};
    for (size_t k = 0; k < n; k++) {
        struct viewer o = viewer_at(f, job, k);
        double azimuth = atan2(o.b, o.a) / acos(-1);
        if (!(view.c == o.c && view.s == o.s && view.psi == azimuth))
            facet_slope_ray_view(f->table, rays, o.c, o.s, azimuth, &view);
        struct drawn m = view.below[2 * rays->rows] > 0 ? turned(&view, job, k) : towards(o);
        double sigma = turned_sigma(f->table, o, azimuth - floor(azimuth));
        put(f, job, k, o, m, 4 * fmax(sigma, DBL_MIN));
    }
    return 0;
}

static size_t draw_any_turned(const struct kernel_surface *f, const struct kernel_job *job,
                              size_t n)
{
    struct slope_ray_view view;
    facet_slope_ray_view(f->table, facet_slope_table_rays((const facet_slope_table *)f->table), 1,
                         0, 0, &view);
    for (size_t k = 0; k < n; k++) put(f, job, k, viewer_at(f, job, k), turned(&view, job, k), 0);
    return 0;
}

kernel_sample_fn *facet_table_draw(facet_sampler sampler, bool is_turned)
{
    switch (sampler) {
    case FACET_SAMPLER_TABLE: return is_turned ? draw_turned : draw_table;
    case FACET_SAMPLER_NDF: return is_turned ? draw_any_turned : draw_any;
    default: return NULL;
    }
}
