/*
 * ndf_ggx.h - GGX (Trowbridge-Reitz; Walter 2007), standard slope density
 * P = 1 / (pi (1 + r^2)^2).
 *
 * Every ndf offers to masking.h: density, D pi det at a half vector that points up,
 * and excess, sigma(k) - max(c, 0).  GGX and Beckmann also smith and smith_front, fr's
 * masking without sigmas.  Beckmann also front_excess, where c >= 0 is known, and
 * density and excess divided by exp(-v_o^2), as both underflow seen from behind.
 */
#ifndef FACET_NDF_GGX_H
#define FACET_NDF_GGX_H

#include "surface.h"

/* A sum of squares over a sum of squares, squared. */
INLINE struct fraction ggx_density(enum kernel_shape shape, struct half h)
{
    real sum = standard_square(shape, h);
    return (struct fraction){h.hh * h.hh, sum * sum};
}

INLINE real ggx_length(struct direction k)
{
    return root(madd(k.c, k.c, k.s2));
}

/* (r - |c|)/2 without the difference, r = sqrt(s^2 + c^2) (Eto & Tokuyoshi 2023, sec. 3). */
INLINE real ggx_excess(struct direction k)
{
    return quotient(k.s2, real_max(2 * (ggx_length(k) + real_abs(k.c)), splat(REAL_MIN)));
}

INLINE real ggx_sigma(struct direction k)
{
    real r = ggx_length(k), below = quotient(k.s2, real_max(2 * (r - k.c), splat(REAL_MIN)));
    return select(less(splat(0), k.c), R(0.5) * (k.c + r), below);
}

/* c_i over 2 (sigma_o c_i + (sigma_i - c_i) max(c_o, 0)), for c_i > 0; where c_o < 0, c_i and a quotient cancel. */
INLINE struct fraction ggx_smith(struct direction i, struct direction o)
{
    real ro = ggx_length(o), front = madd(o.c, ggx_length(i), i.c * ro);
    mask behind = less(o.c, splat(0));
    return (struct fraction){select(behind, ro - o.c, i.c), select(behind, o.s2, front)};
}

/* The denominator where c > 0 is known of both. */
INLINE real ggx_smith_front(struct direction i, struct direction o)
{
    return madd(o.c, ggx_length(i), i.c * ggx_length(o));
}

#endif
