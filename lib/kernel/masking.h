/*
 * masking.h - what is common to all ndfs: the choice of ndf, projected area,
 * masking, and the quantities made of them.  Dupuy 2015 ch. 2 and 3; the sheared
 * forms and the meaning of G and G1 are stated in lib/NOTATION.md.
 */
#ifndef FACET_MASKING_H
#define FACET_MASKING_H

#include "ndf_beckmann.h"
#include "ndf_ggx.h"
#include "ndf_table.h"

/* A pair as the loops see it; constants, so that each loop keeps only its own branch. */
struct model {
    enum facet_ndf ndf;
    enum kernel_shape shape;
    enum kernel_masking masking;
};

/* Seen from behind (c < 0), sigma and the D that follows from it underflow together: Beckmann sheared. */
INLINE bool scales(struct model m)
{
    return m.ndf == FACET_BECKMANN && m.shape == KERNEL_SHEARED;
}

/*
 * The constant that D has before what depends on the pair.  In precise it is part of
 * that (what saturates saturates in the end); elsewhere the loops multiply by it last,
 * together with other constants.
 */
INLINE lane peak_of(struct model m, const struct kernel_surface *s)
{
    return R(s->peak * (m.ndf != FACET_GGX && LIFT ? 0x1p-64 : 1));
}

INLINE lane factor_of(struct model m, const struct kernel_surface *s)
{
    return COMPENSATED ? R(1) : peak_of(m, s);
}

#if REAL_IS_FLOAT
/* Whether cosines with the mean facet of UNSURE_COSINE's accuracy are enough. */
INLINE bool floats_will_do(struct model m)
{
    return DRAFT || m.ndf == FACET_BECKMANN;
}
#endif

/* D / factor_of where H points up; elsewhere anything. */
INLINE struct fraction bare_density(struct model m, const struct kernel_surface *s, struct half h)
{
    struct fraction d = {splat(0), splat(1)};
    if (m.ndf == FACET_GGX)
        d = ggx_density(m.shape, h);
    else
        d.num = m.ndf == FACET_BECKMANN ? beckmann_density(s, m.shape, h) : table_density(s, h);
    return COMPENSATED ? (struct fraction){d.num * peak_of(m, s), d.den} : d;
}

INLINE struct fraction bare_density_scaled(struct model m, const struct kernel_surface *s,
                                           struct half h, struct direction o)
{
    if (!scales(m)) return bare_density(m, s, h);
    real d = beckmann_density_scaled(s, h, o);
    return (struct fraction){COMPENSATED ? d * peak_of(m, s) : d, splat(1)};
}

/* D. */
INLINE struct fraction density(struct model m, const struct kernel_surface *s, struct half h)
{
    struct fraction d = bare_density(m, s, h);
    return (struct fraction){d.num * factor_of(m, s), d.den};
}

INLINE real excess(struct model m, const struct kernel_surface *s, struct direction k)
{
    return m.ndf == FACET_GGX        ? ggx_excess(k)
           : m.ndf == FACET_BECKMANN ? beckmann_excess(k)
                                     : table_excess(s, k);
}

/* The same where c > 0, or nothing depends on it. */
INLINE real front_excess(struct model m, const struct kernel_surface *s, struct direction k)
{
    return m.ndf == FACET_BECKMANN ? beckmann_front_excess(k) : excess(m, s, k);
}

INLINE real excess_scaled(struct model m, const struct kernel_surface *s, struct direction k)
{
    return scales(m) ? beckmann_excess_scaled(k) : excess(m, s, k);
}

INLINE real sigma(struct model m, const struct kernel_surface *s, struct direction k)
{
    if (m.ndf == FACET_GGX) return ggx_sigma(k);
    /* In the other tiers what looks up from below is a stray. */
    bool may_be_behind = COMPENSATED || m.shape == KERNEL_SHEARED;
    return real_max(k.c, splat(0)) + (may_be_behind ? excess(m, s, k) : front_excess(m, s, k));
}

INLINE real sigma_scaled(struct model m, const struct kernel_surface *s, struct direction k)
{
    return scales(m) ? real_max(k.c, splat(0)) + excess_scaled(m, s, k) : sigma(m, s, k);
}

/* x / y; 0 instead of x / 0, the largest number instead of infinity. */
INLINE real ratio(real x, real y)
{
    real q = real_min(quotient(x, y), splat(REAL_MAX));
    return select(less(splat(0), real_min(x, y)), q, splat(0));
}

