/*
 * sampler.c - the sampling loops and the densities of each method, compiled once
 * per (tier, io, isa) like kernel.c.
 *
 * The loops are those of the general shape; a method's density is D times a
 * factor in which nothing cancels, so that fr cos / pdf is the factor's business
 * alone.
 */
#include "loop.h"
#include "sample.h"

/* ---- draws ------------------------------------------------------------------------------ */

/* 1 - u before u is rounded, which may make it 1. */
INLINE struct uniform load_uniform(const struct kernel_job *job, int which, size_t k)
{
#if ROUNDS_INPUT
    struct doubles u = load_doubles((const io *)job->u[which] + k),
                   rest = {{1 - u.half[0], 1 - u.half[1]}};
    return (struct uniform){narrow(u), narrow(rest)};
#else
    real u = load_at(job->u[which], k);
    return (struct uniform){u, 1 - u};
#endif
}

INLINE struct normal draw_normal(enum facet_sampler sampler, enum facet_ndf ndf,
                                 const struct kernel_surface *s, struct direction o, struct cap cap,
                                 struct uniform u1, struct uniform u2)
{
    if (sampler == FACET_SAMPLER_NDF) return any_normal(s, ndf, u1, u2);
    if (sampler == FACET_SAMPLER_VCAVITY) return cavity_normal(s, ndf, o, u1, u2);
    if (sampler == FACET_SAMPLER_SLOPE)
        return ndf == FACET_GGX ? ggx_slopes(o, u1, u2) : beckmann_sample(o, u1, u2);
    return cap_sample(s, o, cap, sampler == FACET_SAMPLER_BOUNDED, u1, u2);
}

/* pdf = D / this, never 0: of a sample at its pole, wo.h = 0 by rounding, the density saturates. */
INLINE real area_of(enum facet_sampler sampler, struct model m, const struct kernel_surface *s,
                    struct direction o, struct cap cap, const struct reflected *a)
{
    const real single = real_max(4 * a->seen, splat(REAL_MIN));
    switch (sampler) {
    case FACET_SAMPLER_NDF: return single;
    case FACET_SAMPLER_VCAVITY:
        return select((mask)(a->faces | less(splat(0), o.c)), 2 * real_max(2 * o.c, a->seen),
                      single);
    case FACET_SAMPLER_BOUNDED: return value_of(cap_area(cap, o));
    default: return 4 * sigma_scaled(m, s, o);
    }
}

/* Which of them are to be made again. */
INLINE mask draw(enum facet_sampler sampler, enum facet_ndf ndf, const struct kernel_surface *s,
                 const struct kernel_job *job, size_t k)
{
    const struct model m = {ndf, KERNEL_SHEARED, KERNEL_SMITH};
    struct vec3 wo = load_vec3(job->wo, k);
    struct direction o = direction_of(s, KERNEL_SHEARED, wo, mean_cosine(s, wo));
    struct cap cap = {splat(1), splat(1)};
    if (sampler == FACET_SAMPLER_BOUNDED) cap = cap_of(s, wo);
    struct normal n = draw_normal(sampler, ndf, s, o, cap, load_uniform(job, 0, k),
                                  load_uniform(job, 1, k));
    struct reflected a = reflect_sample(s, wo, n);
    store_vec3(job->sampled_wi, k, a.wi);
    if (job->sampled_h[0]) store_vec3(job->sampled_h, k, a.h);
    if (job->sampled_pdf)
        store_at(job->sampled_pdf, k, ratio(a.density, area_of(sampler, m, s, o, cap, &a)));
    return less(n.margin, splat(0));
}

/* Adds the places of a vector's marked draws to job->again, which has `count`; how many it has then. */
INLINE size_t note_marked(const struct kernel_job *job, size_t count, mask marks, size_t k)
{
    for (unsigned left = mask_bits(marks); left; left &= left - 1)
        job->again[count++] = k + (size_t)__builtin_ctz(left);
    return count;
}

