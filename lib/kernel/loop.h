/*
 * loop.h - what every batch loop is made of: arrays in and out, the terms of a
 * pair, strays, Fresnel terms, and the loop itself as a macro.
 */
#ifndef FACET_LOOP_H
#define FACET_LOOP_H

#include "kernels.h"

#include "fresnel.h"
#include "masking.h"

#define TABLE_NAME_(table, tier, io, isa) facet_##table##_##tier##_##io##_##isa
#define TABLE_NAME(table, tier, io, isa) TABLE_NAME_(table, tier, io, isa)

/* ---- in and out ------------------------------------------------------------------ */

INLINE real load_at(const void *array, size_t k)
{
    return load((const io *)array + k);
}

INLINE void store_at(void *array, size_t k, real x)
{
    store((io *)array + k, x);
}

INLINE struct vec3 load_vec3(const void *const v[3], size_t k)
{
    return (struct vec3){load_at(v[0], k), load_at(v[1], k), load_at(v[2], k)};
}

INLINE void store_vec3(void *const v[3], size_t k, struct vec3 x)
{
    store_at(v[0], k, x.x), store_at(v[1], k, x.y), store_at(v[2], k, x.z);
}

#if defined(FACET_IO_double) && REAL_IS_FLOAT
#define ROUNDS_INPUT 1

INLINE struct doubles doubles_at(const void *array, size_t k)
{
    return load_doubles((const io *)array + k);
}

INLINE struct doubles sum_of(struct doubles a, struct doubles b)
{
    return (struct doubles){{a.half[0] + b.half[0], a.half[1] + b.half[1]}};
}

INLINE struct given load_pair(const struct kernel_surface *s, struct model m,
                              const struct kernel_job *job, size_t k)
{
    struct doubles ix = doubles_at(job->wi[0], k), iy = doubles_at(job->wi[1], k),
                   iz = doubles_at(job->wi[2], k);
    struct doubles ox = doubles_at(job->wo[0], k), oy = doubles_at(job->wo[1], k),
                   oz = doubles_at(job->wo[2], k);
    struct given g = {
        .wi = {narrow(ix), narrow(iy), narrow(iz)},
        .wo = {narrow(ox), narrow(oy), narrow(oz)},
        .sum = {narrow(sum_of(ix, ox)), narrow(sum_of(iy, oy)), narrow(sum_of(iz, oz))}};
    if (m.shape != KERNEL_SHEARED) return g;
    g.ci = mean_cosine_of_doubles(s, ix, iy, iz);
    g.co = mean_cosine_of_doubles(s, ox, oy, oz);
    return g;
}
#else
#define ROUNDS_INPUT 0

INLINE struct given load_pair(const struct kernel_surface *s, struct model m,
                              const struct kernel_job *job, size_t k)
{
    struct given g = {.wi = load_vec3(job->wi, k), .wo = load_vec3(job->wo, k)};
    g.sum = (struct vec3){g.wi.x + g.wo.x, g.wi.y + g.wo.y, g.wi.z + g.wo.z};
    if (m.shape != KERNEL_SHEARED) return g;
#if REAL_IS_FLOAT
    if (floats_will_do(m)) {
        g.ci = mean_cosine_of_floats(s, g.wi);
        g.co = mean_cosine_of_floats(s, g.wo);
        real least = real_min(real_abs(g.ci.hi), real_abs(g.co.hi));
        if (!any(less(least, splat(R(UNSURE_COSINE * lean_of(s)))))) return g;
    }
#endif
    g.ci = mean_cosine(s, g.wi);
    g.co = mean_cosine(s, g.wo);
    return g;
}
#endif

/* What every quantity of a pair is made of. */
struct terms {
    struct given given;
    struct direction i, o;
    struct half h;
};

INLINE struct terms load_terms(const struct kernel_surface *s, struct model m,
                               const struct kernel_job *job, size_t k)
{
    struct terms t = {.given = load_pair(s, m, job, k)};
    t.i = direction_of(s, m.shape, t.given.wi, t.given.ci);
    t.o = direction_of(s, m.shape, t.given.wo, t.given.co);
    t.h = half_of(s, m.shape, &t.given);
    return t;
}

/* ---- strays ------------------------------------------------------------------------ */

/*
 * Pairs beyond the range of a tier's arithmetic, marked by results that are not
 * numbers: |H| too short for its powers, a result so large that a denominator may
 * have left the range, a cosine lost in float, and what excess_front is not for.
 * precise has none.
 */
