/* The projected area from its definition, by double exponential quadrature (Takahasi & Mori 1974). */
#include "reference.h"

#include <quadmath.h>

enum { NODES_PER_UNIT = 20 };

struct integrand {
    const facet_material *m;
    const double *k;
    quad cosine, sine; /* of the azimuth in the standard slope plane */
};

/* max(<k, h>, 0) D(h) dw_h / dr at standard slope r (cosine, sine): dw_h = cos^3 theta_h dslopes. */
static quad radial_density(const struct integrand *f, quad r)
{
    const facet_roughness *m = &f->m->roughness;
    struct reference_roughness a = reference_roughness(m);
    quad sx = a.alpha_x * r * f->cosine + m->slope_x;
    quad sy = a.alpha_y * r * (a.rho * f->cosine + a.kappa * f->sine) + m->slope_y;
    quad length = sqrtq(1 + sx * sx + sy * sy);
    quad h[3] = {-sx / length, -sy / length, 1 / length};
    quad kh = f->k[0] * h[0] + f->k[1] * h[1] + f->k[2] * h[2];
    if (kh <= 0) return 0;
    return kh * reference_ndf(f->m, h) * h[2] * h[2] * h[2] * a.alpha_x * a.alpha_y * a.kappa * r;
}

/*
 * r from low to high, high < 0 for infinity, by tanh-sinh.  Beckmann: in r itself, which ends where
 * exp(-r^2) is nothing.  GGX: in u = r / (1 + r), with 1 - u kept exact at the far end.
 */
static quad along_radius(const struct integrand *f, quad low, quad high)
{
    const quad nothing = 12; /* exp(-144) ~ 1e-63 */
    bool straight = f->m->ndf == FACET_BECKMANN;
    if (straight && (high < 0 || high > nothing)) high = nothing > low ? nothing : low;
    quad from = straight ? low : low / (1 + low);
    quad rest = straight ? 1 : high < 0 ? 0 : 1 / (1 + high); /* 1 - u at the far end */
    quad width = straight ? high - low : high < 0 ? 1 / (1 + low) : (high - low) * rest / (1 + low);
    quad sum = 0;
    for (int i = -4 * NODES_PER_UNIT; i <= 4 * NODES_PER_UNIT; i++) {
        quad t = (quad)i / NODES_PER_UNIT, s = M_PI_2q * sinhq(t);
        if (fabsq(s) > 25) continue;
        quad e = expq(-2 * fabsq(s)), edge = width * e / (1 + e), other = width / (1 + e);
        quad u = from + (s < 0 ? edge : other);
        quad left = straight ? 1 : rest + (s < 0 ? other : edge); /* 1 - u */
        quad du = M_PIq * coshq(t) * width * e / ((1 + e) * (1 + e));
        sum += radial_density(f, u / left) * du / (left * left);
    }
    return sum / NODES_PER_UNIT;
}

/* Half of the azimuths: toward k (sign 1), where slopes hide, or away from it (sign -1). */
static quad half_turn(const facet_material *m, const double k[3], struct reference_view v, int sign)
{
    if (v.c <= 0 && sign > 0) return 0;
    quad x = v.s > 0 ? v.a / v.s : 1, y = v.s > 0 ? v.b / v.s : 0, sum = 0;
    for (int i = -4 * NODES_PER_UNIT; i <= 4 * NODES_PER_UNIT; i++) {
        quad t = (quad)i / NODES_PER_UNIT, s = M_PI_2q * sinhq(t);
        if (fabsq(s) > 25) continue;
        quad e = expq(-2 * fabsq(s)), edge = M_PIq * e / (1 + e); /* angle to the nearer end */
        quad toward = sign * sinq(edge), aside = (s < 0 ? -1 : 1) * cosq(edge);
        struct integrand f = {m, k, toward * x - aside * y, toward * y + aside * x};
        quad kink = v.s > 0 ? v.c / (v.s * toward) : -1, part; /* c = r s cos(phi) */
        if (kink <= 0)
            part = along_radius(&f, 0, -1);
        else
            part = sign > 0 ? along_radius(&f, 0, kink) : along_radius(&f, kink, -1);
        sum += part * M_PIq * coshq(t) * M_PIq * e / ((1 + e) * (1 + e));
    }
    return sum / NODES_PER_UNIT;
}

quad reference_sigma_integral(const facet_material *m, const double k[3])
{
    const quad exact[3] = {k[0], k[1], k[2]};
    struct reference_view v = reference_project(&m->roughness, exact);
    return half_turn(m, k, v, 1) + half_turn(m, k, v, -1);
}
