/*
 * ndf_ggx.h - GGX (Trowbridge-Reitz; Walter 2007), standard slope density
 * P = 1 / (pi (1 + r^2)^2).
 *
 * Every ndf offers: density, D at a half vector; excess, sigma(k) - max(c, 0);
 * and the two divided by a common factor that keeps D / sigma(wo) finite where
 * both underflow (1 here; exp(-v_o^2) for Beckmann seen from behind).
 */
#ifndef FACET_NDF_GGX_H
#define FACET_NDF_GGX_H

#include "surface.h"

/* A sum of squares over a sum of squares: D = det |H|^4 / (pi (root_det^2 (H_z^2 + X^2 + Y^2))^2). */
INLINE real ggx_density(const struct kernel_surface *s, struct half h)
{
    real sum = madd(h.x, h.x, madd(h.y, h.y, h.z * h.z));
    real q = (real)s->root_det * (h.hh / sum);
    return h.hz > 0 ? q * q * (real)ONE_OVER_PI : 0;
}

/* (r - |c|)/2 without the difference, r = sqrt(s^2 + c^2) (Eto & Tokuyoshi 2023, sec. 3). */
INLINE real ggx_excess(struct direction k)
{
    real r = real_sqrt(madd(k.c, k.c, k.s2));
    return k.s2 / real_max(2 * (r + real_abs(k.c)), (real)REAL_MIN);
}

INLINE real ggx_sigma(struct direction k)
{
    real r = real_sqrt(madd(k.c, k.c, k.s2));
    real below = k.s2 / real_max(2 * (r - k.c), (real)REAL_MIN);
    return k.c > 0 ? (real)0.5 * (k.c + r) : below;
}

/* 4 (sigma_o c_i + (sigma_i - c_i) max(c_o, 0)) for c_i > 0. */
INLINE real ggx_smith(struct direction i, struct direction o)
{
    real ri = real_sqrt(madd(i.c, i.c, i.s2)), ro = real_sqrt(madd(o.c, o.c, o.s2));
    real front = 2 * (o.c * ri + i.c * ro), back = 4 * i.c * ggx_excess(o);
    return o.c > 0 ? front : back;
}

/* The same where c > 0 is known of both. */
INLINE real ggx_smith_front(struct direction i, struct direction o)
{
    real ri = real_sqrt(madd(i.c, i.c, i.s2)), ro = real_sqrt(madd(o.c, o.c, o.s2));
    return 2 * (o.c * ri + i.c * ro);
}

#endif
