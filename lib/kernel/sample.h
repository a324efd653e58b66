/*
 * sample.h - normals of the standard surface (alpha = 1), all of them or those
 * seen from the stretched direction (a, b, c) (Dupuy 2015 eqs. 2.35, 3.4).
 */
#ifndef FACET_SAMPLE_H
#define FACET_SAMPLE_H

#include "masking.h"

/* A random number of [0, 1) and what it lacks of 1, neither from the other by a difference. */
struct uniform {
    real u, rest;
};

/* A standard micronormal (not normalised) and what reflection and density need of it. */
struct normal {
    real x, y, z;
    real mm;      /* x^2 + y^2 + z^2, or 1 where density is that of slopes (z = 1) */
    real density; /* D = density (hh / (mm root_det))^2; times exp(v^2) where c < 0 */
    real margin;  /* fast: below 0 where floats lose u (below) */
};

/*
 * What a float's rounding makes of u, |CDF(x(u)) - u|, stays below 1e-6 in fast, and is more in few
 * places, whose draws are marked and made again in double (sample.c).  The normal is right to 1e-7
 * of each of the terms it is the sum of: those of C + k' cancel where C is next to -k', and an azimuth
 * about a pole hangs on the sum's last bits next to it.  In units of the squared terms that cancel,
 * the square of what is left must pass these; each makes some 3e-7.
 */
#define MARKS_DRAWS (REAL_IS_FLOAT && !DRAFT)
#define SHORTEST_SUM R(0.125)
#define NEAREST_POLE R(4e-3)
/* A cap that is no higher (seen from behind; bounded, of a rough surface) leaves too little of C_z. */
#define LOWEST_CAP R(0.1)
/* cos t where the slope across wo, tan t, is so large that the one along it is lost beside it. */
#define FARTHEST_ACROSS R(0.1)
/* |e - 1| from behind a V-cavity, where the first azimuths that are seen are acos 1/e. */
#define NEAREST_EDGE R(0.02)

/* Of an azimuth on a circle of this squared radius, moved by no more than `terms` squared. */
INLINE real pole_margin(const struct kernel_surface *s, real radius2, real terms)
{
    const double mean2 = 4 * s->mean * s->mean; /* m_z <= 2 */
    return radius2 - madd(terms, splat(NEAREST_POLE), splat(NEAREST_POLE * R(mean2)));
}

/* Keeps a direction that sees nothing from giving a normal of length 0. */
#define NORMAL_MIN (REAL_IS_FLOAT ? R(1e-15) : R(1e-140))

/* ---- GGX: caps ----------------------------------------------------------------------- */

/*
 * The share K of the cap's lower bound -K c that is left where nothing below it rises
 * above the horizon (Eto & Tokuyoshi 2023): K = (1 - A^2) q^2 / (q^2 + A^2 z^2), q = 1 +-
 * |wo_xy|, - where A > 1; of unit vectors z^2 = (1 - |wo_xy|)(1 + |wo_xy|), so that with
 * e = |1 - A^2| |wo_xy|
 *   K = (1 - A^2 + e) / w,   1 + K = 2 (1 + e) / w,   1 - K = 2 A^2 / w,   w = 1 + A^2 + e:
 * of the last two nothing cancels, whatever the length that rounding left to wo.  1 below the horizon.
 */
struct cap {
    real raised, whole; /* 1 + e and w */
};

INLINE struct cap cap_of(const struct kernel_surface *s, struct vec3 wo)
{
    real side = root_from_zero(madd(wo.x, wo.x, wo.y * wo.y)), rise = splat(R(s->cap_rise));
    return (struct cap){madd(rise, side, splat(1)), madd(rise, side, splat(R(s->cap_whole)))};
}

