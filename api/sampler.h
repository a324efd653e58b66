/* sampler.h - the `sampler` member: which methods there are, for which distribution. */
#ifndef API_SAMPLER_H
#define API_SAMPLER_H

#include "facet.h"
#include "field.h"
#include "material.h"

/* In the order of facet_sampler. */
extern const char *const api_sampler_names[];

/* `role_` says what the endpoint does with it. */
#define SAMPLER_FIELD(type_, role_)                                                                \
    {                                                                                              \
        MEMBER(type_, sampler), FIELD_ENUM, FIELD_DEFAULT,                                         \
            .names = api_sampler_names,                                                            \
            .doc = role_                                                                           \
            "; visible normals: caps (ggx), bounded (ggx; caps without most of what "              \
            "falls below the horizon), slope (ggx, beckmann), table; vcavity (ggx, "               \
            "beckmann): those of V-cavities; ndf: all normals; cosine: of wi; auto: "              \
            "bounded for ggx without a mean slope, of minor radius 0.1 or more, else "             \
            "caps; vcavity for beckmann with masking vgroove, else slope; table for tabulated; "   \
            "cosine, the only one, for lambert; with transmission caps and slope, auto too"        \
    }

/* The methods that sample this ndf of a material, a bit each; AUTO is not among them. */
uint32_t api_samplers(int ndf);
/* What AUTO stands for on a surface; others as they are. */
facet_sampler api_sampler_of(const struct surface *surface, facet_sampler sampler);

/*
 * The method named, AUTO left to api_sampler_of; a 422 lists those of this material.  It is made ready,
 * which for a table takes milliseconds; where nothing is asked of it, it is AUTO, always ready.
 */
bool api_sampler(int sampler, bool is_asked, const struct material *material,
                 struct problem *problem, facet_sampler *method);

#endif
