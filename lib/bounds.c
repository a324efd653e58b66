/*
 * bounds.c - the error promised for a material: accuracy.def, and what shear,
 * correlation, Fresnel constants and computed directions add to it.
 */
#include "batch.h"
#include "slope_table.h"
#include "table_closed.h"

#include <math.h>

/* accuracy.def, by [tier][ndf][quantity] and [tier][kind]; NAN where nothing is promised. */
static double base_bound(facet_tier tier, facet_ndf ndf, facet_quantity quantity)
{
#define PROMISE(t, n, q, bound)                                                                    \
    if (tier == FACET_##t && ndf == FACET_##n && quantity == FACET_##q) return bound;
#define FRESNEL(t, kind, own, added)
#define SAMPLER(t, n, pdf, added)
#include "accuracy.def"
#undef PROMISE
#undef FRESNEL
#undef SAMPLER
#undef ALL_QUANTITIES
    return NAN;
}

static double base_fresnel_bound(facet_tier tier, facet_fresnel_kind kind, bool alone)
{
#define PROMISE(t, n, q, bound)
#define SAMPLER(t, n, pdf, added)
#define FRESNEL(t, k, own, added)                                                                  \
    if (tier == FACET_##t && kind == FACET_FRESNEL_##k) return alone ? own : added;
#include "accuracy.def"
#undef PROMISE
#undef FRESNEL
#undef SAMPLER
#undef ALL_QUANTITIES
    return NAN;
}

static double base_sampler_bound(facet_tier tier, facet_sampler sampler, bool density)
{
#define PROMISE(t, n, q, bound)
#define FRESNEL(t, k, own, added)
#define SAMPLER(t, s, pdf, added)                                                                  \
    if (tier == FACET_##t && sampler == FACET_SAMPLER_##s) return density ? pdf : added;
#include "accuracy.def"
#undef PROMISE
#undef FRESNEL
#undef SAMPLER
    return NAN;
}

#define DOUBLE_ROUNDING 0x1p-53
#define FLOAT_ROUNDING 0x1p-24

/*
 * Next to a node where a Fresnel table is 0, c counts as no closer to the node
 * than this share of the cell: no direction but one made for it comes closer.
 */
#define FRESNEL_FLOOR 1e-12

/* Half a unit in the last place of what a tier forms and adds terms in: precise in pairs of doubles. */
static double rounding_of(facet_tier tier)
{
    switch (tier) {
    case FACET_DRAFT:
    case FACET_FAST: return FLOAT_ROUNDING;
    case FACET_EXACT32: return DOUBLE_ROUNDING;
    default: return 2 * DOUBLE_ROUNDING * DOUBLE_ROUNDING;
    }
}

/* Rounding of the linear forms of surface.h, relative to their terms. */
static double form_rounding(facet_tier tier)
{
    return 4 * rounding_of(tier);
}

/*
 * By how much a relative error in the terms of the linear forms grows in the
 * forms: alpha_1/alpha_2 by correlation, |mean slope| max(1, alpha_1)/alpha_2 by
 * shear, with alpha_2 the minor radius.
 */
struct conditions {
    double correlation, shear;
};

static struct conditions form_conditions(const facet_brdf *b)
{
    if (b->shape == KERNEL_ISO) return (struct conditions){0, 0};
    facet_ellipse e = facet_roughness_to_ellipse(&b->material.roughness);
    double lean = fabs(b->surface.slope_x) + fabs(b->surface.slope_y);
    return (struct conditions){e.alpha_1 / e.alpha_2, lean * fmax(1, e.alpha_1) / e.alpha_2};
}

static double form_condition(const facet_brdf *b)
{
    struct conditions c = form_conditions(b);
    return c.correlation + c.shear;
}

/*
 * Seen from behind a sheared Beckmann surface, an exponent is the difference of
 * two squares of slopes, right to a pair's rounding of either.
 */
static double exponent_error(const facet_brdf *b, facet_tier tier)
{
    if (b->material.ndf != FACET_BECKMANN || b->shape != KERNEL_SHEARED || tier != FACET_PRECISE)
        return 0;
    double slope = form_condition(b);
    return 8 * rounding_of(tier) * slope * slope;
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
 * d log D / d log slope, for errors in both of wi and wo: 2 x 4 for GGX; of tables
 * it is measured.  Beckmann's exponent t has
 * 2 x 2 sqrt(t), t <= 150 wherever the result passes FACET_FLOOR.
 */
static double slope_gain(const facet_brdf *b)
{
    if (b->material.ndf == FACET_TABULATED) return 2 * fmax(4, b->material.table->gain);
    return b->material.ndf == FACET_BECKMANN ? 50 : 8;
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

/* The largest |dF/dc| / F: what an error of c makes of Schlick's F, whose (1 - c)^5 counts where it passes F0. */
static double schlick_steepness(double f0)
{
    return 3.04 / pow(fmax(f0, 1e-45), 0.2); /* 5 v^4 / (f0 + v^5) at v^5 = 4 f0 */
}

/* The largest (1 - v) 5 v^4 / (f0 + v^5): the same of a relative error of c. */
static double schlick_condition(double f0)
{
    double worst = 0;
    for (double v = 1; v > 1e-9; v *= 0.97)
        worst = fmax(worst, (1 - v) * 5 / (fmax(f0, 1e-45) / pow(v, 4) + v));
    return worst;
}

/*
 * What a Fresnel term's own constants make of an error in its angle: of c or
 * c^2, relative.  Below eta = 1, F leaves 1 like a square root.
 */
static double fresnel_channel_bound(const struct kernel_fresnel *f, facet_fresnel_kind kind,
                                    double angle, double input_error)
{
    switch (kind) {
    case FACET_FRESNEL_SCHLICK:
        return angle * schlick_condition(f->f0) + input_error * schlick_steepness(f->f0);
    case FACET_FRESNEL_DIELECTRIC:
    case FACET_FRESNEL_CONDUCTOR:
        return f->excess < 0
                   ? 8 * sqrt(angle + 4 * input_error) * (1 + 1 / fmax(f->eta * f->eta, f->k))
                   : 8 * input_error;
    case FACET_FRESNEL_TABLE: return (angle + input_error) * table_steepness(f);
    default: return 0;
    }
}

static double fresnel_bound(const facet_brdf *b, facet_tier tier, bool alone, double input_error)
{
    /* Relative errors of c by tier. */
    static const double cosine_error[FACET_TIER_COUNT] = {2.4e-7, 1.8e-7, 4e-13,
                                                          4 * DOUBLE_ROUNDING * DOUBLE_ROUNDING};
    facet_fresnel_kind kind = b->material.fresnel.kind;
    bool takes_cosine = kind == FACET_FRESNEL_SCHLICK || kind == FACET_FRESNEL_TABLE;
    double angle = takes_cosine ? cosine_error[tier] : 2 * rounding_of(tier), worst = 0;
    for (size_t c = 0; c < b->channels; c++)
        worst = fmax(worst, fresnel_channel_bound(&b->fresnel[c], kind, angle, input_error));
    return base_fresnel_bound(tier, kind, alone) + worst;
}

/* Where floats are enough.  G and G1 of a sheared surface divide by a sigma that underflows. */
static bool float_domain(const facet_brdf *b, facet_quantity quantity)
{
    bool divides = quantity == FACET_G || quantity == FACET_G1_I || quantity == FACET_G1_O;
    if (b->shape == KERNEL_SHEARED && divides) return false;
    return b->floats_hold;
}

/* Of the roots and quotients of a tier. */
static double arithmetic_of(facet_tier tier)
{
    static const double rounding[FACET_TIER_COUNT] = {0x1p-13, 0x1p-23, 0x1p-41, 0x1p-53};
    return rounding[tier];
}

/* What of a table over the azimuth is seen from behind is in facet_depth_error. */
static bool may_be_behind(const facet_brdf *b, facet_quantity quantity)
{
    bool anywhere = quantity == FACET_PDF || quantity == FACET_D_VIS || quantity == FACET_SIGMA_O;
    return (anywhere || b->shape == KERNEL_SHEARED) &&
           !facet_slope_table_is_turned(&b->material.table->view);
}

/*
 * What rounding makes of a table's logarithms: of u, of the azimuth, and in floats of the coefficients
 * and their sums as well.
 */
static double table_rounding(const facet_brdf *b, facet_tier tier, facet_quantity quantity,
                             bool behind)
{
    const facet_slope_table *table = b->material.table;
    if (tier >= FACET_EXACT32) {
        struct slope_reach psi = behind ? table->far_behind : table->psi;
        double size = facet_slope_table_is_turned(&table->view) ? psi.size : 0;
        double sigma = quantity == FACET_D ? 0 : psi.gain + psi.rise + size;
        return 8 * arithmetic_of(tier) * (table->gain + table->q.rise + 2 * sigma);
    }
    double q = 6 * table->q.gain + 3 * table->q.size,
           psi = 6 * table->psi.gain + 3 * table->psi.size,
           far = 6 * table->behind.gain + 3 * table->behind.size;
    if (quantity == FACET_D) return FLOAT_ROUNDING * q;
    if (behind) psi = fmax(psi, far);
    return FLOAT_ROUNDING * (q + 2 * psi);
}

/*
 * What the table of sigma adds (slope_table.h): its error is measured where a cubic's is largest, over the
 * azimuth between all of its nodes.  Behind the mean facet sigma is all excess, and right to psi_error.
 */
static double table_error(const facet_brdf *b, facet_tier tier, facet_quantity quantity)
{
    if (b->material.ndf != FACET_TABULATED) return 0;
    const facet_slope_table *table = b->material.table;
    bool behind = may_be_behind(b, quantity);
    double rounding = table_rounding(b, tier, quantity, behind);
    if (quantity == FACET_D) return rounding;
    return rounding + fmax(3 * table->sigma_error, behind ? 1.5 * table->psi_error : 0);
}

/* d log D by the slope itself, which shear and rounded components move by so much and not by a share: a table is as narrow as its scale. */
static double shear_gain(const facet_brdf *b)
{
    double gain = slope_gain(b);
    return b->material.ndf == FACET_TABULATED ? fmax(gain, 2 * b->material.table->q.steep) : gain;
}

static double surface_bound(const facet_brdf *b, facet_tier tier, double base, double input_error)
{
    struct conditions forms = form_conditions(b);
    double grown = slope_gain(b) * forms.correlation + shear_gain(b) * forms.shear;
    /* In precise what the map adds is in the rows. */
    double general = b->shape == KERNEL_ISO || tier == FACET_PRECISE ? 1 : 2;
    return base * general + form_rounding(tier) * grown + exponent_error(b, tier) +
           (input_error > 0 ? shear_gain(b) * input_error * input_condition(b) : 0);
}

/* The rows have one sigma of a sheared surface; the uncorrelated forms divide by two. */
static double second_sigma(const facet_brdf *b, facet_tier tier, facet_quantity quantity)
{
    bool two = b->masking == KERNEL_UNCORRELATED || b->masking == KERNEL_UNCORRELATED_THESIS;
    bool has = quantity == FACET_FR || quantity == FACET_FR_COS;
    return two && has && tier == FACET_PRECISE && b->shape == KERNEL_SHEARED &&
                   b->material.ndf == FACET_BECKMANN
               ? 5e-16
               : 0;
}

bool facet_bound(const facet_brdf *b, facet_tier tier, facet_quantity quantity, double input_error,
                 double *bound)
{
    *bound = INFINITY;
    if ((unsigned)tier >= FACET_TIER_COUNT || (unsigned)quantity >= FACET_QUANTITY_COUNT)
        return false;
    double base = base_bound(tier, b->material.ndf, quantity);
    tier = facet_served_tier(b, tier);
    if (tier < FACET_EXACT32 && !float_domain(b, quantity)) return false;
    double value = quantity == FACET_F
                       ? 0
                       : surface_bound(b, tier, base, input_error) +
                             table_error(b, tier, quantity) + second_sigma(b, tier, quantity);
    if (quantity == FACET_F || quantity == FACET_FR || quantity == FACET_FR_COS)
        value += fresnel_bound(b, tier, quantity == FACET_F, input_error);
    *bound = value;
    return isfinite(value);
}

/* Results of the float tiers are floats anyway. */
static double rounded_to_float(facet_tier tier, double bound)
{
    return tier >= FACET_EXACT32 ? bound + FLOAT_ROUNDING * (1 + bound) : bound;
}

bool facet_bound_float(const facet_brdf *b, facet_tier tier, facet_quantity quantity,
                       double input_error, double *bound)
{
    if (!facet_bound(b, tier, quantity, input_error, bound)) return false;
    *bound = rounded_to_float(tier, *bound);
    return true;
}

/*
 * A normal is right to rounding of the length 1 of a cap; the affine map may
 * stretch that by alpha_1 (1 + lean) where the rest of the normal shrinks by alpha_2.
 */
static double caps_stretch(const facet_brdf *b, facet_tier tier)
{
    if (b->material.ndf != FACET_GGX || b->shape == KERNEL_ISO) return 0;
    facet_ellipse e = facet_roughness_to_ellipse(&b->material.roughness);
    double lean = fabs(b->surface.slope_x) + fabs(b->surface.slope_y);
    return 8 * arithmetic_of(tier) * (e.alpha_1 + lean) / e.alpha_2;
}

/*
 * What BOUNDED makes of an absolute error in wo: up to A^2 times as much, where 1 + K is as little as
 * 2 / (1 + A^2).
 */
static double cap_input_gain(const facet_brdf *b)
{
    return fmax(1, b->surface.cap_a2);
}

bool facet_pdf_bound(const facet_brdf *b, facet_tier tier, facet_sampler sampler,
                     double input_error, double *bound)
{
    facet_sampler density;
    *bound = INFINITY;
    tier = facet_served_tier(b, tier);
    if (facet_batch_sampler(b, sampler, &density)) return false;
    if (density == FACET_SAMPLER_AUTO) return facet_bound(b, tier, FACET_PDF, input_error, bound);
    facet_brdf twin;
    if (density == FACET_SAMPLER_TABLE) {
        if (tier != FACET_PRECISE || !facet_table_twin(b, &twin) ||
            !facet_bound(&twin, tier, FACET_PDF, input_error, bound))
            return false;
        *bound += facet_table_density_error(b->material.ndf, false);
        return true;
    }
    if (!facet_bound(b, tier, density == FACET_SAMPLER_BOUNDED ? FACET_PDF : FACET_D, input_error,
                     bound))
        return false;
    double gain = density == FACET_SAMPLER_BOUNDED ? cap_input_gain(b) : 1;
    if (density == FACET_SAMPLER_COSINE) *bound = input_error;
    *bound += base_sampler_bound(tier, density, true) + 4 * gain * input_error;
    return true;
}

bool facet_pdf_bound_float(const facet_brdf *b, facet_tier tier, facet_sampler sampler,
                           double input_error, double *bound)
{
    if (!facet_pdf_bound(b, tier, sampler, input_error, bound)) return false;
    *bound = rounded_to_float(tier, *bound);
    return true;
}

/*
 * What inverting a table's CDF adds: amounts are right to some roundings, and the affine map
 * stretches an angle by the ratio of the radii.
 */
static double quantile_error(const facet_brdf *b, facet_sampler method)
{
    if (b->material.ndf != FACET_TABULATED || method == FACET_SAMPLER_COSINE) return 0;
    return 256 * DOUBLE_ROUNDING * b->material.table->quantile_gain * (1 + form_condition(b));
}

bool facet_sample_bound(const facet_brdf *b, facet_tier tier, facet_sampler sampler,
                        double input_error, double *bound)
{
    *bound = INFINITY;
    double pdf, weight;
    tier = facet_served_tier(b, tier);
    if (!facet_sampler_serves(sampler, b->material.ndf)) return false;
    if (!facet_pdf_bound(b, tier, sampler, input_error, &pdf) ||
        !facet_bound(b, tier, FACET_FR_COS, input_error, &weight))
        return false;
    facet_sampler method = sampler == FACET_SAMPLER_AUTO ? b->automatic : sampler;
    facet_brdf twin;
    if (method == FACET_SAMPLER_TABLE && b->material.ndf != FACET_TABULATED) {
        /* The weight is fr cos over the density of the table. */
        if (!facet_table_twin(b, &twin)) return false;
        *bound = base_sampler_bound(tier, method, false) + 8 * (pdf + weight) +
                 quantile_error(&twin, method);
        return true;
    }
    /* Of a radial table its density divides by sigma as it is, not as it is tabulated. */
    bool exact = method == FACET_SAMPLER_TABLE &&
                 !facet_slope_table_is_turned(&b->material.table->view);
    if (exact && !facet_bound(b, tier, FACET_D, input_error, &pdf)) return false;
    *bound = base_sampler_bound(tier, method, false) + 8 * fmax(pdf, weight) +
             caps_stretch(b, tier) + quantile_error(b, method);
    return true;
}

/* ---- Seen from behind --------------------------------------------------------------------- */

/* The depth that a quantity hangs on: that of the sigma it is divided by. */
static double depth_that_counts(const facet_brdf *b, facet_quantity quantity, facet_sampler sampler,
                                const facet_depth *depth)
{
    /* Above the horizon all that does not lean is seen from in front. */
    bool leans = b->shape == KERNEL_SHEARED;
    bool product = b->masking == KERNEL_UNCORRELATED || b->masking == KERNEL_UNCORRELATED_THESIS;
    switch (quantity) {
    case FACET_PDF:
        return sampler == FACET_SAMPLER_AUTO || sampler == FACET_SAMPLER_TABLE ? depth->wo : 0;
    case FACET_SIGMA_O:
    case FACET_D_VIS: return depth->wo;
    case FACET_FR:
    case FACET_FR_COS:
    case FACET_G: return !leans ? 0 : product ? depth->most : depth->least;
    case FACET_G1_I:
    case FACET_G1_O: return leans ? depth->most : 0;
    default: return 0;
    }
}

static double turned_depth_error(const facet_brdf *b, facet_tier tier, facet_quantity quantity,
                                 double depth)
{
    double rounding = table_rounding(b, tier, quantity, true) -
                      table_rounding(b, tier, quantity, false);
    return fmax(0, rounding) + 3 * facet_slope_turned_psi_error(b->material.table, depth);
}

double facet_depth_error(const facet_brdf *b, facet_tier tier, facet_quantity quantity,
                         facet_sampler sampler, const facet_depth *depth)
{
    const bool closed = b->material.ndf != FACET_TABULATED;
    const facet_slope_table *table = facet_table_behind(b, sampler);
    if (!table || (closed && quantity != FACET_PDF)) return 0;
    const bool turned = facet_slope_table_is_turned(&table->view);
    double at = depth_that_counts(b, quantity, sampler, depth);
    if (at <= table->near || (quantity == FACET_SIGMA_O && !turned))
        return 0; /* sigma itself is under the floor there */
    if (at > table->reach && quantity != FACET_SIGMA_O) return INFINITY;
    if (turned) return turned_depth_error(b, facet_served_tier(b, tier), quantity, at);
    return 1.5 * table->far_error + (closed ? facet_table_density_error(b->material.ndf, true) : 0);
}

double facet_sample_depth_error(const facet_brdf *b, facet_tier tier, facet_sampler sampler,
                                const facet_depth *depth)
{
    facet_depth drawn = {depth->wo, depth->wo, depth->wo}; /* wi is no deeper where it counts */
    return 8 * fmax(facet_depth_error(b, tier, FACET_PDF, sampler, &drawn),
                    facet_depth_error(b, tier, FACET_FR_COS, sampler, &drawn));
}
