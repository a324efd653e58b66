/*
 * diffuse.h - a surface evaluated and sampled: what lib does, and the diffuse part on top of it,
 * f_r = (1 - kd) f_specular + kd/pi (Dupuy eq. 5.4); of a Lambert surface kd/pi alone.
 *
 * A sample is drawn from the cosine with the probability `share` that u1 says, else
 * from the specular sampler; its density is that mixture's.
 */
#ifndef API_DIFFUSE_H
#define API_DIFFUSE_H

#include "material.h"

/*
 * facet_eval of a surface (facet_bsdf_eval with transmission), diffuse part included: fr, fr_cos, and the
 * pdf of that specular sampler.
 */
facet_status api_surface_eval(const struct surface *surface, facet_tier tier, facet_sampler sampler,
                              facet_vec3_in wi, facet_vec3_in wo, size_t n,
                              const facet_outputs *outputs);
/* facet_sample of a surface; u1 is used up: overwritten. */
facet_status api_surface_sample(const struct surface *surface, facet_tier tier,
                                facet_sampler sampler, facet_vec3_in wo, double *u1,
                                const double *u2, size_t n, const facet_samples *samples);

/* Whether lib's float calls do all of it: no diffuse part, no transmission. */
bool api_surface_takes_floats(const struct surface *surface);

/* Makes what the tier works on.  False, a problem: there is no memory; lib would serve a finer tier unasked. */
bool api_surface_ready(const struct surface *surface, facet_tier tier, struct problem *problem);

/* What the diffuse part adds to the bound of an evaluation. */
double api_surface_error(const struct surface *surface);
/* facet_sample_bound of a surface. */
bool api_surface_sample_bound(const struct surface *surface, facet_tier tier, facet_sampler sampler,
                              double input_error, double *bound);

/* The albedo of one channel from that of its specular part. */
double api_diffuse_albedo(const struct surface *surface, size_t channel, double specular);

/* Probability of a cosine sample: 0 without a diffuse part. */
double api_diffuse_share(const struct surface *surface);

#endif
