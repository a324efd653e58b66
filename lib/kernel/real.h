/*
 * real.h - the arithmetic of a tier: what a quotient and a root cost, and how
 * wide the linear forms are that feed the formulas.
 *
 *   draft    float; estimates of reciprocals and roots as they come where AVX-512 has them
 *   fast     float, right to the last digit or so
 *   exact32  double, estimates refined to 2e-13: a float's rounding is what is left
 *   precise  double, and double-double where terms cancel
 *
 * Everything outside the linear forms is a sum of like signs.
 */
#ifndef FACET_REAL_H
#define FACET_REAL_H

#include "lanes.h"

#if defined(FACET_TIER_precise)
#define COMPENSATED 1
#else
#define COMPENSATED 0
#endif

#if defined(FACET_TIER_draft)
#define DRAFT 1
#else
#define DRAFT 0
#endif

#define SQRT_PI 1.77245385090551602730
#define ONE_OVER_PI 0.318309886183790671538

/*
 * How quotients and roots are had: by the processor's own instructions (EXACT), by
 * an estimate y of relative error e refined to e^3 (HALLEY), or by the estimate
 * as it comes (NOT).  The divider works beside the multipliers: a quotient or root
 * takes one or two of their cycles, an estimate and Newton's step four, so that
 * float loops, which have few of them, are faster with the exact ones.
 */
#define REFINE_NOT 0
#define REFINE_HALLEY 1
#define REFINE_EXACT 2

#if HAS_ESTIMATES == 14 && defined(FACET_TIER_draft)
#define REFINE REFINE_NOT
#elif HAS_ESTIMATES == 14 && defined(FACET_TIER_exact32)
#define REFINE REFINE_HALLEY
#else
#define REFINE REFINE_EXACT
#endif

#if HAS_ESTIMATES
INLINE real recip_refined(real x, int how)
{
    real y = recip_estimate(x);
    if (how == REFINE_NOT) return y;
    real e = nmadd(x, y, splat(1));
    return madd(madd(e, e, e), y, y);
}

INLINE real rsqrt_refined(real x, int how)
{
    real y = rsqrt_estimate(x);
    if (how == REFINE_NOT) return y;
    real e = nmadd(x * y, y, splat(1));
    return madd(madd(e, splat(R(0.375)), splat(R(0.5))) * e, y, y);
}

/* sqrt(x) by an estimate of 1/sqrt(x), whose step goes into the product. */
INLINE real root_refined(real x, int how)
{
    real y = rsqrt_estimate(x), s = x * y;
    if (how == REFINE_NOT) return s;
    real e = nmadd(s, y, splat(1));
    return madd(R(0.5) * s, madd(R(0.75) * e, e, e), s);
}
#else
INLINE real recip_refined(real x, int how)
{
    (void)how;
    return 1 / x;
}
INLINE real rsqrt_refined(real x, int how)
{
    (void)how;
    return 1 / real_sqrt(x);
}
INLINE real root_refined(real x, int how)
{
    (void)how;
    return real_sqrt(x);
}
#endif

/* 1/x, x > 0 (no less than REAL_MIN). */
INLINE real recip(real x)
{
    return REFINE == REFINE_EXACT ? 1 / x : recip_refined(x, REFINE);
}

INLINE real quotient(real a, real b)
{
    return REFINE == REFINE_EXACT ? a / b : a * recip_refined(b, REFINE);
}

INLINE real rsqrt(real x)
{
    return REFINE == REFINE_EXACT ? 1 / real_sqrt(x) : rsqrt_refined(x, REFINE);
}

/* sqrt(x), x > 0; of 0 it may be not a number (a stray), root_from_zero gives 0. */
INLINE real root(real x)
{
    return REFINE == REFINE_EXACT ? real_sqrt(x) : root_refined(x, REFINE);
}

INLINE real root_from_zero(real x)
{
    return REFINE == REFINE_EXACT ? real_sqrt(x)
                                  : root_refined(real_max(x, splat(REAL_MIN)), REFINE);
}

/* To rounding in draft too: for what a difference or an exponent will magnify. */
INLINE real root_fine(real x)
{
    return REFINE == REFINE_HALLEY ? root_refined(x, REFINE) : real_sqrt(x);
}

