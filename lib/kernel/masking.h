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

INLINE real density(struct model m, const struct kernel_surface *s, struct half h)
{
    return m.ndf == FACET_GGX        ? ggx_density(s, h)
           : m.ndf == FACET_BECKMANN ? beckmann_density(s, h)
                                     : table_density(s, h);
}

INLINE real density_scaled(struct model m, const struct kernel_surface *s, struct half h,
                           struct direction o)
{
    return m.ndf == FACET_BECKMANN ? beckmann_density_scaled(s, h, o) : density(m, s, h);
}

INLINE real excess(struct model m, const struct kernel_surface *s, struct direction k)
{
    return m.ndf == FACET_GGX        ? ggx_excess(k)
           : m.ndf == FACET_BECKMANN ? beckmann_excess(k)
                                     : table_excess(s, k);
}

INLINE real excess_scaled(struct model m, const struct kernel_surface *s, struct direction k)
{
    return m.ndf == FACET_BECKMANN ? beckmann_excess_scaled(k) : excess(m, s, k);
}

INLINE real sigma(struct model m, const struct kernel_surface *s, struct direction k)
{
    return m.ndf == FACET_GGX ? ggx_sigma(k) : real_max(k.c, 0) + excess(m, s, k);
}

INLINE real sigma_scaled(struct model m, const struct kernel_surface *s, struct direction k)
{
    return m.ndf == FACET_GGX ? ggx_sigma(k) : real_max(k.c, 0) + excess_scaled(m, s, k);
}

/* 0 instead of x / 0, the largest number instead of infinity. */
INLINE real ratio(real x, real y)
{
    real q = x / y;
    q = q < (real)REAL_MAX ? q : (real)REAL_MAX;
    return real_min(x, y) > 0 ? q : 0;
}

/* 0 unless both directions are above the horizon (one comparison: GCC does not vectorise a compound one). */
INLINE real lit(struct direction i, struct direction o, real value)
{
    return real_min(i.z, o.z) > 0 ? value : 0;
}

/* 4 (sigma_o c_i + (sigma_i - c_i) max(c_o, 0)), for c_i > 0; height-correlated, energy-safe. */
INLINE real smith_denominator(struct model m, const struct kernel_surface *s, struct direction i,
                              struct direction o, bool scaled)
{
    if (m.ndf == FACET_GGX) return m.shape == KERNEL_SHEARED ? ggx_smith(i, o) : ggx_smith_front(i, o);
    real to = scaled ? excess_scaled(m, s, o) : excess(m, s, o), co = real_max(o.c, 0);
    return 4 * (co * (i.c + excess(m, s, i)) + to * i.c);
}

/* Dupuy eq. 3.3 in 2.13: sigma_o z_i + z_o (sigma_i - z_i), which may vanish, and the sum of its magnitudes. */
struct thesis {
    real denominator, magnitude;
};

INLINE struct thesis thesis_denominator(struct model m, const struct kernel_surface *s,
                                        struct direction i, struct direction o)
{
    real zi = i.z, zo = o.z, so = sigma(m, s, o), si = sigma(m, s, i);
    return (struct thesis){ so * zi + zo * (si - zi), so * zi + zo * (si + zi) };
}

/* H_z / |H|^2. */
INLINE real facing(struct half h)
{
    return h.scale * h.hz / h.hh;
}

/* V-cavity: the visible share of the facets h from a direction with cosine c to the mean facet. */
INLINE real vgroove_visible(struct half h, real c)
{
    return real_max(real_min(4 * facing(h) * c, 1), 0);
}

struct fraction {
    real num, den;
};

/*
 * fr cos theta_i = F D num / den; num <= 0 or den <= 0 stand for 0.  With
 * `scaled`, D and sigma_o are the scaled ones.
 */
INLINE struct fraction reflect(struct model m, const struct kernel_surface *s, struct direction i,
                               struct direction o, struct half h, bool scaled)
{
    switch (m.masking) {
    case KERNEL_SMITH:
        return (struct fraction){ i.c, smith_denominator(m, s, i, o, scaled) };
    case KERNEL_UNCORRELATED:
        return (struct fraction){ i.c, 4 * sigma(m, s, i) * (scaled ? sigma_scaled(m, s, o) : sigma(m, s, o)) };
    case KERNEL_VGROOVE:
        return (struct fraction){ vgroove_visible(h, real_min(i.c, o.c)), 4 * o.c };
    case KERNEL_NONE:
        return (struct fraction){ h.scale * h.hz, 2 * h.hh };
    case KERNEL_SMITH_THESIS:
        return (struct fraction){ i.z, 4 * thesis_denominator(m, s, i, o).denominator };
    case KERNEL_UNCORRELATED_THESIS:
    default:
        return (struct fraction){ i.z, 4 * sigma(m, s, i) * sigma(m, s, o) };
    }
}

