/*
 * crossing.h - a pair of directions across a rough dielectric, or on one side of it: what the index
 * makes of it, the density of what is transmitted, and what masking keeps (facet_transmission.h).
 */
#ifndef FACET_CROSSING_H
#define FACET_CROSSING_H

#include "refraction.h"

#include "loop.h"
#include "wider.h"

/* A pair as given, in `wider`, and the side that wo is on. */
struct sides {
    wider ox, oy, oz, ix, iy, iz;
    mask below;
    real turn;  /* -1 where wo lies below, else 1: turns wo up */
    real index; /* n */
};

INLINE struct sides sides_of(const struct kernel_refraction *job, size_t k)
{
    struct sides p = {.ox = wider_at(job->wo[0], k),
                      .oy = wider_at(job->wo[1], k),
                      .oz = wider_at(job->wo[2], k),
                      .ix = wider_at(job->wi[0], k),
                      .iy = wider_at(job->wi[1], k),
                      .iz = wider_at(job->wi[2], k)};
    p.below = less(wider_pair(p.oz).hi, splat(0));
    p.turn = select(p.below, splat(-1), splat(1));
    p.index = select(p.below, splat(R(job->side[BELOW].index)), splat(R(job->side[ABOVE].index)));
    return p;
}

INLINE wider wider_dot(wider ax, wider ay, wider az, wider bx, wider by, wider bz)
{
    return wider_sum(wider_sum(wider_product(ax, bx), wider_product(ay, by)),
                     wider_product(az, bz));
}

/* F of the reflection: g^2 = n^2 - 1 + c^2, |wi + wo|^2 = 4 c^2, so that the critical angle costs
 * no digit. */
INLINE real reflection_fresnel(const struct kernel_refraction *job, const struct sides *p)
{
    const struct kernel_side *up = &job->side[ABOVE], *down = &job->side[BELOW];
    wider x = wider_sum(p->ox, p->ix), y = wider_sum(p->oy, p->iy), z = wider_sum(p->oz, p->iz),
          hh = wider_dot(x, y, z, x, y, z);
    wider root = wider_choice(p->oz, 4 * down->excess, 4 * down->excess_low, 4 * up->excess,
                              4 * up->excess_low);
    real top = select(p->below, splat(R(8 * down->excess * down->excess)),
                      splat(R(8 * up->excess * up->excess)));
    return fresnel_of_root(top, true, wider_pair(hh), pair_round(wider_pair(wider_sum(root, hh))),
                           1);
}

/* The normal that refracts: M = outer wo + inner wi, turned up with wo. */
struct crossing {
    struct vec3 m, m_low; /* m_low: what it lacks (precise) */
    real to_o, to_i;      /* M . wo and -M . wi: 0 or less where M refracts nothing */
    real flip;            /* -1 where h is -M/|M|, else 1 */
    real index, outer;    /* n, and what it is counted from: 1 or eta */
};

/* In `wider`, so that n -> 1 and grazing angles cost no digit. */
INLINE struct crossing crossing_of(const struct kernel_refraction *job, const struct sides *p)
{
    wider outer = wider_choice(p->oz, job->eta, 0, 1, 0),
          inner = wider_choice(p->oz, 1, 0, job->eta, 0);
    wider x = wider_sum(wider_product(outer, p->ox), wider_product(inner, p->ix));
    wider y = wider_sum(wider_product(outer, p->oy), wider_product(inner, p->iy));
    wider z = wider_sum(wider_product(outer, p->oz), wider_product(inner, p->iz));
    pair mx = wider_pair(x), my = wider_pair(y), mz = wider_pair(z);
    real upward = select(less(mz.hi, splat(0)), splat(-1), splat(1)), flip = upward * p->turn;
    return (struct crossing){
        .m = {upward * mx.hi, upward * my.hi, upward * mz.hi},
        .m_low = {upward * mx.lo, upward * my.lo, upward * mz.lo},
        .to_o = flip * wider_pair(wider_dot(x, y, z, p->ox, p->oy, p->oz)).hi,
        .to_i = -flip * wider_pair(wider_dot(x, y, z, p->ix, p->iy, p->iz)).hi,
        .flip = flip,
        .index = p->index,
        .outer = wider_pair(outer).hi,
    };
}

/* 1 - F of the cosines c and g = n |wi.h|, or of both times the same, in positive terms. */
INLINE struct fraction transmittance(real index, real c, real g)
{
    real n2 = index * index, s = c + g, p = madd(n2, c, g), s2 = s * s, p2 = p * p;
    return (struct fraction){2 * c * g * madd(n2, s2, p2), s2 * p2};
}

/* F of the transmitted lobe's normal, c - g = +-|M|/outer. */
INLINE real crossing_fresnel(const struct crossing *x, real excess_, real length2)
{
    real c = x->to_o, g = x->index * x->to_i, less_ = x->flip * quotient(length2, x->outer);
    real s = quotient(less_, c + g),
         p = quotient(madd(excess_, c, less_), madd(x->index * x->index, c, g));
    return R(0.5) * madd(s, s, p * p);
}

INLINE real square_of(struct vec3 v)
{
    return madd(v.x, v.x, madd(v.y, v.y, v.z * v.z));
}

/* T c (d omega_h / d omega_i) = T (c/|M|) n^2 |wi.h| / (|M|/outer)^2. */
INLINE real crossing_spread(const struct crossing *x)
{
    real c = x->to_o, g = x->index * x->to_i, m2 = square_of(x->m);
    struct fraction t = transmittance(x->index, c, g);
    return quotient(t.num * (x->index * g * x->outer * (x->outer * c)), t.den * (m2 * m2));
}