/* pdf = D / this: 2 (K c + r) = 2 (r - c) + 2 (1 + K) c, r - c = s^2 / (r + c); 4 sigma_o where c < 0. */
INLINE struct fraction cap_area(struct cap cap, struct direction o)
{
    real large = ggx_length(o) + real_abs(o.c), front = real_max(o.c, splat(0));
    return (struct fraction){2 * madd(o.s2, cap.whole, 2 * cap.raised * front * large),
                             cap.whole * large};
}

/*
 * Spherical caps (Dupuy & Benyoub 2023).  m = C + k', C uniform on the cap of
 * directions above -K k'_z: m_z = (1 - u2)(1 + K k'_z) + (1 - K) k'_z, and the radius
 * of C from 1 - C_z = u2 (1 + K k'_z), 1 + C_z = (1 - K k'_z) + (1 - u2)(1 + K k'_z),
 * where 1 +- k'_z, 1 - u2, 1 +- K and their products are never differences.
 */
INLINE struct normal cap_sample(const struct kernel_surface *s, struct direction o, struct cap cap,
                                bool bounded, struct uniform u1, struct uniform u2)
{
    real r = root_from_zero(madd(o.c, o.c, o.s2)), inverse = recip(real_max(r, splat(REAL_MIN)));
    real large = r + real_abs(o.c), more = large * inverse, lift = splat(0);
    real lesser = quotient(o.s2 * inverse, real_max(large, splat(REAL_MIN)));
    mask behind = less(o.c, splat(0));
    real up = select(behind, lesser, more), down = select(behind, more, lesser);
    if (bounded) {
        real part = 2 * real_max(o.c, splat(0)) * inverse * recip(cap.whole);
        lift = R(s->cap_a2) * part;
        up = madd(cap.raised, part, lesser);
        down += lift;
    }
    real z = u2.rest * up, radius2 = u2.u * up * (down + z), radius = root_from_zero(radius2);
    struct sin_cos turn = sin_cos_turns(u1.u);
    real x = madd(radius, turn.cos, o.a * inverse), y = madd(radius, turn.sin, o.b * inverse);
    z = real_max(z + lift, splat(NORMAL_MIN));
    real mm = madd(x, x, madd(y, y, z * z)), flat = o.s2 * inverse * inverse;
    const double correlated = 1 + s->alpha_x * __builtin_fabs(s->tilt); /* 1 + |rho| / kappa */
    real margin = real_min(nmadd(flat, splat(SHORTEST_SUM), mm),
                           pole_margin(s, radius2, R(correlated * correlated) * flat));
    return (struct normal){x, y, z, mm, splat(R(ONE_OVER_PI)), real_min(margin, up - LOWEST_CAP)};
}

/* ---- all normals ------------------------------------------------------------------------ */

/* By D h_z (Walter et al. 2007, eqs. 28, 29, 35, 36): tan^2 theta = -log(1 - u1) or u1 / (1 - u1). */
INLINE struct normal any_normal(const struct kernel_surface *s, enum facet_ndf ndf,
                                struct uniform u1, struct uniform u2)
{
    struct sin_cos turn = sin_cos_turns(u2.u);
    if (ndf == FACET_GGX) {
        real radius = root_from_zero(u1.u),
             z = real_max(root_from_zero(u1.rest), splat(NORMAL_MIN));
        return (struct normal){
            radius * turn.cos, radius * turn.sin,     z,
            splat(1),          splat(R(ONE_OVER_PI)), pole_margin(s, u1.u, splat(0))};
    }
    real radius2 = minus_log(u1.u, u1.rest), radius = root_from_zero(radius2);
    return (struct normal){
        radius * turn.cos, radius * turn.sin,        splat(1),
        splat(1),          u1.rest * R(ONE_OVER_PI), pole_margin(s, radius2, splat(0))};
}

/* ---- Beckmann: slopes ---------------------------------------------------------------------- */

/* Standard slope CDF seen from v = c / s: g = c / sigma, n = s / sigma (Heitz & d'Eon 2014, eq. 15). */
struct view {
    real v, g, n;
    real at_v, edge; /* n psi(v), n exp(-v^2)/sqrt(pi); scaled like sigma where c < 0 */
    real low, high;
    mask back; /* c < 0 */
};

