#include "lambert.h"

#include <string.h>

/* The first member that says something of microfacets; NULL: none. */
static const char *member_of_facets(const struct material *m)
{
    for (const struct field *field = api_material_fields; field->type; field++)
        if (strcmp(field->name, "ndf") && strcmp(field->name, "reflectance") &&
            api_field_is_given(field, m))
            return field->name;
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
