#include "transmission.h"

#include "facet_transmission.h"

#include <math.h>

const char *const api_transport_names[] = {"importance", "radiance", NULL};

_Static_assert(FACET_TRANSPORT_COUNT ==
                   sizeof api_transport_names / sizeof *api_transport_names - 1,
               "every transport has a name on the wire");

static bool refuse_fresnel(const struct material *m, const struct place *place,
                           struct problem *problem)
{
    struct place fresnel = {place, "fresnel", 0}, kind = {&fresnel, "dielectric", 0},
                 eta = {&kind, "eta", 0};
    if (m->fresnel.form != FRESNEL_BY_KEY || !m->fresnel.dielectric)
        return api_problem_at(problem, &fresnel,
                              "must be {\"dielectric\":{\"eta\":x}} with transmission");
    const struct colour *colour = &m->fresnel.dielectric->eta;
    if (colour->channels != 1)
        return api_problem_at(
            problem, &eta,
            "[%g,%g,%g] refract into three directions: must be one number with transmission",
            colour->value[0], colour->value[1], colour->value[2]);
    if (colour->value[0] == 1)
        return api_problem_at(
            problem, &eta,
            "1 refracts nothing: with transmission eta must be in [%g, 1) or (1, %g]",
            FACET_ETA_MIN, FACET_ETA_MAX);
    return true;
}

bool api_transmission_check(const struct material *m, const struct place *place,
                            struct decoder *decoder)
{
    struct problem *problem = decoder->problem;
    struct place ndf = {place, "ndf", 0}, masking = {place, "masking", 0},
                 shear = {place, "shear", 0}, diffuse = {place, "diffuse", 0},
                 transport = {place, "transport", 0};
    if (!m->transmission)
        return m->transport < 0 ||
               api_problem_at(problem, &transport, "\"%s\" needs \"transmission\":true",
                              api_transport_names[m->transport]);
    if (m->ndf != FACET_GGX && m->ndf != FACET_BECKMANN)
        return api_problem_at(problem, &ndf,
                              "\"%s\" has no transmission, must be \"ggx\" or \"beckmann\"",
                              api_ndf_names[m->ndf]);
    if (m->masking != FACET_SMITH && m->masking != FACET_SMITH_UNCORRELATED)
        return api_problem_at(
            problem, &masking,
            "\"%s\" has no transmission, must be \"smith\" or \"smith_uncorrelated\"",
            api_masking_names[m->masking]);
    if (m->shear != FACET_ENERGY_SAFE)
        return api_problem_at(problem, &shear,
                              "\"%s\" has no transmission, must be \"energy_safe\"",
                              api_shear_names[m->shear]);
    if (m->diffuse.channels)
        return api_problem_at(problem, &diffuse,
                              "has no place beside transmission: drop one of them");
    return refuse_fresnel(m, place, problem);
}

static void destroy_bsdf(void *bsdf)
{
    facet_bsdf_destroy(bsdf);
}

bool api_transmission_open(const struct material *m, const struct place *place,
                           struct decoder *decoder, struct surface *surface)
{
    struct place at = {place, "mean_slope", 0};
    if (!m->transmission) return true;
    const facet_roughness *r = &surface->facet.roughness;
    facet_transport transport = m->transport < 0 ? FACET_IMPORTANCE : (facet_transport)m->transport;
    facet_status status = facet_bsdf_create(&surface->facet, transport, &surface->bsdf);
    if (status == FACET_UNSUPPORTED) /* all else has been checked */
        return api_problem_at(
            decoder->problem, &at,
            "has the length %.6g, must be no longer than %d times the minor roughness %.6g with ndf "
            "\"beckmann\" and transmission",
            hypot(r->slope_x, r->slope_y), FACET_TRANSMISSION_LEAN_MAX,
            facet_roughness_to_ellipse(r).alpha_2);
    if (status) return api_problem_status(decoder->problem, status, place);
    return api_arena_defer(decoder->arena, destroy_bsdf, surface->bsdf) ||
           api_problem_memory(decoder->problem);
}

bool api_transmission_refuse(const struct material *m, const struct place *place, const char *why,
                             struct problem *problem)
{
    struct place at = {place, "transmission", 0};
    return !m->transmission || api_problem_at(problem, &at, "%s", why);
}

bool api_transmission_bound(const struct surface *surface, facet_tier tier, facet_quantity quantity,
                            double input_error, double *bound)
{
    return facet_bsdf_bound(surface->bsdf, tier, quantity, input_error, bound);
}

bool api_transmission_sample_bound(const struct surface *surface, facet_tier tier,
                                   facet_sampler sampler, bool is_dense, double input_error,
                                   double *bound)
{
    return facet_bsdf_sample_bound(surface->bsdf, tier, sampler, is_dense, input_error, bound);
}