struct cdf {
    real lower, upper, slope; /* F, 1 - F (the smaller is exact) and dF/dx */
};

/*
 * 1 - F next to x = v, where it is lost as a difference: the integral of
 * t exp(2 v t - t^2) over [0, d], term by term of Hermite's generating function.
 * For |2 v d| + d^2 < EDGE the terms left out are below the rounding of the sum.
 * In float the difference is lost earlier, and fewer digits are asked for.
 */
#define EDGE (REAL_IS_FLOAT ? 0.25 : 0.02)
INLINE real edge_integral(real v, real d)
{
    enum { TERMS = REAL_IS_FLOAT ? 10 : 13 };
    real previous = splat(0), term = splat(1), sum = splat(R(0.5)); /* H_n d^n / n! */
    for (int n = 1; n < TERMS; n++) {
        real next = 2 * (v * d * term - d * d * previous) * R(1.0 / n);
        previous = term;
        term = next;
        sum += term * R(1.0 / (n + 2));
    }
    return d * d * sum;
}

/* The given F, or what is exact at d = v - x next to the edge. */
INLINE struct cdf at_edge(const struct view *view, real d, struct cdf away)
{
    mask near = less(real_abs(2 * view->v * d) + d * d, splat(R(EDGE)));
    if (!any(near)) return away;
    real upper = view->edge * edge_integral(view->v, d);
    return (struct cdf){select(near, 1 - upper, away.lower), select(near, upper, away.upper),
                        away.slope};
}

INLINE struct cdf front_cdf(const struct view *view, real x)
{
    real e = exp_minus(x * x), w = R(ERFC_SCALE) / (R(ERFC_SCALE) + real_abs(x)),
         erfcx = erfcx_tail(w);
    real below = e * (view->g * erfcx + view->n * R(1 / SQRT_PI)) * R(0.5);
    real above = e * ((view->g - view->n * x) * erfcx * R(0.5) - view->n * psi_x(w)) + view->at_v;
    above = real_max(above, splat(0));
    mask left = less(x, splat(0));
    struct cdf away = {select(left, below, 1 - above), select(left, 1 - below, above),
                       (view->g - view->n * x) * e * R(1 / SQRT_PI)};
    return at_edge(view, view->v - x, away);
}

/* Over d = v - x for v < 0, where the slope density has only its tail left: F falls from 1 to 0. */
INLINE struct cdf back_cdf(const struct view *view, real d)
{
    real v = real_abs(view->v), x = v + d, w = R(ERFC_SCALE) / (R(ERFC_SCALE) + x);
    real e = exp_minus(d * (d + 2 * v)) * view->n;
    real lower = e * madd(R(0.5) * d, erfcx_tail(w), psi_x(w));
    struct cdf away = {lower, 1 - lower, -d * e * R(1 / SQRT_PI)};
    return at_edge(view, d, away);
}

INLINE struct cdf cdf_at(const struct view *view, real x)
{
    struct cdf front = front_cdf(view, x);
    if (!any(view->back)) return front;
    struct cdf back = back_cdf(view, x);
    return (struct cdf){select(view->back, back.lower, front.lower),
                        select(view->back, back.upper, front.upper),
                        select(view->back, back.slope, front.slope)};
}

/* Newton's step for F(x) = u: of the smaller tail's logarithm in float, which is concave. */
INLINE real newton_step(struct cdf f, struct uniform u)
{
#if REAL_IS_FLOAT
    mask left = less(u.u, u.rest);
    real lower = (minus_log(u.rest, u.u) - minus_log(f.upper, f.lower)) * f.lower;
    real upper = (minus_log(f.lower, f.upper) - minus_log(u.u, u.rest)) * f.upper;
    return select(left, lower, upper) / f.slope;
#else
    real excess = select(less(f.lower, f.upper), f.lower - u.u, u.rest - f.upper);
    return excess / f.slope;
#endif
}

