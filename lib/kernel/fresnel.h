/*
 * fresnel.h - Fresnel terms over c = cos theta_d.
 */
#ifndef FACET_FRESNEL_H
#define FACET_FRESNEL_H

#include "kernels.h"
#include "real.h"

/*
 * Each loop is fed the angle in the form it needs (kernel.c): Schlick 1 - c, the
 * others a pair, because they subtract from it: the table c, dielectric and
 * conductor c^2, whose difference with 1 - eta^2 vanishes at the critical angle.
 */
INLINE real fresnel_schlick(const struct kernel_fresnel *f, pair versine)
{
    real v = (real)(versine.hi > 0 ? versine.hi : 0), v2 = v * v;
    return madd((real)(1 - f->f0), v2 * v2 * v, (real)f->f0); /* Schlick 1994 */
}

/* f->excess + c^2, right to its last digit. */
INLINE double fresnel_root(const struct kernel_fresnel *f, pair c2)
{
    return pair_round(pair_add((pair){ f->excess, f->excess_low }, c2));
}

/*
 * Unpolarised, real eta; 1 at total reflection.  g^2 = eta^2 - 1 + c^2, g - c as
 * (eta^2 - 1)/(g + c), and c (g +- c) -+ 1 as c g -+ (1 - c^2).
 */
INLINE real fresnel_dielectric(const struct kernel_fresnel *f, pair c2)
{
    double g2 = fresnel_root(f, c2);
    real c = real_sqrt((real)c2.hi), g = real_sqrt(real_max((real)g2, 0));
    real sine2 = (real)((1 - c2.hi) - c2.lo), sum = g + c;
    real s = (real)f->excess / (sum * sum), p = (c * g - sine2) / (c * g + sine2);
    real value = real_min((real)0.5 * s * s * madd(p, p, 1), 1);
    return g2 > 0 ? value : 1;
}

/*
 * Unpolarised, eta + i k: a^2 - b^2 = t = eta^2 - k^2 - 1 + c^2 and a b = eta k,
 * the larger of a and b by a root of like signs; a - c as (t + b^2 - c^2)/(a + c)
 * where b^2 is not what cancels.
 */
INLINE real fresnel_conductor(const struct kernel_fresnel *f, pair c2)
{
    real t = (real)fresnel_root(f, c2), product = (real)(f->eta * f->k);
    real c = real_sqrt((real)c2.hi), sine2 = (real)((1 - c2.hi) - c2.lo);
    real both = real_sqrt(madd(t, t, 4 * product * product));
    real larger = real_sqrt((real)0.5 * (both + real_abs(t)));
    real smaller = product / real_max(larger, (real)REAL_MIN);
    real a = t > 0 ? larger : smaller, b = t > 0 ? smaller : larger;
    real plus = a + c, bb = b * b, cancels = ((real)f->excess + bb) / plus;
    real minus = b > a ? a - c : cancels;
    real s = madd(minus, minus, bb) / madd(plus, plus, bb);
    real low = a * c - sine2, high = a * c + sine2, bc2 = bb * (real)c2.hi;
    real p = madd(low, low, bc2) / madd(high, high, bc2);
    return real_min((real)0.5 * s * (1 + p), 1);
}

/* Linear between the nodes, constant outside. */
INLINE real fresnel_table(const struct kernel_fresnel *f, pair cosine)
{
    double c = cosine.hi;
    size_t low = 0, high = f->count - 1;
    while (high - low > 1) {
        size_t middle = (low + high) / 2;
        if (f->cos_theta_d[middle] <= c)
            low = middle;
        else
            high = middle;
    }
    /* A mean of like signs: exact to rounding even next to a node of value 0. */
    double after = (c - f->cos_theta_d[low]) + cosine.lo, before = (f->cos_theta_d[high] - c) - cosine.lo;
    double value = (before * f->values[low] + after * f->values[high]) / (before + after);
    value = after > 0 ? value : f->values[low];
    return (real)(before > 0 ? value : f->values[high]);
}

#endif
