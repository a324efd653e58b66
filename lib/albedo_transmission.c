/*
 * albedo_transmission.c - what a rough dielectric transmits, by nested adaptive quadrature over
 * standard slopes as in albedo.c:
 *   transmitted = 1/sigma(wo) integral of q P T W dx dy
 * with q = (wo.h)/h_z, over the slopes whose refracted ray leaves on the other side.  No Jacobian of
 * refraction is left in it, so that it does not feel n -> 1.
 */
#include "albedo_ray.h"
#include "facet_albedo.h"
#include "integrate.h"
#include "transmission.h"
#include "watch.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

enum { POINTS = INTEGRATE_POINTS, PANELS = 400, BREAKS = 6 };

/* exp(-r^2) beyond is nothing; of GGX's slopes 1e-15. */
#define BECKMANN_END 8.0
#define GGX_END 1e15
/* To find out how large the integral is, and what the rays may contribute to its error. */
#define ROUGH 1e-2
#define INNER_SHARE 0.4

struct walk {
    const facet_bsdf *bsdf;
    facet_brdf *standard; /* alpha = 1, for P alone */
    struct albedo_surface surface;
    struct integrate_panel radius[PANELS], angle[PANELS];
    facet_watch watch;
    size_t budget, spent, since_asked;
    /* Of the direction at hand: */
    const struct kernel_side *side;
    struct albedo_view view;
    double sigma_o, cosine_o, absolute, relative;
    bool half;
    /* Of the ray at hand: */
    struct albedo_ray ray;
    double breaks[BREAKS]; /* in u = r/(1 + r) */
};

struct points {
    double up[3][POINTS]; /* -wi */
    double normal[3][POINTS], density[POINTS], sigma[POINTS], cosine[POINTS], kept[POINTS];
    double c[POINTS], g[POINTS], share[POINTS],
        factor[POINTS]; /* of T, T, and what else there is */
};

/* u at t, piece j over [j, j + 1], by a step that is flat at its ends: T leaves the critical angle like a root. */
static double slope_of(const struct walk *w, double t, double *dr_dt)
{
    size_t j = (size_t)t;
    double f = t - (double)j, width = w->breaks[j + 1] - w->breaks[j];
    double u = w->breaks[j] + width * f * f * (3 - 2 * f), rest = 1 - u;
    *dr_dt = width * 6 * f * (1 - f) / (rest * rest);
    return u / rest;
}

/* q r dr/dt of the normal at r, and where it refracts to; 0 where it does not. */
static void place(const struct walk *w, double t, struct points *p, int i)
{
    const facet_roughness *m = &w->surface.roughness;
    double dr_dt, r = slope_of(w, t, &dr_dt), n = w->side->index;
    double x = m->slope_x + w->ray.dx * r, y = m->slope_y + w->ray.dy * r,
           length = sqrt(1 + x * x + y * y);
    double q = w->ray.c - w->ray.g * r, c = q / length, g2 = w->side->excess + c * c,
           g = sqrt(fmax(g2, 0));
    double bend = w->side->excess / (g + fmax(c, DBL_MIN)) / length;
    p->up[0][i] = (w->view.x - bend * x) / n;
    p->up[1][i] = (w->view.y - bend * y) / n;
    p->up[2][i] = (w->view.z + bend) / n;
    p->normal[0][i] = -0.5 * r, p->normal[1][i] = 0, p->normal[2][i] = 0.5;
    p->factor[i] = 0;
    p->c[i] = p->g[i] = 1;
    if (!(c > 0 && g2 > 0 && p->up[2][i] > 0)) {
        p->up[0][i] = p->up[1][i] = 0, p->up[2][i] = 1;
        return;
    }
    p->c[i] = c;
    p->g[i] = g;
    p->factor[i] = q * r * dr_dt;
}

