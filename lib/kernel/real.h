/*
 * real.h - the arithmetic of a tier.
 *
 * real is what the formulas run in: float for fast, double for precise.  The
 * linear forms that feed them (H, and what shear and correlation make of it)
 * cancel, so they run one step wider: double for fast, double-double for
 * precise.  Everything else in the kernels is a sum of like signs.
 */
#ifndef FACET_REAL_H
#define FACET_REAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))

#ifdef FACET_TIER_fast
typedef float real;
typedef int32_t real_bits;
#define REAL_IS_FLOAT 1
#define REAL_MIN 1.17549435e-38f
#define REAL_MAX 3.40282347e38f
#else
typedef double real;
typedef int64_t real_bits;
#define REAL_IS_FLOAT 0
#define REAL_MIN 2.2250738585072014e-308
#define REAL_MAX 1.7976931348623157e308
#endif

#define DOUBLE_MIN 2.2250738585072014e-308

#define SQRT_PI 1.77245385090551602730
#define ONE_OVER_PI 0.318309886183790671538

INLINE real real_sqrt(real x)
{
#if REAL_IS_FLOAT
    return __builtin_sqrtf(x);
#else
    return __builtin_sqrt(x);
#endif
}

INLINE real real_abs(real x)
{
#if REAL_IS_FLOAT
    return __builtin_fabsf(x);
#else
    return __builtin_fabs(x);
#endif
}

INLINE real real_max(real a, real b)
{
    return a > b ? a : b;
}

INLINE real real_min(real a, real b)
{
    return a < b ? a : b;
}

/* a b + c, in one rounding where the instruction set has it. */
INLINE real madd(real a, real b, real c)
{
#ifdef __FMA__
#if REAL_IS_FLOAT
    return __builtin_fmaf(a, b, c);
#else
    return __builtin_fma(a, b, c);
#endif
#else
    return a * b + c;
#endif
}

INLINE real_bits real_to_bits(real x)
{
    real_bits i;
    memcpy(&i, &x, sizeof i);
    return i;
}

INLINE real real_from_bits(real_bits i)
{
    real x;
    memcpy(&x, &i, sizeof x);
    return x;
}

/* ---- pairs: unevaluated sums hi + lo -------------------------------------------- */

/* Error-free transformations of Dekker (1971) and Knuth; about 106 bits. */
typedef struct pair {
    double hi, lo;
} pair;

INLINE pair pair_sum(double a, double b)
{
    double s = a + b, t = s - a;
    return (pair){ s, (a - (s - t)) + (b - t) };
}

INLINE double product_error(double a, double b, double p)
{
#ifdef __FMA__
    return __builtin_fma(a, b, -p);
#else
    const double split = 134217729.0; /* 2^27 + 1 */
    double ca = split * a, cb = split * b;
    double ah = ca - (ca - a), bh = cb - (cb - b), al = a - ah, bl = b - bh;
    return ((ah * bh - p) + ah * bl + al * bh) + al * bl;
#endif
}

/* a (b + b_low), b_low what the double b lacks. */
INLINE pair pair_product(double a, double b, double b_low)
{
    double p = a * b;
    return (pair){ p, product_error(a, b, p) + a * b_low };
}

INLINE pair pair_add(pair a, pair b)
{
    pair s = pair_sum(a.hi, b.hi);
    return (pair){ s.hi, s.lo + (a.lo + b.lo) };
}

INLINE double pair_round(pair a)
{
    return a.hi + a.lo;
}

/* ---- wide: the precision of linear forms, a step above real --------------------- */

#if REAL_IS_FLOAT

typedef double wide;

INLINE wide wide_sum(double a, double b) { return a + b; }
INLINE wide wide_product(double a, double b, double b_low) { (void)b_low; return a * b; }
INLINE wide wide_add(wide a, wide b) { return a + b; }
INLINE wide wide_scale(wide a, double b, double b_low) { (void)b_low; return a * b; }
INLINE double wide_round(wide a) { return a; }

#else

typedef pair wide;

INLINE wide wide_sum(double a, double b) { return pair_sum(a, b); }
INLINE wide wide_product(double a, double b, double b_low) { return pair_product(a, b, b_low); }
INLINE wide wide_add(wide a, wide b) { return pair_add(a, b); }
INLINE double wide_round(wide a) { return pair_round(a); }

INLINE wide wide_scale(wide a, double b, double b_low)
{
    pair p = pair_product(a.hi, b, b_low);
    return (pair){ p.hi, p.lo + a.lo * b };
}

#endif

/* 2^-e, e the exponent of x >= 0 (of the smallest normal number where x is less). */
INLINE double inverse_exponent(double x)
{
    int64_t i;
    memcpy(&i, &x, sizeof i);
    i = ((int64_t)2045 << 52) - (i & ((int64_t)0x7fe << 52));
    memcpy(&x, &i, sizeof x);
    return x;
}

#endif
