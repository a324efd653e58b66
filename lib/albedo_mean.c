/*
 * albedo_mean.c - the mean albedo, by micronormals first.
 *
 * With d omega_i d omega_o = 4 cos theta_d d omega_h d omega_d, and as in albedo.c,
 *   mean = integral over standard slopes of P J(h) dx dy
 *   J(h) = sqrt(N)/pi  integral of (fr cos theta_i / D) 4 cos theta_d z_o d omega_d
 * over the wo = (theta_d, phi_d) about h that are lit and whose wi is.  However narrow a surface is, P has
 * width 1 and J is smooth: the mirrored horizon, a step in albedo(wo) as narrow as the lobe, is here the end
 * of an interval of phi_d that is known.  In phi_d everything that bends is a pair of circles
 * reach cos(phi_d - azimuth) = +-level cot theta_d, those of wo and of wi.
 */
#include "albedo_material.h"

#include "roughness.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

enum { AZIMUTHS = 100, RADII = 100, THETAS = 200, PHIS = 200 };
enum { POINTS = ALBEDO_POINTS, CIRCLES = 3, LAYERS = 6 };
enum { RADIUS_BREAKS = 14 };
/* Breaks in theta_d beside those of the Fresnel term, and of one arc of phi_d. */
enum { THETA_BREAKS = LAYERS + CIRCLES + 5, PHI_BREAKS = 4 * CIRCLES + 2 };

/* Up to here P and D of a Gaussian are numbers, whose quotient does not feel the rounding of h. */
#define FAR 25.0
/* Farther out a theta_d whose h is rounded by this much of what D bends by is left out: next to nothing. */
#define ROUNDED 1e-3

/* What the levels may be off by, the inner ones included. */
#define RADIUS_SHARE 0.9
#define NORMAL_SHARE 0.8
#define PHI_SHARE 0.6

struct circle {
    double reach, azimuth, level;
};

struct mean {
    struct albedo_material material;
    struct integrate_panel *azimuth, *radius, *theta, *phi;
    double *breaks, *pieces; /* in theta_d, and 0, 1, 2 .. */
    double tolerance;
    const double *size; /* what the tolerance is relative to; NULL: each integral */
    double alpha_2;
    /* Of the ray at hand: */
    double cosine, sine, dx, dy;
    /* Of the micronormal at hand; its density is in fr or, far out, is not: */
    double r, h[3], across[3], along[3], slope, root_n, least_cos_d;
    bool far;
    struct circle circles[CIRCLES];
    size_t circle_count;
    double absolute[3]; /* of J */
    /* Of the theta_d at hand, and of the arc of phi_d: */
    double cos_d, sin_d, side;
};

/* ---- phi_d ---------------------------------------------------------------------------- */

/* wo at delta from the middle of the arc, which is across the plane of h and z: there nothing cancels. */
static void place(const struct mean *m, double delta, struct albedo_pairs *k, int i)
{
    double c = -m->side * sin(delta) * m->sin_d, s = m->side * cos(delta) * m->sin_d;
    double *o[3] = {k->ox, k->oy, k->oz}, *in[3] = {k->ix, k->iy, k->iz};
    for (int j = 0; j < 3; j++) {
        double t = c * m->along[j] + s * m->across[j];
        o[j][i] = m->cos_d * m->h[j] + t;
        in[j][i] = m->cos_d * m->h[j] - t;
    }
}