static facet_status along_radius(void *user, const double at[POINTS], struct integral of[POINTS])
{
    struct walk *w = user;
    struct points p;
    for (int i = 0; i < POINTS; i++) place(w, at[i], &p, i);
    facet_vec3_in up = {p.up[0], p.up[1], p.up[2]},
                  normal = {p.normal[0], p.normal[1], p.normal[2]};
    const facet_outputs sigma = {.of = {[FACET_SIGMA_O] = {p.sigma}}},
                        density = {.of = {[FACET_D] = {p.density}}};
    facet_status status = facet_eval(w->bsdf->ideal, FACET_PRECISE, up, up, POINTS, &sigma);
    if (!status) status = facet_eval(w->standard, FACET_PRECISE, normal, normal, POINTS, &density);
    w->budget -= w->budget < POINTS ? w->budget : POINTS;
    w->spent += POINTS;
    w->since_asked += POINTS;
    for (int i = 0; i < POINTS; i++)
        p.cosine[i] = facet_mean_cosine(&w->bsdf->ideal->surface, p.up[0][i], p.up[1][i],
                                        p.up[2][i]);
    facet_transmittance(w->side->index, p.c, p.g, POINTS, p.share);
    facet_transmission_masking(w->bsdf, w->sigma_o, w->cosine_o, p.sigma, p.cosine, POINTS, p.kept);
    for (int i = 0; i < POINTS; i++) {
        double r = -2 * p.normal[0][i], sec2 = 1 + r * r;
        double value = p.factor[i] * p.share[i] * p.kept[i] * (p.density[i] / (sec2 * sec2)) /
                       w->sigma_o;
        of[i].value[0] = isfinite(value) ? value : 0;
        of[i].error[0] = isfinite(value) ? 0 : INFINITY;
    }
    return status;
}

/* Where q > 0, broken at the critical angle and where the refracted ray grazes. */
static size_t find_breaks(struct walk *w)
{
    double c = w->ray.c, g = w->ray.g, low = 0, high = GGX_END, r[4];
    size_t found = 0, count = 0;
    if (w->bsdf->ndf == FACET_BECKMANN) {
        double v = w->view.c < 0 ? w->view.c / hypot(w->view.a, w->view.b) : 0;
        high = hypot(v, BECKMANN_END);
    }
    if (c <= 0 && g >= 0) return 0;
    if (c < 0) low = c / g;
    if (g > 0) high = fmin(high, c / g);
    if (!(high > low)) return 0;
    if (w->side->excess < 0) {
        found = facet_albedo_ray_cosine(&w->ray, -w->side->excess, r);
        found += facet_albedo_ray_refracted(&w->ray, &w->view, w->side->excess, r + found);
    }
    double *to = w->breaks;
    to[count++] = low;
    for (size_t i = 0; i < found; i++) {
        if (!(r[i] > low && r[i] < high)) continue;
        size_t at = count++;
        for (; at > 1 && to[at - 1] > r[i]; at--) to[at] = to[at - 1];
        to[at] = r[i];
    }
    to[count++] = high;
    for (size_t i = 0; i < count; i++) to[i] /= 1 + to[i];
    return count;
}

static facet_status integrate_ray(struct walk *w, double phi, struct integral *sum)
{
    static const double pieces[BREAKS] = {0, 1, 2, 3, 4, 5};
    *sum = (struct integral){{0}, {0}};
    if (w->since_asked >= 4096) {
        w->since_asked = 0;
        if (facet_is_cancelled(&w->watch)) return FACET_CANCELLED;
    }
    w->ray = facet_albedo_ray_of(&w->surface, &w->view, phi);
    size_t count = find_breaks(w);
    struct integrate rule = {.fn = along_radius,
                             .user = w,
                             .values = 1,
                             .absolute = {w->absolute},
                             .relative = w->relative,
                             .panel = w->radius,
                             .panels = PANELS,
                             .budget = &w->budget};
    return count ? facet_integrate(&rule, pieces, count, sum) : FACET_OK;
}

static facet_status around(void *user, const double at[POINTS], struct integral of[POINTS])
{
    facet_status status = FACET_OK;
    for (int i = 0; i < POINTS && !status; i++) status = integrate_ray(user, at[i], &of[i]);
    return status;
}

/* To an absolute error, or (0) to ROUGH of the sum. */
static facet_status integrate_rays(struct walk *w, double absolute, struct integral *sum)
{
    double phi[ALBEDO_AZIMUTHS_MAX];
    size_t count = facet_albedo_azimuths(&w->surface, &w->view, w->half, phi);
    struct integrate rule = {.fn = around,
                             .user = w,
                             .values = 1,
                             .absolute = {fmax(absolute, FACET_FLOOR * 1e-3)},
                             .relative = absolute > 0 ? 0 : ROUGH,
                             .panel = w->angle,
                             .panels = PANELS,
                             .budget = &w->budget};
    w->relative = absolute > 0 ? 0 : INNER_SHARE * ROUGH;
    w->absolute = INNER_SHARE * rule.absolute[0] / (phi[count - 1] - phi[0]);
    return facet_integrate(&rule, phi, count, sum);
}

