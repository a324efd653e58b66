/* transmission.h - materials with "transmission": what they may be, opened, bounds, both lobes. */
#ifndef API_TRANSMISSION_H
#define API_TRANSMISSION_H

#include "material.h"

/* In the order of facet_transport. */
extern const char *const api_transport_names[];

/* What goes with transmission, and nothing of it without. */
bool api_transmission_check(const struct material *material, const struct place *place,
                            struct decoder *decoder);
/* surface->bsdf, where the material has transmission. */
bool api_transmission_open(const struct material *material, const struct place *place,
                           struct decoder *decoder, struct surface *surface);

/* 422 where an endpoint has nothing for transmission yet. */
bool api_transmission_refuse(const struct material *material, const struct place *place,
                             const char *why, struct problem *problem);

/* facet_bound, facet_pdf_bound and facet_closeness of a surface with transmission. */
bool api_transmission_bound(const struct surface *surface, facet_tier tier, facet_quantity quantity,
                            double input_error, double *bound);
/* facet_sample_bound; is_dense: some wo are on the side of the larger index. */
bool api_transmission_sample_bound(const struct surface *surface, facet_tier tier,
                                   facet_sampler sampler, bool is_dense, double input_error,
                                   double *bound);

#endif
