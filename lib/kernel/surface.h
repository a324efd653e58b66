/*
 * surface.h - the affine map from standard slopes to the surface's, for every ndf.
 *
 * FORMULAS: Dupuy 2015 eqs. 2.26, 2.35, 3.2, 3.3 and section 2, arranged so that
 * no slope is formed, nothing is divided by h_z and nothing cancels that is not
 * formed in `wide`.
 */
#ifndef FACET_SURFACE_H
#define FACET_SURFACE_H

#include "kernels.h"
#include "real.h"

/* |H| below 1/SCALE_MAX only comes of components that small; a real must hold the scale. */
#define SCALE_MAX (REAL_IS_FLOAT ? 0x1p120 : 0x1p1000)

/* What a float would round to 0 stays above the horizon: fr there is not small. */
INLINE real cosine(double z)
{
    real r = (real)z;
    return z > 0 ? real_max(r, (real)REAL_MIN) : r;
}

/* By value: an array in a loop body would keep GCC from vectorising it. */
struct vec3 {
    double x, y, z;
};

/* One direction k against the surface. */
struct direction {
    real z;          /* macro cosine */
    real c;          /* k_z - k_x slope_x - k_y slope_y: the cosine with the mean facet */
    real a, b, s2;   /* stretched tangential part and its squared length */
};

/* The half vector, up to a power of two, in standard slopes times root_det. */
struct half {
    bool up;         /* H_z > 0 */
    real x, y, z;    /* root_det (X, Y, H_z): minus standard slopes times H_z, and H_z */
    real hz;         /* H_z */
    real hh;         /* |H|^2 */
    real to_wo;      /* wo . H */
    real scale;      /* the power of two that brought H to size 1 */
};

INLINE struct direction direction_of(const struct kernel_surface *s, enum kernel_shape shape,
                                     struct vec3 d)
{
    double x = d.x, y = d.y, z = d.z;
    struct direction k = { .z = cosine(z) };
    if (shape == KERNEL_ISO) {
        k.c = k.z;
        k.a = (real)(s->alpha_x * x);
        k.b = (real)(s->alpha_x * y);
    } else {
        wide a = wide_add(wide_product(s->alpha_x, x), wide_product2(y, s->rho_alpha_y, s->rho_alpha_y_low));
        k.a = (real)wide_round(a);
        k.b = (real)(s->kappa_alpha_y * y);
        k.c = k.z;
    }
    if (shape == KERNEL_SHEARED) {
        wide lean = wide_add(wide_product(-s->slope_x, x), wide_product(-s->slope_y, y));
        wide c = wide_add(wide_sum(z, lean.hi), (wide){ 0 });
#if !REAL_IS_FLOAT
        c.lo += lean.lo;
#endif
        k.c = (real)wide_round(c);
    }
    k.s2 = k.a * k.a + k.b * k.b;
    return k;
}

INLINE double max_abs(double a, double b)
{
    a = a < 0 ? -a : a;
    b = b < 0 ? -b : b;
    return a > b ? a : b;
}

INLINE struct half half_of(const struct kernel_surface *s, enum kernel_shape shape,
                           struct vec3 i, struct vec3 o)
{
    double x = i.x + o.x, y = i.y + o.y, z = i.z + o.z;
    struct half h = { .up = z > 0 };
    double e = inverse_exponent(max_abs(max_abs(x, y), z));
    h.scale = (real)(e < SCALE_MAX ? e : SCALE_MAX);
    real hx = (real)(x * e), hy = (real)(y * e);
    h.hz = (real)(z * e);
    h.hh = madd(hx, hx, madd(hy, hy, h.hz * h.hz));
    /* wo.H = (|H|^2 + (wo - wi).H)/2: the second term vanishes for unit vectors and must not cancel. */
    h.to_wo = (real)(0.5 * e * (x * x + y * y + z * z +
                         ((o.x - i.x) * x + (o.y - i.y) * y + (o.z - i.z) * z)));
    h.z = (real)s->root_det * h.hz;
    if (shape == KERNEL_ISO) {
        h.x = hx;
        h.y = hy;
        return h;
    }
    wide mean_x = wide_sum(i.x, o.x), mean_y = wide_sum(i.y, o.y);
    if (shape == KERNEL_SHEARED) {
        wide up = wide_sum(i.z, o.z);
        mean_x = wide_add(mean_x, wide_scale(up, s->slope_x));
        mean_y = wide_add(mean_y, wide_scale(up, s->slope_y));
    }
    double inverse = e / s->root_det;
    wide cross = wide_add(wide_scale(mean_y, s->alpha_x),
                          wide_scale2(mean_x, -s->rho_alpha_y, -s->rho_alpha_y_low));
    h.x = (real)(wide_round(mean_x) * s->kappa_alpha_y * inverse);
    h.y = (real)(wide_round(cross) * inverse);
    return h;
}

#endif
