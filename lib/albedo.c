/*
 * albedo.c - albedo of a direction by nested adaptive quadrature over standard slopes.
 *
 * With D = P N^2/det and d omega_i = 4 q det/N^2 dx dy (albedo_ray.h),
 *   albedo = integral of (fr cos theta_i / D) 4 q P dx dy
 * over the slopes whose wi is lit.  fr cos/D holds masking and Fresnel alone: it does
 * not feel the rounding of wi that D does when alpha is small, and the peak P of
 * the mirror direction always has width 1.  Polar coordinates, with u = r/(b + r).
 */
#include "albedo_material.h"

#include <math.h>
#include <stdlib.h>

enum { POINTS = ALBEDO_POINTS, RADIUS_PANELS = 200, ANGLE_PANELS = 600 };
/* Breaks of a ray beside those of the Fresnel term. */
enum { RAY_BREAKS = 16 };

/* What the rays may contribute to the error that their integral is allowed. */
#define INNER_SHARE 0.4

struct albedo {
    struct albedo_material m;
    double *breaks, *pieces; /* in u, and 0, 1, 2 .. */
    struct integrate_panel *radius, *angle;
    /* Of the direction at hand: */
    struct albedo_view view;
    bool behind;
    double absolute[3], relative;
    /* Of the ray at hand: */
    struct albedo_ray ray;
};

/* ---- One ray --------------------------------------------------------------------- */

struct batch {
    struct albedo_pairs pairs;
    double r[POINTS], factor[POINTS];
};

/*
 * u at t, piece j of the ray lying over [j, j + 1]; with roots by a step that is
 * flat at the ends of the piece, which makes them smooth.
 */
static double u_of(const struct albedo *a, double t, double *du_dt)
{
    size_t j = (size_t)t;
    double low = a->breaks[j], width = a->breaks[j + 1] - low, f = t - (double)j;
    *du_dt = width * (a->m.has_root ? 6 * f * (1 - f) : 1);
    return low + width * (a->m.has_root ? f * f * (3 - 2 * f) : f);
}

/* The pair and the standard normal of slope r on the ray; factor: what multiplies fr cos/D. */
static void place(const struct albedo *a, double t, struct batch *k, int i)
{
    const struct albedo_ray *ray = &a->ray;
    const facet_roughness *m = &a->m.surface.roughness;
    double du_dt, u = u_of(a, t, &du_dt), r = a->m.scale * u / (1 - u);
    double x = m->slope_x + ray->dx * r, y = m->slope_y + ray->dy * r;
    double n = 1 + x * x + y * y, q = ray->c - ray->g * r, twice = 2 * q / n;
    k->pairs.ix[i] = -x * twice - a->view.x;
    k->pairs.iy[i] = -y * twice - a->view.y;
    k->pairs.iz[i] = twice - a->view.z;
    k->pairs.ox[i] = a->view.x;
    k->pairs.oy[i] = a->view.y;
    k->pairs.oz[i] = a->view.z;
    k->r[i] = r;
    k->factor[i] = 4 * q * r * a->m.scale / ((1 - u) * (1 - u)) * du_dt;
    if (a->behind) k->factor[i] *= a->m.det / (n * n);
}

