/*
 * albedo.c - albedo by nested adaptive quadrature over standard slopes.
 *
 * With D = P N^2/det and d omega_i = 4 q det/N^2 dx dy (albedo_ray.h),
 *   albedo = integral of (fr cos theta_i / D) 4 q P dx dy
 * over the slopes whose wi is lit.  fr cos/D holds masking and Fresnel alone: it does
 * not feel the rounding of wi that D does when alpha is small, and the peak P of
 * the mirror direction always has width 1.  Polar coordinates, with u = r/(b + r).
 *
 * Longer than most files: the albedo of a direction and its mean walk one struct, which would
 * have to be a header's if they were two.
 */
#include "facet_albedo.h"

#include "albedo_ray.h"
#include "integrate.h"
#include "roughness.h"
#include "slope_table.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

enum { POINTS = INTEGRATE_POINTS, RADIUS_PANELS = 200, ANGLE_PANELS = 600, OUTER_PANELS = 100 };
/* Breaks of a ray beside those of the Fresnel term. */
enum { RAY_BREAKS = 16 };

/* exp(-r^2) beyond is nothing, (r^5)^2 of a Schlick term with f0 = 0 included. */
#define BECKMANN_END 8.0
/* Slopes beyond this hold 1e-15 of what is seen, and u could not tell them from infinity. */
#define SLOPE_END 1e15
/* Behind c_o < -BEHIND s the shared factor exp(-v^2) is taken out of D/sigma_o by the kernels only. */
#define BEHIND 10.0
/* So far behind nothing of a Gaussian's tail can be resolved. */
#define BLIND 100.0
/* To find out how large an integral is. */
#define ROUGH 1e-2
/* What the rays may contribute to the error that their integral is allowed. */
#define INNER_SHARE 0.4

struct albedo {
    facet_material material;
    facet_brdf *brdf, *standard; /* standard: alpha = 1, for P alone */
    struct albedo_surface surface;
    double det, scale;
    size_t channels, budget, spent, since_asked;
    facet_watch watch;
    double kink[FACET_FRESNEL_NODES_MAX]; /* cos^2 theta_d */
    size_t kinks;
    bool has_root;           /* F leaves a kink like a square root */
    double *breaks, *pieces; /* in u, and 0, 1, 2 .. */
    struct integrate_panel *radius, *angle, *theta, *azimuth;
    /* Of the direction at hand: */
    struct albedo_view view;
    bool half, behind, turned; /* turned: the standard slopes are not radial */
    double condition, absolute[3], relative;
    /* Of the ray at hand: */
    struct albedo_ray ray;
    /* Of the mean: */
    double azimuth_at, edge, tolerance; /* edge: theta_o at c_o = 0, or the horizon */
    const double *size;                 /* what the tolerance is relative to; NULL: each albedo */
};

/* ---- One ray --------------------------------------------------------------------- */

struct batch {
    double ix[POINTS], iy[POINTS], iz[POINTS], ox[POINTS], oy[POINTS], oz[POINTS];
    double px[POINTS], py[POINTS], pz[POINTS], r[POINTS];
    double fr_cos[3][POINTS], d[POINTS], p[POINTS], factor[POINTS];
};

static facet_status evaluate(struct albedo *a, struct batch *k)
{
    facet_vec3_in wi = {k->ix, k->iy, k->iz}, wo = {k->ox, k->oy, k->oz}, m = {k->px, k->py, k->pz};
    facet_outputs outputs = {.of = {[FACET_D] = {k->d}}};
    for (size_t c = 0; c < a->channels; c++) outputs.of[FACET_FR_COS][c] = k->fr_cos[c];
    facet_status status = facet_eval(a->brdf, FACET_PRECISE, wi, wo, POINTS, &outputs);
    facet_outputs density = {.of = {[FACET_D] = {k->p}}};
    if (!status) status = facet_eval(a->standard, FACET_PRECISE, m, m, POINTS, &density);
    if (!status && a->material.shear == FACET_THESIS) {
        double condition;
        status = facet_condition(a->brdf, wi, wo, POINTS, &condition);
        a->condition = fmax(a->condition, condition);
    }
    a->budget -= a->budget < POINTS ? a->budget : POINTS;
    a->spent += POINTS;
    a->since_asked += POINTS;
    return status;
}

