/*
 * sample.h - visible normals of the standard surface (alpha = 1), seen from the
 * stretched direction (a, b, c) (Dupuy 2015 eqs. 2.35, 3.4).
 */
#ifndef FACET_SAMPLE_H
#define FACET_SAMPLE_H

#include "masking.h"

/* A standard micronormal (not normalised) and what reflection and density need of it. */
struct normal {
    real x, y, z;
    real mm;       /* x^2 + y^2 + z^2, or 1 where density is that of slopes (z = 1) */
    real density;  /* D = density (hh / (mm root_det))^2; times exp(v^2) where c < 0 */
};

/* Keeps a direction that sees nothing from giving a normal of length 0. */
#define NORMAL_MIN (REAL_IS_FLOAT ? (real)1e-15 : (real)1e-140)

/*
 * GGX: spherical caps (Dupuy & Benyoub 2023).  m = C + k', C uniform on the cap
 * of directions above -k'_z: m_z = (1 - u2)(1 + k'_z), and the radius of C from
 * 1 - C_z = u2 (1 + k'_z), 1 + C_z = (1 - k'_z) + (1 - u2)(1 + k'_z), where
 * 1 +- k'_z, 1 - u2 and their products are never differences.
 */
INLINE struct normal ggx_sample(struct direction o, double u1, double u2)
{
    real r = real_sqrt(madd(o.c, o.c, o.s2)), inverse = 1 / real_max(r, (real)REAL_MIN);
    real large = r + real_abs(o.c), more = large * inverse;
    real less = o.s2 * inverse / real_max(large, (real)REAL_MIN);
    real up = o.c < 0 ? less : more, down = o.c < 0 ? more : less;
    real z = (real)(1 - u2) * up, radius = real_sqrt((real)u2 * up * (down + z));
    struct sin_cos turn = sin_cos_turns((real)u1);
    real x = madd(radius, turn.cos, o.a * inverse), y = madd(radius, turn.sin, o.b * inverse);
    z = real_max(z, NORMAL_MIN);
    real mm = madd(x, x, madd(y, y, z * z));
    return (struct normal){ x, y, z, mm, (real)ONE_OVER_PI };
}

/* Standard slope CDF seen from v = c / s: g = c / sigma, n = s / sigma (Heitz & d'Eon 2014, eq. 15). */
struct view {
    real v, g, n;
    real at_v, edge; /* n psi(v), n exp(-v^2)/sqrt(pi); scaled like sigma where c < 0 */
    real low, high;
};

struct cdf {
    real lower, upper, slope; /* F, 1 - F (the smaller is exact) and dF/dx */
};

/*
 * 1 - F next to x = v, where it is lost as a difference: the integral of
 * t exp(2 v t - t^2) over [0, d], term by term of Hermite's generating function.
 * For |2 v d| + d^2 < EDGE the terms left out are below 1e-14 of the sum.
 */
#define EDGE (real)0.02
INLINE real edge_integral(real v, real d)
{
    enum { TERMS = 13 };
    real previous = 0, term = 1, sum = (real)0.5; /* H_n d^n / n! */
    for (int n = 1; n < TERMS; n++) {
        real next = 2 * (v * d * term - d * d * previous) / (real)n;
        previous = term;
        term = next;
        sum += term / (real)(n + 2);
    }
    return d * d * sum;
}

/* The given F, or what is exact at d = v - x next to the edge. */
INLINE struct cdf at_edge(struct view view, real d, struct cdf away)
{
    if (real_abs(2 * view.v * d) + d * d >= EDGE) return away;
    real upper = view.edge * edge_integral(view.v, d);
    return (struct cdf){ 1 - upper, upper, away.slope };
}

INLINE struct cdf front_cdf(struct view view, real x)
{
    real e = exp_minus(x * x), w = ERFC_SCALE / (ERFC_SCALE + real_abs(x)), erfcx = erfcx_tail(w);
    real below = e * (view.g * erfcx + view.n * (real)(1 / SQRT_PI)) * (real)0.5;
    real above = e * ((view.g - view.n * x) * erfcx * (real)0.5 - view.n * psi_x(w)) + view.at_v;
    above = real_max(above, 0);
    struct cdf away = { x < 0 ? below : 1 - above, x < 0 ? 1 - below : above,
                        (view.g - view.n * x) * e * (real)(1 / SQRT_PI) };
    return at_edge(view, view.v - x, away);
}

/* Over d = v - x for v < 0, where the slope density has only its tail left: F falls from 1 to 0. */
INLINE struct cdf back_cdf(struct view view, real d)
{
    real v = real_abs(view.v), x = v + d, w = ERFC_SCALE / (ERFC_SCALE + x);
    real e = exp_minus(d * (d + 2 * v)) * view.n;
    real lower = e * madd((real)0.5 * d, erfcx_tail(w), psi_x(w));
    struct cdf away = { lower, 1 - lower, -d * e * (real)(1 / SQRT_PI) };
    return at_edge(view, d, away);
}