#if REAL_IS_FLOAT
#define SHORTEST2 R(0x1p-20)
#define LARGEST R(1e24)
#define LEAST_COSINE 0x1p-28
#define LEAST_ROUNDED                                                                              \
    R(1e-37) /* above FLT_MIN: a double that is no less keeps its digits as a float */
#else
#define SHORTEST2 R(1e-60)
#define LARGEST R(1e250)
#define LEAST_COSINE 0x1p-16
#define LEAST_ROUNDED R(0) /* doubles are not rounded */
#endif

/* Positive where sigma is no smaller than floats hold, or is not needed: nothing is lit. */
INLINE real table_margin(const struct kernel_surface *s, struct direction i, struct direction o,
                         enum kernel_quantity q)
{
    real seen = table_front(s, o);
    if (q == KERNEL_G1_I) seen = table_front(s, i);
    bool is_lit = q == KERNEL_FR || q == KERNEL_FR_COS || q == KERNEL_G || q == KERNEL_WEIGHT;
    return is_lit ? real_max(seen, -real_min(i.z, o.z)) : seen;
}

/*
 * Positive where a pair is within the range.  By differences and minima, which cost
 * nothing beside the multiplications, and one comparison; `value` comes last because
 * a minimum is its second operand where either is not a number.
 */
INLINE real margin(struct model m, const struct kernel_surface *s, const struct terms *t,
                   enum kernel_quantity q, real value)
{
    real least = t->h.hh - SHORTEST2;
    /* What was a cosine may have become 0. */
    if (ROUNDS_INPUT)
        least = real_min(least, real_min(real_abs(t->i.z), real_abs(t->o.z)) - LEAST_ROUNDED);
    if (m.shape == KERNEL_SHEARED) {
        real least_z = real_min(t->i.z, t->o.z), c = real_abs(t->o.c);
        if (q == KERNEL_FR && m.masking == KERNEL_SMITH && REAL_IS_FLOAT)
            /* Below 0 for certain is as good as above: no light. */
            c = real_min(c, real_abs(real_min(least_z, t->i.c)));
        else if (REAL_IS_FLOAT)
            c = real_min(real_min(c, real_abs(t->i.c)),
                         real_min(real_abs(t->i.z), real_abs(t->o.z)));
        else
            c = real_min(c, real_abs(t->i.c));
        least = real_min(least, c - R(LEAST_COSINE * lean_of(s)));
        if (scales(m)) least = real_min(least, BEHIND_MAX + beckmann_cotangent(t->o).v);
    }
    if (m.ndf == FACET_TABULATED && REAL_IS_FLOAT && q != KERNEL_D)
        least = real_min(least, table_margin(s, t->i, t->o, q));
    bool from_below = q == KERNEL_PDF || q == KERNEL_D_VIS || q == KERNEL_SIGMA_O;
    if (from_below && m.ndf == FACET_BECKMANN && m.shape != KERNEL_SHEARED)
        least = real_min(least, t->o.z);
    return real_min(least, LARGEST - value);
}

INLINE mask stray(struct model m, const struct kernel_surface *s, const struct terms *t,
                  enum kernel_quantity q, real value)
{
    return not_less(splat(0), margin(m, s, t, q, value));
}

INLINE real marked(mask stray_, real value)
{
    return select(stray_, splat(R(__builtin_nan(""))), value);
}

/* ---- quantities ---------------------------------------------------------------------- */

INLINE real fresnel_of(const struct kernel_job *job, size_t channel, pair hh, real versine5,
                       lane scale)
{
    const struct kernel_fresnel *f = &job->fresnel[channel];
    switch (job->kind) {
    case FACET_FRESNEL_SCHLICK: return fresnel_schlick(f, versine5, scale);
    case FACET_FRESNEL_DIELECTRIC: return fresnel_dielectric(f, hh, scale);
    case FACET_FRESNEL_CONDUCTOR: return fresnel_conductor(f, hh, scale);
    case FACET_FRESNEL_TABLE: return fresnel_table(f, hh, scale);
    default: return splat(scale);
    }
}

/* Far enough above the smallest normal float for what F times it is made of. */
#define FAINT 1e-30