#define DRAW_LOOP(sampler, ndf)                                                                    \
    static size_t draw_##sampler##_##ndf(const struct kernel_surface *surface,                     \
                                         const struct kernel_job *job, size_t n)                   \
    {                                                                                              \
        const struct kernel_surface s = *surface;                                                  \
        size_t count = 0;                                                                          \
        for (size_t k = 0; k < n; k += LANES) {                                                    \
            mask marks = draw(FACET_SAMPLER_##sampler, FACET_##ndf, &s, job, k);                   \
            if (MARKS_DRAWS) count = note_marked(job, count, marks, k);                            \
        }                                                                                          \
        return count;                                                                              \
    }

DRAW_LOOP(CAPS, GGX)
DRAW_LOOP(BOUNDED, GGX)
DRAW_LOOP(NDF, GGX)
DRAW_LOOP(NDF, BECKMANN)
DRAW_LOOP(SLOPE, GGX)
DRAW_LOOP(SLOPE, BECKMANN)
DRAW_LOOP(VCAVITY, GGX)
DRAW_LOOP(VCAVITY, BECKMANN)

/* Whatever the surface. */
static size_t draw_COSINE(const struct kernel_surface *surface, const struct kernel_job *job,
                          size_t n)
{
    (void)surface;
    for (size_t k = 0; k < n; k += LANES) {
        struct vec3 wo = load_vec3(job->wo, k);
        struct uniform u = load_uniform(job, 0, k);
        struct sin_cos turn = sin_cos_turns(load_uniform(job, 1, k).u);
        real radius = root_from_zero(u.u), up = root_from_zero(u.rest);
        struct vec3 wi = {radius * turn.cos, radius * turn.sin, up};
        store_vec3(job->sampled_wi, k, wi);
        if (job->sampled_pdf) store_at(job->sampled_pdf, k, up * R(ONE_OVER_PI));
        if (!job->sampled_h[0]) continue;
        struct vec3 h = {wi.x + wo.x, wi.y + wo.y, wi.z + wo.z};
        real hh = madd(h.x, h.x, madd(h.y, h.y, h.z * h.z)),
             inverse = rsqrt(real_max(hh, splat(REAL_MIN)));
        mask none = less(hh,
                         splat(REAL_IS_FLOAT ? R(1e-30) : R(1e-280))); /* wi = -wo: any h will do */
        store_vec3(job->sampled_h, k,
                   (struct vec3){select(none, splat(0), h.x * inverse),
                                 select(none, splat(0), h.y * inverse),
                                 select(none, splat(1), h.z * inverse)});
    }
    return 0;
}

/* ---- densities ------------------------------------------------------------------------------ */

/* C . z + K c < 0 of the C that makes h, times r mm / (1 - K): (k.m) m_z < A^2 c mm / w. */
INLINE mask below_cap(struct model m, const struct kernel_surface *s, struct cap cap,
                      const struct terms *t)
{
    struct vec3 wo = t->given.wo;
    struct half h = t->h;
    /* k.m = wo.h; x and y are those of H itself where isotropic. */
    real seen = m.shape == KERNEL_ISO ? madd(wo.x, h.x, madd(wo.y, h.y, wo.z * h.hz))
                                      : madd(t->o.a, h.x, madd(t->o.b, h.y, t->o.c * h.z));
    real lowest = R(s->cap_a2) * real_max(t->o.c, splat(0)) * standard_square(m.shape, h);
    return less(seen * h.hz * cap.whole, lowest);
}

INLINE real pdf_bounded(struct model m, const struct kernel_surface *s, const struct terms *t)
{
    struct cap cap = cap_of(s, t->given.wo);
    struct fraction d = density(m, s, t->h), area = cap_area(cap, t->o);
    real value = saturated(quotient(d.num * area.den, d.den * real_max(area.num, splat(REAL_MIN))));
    /* What is above the horizon is never cut, however its last digits fall; mostly all of it is. */
    mask below = (mask)~less(splat(0), t->i.z);
    if (any(below)) value = select((mask)(below & below_cap(m, s, cap, t)), splat(0), value);
    return facing_up(t->h, value);
}

/* D |h_z| / (4 |wo.h|) = D |H_z| / (2 |H|^2), h turned up. */
INLINE real pdf_ndf(struct model m, const struct kernel_surface *s, const struct terms *t)
{
    real facing_ = real_abs(facing(t->h));
    real value = saturated(R(0.5) * saturated(facing_) * value_of(density(m, s, t->h)));
    return select(less(splat(0), facing_), value, splat(0));
}

/*
 * G1 <wo, h> D / (4 |wo.h| c) = D min(1/(4 c), H_z/|H|^2): of the twins one is seen, or both.
 * Behind the mean facet never both; where neither is, h was kept as it was drawn.
 */
INLINE real pdf_vcavity(struct model m, const struct kernel_surface *s, const struct terms *t)
{
    real facing_ = facing(t->h), c4 = 4 * t->o.c, size = saturated(real_abs(facing_));
    real seen = select(less(c4 * size, splat(1)), size,
                       quotient(splat(1), real_max(c4, splat(REAL_MIN))));
    real unseen = select(less(c4 * size, splat(-1)), R(0.5) * size, splat(0));
    real value = saturated(select(less(splat(0), facing_), seen, unseen) *
                           saturated(value_of(density(m, s, t->h))));
    return select(less(splat(0), size), value, splat(0));
}

INLINE real pdf_cosine(struct model m, const struct kernel_surface *s, const struct terms *t)
{
    (void)m, (void)s;
    return R(ONE_OVER_PI) * real_max(t->i.z, splat(0));
}

/* fr cos theta_i / (F pdf), D gone. */
INLINE real weight_bounded(struct model m, const struct kernel_surface *s, const struct terms *t)
{
    struct fraction f = reflect(m, s, t->i, t->o, t->h, false),
                    area = cap_area(cap_of(s, t->given.wo), t->o);
    return lit(t->i, t->o, ratio(area.num * f.num, area.den * f.den));
}

INLINE real weight_ndf(struct model m, const struct kernel_surface *s, const struct terms *t)
{
    bool scaled = needs_scaling(m);
    struct fraction f = reflect(m, s, t->i, t->o, t->h, scaled);
    real value = saturated(2 * ratio(ratio(f.num, f.den), facing(t->h)));
    return lit(t->i, t->o, scaled ? unscale(m, t->o, value) : value);
}

INLINE real weight_vcavity(struct model m, const struct kernel_surface *s, const struct terms *t)
{
    bool scaled = needs_scaling(m);
    struct fraction f = reflect(m, s, t->i, t->o, t->h, scaled);
    real single = quotient(splat(1), real_max(facing(t->h), splat(REAL_MIN)));
    real value = saturated(ratio(f.num, f.den) * real_max(4 * t->o.c, single));
    return lit(t->i, t->o, scaled ? unscale(m, t->o, value) : value);
}

INLINE real weight_cosine(struct model m, const struct kernel_surface *s, const struct terms *t)
{
    return saturated(quantity_fr(m, s, t->i, t->o, t->h) * R(1 / ONE_OVER_PI));
}

#define PDF_OF(function)                                                                           \
    {                                                                                              \
        scale = 1;                                                                                 \
        real value = function(m, &s, &t);                                                          \
        STORE_MARKED(PDF)                                                                          \
    }
#define PDF_LOOP(sampler, function, ndf, shape)                                                    \
    LOOP(pdf_##sampler##_##ndf##_##shape, ndf, shape, KERNEL_SMITH, (void)0, PDF_OF(function))
#define JOINT_LOOP(sampler, function, ndf, shape)                                                  \
    LOOP(fr_pdf_##sampler##_##ndf##_##shape, ndf, shape, KERNEL_SMITH, (void)0,                    \
         ONE_QUANTITY(FR) PDF_OF(function))
#define WEIGHT_LOOP(sampler, function, ndf, shape, masking)                                        \
    LOOP(weight_##sampler##_##ndf##_##masking, ndf, shape, KERNEL_##masking, (void)0, {            \
        real value = function(m, &s, &t);                                                          \
        STORE_MARKED(WEIGHT)                                                                       \
    })
#define ANY_WEIGHT_LOOP(sampler, function, ndf, shape)                                             \
    LOOP(weight_##sampler##_##ndf##_ANY, ndf, shape, job->masking, (void)0, {                      \
        real value = function(m, &s, &t);                                                          \
        STORE_MARKED(WEIGHT)                                                                       \
    })
