#include "sampler.h"

#include "facet_transmission.h"

#include <stdio.h>

const char *const api_sampler_names[] = {
#define NAME(id, name) name,
    FACET_SAMPLER_MAP(NAME)
#undef NAME
        NULL,
};

facet_sampler api_sampler_of(const struct surface *surface, facet_sampler sampler)
{
    if (sampler != FACET_SAMPLER_AUTO) return sampler;
    if (surface->is_lambert) return FACET_SAMPLER_COSINE;
    return surface->bsdf ? facet_sampler_visible(surface->facet.ndf)
                         : facet_sampler_auto(&surface->facet);
}

static bool serves(facet_sampler method, const struct material *material)
{
    facet_ndf ndf = (facet_ndf)material->ndf;
    if (material->ndf == NDF_LAMBERT) return method == FACET_SAMPLER_COSINE;
    return material->transmission ? facet_bsdf_sampler_serves(method, ndf)
                                  : facet_sampler_serves(method, ndf);
}

uint32_t api_samplers(int ndf)
{
    const struct material material = {.ndf = ndf};
    uint32_t set = 0;
    for (int i = FACET_SAMPLER_AUTO + 1; i < FACET_SAMPLER_COUNT; i++)
        if (serves((facet_sampler)i, &material)) set |= UINT32_C(1) << i;
    return set;
}

bool api_sampler(int sampler, bool is_asked, const struct material *material,
                 struct problem *problem, facet_sampler *method)
{
    struct place at = {NULL, "sampler", 0};
    *method = (facet_sampler)sampler;
    if (sampler == FACET_SAMPLER_AUTO) return true;
    if (serves(*method, material)) {
        if (!is_asked) *method = FACET_SAMPLER_AUTO;
        facet_status status = facet_sampler_prepare(*method, (facet_ndf)material->ndf);
        return !status || api_problem_status(problem, status, &at);
    }
    char list[128];
    size_t used = (size_t)snprintf(list, sizeof list, "auto");
    for (int i = FACET_SAMPLER_AUTO + 1; i < FACET_SAMPLER_COUNT; i++)
        if (serves((facet_sampler)i, material))
            used += (size_t)snprintf(list + used, sizeof list - used, ", %s", api_sampler_names[i]);
    return api_problem_at(
        problem, &at, "\"%s\" does not sample %s, which has: %s", api_sampler_names[sampler],
        material->transmission ? "transmission" : api_ndf_names[material->ndf], list);
}