/* No more than the largest number; in the other tiers it would be a stray. */
INLINE real saturated(real x)
{
    return COMPENSATED ? real_min(x, splat(REAL_MAX)) : x;
}

/* 0 unless both directions are above the horizon. */
INLINE real lit(struct direction i, struct direction o, real value)
{
    return select(less(splat(0), real_min(i.z, o.z)), value, splat(0));
}

INLINE real facing_up(struct half h, real value)
{
    return select(less(splat(0), h.hz), value, splat(0));
}

/* What the ndfs' fractions have yet to be divided by. */
INLINE lane smith_factor(struct model m)
{
    return m.ndf == FACET_GGX ? 2 : 4;
}

/*
 * c_i over 4 (sigma_o c_i + (sigma_i - c_i) max(c_o, 0)), for c_i > 0, times smith_factor;
 * height-correlated, energy-safe.  What it is the quotient of is free: factors that both
 * have are dropped.
 */
INLINE struct fraction smith(struct model m, const struct kernel_surface *s, struct direction i,
                             struct direction o)
{
    if (m.ndf == FACET_GGX) return ggx_smith(i, o);
    if (m.ndf == FACET_BECKMANN && m.shape == KERNEL_SHEARED) return beckmann_smith(i, o);
    real front = madd(real_max(o.c, splat(0)), i.c + front_excess(m, s, i), excess(m, s, o) * i.c);
    return (struct fraction){i.c, front};
}

/* Its denominator on a central surface, where both are lit. */
INLINE real smith_front(struct model m, const struct kernel_surface *s, struct direction i,
                        struct direction o)
{
    if (m.ndf == FACET_GGX) return ggx_smith_front(i, o);
    if (m.ndf == FACET_BECKMANN) return beckmann_smith_front(i, o);
    return smith(m, s, i, o).den;
}

/* Dupuy eq. 3.3 in 2.13: sigma_o z_i + z_o (sigma_i - z_i), which may vanish, and the sum of its magnitudes. */
struct thesis {
    real denominator, magnitude;
};

INLINE struct thesis thesis_denominator(struct model m, const struct kernel_surface *s,
                                        struct direction i, struct direction o)
{
    real zi = i.z, zo = o.z, so = sigma(m, s, o), si = sigma(m, s, i);
    return (struct thesis){so * zi + zo * (si - zi), so * zi + zo * (si + zi)};
}

/* H_z / |H|^2. */
INLINE real facing(struct half h)
{
    return saturated(quotient(h.scale * h.hz, real_max(h.hh, splat(REAL_MIN)))); /* 0 where H is */
}

/* V-cavity: the visible share of the facets h from a direction with cosine c to the mean facet. */
INLINE real vgroove_visible(struct half h, real c)
{
    return real_max(real_min(4 * facing(h) * c, splat(1)), splat(0));
}

/*
 * fr cos theta_i = F D num / den; num <= 0 or den <= 0 stand for 0.  With
 * `scaled`, D and sigma_o are the scaled ones.
 */
INLINE struct fraction reflect(struct model m, const struct kernel_surface *s, struct direction i,
                               struct direction o, struct half h, bool scaled)
{
    switch (m.masking) {
    case KERNEL_SMITH:
        if (m.shape != KERNEL_SHEARED)
            return (struct fraction){i.c, smith_factor(m) * smith_front(m, s, i, o)};
        struct fraction f = smith(m, s, i, o);
        return (struct fraction){select(less(splat(0), i.c), f.num, splat(0)),
                                 smith_factor(m) * f.den};
    case KERNEL_UNCORRELATED:
        return (struct fraction){i.c, 4 * sigma(m, s, i) *
                                          (scaled ? sigma_scaled(m, s, o) : sigma(m, s, o))};
    case KERNEL_VGROOVE: return (struct fraction){vgroove_visible(h, real_min(i.c, o.c)), 4 * o.c};
    case KERNEL_NONE: return (struct fraction){h.scale * h.hz, 2 * h.hh};
    case KERNEL_SMITH_THESIS:
        return (struct fraction){i.z, 4 * thesis_denominator(m, s, i, o).denominator};
    case KERNEL_UNCORRELATED_THESIS:
    default: return (struct fraction){i.z, 4 * sigma(m, s, i) * sigma(m, s, o)};
    }
}

/* Below c_o < 0 only the energy-safe forms divide D by sigma_o, which both underflow there. */
INLINE bool needs_scaling(struct model m)
{
    return scales(m) && (m.masking == KERNEL_SMITH || m.masking == KERNEL_UNCORRELATED);
}

