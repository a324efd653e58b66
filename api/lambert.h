/* lambert.h - ndf "lambert": fr = reflectance/pi, without microfacets. */
#ifndef API_LAMBERT_H
#define API_LAMBERT_H

#include "material.h"

/* What goes with lambert, and its reflectance nowhere else. */
bool api_lambert_check(const struct material *material, const struct place *place,
                       struct decoder *decoder);
/* 422 where an endpoint has nothing for such a surface. */
bool api_lambert_refuse(const struct material *material, const struct place *place, const char *why,
                        struct problem *problem);
/* The same at the outputs asked for: a bit per facet_quantity. */
bool api_lambert_check_outputs(const struct material *material, uint32_t outputs,
                               struct problem *problem);

#endif