#define SLOPE_MAX (REAL_IS_FLOAT ? R(1e15) : R(1e140)) /* its square is finite, stretched too */

/* That of a stretched direction, whose sine is `side`; any at the pole. */
struct azimuth {
    real cos, sin;
};

INLINE struct azimuth azimuth_of(struct direction o, real side)
{
    mask pole = less(o.s2, splat(REAL_MIN));
    real length = real_max(side, splat(REAL_MIN));
    return (struct azimuth){select(pole, splat(1), o.a / length),
                            select(pole, splat(0), o.b / length)};
}

/*
 * x with F(x) = u (of a back view: its d) by Newton's method kept inside a
 * bracket: monotone in u, so that stratified points stay stratified.
 */
INLINE real invert(const struct view *view, struct uniform u, real x)
{
    enum { STEPS = REAL_IS_FLOAT ? 16 : 100 };
    const lane tolerance = COMPENSATED ? R(4e-16) : REAL_IS_FLOAT ? R(1e-6) : R(1e-13);
    /* Floats of F do not tell slopes near 0 apart. */
    const real least = splat(REAL_IS_FLOAT ? R(0.5) : R(0));
    real low = view->low, high = view->high;
    x = real_max(real_min(x, high), low);
    mask active = less(splat(0), splat(1));
    for (int step = 0; step < STEPS && any(active); step++) {
        struct cdf f = cdf_at(view, x);
        real by = newton_step(f, u);
        real excess = select(less(f.lower, f.upper), f.lower - u.u, u.rest - f.upper);
        mask over = less(splat(0), excess) ^ view->back;
        high = select(over, x, high);
        low = select(over, low, x);
        /* A last step may leave the bracket by rounding; what is not a number is no last step. */
        mask moves = (mask)~less(real_abs(by), tolerance * real_max(real_abs(x), least));
        real next = x - by, middle = R(0.5) * (low + high);
        next = select(moves, select(less(low, next) & less(next, high), next, middle), next);
        mask wide_open = less(tolerance * real_max(real_abs(high), least), high - low);
        x = select(active, next, x);
        active &= moves & wide_open;
    }
    return real_max(real_min(x, view->high), view->low);
}

/* About the normal quantile erfinv(2 u - 1), and that of exp(-x^2), x < 0 (Winitzki's form of erfinv). */
struct guess {
    real normal, tail;
};

INLINE struct guess guess_of(struct uniform u)
{
    real lower = minus_log(u.rest, u.u), upper = minus_log(u.u, u.rest); /* -log u, -log(1 - u) */
    real half = R(0.5) * (R(-1.3862943611) + lower + upper),
         part = R(4.3307) - half; /* 2/(pi 0.147) + log(1 - x^2)/2 */
    real root_ = root_from_zero(real_max(madd(part, part, R(13.6054) * half), splat(0)));
    real size = root_from_zero(real_max(root_ - part, splat(0)));
    return (struct guess){select(less(u.u, u.rest), -size, size), -root_from_zero(lower)};
}

/* Where the Gaussian tail ends: exp(-SLOPE_END^2) is below any step of u. */
#define SLOPE_END                                                                                  \
    (REAL_IS_FLOAT ? R(6.3) : R(6.7)) /* a float keeps the density of two such slopes */

INLINE struct view view_from(struct direction o, real s)
{
    real v = real_max(o.c / real_max(s, splat(REAL_MIN)), splat(-SLOPE_MAX)),
         end = splat(SLOPE_END);
    real e = exp_minus_pair(beckmann_v2(o)), tail = s * psi_x(beckmann_tail(o, s));
    mask back = less(o.c, splat(0));
    /* sigma, exp(v^2) sigma behind; the CDF is its parts, so that it is made of the same ones. */
    real area = real_max(real_max(o.c, splat(0)) + tail * select(back, splat(1), e),
                         splat(REAL_MIN)),
         n = s / area;
    real back_end = end * end / (real_sqrt(madd(v, v, end * end)) - v);
    return (struct view){
        .v = v,
        .g = o.c / area,
        .n = n,
        .at_v = tail / area * e,
        .edge = n * R(1 / SQRT_PI) * select(back, splat(1), e),
        .low = select(back, splat(0), -end),
        .high = select(back, back_end, real_min(v, end)),
        .back = back,
    };
}

