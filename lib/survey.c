/*
 * survey.c - what bounds need to know of the directions, where they depend on them: how ill-conditioned
 * they are, how close to a singularity, and how far behind a surface its table is asked for sigma.
 */
#include "batch.h"
#include "slope_table.h"
#include "table_closed.h"

#include <math.h>

facet_status facet_condition(const facet_brdf *brdf, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                             double *condition)
{
    *condition = 1;
    if (brdf->masking != KERNEL_SMITH_THESIS && brdf->masking != KERNEL_UNCORRELATED_THESIS)
        return FACET_OK;
    double out[BLOCK];
    for (size_t start = 0; start < n; start += BLOCK) {
        size_t size = n - start < BLOCK ? n - start : BLOCK;
        struct batch batch = {.brdf = brdf,
                              .tier = FACET_PRECISE,
                              .wi = {facet_doubles(wi.x + start), facet_doubles(wi.y + start),
                                     facet_doubles(wi.z + start)},
                              .wo = {facet_doubles(wo.x + start), facet_doubles(wo.y + start),
                                     facet_doubles(wo.z + start)}};
        batch.out[KERNEL_CONDITION][0] = facet_doubles(out);
        facet_batch_run(&batch, size);
        for (size_t i = 0; i < size; i++) *condition = fmax(*condition, out[i]);
    }
    return FACET_OK;
}

/* By hand and not fmin, which is a call; no number of these is none. */
static double least(double a, double b)
{
    return a < b ? a : b;
}

double facet_closeness(const facet_brdf *brdf, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                       bool exact_z)
{
    const struct kernel_surface *s = &brdf->surface;
    bool leans = brdf->shape == KERNEL_SHEARED;
    double closest = 1, shortest2 = 1; /* |H|^2: one root for all of them */
    for (size_t i = 0; i < n; i++) {
        double x = wi.x[i] + wo.x[i], y = wi.y[i] + wo.y[i], z = wi.z[i] + wo.z[i];
        shortest2 = least(shortest2, x * x + y * y + z * z);
        if (leans || !exact_z) {
            double ci = wi.z[i] - wi.x[i] * s->slope_x - wi.y[i] * s->slope_y;
            double co = wo.z[i] - wo.x[i] * s->slope_x - wo.y[i] * s->slope_y;
            closest = least(closest, least(fabs(ci), fabs(co)));
        }
        if (!exact_z) closest = least(closest, least(fabs(wi.z[i]), fabs(wo.z[i])));
        if (!exact_z || wi.z[i] * wo.z[i] < 0) closest = least(closest, fabs(z));
    }
    closest = least(closest, sqrt(shortest2));
    return closest > 0 ? 1 / closest : INFINITY;
}

/* ---- Far behind ------------------------------------------------------------------------- */

/* |c|/s of a direction from behind; 0 in front, and from `end` on, where nothing is seen and nothing wrong. */
static double depth_of(const struct kernel_surface *s, double end, double x, double y, double z)
{
    double c = z - x * s->slope_x - y * s->slope_y;
    if (!(c < 0)) return 0;
    double depth = -c / hypot(s->alpha_x * x + s->rho_alpha_y * y, s->kappa_alpha_y * y);
    return depth < end ? depth : 0;
}

void facet_depth_survey(const facet_brdf *brdf, facet_sampler sampler, facet_vec3_in wi,
                        facet_vec3_in wo, size_t n, facet_depth *depth)
{
    const struct kernel_surface *s = &brdf->surface;
    const facet_slope_table *table = facet_table_behind(brdf, sampler);
    if (!table) return;
    /* GGX and Beckmann are seen from everywhere: their tables end too early. */
    double end = brdf->material.ndf == FACET_TABULATED ? table->end : INFINITY;
    for (size_t k = 0; k < n; k++) {
        double o = depth_of(s, end, wo.x[k], wo.y[k], wo.z[k]);
        depth->wo = fmax(depth->wo, o);
        if (!(wi.z[k] > 0 && wo.z[k] > 0)) continue;
        double i = depth_of(s, end, wi.x[k], wi.y[k], wi.z[k]);
        depth->least = fmax(depth->least, fmin(i, o));
        depth->most = fmax(depth->most, fmax(i, o));
    }
}
