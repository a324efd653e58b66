/*
 * bounds.c - the error promised for a material: accuracy.def, and what shear,
 * correlation, Fresnel constants and computed directions add to it.
 */
#include "brdf.h"

#include <math.h>

/* accuracy.def, by [tier][ndf][quantity] and [tier][kind]; NAN where nothing is promised. */
static double base_bound(facet_tier tier, facet_ndf ndf, facet_quantity quantity)
{
#define PROMISE(t, n, q, bound)                                                 \
    if (tier == FACET_##t && ndf == FACET_##n && quantity == FACET_##q) return bound;
#define FRESNEL(t, kind, bound)
#include "accuracy.def"
#undef PROMISE
#undef FRESNEL
#undef ALL_QUANTITIES
    return NAN;
}

static double base_fresnel_bound(facet_tier tier, facet_fresnel_kind kind)
{
#define PROMISE(t, n, q, bound)
#define FRESNEL(t, k, bound)                                                    \
    if (tier == FACET_##t && kind == FACET_FRESNEL_##k) return bound;
#include "accuracy.def"
#undef PROMISE
#undef FRESNEL
    return NAN;
}

#define DOUBLE_ROUNDING 0x1p-53

/*
 * Next to a node where a Fresnel table is 0, c counts as no closer to the node
 * than this share of the cell: no direction but one made for it comes closer.
 */
#define FRESNEL_FLOOR 1e-12

/* Rounding of the linear forms of surface.h, relative to their terms: double for fast, double-double else. */
static double form_rounding(facet_tier tier)
{
    return tier == FACET_FAST ? 4 * DOUBLE_ROUNDING : 8 * DOUBLE_ROUNDING * DOUBLE_ROUNDING;
}

/*
 * By how much a relative error in the terms of the linear forms grows in the
 * forms: alpha_1/alpha_2 by correlation, |mean slope|/alpha_2 by shear, with
 * alpha_2 the minor radius.
 */
static double form_condition(const facet_brdf *b)
{
    if (b->shape == KERNEL_ISO) return 0;
    facet_ellipse e = facet_roughness_to_ellipse(&b->material.roughness);
    double lean = fabs(b->surface.slope_x) + fabs(b->surface.slope_y);
    return (e.alpha_1 + lean * fmax(1, e.alpha_1)) / e.alpha_2;
}

/*
 * By how much an absolute error in the components of wi and wo grows in slopes:
 * H may be short, and slopes are divided by alpha_2.
 */
static double input_condition(const facet_brdf *b)
{
    facet_ellipse e = facet_roughness_to_ellipse(&b->material.roughness);
    double lean = fabs(b->surface.slope_x) + fabs(b->surface.slope_y);
    return 4 * (1 + lean) * (1 + 1 / e.alpha_2);
}

/*
 * d log D / d log slope, for errors in both of wi and wo: 2 x 4 for GGX and for
 * what is tabulated.  Beckmann's exponent t has 2 x 2 sqrt(t), t <= 150 wherever
 * the result passes FACET_FLOOR.
 */
static double slope_gain(facet_ndf ndf)
{
    return ndf == FACET_BECKMANN ? 50 : 8;
}

/* max |dF/dc| / F over the cells, where an error of c meets an F that is not 0. */
static double table_steepness(const struct kernel_fresnel *f)
{
    double worst = 0;
    for (size_t i = 1; i < f->count; i++) {
        double rise = fabs(f->values[i] - f->values[i - 1]);
        double low = fmax(fmin(f->values[i], f->values[i - 1]), rise * FRESNEL_FLOOR);
        if (rise > 0) worst = fmax(worst, rise / (f->cos_theta_d[i] - f->cos_theta_d[i - 1]) / low);
    }
    return worst;
}

/*
 * What a Fresnel term's own constants make of an error in its angle (angle: of
 * 1 - c or c^2 as the kernels form it).  (1 - c)^5 counts where it passes F0 and
 * FACET_FLOOR; below eta = 1, F leaves 1 like a square root.
 */
static double fresnel_channel_bound(const struct kernel_fresnel *f, facet_fresnel_kind kind, double angle,
                                    double input_error)
{
    switch (kind) {
    case FACET_FRESNEL_SCHLICK: return 5 * (angle + input_error) / pow(fmax(f->f0, 1e-45), 0.2);
    case FACET_FRESNEL_DIELECTRIC:
    case FACET_FRESNEL_CONDUCTOR:
        return f->excess < 0 ? 8 * sqrt(angle + 4 * input_error) * (1 + 1 / fmax(f->eta * f->eta, f->k)) : 8 * input_error;
    case FACET_FRESNEL_TABLE: return (angle + input_error) * table_steepness(f);
    default: return 0;
    }
}

static double fresnel_bound(const facet_brdf *b, facet_tier tier, double input_error)
{
    facet_fresnel_kind kind = b->material.fresnel.kind;
    double angle = 4 * DOUBLE_ROUNDING * DOUBLE_ROUNDING, worst = 0;
    for (size_t c = 0; c < b->channels; c++)
        worst = fmax(worst, fresnel_channel_bound(&b->fresnel[c], kind, angle, input_error));
    return base_fresnel_bound(tier, kind) + worst;
}

/*
 * Where floats are enough.  G and G1 of a sheared surface, and the thesis's
 * forms, divide by a sigma that underflows.
 */
static bool fast_domain(const facet_brdf *b, facet_quantity quantity)
{
    bool divides = quantity == FACET_G || quantity == FACET_G1_I || quantity == FACET_G1_O;
    if (b->masking == KERNEL_SMITH_THESIS || b->masking == KERNEL_UNCORRELATED_THESIS) return false;
    if (b->shape == KERNEL_SHEARED && divides) return false;
    return b->floats_hold;
}

static double surface_bound(const facet_brdf *b, facet_tier tier, double base, double input_error)
{
    double gain = slope_gain(b->material.ndf);
    double general = b->shape == KERNEL_ISO ? 1 : 2;
    return base * general + gain * form_rounding(tier) * form_condition(b) +
           (input_error > 0 ? gain * input_error * input_condition(b) : 0);
}

bool facet_bound(const facet_brdf *b, facet_tier tier, facet_quantity quantity, double input_error,
                 double *bound)
{
    *bound = INFINITY;
    if ((unsigned)tier >= FACET_TIER_COUNT || (unsigned)quantity >= FACET_QUANTITY_COUNT) return false;
    if (tier == FACET_FAST && !fast_domain(b, quantity)) return false;
    double base = base_bound(tier, b->material.ndf, quantity);
    double value = quantity == FACET_F ? 0 : surface_bound(b, tier, base, input_error);
    if (quantity == FACET_F || quantity == FACET_FR || quantity == FACET_FR_COS)
        value += fresnel_bound(b, tier, input_error);
    *bound = value;
    return isfinite(value);
}

/*
 * A cap's normal is right to rounding of its own length 1; the affine map may
 * stretch that by alpha_1 (1 + lean) where the rest of the normal shrinks by alpha_2.
 */
static double caps_stretch(const facet_brdf *b, facet_tier tier)
{
    if (b->material.ndf != FACET_GGX || b->shape == KERNEL_ISO) return 0;
    facet_ellipse e = facet_roughness_to_ellipse(&b->material.roughness);
    double rounding = tier == FACET_FAST ? 0x1p-24 : DOUBLE_ROUNDING;
    double lean = fabs(b->surface.slope_x) + fabs(b->surface.slope_y);
    return 8 * rounding * (e.alpha_1 + lean) / e.alpha_2;
}

bool facet_sample_bound(const facet_brdf *b, facet_tier tier, double input_error, double *bound)
{
    *bound = INFINITY;
    double pdf, weight;
    if (b->material.ndf == FACET_TABULATED) return false;
    if (!facet_bound(b, tier, FACET_PDF, input_error, &pdf) ||
        !facet_bound(b, tier, FACET_FR_COS, input_error, &weight))
        return false;
    *bound = 8 * fmax(pdf, weight) + caps_stretch(b, tier);
    return true;
}