INLINE struct normal beckmann_sample(struct direction o, struct uniform u1, struct uniform u2)
{
    real s = real_sqrt(o.s2), zero = splat(0);
    struct view view = view_from(o, s);
    struct guess first = guess_of(u1), second = guess_of(u2);
    real start = madd(view.g, first.normal - first.tail, first.tail);
    start = select(view.back, R(0.5) * (view.low + view.high),
                   real_min(start, R(0.5) * (view.high + first.tail)));
    real found = invert(&view, u1, start), x = select(view.back, view.v - found, found);
    /* The Gaussian alone: seen from the pole. */
    struct view plain = {splat(SLOPE_MAX), splat(1),        zero, zero, zero, splat(-SLOPE_END),
                         splat(SLOPE_END), less(zero, zero)};
    real y = invert(&plain, u2, second.normal);
    struct azimuth to = azimuth_of(o, s);
    real behind = madd(y, y, found * (found + 2 * real_abs(view.v)));
    real exponent = select(view.back, behind, madd(y, y, x * x));
    return (struct normal){.x = nmadd(x, to.cos, y * to.sin),
                           .y = -madd(x, to.sin, y * to.cos),
                           .z = splat(1),
                           .mm = splat(1),
                           .density = exp_minus(exponent) * R(ONE_OVER_PI),
                           /* The rounding of v and that of its tail come to 1e-6. */
                           .margin = select(view.back, splat(-1), zero)};
}

/* ---- GGX: slopes --------------------------------------------------------------------------- */

/* d - sin d cos d, without the difference where it has too few digits left. */
INLINE real segment(real d, struct sin_cos at)
{
    static const double terms[] = {4.0 / 1856156927625, -2.0 / 10854718875, 8.0 / 638512875,
                                   -4.0 / 6081075,      4.0 / 155925,       -2.0 / 2835,
                                   4.0 / 315,           -2.0 / 15,          2.0 / 3};
    real d2 = d * d, sum = splat(R(terms[0]));
    for (int k = 1; k < 9; k++) sum = madd(sum, d2, splat(R(terms[k])));
    return select(less(d2, splat(R(0.25))), sum * d2 * d, nmadd(at.sin, at.cos, d));
}

/*
 * d in [0, pi/2] with (d - sin d cos d) + sin d (p cos d + q sin d) = pi w, w in
 * [0, 1/2], p, q >= 0 and not both above 0, by Newton.  Not `bent`: p = q = 0, from
 * d^3 = 3/2 pi w.  Else from above, each term by itself (each is at least its chord),
 * whence the steps fall: the left side is convex up to d.
 */
INLINE real across_angle(real w, bool bent, real p, real q)
{
    enum { STEPS = REAL_IS_FLOAT ? 4 : 6 };
    /* A third of the exponent is a cube root to 5 % (Kahan). */
    const lane_bits third = REAL_IS_FLOAT ? (lane_bits)0x2a5119f2
                                          : (lane_bits)((int64_t)0x2a9f7893 << 32);
    const real least = splat(REAL_IS_FLOAT ? R(1e-30) : R(1e-280)), area = w * R(1 / ONE_OVER_PI);
    real cube = real_max((bent ? R(0.25 / (ONE_OVER_PI * ONE_OVER_PI)) : R(1.5)) * area, least);
    real d = (real)(__builtin_convertvector(__builtin_convertvector((bits)cube, real) * R(1.0 / 3),
                                            bits) +
                    third);
    for (int k = 0; k < 2; k++) d = R(1.0 / 3) * (2 * d + cube / (d * d));
    if (bent) {
        real line = area / real_max(p, least),
             square = R(0.5 / ONE_OVER_PI) * root_from_zero(area / real_max(q, least));
        d = real_max(real_min(d, real_min(line, square)), least);
    }
    for (int k = 0; k < STEPS + bent; k++) {
        struct sin_cos at = sin_cos_turns(d * R(0.5 * ONE_OVER_PI));
        real side = segment(d, at), slope = 2 * at.sin * at.sin;
        if (bent) {
            side = madd(at.sin, madd(p, at.cos, q * at.sin), side);
            slope += madd(p, madd(at.cos, at.cos, -at.sin * at.sin), 2 * q * at.sin * at.cos);
        }
        d -= (side - area) / (bent ? real_max(slope, splat(REAL_MIN)) : slope);
        if (bent) d = real_max(d, splat(0));
    }
    return d;
}

