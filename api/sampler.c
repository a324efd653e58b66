#include "sampler.h"

#include "material.h"

const char *const api_sampler_names[] = {"auto", "caps", "slope", NULL};

const char *api_sampler(int sampler, facet_ndf ndf, struct problem *problem)
{
    static const int of_ndf[FACET_NDF_COUNT] = {[FACET_GGX] = SAMPLER_CAPS,
                                                [FACET_BECKMANN] = SAMPLER_SLOPE,
                                                [FACET_TABULATED] = SAMPLER_AUTO};
    struct place at = {NULL, "sampler", 0};
    int own = of_ndf[ndf];
    if (sampler == SAMPLER_AUTO || sampler == own) return api_sampler_names[own];
    api_problem_at(problem, &at, "\"%s\" does not sample %s, which has: auto%s%s",
                   api_sampler_names[sampler], api_ndf_names[ndf], own ? ", " : "",
                   own ? api_sampler_names[own] : "");
    return NULL;
}
