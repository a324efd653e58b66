/* sampler.h - the `sampler` member: which methods there are, for which distribution. */
#ifndef API_SAMPLER_H
#define API_SAMPLER_H

#include "facet.h"
#include "field.h"

/* In the order of facet_sampler. */
extern const char *const api_sampler_names[];

#define SAMPLER_FIELD(type_)                                                                       \
    {                                                                                              \
        MEMBER(type_, sampler), FIELD_ENUM, FIELD_DEFAULT,                                         \
            .names = api_sampler_names,                                                            \
            .doc = "visible normals: caps (ggx; bounded: without most of what falls below the "    \
                   "horizon), slope, table; vcavity: those of V-cavities; ndf: all "                \
                   "normals; cosine: of wi; auto: caps for ggx, slope for beckmann, table for "     \
                   "tabulated"                                                                      \
    }

/* The methods that sample this distribution, a bit each; AUTO is not among them. */
uint32_t api_samplers(facet_ndf ndf);

/* The method asked for, AUTO resolved; false and a 422 that lists those of this distribution. */
bool api_sampler(int sampler, facet_ndf ndf, struct problem *problem, facet_sampler *method);

#endif
