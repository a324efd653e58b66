/*
 * fresnel.h - Fresnel terms over c = cos theta_d (FORMULAS section 4).
 */
#ifndef FACET_FRESNEL_H
#define FACET_FRESNEL_H

#include "kernels.h"
#include "real.h"

/* Schlick 1994, of 1 - c, which is given because forming it here would cancel. */
INLINE real fresnel_schlick(const struct kernel_fresnel *f, double versine)
{
    real v = (real)(versine > 0 ? versine : 0), v2 = v * v;
    return madd((real)(1 - f->f0), v2 * v2 * v, (real)f->f0);
}

/* Unpolarised, real eta; 1 at total reflection.  g - c is formed as (eta^2 - 1)/(g + c). */
INLINE real fresnel_dielectric(const struct kernel_fresnel *f, double cosine)
{
    double excess = (f->eta - 1) * (f->eta + 1), g2 = excess + cosine * cosine;
    real c = (real)cosine, g = real_sqrt(real_max((real)g2, 0));
    real sum = g + c, difference = (real)excess / sum;
    real s = difference / sum, p = (c * sum - 1) / (c * difference + 1);
    real value = (real)0.5 * s * s * madd(p, p, 1);
    return g2 < 0 ? 1 : real_min(value, 1);
}

/* Unpolarised, eta + i k. */
INLINE real fresnel_conductor(const struct kernel_fresnel *f, double cosine)
{
    real c = (real)(cosine < 1 ? cosine : 1), c2 = c * c, s2 = (1 - c) * (1 + c);
    real eta = (real)f->eta, k = (real)f->k;
    real t = (eta - k) * (eta + k) - s2;
    real both = real_sqrt(madd(t, t, 4 * eta * eta * k * k)); /* a^2 + b^2 */
    real a = real_sqrt(real_max((real)0.5 * (both + t), 0));
    real s = (both - 2 * a * c + c2) / (both + 2 * a * c + c2);
    real s4 = s2 * s2;
    real p = (c2 * both - 2 * a * c * s2 + s4) / (c2 * both + 2 * a * c * s2 + s4);
    return real_min(real_max((real)0.5 * s * (1 + p), 0), 1);
}

/* Linear between the nodes, constant outside. */
INLINE real fresnel_table(const struct kernel_fresnel *f, double c)
{
    size_t low = 0, high = f->count - 1;
    while (high - low > 1) {
        size_t middle = (low + high) / 2;
        if (f->cos_theta_d[middle] <= c)
            low = middle;
        else
            high = middle;
    }
    double x0 = f->cos_theta_d[low], x1 = f->cos_theta_d[high];
    double t = (c - x0) / (x1 - x0);
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    return (real)((1 - t) * f->values[low] + t * f->values[high]);
}

#endif