INLINE real value_of(struct fraction f)
{
    return quotient(f.num, f.den);
}

/*
 * Where `where` is positive.  Of a tail (GGX has none) what counts as 0 becomes 0 before it
 * becomes denormal, which processors are slow with; a value that is no number stays so.
 */
#define LEAST_VALUE (REAL_IS_FLOAT ? 1e-35 : 1e-250)
INLINE real counted(struct model m, lane factor, real where, real value)
{
    if (m.ndf != FACET_GGX && !COMPENSATED)
        where = real_min(value - R(LEAST_VALUE) / factor, where);
    return select(less(splat(0), where), value, splat(0));
}

INLINE real lit_density(struct model m, const struct kernel_surface *s, struct direction i,
                        struct direction o, struct half h)
{
    bool scaled = needs_scaling(m);
    struct fraction f = reflect(m, s, i, o, h, scaled);
    struct fraction d = scaled ? bare_density_scaled(m, s, h, o) : bare_density(m, s, h);
    /* The fraction first: d and num may both be small, and so may num and den. */
    return saturated(value_of(d) * ratio(f.num, f.den));
}

/* bare_x: quantity x over factor_of, fr over fr_factor. */
INLINE real bare_fr_cos(struct model m, const struct kernel_surface *s, struct direction i,
                        struct direction o, struct half h)
{
    return counted(m, factor_of(m, s), real_min(i.z, o.z), lit_density(m, s, i, o, h));
}

/* Smith's fr leaves more constants for last. */
INLINE lane fr_factor(struct model m, const struct kernel_surface *s)
{
    bool more = m.masking == KERNEL_SMITH && (m.shape != KERNEL_SHEARED || REAL_IS_FLOAT) &&
                !COMPENSATED;
    return factor_of(m, s) / (more ? smith_factor(m) : R(1));
}

/* fr cos theta_i / cos theta_i, which cancels on a central Smith surface. */
INLINE real bare_fr(struct model m, const struct kernel_surface *s, struct direction i,
                    struct direction o, struct half h)
{
    if (m.masking == KERNEL_SMITH && m.shape != KERNEL_SHEARED) {
        struct fraction d = bare_density(m, s, h);
        real front = smith_front(m, s, i, o);
        if (COMPENSATED) front = smith_factor(m) * front;
        return counted(m, fr_factor(m, s), real_min(i.z, o.z),
                       saturated(quotient(d.num, d.den * front)));
    }
#if REAL_IS_FLOAT /* cosines are not so small that it matters what is multiplied first */
    if (m.masking == KERNEL_SMITH) {
        struct fraction d = bare_density_scaled(m, s, h, o), f = smith(m, s, i, o);
        real value = quotient(d.num * f.num, d.den * (i.z * f.den));
        return counted(m, fr_factor(m, s), real_min(real_min(i.z, o.z), i.c), value);
    }
#endif
    /* What counts as 0 is known after the division alone. */
    return counted(m, fr_factor(m, s), real_min(i.z, o.z), ratio(lit_density(m, s, i, o, h), i.z));
}

/* D / (4 sigma_o): visible-normal sampling, whatever the masking of the material. */
INLINE real bare_pdf(struct model m, const struct kernel_surface *s, struct direction i,
                     struct direction o, struct half h)
{
    (void)i;
    struct fraction d = bare_density_scaled(m, s, h, o);
    real value = saturated(
        quotient(d.num, d.den * real_max(4 * sigma_scaled(m, s, o), splat(REAL_MIN))));
    return counted(m, factor_of(m, s), h.hz, value);
}

INLINE real bare_d(struct model m, const struct kernel_surface *s, struct direction i,
                   struct direction o, struct half h)
{
    (void)i, (void)o;
    return counted(m, factor_of(m, s), h.hz, saturated(value_of(bare_density(m, s, h))));
}

INLINE real bare_d_vis(struct model m, const struct kernel_surface *s, struct direction i,
                       struct direction o, struct half h)
{
    (void)i;
    real length = root_from_zero(h.hh);                 /* |H| times scale */
    real facing_o = R(0.5) * quotient(length, h.scale); /* wo.h, that is cos theta_d */
    if (m.masking == KERNEL_VGROOVE)
        return facing_up(h, saturated(saturated(value_of(bare_density(m, s, h))) *
                                      ratio(facing_o * vgroove_visible(h, o.c), o.c)));
    if (m.masking == KERNEL_NONE)
        return facing_up(h, saturated(value_of(bare_density(m, s, h))) *
                                quotient(h.hz, real_max(length, splat(REAL_MIN))));
    struct fraction d = bare_density_scaled(m, s, h, o);
    real value = saturated(
        quotient(d.num * facing_o, d.den * real_max(sigma_scaled(m, s, o), splat(REAL_MIN))));
    return counted(m, factor_of(m, s), h.hz, value);
}