/* out[channel] = scale F_channel value. */
INLINE void store_coloured(const struct kernel_job *job, enum kernel_quantity q, size_t k,
                           const struct terms *t, real value, lane scale)
{
    pair hh = {splat(0), splat(0)};
    real v5 = splat(0);
    if (job->kind != FACET_FRESNEL_IDEAL) hh = angle_squared(&t->given, t->h);
    if (job->kind == FACET_FRESNEL_SCHLICK) {
        real v = real_max(angle_versine(hh), splat(0)), v2 = v * v;
        v5 = v2 * v2 * v;
    }
    for (size_t c = 0; c < job->channels; c++) {
        if (!job->out[q][c]) continue;
        /* Where F times the scale may become denormal, the scale goes with the value. */
        bool faint = REAL_IS_FLOAT && job->kind != FACET_FRESNEL_IDEAL &&
                     job->fresnel[c].least * scale < FAINT;
        lane own = faint ? 1 : scale;
        real scaled = value;
        if (faint) scaled = value * scale;
        store_at(job->out[q][c], k, scaled * fresnel_of(job, c, hh, v5, own));
    }
}

/* By name and not by a switch over q: what a switch drops has first to be compiled. */
#define quantity_FR bare_fr
#define quantity_FR_COS bare_fr_cos
#define quantity_PDF bare_pdf
#define quantity_D bare_d
#define quantity_D_VIS bare_d_vis
#define quantity_G quantity_g
#define quantity_G1_I quantity_g1_i
#define quantity_G1_O quantity_g1_o
#define quantity_F(m, s, i, o, h) splat(1)
#define quantity_SIGMA_O quantity_sigma_o
#define quantity_WEIGHT quantity_weight
#define quantity_CONDITION quantity_condition

/* What a quantity has yet to be multiplied by. */
INLINE lane constant_of(struct model m, const struct kernel_surface *s, enum kernel_quantity q)
{
    if (q == KERNEL_FR) return fr_factor(m, s);
    bool bare = q == KERNEL_FR_COS || q == KERNEL_PDF || q == KERNEL_D || q == KERNEL_D_VIS;
    return bare ? factor_of(m, s) : R(1);
}

#define STORE_PLAIN(q) store_at(own.out[q][0], k, value *scale)
#define STORE_COLOURED(q) store_coloured(&own, q, k, &t, value, scale)
#define STORE_FR STORE_COLOURED
#define STORE_FR_COS STORE_COLOURED
#define STORE_PDF STORE_PLAIN
#define STORE_D STORE_PLAIN
#define STORE_D_VIS STORE_PLAIN
#define STORE_G STORE_PLAIN
#define STORE_G1_I STORE_PLAIN
#define STORE_G1_O STORE_PLAIN
#define STORE_F STORE_COLOURED
#define STORE_SIGMA_O STORE_PLAIN
#define STORE_WEIGHT STORE_COLOURED
#define STORE_CONDITION STORE_PLAIN

/* The variable `value` of a LOOP, strays marked, to where it goes. */
#define STORE_MARKED(q)                                                                            \
    if (!COMPENSATED) {                                                                            \
        mask out = stray(m, &s, &t, KERNEL_##q, value);                                            \
        if (__builtin_expect(any(out), 0)) value = marked(out, value), some = (mask)(some | out);  \
    }                                                                                              \
    STORE_##q(KERNEL_##q);

#define ONE_QUANTITY(q)                                                                            \
    {                                                                                              \
        scale = constant_of(m, &s, KERNEL_##q);                                                    \
        real value = quantity_##q(m, &s, t.i, t.o, t.h);                                           \
        STORE_MARKED(q)                                                                            \
    }

/* The quantities of one loop share what they have in common. */
#define LOOP(name, ndf_, shape_, masking_, fixed, quantities)                                      \
    static bool name(const struct kernel_surface *surface, const struct kernel_job *job, size_t n) \
    {                                                                                              \
        const struct kernel_surface s = *surface;                                                  \
        struct kernel_job own = *job;                                                              \
        const struct model m = {FACET_##ndf_, KERNEL_##shape_, masking_};                          \
        mask some = less(splat(0), splat(0));                                                      \
        fixed;                                                                                     \
        for (size_t k = 0; k < n; k += LANES) {                                                    \
            struct terms t = load_terms(&s, m, &own, k);                                           \
            lane scale = 1;                                                                        \
            quantities                                                                             \
        }                                                                                          \
        return any(some);                                                                          \
    }

#endif
