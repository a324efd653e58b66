/*
 * kernel.c - the batch loops, compiled once per (tier, isa).
 *
 * Each loop computes one quantity for one model; what the model lacks (shear,
 * correlation, masking) is gone by constant folding.  A quantity that nobody
 * asked for has no loop running.
 */
#include "kernels.h"

#include "fresnel.h"
#include "masking.h"
#include "sample.h"

#define PASTE(a, b, c, d) a##b##c##d
#define TABLE_NAME(tier, isa) PASTE(facet_kernels_, tier, _, isa)

/* ---- quantities ------------------------------------------------------------------ */

#define EVAL_LOOP(quantity, ndf_, shape_, masking_)                                             \
    static void quantity##_##ndf_##_##shape_##_##masking_(                                      \
        const struct kernel_surface *surface, const struct kernel_pairs *p, size_t n,           \
        double *restrict out)                                                                   \
    {                                                                                           \
        const struct kernel_surface s = *surface;                                               \
        const struct model m = { FACET_##ndf_, KERNEL_##shape_, KERNEL_##masking_ };            \
        const double *restrict ix = p->wi.x, *restrict iy = p->wi.y, *restrict iz = p->wi.z;    \
        const double *restrict ox = p->wo.x, *restrict oy = p->wo.y, *restrict oz = p->wo.z;    \
        _Pragma("omp simd") for (size_t k = 0; k < n; k++)                                      \
        {                                                                                       \
            struct vec3 wi = { ix[k], iy[k], iz[k] }, wo = { ox[k], oy[k], oz[k] };             \
            struct direction i = direction_of(&s, m.shape, wi), o = direction_of(&s, m.shape, wo); \
            out[k] = (double)quantity(m, &s, i, o, half_of(&s, m.shape, wi, wo));               \
        }                                                                                       \
    }

#include "loops.def"
#undef EVAL_LOOP

/* ---- angles and Fresnel ------------------------------------------------------------- */

/* |H|^2/4 as a pair, from H with its rounding errors. */
INLINE pair cosine_squared(struct vec3 i, struct vec3 o)
{
    pair x = pair_sum(i.x, o.x), y = pair_sum(i.y, o.y), z = pair_sum(i.z, o.z);
    pair xx = pair_product(x.hi, x.hi, 2 * x.lo), yy = pair_product(y.hi, y.hi, 2 * y.lo);
    pair hh = pair_add(pair_add(xx, yy), pair_product(z.hi, z.hi, 2 * z.lo));
    return (pair){ 0.25 * hh.hi, 0.25 * hh.lo };
}

INLINE pair angle_squared(pair c2)
{
    return c2;
}

INLINE pair angle_cosine(pair c2)
{
    double c = __builtin_sqrt(c2.hi), rest = c2.hi - c * c - product_error(c, c, c * c) + c2.lo;
    return (pair){ c, rest / (2 * (c > DOUBLE_MIN ? c : DOUBLE_MIN)) };
}

/* 1 - c = (1 - c^2)/(1 + c): the difference cancels near the mirror direction. */
INLINE pair angle_versine(pair c2)
{
    return (pair){ ((1 - c2.hi) - c2.lo) / (1 + __builtin_sqrt(c2.hi)), 0 };
}

#define ANGLE_LOOP(name, has_low)                                                                   \
    static void loop_##name(const struct kernel_pairs *p, size_t n, double *restrict out,       \
                            double *restrict low)                                                   \
    {                                                                                           \
        const double *restrict ix = p->wi.x, *restrict iy = p->wi.y, *restrict iz = p->wi.z;    \
        const double *restrict ox = p->wo.x, *restrict oy = p->wo.y, *restrict oz = p->wo.z;    \
        _Pragma("omp simd") for (size_t k = 0; k < n; k++)                                      \
        {                                                                                       \
            struct vec3 i = { ix[k], iy[k], iz[k] }, o = { ox[k], oy[k], oz[k] };               \
            pair angle = angle_##name(cosine_squared(i, o));                                    \
            out[k] = angle.hi;                                                                  \
            if (has_low) low[k] = angle.lo;                                                     \
        }                                                                                       \
    }

ANGLE_LOOP(cosine, true)
ANGLE_LOOP(versine, false)
ANGLE_LOOP(squared, true)

