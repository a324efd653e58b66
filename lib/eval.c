/*
 * eval.c - batches of evaluations: one kernel loop per quantity asked for, in
 * blocks; whole vectors of the kernels' own type in place, the rest converted;
 * strays once more in precise.
 */
#include "batch.h"
#include "slope_table.h"
#include "table_closed.h"

#include <math.h>

/* The loops of one tier for one type of arrays. */
struct loops {
    const struct facet_kernels *kernels;
    const struct facet_samplers *samplers;
};

static kernel_eval_fn *find_sampler_loop(const struct batch *batch,
                                         const struct facet_samplers *samplers,
                                         enum kernel_quantity quantity)
{
    const facet_brdf *b = batch->brdf;
    facet_ndf ndf = b->material.ndf;
    if (quantity == KERNEL_PDF) {
        kernel_eval_fn *const *shapes = samplers->pdf[ndf][batch->sampler];
        return shapes[b->shape] ? shapes[b->shape] : shapes[KERNEL_SHEARED];
    }
    kernel_eval_fn *const *weights = samplers->weight[ndf][batch->sampler];
    return weights[b->masking] ? weights[b->masking] : weights[KERNEL_SMITH]; /* which serves any */
}

/* A shape that has no loop of its own is served by that of the next, which is more general. */
static kernel_eval_fn *for_shape(kernel_eval_fn *const (*shapes)[KERNEL_MASKING_COUNT],
                                 enum kernel_shape shape, enum kernel_masking masking)
{
    int s = (int)shape;
    while (s < KERNEL_SHEARED && !shapes[s][masking]) s++;
    return shapes[s][masking];
}

static kernel_eval_fn *find_loop(const struct batch *batch, const struct loops *loops,
                                 enum kernel_quantity quantity)
{
    const facet_brdf *b = batch->brdf;
    const struct facet_kernels *kernels = loops->kernels;
    if (batch->sampler != FACET_SAMPLER_AUTO &&
        (quantity == KERNEL_PDF || quantity == KERNEL_WEIGHT))
        return find_sampler_loop(batch, loops->samplers, quantity);
    if (quantity == KERNEL_FR && b->masking == KERNEL_SMITH && b->channels == 1) {
        kernel_eval_fn
            *own = kernels->fr_achromatic[b->material.ndf][b->shape][b->material.fresnel.kind];
        if (own) return own;
    }
    if (quantity == KERNEL_F) return kernels->eval[KERNEL_F][FACET_GGX][KERNEL_ISO][KERNEL_SMITH];
    kernel_eval_fn *const(*shapes)[KERNEL_MASKING_COUNT] = kernels->eval[quantity][b->material.ndf];
    kernel_eval_fn *own = for_shape(shapes, b->shape, b->masking);
    /* What does not depend on masking, or takes it as it is, is filed under SMITH. */
    return own ? own : for_shape(shapes, b->shape, KERNEL_SMITH);
}

static size_t columns_of(const facet_brdf *b, int quantity)
{
    static const bool coloured[KERNEL_QUANTITY_COUNT] = {
#define QUANTITY(id, name, coloured, doc) [KERNEL_##id] = coloured,
#include "quantities.def"
#undef QUANTITY
        [KERNEL_WEIGHT] = true,
    };
    return coloured[quantity] ? b->channels : 1;
}

static struct kernel_job job_of(const facet_brdf *b)
{
    return (struct kernel_job){.masking = b->masking,
                               .kind = b->material.fresnel.kind,
                               .channels = b->channels,
                               .fresnel = b->fresnel};
}

/* Elements start .. start + n - 1 of a quantity: those without a number again, in precise. */
static void redo_strays(const struct batch *batch, int quantity, size_t start, size_t n);

/* Runs one quantity over n (whole vectors) and says whether there were strays. */
static bool run(const struct batch *batch, const struct loops *loops, const struct kernel_job *job,
                int quantity, size_t n)
{
    return find_loop(batch, loops, (enum kernel_quantity)quantity)(&batch->brdf->surface, job, n);
}