/*
 * u at t, piece j of the ray lying over [j, j + 1]; with roots by a step that is
 * flat at the ends of the piece, which makes them smooth.
 */
static double u_of(const struct albedo *a, double t, double *du_dt)
{
    size_t j = (size_t)t;
    double low = a->breaks[j], width = a->breaks[j + 1] - low, f = t - (double)j;
    *du_dt = width * (a->has_root ? 6 * f * (1 - f) : 1);
    return low + width * (a->has_root ? f * f * (3 - 2 * f) : f);
}

/* The pair and the standard normal of slope r on the ray; factor: what multiplies fr cos/D. */
static void place(const struct albedo *a, double t, struct batch *k, int i)
{
    const struct albedo_ray *ray = &a->ray;
    const facet_roughness *m = &a->surface.roughness;
    double du_dt, u = u_of(a, t, &du_dt), r = a->scale * u / (1 - u);
    double x = m->slope_x + ray->dx * r, y = m->slope_y + ray->dy * r;
    double n = 1 + x * x + y * y, q = ray->c - ray->g * r, twice = 2 * q / n;
    k->ix[i] = -x * twice - a->view.x;
    k->iy[i] = -y * twice - a->view.y;
    k->iz[i] = twice - a->view.z;
    k->ox[i] = a->view.x;
    k->oy[i] = a->view.y;
    k->oz[i] = a->view.z;
    k->r[i] = r;
    k->px[i] = -0.5 * r * (a->turned ? ray->cosine : 1);
    k->py[i] = -0.5 * r * (a->turned ? ray->sine : 0);
    k->pz[i] = 0.5;
    k->factor[i] = 4 * q * r * a->scale / ((1 - u) * (1 - u)) * du_dt;
    if (a->behind) k->factor[i] *= a->det / (n * n);
}

static facet_status along_radius(void *user, const double at[POINTS], struct integral of[POINTS])
{
    struct albedo *a = user;
    struct batch k;
    for (int i = 0; i < POINTS; i++) place(a, at[i], &k, i);
    facet_status status = evaluate(a, &k);
    if (status) return status;
    for (int i = 0; i < POINTS; i++) {
        double r = k.r[i], n = 1 + r * r, p = k.p[i] / (n * n);
        double share = a->behind ? 1 : k.d[i] > 0 ? p / k.d[i] : 0;
        for (size_t c = 0; c < a->channels; c++) {
            double value = k.fr_cos[c][i] * (share * k.factor[i]);
            of[i].value[c] = isfinite(value) ? value : 0;
            of[i].error[c] = isfinite(value) ? 0 : INFINITY;
        }
    }
    return FACET_OK;
}

static bool is_central(const facet_roughness *r)
{
    return r->slope_x == 0 && r->slope_y == 0;
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
    for (size_t i = 0; i < a->kinks; i++) KEEP(facet_albedo_ray_cosine(&a->ray, a->kink[i], r));
    if (!is_central(&a->surface.roughness)) KEEP(facet_albedo_ray_edge(&a->ray, r));
    if (a->material.masking == FACET_VGROOVE) KEEP(facet_albedo_ray_vgroove(&a->ray, r));
#undef KEEP
    double pole = facet_albedo_pole(&a->surface, &a->view, &phi);
    if ((a->surface.is_rough || a->surface.is_careful) && pole > low && pole < high)
        to[count++] = pole;
    to[count++] = low;
    to[count++] = high;
    qsort(to, count, sizeof *to, ascending);
    size_t kept = 0;
    for (size_t i = 0; i < count; i++) {
        double u = to[i] / (a->scale + to[i]);
        if (kept == 0 || u > to[kept - 1]) to[kept++] = u;
    }
    return kept;
}

