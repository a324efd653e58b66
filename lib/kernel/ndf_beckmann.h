/*
 * ndf_beckmann.h - Beckmann, standard slope density P = exp(-r^2) / pi.
 *
 * With v = c / s the projected area is sigma = max(c, 0) + s e(|v|),
 * e(v) = (exp(-v^2)/sqrt(pi) - v erfc v)/2 (Heitz 2014, rearranged), which is
 * exp(-v^2) psi(v), psi(v) = (1/sqrt(pi) - v erfcx v)/2.
 */
#ifndef FACET_NDF_BECKMANN_H
#define FACET_NDF_BECKMANN_H

#include "surface.h"
#include "vmath.h"

/* Of v_o^2 behind the mean facet: its rounding is the exponent's absolute error. */
#define BEHIND_MAX (REAL_IS_FLOAT ? R(24) : R(1e3))

INLINE real beckmann_tail(struct direction k, real s)
{
    return quotient(ERFC_SCALE * s, real_max(ERFC_SCALE * s + real_abs(k.c), splat(REAL_MIN)));
}

/* v^2: an exponent, and for c < 0 what decides sigma. */
INLINE pair beckmann_v2(struct direction k)
{
#if COMPENSATED
    pair c2 = pair_product(k.c, k.c, 2 * k.c_low);
    return pair_quotient(c2, (pair){ real_max(k.s2, splat(REAL_MIN)), k.s2_low });
#else
    return (pair){ R(EXPONENT_UNIT) * (k.c * k.c) * recip_fine(real_max(k.s2, splat(REAL_MIN))), splat(0) };
#endif
}

INLINE real beckmann_excess(struct direction k)
{
    real s = root_from_zero(k.s2);
    return s * psi_x(beckmann_tail(k, s)) * exp_minus_pair(beckmann_v2(k));
}

/* c >= 0: it is added to c, so that e may be right to the size of max(v, e) alone. */
INLINE real beckmann_front_excess(struct direction k)
{
#if COMPENSATED
    real s = root_from_zero(k.s2);
    return s * psi_x(beckmann_tail(k, s)) * exp_minus(k.c * k.c / real_max(k.s2, splat(REAL_MIN)));
#else
    real inverse = rsqrt(real_max(k.s2, splat(REAL_MIN)));
    return k.s2 * inverse * excess_front(k.c * inverse);
#endif
}

/* exp(v^2) times the excess where c < 0. */
INLINE real beckmann_excess_scaled(struct direction k)
{
    mask behind = less(k.c, splat(0));
    real front = beckmann_front_excess(k);
    if (!any(behind)) return front;
    real s = root_from_zero(k.s2);
    return select(behind, s * psi_x(beckmann_tail(k, s)), front);
}

/* x^2 + y^2 over z^2, in EXPONENT_UNIT; inverse: 1/H_z. */
INLINE pair beckmann_exponent(const struct kernel_surface *s, enum kernel_shape shape, struct half h, real inverse)
{
#if COMPENSATED
    (void)inverse;
    pair flat = pair_add(pair_multiply(h.wide_x, h.wide_x), pair_multiply(h.wide_y, h.wide_y));
    pair z = shape == KERNEL_ISO ? pair_multiply(h.wide_z, (pair){ splat(s->alpha_x), splat(0) }) : h.wide_z;
    return pair_quotient(flat, pair_multiply(z, z));
#else
    if (shape == KERNEL_ISO) return (pair){ h.flat * (inverse * inverse) * R(EXPONENT_UNIT * s->inverse_alpha2), splat(0) };
    return (pair){ madd(h.x, h.x, h.y * h.y) * (inverse * inverse) * R(EXPONENT_UNIT * s->inverse_weight2), splat(0) };
#endif
}

/* exp(-exponent) sec^4 / (pi det). */
INLINE real beckmann_value(const struct kernel_surface *s, struct half h, real inverse, pair exponent)
{
    real sec2 = h.hh * (inverse * inverse);
    real value = exp_lifted(exponent) * sec2 * (sec2 * R(s->peak * (LIFT ? 0x1p-64 : 1)));
#if COMPENSATED
    value = select(less(exponent.hi, splat(EXP_DOMAIN)), value, splat(0));
#elif !HAS_SCALE
    value = select(less(exponent.hi, splat(EXPONENT_MAX)), value, splat(0));
#endif
    return value;
}

INLINE real beckmann_density(const struct kernel_surface *s, enum kernel_shape shape, struct half h)
{
    real inverse = recip_fine(h.hz);
    return beckmann_value(s, h, inverse, beckmann_exponent(s, shape, h, inverse));
}

/*
 * exp(v_o^2) D where c_o < 0.  The exponent is a difference: in precise of pairs,
 * in the other tiers where v_o^2 is no larger than BEHIND_MAX, which the kernel
 * calls a stray.
 */
INLINE real beckmann_density_scaled(const struct kernel_surface *s, struct half h, struct direction o)
{
    real inverse = recip_fine(h.hz);
    pair t = beckmann_exponent(s, KERNEL_SHEARED, h, inverse), v2 = beckmann_v2(o);
    mask behind = less(o.c, splat(0));
    if (!any(behind)) return beckmann_value(s, h, inverse, t);
#if COMPENSATED
    pair rest = pair_add(t, (pair){ -v2.hi, -v2.lo });
#else
    pair rest = { t.hi - v2.hi, splat(0) };
#endif
    /* The difference is never negative but by its rounding. */
    mask some = less(splat(0), rest.hi);
    rest = (pair){ select(some, rest.hi, splat(0)), select(some, rest.lo, splat(0)) };
    return beckmann_value(s, h, inverse, (pair){ select(behind, rest.hi, t.hi), select(behind, rest.lo, t.lo) });
}

INLINE real beckmann_sigma(struct direction k)
{
    return real_max(k.c, splat(0)) + beckmann_excess(k);
}

#endif
