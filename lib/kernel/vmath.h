/*
 * vmath.h - the transcendental functions the kernels need.  Coefficients:
 * vmath_coefficients.py, to the degree that each tier's promise asks for.
 */
#ifndef FACET_VMATH_H
#define FACET_VMATH_H

#include "real.h"
#include "vmath_coefficients.h"

#if REAL_IS_FLOAT
#define EXP_SHIFT 23
#define EXP_BIAS 127
#define EXP_MAGIC 12582912.0f /* 1.5 * 2^23: adding it rounds to an integer */
#else
#define EXP_SHIFT 52
#define EXP_BIAS 1023
#define EXP_MAGIC 6755399441055744.0 /* 1.5 * 2^52 */
#define EXP_DOMAIN 708.0             /* exp(-708) is the last normal double */
#endif

/* Horner, written out by the preprocessor. */
#define HORNER_STEP(c) y_ = madd(y_, x_, splat(R(c)));
#define HORNER(coefficients, x)                                                                    \
    __extension__({                                                                                \
        real x_ = (x), y_;                                                                         \
        coefficients(POLY_FIRST, HORNER_STEP, HORNER_STEP) y_;                                     \
    })
#define POLY_FIRST(c) y_ = splat(R(c));

/* The even and the odd powers each by Horner: half as long a chain for one product more. */
#define POLY_SECOND(c) z_ = splat(R(c));
#define POLY_STEP(c) next_ = madd(y_, x2_, splat(R(c))), y_ = z_, z_ = next_;
#define POLY(coefficients, x)                                                                      \
    __extension__({                                                                                \
        real x_ = (x), x2_ = x_ * x_, y_, z_, next_;                                               \
        coefficients(POLY_FIRST, POLY_SECOND, POLY_STEP) madd(y_, x_, z_);                         \
    })

#if defined(FACET_TIER_draft)
#define TIER_COEFFICIENTS(name) name##_DRAFT
#undef POLY
#define POLY HORNER /* short as they are */
#elif defined(FACET_TIER_fast)
#define TIER_COEFFICIENTS(name) name##_FAST
#elif defined(FACET_TIER_exact32)
#define TIER_COEFFICIENTS(name) name##_EXACT32
#else
#define TIER_COEFFICIENTS(name) name##_PRECISE
#endif
#define EXPAND_POLY(coefficients, x) POLY(coefficients, x)
#define TIER_POLY(name, x) EXPAND_POLY(TIER_COEFFICIENTS(name), x)

#if COMPENSATED

#define EXPONENT_UNIT 1.0
#define LIFT 0

/* exp(-x) for x >= 0; 0 past EXP_DOMAIN. */
INLINE real exp_minus(real x)
{
    const lane log2e = R(1.44269504088896340736);
    /* ln 2 in two parts, the first with zeros at its end: n * high is exact. */
    const lane ln2_high = R(6.93147180369123816490e-01), ln2_low = R(1.90821492927058770002e-10);
    real clamped = real_min(x, splat(EXP_DOMAIN));
    real shifted = nmadd(clamped, splat(log2e), splat(EXP_MAGIC)), n = shifted - EXP_MAGIC;
    real r = nmadd(n, splat(ln2_low), nmadd(n, splat(ln2_high), -clamped));
    real scale = (real)(((bits)shifted + EXP_BIAS) << EXP_SHIFT);
    return select(less(splat(EXP_DOMAIN), x), splat(0), TIER_POLY(EXP, r) * scale);
}

/* exp(-(x.hi + x.lo)), |x.lo| so small that its square is nothing. */
INLINE real exp_lifted(pair x)
{
    real e = exp_minus(x.hi);
    /* Where e is 0, lo may be no number. */
    return select(less(x.hi, splat(EXP_DOMAIN)), nmadd(e, x.lo, e), splat(0));
}

INLINE real exp_minus_pair(pair x)
{
    return exp_lifted(x);
}

#else

/* Exponents are counted in powers of two: what makes one multiplies by log2(e). */
#define EXPONENT_UNIT 1.44269504088896340736
/* What keeps a factor exp(-t) of a larger product normal in float. */
#define LIFT (REAL_IS_FLOAT ? 64 : 0)
/* Where 2^(LIFT - x) counts as 0: there its exponent's bits are 0, or scaled_by says so. */
#define EXPONENT_MAX R(SCALES ? 1e4 : EXP_BIAS + LIFT)
/* scaled_by is short, but slow where it underflows: a gain in the shortest loops alone. */
#define SCALES (HAS_SCALE && DRAFT)