/* Below c_o < 0 only the energy-safe forms divide D by sigma_o, which both underflow there. */
INLINE bool needs_scaling(struct model m)
{
    return m.shape == KERNEL_SHEARED && (m.masking == KERNEL_SMITH || m.masking == KERNEL_UNCORRELATED);
}

INLINE real quantity_fr_cos(struct model m, const struct kernel_surface *s, struct direction i,
                            struct direction o, struct half h)
{
    bool scaled = needs_scaling(m);
    struct fraction f = reflect(m, s, i, o, h, scaled);
    real d = scaled ? density_scaled(m, s, h, o) : density(m, s, h);
    /* The fraction first: d and num may both be small, and so may num and den. */
    return lit(i, o, real_min(d * ratio(f.num, f.den), (real)REAL_MAX));
}

/* fr cos theta_i / cos theta_i, which cancels on a central Smith surface. */
INLINE real quantity_fr(struct model m, const struct kernel_surface *s, struct direction i,
                        struct direction o, struct half h)
{
    if (m.masking == KERNEL_SMITH && m.shape != KERNEL_SHEARED) {
        return lit(i, o, ratio(density(m, s, h), smith_denominator(m, s, i, o, false)));
    }
    return ratio(quantity_fr_cos(m, s, i, o, h), i.z);
}

/* D / (4 sigma_o): visible-normal sampling, whatever the masking of the material. */
INLINE real quantity_pdf(struct model m, const struct kernel_surface *s, struct direction i,
                         struct direction o, struct half h)
{
    (void)i;
    return ratio(density_scaled(m, s, h, o), 4 * sigma_scaled(m, s, o));
}

INLINE real quantity_d(struct model m, const struct kernel_surface *s, struct direction i,
                       struct direction o, struct half h)
{
    (void)i, (void)o;
    return density(m, s, h);
}

INLINE real quantity_d_vis(struct model m, const struct kernel_surface *s, struct direction i,
                           struct direction o, struct half h)
{
    (void)i;
    real facing_o = (real)0.5 * h.length; /* wo.h, that is cos theta_d */
    if (m.masking == KERNEL_VGROOVE)
        return density(m, s, h) * ratio(facing_o * vgroove_visible(h, o.c), o.c);
    if (m.masking == KERNEL_NONE) return density(m, s, h) * h.hz / real_max(real_sqrt(h.hh), (real)REAL_MIN);
    return ratio(density_scaled(m, s, h, o) * facing_o, sigma_scaled(m, s, o));
}

/* x / sigma from x / the scaled sigma, which is right until the quotient itself leaves the range. */
INLINE real unscale(struct model m, struct direction k, real quotient)
{
    if (m.ndf != FACET_BECKMANN) return quotient;
    /* exp(v^2) in two halves: it may be too large where the product is not. */
    real half = real_max(exp_minus((real)0.5 * beckmann_v2(k)), (real)REAL_MIN);
    return k.c < 0 ? real_min(quotient / half / half, (real)REAL_MAX) : quotient;
}

/* G of fr = F D G / (4 z_i z_o) = F D num / (den z_i). */
INLINE real quantity_g(struct model m, const struct kernel_surface *s, struct direction i,
                       struct direction o, struct half h)
{
    struct fraction f = reflect(m, s, i, o, h, needs_scaling(m));
    real value = ratio(4 * o.z * f.num, f.den);
    return lit(i, o, needs_scaling(m) ? unscale(m, o, value) : value);
}

/* G1 of D_vis = G1 <k, h> D / z_k. */
INLINE real quantity_g1(struct model m, const struct kernel_surface *s, struct direction k, struct half h)
{
    if (m.masking == KERNEL_VGROOVE) return ratio(k.z * vgroove_visible(h, k.c), k.c);
    if (m.masking == KERNEL_NONE) return 2 * real_max(k.z, 0) * real_min(real_max(facing(h), 0), (real)(REAL_MAX / 4));
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

INLINE real quantity_condition(struct model m, const struct kernel_surface *s, struct direction i,
                               struct direction o, struct half h)
{
    (void)h;
    struct thesis t = thesis_denominator(m, s, i, o);
    real size = real_abs(t.denominator), least = real_min(sigma(m, s, i), sigma(m, s, o));
    real value = real_min(t.magnitude / real_max(size, (real)REAL_MIN), (real)REAL_MAX);
    /* D / (sigma_i sigma_o) where a sigma is about to underflow and D with it. */
    if (m.masking == KERNEL_UNCORRELATED_THESIS) value = least < (real)1e-30 ? (real)REAL_MAX : 1;
    return real_min(i.z, o.z) > 0 ? value : 1;
}

#endif
