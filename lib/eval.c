/*
 * eval.c - batches: one kernel loop per quantity asked for, in blocks that stay
 * in the first-level cache, colour applied last.
 */
#include "brdf.h"
#include "dispatch.h"

#include <math.h>

enum { BLOCK = 512 };

static kernel_eval_fn *find_loop(const facet_brdf *b, const struct facet_kernels *kernels,
                                 enum kernel_quantity quantity)
{
    if (b->material.ndf == FACET_TABULATED) kernels = kernels->base;
    kernel_eval_fn *const(*shapes)[KERNEL_MASKING_COUNT] = kernels->eval[quantity][b->material.ndf];
    kernel_eval_fn *loop = shapes[b->shape][b->masking];
    if (!loop) loop = shapes[KERNEL_SHEARED][b->masking];
    /* What does not depend on masking is filed under SMITH. */
    if (!loop) loop = shapes[b->shape][KERNEL_SMITH];
    return loop ? loop : shapes[KERNEL_SHEARED][KERNEL_SMITH];
}

static const int kernel_quantity_of[FACET_QUANTITY_COUNT] = {
    [FACET_FR] = KERNEL_FR,     [FACET_FR_COS] = KERNEL_FR_COS, [FACET_PDF] = KERNEL_PDF,
    [FACET_D] = KERNEL_D,       [FACET_D_VIS] = KERNEL_D_VIS,   [FACET_G] = KERNEL_G,
    [FACET_G1_I] = KERNEL_G1_I, [FACET_G1_O] = KERNEL_G1_O,     [FACET_F] = -1,
    [FACET_SIGMA_O] = KERNEL_SIGMA_O,
};

static bool is_coloured(facet_quantity quantity)
{
    static const bool coloured[FACET_QUANTITY_COUNT] = {
#define QUANTITY(id, name, coloured, doc) [FACET_##id] = coloured,
#include "quantities.def"
#undef QUANTITY
    };
    return coloured[quantity];
}

struct block {
    const facet_brdf *brdf;
    const struct facet_kernels *kernels;
    struct kernel_pairs pairs;
    size_t n;
    bool has_angle;
    double angle[BLOCK], angle_low[BLOCK], scalar[BLOCK];
};

/* Computed once per block, if at all. */
static const double *angle_of(struct block *k)
{
    if (!k->has_angle) {
        k->kernels->angle[k->brdf->material.fresnel.kind](&k->pairs, k->n, k->angle, k->angle_low);
        k->has_angle = true;
    }
    return k->angle;
}

/* out[c] = F_c factor for every channel; factor NULL is 1. */
static void colour(struct block *k, const double *factor, double *const out[3], size_t offset)
{
    const facet_brdf *b = k->brdf;
    kernel_fresnel_fn *fresnel = k->kernels->fresnel[b->material.fresnel.kind];
    for (size_t c = 0; c < b->channels; c++) {
        if (!out[c]) continue;
        if (fresnel) {
            fresnel(&b->fresnel[c], angle_of(k), k->angle_low, factor, k->n, out[c] + offset);
        } else {
            for (size_t i = 0; i < k->n; i++) out[c][offset + i] = factor ? factor[i] : 1;
        }
    }
}

static bool achromatic_ideal(const facet_brdf *b)
{
    return b->material.fresnel.kind == FACET_FRESNEL_IDEAL && b->channels == 1;
}

static void eval_quantity(struct block *k, facet_quantity q, double *const out[3], size_t offset)
{
    if (q == FACET_F) {
        colour(k, NULL, out, offset);
        return;
    }
    kernel_eval_fn *loop = find_loop(k->brdf, k->kernels, (enum kernel_quantity)kernel_quantity_of[q]);
    if (!is_coloured(q) || achromatic_ideal(k->brdf)) {
        loop(&k->brdf->surface, &k->pairs, k->n, out[0] + offset);
        return;
    }
    loop(&k->brdf->surface, &k->pairs, k->n, k->scalar);
    colour(k, k->scalar, out, offset);
}

