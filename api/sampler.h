/* sampler.h - the `sampler` member: which methods there are, for which distribution. */
#ifndef API_SAMPLER_H
#define API_SAMPLER_H

#include "facet.h"
#include "field.h"

enum { SAMPLER_AUTO, SAMPLER_CAPS, SAMPLER_SLOPE };
extern const char *const api_sampler_names[];

#define SAMPLER_FIELD(type_)                                                                       \
    {                                                                                              \
        MEMBER(type_, sampler), FIELD_ENUM, FIELD_DEFAULT,                                         \
            .names = api_sampler_names,                                                            \
            .doc = "visible normals: caps for ggx, slope for beckmann; auto: the one there is"     \
    }

/* The method by its own name; NULL and a 422 that lists those of this distribution. */
const char *api_sampler(int sampler, facet_ndf ndf, struct problem *problem);

#endif
