#include "diffuse.h"

#include "facet_table.h"

#include <float.h>
#include <math.h>
#include <string.h>

bool api_surface_takes_floats(const struct surface *surface)
{
    return !surface->has_diffuse && !surface->bsdf;
}

bool api_surface_ready(const struct surface *surface, facet_tier tier, struct problem *problem)
{
    const facet_slope_table *table = surface->facet.ndf == FACET_TABULATED ? surface->facet.table
                                                                           : NULL;
    return !table || tier >= FACET_EXACT32 || facet_slope_table_has_floats(table) ||
           api_problem_memory(problem);
}

double api_surface_error(const struct surface *surface)
{
    /* 1 - kd, a product, kd/pi (three roundings with pi's own) and a sum of positive terms */
    return surface->has_diffuse ? 4 * DBL_EPSILON : 0;
}

bool api_surface_sample_bound(const struct surface *surface, facet_tier tier, facet_sampler sampler,
                              double input_error, double *bound)
{
    const double cosine_error = 64 * DBL_EPSILON;
    *bound = cosine_error;
    if (surface->is_lambert) return true;
    if (!facet_sample_bound(surface->brdf, tier, sampler, input_error, bound)) return false;
    if (!surface->has_diffuse) return true;
    /* components of a cosine sample are right to 4 roundings, which the specular density sees */
    double pdf;
    if (!facet_pdf_bound(surface->brdf, tier, sampler, 16 * DBL_EPSILON, &pdf)) return false;
    *bound += 2 * pdf + cosine_error;
    return true;
}

/* F at normal incidence, mean of the channels: about how much the specular part reflects. */
static double normal_reflectance(const facet_fresnel *f)
{
    double sum = 0;
    for (size_t c = 0; c < f->channels; c++) {
        double eta = f->eta[c], k = f->k[c];
        switch (f->kind) {
        case FACET_FRESNEL_SCHLICK: sum += f->f0[c]; break;
        case FACET_FRESNEL_DIELECTRIC:
            sum += (eta - 1) * (eta - 1) / ((eta + 1) * (eta + 1));
            break;
        case FACET_FRESNEL_CONDUCTOR:
            sum += ((eta - 1) * (eta - 1) + k * k) / ((eta + 1) * (eta + 1) + k * k);
            break;
        case FACET_FRESNEL_TABLE: sum += fmin(f->values[c][f->count - 1], 1); break;
        default: sum += 1;
        }
    }
    return sum / (double)f->channels;
}

double api_diffuse_share(const struct surface *surface)
{
    static const double most = 0.95; /* a highlight is never left to chance */
    if (!surface->has_diffuse) return 0;
    if (surface->is_lambert) return 1;
    double kd = (surface->diffuse[0] + surface->diffuse[1] + surface->diffuse[2]) / 3;
    double specular = (1 - kd) * normal_reflectance(&surface->facet.fresnel);
    return kd > 0 ? fmin(kd / (kd + specular), most) : 0;
}

/* What the specular part counts. */
static double specular_weight(const struct surface *surface, size_t channel)
{
    return surface->is_lambert ? 0 : 1 - surface->diffuse[channel];
}

static void add_lambert(const struct surface *surface, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                        bool with_cos, double *const out[3])
{
    for (size_t c = 0; c < surface->channels; c++) {
        double specular = specular_weight(surface, c), lambert = surface->diffuse[c] / FACET_PI;
        for (size_t i = 0; out[c] && i < n; i++)
            if (wi.z[i] > 0 && wo.z[i] > 0)
                out[c][i] = specular * out[c][i] + lambert * (with_cos ? wi.z[i] : 1);
    }
}

static void mix_pdf(const struct surface *surface, facet_vec3_in wi, size_t n, double *pdf)
{
    double share = api_diffuse_share(surface);
    for (size_t i = 0; i < n; i++)
        pdf[i] = (1 - share) * pdf[i] + share / FACET_PI * fmax(wi.z[i], 0);
}

/* Of a Lambert surface there is none: fr, fr_cos and pdf start at 0. */
static facet_status eval_specular(const struct surface *surface, facet_tier tier,
                                  facet_sampler sampler, facet_vec3_in wi, facet_vec3_in wo,
                                  size_t n, const facet_outputs *outputs)
{
    for (int q = 0; q < FACET_QUANTITY_COUNT && surface->is_lambert; q++)
        for (int c = 0; c < 3 && outputs->of[q][c]; c++)
            memset(outputs->of[q][c], 0, n * sizeof *outputs->of[q][c]);
    if (surface->is_lambert) return FACET_OK;
    return facet_eval_sampled(surface->brdf, tier, sampler, wi, wo, n, outputs);
}