static facet_status integrate_ray(struct albedo *a, double phi, struct integral *sum)
{
    double low, high;
    *sum = (struct integral){{0}, {0}};
    if (a->since_asked >= 4096) {
        a->since_asked = 0;
        if (a->watch.cancelled && a->watch.cancelled(a->watch.user)) return FACET_CANCELLED;
    }
    a->ray = facet_albedo_ray_of(&a->surface, &a->view, phi);
    if (!facet_albedo_ray_lit(&a->ray, &a->view, &low, &high)) return FACET_OK;
    double end = SLOPE_END * fmin(a->scale, 1);
    if (a->material.ndf == FACET_BECKMANN) {
        double v = a->view.c < 0 ? a->view.c / hypot(a->view.a, a->view.b) : 0;
        end = hypot(v, BECKMANN_END);
    }
    high = fmin(high, end);
    if (!(high > low)) return FACET_OK;
    size_t count = ray_breaks(a, low, high);
    struct integrate rule = {.fn = along_radius,
                             .user = a,
                             .values = a->channels,
                             .relative = a->relative,
                             .panel = a->radius,
                             .panels = RADIUS_PANELS + count,
                             .budget = &a->budget};
    for (size_t c = 0; c < a->channels; c++) rule.absolute[c] = a->absolute[c];
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
    size_t count = facet_albedo_azimuths(&a->surface, &a->view, a->half, phi);
    struct integrate rule = {.fn = around,
                             .user = a,
                             .values = a->channels,
                             .relative = target ? 0 : relative,
                             .panel = a->angle,
                             .panels = ANGLE_PANELS,
                             .budget = &a->budget};
    a->relative = target ? 0 : INNER_SHARE * relative;
    for (size_t c = 0; c < a->channels; c++) {
        rule.absolute[c] = fmax(target ? target[c] : 0, FACET_FLOOR * 1e-3);
        a->absolute[c] = INNER_SHARE * rule.absolute[c] / (phi[count - 1] - phi[0]);
    }
    return facet_integrate(&rule, phi, count, sum);
}

/* What the evaluations themselves may be off by, relative: fr cos, D and P. */
static double evaluation_bound(const struct albedo *a)
{
    double fr_cos, d, p;
    if (!facet_bound(a->brdf, FACET_PRECISE, FACET_FR_COS, 0, &fr_cos) ||
        !facet_bound(a->brdf, FACET_PRECISE, FACET_D, 0, &d) ||
        !facet_bound(a->standard, FACET_PRECISE, FACET_D, 0, &p))
        return INFINITY;
    return fr_cos * a->condition + d + p + 32 * DBL_EPSILON;
}

static bool is_blind(const struct albedo *a)
{
    double v = -a->view.c / hypot(a->view.a, a->view.b);
    return a->material.ndf != FACET_GGX && v > BLIND;
}

/* To an absolute error of tolerance times size; size NULL: times the albedo itself. */
static facet_status integrate_to_size(struct albedo *a, double tolerance, const double size[3],
                                      struct integral *sum)
{
    struct integral rough = {{0}, {0}};
    facet_status status = FACET_OK;
    if (!size) status = integrate_rays(a, NULL, ROUGH, &rough);
    for (int round = 0; round < 3 && !status; round++) {
        bool fits = true; /* was the size right that the rays went by? */
        double target[3] = {0};
        for (size_t c = 0; c < a->channels; c++)
            target[c] = 0.5 * tolerance * (size ? size[c] : rough.value[c]);
        status = integrate_rays(a, target, 0, sum);
        for (size_t c = 0; c < a->channels; c++)
            fits = fits && sum->value[c] >= 0.6 * rough.value[c];
        rough = *sum;
        if (size || fits) break;
    }
    return status;
}

