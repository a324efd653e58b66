#include "lambert.h"

#include <math.h>

/* The first member that says something of microfacets; NULL: none. */
static const char *member_of_facets(const struct material *m)
{
    const struct {
        bool given;
        const char *name;
    } members[] = {
        {m->slopes != NULL, "slopes"},
        {!isnan(m->alpha), "alpha"},
        {!isnan(m->alpha_x), "alpha_x"},
        {!isnan(m->alpha_y), "alpha_y"},
        {!isnan(m->rho), "rho"},
        {!isnan(m->alpha_1), "alpha_1"},
        {!isnan(m->alpha_2), "alpha_2"},
        {!isnan(m->phi), "phi"},
        {m->moments.values != NULL, "moments"},
        {!isnan(m->height_scale), "height_scale"},
        {m->jacobian.values != NULL, "jacobian"},
        {m->base != NULL, "base"},
        {m->mean_slope.values != NULL, "mean_slope"},
        {m->masking != FACET_SMITH, "masking"},
        {m->shear != FACET_ENERGY_SAFE, "shear"},
        {m->fresnel.form == FRESNEL_BY_KEY, "fresnel"},
        {m->diffuse.channels != 0, "diffuse"},
        {m->transmission, "transmission"},
        {m->transport >= 0, "transport"},
    };
    for (size_t i = 0; i < sizeof members / sizeof *members; i++)
        if (members[i].given) return members[i].name;
    return NULL;
}

bool api_lambert_check(const struct material *m, const struct place *place, struct decoder *decoder)
{
    struct place reflectance = {place, "reflectance", 0};
    if (m->ndf != NDF_LAMBERT)
        return !m->reflectance.channels ||
               api_problem_at(decoder->problem, &reflectance, "needs ndf \"lambert\"");
    if (!m->reflectance.channels)
        return api_problem_at(decoder->problem, &reflectance,
                              "is required with ndf \"lambert\": in [0, 1]");
    struct place other = {place, member_of_facets(m), 0};
    return !other.name ||
           api_problem_at(decoder->problem, &other,
                          "is of microfacets: ndf \"lambert\" has reflectance alone");
}

bool api_lambert_refuse(const struct material *m, const struct place *place, const char *why,
                        struct problem *problem)
{
    struct place at = {place, "ndf", 0};
    return m->ndf != NDF_LAMBERT || api_problem_at(problem, &at, "\"lambert\" %s", why);
}

bool api_lambert_check_outputs(const struct material *m, uint32_t outputs, struct problem *problem)
{
    struct place at = {NULL, "outputs", 0};
    return m->ndf != NDF_LAMBERT ||
           !(outputs & ~(1u << FACET_FR | 1u << FACET_FR_COS | 1u << FACET_PDF)) ||
           api_problem_at(problem, &at,
                          "are of microfacets: ndf \"lambert\" has fr, fr_cos and pdf");
}
