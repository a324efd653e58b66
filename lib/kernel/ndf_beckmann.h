/*
 * ndf_beckmann.h - Beckmann, standard slope density P = exp(-r^2) / pi.
 *
 * With v = c / s the projected area is sigma = max(c, 0) + s psi(|v|),
 * psi(v) = exp(-v^2) (1/sqrt(pi) - v erfcx v)/2 (Heitz 2014, rearranged).
 */
#ifndef FACET_NDF_BECKMANN_H
#define FACET_NDF_BECKMANN_H

#include "surface.h"
#include "vmath.h"

INLINE real beckmann_tail(struct direction k)
{
    real s = real_sqrt(k.s2), c = real_abs(k.c);
    return ERFC_SCALE * s / real_max(ERFC_SCALE * s + c, (real)REAL_MIN);
}

INLINE real beckmann_v2(struct direction k)
{
    return k.c * k.c / real_max(k.s2, (real)REAL_MIN);
}

INLINE real beckmann_excess(struct direction k)
{
    return real_sqrt(k.s2) * psi_x(beckmann_tail(k)) * exp_minus(beckmann_v2(k));
}

/* exp(v^2) times the excess where c < 0. */
INLINE real beckmann_excess_scaled(struct direction k)
{
    real e = exp_minus(beckmann_v2(k));
    return real_sqrt(k.s2) * psi_x(beckmann_tail(k)) * (k.c < 0 ? 1 : e);
}

/* exp(-exponent) sec^4 / (pi det), as a square so that a float keeps all of it down to 1e-38. */
INLINE real beckmann_value(const struct kernel_surface *s, struct half h, real exponent)
{
    real root = exp_minus((real)0.5 * exponent) * (h.hh / (h.hz * h.hz)) *
                (real)(1 / (SQRT_PI * s->root_det));
    real value = exponent < 2 * (real)EXP_DOMAIN ? root * root : 0;
    return h.hz > 0 ? value : 0;
}

INLINE real beckmann_exponent(struct half h)
{
    return madd(h.x, h.x, h.y * h.y) / (h.z * h.z);
}

INLINE real beckmann_density(const struct kernel_surface *s, struct half h)
{
    return beckmann_value(s, h, beckmann_exponent(h));
}

/*
 * exp(v_o^2) D where c_o < 0.  With x the standard slope along wo and y across,
 * x^2 + y^2 - v^2 = y^2 + d (d + 2 |v|), d = v - x = wo.H / (s_o H_z) >= 0.
 */
INLINE real beckmann_density_scaled(const struct kernel_surface *s, struct half h, struct direction o)
{
    real so = real_max(real_sqrt(o.s2), (real)REAL_MIN);
    real across = (o.a * h.y - o.b * h.x) / (so * h.z);
    real d = real_max((real)h.to_wo / (so * h.hz), 0), v = real_abs(o.c) / so;
    real behind = madd(across, across, d * (d + 2 * v));
    return beckmann_value(s, h, o.c < 0 ? behind : beckmann_exponent(h));
}

INLINE real beckmann_sigma(struct direction k)
{
    return real_max(k.c, 0) + beckmann_excess(k);
}

#endif
