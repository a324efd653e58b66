/*
 * vmath.h - the transcendental functions the kernels need, branch-free so that
 * the loops around them vectorise.  Coefficients: vmath_coefficients.py.
 */
#ifndef FACET_VMATH_H
#define FACET_VMATH_H

#include "real.h"
#include "vmath_coefficients.h"

#if REAL_IS_FLOAT
#define COEFFICIENTS(name) name##_FLOAT
#define EXP_SHIFT 23
#define EXP_BIAS 127
#define EXP_MAGIC 12582912.0f /* 1.5 * 2^23: adding it rounds to an integer */
#define EXP_DOMAIN 87.0f      /* exp(-87) is the last normal float */
#else
#define COEFFICIENTS(name) name##_DOUBLE
#define EXP_SHIFT 52
#define EXP_BIAS 1023
#define EXP_MAGIC 6755399441055744.0 /* 1.5 * 2^52 */
#define EXP_DOMAIN 708.0
#endif

/* Horner, written out by the preprocessor: an array would keep the loop around it from vectorising. */
#define POLY_FIRST(c) y_ = (real)(c);
#define POLY_STEP(c) y_ = madd(y_, x_, (real)(c));
#define POLY(name, x)                                                           \
    __extension__({                                                             \
        real x_ = (x), y_;                                                      \
        COEFFICIENTS(name)(POLY_FIRST, POLY_STEP) y_;                           \
    })

/* exp(-x) for x >= 0; 0 past EXP_DOMAIN. */
INLINE real exp_minus(real x)
{
    const real log2e = (real)1.44269504088896340736;
    /* ln 2 in two parts, the first with zeros at its end: n * high is exact. */
    const real ln2_high = REAL_IS_FLOAT ? (real)0.693145751953125 : (real)6.93147180369123816490e-01;
    const real ln2_low = REAL_IS_FLOAT ? (real)1.42860682030941723212e-6 : (real)1.90821492927058770002e-10;
    real clamped = real_min(x, EXP_DOMAIN);
    real shifted = (real)EXP_MAGIC - clamped * log2e;
    real n = shifted - (real)EXP_MAGIC;
    real r = madd(-n, ln2_low, madd(-n, ln2_high, -clamped));
    real scale = real_from_bits((real_bits)((uint64_t)(real_to_bits(shifted) + EXP_BIAS) << EXP_SHIFT));
    return x > (real)EXP_DOMAIN ? 0 : POLY(EXP, r) * scale;
}

struct sin_cos {
    real sin, cos;
};

/* sin and cos of 2 pi u, u in [0, 1]. */
INLINE struct sin_cos sin_cos_turns(real u)
{
    real magic = (real)EXP_MAGIC, quarter = (u * 4 + magic) - magic;
    real f = madd((real)-0.25, quarter, u), f2 = f * f;
    real s = f * POLY(SINPI, f2), c = POLY(COSPI, f2);
    /* Quarter 2 is quarter 0 negated, and so on; 4 is 0 again. */
    real half = quarter - 2, side = real_abs(real_abs(half) - 1); /* side 0: odd quarters */
    real sine = side == 0 ? c : s, cosine = side == 0 ? s : c;
    real past = real_abs(quarter - (real)2.5), left = real_abs(half + (real)0.5);
    return (struct sin_cos){ past < 1 ? -sine : sine, left < 1 ? -cosine : cosine };
}

/* The variable of the two tails below: 1 at v = 0, 0 at infinity, for v = c / s. */
INLINE real tail_variable(real c, real s)
{
    return ERFC_SCALE * s / (ERFC_SCALE * s + c);
}

/* psi_x(v) = (1/sqrt(pi) - v erfcx(v))/2 = exp(v^2) (N(v) - v), v >= 0. */
INLINE real psi_x(real w)
{
    return w * w * POLY(PSI, 2 * w - 1);
}

/* erfcx(v) = exp(v^2) erfc(v), v >= 0. */
INLINE real erfcx_tail(real w)
{
    return w * POLY(ERFCX, 2 * w - 1);
}

#endif