static facet_status integrate_direction(struct albedo *a, double x, double y, double z,
                                        double tolerance, const double size[3],
                                        facet_albedo_value *out)
{
    struct integral sum = {{0}, {0}};
    *out = (facet_albedo_value){{0}, {0}};
    if (!(z > 0)) return FACET_OK;
    a->view = facet_albedo_view_of(&a->surface, x, y, z);
    a->condition = 1;
    a->behind = a->material.ndf != FACET_GGX && -a->view.c > BEHIND * hypot(a->view.a, a->view.b);
    facet_status status = integrate_to_size(a, tolerance, size, &sum);
    for (size_t c = 0; c < a->channels; c++) {
        double both = a->half ? 2 : 1;
        out->value[c] = both * sum.value[c];
        out->error[c] = both * (sum.error[c] + fabs(sum.value[c]) * evaluation_bound(a));
        if (is_blind(a)) out->error[c] = INFINITY;
    }
    return status;
}

/* ---- The mean -------------------------------------------------------------------------- */

/*
 * theta_o at t in [0, 2]: before the mean facet up to 1, behind it from there.  Next to its edge c_o = 0 the
 * albedo is about c_o log c_o, which a step that is flat there smooths.
 */
static double theta_of(double edge, double t, double *dtheta_dt)
{
    double behind = FACET_PI / 2 - edge, left = 1 - t;
    *dtheta_dt = t > 1 ? behind : behind > 0 ? 2 * edge * left : edge;
    return t > 1 ? edge - behind * left : behind > 0 ? edge * (1 - left * left) : edge * t;
}

/*
 * 2 cos theta sin theta albedo(theta, azimuth): its integral over theta in [0, pi/2], the mean of that over
 * the azimuth, is the answer.  Not over the cosine: a sheared surface's albedo is no even function of theta,
 * and has a root at cosine 1.
 */
static facet_status along_theta(void *user, const double at[POINTS], struct integral of[POINTS])
{
    struct albedo *a = user;
    double x = cos(a->azimuth_at), y = sin(a->azimuth_at);
    for (int i = 0; i < POINTS; i++) {
        facet_albedo_value one;
        double dtheta_dt, theta = theta_of(a->edge, at[i], &dtheta_dt);
        double mu = cos(theta), sine = sin(theta), weight = 2 * mu * sine * dtheta_dt;
        facet_status status = integrate_direction(a, x * sine, y * sine, mu, 0.5 * a->tolerance,
                                                  a->size, &one);
        if (status) return status;
        for (size_t c = 0; c < a->channels; c++) {
            of[i].value[c] = weight * one.value[c];
            of[i].error[c] = weight * one.error[c];
        }
    }
    return FACET_OK;
}

/* What a level of the mean may be off by: a share of the whole, or relative to itself. */
static struct integrate mean_rule(struct albedo *a, integrand_fn *fn, double share,
                                  struct integrate_panel *panel)
{
    struct integrate rule = {.fn = fn,
                             .user = a,
                             .values = a->channels,
                             .panel = panel,
                             .relative = a->size ? 0 : share * a->tolerance,
                             .panels = OUTER_PANELS,
                             .budget = &a->budget,
                             .is_smooth = true};
    for (size_t c = 0; c < a->channels; c++)
        rule.absolute[c] = fmax(a->size ? share * a->tolerance * a->size[c] : 0,
                                FACET_FLOOR * 1e-3);
    return rule;
}

/* Along an azimuth the mean facet is left behind, c_o = 0, where the energy-safe form bends. */
static facet_status over_theta(struct albedo *a, struct integral *sum)
{
    const facet_roughness *r = &a->surface.roughness;
    double lean = r->slope_x * cos(a->azimuth_at) + r->slope_y * sin(a->azimuth_at);
    const double ends[] = {0, 1, 2};
    struct integrate rule = mean_rule(a, along_theta, 0.75, a->theta);
    a->edge = lean > 0 ? atan2(1, lean) : FACET_PI / 2;
    return facet_integrate(&rule, ends, lean > 0 ? 3 : 2, sum);
}