INLINE real recip_fine(real x)
{
    return REFINE == REFINE_HALLEY ? recip_refined(x, REFINE) : 1 / x;
}

INLINE real quotient_fine(real a, real b)
{
    return REFINE == REFINE_HALLEY ? a * recip_refined(b, REFINE) : a / b;
}

/* s = sqrt(s2) and c / s, s2 >= REAL_MIN, for what varies slowly: in draft any estimate will do. */
struct cotangent {
    real s, v;
};

INLINE struct cotangent cotangent_of(real c, real s2)
{
#if HAS_ESTIMATES
    if (REAL_IS_FLOAT ? DRAFT : REFINE == REFINE_HALLEY) {
        real inverse = DRAFT ? rsqrt_estimate(s2) : rsqrt(s2);
        return (struct cotangent){s2 * inverse, c * inverse};
    }
#endif
    real s = root(s2);
    return (struct cotangent){s, quotient(c, s)};
}

/* ---- pairs: unevaluated sums hi + lo --------------------------------------------- */

/* Error-free transformations of Dekker (1971) and Knuth; twice the digits of real. */
typedef struct pair {
    real hi, lo;
} pair;

INLINE pair pair_sum(real a, real b)
{
    real s = a + b, t = s - a;
    return (pair){s, (a - (s - t)) + (b - t)};
}

INLINE real product_error(real a, real b, real p)
{
    if (HAS_FMA) return -nmadd(a, b, p);
    const lane split = REAL_IS_FLOAT ? R(4097) : R(134217729); /* 2^12 + 1, 2^27 + 1 */
    real ca = split * a, cb = split * b;
    real ah = ca - (ca - a), bh = cb - (cb - b), al = a - ah, bl = b - bh;
    return ((ah * bh - p) + ah * bl + al * bh) + al * bl;
}

/* a (b + b_low), b_low what b lacks. */
INLINE pair pair_product(real a, real b, real b_low)
{
    real p = a * b;
    return (pair){p, product_error(a, b, p) + a * b_low};
}

/* hi the sum rounded, lo the rest, for |lo| below |hi|. */
INLINE pair pair_normalise(pair a)
{
    real s = a.hi + a.lo;
    return (pair){s, a.lo - (s - a.hi)};
}

/* Normalised: where the first parts cancel, the second are no longer small. */
INLINE pair pair_add(pair a, pair b)
{
    pair s = pair_sum(a.hi, b.hi);
    return pair_normalise((pair){s.hi, s.lo + (a.lo + b.lo)});
}

INLINE pair pair_multiply(pair a, pair b)
{
    real p = a.hi * b.hi, rest = madd(a.hi, b.lo, madd(a.lo, b.hi, product_error(a.hi, b.hi, p))),
         s = p + rest;
    return (pair){s, rest - (s - p)};
}

/* a / b to about the digits of a pair. */
INLINE pair pair_quotient(pair a, pair b)
{
    real q = a.hi / b.hi, p = q * b.hi;
    real rest = ((a.hi - p) - product_error(q, b.hi, p)) + (a.lo - q * b.lo);
    return (pair){q, rest / b.hi};
}

INLINE real pair_round(pair a)
{
    return a.hi + a.lo;
}

/* ---- wide: the precision of linear forms ------------------------------------------ */

#if COMPENSATED

typedef pair wide;

INLINE wide wide_of(real a)
{
    return (pair){a, splat(0)};
}
INLINE real wide_round(wide a)
{
    return pair_round(a);
}
/* a (b + b_low). */
INLINE wide wide_scale(wide a, double b, double b_low)
{
    pair p = pair_product(a.hi, splat(b), splat(b_low));
    return (pair){p.hi, madd(a.lo, splat(b), p.lo)};
}

INLINE wide wide_madd(wide a, double b, double b_low, wide c)
{
    return pair_add(wide_scale(a, b, b_low), c);
}

#else

typedef real wide;

INLINE wide wide_of(real a)
{
    return a;
}
INLINE real wide_round(wide a)
{
    return a;
}
INLINE wide wide_scale(wide a, double b, double b_low)
{
    (void)b_low;
    return a * R(b);
}
INLINE wide wide_madd(wide a, double b, double b_low, wide c)
{
    (void)b_low;
    return madd(a, splat(R(b)), c);
}

#endif

#endif
