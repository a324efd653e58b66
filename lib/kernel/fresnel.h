/*
 * fresnel.h - Fresnel terms over c = cos theta_d = |H|/2.
 */
#ifndef FACET_FRESNEL_H
#define FACET_FRESNEL_H

#include "surface.h"

/*
 * c^2, as a pair in precise: 1 - c cancels near the mirror direction, and c^2
 * from 1 - eta^2 at the critical angle.
 */
INLINE pair angle_squared(const struct given *g, struct half h)
{
#if COMPENSATED
    (void)h;
    pair x = pair_sum(g->wi.x, g->wo.x), y = pair_sum(g->wi.y, g->wo.y), z = pair_sum(g->wi.z, g->wo.z);
    pair hh = pair_add(pair_add(pair_multiply(x, x), pair_multiply(y, y)), pair_multiply(z, z));
    return pair_normalise((pair){ R(0.25) * hh.hi, R(0.25) * hh.lo });
#else
    (void)g;
    return (pair){ R(0.25) * h.hh, splat(0) };
#endif
}

/* 1 - c. */
INLINE real angle_versine(struct half h, pair c2)
{
#if COMPENSATED
    (void)h;
    return quotient((1 - c2.hi) - c2.lo, 1 + real_sqrt(c2.hi));
#else
    (void)c2;
    return nmadd(root_fine(h.hh), splat(R(0.5)), splat(1));
#endif
}

INLINE real fresnel_schlick(const struct kernel_fresnel *f, real versine5)
{
    return madd(versine5, splat(R(1 - f->f0)), splat(R(f->f0))); /* Schlick 1994 */
}

/* f->excess + c^2. */
INLINE real fresnel_root(const struct kernel_fresnel *f, pair c2)
{
#if COMPENSATED
    return pair_round(pair_add((pair){ splat(f->excess), splat(f->excess_low) }, c2));
#else
    return R(f->excess) + c2.hi;
#endif
}

/*
 * Unpolarised, real eta; 1 at total reflection.  With g^2 = eta^2 - 1 + c^2,
 * F = s^2 (1 + p^2)/2, s = (g - c)/(g + c) = (eta^2 - 1)/(g + c)^2,
 * p = (c g - sin^2)/(c g + sin^2): one root, of c^2 g^2, and one quotient.
 */
INLINE real fresnel_dielectric(const struct kernel_fresnel *f, pair c2)
{
    bool may_be_total = f->excess < 0;
    real g2 = fresnel_root(f, c2), sine2 = (1 - c2.hi) - c2.lo;
    mask partial = less(splat(0), g2);
    real cg = may_be_total ? root_from_zero(c2.hi * real_max(g2, splat(0))) : root_from_zero(c2.hi * g2);
    real sum2 = madd(splat(2), cg, g2 + c2.hi), low = cg - sine2, high = cg + sine2, scale = sum2 * high;
    real value = quotient(R(0.5 * f->excess * f->excess) * madd(low, low, high * high), scale * scale);
    value = real_min(value, splat(1));
    return may_be_total ? select(partial, value, splat(1)) : value;
}

/*
 * Unpolarised, eta + i k: a^2 - b^2 = t = eta^2 - k^2 - 1 + c^2 and a b = eta k,
 * the larger of a and b by a root of like signs; a - c as (t + b^2 - c^2)/(a + c)
 * where b^2 is not what cancels.
 */
INLINE real fresnel_conductor(const struct kernel_fresnel *f, pair c2)
{
    real t = fresnel_root(f, c2);
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
    return real_min(R(0.5) * s * (1 + p), splat(1));
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
INLINE real fresnel_table(const struct kernel_fresnel *f, pair c2)
{
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
    return c;
}

#endif
