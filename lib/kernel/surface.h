/*
 * surface.h - the affine map from standard slopes to the surface's, for every ndf.
 *
 * Dupuy 2015 eqs. 2.26, 2.35, 3.2 and 3.3 (lib/NOTATION.md), arranged so that
 * no slope is formed, nothing is divided by h_z and, in precise, nothing cancels
 * that is not formed in `wide`.
 */
#ifndef FACET_SURFACE_H
#define FACET_SURFACE_H

#include "kernels.h"
#include "real.h"

/* The largest power of two that |H| is scaled by: it brings what is subnormal to 1e-22, whose powers are numbers. */
#define SCALE_MAX 0x1p1000

struct vec3 {
    real x, y, z;
};

/* One direction k against the surface. */
struct direction {
    real z;             /* macro cosine */
    real c;             /* k_z - k_x slope_x - k_y slope_y: the cosine with the mean facet */
    real a, b, s2;      /* stretched tangential part and its squared length */
    real c_low, s2_low; /* what c and s2 lack (precise only) */
};

/* A pair of directions as the caller gave it. */
struct given {
    struct vec3 wi, wo;
    struct vec3 sum; /* wi + wo, rounded once */
    pair ci, co;     /* cosines with the mean facet (sheared only) */
};

/* The half vector, up to a power of two, in standard slopes. */
struct half {
    real x, y, z; /* minus standard slopes times H_z, and H_z */
    real flat;    /* H_x^2 + H_y^2 */
    real iso_sum; /* isotropic: their squares summed, and x, y are those of H itself */
    pair wide_x, wide_y,
        wide_z; /* for exponents (precise): det (X, Y, H_z), or H itself where isotropic */
    real hz;    /* H_z */
    real hh;    /* |H|^2 */
    real scale; /* the power of two that brought H to size 1 */
};

struct fraction {
    real num, den;
};

#if REAL_IS_FLOAT
INLINE pair mean_cosine_of_doubles(const struct kernel_surface *s, struct doubles x,
                                   struct doubles y, struct doubles z)
{
    for (int j = 0; j < 2; j++)
        z.half[j] = half_nmadd(x.half[j], s->slope_x, half_nmadd(y.half[j], s->slope_y, z.half[j]));
    return (pair){narrow(z), splat(0)};
}
#endif

/* The largest sum of the magnitudes that c is made of. */
INLINE double lean_of(const struct kernel_surface *s)
{
    return 1 + __builtin_fabs(s->slope_x) + __builtin_fabs(s->slope_y);
}

#if REAL_IS_FLOAT
/* In float c is right to 1.5 2^-24 lean_of: 2.3e-5 of it where it is no less than this times lean_of. */
#define UNSURE_COSINE 0x1p-8

INLINE pair mean_cosine_of_floats(const struct kernel_surface *s, struct vec3 k)
{
    return (pair){nmadd(k.x, splat(R(s->slope_x)), nmadd(k.y, splat(R(s->slope_y)), k.z)),
                  splat(0)};
}
#endif

/*
 * fr cos theta_i vanishes with c: its relative error is c's.  So c is formed a
 * step wider than the tier: in double for float, in pairs for precise; exact32
 * calls those strays that its double is not enough for.
 */
INLINE pair mean_cosine(const struct kernel_surface *s, struct vec3 k)
{
#if COMPENSATED
    pair x = pair_product(k.x, splat(-s->slope_x), splat(0)),
         y = pair_product(k.y, splat(-s->slope_y), splat(0));
    return pair_add((pair){k.z, splat(0)}, pair_add(x, y));
#elif REAL_IS_FLOAT
    return mean_cosine_of_doubles(s, widen(k.x), widen(k.y), widen(k.z));
#else
    return (pair){nmadd(k.x, splat(s->slope_x), nmadd(k.y, splat(s->slope_y), k.z)), splat(0)};
#endif
}

#if COMPENSATED
/* What s2 lacks: only Beckmann's exponents ask, and only then it is computed. */
INLINE real square_low(real s2, pair a, pair b)
{
    pair exact = pair_add(pair_multiply(a, a), pair_multiply(b, b));
    return (exact.hi - s2) + exact.lo;
}
#endif

INLINE struct direction direction_of(const struct kernel_surface *s, enum kernel_shape shape,
                                     struct vec3 d, pair c)
{
    struct direction k = {.z = d.z, .c = d.z};
    if (shape == KERNEL_ISO) {
        k.a = R(s->alpha_x) * d.x;
        k.b = R(s->alpha_x) * d.y;
        k.s2 = R(s->alpha_x * s->alpha_x) * madd(d.x, d.x, d.y * d.y);
#if COMPENSATED
        pair ax = pair_product(d.x, splat(s->alpha_x), splat(0)),
             ay = pair_product(d.y, splat(s->alpha_x), splat(0));
        k.s2_low = square_low(k.s2, ax, ay);
#endif
        return k;
    }
    wide a = wide_madd(wide_of(d.x), s->alpha_x, 0,
                       wide_scale(wide_of(d.y), s->rho_alpha_y, s->rho_alpha_y_low));
    k.a = wide_round(a);
    k.b = R(s->kappa_alpha_y) * d.y;
    k.s2 = madd(k.a, k.a, k.b * k.b);
#if COMPENSATED
    k.s2_low = square_low(k.s2, a,
                          pair_product(d.y, splat(s->kappa_alpha_y), splat(s->kappa_alpha_y_low)));
#endif
    if (shape == KERNEL_SHEARED) k.c = c.hi, k.c_low = c.lo;
    return k;
}

