/* transmission.h - what evaluation, sampling, albedo and bounds of a BSDF share (internal). */
#ifndef FACET_TRANSMISSION_INTERNAL_H
#define FACET_TRANSMISSION_INTERNAL_H

#include "facet_transmission.h"

#include "brdf.h"
#include "kernel/refraction.h"

struct facet_bsdf {
    facet_brdf *brdf[SIDES]; /* what reflects, as wo sees it from one side */
    facet_brdf *ideal;       /* the same surface with F = 1 */
    struct kernel_side side[SIDES];
    facet_ndf ndf;
    bool is_correlated;
    bool floats_hold; /* the float tiers' differences and powers stay in range */
};

/* The side of a direction; 0 counts as above. */
static inline int facet_side(double z)
{
    return z < 0 ? BELOW : ABOVE;
}

/* Of both lobes AUTO is by the visible normals, whose density theirs is made of. */
static inline facet_sampler facet_bsdf_method(const facet_bsdf *b, facet_sampler sampler)
{
    return sampler == FACET_SAMPLER_AUTO ? facet_sampler_visible(b->ndf) : sampler;
}

enum { TRANSMISSION_BLOCK = 256 };

/* A batch of this surface without directions and outputs. */
struct kernel_refraction facet_refraction_of(const facet_bsdf *bsdf);

/* The tier that really runs. */
facet_tier facet_bsdf_tier(const facet_bsdf *bsdf, facet_tier tier);

/*
 * Runs n <= TRANSMISSION_BLOCK pairs, a multiple of KERNEL_LANES, in a tier; what that leaves
 * without a number again in precise.
 */
void facet_refract(const facet_bsdf *bsdf, facet_tier tier, const struct kernel_refraction *job,
                   size_t n);

/* 1 - F of n <= TRANSMISSION_BLOCK normals with cosines c = wo.h and g = index |wi.h|, as the
 * kernels have it. */
void facet_transmittance(double index, const double *c, const double *g, size_t n, double *to);

/* W of facet_transmission.h: sigma(wo), sigma(-wi) and the cosines of wo, of n <=
 * TRANSMISSION_BLOCK -wi with the mean facet. */
void facet_transmission_masking(const facet_bsdf *bsdf, double sigma_o, double cosine_o,
                                const double *sigma_i, const double *cosine_i, size_t n,
                                double *to);

#endif
