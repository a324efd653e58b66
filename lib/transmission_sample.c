/* transmission_sample.c - samples of both lobes of a rough dielectric. */
#include "transmission.h"

#include "batch.h"

#include <string.h>

bool facet_bsdf_sampler_serves(facet_sampler sampler, facet_ndf ndf)
{
    bool visible = sampler == FACET_SAMPLER_AUTO || sampler == FACET_SAMPLER_CAPS ||
                   sampler == FACET_SAMPLER_SLOPE;
    return visible && ndf != FACET_TABULATED && facet_sampler_serves(sampler, ndf);
}

/* A block of samples; h, u3 and what is made of them as kernel_normals has it. */
struct drawn {
    double wo[3][TRANSMISSION_BLOCK], wi[3][TRANSMISSION_BLOCK], h[3][TRANSMISSION_BLOCK];
    double u[TRANSMISSION_BLOCK], density[TRANSMISSION_BLOCK], chosen[TRANSMISSION_BLOCK];
    double pdf[TRANSMISSION_BLOCK], weight[TRANSMISSION_BLOCK];
};

/* Visible normals of wo turned up, and what reflects there. */
static facet_status draw(const facet_bsdf *b, facet_tier tier, facet_sampler sampler,
                         struct drawn *d, facet_vec3_in wo, const double *u1, const double *u2,
                         size_t n)
{
    double up[3][TRANSMISSION_BLOCK];
    for (size_t i = 0; i < n; i++) {
        double turn = facet_side(wo.z[i]) == BELOW ? -1 : 1;
        up[0][i] = turn * wo.x[i], up[1][i] = turn * wo.y[i], up[2][i] = turn * wo.z[i];
    }
    const facet_samples samples = {
        .wi = {d->wi[0], d->wi[1], d->wi[2]}, .h = {d->h[0], d->h[1], d->h[2]}, .pdf = d->density};
    return facet_sample(b->ideal, tier, facet_bsdf_method(b, sampler),
                        (facet_vec3_in){up[0], up[1], up[2]}, u1, u2, n, &samples);
}

/*
 * Chooses lobes and weighs both.  Densities are those of the wi handed out, as in sample.c, but in precise:
 * next to n = 1, where the other tiers promise nothing, a wi in doubles no longer tells its normal.
 */
static void refract(const facet_bsdf *b, facet_tier tier, struct drawn *d, size_t n)
{
    struct kernel_refraction job = facet_refraction_of(b);
    struct kernel_normals normals = {.pdf = d->density, .u = d->u, .chosen = d->chosen};
    for (int j = 0; j < 3; j++) {
        for (size_t i = n; i < facet_padded(n); i++)
            d->wi[j][i] = d->wo[j][i] = d->h[j][i] = j == 2;
        job.wi[j] = d->wi[j], job.wo[j] = d->wo[j];
        normals.wi[j] = d->wi[j], normals.h[j] = d->h[j];
    }
    for (size_t i = n; i < facet_padded(n); i++) d->u[i] = d->density[i] = 0;
    facet_refractions_for(tier)->choose(&job, &normals, facet_padded(n));
    if (tier == FACET_PRECISE) job.chosen = d->chosen;
    job.out[REFRACTION_PDF] = d->pdf;
    job.out[REFRACTION_WEIGHT] = d->weight;
    facet_refract(b, tier, &job, facet_padded(n));
}

static void hand_out(const struct drawn *d, size_t start, size_t n, const facet_samples *to)
{
    const size_t bytes = n * sizeof(double);
    double *const wi[3] = {to->wi.x, to->wi.y, to->wi.z}, *const h[3] = {to->h.x, to->h.y, to->h.z};
    for (int j = 0; j < 3; j++) {
        memcpy(wi[j] + start, d->wi[j], bytes);
        if (h[j]) memcpy(h[j] + start, d->h[j], bytes);
    }
    if (to->pdf) memcpy(to->pdf + start, d->pdf, bytes);
    if (to->weight[0]) memcpy(to->weight[0] + start, d->weight, bytes);
}

facet_status facet_bsdf_sample(const facet_bsdf *b, facet_tier tier, facet_sampler sampler,
                               facet_vec3_in wo, const double *u1, const double *u2,
                               const double *u3, size_t n, const facet_samples *out)
{
    struct drawn drawn;
    facet_status status = FACET_OK;
    if (!facet_bsdf_sampler_serves(sampler, b->ndf) || (unsigned)tier >= FACET_TIER_COUNT)
        return FACET_UNSUPPORTED;
    tier = facet_bsdf_tier(b, tier);
    for (size_t start = 0, size; start < n && !status; start += size) {
        const facet_vec3_in from = {wo.x + start, wo.y + start, wo.z + start};
        size = n - start < TRANSMISSION_BLOCK ? n - start : TRANSMISSION_BLOCK;
        status = draw(b, tier, sampler, &drawn, from, u1 + start, u2 + start, size);
        if (status) break;
        memcpy(drawn.wo[0], from.x, size * sizeof(double));
        memcpy(drawn.wo[1], from.y, size * sizeof(double));
        memcpy(drawn.wo[2], from.z, size * sizeof(double));
        memcpy(drawn.u, u3 + start, size * sizeof(double));
        refract(b, tier, &drawn, size);
        hand_out(&drawn, start, size, out);
    }
    return status;
}