static facet_status integrate_direction(struct walk *w, const double wo[3], double tolerance,
                                        facet_albedo_value *out)
{
    struct integral rough, fine = {{0}, {0}};
    const int side = facet_side(wo[2]);
    const double turn = side == BELOW ? -1 : 1, up[3] = {turn * wo[0], turn * wo[1], turn * wo[2]};
    const facet_outputs area = {.of = {[FACET_SIGMA_O] = {&w->sigma_o}}};
    facet_vec3_in from = {&up[0], &up[1], &up[2]};
    double bound;
    *out = (facet_albedo_value){{0}, {0}};
    if (!(up[2] > 0)) return FACET_OK;
    w->side = &w->bsdf->side[side];
    w->view = facet_albedo_view_of(&w->surface, up[0], up[1], up[2]);
    w->cosine_o = facet_mean_cosine(&w->bsdf->ideal->surface, up[0], up[1], up[2]);
    facet_status status = facet_eval(w->bsdf->ideal, FACET_PRECISE, from, from, 1, &area);
    if (!status) status = integrate_rays(w, 0, &rough);
    if (!status) status = integrate_rays(w, 0.5 * tolerance * rough.value[0], &fine);
    if (!facet_bsdf_bound(w->bsdf, FACET_PRECISE, FACET_FR_COS, 0, &bound)) bound = INFINITY;
    double scale = (w->half ? 2 : 1) * w->side->scale;
    out->value[0] = scale * fine.value[0];
    /* The rules' differences are no proof: nothing far below what was aimed at is claimed. */
    out->error[0] = scale *
                    fmax(fine.error[0] + fine.value[0] * bound, 0.1 * tolerance * fine.value[0]);
    return status;
}

static facet_status open_walk(const facet_bsdf *b, const facet_albedo_options *options,
                              struct walk **walk)
{
    const facet_roughness *r = &b->ideal->material.roughness;
    facet_material standard = {
        .ndf = b->ndf, .roughness = {.alpha_x = 1, .alpha_y = 1}, .fresnel = {.channels = 1}};
    struct walk *w = calloc(1, sizeof *w);
    *walk = w;
    if (!w) return FACET_NO_MEMORY;
    facet_ellipse e = facet_roughness_to_ellipse(r);
    w->bsdf = b;
    w->watch = options->watch;
    w->surface = (struct albedo_surface){*r,
                                         b->ideal->surface.kappa_alpha_y,
                                         b->ideal->surface.rho_alpha_y,
                                         e.alpha_1,
                                         e.alpha_1 > 1,
                                         e.alpha_1 > 4 * e.alpha_2,
                                         options->tolerance < 1e-5};
    w->half = b->ideal->shape == KERNEL_ISO;
    return facet_brdf_create(&standard, &w->standard);
}

static void close_walk(struct walk *w)
{
    if (w) facet_brdf_destroy(w->standard);
    free(w);
}

static facet_status transmit(const facet_bsdf *b, facet_vec3_in wo, size_t n,
                             const facet_albedo_options *options, facet_albedo_value *transmitted,
                             size_t *evaluations)
{
    struct walk *w;
    facet_status status = open_walk(b, options, &w);
    for (size_t i = 0; i < n && !status; i++) {
        const double from[3] = {wo.x[i], wo.y[i], wo.z[i]};
        w->budget = options->evaluations_max;
        status = integrate_direction(w, from, options->tolerance, &transmitted[i]);
    }
    *evaluations += w ? w->spent : 0;
    close_walk(w);
    return status;
}

facet_status facet_bsdf_albedo(const facet_bsdf *b, facet_vec3_in wo, size_t n,
                               const facet_albedo_options *options, facet_albedo_value *reflected,
                               facet_albedo_value *transmitted, size_t *evaluations)
{
    size_t spent = 0, own = 0;
    if (!(options->tolerance >= 1e-15 && options->tolerance <= 0.1)) return FACET_UNSUPPORTED;
    facet_status status = transmit(b, wo, n, options, transmitted, &spent);
    for (size_t i = 0; i < n && !status; i++) {
        const int side = facet_side(wo.z[i]);
        const double turn = side == BELOW ? -1 : 1,
                     up[3] = {turn * wo.x[i], turn * wo.y[i], turn * wo.z[i]};
        facet_vec3_in from = {&up[0], &up[1], &up[2]};
        status = facet_albedo(&b->brdf[side]->material, from, 1, options, &reflected[i], &own);
        /* From below its index is 1/eta rounded, which moves the critical angle by as much. */
        reflected[i].error[0] += 16 * DBL_EPSILON * reflected[i].value[0];
        spent += own;
    }
    if (evaluations) *evaluations = spent;
    return status;
}
