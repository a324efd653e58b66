/* transmission_sample.c - samples of both lobes of a rough dielectric. */
#include "transmission.h"

#include "batch.h"

#include <float.h>
#include <math.h>

bool facet_bsdf_sampler_serves(facet_sampler sampler, facet_ndf ndf)
{
    bool visible = sampler == FACET_SAMPLER_AUTO || sampler == FACET_SAMPLER_CAPS ||
                   sampler == FACET_SAMPLER_SLOPE;
    return visible && ndf != FACET_TABULATED && facet_sampler_serves(sampler, ndf);
}

/* A block of samples: wo and wi as they are handed out, and visible normals h of wo turned up. */
struct drawn {
    double wo[3][TRANSMISSION_BLOCK], wi[3][TRANSMISSION_BLOCK],
        turn[TRANSMISSION_BLOCK];                             /* turn: -1 for wo below, else 1 */
    double h[3][TRANSMISSION_BLOCK], pdf[TRANSMISSION_BLOCK]; /* pdf: D(h) / (4 sigma(wo)) */
    double own[TRANSMISSION_BLOCK]; /* density of the lobe that was chosen */
    bool is_refracted[TRANSMISSION_BLOCK];
    double out[REFRACTION_OUTPUT_COUNT][TRANSMISSION_BLOCK];
};

/* The outputs from `first` to `last` of wi and wo. */
static void refract(const facet_bsdf *b, facet_tier tier, struct drawn *d, int first, int last,
                    size_t n)
{
    struct kernel_refraction job = facet_refraction_of(b);
    for (int j = 0; j < 3; j++) {
        job.wi[j] = d->wi[j], job.wo[j] = d->wo[j];
        for (size_t i = n; i < facet_padded(n); i++) d->wi[j][i] = d->wo[j][i] = j == 2;
    }
    for (int q = first; q <= last; q++) job.out[q] = d->out[q];
    facet_refract(b, tier, &job, facet_padded(n));
}

/* Normals, what reflects there, and F. */
static facet_status draw(const facet_bsdf *b, facet_tier tier, facet_sampler sampler,
                         struct drawn *d, facet_vec3_in wo, const double *u1, const double *u2,
                         size_t n)
{
    const double *const from[3] = {wo.x, wo.y, wo.z};
    double up[3][TRANSMISSION_BLOCK];
    for (size_t i = 0; i < n; i++) {
        d->turn[i] = facet_side(wo.z[i]) == BELOW ? -1 : 1;
        for (int j = 0; j < 3; j++) d->wo[j][i] = from[j][i], up[j][i] = d->turn[i] * from[j][i];
    }
    const facet_samples samples = {
        .wi = {d->wi[0], d->wi[1], d->wi[2]}, .h = {d->h[0], d->h[1], d->h[2]}, .pdf = d->pdf};
    facet_status status = facet_sample(b->ideal, tier, sampler,
                                       (facet_vec3_in){up[0], up[1], up[2]}, u1, u2, n, &samples);
    for (size_t i = 0; i < n; i++)
        for (int j = 0; j < 3; j++) d->wi[j][i] *= d->turn[i];
    if (!status) refract(b, tier, d, REFRACTION_FRESNEL, REFRACTION_FRESNEL, n);
    return status;
}

/*
 * wi = -(wo + (g - c) h)/n by Snell's law, with g - c = (n^2 - 1)/(g + c), and the density of
 * facet_transmission.h over wi with |M| = |g - c|: nothing cancels, unlike M of the rounded wi.
 */
