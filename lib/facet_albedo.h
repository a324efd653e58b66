/*
 * facet_albedo.h - directional albedo, the integral of fr cos theta_i over the
 * hemisphere of wi, and its cosine-weighted mean over the hemisphere of wo.
 *
 * By deterministic adaptive quadrature; every number comes with an error that
 * includes what the evaluation itself may be off by.  An ideal Fresnel term
 * makes it the white furnace: 1 minus what masking (and the horizon) loses.
 */
#ifndef FACET_ALBEDO_H
#define FACET_ALBEDO_H

#include "facet.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct facet_albedo_options {
    double tolerance; /* relative error aimed at, in [1e-15, 0.1] */
    size_t
        evaluations_max; /* of fr, per direction (for the mean: in all); beyond, nothing is refined */
    facet_watch watch;   /* asked every few thousand evaluations */
} facet_albedo_options;

/* An absolute error: |value - exact| <= error.  Infinite where nothing can be promised. */
typedef struct facet_albedo_value {
    double value[3], error[3]; /* one entry, or three where the Fresnel term has three channels */
} facet_albedo_value;

/*
 * Albedo of each of n directions wo; 0 for those on or below the horizon.  The
 * material's table, if any, must live through the call.  A tolerance that was
 * not met shows in the errors.  *evaluations, if not NULL, is how many fr it took.
 * Fails as facet_brdf_create does, with NO_MEMORY or with CANCELLED.
 */
facet_status facet_albedo(const facet_material *material, facet_vec3_in wo, size_t n,
                          const facet_albedo_options *options, facet_albedo_value *albedo,
                          size_t *evaluations);

/* (1/pi) integral of albedo(wo) cos theta_o over the hemisphere. */
facet_status facet_albedo_average(const facet_material *material,
                                  const facet_albedo_options *options, facet_albedo_value *average,
                                  size_t *evaluations);

#ifdef __cplusplus
}
#endif
#endif