/*
 * Heitz & d'Eon 2014 for GGX with the quantiles exact.  Along wo the slope is tan b, b = A -
 * theta_o, sin A = u1 (1 + k'_z) - k'_z; across it is tan t / cos b, t + sin t cos t = pi (u2 -
 * 1/2): m = (sin b cos t, sin t, cos b cos t), no slope formed.
 */
INLINE struct normal ggx_slopes(struct direction o, struct uniform u1, struct uniform u2)
{
    real r = root_from_zero(madd(o.c, o.c, o.s2)), inverse = recip(real_max(r, splat(REAL_MIN)));
    real c = o.c * inverse, side = root_from_zero(o.s2), s = side * inverse, zero = splat(0);
    real large = r + real_abs(o.c), more = large * inverse,
         least = quotient(o.s2 * inverse, real_max(large, splat(REAL_MIN)));
    mask behind = less(o.c, zero);
    real up = select(behind, least, more), down = select(behind, more, least), part = u1.u * up;
    real sin_a = part - c, cos_a = root_from_zero(u1.rest * up * (part + down));
    /* cos b by its conjugate where it is a difference. */
    real plain = madd(cos_a, c, sin_a * s), under = nmadd(sin_a, s, cos_a * c);
    real conjugate = (c - sin_a) * part /
                     select(less(real_abs(under), splat(REAL_MIN)), splat(1), under);
    mask direct = (mask)((mask)~behind & less(zero, sin_a));
    real cos_b = select(direct, plain, conjugate), sin_b = nmadd(cos_a, s, sin_a * c);
    struct sin_cos at = sin_cos_turns(across_angle(real_min(u2.u, u2.rest), false, zero, zero) *
                                      R(0.5 * ONE_OVER_PI));
    real x = sin_b * at.sin, y = select(less(u2.u, u2.rest), -at.cos, at.cos),
         z = real_max(cos_b * at.sin, splat(NORMAL_MIN));
    struct azimuth to = azimuth_of(o, side);
    real mx = nmadd(x, to.cos, y * to.sin), my = -madd(x, to.sin, y * to.cos);
    return (struct normal){
        mx, my, z, madd(x, x, madd(y, y, z * z)), splat(R(ONE_OVER_PI)), at.sin - FARTHEST_ACROSS};
}

/* ---- V-cavities ---------------------------------------------------------------------------- */

/*
 * Heitz & d'Eon 2014, algorithm 3: of a normal and its twin at the opposite slope
 * (about the mean slope, where that is not 0) the one or the other, by how much of each is seen.
 * Of radius r = tan theta_m by u1 and azimuth psi from wo's, wo sees c + s r cos psi; so psi
 * has density (1 + e cos psi)/(2 pi), e = s r/c, where both twins are seen, twice the uniform where
 * only this one is, nothing where only the other is; behind the mean facet (c <= 0) the uniform
 * where neither is.  That is inverted by u2, so that no third random number is
 * borrowed and both u keep their order: psi from -pi to pi, w = min(u2, 1 - u2) the area
 * beyond it, psi_0 = acos 1/e (0 for e < 1) where the other twin comes into view.
 */