/* fr and pdf in one pass: what a renderer asks for. */
static kernel_eval_fn *joint_loop(const struct batch *batch, const struct loops *loops)
{
    const facet_brdf *b = batch->brdf;
    if (!batch->out[KERNEL_FR][0].data || !batch->out[KERNEL_PDF][0].data ||
        b->masking != KERNEL_SMITH)
        return NULL;
    if (batch->sampler != FACET_SAMPLER_AUTO)
        return loops->samplers->fr_pdf[b->material.ndf][batch->sampler][b->shape];
    return loops->kernels->fr_pdf[b->material.ndf][b->shape];
}

/* The quantities asked for. */
struct wanted {
    int count, quantity[KERNEL_QUANTITY_COUNT];
};

static struct wanted wanted_of(const struct batch *batch)
{
    struct wanted w = {.count = 0};
    for (int q = 0; q < KERNEL_QUANTITY_COUNT; q++)
        if (batch->out[q][0].data) w.quantity[w.count++] = q;
    return w;
}

/* A block of whole vectors in the kernels' own type. */
static void run_in_place(const struct batch *batch, const struct loops *loops,
                         const struct wanted *wanted, size_t start, size_t n)
{
    struct kernel_job job = job_of(batch->brdf);
    for (int j = 0; j < 3; j++) {
        job.wi[j] = facet_array_at(batch->wi[j], start).data;
        job.wo[j] = facet_array_at(batch->wo[j], start).data;
    }
    for (int i = 0; i < wanted->count; i++)
        for (int c = 0; c < 3; c++)
            job.out[wanted->quantity[i]][c] =
                facet_array_at(batch->out[wanted->quantity[i]][c], start).data;
    kernel_eval_fn *joint = wanted->count > 1 ? joint_loop(batch, loops) : NULL;
    if (joint && joint(&batch->brdf->surface, &job, n)) {
        redo_strays(batch, KERNEL_FR, start, n);
        redo_strays(batch, KERNEL_PDF, start, n);
    }
    for (int i = 0; i < wanted->count; i++) {
        int q = wanted->quantity[i];
        if (joint && (q == KERNEL_FR || q == KERNEL_PDF)) continue;
        if (run(batch, loops, &job, q, n)) redo_strays(batch, q, start, n);
    }
}

/* A block of any length, through arrays of the kernels' type. */
static void run_staged(const struct batch *batch, const struct loops *loops, enum kernel_io io,
                       size_t start, size_t n)
{
    double in[6][BLOCK], results[3][BLOCK];
    struct kernel_job job = job_of(batch->brdf);
    for (int j = 0; j < 3; j++) { /* padding: both directions at the pole */
        job.wi[j] = facet_stage(facet_array_at(batch->wi[j], start), io, n, j == 2, in[j]);
        job.wo[j] = facet_stage(facet_array_at(batch->wo[j], start), io, n, j == 2, in[3 + j]);
    }
    for (int q = 0; q < KERNEL_QUANTITY_COUNT; q++) {
        if (!batch->out[q][0].data) continue;
        for (int c = 0; c < 3; c++) job.out[q][c] = batch->out[q][c].data ? results[c] : NULL;
        bool strays = run(batch, loops, &job, q, facet_padded(n));
        for (size_t c = 0; c < columns_of(batch->brdf, q); c++)
            facet_unstage(results[c], io, n, facet_array_at(batch->out[q][c], start));
        if (strays) redo_strays(batch, q, start, n);
    }
}

facet_tier facet_served_tier(const facet_brdf *b, facet_tier tier)
{
    return b->material.ndf == FACET_TABULATED && tier == FACET_DRAFT ? FACET_FAST : tier;
}