static facet_vec3_in shift(facet_vec3_in v, size_t offset)
{
    return (facet_vec3_in){ v.x + offset, v.y + offset, v.z + offset };
}

static void eval_block(struct block *k, const facet_outputs *outputs, size_t offset)
{
    k->has_angle = false;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (outputs->of[q][0]) eval_quantity(k, (facet_quantity)q, outputs->of[q], offset);
}

/*
 * Floats lose products of cosines below the first and powers of |H| below the
 * second: such pairs are done again by the precise kernels, so that the promise
 * of FAST holds for every direction.
 */
#define FAST_COSINE_MIN 0x1p-28
#define FAST_HALF_MIN 0x1p-20

static int grazes(double zi, double zo)
{
    return ((fabs(zi) < FAST_COSINE_MIN) & (zi != 0)) | ((fabs(zo) < FAST_COSINE_MIN) & (zo != 0)) |
           (fabs(zi + zo) < FAST_HALF_MIN);
}

static bool any_grazes(const struct kernel_pairs *pairs, size_t n)
{
    size_t count = 0;
    for (size_t i = 0; i < n; i++) count += grazes(pairs->wi.z[i], pairs->wo.z[i]);
    return count > 0;
}

typedef void block_fn(struct block *block, const facet_outputs *outputs, size_t offset);

/* One block in its tier; fast and grazing pairs once more. */
static void run_block(struct block *k, facet_tier tier, block_fn *run, const facet_outputs *outputs,
                      size_t offset)
{
    if (!k->brdf->floats_hold) tier = FACET_PRECISE;
    k->kernels = facet_kernels_for(tier);
    run(k, outputs, offset);
    if (tier != FACET_FAST || !any_grazes(&k->pairs, k->n)) return;
    const struct kernel_pairs pairs = k->pairs;
    const size_t n = k->n;
    k->kernels = facet_kernels_for(FACET_PRECISE);
    k->n = 1;
    for (size_t i = 0; i < n; i++) {
        if (!grazes(pairs.wi.z[i], pairs.wo.z[i])) continue;
        k->pairs = (struct kernel_pairs){ shift(pairs.wi, i), shift(pairs.wo, i) };
        run(k, outputs, offset + i);
    }
}

facet_status facet_eval(const facet_brdf *brdf, facet_tier tier, facet_vec3_in wi, facet_vec3_in wo,
                        size_t n, const facet_outputs *outputs)
{
    if ((unsigned)tier >= FACET_TIER_COUNT) return FACET_UNSUPPORTED;
    struct block k;
    k.brdf = brdf;
    for (size_t start = 0; start < n; start += BLOCK) {
        k.n = n - start < BLOCK ? n - start : BLOCK;
        k.pairs = (struct kernel_pairs){ shift(wi, start), shift(wo, start) };
        run_block(&k, tier, eval_block, outputs, start);
    }
    return FACET_OK;
}

facet_status facet_condition(const facet_brdf *brdf, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                             double *condition)
{
    *condition = 1;
    if (brdf->masking != KERNEL_SMITH_THESIS && brdf->masking != KERNEL_UNCORRELATED_THESIS) return FACET_OK;
    const struct facet_kernels *kernels = facet_kernels_for(FACET_PRECISE);
    kernel_eval_fn *loop = find_loop(brdf, kernels, KERNEL_CONDITION);
    double out[BLOCK];
    for (size_t start = 0; start < n; start += BLOCK) {
        size_t size = n - start < BLOCK ? n - start : BLOCK;
        struct kernel_pairs pairs = { shift(wi, start), shift(wo, start) };
        loop(&brdf->surface, &pairs, size, out);
        for (size_t i = 0; i < size; i++) *condition = fmax(*condition, out[i]);
    }
    return FACET_OK;
}