facet_status api_surface_eval(const struct surface *surface, facet_tier tier, facet_sampler sampler,
                              facet_vec3_in wi, facet_vec3_in wo, size_t n,
                              const facet_outputs *outputs)
{
    if (surface->bsdf) return facet_bsdf_eval(surface->bsdf, tier, wi, wo, n, outputs);
    facet_status status = eval_specular(surface, tier, sampler, wi, wo, n, outputs);
    if (status != FACET_OK || !surface->has_diffuse) return status;
    if (outputs->of[FACET_FR][0]) add_lambert(surface, wi, wo, n, false, outputs->of[FACET_FR]);
    if (outputs->of[FACET_FR_COS][0])
        add_lambert(surface, wi, wo, n, true, outputs->of[FACET_FR_COS]);
    if (outputs->of[FACET_PDF][0]) mix_pdf(surface, wi, n, outputs->of[FACET_PDF][0]);
    return FACET_OK;
}

/* ---- Samples ------------------------------------------------------------------------------- */

enum { BLOCK = 256 };

/* One cosine sample, and its half vector. */
static void cosine(const facet_samples *out, facet_vec3_in wo, size_t i, double u1, double u2)
{
    double s = sqrt(u1), x = s * cos(2 * FACET_PI * u2), y = s * sin(2 * FACET_PI * u2),
           z = sqrt(1 - u1);
    out->wi.x[i] = x, out->wi.y[i] = y, out->wi.z[i] = z;
    if (!out->h.x) return;
    x += wo.x[i], y += wo.y[i], z += wo.z[i];
    double length = sqrt(x * x + y * y + z * z);
    out->h.x[i] = x / length, out->h.y[i] = y / length, out->h.z[i] = z / length;
}

/* Density of the mixture and weight of the samples of one block. */
static facet_status weigh(const struct surface *surface, facet_tier tier, facet_sampler sampler,
                          facet_vec3_in wo, size_t start, size_t n, const facet_samples *out)
{
    double pdf[BLOCK];
    facet_outputs outputs = {0};
    facet_vec3_in wi = {out->wi.x + start, out->wi.y + start, out->wi.z + start},
                  from = {wo.x + start, wo.y + start, wo.z + start};
    outputs.of[FACET_PDF][0] = pdf;
    for (size_t c = 0; c < surface->channels && out->weight[0]; c++)
        outputs.of[FACET_FR_COS][c] = out->weight[c] + start;
    facet_status status = api_surface_eval(surface, tier, sampler, wi, from, n, &outputs);
    for (size_t c = 0; c < surface->channels && out->weight[0]; c++)
        for (size_t i = 0; i < n; i++) {
            double *weight = &out->weight[c][start + i];
            *weight = *weight > 0 && pdf[i] > 0 ? *weight / pdf[i] : 0;
        }
    for (size_t i = 0; out->pdf && i < n; i++) out->pdf[start + i] = pdf[i];
    return status;
}

facet_status api_surface_sample(const struct surface *surface, facet_tier tier,
                                facet_sampler sampler, facet_vec3_in wo, double *u1,
                                const double *u2, size_t n, const facet_samples *out)
{
    if (!surface->has_diffuse)
        return facet_sample(surface->brdf, tier, sampler, wo, u1, u2, n, out);
    double share = api_diffuse_share(surface);
    facet_samples specular = {.wi = out->wi, .h = out->h};
    for (size_t start = 0; start < n; start += BLOCK) {
        size_t size = n - start < BLOCK ? n - start : BLOCK;
        bool is_cosine[BLOCK];
        double below = nextafter(1, 0);
        for (size_t i = 0; i < size; i++) {
            double u = u1[start + i];
            is_cosine[i] = u < share;
            u1[start + i] = fmin(is_cosine[i] ? u / share : (u - share) / (1 - share), below);
        }
        facet_vec3_in from = {wo.x + start, wo.y + start, wo.z + start};
        specular.wi = (facet_vec3_out){out->wi.x + start, out->wi.y + start, out->wi.z + start};
        if (out->h.x)
            specular.h = (facet_vec3_out){out->h.x + start, out->h.y + start, out->h.z + start};
        facet_status status = surface->is_lambert
                                  ? FACET_OK
                                  : facet_sample(surface->brdf, tier, sampler, from, u1 + start,
                                                 u2 + start, size, &specular);
        if (status != FACET_OK) return status;
        for (size_t i = 0; i < size; i++)
            if (is_cosine[i]) cosine(out, wo, start + i, u1[start + i], u2[start + i]);
        status = weigh(surface, tier, sampler, wo, start, size, out);
        if (status != FACET_OK) return status;
    }
    return FACET_OK;
}

double api_diffuse_albedo(const struct surface *surface, size_t channel, double specular)
{
    return specular_weight(surface, channel) * specular + surface->diffuse[channel];
}
