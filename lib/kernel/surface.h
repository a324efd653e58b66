/*
 * surface.h - the affine map from standard slopes to the surface's, for every ndf.
 *
 * Dupuy 2015 eqs. 2.26, 2.35, 3.2 and 3.3 (lib/NOTATION.md), arranged so that
 * no slope is formed, nothing is divided by h_z and nothing cancels that is not
 * formed in `wide`.
 */
#ifndef FACET_SURFACE_H
#define FACET_SURFACE_H

#include "kernels.h"
#include "real.h"

/* |H| below 1/SCALE_MAX only comes of components that small; its square must stay finite. */
#define SCALE_MAX 0x1p500

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
    real x, y, z;    /* root_det (X, Y, H_z): minus standard slopes times H_z, and H_z */
    real hz;         /* H_z */
    real hh;         /* |H|^2 */
    real length;     /* |H|, of the H as it is */
    real to_wo;      /* wo . H */
    real scale;      /* the power of two that brought H to size 1 */
};

INLINE struct direction direction_of(const struct kernel_surface *s, enum kernel_shape shape,
                                     struct vec3 d)
{
    double x = d.x, y = d.y, z = d.z;
    struct direction k = { .z = (real)z };
    if (shape == KERNEL_ISO) {
        k.c = k.z;
        k.a = (real)(s->alpha_x * x);
        k.b = (real)(s->alpha_x * y);
    } else {
        wide a = wide_add(wide_product(x, s->alpha_x, 0),
                          wide_product(y, s->rho_alpha_y, s->rho_alpha_y_low));
        k.a = (real)wide_round(a);
        k.b = (real)(s->kappa_alpha_y * y);
        k.c = k.z;
    }
    if (shape == KERNEL_SHEARED) {
        /* fr cos theta_i vanishes with c_i: its relative error is c's, so c is a pair in every tier. */
        pair lean = pair_add(pair_product(-s->slope_x, x, 0), pair_product(-s->slope_y, y, 0));
        k.c = (real)pair_round(pair_add((pair){ z, 0 }, lean));
    }
    k.s2 = k.a * k.a + k.b * k.b;
    return k;
}

/*
 * 2^-e, e the exponent of the largest component of H: brings H to size 1, so that
 * no square of it leaves the range of a real.  Not for floats: eval.c keeps
 * short H away from them, and the scaling costs as much as the rest.
 */
INLINE double scale_of(double x, double y, double z)
{
    double ax = __builtin_fabs(x), ay = __builtin_fabs(y), az = __builtin_fabs(z);
    double largest = ax > ay ? ax : ay, e = inverse_exponent(largest > az ? largest : az);
    return REAL_IS_FLOAT ? 1 : e < SCALE_MAX ? e : SCALE_MAX;
}

INLINE struct half half_of(const struct kernel_surface *s, enum kernel_shape shape,
                           struct vec3 i, struct vec3 o)
{
    double x = i.x + o.x, y = i.y + o.y, z = i.z + o.z;
    struct half h;
    double e = scale_of(x, y, z);
    h.scale = (real)e;
    real hx = (real)(x * e), hy = (real)(y * e);
    h.hz = (real)(z * e);
    h.hh = madd(hx, hx, madd(hy, hy, h.hz * h.hz));
    h.length = real_sqrt(h.hh) * (real)(1 / e);
    pair to_wo = pair_add(pair_product(o.x, x, 0), pair_add(pair_product(o.y, y, 0), pair_product(o.z, z, 0)));
    h.to_wo = (real)(e * pair_round(to_wo));
    h.z = (real)s->root_det * h.hz;
    if (shape == KERNEL_ISO) {
        h.x = hx;
        h.y = hy;
        return h;
    }
    wide mean_x = wide_sum(i.x, o.x), mean_y = wide_sum(i.y, o.y);
    if (shape == KERNEL_SHEARED) {
        wide up = wide_sum(i.z, o.z);
        mean_x = wide_add(mean_x, wide_scale(up, s->slope_x, 0));
        mean_y = wide_add(mean_y, wide_scale(up, s->slope_y, 0));
    }
    double inverse = 1 / s->root_det; /* e goes first: e / root_det overflows where H is subnormal */
    wide cross = wide_add(wide_scale(mean_y, s->alpha_x, 0),
                          wide_scale(mean_x, -s->rho_alpha_y, -s->rho_alpha_y_low));
    h.x = (real)(wide_round(mean_x) * e * (s->kappa_alpha_y * inverse));
    h.y = (real)(wide_round(cross) * e * inverse);
    return h;
}

#endif
