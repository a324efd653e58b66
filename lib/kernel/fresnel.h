/*
 * fresnel.h - Fresnel terms over c = cos theta_d = |H|/2, times a constant `scale`
 * that they take into constants of their own.
 */
#ifndef FACET_FRESNEL_H
#define FACET_FRESNEL_H

#include "surface.h"

/*
 * 4 c^2 = |H|^2, as a pair in precise: 1 - c cancels near the mirror direction, and
 * c^2 from 1 - eta^2 at the critical angle.
 */
INLINE pair angle_squared(const struct given *g, struct half h)
{
#if COMPENSATED
    (void)h;
    pair x = pair_sum(g->wi.x, g->wo.x), y = pair_sum(g->wi.y, g->wo.y),
         z = pair_sum(g->wi.z, g->wo.z);
    pair hh = pair_add(pair_add(pair_multiply(x, x), pair_multiply(y, y)), pair_multiply(z, z));
    return pair_normalise(hh);
#else
    (void)g;
    return (pair){h.hh, splat(0)};
#endif
}

/* 1 - c. */
INLINE real angle_versine(pair hh)
{
#if COMPENSATED
    return quotient((4 - hh.hi) - hh.lo, 2 * (2 + real_sqrt(hh.hi)));
#else
    return nmadd(root_fine(hh.hi), splat(R(0.5)), splat(1));
#endif
}

INLINE real fresnel_schlick(const struct kernel_fresnel *f, real versine5, lane scale)
{
    return madd(versine5, splat(R(1 - f->f0) * scale), splat(R(f->f0) * scale)); /* Schlick 1994 */
}

/* 4 (f->excess + c^2). */
INLINE real fresnel_root(const struct kernel_fresnel *f, pair hh)
{
#if COMPENSATED
    return pair_round(pair_add((pair){splat(4 * f->excess), splat(4 * f->excess_low)}, hh));
#else
    return R(4 * f->excess) + hh.hi;
#endif
}

/*
 * Unpolarised, real eta; 1 at total reflection.  With g^2 = eta^2 - 1 + c^2,
 * F = s^2 (1 + p^2)/2, s = (g - c)/(g + c) = (eta^2 - 1)/(g + c)^2,
 * p = (c g - sin^2)/(c g + sin^2): one root, of c^2 g^2, and one quotient.  All four
 * times as large, over |H|^2 = 4 c^2.
 */
INLINE real fresnel_of_root(real top, bool may_be_total, pair hh, real g2, lane scale)
{
    real sine2 = (4 - hh.hi) - hh.lo;
    mask partial = less(splat(0), g2);
    real cg = may_be_total ? root_from_zero(hh.hi * real_max(g2, splat(0)))
                           : root_from_zero(hh.hi * g2);
    real sum2 = (cg + cg) + (g2 + hh.hi), low = cg - sine2, high = cg + sine2, bottom = sum2 * high;
    real value = quotient(top * madd(low, low, high * high), bottom * bottom);
    value = real_min(value, splat(scale));
    return may_be_total ? select(partial, value, splat(scale)) : value;
}

/* Of one index: top = 8 (eta^2 - 1)^2 scale, g2 = 4 g^2. */
INLINE real fresnel_dielectric(const struct kernel_fresnel *f, pair hh, lane scale)
{
    real top = splat(R(8 * f->excess * f->excess) * scale);
    return fresnel_of_root(top, f->excess < 0, hh, fresnel_root(f, hh), scale);
}

/*
 * Unpolarised, eta + i k: a^2 - b^2 = t = eta^2 - k^2 - 1 + c^2 and a b = eta k,
 * the larger of a and b by a root of like signs; a - c as (t + b^2 - c^2)/(a + c)
 * where b^2 is not what cancels.
 */
INLINE real fresnel_conductor(const struct kernel_fresnel *f, pair hh, lane scale)
{
    pair c2 = {R(0.25) * hh.hi, R(0.25) * hh.lo};
    real t = R(0.25) * fresnel_root(f, hh);
    const lane product = R(f->eta * f->k);
    real c = root_from_zero(c2.hi), sine2 = (1 - c2.hi) - c2.lo;
    real both = root_from_zero(madd(t, t, splat(4 * product * product)));
    real larger = root_from_zero(R(0.5) * (both + real_abs(t)));
    real smaller = quotient(splat(product), real_max(larger, splat(REAL_MIN)));
    mask forward = less(splat(0), t);
    real a = select(forward, larger, smaller), b = select(forward, smaller, larger);
    real plus = a + c, bb = b * b, cancels = quotient(R(f->excess) + bb, plus);
    real minus = select(less(a, b), a - c, cancels);
    real s = quotient(madd(minus, minus, bb), madd(plus, plus, bb));
    real low = a * c - sine2, high = a * c + sine2, bc2 = bb * c2.hi;
    real p = quotient(madd(low, low, bc2), madd(high, high, bc2));
    return real_min(R(0.5) * scale * s * (1 + p), splat(scale));
}

/* Linear between the nodes, constant outside; c + c_low. */
INLINE lane fresnel_node(const struct kernel_fresnel *f, lane c, lane c_low)
{
    size_t low = 0, high = f->count - 1;
    while (high - low > 1) {
        size_t middle = (low + high) / 2;
        if (f->cos_theta_d[middle] <= (double)c)
            low = middle;
        else
            high = middle;
    }
    /* A mean of like signs: exact to rounding even next to a node of value 0. */
    double after = ((double)c - f->cos_theta_d[low]) + (double)c_low;
    double before = (f->cos_theta_d[high] - (double)c) - (double)c_low;
    if (!(after > 0)) return R(f->values[low]);
    if (!(before > 0)) return R(f->values[high]);
    return R((before * f->values[low] + after * f->values[high]) / (before + after));
}

/* Lane by lane: looking up does not vectorise. */
INLINE real fresnel_table(const struct kernel_fresnel *f, pair hh, lane scale)
{
    pair c2 = {R(0.25) * hh.hi, R(0.25) * hh.lo};
    real c = root_fine(c2.hi), rest = splat(0);
#if COMPENSATED
    real residue = ((c2.hi - c * c) - product_error(c, c, c * c)) + c2.lo;
    rest = quotient(residue, 2 * real_max(c, splat(REAL_MIN)));
#endif
    lane at[LANES], low[LANES];
    memcpy(at, &c, sizeof at);
    memcpy(low, &rest, sizeof low);
    for (size_t k = 0; k < LANES; k++) at[k] = fresnel_node(f, at[k], low[k]);
    memcpy(&c, at, sizeof c);
    return c * scale;
}

#endif