/* 2^-e, e the exponent of x >= 0 (of the smallest normal number where x is less). */
INLINE real inverse_exponent(real x)
{
    const lane_bits exponents = REAL_IS_FLOAT ? (lane_bits)0xfe << 23
                                              : (lane_bits)((int64_t)0x7fe << 52);
    const lane_bits twice_bias = REAL_IS_FLOAT ? (lane_bits)0xfd << 23
                                               : (lane_bits)((int64_t)2045 << 52);
    return (real)(twice_bias - ((bits)x & exponents));
}

/*
 * 2^-e, e the exponent of the largest component of H: brings H to size 1, so that
 * no square of it leaves the range.  In precise alone: eval.c keeps short H away
 * from the others, and the scaling costs as much as the rest of isotropic GGX.
 */
INLINE real scale_of(struct vec3 h)
{
    real largest = real_max(real_max(real_abs(h.x), real_abs(h.y)), real_abs(h.z));
    return real_min(inverse_exponent(largest), splat(R(SCALE_MAX)));
}

/* x and y from H less the mean slope (mean_x, mean_y). */
INLINE void standard_slopes(const struct kernel_surface *s, wide mean_x, wide mean_y, real scale,
                            struct half *h)
{
#if COMPENSATED
    wide cross = wide_madd(mean_y, s->alpha_x, 0,
                           wide_scale(mean_x, -s->rho_alpha_y, -s->rho_alpha_y_low));
    /* scale goes first: scale times a parameter overflows where H is subnormal */
    pair x = {mean_x.hi * scale, mean_x.lo * scale}, y = {cross.hi * scale, cross.lo * scale};
    /* Rounded once, what det's double lacks included: D has the fourth power. */
    h->x = x.hi / s->alpha_x;
    h->y = (y.hi + nmadd(y.hi, splat(s->det_low / s->det), y.lo)) / s->det;
    h->wide_x = pair_multiply(x, (pair){splat(s->kappa_alpha_y), splat(s->kappa_alpha_y_low)});
    h->wide_y = y;
    h->wide_z = pair_multiply(h->wide_z, (pair){splat(s->det), splat(s->det_low)});
#else
    (void)scale;
    h->x = mean_x * R(s->inverse_x);
    h->y = nmadd(mean_x, splat(R(s->tilt)), mean_y * R(s->inverse_y));
#endif
}

INLINE struct half half_of(const struct kernel_surface *s, enum kernel_shape shape,
                           const struct given *g)
{
    struct vec3 sum = g->sum;
    struct half h = {.scale = splat(1)};
#if COMPENSATED
    h.scale = scale_of(sum);
    wide mean_x = pair_sum(g->wi.x, g->wo.x), mean_y = pair_sum(g->wi.y, g->wo.y),
         up = pair_sum(g->wi.z, g->wo.z);
    h.wide_x = (pair){mean_x.hi * h.scale, mean_x.lo * h.scale};
    h.wide_y = (pair){mean_y.hi * h.scale, mean_y.lo * h.scale};
    h.wide_z = (pair){up.hi * h.scale, up.lo * h.scale};
#else
    wide mean_x = sum.x, mean_y = sum.y, up = sum.z;
#endif
    h.x = sum.x * h.scale, h.y = sum.y * h.scale, h.hz = sum.z * h.scale;
    real tall = h.hz * h.hz;
    h.flat = madd(h.x, h.x, h.y * h.y);
    h.hh = h.flat + tall;
    if (shape == KERNEL_ISO) {
        h.iso_sum = madd(h.flat, splat(R(s->inverse_alpha2)), tall);
        return h;
    }
    h.z = h.hz;
    if (shape == KERNEL_SHEARED) {
        mean_x = wide_madd(up, s->slope_x, 0, mean_x);
        mean_y = wide_madd(up, s->slope_y, 0, mean_y);
    }
    standard_slopes(s, mean_x, mean_y, h.scale, &h);
    return h;
}

/* X^2 + Y^2 + H_z^2. */
INLINE real standard_square(enum kernel_shape shape, struct half h)
{
    if (shape == KERNEL_ISO) return h.iso_sum;
    return madd(h.x, h.x, madd(h.y, h.y, h.z * h.z));
}

#endif