static facet_status along_phi(void *user, const double at[POINTS], struct integral of[POINTS])
{
    struct mean *m = user;
    struct albedo_pairs k;
    for (int i = 0; i < POINTS; i++) place(m, at[i], &k, i);
    facet_status status = facet_albedo_evaluate(&m->material, &k);
    for (int i = 0; i < POINTS && !status; i++) {
        double share = m->far ? k.oz[i] : k.d[i] > 0 ? k.oz[i] / k.d[i] : 0;
        for (size_t c = 0; c < m->material.channels; c++) {
            double value = k.fr_cos[c][i] * share;
            of[i].value[c] = isfinite(value) ? value : 0;
            of[i].error[c] = isfinite(value) ? 0 : INFINITY;
        }
    }
    return status;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The lit arc and where the circles cross it, ascending. */
static size_t arc_breaks(const struct mean *m, double end, double to[PHI_BREAKS])
{
    size_t count = 0;
    to[count++] = -end;
    to[count++] = end;
    for (size_t i = 0; i < m->circle_count; i++) {
        const struct circle *c = &m->circles[i];
        double x = c->level * m->cos_d / (c->reach * m->sin_d);
        if (!(fabs(x) < 1)) continue;
        for (int k = 0; k < 4; k++) {
            double phi = c->azimuth + (k & 1 ? 1 : -1) * acos(k & 2 ? x : -x);
            double delta = remainder(phi - m->side * FACET_PI / 2, 2 * FACET_PI);
            if (delta > -end && delta < end) to[count++] = delta;
        }
    }
    qsort(to, count, sizeof *to, ascending);
    return count;
}

/* Where the thesis's shear divides by 0 is no circle. */
static bool bends_where_known(const struct albedo_material *a)
{
    return a->is_central || a->material.shear != FACET_THESIS;
}

/* Both arcs; where one is the other's mirror image, or wi and wo may change places, twice the first. */
static facet_status over_phi(struct mean *m, double weight, struct integral *sum)
{
    struct albedo_material *a = &m->material;
    bool is_reciprocal = a->is_central && a->material.masking != FACET_NONE;
    double limit = m->cos_d / (m->sin_d * m->slope), to[PHI_BREAKS];
    double end = limit < 1 ? asin(limit) : FACET_PI / 2;
    struct integrate rule = {.fn = along_phi,
                             .user = m,
                             .values = a->channels,
                             .relative = m->size ? 0 : PHI_SHARE * m->tolerance,
                             .panel = m->phi,
                             .panels = PHIS,
                             .budget = &a->budget,
                             .is_smooth = bends_where_known(a)};
    facet_status status = facet_albedo_ask(a);
    *sum = (struct integral){{0}, {0}};
    for (size_t c = 0; c < a->channels; c++)
        rule.absolute[c] = m->absolute[c] * (PHI_SHARE / NORMAL_SHARE) / (FACET_PI * weight);
    int arcs = a->half || is_reciprocal ? 1 : 2;
    for (int i = 0; i < arcs && !status; i++) {
        struct integral one;
        m->side = i ? -1 : 1;
        status = facet_integrate(&rule, to, arc_breaks(m, end, to), &one);
        for (size_t c = 0; c < a->channels; c++) {
            sum->value[c] += one.value[c] * (2. / arcs);
            sum->error[c] += one.error[c] * (2. / arcs);
        }
    }
    return status;
}

/* ---- theta_d -------------------------------------------------------------------------- */

/* By a step that is flat at the ends of its piece, as an arc begins like a root. */
static facet_status along_theta(void *user, const double at[POINTS], struct integral of[POINTS])
{
    struct mean *m = user;
    facet_status status = FACET_OK;
    for (int i = 0; i < POINTS && !status; i++) {
        size_t j = (size_t)at[i];
        double low = m->breaks[j], width = m->breaks[j + 1] - low, f = at[i] - (double)j;
        double theta = low + width * f * f * (3 - 2 * f);
        m->cos_d = cos(theta);
        m->sin_d = sin(theta);
        double weight = 4 / FACET_PI * m->root_n * m->cos_d * m->sin_d * width * 6 * f * (1 - f);
        if (!(weight > 0) || m->cos_d < m->least_cos_d) continue;
        status = over_phi(m, weight, &of[i]);
        for (size_t c = 0; c < m->material.channels; c++) {
            of[i].value[c] *= weight;
            of[i].error[c] *= weight;
        }
    }
    return status;
}

/* The micronormal of slope (x, y), its frame, and what bends about it. */
static void turn_to(struct mean *m, double x, double y)
{
    const facet_roughness *r = &m->material.surface.roughness;
    double slope = hypot(x, y), ux = slope > 0 ? x / slope : 1, uy = slope > 0 ? y / slope : 0;
    double root_n = hypot(1, slope), z = 1 / root_n, t = slope / root_n;
    m->slope = slope;
    m->root_n = root_n;
    m->h[0] = -ux * t, m->h[1] = -uy * t, m->h[2] = z;
    m->along[0] = ux * z, m->along[1] = uy * z, m->along[2] = t;
    m->across[0] = -uy, m->across[1] = ux, m->across[2] = 0;
    double level = (1 + x * r->slope_x + y * r->slope_y) * z;
    double b = t - z * (r->slope_x * ux + r->slope_y * uy), c = r->slope_x * uy - r->slope_y * ux;
    double reach = hypot(b, c), azimuth = atan2(c, b);
    m->circle_count = 0;
    if (!m->material.is_central)
        m->circles[m->circle_count++] = (struct circle){reach, azimuth, level};
    if (m->material.material.masking == FACET_VGROOVE) {
        m->circles[m->circle_count++] = (struct circle){reach, azimuth, 0.5 * root_n - level};
        m->circles[m->circle_count++] = (struct circle){reach, azimuth, 0};
    }
}

static double norm(double x, double y, double z)
{
    return hypot(hypot(x, y), z);
}

/*
 * Where the edge of the mean facet, wo.n = 0, crosses the horizon of wo, z, and that of wi, which is the
 * mirror image 2 h_z h - z: at wo = n x either.
 */
static size_t edge_crossings(const struct mean *m, double theta[2])
{
    const facet_roughness *r = &m->material.surface.roughness;
    const double *h = m->h, x = -r->slope_x, y = -r->slope_y;
    double ix = 2 * h[2] * h[0], iy = 2 * h[2] * h[1], iz = 2 * h[2] * h[2] - 1;
    double volume = fabs(h[0] * y - h[1] * x);
    theta[0] = acos(fmin(volume / norm(y, x, 0), 1));
    theta[1] = acos(fmin(volume / norm(y * iz - iy, ix - x * iz, x * iy - y * ix), 1));
    return 2;
}

/* Where an arc begins, kinks of F, and, for masking, layers as thin as the surface is. */
static size_t theta_breaks(const struct mean *m)
{
    const struct albedo_material *a = &m->material;
    double *to = m->breaks, end = FACET_PI / 2, width = fmax(m->alpha_2 * fmax(m->r, 1), 1e-5);
    size_t count = 0;
    to[count++] = 0;
    to[count++] = end;
    to[count++] = atan2(1, m->slope);
    for (size_t i = 0; i < m->circle_count; i++)
        to[count++] = atan2(fabs(m->circles[i].level), m->circles[i].reach);
    if (!a->is_central) count += edge_crossings(m, to + count);
    for (int i = 0; i < LAYERS && width < 0.1; i++, width *= 10) to[count++] = end - width;
    for (size_t i = 0; i < a->kinks; i++) to[count++] = acos(fmin(sqrt(a->kink[i]), 1));
    qsort(to, count, sizeof *to, ascending);
    size_t kept = 1;
    for (size_t i = 1; i < count; i++)
        if (to[i] > to[kept - 1]) to[kept++] = to[i];
    return kept;
}

/* J at standard slope r of the ray; weight: what it counts. */
static facet_status at_normal(struct mean *m, double r, double weight, struct integral *sum)
{
    struct albedo_material *a = &m->material;
    const facet_roughness *s = &a->surface.roughness;
    turn_to(m, s->slope_x + m->dx * r, s->slope_y + m->dy * r);
    m->r = r;
    m->far = a->material.ndf == FACET_BECKMANN && r > FAR;
    m->least_cos_d = m->far ? DBL_EPSILON * r / (ROUNDED * m->alpha_2) : 0;
    if (m->far) weight *= a->det / pow(m->root_n, 4);
    *sum = (struct integral){{0}, {0}};
    if (!(weight > 0)) return FACET_OK;
    for (size_t c = 0; c < a->channels; c++) {
        double target = m->size ? NORMAL_SHARE * m->tolerance * m->size[c] : 0;
        m->absolute[c] = fmax(target, FACET_FLOOR * 1e-3) / (2 * FACET_PI * weight);
    }
    a->condition = 1;
    a->depth = (facet_depth){0, 0, 0};
    struct integrate rule = {.fn = along_theta,
                             .user = m,
                             .values = a->channels,
                             .relative = m->size ? 0 : NORMAL_SHARE * m->tolerance,
                             .panel = m->theta,
                             .panels = THETAS + a->kinks,
                             .budget = &a->budget,
                             .is_smooth = bends_where_known(a) &&
                                          a->material.masking != FACET_VGROOVE};
    for (size_t c = 0; c < a->channels; c++) rule.absolute[c] = m->absolute[c];
    facet_status status = facet_integrate(&rule, m->pieces, theta_breaks(m), sum);
    for (size_t c = 0; c < a->channels; c++) {
        sum->error[c] += fabs(sum->value[c]) * facet_albedo_evaluation_bound(a);
        sum->value[c] *= weight;
        sum->error[c] *= weight;
    }
    return status;
}

/* ---- Micronormals --------------------------------------------------------------------- */

static facet_status along_radius(void *user, const double at[POINTS], struct integral of[POINTS])
{
    struct mean *m = user;
    double r[POINTS], p[POINTS], scale = m->material.scale;
    for (int i = 0; i < POINTS; i++) r[i] = scale * at[i] / (1 - at[i]);
    facet_status status = facet_albedo_density(&m->material, r, m->cosine, m->sine, p);
    for (int i = 0; i < POINTS && !status; i++) {
        bool far = m->material.material.ndf == FACET_BECKMANN && r[i] > FAR;
        double area = r[i] * scale / ((1 - at[i]) * (1 - at[i]));
        status = at_normal(m, r[i], (far ? 1 : p[i]) * area, &of[i]);
    }
    return status;
}

/* How far out the normals are that some wo sees: v of the horizon is that of the pole at most. */
static double slope_end(const struct mean *m, double pole)
{
    const struct albedo_material *a = &m->material;
    if (a->material.ndf != FACET_BECKMANN) return ALBEDO_SLOPE_END * fmin(a->scale, 1);
    return hypot(fmin(pole, ALBEDO_BLIND), ALBEDO_BECKMANN_END);
}

static facet_status over_radius(struct mean *m, double azimuth, struct integral *sum)
{
    const struct albedo_material *a = &m->material;
    const struct albedo_view up = facet_albedo_view_of(&a->surface, 0, 0, 1);
    const struct albedo_ray ray = facet_albedo_ray_of(&a->surface, &up, azimuth);
    double breaks[RADIUS_BREAKS] = {0}, phi, across = -2 * ray.n[0] / ray.n[1];
    double pole = facet_albedo_pole(&a->surface, &up, &phi), end = slope_end(m, pole);
    size_t count = 1;
    /* h = z or, of a central surface, as steep; h across the mean normal; where `far` begins. */
    breaks[count++] = a->is_central ? 1 / a->surface.alpha_1 : pole;
    if (across > 0) breaks[count++] = across;
    if (a->material.ndf == FACET_BECKMANN) breaks[count++] = FAR;
    /* Behind its mean facet a surface with tails shows all there is up to the pole, in equal parts. */
    else if (!a->is_central)
        while (count < RADIUS_BREAKS - 1 && pole > 10) breaks[count++] = pole /= 10;
    breaks[count++] = end;
    m->cosine = ray.cosine, m->sine = ray.sine;
    m->dx = ray.dx, m->dy = ray.dy;
    for (size_t i = 0; i < count; i++) {
        double r = fmin(breaks[i], end);
        breaks[i] = r / (a->scale + r);
    }
    qsort(breaks, count, sizeof *breaks, ascending);
    struct integrate rule = {.fn = along_radius,
                             .user = m,
                             .values = a->channels,
                             .relative = m->size ? 0 : RADIUS_SHARE * m->tolerance,
                             .panel = m->radius,
                             .panels = RADII,
                             .budget = &a->budget,
                             .is_smooth = true};
    for (size_t c = 0; c < a->channels; c++) {
        double target = m->size ? RADIUS_SHARE * m->tolerance * m->size[c] : 0;
        rule.absolute[c] = fmax(target, FACET_FLOOR * 1e-3) / (2 * FACET_PI);
    }
    return facet_integrate(&rule, breaks, count, sum);
}

static facet_status around_azimuth(void *user, const double at[POINTS], struct integral of[POINTS])
{
    facet_status status = FACET_OK;
    for (int i = 0; i < POINTS && !status; i++) status = over_radius(user, at[i], &of[i]);
    return status;
}

/*
 * The axes of a central surface are its mirrors, and the mean slope that of an isotropic one; a central table
 * over the azimuth is the same on both sides.  h = z, where nothing is hidden by the horizon, is a cusp of J.
 */
static size_t quarters_of(const struct albedo_material *a, double *axis)
{
    const facet_roughness *r = &a->surface.roughness;
    const struct albedo_view up = facet_albedo_view_of(&a->surface, 0, 0, 1);
    double x = r->alpha_x, y = a->surface.rho_alpha_y, k = a->surface.kappa_alpha_y;
    bool is_round = r->alpha_x == r->alpha_y && r->rho == 0;
    *axis = 0.5 * atan2(2 * y * k, x * x + y * y - k * k);
    if (!a->is_central) facet_albedo_pole(&a->surface, &up, axis);
    if (a->turned) return a->is_central ? 2 : 4;
    return a->is_central ? 1 : is_round ? 2 : 4;
}

static facet_status integrate_mean(struct mean *m, double tolerance, const double size[3],
                                   struct integral *sum)
{
    struct albedo_material *a = &m->material;
    double axis, breaks[5];
    size_t quarters = quarters_of(a, &axis);
    double turn = (double)quarters * FACET_PI / 2;
    facet_status status;
    m->tolerance = tolerance;
    m->size = size;
    if (a->half) {
        status = over_radius(m, turn = 1, sum);
    } else {
        struct integrate rule = {.fn = around_azimuth,
                                 .user = m,
                                 .values = a->channels,
                                 .relative = size ? 0 : tolerance,
                                 .panel = m->azimuth,
                                 .panels = AZIMUTHS,
                                 .budget = &a->budget,
                                 .is_smooth = true};
        for (size_t c = 0; c < a->channels; c++)
            rule.absolute[c] = fmax(size ? tolerance * size[c] : 0, FACET_FLOOR * 1e-3) * turn /
                               (2 * FACET_PI);
        for (size_t i = 0; i <= quarters; i++) breaks[i] = axis + (double)i * FACET_PI / 2;
        if (quarters == 4) { /* next to the cusp half as far */
            breaks[1] -= FACET_PI / 4;
            breaks[3] += FACET_PI / 4;
        }
        status = facet_integrate(&rule, breaks, quarters + 1, sum);
    }
    for (size_t c = 0; c < a->channels; c++) {
        sum->value[c] *= 2 * FACET_PI / turn;
        sum->error[c] *= 2 * FACET_PI / turn;
    }
    return status;
}

/*
 * Behind v = BLIND a Gaussian's tail is left out.  A wo there has z_o < s/v for a wi above the horizon, with
 * s < lean/v: of all wo (s/v)^2, and the factor for what is beyond that exponential's width.
 */
static double unseen(const struct mean *m)
{
    const struct albedo_material *a = &m->material;
    const facet_roughness *r = &a->surface.roughness;
    const struct albedo_view up = facet_albedo_view_of(&a->surface, 0, 0, 1);
    double phi, lean = hypot(r->slope_x, r->slope_y);
    if (a->material.ndf != FACET_BECKMANN ||
        facet_albedo_pole(&a->surface, &up, &phi) <= ALBEDO_BLIND)
        return 0;
    double s = fmin(a->surface.alpha_1, lean / ALBEDO_BLIND) / ALBEDO_BLIND;
    return 4 * s * s;
}

static facet_status open_mean(struct mean *m, const facet_material *material,
                              const facet_albedo_options *options)
{
    facet_status status = facet_albedo_open(&m->material, material, options);
    if (status) return status;
    size_t thetas = THETAS + m->material.kinks, breaks = THETA_BREAKS + m->material.kinks;
    m->breaks = malloc(2 * breaks * sizeof *m->breaks);
    m->azimuth = malloc((AZIMUTHS + RADII + PHIS + thetas) * sizeof *m->azimuth);
    if (!m->breaks || !m->azimuth) return FACET_NO_MEMORY;
    m->pieces = m->breaks + breaks;
    for (size_t i = 0; i < breaks; i++) m->pieces[i] = (double)i;
    m->alpha_2 = facet_roughness_to_ellipse(&material->roughness).alpha_2;
    m->radius = m->azimuth + AZIMUTHS;
    m->phi = m->radius + RADII;
    m->theta = m->phi + PHIS;
    return FACET_OK;
}

static void close_mean(struct mean *m)
{
    facet_albedo_close(&m->material);
    free(m->breaks);
    free(m->azimuth);
    free(m);
}

/* To options->tolerance or, out of budget, with a quarter of it to what that may reach. */
static facet_status refine(struct mean *m, const facet_albedo_options *options,
                           struct integral *sum)
{
    const struct integral rough = *sum;
    double tolerance = options->tolerance;
    facet_status status = FACET_OK;
    for (int pass = 0; pass < 2 && !status && tolerance < ALBEDO_ROUGH; pass++) {
        struct integral fine;
        status = integrate_mean(m, tolerance, rough.value, &fine);
        if (fine.error[0] <= sum->error[0]) *sum = fine;
        if (m->material.budget > 0) break;
        m->material.budget = options->evaluations_max / 4;
        tolerance *= 100;
    }
    return status;
}

facet_status facet_albedo_average(const facet_material *material,
                                  const facet_albedo_options *options, facet_albedo_value *average,
                                  size_t *evaluations)
{
    struct integral sum = {{0}, {0}};
    *average = (facet_albedo_value){{0}, {0}};
    struct mean *m = calloc(1, sizeof *m);
    if (!m) return FACET_NO_MEMORY;
    facet_status status = open_mean(m, material, options);
    if (!status) status = integrate_mean(m, ALBEDO_ROUGH, NULL, &sum);
    if (!status) status = refine(m, options, &sum);
    for (size_t c = 0; c < m->material.channels && !status; c++) {
        average->value[c] = sum.value[c];
        average->error[c] = sum.error[c] + unseen(m);
    }
    facet_albedo_be_modest(&m->material, options->tolerance, average);
    if (evaluations) *evaluations = m->material.spent;
    close_mean(m);
    return status;
}