INLINE real quantity_fr(struct model m, const struct kernel_surface *s, struct direction i,
                        struct direction o, struct half h)
{
    return bare_fr(m, s, i, o, h) * fr_factor(m, s);
}

/* x / sigma from x / the scaled sigma, which is right until the quotient itself leaves the range. */
INLINE real unscale(struct model m, struct direction k, real quotient_)
{
    if (!scales(m)) return quotient_;
    /* exp(v^2) in two halves: it may be too large where the product is not. */
    pair v2 = beckmann_v2(k);
    real half = real_max(exp_minus_pair((pair){R(0.5) * v2.hi, R(0.5) * v2.lo}), splat(REAL_MIN));
    real unscaled = saturated(quotient(quotient(quotient_, half), half));
    return select(less(k.c, splat(0)), unscaled, quotient_);
}

/* G of fr = F D G / (4 z_i z_o) = F D num / (den z_i). */
INLINE real quantity_g(struct model m, const struct kernel_surface *s, struct direction i,
                       struct direction o, struct half h)
{
    struct fraction f = reflect(m, s, i, o, h, needs_scaling(m));
    real value = saturated(4 * o.z * ratio(f.num, f.den));
    return lit(i, o, needs_scaling(m) ? unscale(m, o, value) : value);
}

/* G1 of D_vis = G1 <k, h> D / z_k. */
INLINE real quantity_g1(struct model m, const struct kernel_surface *s, struct direction k,
                        struct half h)
{
    if (m.masking == KERNEL_VGROOVE) return ratio(k.z * vgroove_visible(h, k.c), k.c);
    if (m.masking == KERNEL_NONE)
        return 2 * real_max(k.z, splat(0)) *
               real_min(real_max(facing(h), splat(0)), splat(REAL_MAX / 4));
    return unscale(m, k, ratio(k.z, sigma_scaled(m, s, k)));
}

INLINE real quantity_g1_i(struct model m, const struct kernel_surface *s, struct direction i,
                          struct direction o, struct half h)
{
    (void)o;
    return quantity_g1(m, s, i, h);
}

INLINE real quantity_g1_o(struct model m, const struct kernel_surface *s, struct direction i,
                          struct direction o, struct half h)
{
    (void)i;
    return quantity_g1(m, s, o, h);
}

INLINE real quantity_sigma_o(struct model m, const struct kernel_surface *s, struct direction i,
                             struct direction o, struct half h)
{
    (void)i, (void)h;
    return sigma(m, s, o);
}

/* fr cos theta_i / (F pdf). */
INLINE real quantity_weight(struct model m, const struct kernel_surface *s, struct direction i,
                            struct direction o, struct half h)
{
    /* sigma_o, which may underflow, cancels. */
    if (m.masking == KERNEL_UNCORRELATED_THESIS)
        return lit(i, o, unscale(m, i, ratio(i.z, sigma_scaled(m, s, i))));
    struct fraction f = reflect(m, s, i, o, h, needs_scaling(m));
    real so = needs_scaling(m) ? sigma_scaled(m, s, o) : sigma(m, s, o);
    return lit(i, o, ratio(4 * so * f.num, f.den));
}

/* A sigma that is no less leaves D over the product of two in the range of a double. */
#define LEAST_SIGMA R(1e-30)

INLINE real quantity_condition(struct model m, const struct kernel_surface *s, struct direction i,
                               struct direction o, struct half h)
{
    (void)h;
    struct thesis t = thesis_denominator(m, s, i, o);
    real size = real_abs(t.denominator), least = real_min(sigma(m, s, i), sigma(m, s, o));
    real value = saturated(quotient(t.magnitude, real_max(size, splat(REAL_MIN))));
    /* D / (sigma_i sigma_o) where a sigma is about to underflow and D with it. */
    if (m.masking == KERNEL_UNCORRELATED_THESIS)
        value = select(less(least, splat(LEAST_SIGMA)), splat(REAL_MAX), splat(1));
    return select(less(splat(0), real_min(i.z, o.z)), value, splat(1));
}

#endif
