/* transmission_sample.c - samples of both lobes of a rough dielectric. */
#include "transmission.h"

#include <float.h>
#include <math.h>

bool facet_bsdf_sampler_serves(facet_sampler sampler, facet_ndf ndf)
{
    bool visible = sampler == FACET_SAMPLER_AUTO || sampler == FACET_SAMPLER_CAPS || sampler == FACET_SAMPLER_SLOPE;
    return visible && ndf != FACET_TABULATED && facet_sampler_serves(sampler, ndf);
}

/* Visible normals h and what reflects there, with F, for the wo of a block. */
struct drawn {
    double h[3][TRANSMISSION_BLOCK], pdf[TRANSMISSION_BLOCK]; /* D(h) / (4 sigma(wo)) */
    double own[TRANSMISSION_BLOCK];                           /* density of the lobe that was chosen */
    bool is_refracted[TRANSMISSION_BLOCK];
};

static facet_status draw(const facet_bsdf *b, facet_sampler sampler, struct lobes *l, struct drawn *d,
                         const double *u1, const double *u2, size_t n)
{
    facet_vec3_in wo = { l->wo[0], l->wo[1], l->wo[2] };
    const facet_samples samples = { .wi = { l->wi[0], l->wi[1], l->wi[2] }, .h = { d->h[0], d->h[1], d->h[2] }, .pdf = d->pdf };
    facet_status status = facet_sample(b->ideal, FACET_PRECISE, sampler, wo, u1, u2, n, &samples);
    return status ? status : facet_lobes_fresnel(b, l, n);
}

/*
 * wi = -(wo + (c - g) h ..)/n by Snell's law, with g - c = (n^2 - 1)/(g + c), and the density of
 * facet_transmission.h over wi with |M| = |g - c|: nothing cancels, unlike M of the rounded wi.
 */
static void choose_lobe(const facet_bsdf *b, struct lobes *l, struct drawn *d, size_t i, double u3)
{
    const struct side *side = &b->side[l->side[i]];
    double n = side->index, c = 0;
    for (int j = 0; j < 3; j++) c += l->wo[j][i] * d->h[j][i];
    double g2 = side->excess + c * c;
    d->is_refracted[i] = u3 >= l->fresnel[i] && c > 0 && g2 > 0;
    d->own[i] = l->fresnel[i] * d->pdf[i];
    if (!d->is_refracted[i]) return;
    double g = sqrt(g2), bend = side->excess / (g + c);
    for (int j = 0; j < 3; j++) l->wi[j][i] = -(l->wo[j][i] + bend * d->h[j][i]) / n;
    d->own[i] = 4 * d->pdf[i] * c * facet_transmittance(n, c, g) * n * g / (bend * bend);
}

/* fr cos theta_i over the density of both lobes. */
static double weight_of(const facet_bsdf *b, const struct lobes *l, size_t i, double pdf)
{
    double z = l->wi[2][i], share = 0;
    if (z > 0) share = l->reflected.pdf[i] / pdf * l->reflected.weight[i];
    if (z < 0) share = l->transmitted.pdf[i] / pdf * l->transmitted.weight[i] * facet_transport_scale(b, l->side[i]);
    return pdf > 0 ? share : 0;
}

static void hand_out(const facet_bsdf *b, struct lobes *l, const struct drawn *d, size_t start, size_t n,
                     const facet_samples *out)
{
    double *const wi[3] = { out->wi.x, out->wi.y, out->wi.z }, *const h[3] = { out->h.x, out->h.y, out->h.z };
    for (size_t i = 0; i < n; i++) {
        double sign = l->side[i] == BELOW ? -1 : 1;
        double *own = d->is_refracted[i] ? &l->transmitted.pdf[i] : &l->reflected.pdf[i];
        *own = d->own[i];
        double pdf = fmin(l->reflected.pdf[i] + l->transmitted.pdf[i], DBL_MAX);
        for (int j = 0; j < 3; j++) {
            wi[j][start + i] = sign * l->wi[j][i];
            if (h[0]) h[j][start + i] = d->h[j][i];
        }
        if (out->pdf) out->pdf[start + i] = pdf;
        if (out->weight[0]) out->weight[0][start + i] = weight_of(b, l, i, pdf);
    }
}

facet_status facet_bsdf_sample(const facet_bsdf *b, facet_sampler sampler, facet_vec3_in wo, const double *u1,
                               const double *u2, const double *u3, size_t n, const facet_samples *out)
{
    struct lobes lobes;
    struct drawn drawn;
    facet_status status = FACET_OK;
    if (!facet_bsdf_sampler_serves(sampler, b->ndf)) return FACET_UNSUPPORTED;
    for (size_t start = 0, size; start < n && !status; start += size) {
        size = n - start < TRANSMISSION_BLOCK ? n - start : TRANSMISSION_BLOCK;
        facet_lobes_turn(&lobes, wo, wo, start, size);
        status = draw(b, sampler, &lobes, &drawn, u1 + start, u2 + start, size);
        if (status) break;
        for (size_t i = 0; i < size; i++) choose_lobe(b, &lobes, &drawn, i, u3[start + i]);
        status = facet_lobes_eval(b, &lobes, size);
        if (!status) hand_out(b, &lobes, &drawn, start, size, out);
    }
    return status;
}
