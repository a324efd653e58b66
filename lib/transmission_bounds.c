/* transmission_bounds.c - the error promised for a BSDF: that of its pieces, and what refraction adds. */
#include "transmission.h"

#include "opposite.h"

#include <float.h>
#include <math.h>

/* Of what the index, the Fresnel term, the Jacobian and powers in masking add to D and sigma (accuracy.def). */
static double refraction_bound(facet_tier tier, facet_ndf ndf)
{
#define PROMISE(t, n, q, bound)
#define FRESNEL(t, kind, own, added)
#define SAMPLER(t, s, pdf, added)
#define TRANSMISSION(t, n, bound)                                                                  \
    if (FACET_##t == tier && FACET_##n == ndf) return bound;
#include "accuracy.def"
#undef PROMISE
#undef FRESNEL
#undef SAMPLER
#undef TRANSMISSION
#undef ALL_QUANTITIES
    return NAN;
}

/*
 * W = G2/G1(o) of two cosines that are exact and two sigmas.  Correlated, |d log W/d log| of either
 * argument is at most |log W|, and log(2 + a) more in b = sigma/c - 1, but where (GGX) the excess
 * sigma - c is had without the difference.  The tiers below precise leave a W below
 * TRANSMISSION_WEIGHT_LEAST and a larger a to it.  There a result above the floor has
 * W > 1e-30 times 1e-48, the inverse of the largest density there is; a = sigma_o/c_o has no more
 * than a double's exponent.
 */
static double masking_bound(const facet_bsdf *b, facet_tier tier, double sigma)
{
    bool precise = tier == FACET_PRECISE;
    const double log_w = precise ? 180 : -log(TRANSMISSION_WEIGHT_LEAST),
                 log_a = precise ? 745 : log(2 + TRANSMISSION_LAMBDA_MOST);
    if (!b->is_correlated) return sigma + DBL_EPSILON;
    if (precise) return (2 * log_w + log_a) * (sigma + 2 * DBL_EPSILON) + OPPOSITE_ERROR(log_w);
    return (2 * log_w + (b->ndf == FACET_GGX ? 0 : log_a)) * sigma;
}

/* Of the transmitted lobe. */
static bool across_bound(const facet_bsdf *b, facet_tier tier, facet_quantity quantity,
                         double input_error, double *bound)
{
    double d, sigma, seen, own = refraction_bound(tier, b->ndf) + 8 * input_error;
    if (!facet_bound(b->ideal, tier, FACET_D, input_error, &d) ||
        !facet_bound(b->ideal, tier, FACET_SIGMA_O, input_error, &sigma) ||
        !facet_bound(b->ideal, tier, FACET_PDF, input_error, &seen))
        return false;
    double masking = masking_bound(b, tier, sigma + input_error);
    switch (quantity) {
    case FACET_F: *bound = own; break;
    case FACET_D: *bound = own + d; break;
    case FACET_SIGMA_O:
    case FACET_G1_I:
    case FACET_G1_O: *bound = own + sigma; break;
    case FACET_PDF:
    case FACET_D_VIS:
        *bound = own + seen;
        break; /* D / sigma, as in the density of what reflects */
    case FACET_G: *bound = own + sigma + masking; break;
    default: *bound = own + seen + masking; break;
    }
    return true;
}

/*
 * Of F on wo's side, whose g^2 is formed a step wider than the tier: how it leaves the critical angle
 * is that of the tier whose step it is.
 */
static bool fresnel_bound(const facet_bsdf *b, facet_tier tier, double input_error, double *bound)
{
    const facet_tier wider = tier < FACET_EXACT32 ? FACET_EXACT32 : FACET_PRECISE;
    double worst = 0;
    for (int i = 0; i < SIDES; i++) {
        double of_side;
        if (!facet_bound(b->brdf[i], wider, FACET_F, 0, &of_side)) return false;
        worst = fmax(worst,
                     of_side + 8 * input_error); /* next to the critical angle: closeness_same */
    }
    *bound = worst + (tier == FACET_PRECISE ? 0 : refraction_bound(tier, b->ndf));
    return true;
}

bool facet_bsdf_bound(const facet_bsdf *b, facet_tier tier, facet_quantity quantity,
                      double input_error, double *bound)
{
    bool rendered = quantity == FACET_FR || quantity == FACET_FR_COS || quantity == FACET_PDF;
    double same, across, fresnel = 0;
    *bound = INFINITY;
    if ((tier != FACET_PRECISE && !rendered) || (tier < FACET_EXACT32 && !b->floats_hold))
        return false;
    if (!facet_bound(b->ideal, tier, quantity, input_error, &same) ||
        !across_bound(b, tier, quantity, input_error, &across))
        return false;
    if ((rendered || quantity == FACET_F) && !fresnel_bound(b, tier, input_error, &fresnel))
        return false;
    *bound = fmax(same + fresnel, across) + DBL_EPSILON;
    return isfinite(*bound);
}

/* Relative errors of M, c, g and, where they are not exact, of cosines, in units of the error of wi and wo. */
static double closeness_across(const facet_bsdf *b, const double wi[3], const double wo[3],
                               bool exact_z)
{
    double n = b->side[facet_side(wo[2])].index, m[3], to_o = 0, to_i = 0, length2 = 0;
    for (int j = 0; j < 3; j++) {
        m[j] = wo[j] + n * wi[j];
        to_o += m[j] * wo[j];
        to_i += m[j] * wi[j];
        length2 += m[j] * m[j];
    }
    double length = sqrt(length2), least = fmin(fmin(fabs(to_o), fabs(to_i)), fabs(m[2]));
    if (!(least > 0)) return INFINITY;
    const double *const both[] = {wi, wo};
    double worst = fmax(1, length / least);
    for (int k = 0; k < 2; k++) {
        double c = facet_mean_cosine(&b->ideal->surface, both[k][0], both[k][1], both[k][2]);
        if (b->ideal->shape == KERNEL_SHEARED || !exact_z) worst = fmax(worst, 1 / fabs(c));
        if (!exact_z) worst = fmax(worst, 1 / fabs(both[k][2]));
    }
    return worst * (1 + n) / length;
}

/*
 * F of the index n at c is that of 1/n at g/n, whose relative slope is at most 8: c/(g n) times that at c.
 * Closer to the critical angle than the error itself the root of it is what F is off by; hence the 4.
 */
static double closeness_same(const facet_bsdf *b, const double wi[3], const double wo[3])
{
    const struct kernel_side *side = &b->side[facet_side(wo[2])];
    double hh = 0;
    for (int j = 0; j < 3; j++) hh += (wi[j] + wo[j]) * (wi[j] + wo[j]);
    return side->excess < 0 ? 4 / (side->index * sqrt(fabs(side->excess + hh / 4))) : 1;
}

double facet_bsdf_closeness(const facet_bsdf *b, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                            bool exact_z)
{
    double worst = facet_closeness(b->ideal, wi, wo, n, exact_z);
    for (size_t i = 0; i < n; i++) {
        const double from[3] = {wi.x[i], wi.y[i], wi.z[i]}, to[3] = {wo.x[i], wo.y[i], wo.z[i]};
        worst = fmax(worst,
                     fmax(closeness_same(b, from, to), closeness_across(b, from, to, exact_z)));
    }
    return worst;
}

bool facet_bsdf_sample_bound(const facet_bsdf *b, facet_tier tier, facet_sampler sampler,
                             bool dense, double input_error, double *bound)
{
    double pdf, weight, normal;
    *bound = INFINITY;
    if (!facet_bsdf_sampler_serves(sampler, b->ndf) ||
        !facet_bsdf_bound(b, tier, FACET_PDF, input_error, &pdf) ||
        !facet_bsdf_bound(b, tier, FACET_FR_COS, input_error, &weight) ||
        !facet_sample_bound(b->ideal, tier, facet_bsdf_method(b, sampler), input_error, &normal))
        return false;
    double n = b->side[ABOVE].index, least = fmin(n, b->side[BELOW].index), cosine = 2 * normal;
    /* g^2 = n^2 - 1 + c^2 is right to 2 c times the error of c, g >= c toward the dense side. */
    double refracted = dense ? (sqrt(2 * cosine) + 2 * cosine) / least : 4 * cosine;
    *bound = fmax(refracted, fmax(normal, pdf + weight));
    return true;
}
