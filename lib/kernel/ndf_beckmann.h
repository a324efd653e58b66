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

/* The largest |v_o| behind the mean facet: the rounding of its square is the exponent's absolute error. */
#define BEHIND_MAX (REAL_IS_FLOAT ? R(INVERSE_PSI_END) : R(31))

INLINE struct cotangent beckmann_cotangent(struct direction k)
{
    return cotangent_of(k.c, real_max(k.s2, splat(REAL_MIN)));
}

INLINE real beckmann_tail(struct direction k, real s)
{
    return quotient(ERFC_SCALE * s, real_max(ERFC_SCALE * s + real_abs(k.c), splat(REAL_MIN)));
}

/* v^2: an exponent, and for c < 0 what decides sigma. */
INLINE pair beckmann_v2(struct direction k)
{
#if COMPENSATED
    pair c2 = pair_product(k.c, k.c, 2 * k.c_low);
    return pair_quotient(c2, (pair){real_max(k.s2, splat(REAL_MIN)), k.s2_low});
#else
    return (pair){R(EXPONENT_UNIT) * quotient_fine(k.c * k.c, real_max(k.s2, splat(REAL_MIN))),
                  splat(0)};
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
    struct cotangent t = beckmann_cotangent(k);
    return t.s * excess_front(t.v);
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

/*
 * c_i over sigma_o c_i + (sigma_i - c_i) max(c_o, 0), for c_i > 0, or exp(-v_o^2)
 * times it where c_o < 0: there c_i cancels, and what psi divides is multiplied by 1/psi.
 */
INLINE struct fraction beckmann_smith(struct direction i, struct direction o)
{
    mask behind = less(o.c, splat(0));
    real to_i = i.c + beckmann_front_excess(i), up = real_max(o.c, splat(0));
#if REAL_IS_FLOAT
    struct cotangent t = beckmann_cotangent(o);
    real front = madd(up, to_i, i.c * (t.s * excess_front(t.v)));
    return (struct fraction){select(behind, inverse_psi(-t.v), i.c), select(behind, t.s, front)};
#else
    real to = beckmann_excess_scaled(o);
    return (struct fraction){select(behind, splat(1), i.c),
                             select(behind, to, madd(up, to_i, i.c * to))};
#endif
}

/* The denominator where c > 0 is known of both. */
INLINE real beckmann_smith_front(struct direction i, struct direction o)
{
    return madd(o.c, i.c + beckmann_front_excess(i), beckmann_front_excess(o) * i.c);
}

/* x^2 + y^2 over z^2, in EXPONENT_UNIT; inverse2: 1/H_z^2. */
INLINE pair beckmann_exponent(const struct kernel_surface *s, enum kernel_shape shape,
                              struct half h, real inverse2)
{
#if COMPENSATED
    (void)inverse2;
    pair flat = pair_add(pair_multiply(h.wide_x, h.wide_x), pair_multiply(h.wide_y, h.wide_y));
    pair z = shape == KERNEL_ISO ? pair_multiply(h.wide_z, (pair){splat(s->alpha_x), splat(0)})
                                 : h.wide_z;
    return pair_quotient(flat, pair_multiply(z, z));
#else
    if (shape == KERNEL_ISO)
        return (pair){h.flat * R(EXPONENT_UNIT * s->inverse_alpha2) * inverse2, splat(0)};
    return (pair){madd(h.x, h.x, h.y * h.y) * R(EXPONENT_UNIT) * inverse2, splat(0)};
#endif
}

/* exp(LIFT ln 2 - exponent) sec^4. */
INLINE real beckmann_value(struct half h, real inverse2, pair exponent)
{
    real sec2 = h.hh * inverse2;
    real value = exp_lifted(exponent) * sec2 * sec2;
#if COMPENSATED
    value = select(less(exponent.hi, splat(EXP_DOMAIN)), value, splat(0));
#endif
    return value;
}

INLINE real beckmann_density(const struct kernel_surface *s, enum kernel_shape shape, struct half h)
{
    real inverse2 = recip_fine(h.hz * h.hz);
    return beckmann_value(h, inverse2, beckmann_exponent(s, shape, h, inverse2));
}

/*
 * How far exp(v_o^2) D's exponent may be below 0, in EXPONENT_UNIT: where h turns its back on wo, as that of
 * nearly opposite directions does whose lengths are 1 to a float's rounding alone.  In float |H| is then
 * too short; in exact32 what is beyond is a stray.
 */
#define BEYOND_MAX (COMPENSATED ? 700.0 : REAL_IS_FLOAT ? 0.0 : 900.0)

/*
 * exp(v_o^2) D where c_o < 0.  The exponent is a difference: in precise of pairs,
 * in the other tiers where |v_o| is no larger than BEHIND_MAX, which the kernel
 * calls a stray.
 */
INLINE real beckmann_density_scaled(const struct kernel_surface *s, struct half h,
                                    struct direction o)
{
    real inverse2 = recip_fine(h.hz * h.hz);
    pair t = beckmann_exponent(s, KERNEL_SHEARED, h, inverse2), v2 = beckmann_v2(o);
    mask behind = less(o.c, splat(0));
#if COMPENSATED
    if (!any(behind)) return beckmann_value(h, inverse2, t);
    pair rest = pair_add(t, (pair){-v2.hi, -v2.lo});
    mask some = less(splat(-BEYOND_MAX), rest.hi);
    rest = (pair){select(some, rest.hi, splat(-BEYOND_MAX)), select(some, rest.lo, splat(0))};
    return beckmann_value(h, inverse2,
                          (pair){select(behind, rest.hi, t.hi), select(behind, rest.lo, t.lo)});
#else
    t.hi = select(behind, real_max(t.hi - v2.hi, splat(R(-BEYOND_MAX))), t.hi);
    return beckmann_value(h, inverse2, t);
#endif
}

#endif