facet_tier facet_batch_tier(const facet_brdf *b, facet_tier tier)
{
    bool floats = b->floats_hold;
    tier = facet_served_tier(b, tier);
    if (floats && tier < FACET_EXACT32 && b->material.ndf == FACET_TABULATED)
        floats = facet_slope_table_has_floats(b->material.table);
    return tier < FACET_EXACT32 && !floats ? FACET_EXACT32 : tier;
}

/* The table has a density and no more. */
static void run_with_table(const struct batch *batch, size_t n)
{
    struct batch rest = *batch;
    if (batch->out[KERNEL_PDF][0].data || batch->out[KERNEL_WEIGHT][0].data)
        facet_table_weigh(batch, n);
    rest.sampler = FACET_SAMPLER_AUTO;
    for (int c = 0; c < 3; c++)
        rest.out[KERNEL_PDF][c].data = rest.out[KERNEL_WEIGHT][c].data = NULL;
    if (wanted_of(&rest).count) facet_batch_run(&rest, n);
}

void facet_batch_run(const struct batch *batch, size_t n)
{
    enum kernel_io io;
    if (batch->sampler == FACET_SAMPLER_TABLE) {
        run_with_table(batch, n);
        return;
    }
    facet_tier tier = facet_batch_tier(batch->brdf, batch->tier);
    struct loops loops = {.kernels = facet_kernels_nearest(tier, batch->wi[0].io, &io)};
    loops.samplers = facet_samplers_for(tier, io);
    const struct wanted wanted = wanted_of(batch);
    /* What is read once need not be in the first-level cache to be read again. */
    const size_t most = wanted.count == 1 ? LONG_BLOCK : BLOCK;
    for (size_t start = 0; start < n;) {
        size_t size = n - start < most ? n - start : most;
        if (io == batch->wi[0].io && size >= KERNEL_LANES) {
            size -= size % KERNEL_LANES;
            run_in_place(batch, &loops, &wanted, start, size);
        } else {
            size = size < BLOCK ? size : BLOCK;
            run_staged(batch, &loops, io, start, size);
        }
        start += size;
    }
}

static bool any_nan(const float *f, const double *d, size_t n)
{
    bool any = false;
    for (size_t k = 0; f && k < n; k++) any |= f[k] != f[k];
    for (size_t k = 0; d && k < n; k++) any |= d[k] != d[k];
    return any;
}

/* Where of n <= BLOCK elements there is no number; how many. */
static size_t find_nans(struct array a, size_t n, size_t at[BLOCK])
{
    size_t count = 0;
    for (size_t k = 0, size; k < n; k += size) {
        size = n - k < KERNEL_LANES ? n - k : KERNEL_LANES;
        const struct array part = facet_array_at(a, k);
        if (!any_nan(a.io == KERNEL_FLOAT ? part.data : NULL,
                     a.io == KERNEL_FLOAT ? NULL : part.data, size))
            continue;
        for (size_t j = 0; j < size; j++)
            if (isnan(facet_array_get(part, j))) at[count++] = k + j;
    }
    return count;
}

/* One stray after the other into arrays of doubles, and their results back; n <= BLOCK. */
static void redo_block(const struct batch *batch, int quantity, size_t start, size_t n)
{
    double in[6][BLOCK], out[3][BLOCK];
    size_t at[BLOCK];
    const struct array *columns = batch->out[quantity];
    /* A stray is one in every channel. */
    size_t count = find_nans(facet_array_at(columns[0], start), n, at);
    for (size_t i = 0; i < count; i++) {
        at[i] += start;
        for (int j = 0; j < 3; j++) {
            in[j][i] = facet_array_get(batch->wi[j], at[i]);
            in[3 + j][i] = facet_array_get(batch->wo[j], at[i]);
        }
    }
    struct batch again = {.brdf = batch->brdf, .tier = FACET_PRECISE, .sampler = batch->sampler};
    for (int j = 0; j < 3; j++) {
        again.wi[j] = (struct array){in[j], KERNEL_DOUBLE};
        again.wo[j] = (struct array){in[3 + j], KERNEL_DOUBLE};
        if (columns[j].data) again.out[quantity][j] = (struct array){out[j], KERNEL_DOUBLE};
    }
    if (count) facet_batch_run(&again, count);
    for (int c = 0; c < 3; c++)
        for (size_t k = 0; columns[c].data && k < count; k++)
            facet_array_put(columns[c], at[k], out[c][k]);
}