static facet_status around_azimuth(void *user, const double at[POINTS], struct integral of[POINTS])
{
    struct albedo *a = user;
    facet_status status = FACET_OK;
    for (int i = 0; i < POINTS && !status; i++) {
        a->azimuth_at = at[i];
        status = over_theta(a, &of[i]);
    }
    return status;
}

static facet_status integrate_mean(struct albedo *a, double tolerance, const double size[3],
                                   struct integral *sum)
{
    const facet_roughness *r = &a->surface.roughness;
    a->tolerance = tolerance;
    a->size = size;
    a->azimuth_at = 0;
    if (a->half) return over_theta(a, sum);
    /*
     * The axes of a central surface are its mirrors, and the mean slope that of an isotropic one; a lean
     * ends across the mean slope; a table over the azimuth is the same on both sides.
     */
    size_t quarters = a->turned                                 ? 2
                      : is_central(r)                           ? 1
                      : r->alpha_x == r->alpha_y && r->rho == 0 ? 2
                                                                : 4;
    double turn = (double)quarters * FACET_PI / 2, breaks[5];
    double axis = is_central(r) ? -facet_roughness_to_ellipse(r).phi
                                : atan2(r->slope_y, r->slope_x);
    for (size_t i = 0; i <= quarters; i++) breaks[i] = axis + (double)i * FACET_PI / 2;
    struct integrate rule = mean_rule(a, around_azimuth, turn, a->azimuth);
    facet_status status = facet_integrate(&rule, breaks, quarters + 1, sum);
    for (size_t c = 0; c < a->channels; c++) {
        sum->value[c] /= turn;
        sum->error[c] /= turn;
    }
    return status;
}

/* ---- Open and close ---------------------------------------------------------------------- */

/* Where F as a function of theta_d bends: the nodes of a table, the critical angle. */
static void find_kinks(struct albedo *a)
{
    const facet_fresnel *f = &a->material.fresnel;
    for (size_t i = 0; f->kind == FACET_FRESNEL_TABLE && i < f->count; i++)
        a->kink[a->kinks++] = f->cos_theta_d[i] * f->cos_theta_d[i];
    for (size_t c = 0; f->kind == FACET_FRESNEL_DIELECTRIC && c < f->channels; c++)
        if (f->eta[c] < 1) a->kink[a->kinks++] = (1 - f->eta[c]) * (1 + f->eta[c]);
    a->has_root = f->kind == FACET_FRESNEL_DIELECTRIC && a->kinks > 0;
}

static bool allocate(struct albedo *a)
{
    size_t breaks = 2 * a->kinks + RAY_BREAKS;
    a->breaks = malloc(2 * breaks * sizeof *a->breaks);
    a->pieces = a->breaks ? a->breaks + breaks : NULL;
    for (size_t i = 0; i < breaks && a->pieces; i++) a->pieces[i] = (double)i;
    a->radius = malloc((RADIUS_PANELS + breaks) * sizeof *a->radius);
    a->angle = malloc((ANGLE_PANELS + 2 * OUTER_PANELS) * sizeof *a->angle);
    a->theta = a->angle ? a->angle + ANGLE_PANELS : NULL;
    a->azimuth = a->angle ? a->theta + OUTER_PANELS : NULL;
    return a->breaks && a->radius && a->angle;
}

static void close_albedo(struct albedo *a)
{
    facet_brdf_destroy(a->brdf);
    facet_brdf_destroy(a->standard);
    free(a->breaks);
    free(a->radius);
    free(a->angle);
    free(a);
}