static void choose_lobes(const facet_bsdf *b, struct drawn *d, const double *u3, size_t n)
{
    double c[TRANSMISSION_BLOCK], g[TRANSMISSION_BLOCK], bend[TRANSMISSION_BLOCK],
        share[SIDES][TRANSMISSION_BLOCK];
    for (size_t i = 0; i < n; i++) {
        const struct kernel_side *side = &b->side[facet_side(d->wo[2][i])];
        c[i] = 0;
        for (int j = 0; j < 3; j++) c[i] += d->turn[i] * d->wo[j][i] * d->h[j][i];
        double g2 = side->excess + c[i] * c[i];
        d->is_refracted[i] = u3[i] >= d->out[REFRACTION_FRESNEL][i] && c[i] > 0 && g2 > 0;
        d->own[i] = d->out[REFRACTION_FRESNEL][i] * d->pdf[i];
        g[i] = d->is_refracted[i] ? sqrt(g2) : 1;
        bend[i] = d->is_refracted[i] ? side->excess / (g[i] + c[i]) : 1;
    }
    for (int s = 0; s < SIDES; s++) facet_transmittance(b->side[s].index, c, g, n, share[s]);
    for (size_t i = 0; i < n; i++) {
        int s = facet_side(d->wo[2][i]);
        double index = b->side[s].index;
        if (!d->is_refracted[i]) continue;
        for (int j = 0; j < 3; j++)
            d->wi[j][i] = -(d->wo[j][i] + d->turn[i] * bend[i] * d->h[j][i]) / index;
        d->own[i] = 4 * d->pdf[i] * c[i] * share[s][i] * index * g[i] / (bend[i] * bend[i]);
    }
}

/* fr cos theta_i over the density of both lobes. */
static double weight_of(const facet_bsdf *b, const struct drawn *d, size_t i, double pdf)
{
    double z = d->turn[i] * d->wi[2][i], share = 0;
    if (z > 0)
        share = d->out[REFRACTION_REFLECTED_PDF][i] / pdf * d->out[REFRACTION_REFLECTED_WEIGHT][i];
    if (z < 0)
        share = d->out[REFRACTION_TRANSMITTED_PDF][i] / pdf *
                d->out[REFRACTION_TRANSMITTED_WEIGHT][i] * b->side[facet_side(d->wo[2][i])].scale;
    return pdf > 0 ? share : 0;
}

/* In precise the lobe that was chosen has the density of its h: a rounded wi no longer tells it
 * where n is next to 1. */
static void hand_out(const facet_bsdf *b, facet_tier tier, struct drawn *d, size_t start, size_t n,
                     const facet_samples *to)
{
    double *const wi[3] = {to->wi.x, to->wi.y, to->wi.z}, *const h[3] = {to->h.x, to->h.y, to->h.z};
    for (size_t i = 0; i < n; i++) {
        double *chosen =
            d->out[d->is_refracted[i] ? REFRACTION_TRANSMITTED_PDF : REFRACTION_REFLECTED_PDF];
        if (tier == FACET_PRECISE) chosen[i] = d->own[i];
        double pdf = fmin(
            d->out[REFRACTION_REFLECTED_PDF][i] + d->out[REFRACTION_TRANSMITTED_PDF][i], DBL_MAX);
        for (int j = 0; j < 3; j++) {
            wi[j][start + i] = d->wi[j][i];
            if (h[0]) h[j][start + i] = d->h[j][i];
        }
        if (to->pdf) to->pdf[start + i] = pdf;
        if (to->weight[0]) to->weight[0][start + i] = weight_of(b, d, i, pdf);
    }
}

facet_status facet_bsdf_sample(const facet_bsdf *b, facet_tier tier, facet_sampler sampler,
                               facet_vec3_in wo, const double *u1, const double *u2,
                               const double *u3, size_t n, const facet_samples *out)
{
    struct drawn drawn;
    facet_status status = FACET_OK;
    if (!facet_bsdf_sampler_serves(sampler, b->ndf) || (unsigned)tier >= FACET_TIER_COUNT)
        return FACET_UNSUPPORTED;
    for (size_t start = 0, size; start < n && !status; start += size) {
        const facet_vec3_in from = {wo.x + start, wo.y + start, wo.z + start};
        size = n - start < TRANSMISSION_BLOCK ? n - start : TRANSMISSION_BLOCK;
        status = draw(b, tier, sampler, &drawn, from, u1 + start, u2 + start, size);
        if (status) break;
        choose_lobes(b, &drawn, u3 + start, size);
        refract(b, tier, &drawn, REFRACTION_REFLECTED_PDF, REFRACTION_TRANSMITTED_WEIGHT, size);
        hand_out(b, tier, &drawn, start, size, out);
    }
    return status;
}