/* ---- masking ---------------------------------------------------------------------------- */

#if defined(FACET_TIER_draft)
#define OPPOSITE_SHIFT 2
#define OPPOSITE_TERMS 2
#elif REAL_IS_FLOAT
#define OPPOSITE_SHIFT 3
#define OPPOSITE_TERMS 3
#else
#define OPPOSITE_SHIFT 8
#define OPPOSITE_TERMS (COMPENSATED ? 8 : 6)
#endif

/* log Gamma(z) - ((z - 1/2) log z - z + log(2 pi)/2) of 1/z, z > OPPOSITE_SHIFT: the first term
 * left out is below the tier's rounding. */
INLINE real stirling(real inverse)
{
    static const double terms[] = {-3617.0 / 122400, 1.0 / 156,  -691.0 / 360360, 1.0 / 1188,
                                   -1.0 / 1680,      1.0 / 1260, -1.0 / 360,      1.0 / 12};
    real square = inverse * inverse, sum = splat(R(terms[8 - OPPOSITE_TERMS]));
    for (int k = 9 - OPPOSITE_TERMS; k < 8; k++) sum = madd(sum, square, splat(R(terms[k])));
    return sum * inverse;
}

/* Product over k = 1 .. SHIFT of (l + t + k) / (l + k) r / (t + k); one quotient below precise,
 * where a large l is a stray. */
INLINE real opposite_product(real t, real l, real r)
{
    struct fraction f = {splat(1), splat(1)};
    for (int k = 1; k <= OPPOSITE_SHIFT; k++) {
        real top = l + t + R(k), low = l + R(k), least = t + R(k);
        if (COMPENSATED)
            f.num *= top / low / least * r;
        else
            f.num *= top * r, f.den *= low * least;
    }
    return COMPENSATED ? f.num : quotient_fine(f.num, f.den);
}

/*
 * opposite.h.  With t the smaller of a and b, l the larger, SHIFT that of OPPOSITE_SHIFT, and
 * r, m, s = t, l, a + b + 1 + SHIFT:
 *   Gamma(r) Gamma(m) / Gamma(s) = sqrt(2 pi) e^-(1 + SHIFT) (1 - t/s)^(m - 1/2) (r/s)^t r^(1/2 + SHIFT)
 * times what the series leave: no two large logarithms are subtracted.  exp_minus takes no exponent
 * below 0: 1 is added to it, and e^-1 is left to the constant.
 */
INLINE real opposite(real a, real b)
{
    enum { SHIFT = OPPOSITE_SHIFT };
    const double root_two_pi = 2.50662827463100050242,
                 e_to_minus[] = {[2] = 1.35335283236612691894e-1,
                                 [3] = 4.97870683678639429793e-2,
                                 [8] = 3.35462627902511838821e-4};
    real t = real_min(a, b), l = real_max(a, b), most = splat(REAL_MAX / 8);
    mask some = less(splat(0), t), finite = less(l, most);
    /* Lanes whose result nobody takes have cosines of any sign: logarithms are not for those. */
    l = real_max(real_min(l, most), splat(0));
    t = real_min(real_max(t, splat(0)), most);
    real r = t + (1 + SHIFT), m = l + (1 + SHIFT), s = l + r;
    real per_r = quotient_fine(splat(1), r), per_m = quotient_fine(splat(1), m),
         per_s = quotient_fine(splat(1), s);
    real first = COMPENSATED ? minus_log(t / s, m / s) : minus_log(t * per_s, m * per_s);
    real second = COMPENSATED ? minus_log(l / s, r / s) : minus_log(l * per_s, r * per_s);
    real rest = stirling(per_r) + stirling(per_m) - stirling(per_s);
    real power = exp_minus(1 + madd(m - R(0.5), first, t * second) - rest);
    real value = real_min(R(root_two_pi * e_to_minus[SHIFT]) * opposite_product(t, l, r) *
                              root_fine(r) * power,
                          splat(1));
    value = select((mask)(finite & less(splat(0), power)), value,
                   splat(0)); /* what power is multiplied by may be infinite */
    return select(some, value, splat(1));
}

/*
 * Below this, and above that a, W hangs on sigmas by more than the tiers' bounds have room for
 * (transmission_bounds.c): strays.  precise has room.
 */
#if !COMPENSATED
#define WEIGHT_UNSURE TRANSMISSION_WEIGHT_LEAST
#define LAMBDA_UNSURE TRANSMISSION_LAMBDA_MOST
#endif

/* W = G2/G1(o) across the surface, of directions turned up; 0 where wi shows no facet. */
INLINE real crossing_weight(struct model m, const struct kernel_surface *s, struct direction i,
                            struct direction o, bool is_correlated, mask *unsure)
{
    mask faces = less(splat(0), real_min(i.c, real_min(i.z, o.z)));
    *unsure = less(splat(0), splat(0));
    if (!is_correlated)
        return select(faces,
                      real_min(quotient(i.c, real_max(sigma(m, s, i), splat(REAL_MIN))), splat(1)),
                      splat(0));
    faces = (mask)(faces &
                   less(splat(0), o.c)); /* behind: the limit, only the highest facets are seen */
    real a = 1 + quotient(front_excess(m, s, o), real_max(o.c, splat(REAL_MIN)));
    real b = quotient(front_excess(m, s, i), real_max(i.c, splat(REAL_MIN)));
    real value = opposite(a, b);
#if !COMPENSATED
    real margin_ = real_min(value - R(WEIGHT_UNSURE), R(LAMBDA_UNSURE) - a);
    *unsure = (mask)(faces & not_less(splat(0), margin_));
#endif
    return select(faces, value, splat(0));
}

#endif