/* 2^(LIFT - x) for x >= 0; from EXPONENT_MAX on 0. */
INLINE real exp_lifted(pair x)
{
    real most = real_min(x.hi, splat(EXPONENT_MAX));
#if SCALES
    real n = nearest(most);
    return scaled_by(TIER_POLY(EXP2, n - most), R(LIFT) - n);
#else
    real shifted = R(EXP_MAGIC) - most, n = shifted - R(EXP_MAGIC),
         power = TIER_POLY(EXP2, -most - n);
    return power * (real)(((bits)shifted + (EXP_BIAS + LIFT)) << EXP_SHIFT);
#endif
}

INLINE real exp_minus_pair(pair x)
{
    return exp_lifted(x) * R(REAL_IS_FLOAT ? 0x1p-64 : 1);
}

INLINE real exp_minus(real x)
{
    return exp_minus_pair((pair){x * R(EXPONENT_UNIT), splat(0)});
}

#endif

struct sin_cos {
    real sin, cos;
};

/* sin and cos of 2 pi u, u in [0, 1]. */
INLINE struct sin_cos sin_cos_turns(real u)
{
    real quarter = (u * 4 + R(EXP_MAGIC)) - R(EXP_MAGIC);
    real f = madd(splat(R(-0.25)), quarter, u), f2 = f * f;
    real s = f * TIER_POLY(SINPI, f2), c = TIER_POLY(COSPI, f2);
    /* Quarter 2 is quarter 0 negated, and so on; 4 is 0 again. */
    real half = quarter - 2, side = real_abs(real_abs(half) - 1); /* side 0: odd quarters */
    mask odd = less(side, splat(R(0.5)));
    real sine = select(odd, c, s), cosine = select(odd, s, c);
    mask past = less(real_abs(quarter - R(2.5)), splat(1)),
         left = less(real_abs(half + R(0.5)), splat(1));
    return (struct sin_cos){select(past, -sine, sine), select(left, -cosine, cosine)};
}

/*
 * -log(1 - u) by rest = 1 - u = 2^e m, m in [3/4, 3/2): 2 atanh(f / (2 + f)) by its
 * series, f = m - 1, which is -u itself where e = 0: small u keep all their digits.
 */
INLINE real minus_log(real u, real rest)
{
    enum { TERMS = REAL_IS_FLOAT ? 5 : 12 }; /* (f / (2 + f))^2 <= 1/25 */
    const bits start = (bits)splat(R(0.75));
    bits e = ((bits)rest - start) >> EXP_SHIFT;
    real m = (real)((bits)rest - (e << EXP_SHIFT)), power = __builtin_convertvector(e, real);
    real f = select(less(real_abs(power), splat(R(0.5))), -u, m - 1), s = f / (2 + f), s2 = s * s;
    real sum = splat(R(1.0 / (2 * TERMS + 1)));
    for (int k = TERMS - 1; k >= 0; k--) sum = madd(sum, s2, splat(R(1.0 / (2 * k + 1))));
    return -madd(power, splat(R(0.693147180559945309417)), 2 * s * sum);
}

/* psi(v) = (1/sqrt(pi) - v erfcx(v))/2, v >= 0, over w = K / (K + v), K = ERFC_SCALE: 1 at v = 0, 0 at infinity. */
INLINE real psi_x(real w)
{
    return w * w * TIER_POLY(PSI, 2 * w - 1);
}

/* erfcx(v) = exp(v^2) erfc(v), v >= 0. */
INLINE real erfcx_tail(real w)
{
    return w * TIER_POLY(ERFCX, 2 * w - 1);
}

#if !COMPENSATED
/* e(v) = (exp(-v^2)/sqrt(pi) - v erfc v)/2, v >= 0, right to max(v, e) and not to e itself. */
INLINE real excess_front(real v)
{
    return TIER_POLY(EXCESS, real_min(v, splat(R(TIER_COEFFICIENTS(EXCESS_END)))));
}
#endif

#if REAL_IS_FLOAT
/* 1 / psi(v), 0 <= v <= INVERSE_PSI_END. */
INLINE real inverse_psi(real v)
{
    return TIER_POLY(INVERSE_PSI, v);
}
#endif

#endif