#define FRESNEL_LOOP(name, pragma)                                                              \
    static void loop_##name(const struct kernel_fresnel *fresnel, const double *restrict angle, \
                            const double *restrict low, const double *restrict factor, size_t n, \
                            double *restrict out)                                               \
    {                                                                                           \
        const struct kernel_fresnel f = *fresnel;                                               \
        if (factor) {                                                                           \
            pragma for (size_t k = 0; k < n; k++)                                               \
                out[k] = (double)name(&f, (pair){ angle[k], low[k] }) * factor[k];              \
        } else {                                                                                \
            pragma for (size_t k = 0; k < n; k++)                                               \
                out[k] = (double)name(&f, (pair){ angle[k], low[k] });                          \
        }                                                                                       \
    }

FRESNEL_LOOP(fresnel_schlick, _Pragma("omp simd"))
FRESNEL_LOOP(fresnel_dielectric, _Pragma("omp simd"))
FRESNEL_LOOP(fresnel_conductor, _Pragma("omp simd"))
FRESNEL_LOOP(fresnel_table, )

/* ---- samples -------------------------------------------------------------------------- */

#define SAMPLE_LOOP(ndf, pragma)                                                                \
    static void sample_##ndf(const struct kernel_surface *surface, facet_vec3_in wo,            \
                             const double *restrict u1, const double *restrict u2, size_t n,    \
                             facet_vec3_out wi, facet_vec3_out h, double *restrict pdf)         \
    {                                                                                           \
        const struct kernel_surface s = *surface;                                               \
        const double *restrict ox = wo.x, *restrict oy = wo.y, *restrict oz = wo.z;             \
        double *restrict ix = wi.x, *restrict iy = wi.y, *restrict iz = wi.z;                   \
        double *restrict hx = h.x, *restrict hy = h.y, *restrict hz = h.z;                      \
        if (!pdf) {                                                                             \
            pragma for (size_t k = 0; k < n; k++)                                               \
            {                                                                                   \
                struct sampled a = SAMPLE_AT(ndf, k);                                           \
                ix[k] = (double)a.wi_x, iy[k] = (double)a.wi_y, iz[k] = (double)a.wi_z;         \
            }                                                                                   \
            return;                                                                             \
        }                                                                                       \
        pragma for (size_t k = 0; k < n; k++)                                                   \
        {                                                                                       \
            struct sampled a = SAMPLE_AT(ndf, k);                                               \
            ix[k] = (double)a.wi_x, iy[k] = (double)a.wi_y, iz[k] = (double)a.wi_z;             \
            hx[k] = (double)a.h_x, hy[k] = (double)a.h_y, hz[k] = (double)a.h_z;                \
            pdf[k] = (double)a.pdf;                                                             \
        }                                                                                       \
    }
#define SAMPLE_AT(ndf, k)                                                                       \
    reflect_sample(FACET_##ndf, &s, (struct vec3){ ox[k], oy[k], oz[k] }, u1[k], u2[k])

SAMPLE_LOOP(GGX, _Pragma("omp simd"))
#if !REAL_IS_FLOAT /* in floats 1 - u is lost where the CDF is inverted */
SAMPLE_LOOP(BECKMANN, )
#endif

/* ---- the table --------------------------------------------------------------------------- */

extern const struct facet_kernels TABLE_NAME(FACET_TIER, base);
extern const struct facet_kernels TABLE_NAME(FACET_TIER, FACET_ISA);
const struct facet_kernels TABLE_NAME(FACET_TIER, FACET_ISA) = {
    .base = &TABLE_NAME(FACET_TIER, base),
    .eval = {
#define EVAL_LOOP(quantity, ndf, shape, masking)                                                \
    [INDEX_##quantity][FACET_##ndf][KERNEL_##shape][KERNEL_##masking] = quantity##_##ndf##_##shape##_##masking,
#include "loops.def"
#undef EVAL_LOOP
    },
    .angle = {
        [FACET_FRESNEL_SCHLICK] = loop_versine,
        [FACET_FRESNEL_DIELECTRIC] = loop_squared,
        [FACET_FRESNEL_CONDUCTOR] = loop_squared,
        [FACET_FRESNEL_TABLE] = loop_cosine,
    },
    .fresnel = {
        [FACET_FRESNEL_SCHLICK] = loop_fresnel_schlick,
        [FACET_FRESNEL_DIELECTRIC] = loop_fresnel_dielectric,
        [FACET_FRESNEL_CONDUCTOR] = loop_fresnel_conductor,
        [FACET_FRESNEL_TABLE] = loop_fresnel_table,
    },
    .sample = {
        [FACET_GGX] = sample_GGX,
#if !REAL_IS_FLOAT
        [FACET_BECKMANN] = sample_BECKMANN,
#endif
    },
};
