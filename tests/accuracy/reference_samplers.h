/*
 * reference_samplers.h - the sampling methods by name, and rough glass, in quadruple precision.
 *
 * Conventions, where the papers leave a choice: m is the micronormal of the standard surface
 * (alpha = 1), h ~ the affine map of m; u1 and u2 in [0, 1) mean
 *   BOUNDED    azimuth 2 pi u1 and height u2 of the cap, in the same standard frame as caps
 *   NDF        tan theta_m = quantile(u1), m's azimuth 2 pi u2
 *   SLOPE_GGX  slope along wo by u1, across by u2 (as Beckmann's in reference_sample)
 *   VCAVITY    tan theta_m = quantile(u1), m's azimuth from that of wo's image over (-pi, pi) by u2
 *   COSINE     wi = (sqrt(u1) cos 2 pi u2, sqrt(u1) sin 2 pi u2, sqrt(1 - u1))
 * Reflection is wi = 2 (wo.h) h - wo also for an h that wo does not see (NDF): weight 0.
 */
#ifndef REFERENCE_SAMPLERS_H
#define REFERENCE_SAMPLERS_H

#include "reference.h"

enum reference_method {
    REFERENCE_BOUNDED, /* Eto & Tokuyoshi 2023; GGX, central surfaces, else K = 1 (that is caps) */
    REFERENCE_NDF,     /* Walter et al. 2007 */
    REFERENCE_SLOPE_GGX, /* Heitz & d'Eon 2014, quantiles exact */
    REFERENCE_COSINE,
    REFERENCE_VCAVITY, /* Heitz & d'Eon 2014, algorithm 3 */
    REFERENCE_METHOD_COUNT
};

void reference_sample_by(enum reference_method method, const facet_material *material,
                         const double wo[3], double u1, double u2, struct reference_sample *result);

/* Density of wi over the whole sphere; H = wi + wo exactly.  0 where the method never goes. */
quad reference_pdf_by(enum reference_method method, const facet_material *material,
                      const quad wi[3], const double wo[3], const quad H[3]);

/*
 * The u in [0, 1) that the method makes wi (COSINE) or h of: the CDF of what u1 sets, and given that
 * of what u2 sets.  Beckmann's SLOPE: for wo before the mean facet.
 */
void reference_uniforms(facet_sampler sampler, const facet_material *material, const double wo[3],
                        const quad wi[3], const quad h[3], quad u[2]);

/* The share K of the cap's lower bound (1: caps). */
quad reference_bounded_share(const facet_material *material, const double wo[3]);

/*
 * V-cavities as the paper has them: the normal of (u1, u2) as NDF draws it, its twin of the
 * opposite slope (about the mean slope), and the chance that the twin is taken.
 */
struct reference_twins {
    quad h[2][3], chance; /* of h[1] */
};
struct reference_twins reference_vcavity(const facet_material *material, const double wo[3],
                                         double u1, double u2);
/* Density of wi: G1 D/(4 c_o) of the V-cavities for wo before the mean facet. */
quad reference_vcavity_pdf(const facet_material *material, const double wo[3], const quad H[3]);

/*
 * Rough glass (Walter et al. 2007): light refracted between wi below and wo above the horizon, or
 * the other way round; eta is inside over outside, dielectric Fresnel term, central surfaces,
 * smith or smith_uncorrelated masking of wo and -wi.
 */
struct reference_refraction {
    quad h[3];     /* towards +z for wo above */
    quad f;        /* f_t */
    quad pdf;      /* of wi given wo by visible normals, and 1 - F as the chance to refract */
    quad jacobian; /* d omega_h / d omega_i */
    quad fresnel;  /* F, the chance to reflect */
};
/* All 0 but F = 1 where no facet refracts wi into wo. */
void reference_refract(const facet_material *material, const quad wi[3], const double wo[3],
                       size_t channel, struct reference_refraction *result);
/* wi that wo refracts into at the facet h; false: total reflection. */
bool reference_refracted(const facet_material *material, const double wo[3], const quad h[3],
                         size_t channel, quad wi[3]);

#endif