static facet_status along_radius(void *user, const double at[POINTS], struct integral of[POINTS])
{
    struct albedo *a = user;
    struct batch k;
    double p[POINTS];
    for (int i = 0; i < POINTS; i++) place(a, at[i], &k, i);
    facet_status status = facet_albedo_evaluate(&a->m, &k.pairs);
    if (!status) status = facet_albedo_density(&a->m, k.r, a->ray.cosine, a->ray.sine, p);
    if (status) return status;
    for (int i = 0; i < POINTS; i++) {
        double d = k.pairs.d[i], share = a->behind ? 1 : d > 0 ? p[i] / d : 0;
        for (size_t c = 0; c < a->m.channels; c++) {
            double value = k.pairs.fr_cos[c][i] * (share * k.factor[i]);
            of[i].value[c] = isfinite(value) ? value : 0;
            of[i].error[c] = isfinite(value) ? 0 : INFINITY;
        }
    }
    return FACET_OK;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* In u, ascending, with the ends of the lit part; returns how many. */
static size_t ray_breaks(const struct albedo *a, double low, double high)
{
    double r[5], phi, *to = a->breaks;
    size_t count = 0, n = 0;
#define KEEP(found)                                                                                \
    for (n = (found); n-- > 0;)                                                                    \
        if (r[n] > low && r[n] < high) to[count++] = r[n]
    for (size_t i = 0; i < a->m.kinks; i++) KEEP(facet_albedo_ray_cosine(&a->ray, a->m.kink[i], r));
    if (!a->m.is_central) KEEP(facet_albedo_ray_edge(&a->ray, r));
    if (a->m.material.masking == FACET_VGROOVE) KEEP(facet_albedo_ray_vgroove(&a->ray, r));
#undef KEEP
    double pole = facet_albedo_pole(&a->m.surface, &a->view, &phi);
    if ((a->m.surface.is_rough || a->m.surface.is_careful) && pole > low && pole < high)
        to[count++] = pole;
    to[count++] = low;
    to[count++] = high;
    qsort(to, count, sizeof *to, ascending);
    size_t kept = 0;
    for (size_t i = 0; i < count; i++) {
        double u = to[i] / (a->m.scale + to[i]);
        if (kept == 0 || u > to[kept - 1]) to[kept++] = u;
    }
    return kept;
}

static facet_status integrate_ray(struct albedo *a, double phi, struct integral *sum)
{
    double low, high;
    *sum = (struct integral){{0}, {0}};
    facet_status status = facet_albedo_ask(&a->m);
    if (status) return status;
    a->ray = facet_albedo_ray_of(&a->m.surface, &a->view, phi);
    if (!facet_albedo_ray_lit(&a->ray, &a->view, &low, &high)) return FACET_OK;
    double end = ALBEDO_SLOPE_END * fmin(a->m.scale, 1);
    if (a->m.material.ndf == FACET_BECKMANN) {
        double v = a->view.c < 0 ? a->view.c / hypot(a->view.a, a->view.b) : 0;
        end = hypot(v, ALBEDO_BECKMANN_END);
    }
    high = fmin(high, end);
    if (!(high > low)) return FACET_OK;
    size_t count = ray_breaks(a, low, high);
    struct integrate rule = {.fn = along_radius,
                             .user = a,
                             .values = a->m.channels,
                             .relative = a->relative,
                             .panel = a->radius,
                             .panels = RADIUS_PANELS + count,
                             .budget = &a->m.budget};
    for (size_t c = 0; c < a->m.channels; c++) rule.absolute[c] = a->absolute[c];
    return facet_integrate(&rule, a->pieces, count, sum);
}

/* ---- One direction ------------------------------------------------------------------ */

static facet_status around(void *user, const double at[POINTS], struct integral of[POINTS])
{
    struct albedo *a = user;
    facet_status status = FACET_OK;
    for (int i = 0; i < POINTS && !status; i++) status = integrate_ray(a, at[i], &of[i]);
    return status;
}

/* All rays, to the absolute errors of target (NULL: to `relative` of the sum). */
static facet_status integrate_rays(struct albedo *a, const double target[3], double relative,
                                   struct integral *sum)
{
    double phi[ALBEDO_AZIMUTHS_MAX];
    size_t count = facet_albedo_azimuths(&a->m.surface, &a->view, a->m.half, phi);
    struct integrate rule = {.fn = around,
                             .user = a,
                             .values = a->m.channels,
                             .relative = target ? 0 : relative,
                             .panel = a->angle,
                             .panels = ANGLE_PANELS,
                             .budget = &a->m.budget};
    a->relative = target ? 0 : INNER_SHARE * relative;
    for (size_t c = 0; c < a->m.channels; c++) {
        rule.absolute[c] = fmax(target ? target[c] : 0, FACET_FLOOR * 1e-3);
        a->absolute[c] = INNER_SHARE * rule.absolute[c] / (phi[count - 1] - phi[0]);
    }
    return facet_integrate(&rule, phi, count, sum);
}

static bool is_blind(const struct albedo *a)
{
    double v = -a->view.c / hypot(a->view.a, a->view.b);
    return a->m.material.ndf != FACET_GGX && v > ALBEDO_BLIND;
}

/* To a relative error, by way of the size. */
static facet_status integrate_to(struct albedo *a, double tolerance, struct integral *sum)
{
    struct integral rough;
    facet_status status = integrate_rays(a, NULL, ALBEDO_ROUGH, &rough);
    for (int round = 0; round < 3 && !status; round++) {
        bool fits = true; /* was the size right that the rays went by? */
        double target[3] = {0};
        for (size_t c = 0; c < a->m.channels; c++) target[c] = 0.5 * tolerance * rough.value[c];
        status = integrate_rays(a, target, 0, sum);
        for (size_t c = 0; c < a->m.channels; c++)
            fits = fits && sum->value[c] >= 0.6 * rough.value[c];
        rough = *sum;
        if (fits) break;
    }
    return status;
}

static facet_status integrate_direction(struct albedo *a, double x, double y, double z,
                                        double tolerance, facet_albedo_value *out)
{
    struct integral sum = {{0}, {0}};
    *out = (facet_albedo_value){{0}, {0}};
    if (!(z > 0)) return FACET_OK;
    a->view = facet_albedo_view_of(&a->m.surface, x, y, z);
    a->m.condition = 1;
    a->m.depth = (facet_depth){0, 0, 0};
    a->behind = a->m.material.ndf != FACET_GGX &&
                -a->view.c > ALBEDO_BEHIND * hypot(a->view.a, a->view.b);
    facet_status status = integrate_to(a, tolerance, &sum);
    for (size_t c = 0; c < a->m.channels; c++) {
        double both = a->m.half ? 2 : 1;
        out->value[c] = both * sum.value[c];
        out->error[c] = both *
                        (sum.error[c] + fabs(sum.value[c]) * facet_albedo_evaluation_bound(&a->m));
        if (is_blind(a)) out->error[c] = INFINITY;
    }
    return status;
}

/* ---- Open and close ---------------------------------------------------------------------- */

static bool allocate(struct albedo *a)
{
    size_t breaks = 2 * a->m.kinks + RAY_BREAKS;
    a->breaks = malloc(2 * breaks * sizeof *a->breaks);
    a->pieces = a->breaks ? a->breaks + breaks : NULL;
    for (size_t i = 0; i < breaks && a->pieces; i++) a->pieces[i] = (double)i;
    a->radius = malloc((RADIUS_PANELS + breaks) * sizeof *a->radius);
    a->angle = malloc(ANGLE_PANELS * sizeof *a->angle);
    return a->breaks && a->radius && a->angle;
}

static void close_albedo(struct albedo *a)
{
    facet_albedo_close(&a->m);
    free(a->breaks);
    free(a->radius);
    free(a->angle);
    free(a);
}

facet_status facet_albedo(const facet_material *material, facet_vec3_in wo, size_t n,
                          const facet_albedo_options *options, facet_albedo_value *albedo,
                          size_t *evaluations)
{
    struct albedo *a = calloc(1, sizeof *a);
    if (!a) return FACET_NO_MEMORY;
    facet_status status = facet_albedo_open(&a->m, material, options);
    if (!status && !allocate(a)) status = FACET_NO_MEMORY;
    for (size_t i = 0; i < n && !status; i++) {
        a->m.budget = options->evaluations_max;
        status = integrate_direction(a, wo.x[i], wo.y[i], wo.z[i], options->tolerance, &albedo[i]);
        facet_albedo_be_modest(&a->m, options->tolerance, &albedo[i]);
    }
    if (evaluations) *evaluations = a->m.spent;
    close_albedo(a);
    return status;
}