INLINE struct normal cavity_normal(const struct kernel_surface *s, enum facet_ndf ndf,
                                   struct direction o, struct uniform u1, struct uniform u2)
{
    const real one = splat(1), zero = splat(0), most = splat(SLOPE_MAX);
    bool ggx = ndf == FACET_GGX;
    real radius2 = ggx ? u1.u : minus_log(u1.u, u1.rest), radius = root_from_zero(radius2);
    real z = ggx ? real_max(root_from_zero(u1.rest), splat(NORMAL_MIN)) : one;
    real side = root_from_zero(o.s2), w = real_min(u2.u, u2.rest);
    real e = real_min(side * radius / real_max(real_abs(o.c) * z, splat(REAL_MIN)), most);
    real rise = root_from_zero(real_max((e - 1) * (e + 1), zero));
    mask behind = (mask)~less(zero, o.c);
    struct sin_cos half = sin_cos_turns(R(0.5) * w); /* of pi w */
    struct sin_cos d = sin_cos_turns(across_angle(w, true, real_max(1 - e, zero), rise) *
                                     R(0.5 * ONE_OVER_PI));
    d.sin = select(behind, half.sin, d.sin), d.cos = select(behind, half.cos, d.cos);
    /* psi = pi - psi_0 - 2 d where both or none are seen; else pi/2 - pi w. */
    real i = one / real_max(e, one), j = select(less(one, e), rise * i, zero);
    real sin_2 = 2 * d.sin * d.cos, cos_2 = madd(d.cos, d.cos, -d.sin * d.sin);
    mask alone = less(one, e * half.sin);
    real x = select(alone, half.sin, nmadd(i, cos_2, j * sin_2));
    real y = select(alone, half.cos, madd(j, cos_2, i * sin_2)) *
             select(less(u2.u, u2.rest), -one, one);
    struct azimuth to = azimuth_of(o, side);
    real margin = real_min(pole_margin(s, radius2, zero),
                           select(behind, real_abs(e - 1) - NEAREST_EDGE, one));
    return (struct normal){radius * nmadd(y, to.sin, x * to.cos),
                           radius * madd(x, to.sin, y * to.cos),
                           z,
                           one,
                           ggx ? splat(R(ONE_OVER_PI)) : u1.rest * R(ONE_OVER_PI),
                           margin};
}

/* ---- reflection --------------------------------------------------------------------------- */

struct reflected {
    struct vec3 wi, h;
    real density; /* D */
    real seen;    /* |wo.h| / h_z */
    mask faces;   /* wo.h > 0 */
};

/* The affine map, and reflection wi = 2 (wo.h) h - wo. */
INLINE struct reflected reflect_sample(const struct kernel_surface *s, struct vec3 wo,
                                       struct normal m)
{
    real hx = nmadd(m.z, splat(R(s->slope_x)), R(s->alpha_x) * m.x);
    real hy = madd(splat(R(s->rho_alpha_y)), m.x,
                   nmadd(m.z, splat(R(s->slope_y)), R(s->kappa_alpha_y) * m.y));
    real hh = madd(hx, hx, madd(hy, hy, m.z * m.z)), inverse = rsqrt(hh);
    /* Of the h that is used: wi stays a mirror image, whatever rounding did to h. */
    real dot = madd(wo.x, hx, madd(wo.y, hy, wo.z * m.z)), twice = quotient(2 * dot, hh);
    real q = quotient(hh, m.mm * R(s->root_det));
    return (struct reflected){
        .wi = {madd(twice, hx, -wo.x), madd(twice, hy, -wo.y), madd(twice, m.z, -wo.z)},
        .h = {hx * inverse, hy * inverse, m.z * inverse},
        .density = q * q * m.density,
        .seen = quotient(real_abs(dot), m.z),
        .faces = less(splat(0), dot),
    };
}

#endif