static void redo_strays(const struct batch *batch, int quantity, size_t start, size_t n)
{
    for (size_t end = start + n, size; start < end; start += size) {
        size = end - start < BLOCK ? end - start : BLOCK;
        redo_block(batch, quantity, start, size);
    }
}

static struct batch batch_of_doubles(const facet_brdf *brdf, facet_tier tier, facet_vec3_in wi,
                                     facet_vec3_in wo, const facet_outputs *outputs)
{
    struct batch batch = {.brdf = brdf,
                          .tier = tier,
                          .wi = {facet_doubles(wi.x), facet_doubles(wi.y), facet_doubles(wi.z)},
                          .wo = {facet_doubles(wo.x), facet_doubles(wo.y), facet_doubles(wo.z)}};
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (int c = 0; c < 3; c++) batch.out[q][c] = facet_doubles(outputs->of[q][c]);
    return batch;
}

static struct batch batch_of_floats(const facet_brdf *brdf, facet_tier tier, facet_vec3_in_float wi,
                                    facet_vec3_in_float wo, const facet_outputs_float *outputs)
{
    struct batch batch = {.brdf = brdf,
                          .tier = tier,
                          .wi = {facet_floats(wi.x), facet_floats(wi.y), facet_floats(wi.z)},
                          .wo = {facet_floats(wo.x), facet_floats(wo.y), facet_floats(wo.z)}};
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (int c = 0; c < 3; c++) batch.out[q][c] = facet_floats(outputs->of[q][c]);
    return batch;
}

static facet_status evaluate(const struct batch *batch, size_t n)
{
    if ((unsigned)batch->tier >= FACET_TIER_COUNT) return FACET_UNSUPPORTED;
    facet_batch_run(batch, n);
    return FACET_OK;
}

facet_status facet_eval(const facet_brdf *brdf, facet_tier tier, facet_vec3_in wi, facet_vec3_in wo,
                        size_t n, const facet_outputs *outputs)
{
    const struct batch batch = batch_of_doubles(brdf, tier, wi, wo, outputs);
    return evaluate(&batch, n);
}

facet_status facet_eval_float(const facet_brdf *brdf, facet_tier tier, facet_vec3_in_float wi,
                              facet_vec3_in_float wo, size_t n, const facet_outputs_float *outputs)
{
    const struct batch batch = batch_of_floats(brdf, tier, wi, wo, outputs);
    return evaluate(&batch, n);
}

static facet_status evaluate_sampled(struct batch *batch, facet_sampler sampler, size_t n)
{
    facet_status status = facet_batch_sampler(batch->brdf, sampler, &batch->sampler);
    return status ? status : evaluate(batch, n);
}

facet_status facet_eval_sampled(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                                facet_vec3_in wi, facet_vec3_in wo, size_t n,
                                const facet_outputs *outputs)
{
    struct batch batch = batch_of_doubles(brdf, tier, wi, wo, outputs);
    return evaluate_sampled(&batch, sampler, n);
}

facet_status facet_eval_sampled_float(const facet_brdf *brdf, facet_tier tier,
                                      facet_sampler sampler, facet_vec3_in_float wi,
                                      facet_vec3_in_float wo, size_t n,
                                      const facet_outputs_float *outputs)
{
    struct batch batch = batch_of_floats(brdf, tier, wi, wo, outputs);
    return evaluate_sampled(&batch, sampler, n);
}