/*
 * x with F(x) = u by Newton's method kept inside a bracket: monotone in u, so
 * that stratified points stay stratified.
 */
INLINE real invert(struct view view, bool back, real u, real complement)
{
    enum { STEPS = 100 };
    const real tolerance = REAL_IS_FLOAT ? (real)1e-7 : (real)4e-16;
    real low = view.low, high = view.high, x = back ? (real)0.5 * (low + high) : real_min(0, high);
    for (int step = 0; step < STEPS; step++) {
        struct cdf f = back ? back_cdf(view, x) : front_cdf(view, x);
        real excess = f.lower < f.upper ? f.lower - u : complement - f.upper;
        if ((excess > 0) != back)
            high = x;
        else
            low = x;
        real next = x - excess / f.slope;
        if (!(next > low && next < high)) next = (real)0.5 * (low + high);
        real moved = real_abs(next - x);
        x = next;
        if (moved <= tolerance * real_abs(x) || high - low <= tolerance * real_abs(high)) break;
    }
    return x;
}

/* Where the Gaussian tail ends: exp(-SLOPE_END^2) is below any step of u. */
#define SLOPE_MAX (REAL_IS_FLOAT ? (real)1e12 : (real)1e140) /* its square is finite, stretched too */
#define SLOPE_END (REAL_IS_FLOAT ? (real)6.3 : (real)6.7)

INLINE struct normal beckmann_sample(struct direction o, double u1, double u2)
{
    real s = real_sqrt(o.s2), safe = real_max(s, (real)REAL_MIN);
    bool back = o.c < 0;
    real area = real_max(sigma_scaled((struct model){ FACET_BECKMANN, KERNEL_SHEARED, KERNEL_SMITH }, NULL, o), (real)REAL_MIN);
    real v = real_max(o.c / safe, -SLOPE_MAX), end = SLOPE_END;
    real n = s / area, e = exp_minus(beckmann_v2(o));
    struct view view = { v, o.c / area, n, n * psi_x(beckmann_tail(o)) * e, n * e * (real)(1 / SQRT_PI), -end, real_min(v, end) };
    if (back) {
        view.edge = n * (real)(1 / SQRT_PI);
        view.low = 0;
        view.high = end * end / (real_sqrt(madd(v, v, end * end)) - v);
    }
    real root = invert(view, back, (real)u1, (real)(1 - u1));
    real x = back ? v - root : root;
    struct view plain = { SLOPE_MAX, 1, 0, 0, 0, -end, end }; /* the Gaussian alone: seen from the pole */
    real y = invert(plain, false, (real)u2, (real)(1 - u2));
    bool pole = s < (real)REAL_MIN;
    real ca = pole ? 1 : o.a / safe, cb = pole ? 0 : o.b / safe;
    real exponent = back ? madd(y, y, root * (root + 2 * real_abs(v))) : madd(y, y, x * x);
    return (struct normal){ .x = -madd(x, ca, -y * cb), .y = -madd(x, cb, y * ca), .z = 1, .mm = 1,
                            .density = exp_minus(exponent) * (real)ONE_OVER_PI };
}

struct sampled {
    real wi_x, wi_y, wi_z, h_x, h_y, h_z, pdf;
};

/* The affine map, reflection wi = 2 (wo.h) h - wo, and pdf = D / (4 sigma_o). */
INLINE struct sampled reflect_sample(enum facet_ndf ndf, const struct kernel_surface *s,
                                     struct vec3 wo, double u1, double u2)
{
    struct direction o = direction_of(s, KERNEL_SHEARED, wo);
    struct normal m = ndf == FACET_GGX ? ggx_sample(o, u1, u2) : beckmann_sample(o, u1, u2);
    real hx = madd((real)s->alpha_x, m.x, -(real)s->slope_x * m.z);
    real hy = madd((real)s->rho_alpha_y, m.x, madd((real)s->kappa_alpha_y, m.y, -(real)s->slope_y * m.z));
    real hh = madd(hx, hx, madd(hy, hy, m.z * m.z)), inverse = 1 / real_sqrt(hh);
    /* Of the h that is used: wi stays a mirror image, whatever rounding did to h. */
    real twice = 2 * madd((real)wo.x, hx, madd((real)wo.y, hy, (real)wo.z * m.z)) / hh;
    struct model model = { ndf, KERNEL_SHEARED, KERNEL_SMITH };
    real q = hh / (m.mm * (real)s->root_det);
    return (struct sampled){
        .wi_x = madd(twice, hx, -(real)wo.x),
        .wi_y = madd(twice, hy, -(real)wo.y),
        .wi_z = madd(twice, m.z, -(real)wo.z),
        .h_x = hx * inverse,
        .h_y = hy * inverse,
        .h_z = m.z * inverse,
        .pdf = ratio(q * q * m.density, 4 * sigma_scaled(model, s, o)),
    };
}

#endif