#include "samplers.def"
#undef PDF_LOOP
#undef JOINT_LOOP
#undef WEIGHT_LOOP
#undef ANY_WEIGHT_LOOP

/* ---- the table ------------------------------------------------------------------------------- */

extern const struct facet_samplers TABLE_NAME(samplers, FACET_TIER, FACET_IO, FACET_ISA);
const struct facet_samplers TABLE_NAME(samplers, FACET_TIER, FACET_IO, FACET_ISA) = {
    .draw =
        {
            [FACET_GGX] = {[FACET_SAMPLER_CAPS] = draw_CAPS_GGX,
                           [FACET_SAMPLER_BOUNDED] = draw_BOUNDED_GGX,
                           [FACET_SAMPLER_SLOPE] = draw_SLOPE_GGX,
                           [FACET_SAMPLER_NDF] = draw_NDF_GGX,
                           [FACET_SAMPLER_COSINE] = draw_COSINE,
                           [FACET_SAMPLER_VCAVITY] = draw_VCAVITY_GGX},
            [FACET_BECKMANN] =
                {
                    [FACET_SAMPLER_NDF] = draw_NDF_BECKMANN,
                    [FACET_SAMPLER_COSINE] = draw_COSINE,
                    [FACET_SAMPLER_SLOPE] = draw_SLOPE_BECKMANN,
                    [FACET_SAMPLER_VCAVITY] = draw_VCAVITY_BECKMANN,
                },
            [FACET_TABULATED] = {[FACET_SAMPLER_COSINE] =
                                     draw_COSINE}, /* the others: table_sample.c */
        },
#define PDF_LOOP(sampler, function, ndf, shape)                                                    \
    .pdf[FACET_##ndf][FACET_SAMPLER_##sampler][KERNEL_##shape] = pdf_##sampler##_##ndf##_##shape,
#define JOINT_LOOP(sampler, function, ndf, shape)                                                  \
    .fr_pdf[FACET_##ndf][FACET_SAMPLER_##sampler][KERNEL_##shape] =                                \
        fr_pdf_##sampler##_##ndf##_##shape,
#define WEIGHT_LOOP(sampler, function, ndf, shape, masking)                                        \
    .weight[FACET_##ndf][FACET_SAMPLER_##sampler][KERNEL_##masking] =                              \
        weight_##sampler##_##ndf##_##masking,
#define ANY_WEIGHT_LOOP(sampler, function, ndf, shape)                                             \
    .weight[FACET_##ndf][FACET_SAMPLER_##sampler][KERNEL_SMITH] = weight_##sampler##_##ndf##_ANY,
#include "samplers.def"
};
