#include "albedo_material.h"

#include "roughness.h"
#include "slope_table.h"
#include "watch.h"

#include <float.h>
#include <math.h>

/* Where F as a function of theta_d bends: the nodes of a table, the critical angle. */
static void find_kinks(struct albedo_material *a)
{
    const facet_fresnel *f = &a->material.fresnel;
    for (size_t i = 0; f->kind == FACET_FRESNEL_TABLE && i < f->count; i++)
        a->kink[a->kinks++] = f->cos_theta_d[i] * f->cos_theta_d[i];
    for (size_t c = 0; f->kind == FACET_FRESNEL_DIELECTRIC && c < f->channels; c++)
        if (f->eta[c] < 1) a->kink[a->kinks++] = (1 - f->eta[c]) * (1 + f->eta[c]);
    a->has_root = f->kind == FACET_FRESNEL_DIELECTRIC && a->kinks > 0;
}

facet_status facet_albedo_open(struct albedo_material *a, const facet_material *m,
                               const facet_albedo_options *options)
{
    const facet_roughness *r = &m->roughness;
    *a = (struct albedo_material){.material = *m};
    if (!(options->tolerance >= 1e-15 && options->tolerance <= 0.1)) return FACET_UNSUPPORTED;
    facet_material standard = {.ndf = m->ndf,
                               .roughness = {.alpha_x = 1, .alpha_y = 1},
                               .fresnel = {.channels = 1},
                               .table = m->table};
    facet_status status = facet_brdf_create(m, &a->brdf);
    if (!status) status = facet_brdf_create(&standard, &a->standard);
    if (status) return status;
    const struct roughness_form form = facet_roughness_form(r);
    facet_ellipse e = facet_roughness_to_ellipse(r);
    a->surface = (struct albedo_surface){*r,
                                         form.conditional.hi,
                                         form.correlated.hi,
                                         e.alpha_1,
                                         e.alpha_1 > 1,
                                         e.alpha_1 > 4 * e.alpha_2,
                                         options->tolerance < 1e-5};
    a->det = r->alpha_x * form.conditional.hi;
    a->scale = m->ndf == FACET_TABULATED ? m->table->view.psi_scale : 1;
    a->channels = m->fresnel.channels;
    a->watch = options->watch;
    a->turned = m->ndf == FACET_TABULATED && facet_slope_table_is_turned(&m->table->view);
    a->is_central = r->slope_x == 0 && r->slope_y == 0;
    a->half = a->is_central && r->alpha_x == r->alpha_y && r->rho == 0 && !a->turned;
    a->budget = options->evaluations_max;
    find_kinks(a);
    return FACET_OK;
}

void facet_albedo_close(struct albedo_material *a)
{
    facet_brdf_destroy(a->brdf);
    facet_brdf_destroy(a->standard);
}

facet_status facet_albedo_evaluate(struct albedo_material *a, struct albedo_pairs *k)
{
    facet_vec3_in wi = {k->ix, k->iy, k->iz}, wo = {k->ox, k->oy, k->oz};
    facet_outputs outputs = {.of = {[FACET_D] = {k->d}}};
    for (size_t c = 0; c < a->channels; c++) outputs.of[FACET_FR_COS][c] = k->fr_cos[c];
    facet_status status = facet_eval(a->brdf, FACET_PRECISE, wi, wo, ALBEDO_POINTS, &outputs);
    if (!status && a->material.shear == FACET_THESIS) {
        double condition;
        status = facet_condition(a->brdf, wi, wo, ALBEDO_POINTS, &condition);
        a->condition = fmax(a->condition, condition);
    }
    if (a->material.ndf == FACET_TABULATED && !a->is_central)
        facet_depth_survey(a->brdf, FACET_SAMPLER_AUTO, wi, wo, ALBEDO_POINTS, &a->depth);
    a->budget -= a->budget < ALBEDO_POINTS ? a->budget : ALBEDO_POINTS;
    a->spent += ALBEDO_POINTS;
    a->since_asked += ALBEDO_POINTS;
    return status;
}

facet_status facet_albedo_density(const struct albedo_material *a, const double r[ALBEDO_POINTS],
                                  double cosine, double sine, double p[ALBEDO_POINTS])
{
    double x[ALBEDO_POINTS], y[ALBEDO_POINTS], z[ALBEDO_POINTS];
    for (int i = 0; i < ALBEDO_POINTS; i++) {
        x[i] = -0.5 * r[i] * (a->turned ? cosine : 1);
        y[i] = -0.5 * r[i] * (a->turned ? sine : 0);
        z[i] = 0.5;
    }
    facet_vec3_in m = {x, y, z};
    facet_outputs density = {.of = {[FACET_D] = {p}}};
    facet_status status = facet_eval(a->standard, FACET_PRECISE, m, m, ALBEDO_POINTS, &density);
    for (int i = 0; i < ALBEDO_POINTS && !status; i++) {
        double n = 1 + r[i] * r[i];
        p[i] /= n * n;
    }
    return status;
}

double facet_albedo_evaluation_bound(const struct albedo_material *a)
{
    double fr_cos, d, p;
    if (!facet_bound(a->brdf, FACET_PRECISE, FACET_FR_COS, 0, &fr_cos) ||
        !facet_bound(a->brdf, FACET_PRECISE, FACET_D, 0, &d) ||
        !facet_bound(a->standard, FACET_PRECISE, FACET_D, 0, &p))
        return INFINITY;
    double behind = facet_depth_error(a->brdf, FACET_PRECISE, FACET_FR_COS, FACET_SAMPLER_AUTO,
                                      &a->depth);
    return (fr_cos + behind) * a->condition + d + p + 32 * DBL_EPSILON;
}

facet_status facet_albedo_ask(struct albedo_material *a)
{
    if (a->since_asked < 4096) return FACET_OK;
    a->since_asked = 0;
    return facet_is_cancelled(&a->watch) ? FACET_CANCELLED : FACET_OK;
}

void facet_albedo_be_modest(const struct albedo_material *a, double tolerance,
                            facet_albedo_value *of)
{
    for (size_t c = 0; c < a->channels; c++)
        of->error[c] = fmax(of->error[c], 0.1 * tolerance * fabs(of->value[c]));
}