double facet_closeness(const facet_brdf *brdf, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                       bool exact_z)
{
    const struct kernel_surface *s = &brdf->surface;
    bool leans = brdf->shape == KERNEL_SHEARED;
    double least = 1;
    for (size_t i = 0; i < n; i++) {
        double x = wi.x[i] + wo.x[i], y = wi.y[i] + wo.y[i], z = wi.z[i] + wo.z[i];
        double ci = wi.z[i] - wi.x[i] * s->slope_x - wi.y[i] * s->slope_y;
        double co = wo.z[i] - wo.x[i] * s->slope_x - wo.y[i] * s->slope_y;
        least = fmin(least, sqrt(x * x + y * y + z * z));
        if (leans || !exact_z) least = fmin(least, fmin(fabs(ci), fabs(co)));
        if (!exact_z) least = fmin(least, fmin(fabs(wi.z[i]), fabs(wo.z[i])));
        if (!exact_z || wi.z[i] * wo.z[i] < 0) least = fmin(least, fabs(z));
    }
    return least > 0 ? 1 / least : INFINITY;
}

/*
 * outputs->of[FACET_FR] holds the weights.  The weight is that of the wi handed
 * out: whoever evaluates there finds the same number.
 */
static void weigh_block(struct block *k, const facet_outputs *outputs, size_t offset)
{
    double *const *weight = outputs->of[FACET_FR];
    k->has_angle = false;
    kernel_eval_fn *loop = find_loop(k->brdf, k->kernels, KERNEL_WEIGHT);
    if (achromatic_ideal(k->brdf)) {
        loop(&k->brdf->surface, &k->pairs, k->n, weight[0] + offset);
        return;
    }
    loop(&k->brdf->surface, &k->pairs, k->n, k->scalar);
    colour(k, k->scalar, weight, offset);
}

/* NULL: this ndf has no sampler.  One that a tier does not have runs in the next. */
static kernel_sample_fn *sample_loop(const facet_brdf *b, facet_tier tier)
{
    kernel_sample_fn *loop = NULL;
    if (!b->floats_hold) tier = FACET_PRECISE;
    for (int t = (int)tier; !loop && t < FACET_TIER_COUNT; t++)
        loop = facet_kernels_for((facet_tier)t)->sample[b->material.ndf];
    return loop;
}

/* Where the samples of one block go; what nobody asked for but the loop writes goes to scratch. */
static void draw(struct block *k, facet_tier tier, kernel_sample_fn *sample, const double *u1,
                 const double *u2, const facet_samples *out, size_t offset)
{
    double scratch[4][BLOCK];
    facet_vec3_out wi = { out->wi.x + offset, out->wi.y + offset, out->wi.z + offset };
    facet_vec3_out h = { scratch[0], scratch[1], scratch[2] };
    double *pdf = out->pdf ? out->pdf + offset : out->h.x ? scratch[3] : NULL;
    if (out->h.x) h = (facet_vec3_out){ out->h.x + offset, out->h.y + offset, out->h.z + offset };
    sample(&k->brdf->surface, k->pairs.wo, u1 + offset, u2 + offset, k->n, wi, h, pdf);
    if (!out->weight[0]) return;
    facet_outputs weights = { .of[FACET_FR] = { out->weight[0], out->weight[1], out->weight[2] } };
    k->pairs.wi = (facet_vec3_in){ wi.x, wi.y, wi.z };
    run_block(k, tier, weigh_block, &weights, offset);
}

facet_status facet_sample(const facet_brdf *brdf, facet_tier tier, facet_vec3_in wo, const double *u1,
                          const double *u2, size_t n, const facet_samples *out)
{
    if ((unsigned)tier >= FACET_TIER_COUNT) return FACET_UNSUPPORTED;
    struct block k;
    k.brdf = brdf;
    kernel_sample_fn *sample = sample_loop(brdf, tier);
    if (!sample) return FACET_UNSUPPORTED;
    for (size_t start = 0; start < n; start += BLOCK) {
        k.n = n - start < BLOCK ? n - start : BLOCK;
        k.pairs.wo = shift(wo, start);
        draw(&k, tier, sample, u1, u2, out, start);
    }
    return FACET_OK;
}
