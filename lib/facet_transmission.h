/*
 * facet_transmission.h - rough dielectrics: reflection and transmission (Walter et al. 2007).
 *
 * wo and wi may each lie above or below the surface; a BSDF whose material has the index eta,
 * inside (below) over outside (above).  In what follows n is the index on wi's side over that on
 * wo's side: eta for wo above, 1/eta for wo below.
 *
 * On wo's side fr is that of facet_eval with the Fresnel term F of n.  On the other side, with
 * M = wo + n wi (never normalised in advance), h = +-M/|M| turned up, c = |wo.h|, g = n |wi.h|:
 *
 *   fr cos theta_i = (c D(h)/sigma(wo)) T W n^2 |wi.h| / |M|^2
 *   T = 1 - F = 2 c g (1/(c + g)^2 + n^2/(n^2 c + g)^2)
 *
 * where Snell's law holds, that is where h has wo and wi on opposite sides; else 0.  This is
 * Walter's eq. 21 with the denominator o.h + n i.h = +-|M| and with T in positive terms: nothing
 * cancels but M itself, which is formed in twice the digits, so that n -> 1, grazing angles and
 * the critical angle cost no digit.
 *
 * Masking: W = G2/G1(o).  SMITH is height-correlated on both sides, which across the surface is
 * G2 = B(1 + Lambda(o), 1 + Lambda(i)) (Heitz et al. 2016); SMITH_UNCORRELATED is Walter's
 * G1(o) G1(i).  Behind the mean facet of a sheared surface SMITH gives its limit, 0.  A direction from below sees the surface that its point reflection sees from above.
 *
 * Convention: with FACET_IMPORTANCE the integral of fr cos theta_i over all wi is what is not
 * lost to masking of the flux (Walter's f_s, which conserves energy); with FACET_RADIANCE what
 * is transmitted is divided by n^2, as radiance from wi's side is.
 */
#ifndef FACET_TRANSMISSION_H
#define FACET_TRANSMISSION_H

#include "facet_albedo.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum facet_transport {
    FACET_IMPORTANCE,
    FACET_RADIANCE,
    FACET_TRANSPORT_COUNT
} facet_transport;

/*
 * A Beckmann surface whose mean slope is more than this many times its minor radius has no
 * transmission: seen from behind, its densities leave the range of numbers.
 */
#define FACET_TRANSMISSION_LEAN_MAX 16

typedef struct facet_bsdf facet_bsdf;

/*
 * UNSUPPORTED unless: GGX or Beckmann, within FACET_TRANSMISSION_LEAN_MAX; a Smith masking; shear
 * ENERGY_SAFE; a dielectric Fresnel term of one channel.  BAD_FRESNEL where its eta is 1: nothing is
 * refracted, and what is transmitted is no function of wi.
 */
facet_status facet_bsdf_create(const facet_material *material, facet_transport transport,
                               facet_bsdf **bsdf);
void facet_bsdf_destroy(facet_bsdf *bsdf); /* NULL is allowed */

/*
 * Quantities of n pairs, as facet_eval: FR, FR_COS and PDF in the tier asked for (or the next, where
 * floats do not hold the index: facet_bsdf_bound), the others in FACET_PRECISE.  Across the surface D, D_VIS, F and G are
 * those of the h that refracts wo into wi, 0 where there is none; G is that of fr = F D G/(4 z_i z_o)
 * and of Walter's eq. 21.  PDF is the density of facet_bsdf_sample over the whole sphere: that of
 * both lobes, whichever side wi is on.
 */
facet_status facet_bsdf_eval(const facet_bsdf *bsdf, facet_tier tier, facet_vec3_in wi,
                             facet_vec3_in wo, size_t n, const facet_outputs *outputs);

/* Whether this sampler draws visible normals of the distribution (AUTO included). */
bool facet_bsdf_sampler_serves(facet_sampler sampler, facet_ndf ndf);

/*
 * Sample wi for wo: a visible normal by u1, u2, reflection with probability F(wo.h) by u3, else
 * refraction; each in [0, 1).  weight = fr cos theta_i / pdf, both lobes in either: at most 1 with
 * FACET_IMPORTANCE, where a sample on the wrong side of the surface for its lobe still carries what
 * the other sends there.  pdf and weight are those of a wi within the bound of the one returned.
 */
facet_status facet_bsdf_sample(const facet_bsdf *bsdf, facet_tier tier, facet_sampler sampler,
                               facet_vec3_in wo, const double *u1, const double *u2,
                               const double *u3, size_t n, const facet_samples *samples);

/*
 * As facet_bound and facet_closeness; input_error is to be multiplied by the closeness.  The tiers below
 * FACET_PRECISE promise FR, FR_COS and PDF alone, those in float an eta in [1/8, 8] and no nearer to 1 than 1/64.
 */
bool facet_bsdf_bound(const facet_bsdf *bsdf, facet_tier tier, facet_quantity quantity,
                      double input_error, double *bound);
double facet_bsdf_closeness(const facet_bsdf *bsdf, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                            bool exact_z);

/*
 * As facet_sample_bound.  dense: some wo are on the side of the larger index, where wi leaves the
 * critical angle like a square root and is right to the root of what its normal is right to.
 */
bool facet_bsdf_sample_bound(const facet_bsdf *bsdf, facet_tier tier, facet_sampler sampler,
                             bool dense, double input_error, double *bound);

/*
 * Integrals of fr cos theta_i over wi on the side of each of n wo and on the other, as facet_albedo
 * (which see); value[0] and error[0] alone.  Their sum with FACET_IMPORTANCE is 1 minus what masking loses.
 */
facet_status facet_bsdf_albedo(const facet_bsdf *bsdf, facet_vec3_in wo, size_t n,
                               const facet_albedo_options *options, facet_albedo_value *reflected,
                               facet_albedo_value *transmitted, size_t *evaluations);

#ifdef __cplusplus
}
#endif
#endif