static facet_status set_up(struct albedo *a, const facet_material *m,
                           const facet_albedo_options *options)
{
    const facet_roughness *r = &m->roughness;
    facet_material standard = {.ndf = m->ndf,
                               .roughness = {.alpha_x = 1, .alpha_y = 1},
                               .fresnel = {.channels = 1},
                               .table = m->table};
    facet_status status = facet_brdf_create(m, &a->brdf);
    if (!status) status = facet_brdf_create(&standard, &a->standard);
    if (status) return status;
    const struct roughness_form form = facet_roughness_form(r);
    a->material = *m;
    facet_ellipse e = facet_roughness_to_ellipse(r);
    a->surface = (struct albedo_surface){*r,
                                         form.conditional.hi,
                                         form.correlated.hi,
                                         e.alpha_1,
                                         e.alpha_1 > 1,
                                         e.alpha_1 > 4 * e.alpha_2,
                                         options->tolerance < 1e-5};
    a->det = r->alpha_x * form.conditional.hi;
    a->scale = m->ndf == FACET_TABULATED ? m->table->view.slope_scale : 1;
    a->channels = m->fresnel.channels;
    a->watch = options->watch;
    a->turned = m->ndf == FACET_TABULATED && facet_slope_table_is_turned(&m->table->view);
    a->half = is_central(r) && r->alpha_x == r->alpha_y && r->rho == 0 && !a->turned;
    find_kinks(a);
    return allocate(a) ? FACET_OK : FACET_NO_MEMORY;
}

static facet_status open_albedo(const facet_material *m, const facet_albedo_options *options,
                                struct albedo **albedo)
{
    *albedo = NULL;
    if (!(options->tolerance >= 1e-15 && options->tolerance <= 0.1)) return FACET_UNSUPPORTED;
    struct albedo *a = calloc(1, sizeof *a);
    if (!a) return FACET_NO_MEMORY;
    facet_status status = set_up(a, m, options);
    if (status)
        close_albedo(a);
    else
        *albedo = a;
    return status;
}

/* The rules' differences are no proof: nothing far below what was aimed at is claimed. */
static void be_modest(const struct albedo *a, double tolerance, facet_albedo_value *of)
{
    for (size_t c = 0; c < a->channels; c++)
        of->error[c] = fmax(of->error[c], 0.1 * tolerance * fabs(of->value[c]));
}

facet_status facet_albedo(const facet_material *material, facet_vec3_in wo, size_t n,
                          const facet_albedo_options *options, facet_albedo_value *albedo,
                          size_t *evaluations)
{
    struct albedo *a;
    facet_status status = open_albedo(material, options, &a);
    if (status) return status;
    for (size_t i = 0; i < n && !status; i++) {
        a->budget = options->evaluations_max;
        status = integrate_direction(a, wo.x[i], wo.y[i], wo.z[i], options->tolerance, NULL,
                                     &albedo[i]);
        be_modest(a, options->tolerance, &albedo[i]);
    }
    if (evaluations) *evaluations = a->spent;
    close_albedo(a);
    return status;
}

facet_status facet_albedo_average(const facet_material *material,
                                  const facet_albedo_options *options, facet_albedo_value *average,
                                  size_t *evaluations)
{
    struct albedo *a;
    struct integral sum;
    *average = (facet_albedo_value){{0}, {0}};
    facet_status status = open_albedo(material, options, &a);
    if (status) return status;
    a->budget = options->evaluations_max;
    a->surface.is_careful = false;
    status = integrate_mean(a, ROUGH, NULL, &sum);
    if (!status && options->tolerance < ROUGH) {
        struct integral fine;
        status = integrate_mean(a, options->tolerance, sum.value, &fine);
        /* Out of budget, the rough one may be the better of the two. */
        if (fine.error[0] <= sum.error[0]) sum = fine;
    }
    for (size_t c = 0; c < a->channels && !status; c++) {
        average->value[c] = sum.value[c];
        average->error[c] = sum.error[c];
    }
    be_modest(a, options->tolerance, average);
    if (evaluations) *evaluations = a->spent;
    close_albedo(a);
    return status;
}
