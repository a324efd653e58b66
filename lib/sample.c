/* sample.c - batches of samples: directions drawn by each method, then weighed. */
#include "batch.h"
#include "slope_table.h"
#include "table_closed.h"
#include "table_sample.h"

const char *facet_sampler_name(facet_sampler sampler)
{
#define NAME(id, name) [FACET_SAMPLER_##id] = name,
    static const char *const names[FACET_SAMPLER_COUNT] = {FACET_SAMPLER_MAP(NAME)};
#undef NAME
    return (unsigned)sampler < FACET_SAMPLER_COUNT ? names[sampler] : NULL;
}

facet_sampler facet_sampler_visible(facet_ndf ndf)
{
    switch (ndf) {
    case FACET_GGX: return FACET_SAMPLER_CAPS;
    case FACET_BECKMANN: return FACET_SAMPLER_SLOPE;
    case FACET_TABULATED: return FACET_SAMPLER_TABLE;
    default: return FACET_SAMPLER_AUTO;
    }
}

/* The minor radius below which bounded caps are cut by less than they cost. */
#define LEAST_CUT 0.1

facet_sampler facet_sampler_auto(const facet_material *material)
{
    const facet_roughness *r = &material->roughness;
    bool leans = r->slope_x != 0 || r->slope_y != 0;
    if (material->ndf == FACET_GGX && !leans && facet_roughness_to_ellipse(r).alpha_2 >= LEAST_CUT)
        return FACET_SAMPLER_BOUNDED;
    if (material->ndf == FACET_BECKMANN && material->masking == FACET_VGROOVE)
        return FACET_SAMPLER_VCAVITY;
    return facet_sampler_visible(material->ndf);
}

bool facet_sampler_serves(facet_sampler sampler, facet_ndf ndf)
{
    if ((unsigned)ndf >= FACET_NDF_COUNT) return false;
    switch (sampler) {
    case FACET_SAMPLER_CAPS:
    case FACET_SAMPLER_BOUNDED: return ndf == FACET_GGX;
    case FACET_SAMPLER_VCAVITY:
    case FACET_SAMPLER_SLOPE: return ndf != FACET_TABULATED;
    default: return (unsigned)sampler < FACET_SAMPLER_COUNT;
    }
}

/* The method that really runs. */
static facet_sampler method_of(const facet_brdf *b, facet_sampler sampler)
{
    if (sampler == FACET_SAMPLER_AUTO) return b->automatic;
    return sampler == FACET_SAMPLER_BOUNDED && b->shape == KERNEL_SHEARED ? FACET_SAMPLER_CAPS
                                                                          : sampler;
}

facet_status facet_batch_sampler(const facet_brdf *b, facet_sampler sampler, facet_sampler *density)
{
    *density = FACET_SAMPLER_AUTO;
    if (!facet_sampler_serves(sampler, b->material.ndf)) return FACET_UNSUPPORTED;
    facet_sampler method = method_of(b, sampler);
    bool own_table = method == FACET_SAMPLER_TABLE && b->material.ndf == FACET_TABULATED;
    if (method == FACET_SAMPLER_TABLE && !own_table && !facet_table_of(b->material.ndf))
        return FACET_NO_MEMORY;
    if (method != FACET_SAMPLER_CAPS && method != FACET_SAMPLER_SLOPE && !own_table)
        *density = method;
    return FACET_OK;
}

/* A batch of samples as its caller holds it. */
struct drawn {
    const facet_brdf *brdf;
    facet_tier tier;
    struct kernel_surface surface;
    facet_sampler method,
        density; /* what draws, and whose density the weight is divided by (batch.h) */
    struct array wo[3], u[2];
    struct array wi[3], h[3], weight[3], pdf; /* h, weight, pdf NULL: not computed */
};

/*
 * The largest mean slope, in standard slopes, with which a normal rounded to floats returns to its u
 * within 1e-6: that rounding is so many times larger in standard slopes.
 */
#define LARGEST_MEAN 4.0

/* Beyond it doubles are drawn as such; arrays of floats have that rounding anyway. */
static facet_tier drawing_tier(const struct drawn *d)
{
    bool exact = d->tier == FACET_FAST && d->wo[0].io == KERNEL_DOUBLE &&
                 d->method != FACET_SAMPLER_COSINE && d->surface.mean > LARGEST_MEAN;
    return facet_batch_tier(d->brdf, exact ? FACET_EXACT32 : d->tier);
}

/* A method that a tier does not have runs in the next. */
static kernel_sample_fn *find_draw(const struct drawn *d, enum kernel_io *io)
{
    const struct kernel_table *table = d->surface.table;
    kernel_sample_fn *of_table = facet_table_draw(d->method,
                                                  table && facet_slope_table_is_turned(table));
    if (of_table && table) {
        *io = KERNEL_DOUBLE;
        return of_table;
    }
    for (int t = (int)drawing_tier(d); t < FACET_TIER_COUNT; t++) {
        facet_kernels_nearest((facet_tier)t, d->wo[0].io, io);
        const struct facet_samplers *samplers = facet_samplers_for((facet_tier)t, *io);
        kernel_sample_fn *found = samplers->draw[d->brdf->material.ndf][d->method];
        if (found) return found;
    }
    return NULL;
}

/* Both say how many are to be made again, and which of the n. */
static size_t draw_in_place(const struct drawn *d, kernel_sample_fn *sample, size_t start, size_t n,
                            size_t again[BLOCK])
{
    struct kernel_job job = {.sampled_pdf = facet_array_at(d->pdf, start).data, .again = again};
    for (int j = 0; j < 3; j++) {
        job.wo[j] = facet_array_at(d->wo[j], start).data;
        job.sampled_wi[j] = facet_array_at(d->wi[j], start).data;
        job.sampled_h[j] = facet_array_at(d->h[j], start).data;
        if (j < 2) job.u[j] = facet_array_at(d->u[j], start).data;
    }
    return sample(&d->surface, &job, n);
}

static size_t draw_staged(const struct drawn *d, kernel_sample_fn *sample, enum kernel_io io,
                          size_t start, size_t n, size_t again[BLOCK])
{
    double wo[3][BLOCK], u[2][BLOCK], wi[3][BLOCK], h[3][BLOCK], pdf[BLOCK];
    struct kernel_job job = {.sampled_pdf = d->pdf.data ? pdf : NULL, .again = again};
    for (int j = 0; j < 3; j++) {
        job.wo[j] = facet_stage(facet_array_at(d->wo[j], start), io, n, j == 2, wo[j]);
        job.sampled_wi[j] = wi[j];
        job.sampled_h[j] = d->h[j].data ? h[j] : NULL;
        if (j < 2) job.u[j] = facet_stage(facet_array_at(d->u[j], start), io, n, 0.5, u[j]);
    }
    size_t count = sample(&d->surface, &job, facet_padded(n));
    while (count && again[count - 1] >= n) count--; /* what was padded */
    for (int j = 0; j < 3; j++) {
        facet_unstage(wi[j], io, n, facet_array_at(d->wi[j], start));
        facet_unstage(h[j], io, n, facet_array_at(d->h[j], start));
    }
    facet_unstage(pdf, io, n, facet_array_at(d->pdf, start));
    return count;
}

/* Draws after `start` again in exact32: in double, whatever the arrays are of. */
static void redraw(const struct drawn *d, size_t start, const size_t at[BLOCK], size_t count)
{
    double in[5][BLOCK], out[7][BLOCK];
    size_t none[BLOCK];
    enum kernel_io io;
    struct drawn again = {
        .brdf = d->brdf, .tier = FACET_EXACT32, .surface = d->surface, .method = d->method};
    struct array from[5] = {d->wo[0], d->wo[1], d->wo[2], d->u[0], d->u[1]};
    struct array to[7] = {d->wi[0], d->wi[1], d->wi[2], d->h[0], d->h[1], d->h[2], d->pdf};
    for (int j = 0; j < 3; j++) {
        again.wo[j] = facet_doubles(in[j]);
        again.wi[j] = facet_doubles(out[j]);
        if (to[3 + j].data) again.h[j] = facet_doubles(out[3 + j]);
        if (j < 2) again.u[j] = facet_doubles(in[3 + j]);
    }
    if (d->pdf.data) again.pdf = facet_doubles(out[6]);
    kernel_sample_fn *sample = find_draw(&again, &io);
    if (!sample) return;
    for (int j = 0; j < 5; j++) {
        for (size_t k = 0; k < count; k++) in[j][k] = facet_array_get(from[j], start + at[k]);
        /* Whole vectors: the last again. */
        for (size_t k = count; k < facet_padded(count); k++) in[j][k] = in[j][count - 1];
    }
    draw_in_place(&again, sample, 0, facet_padded(count), none);
    for (int j = 0; j < 7; j++)
        for (size_t k = 0; to[j].data && k < count; k++)
            facet_array_put(to[j], start + at[k], out[j][k]);
}

/* The weight is that of the wi handed out: whoever evaluates there finds the same number. */
static void weigh(const struct drawn *d, size_t start, size_t n)
{
    struct batch batch = {.brdf = d->brdf, .tier = d->tier, .sampler = d->density};
    for (int j = 0; j < 3; j++) {
        batch.wi[j] = facet_array_at(d->wi[j], start);
        batch.wo[j] = facet_array_at(d->wo[j], start);
        batch.out[KERNEL_WEIGHT][j] = facet_array_at(d->weight[j], start);
    }
    if (d->weight[0].data) facet_batch_run(&batch, n);
}

static facet_status draw(struct drawn *d, facet_sampler sampler, size_t n)
{
    enum kernel_io io;
    if ((unsigned)d->tier >= FACET_TIER_COUNT ||
        !facet_sampler_serves(sampler, d->brdf->material.ndf))
        return FACET_UNSUPPORTED;
    d->method = method_of(d->brdf, sampler);
    facet_status status = facet_batch_sampler(d->brdf, sampler, &d->density);
    if (status) return status;
    d->surface = d->brdf->surface;
    /* What arrays of floats round away is not made again. */
    if (d->wo[0].io == KERNEL_FLOAT && d->surface.mean > LARGEST_MEAN) d->surface.mean = 0;
    if (d->density == FACET_SAMPLER_TABLE)
        d->surface.table = &facet_table_of(d->brdf->material.ndf)->view;
    const facet_slope_table *own = d->brdf->material.table;
    bool is_turned = d->surface.table && facet_slope_table_is_turned(d->surface.table);
    if (is_turned && d->method != FACET_SAMPLER_COSINE && !facet_slope_table_rays(own))
        return FACET_NO_MEMORY;
    kernel_sample_fn *sample = find_draw(d, &io);
    if (!sample) return FACET_UNSUPPORTED;
    for (size_t start = 0; start < n;) {
        size_t size = n - start < BLOCK ? n - start : BLOCK;
        size_t again[BLOCK], count;
        if (io == d->wo[0].io && size >= KERNEL_LANES) {
            size -= size % KERNEL_LANES;
            count = draw_in_place(d, sample, start, size, again);
        } else {
            count = draw_staged(d, sample, io, start, size, again);
        }
        if (count) redraw(d, start, again, count);
        weigh(d, start, size);
        start += size;
    }
    return FACET_OK;
}

facet_status facet_sample(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                          facet_vec3_in wo, const double *u1, const double *u2, size_t n,
                          const facet_samples *out)
{
    struct drawn d = {
        .brdf = brdf,
        .tier = tier,
        .wo = {facet_doubles(wo.x), facet_doubles(wo.y), facet_doubles(wo.z)},
        .u = {facet_doubles(u1), facet_doubles(u2)},
        .wi = {facet_doubles(out->wi.x), facet_doubles(out->wi.y), facet_doubles(out->wi.z)},
        .h = {facet_doubles(out->h.x), facet_doubles(out->h.y), facet_doubles(out->h.z)},
        .weight = {facet_doubles(out->weight[0]), facet_doubles(out->weight[1]),
                   facet_doubles(out->weight[2])},
        .pdf = facet_doubles(out->pdf)};
    return draw(&d, sampler, n);
}

facet_status facet_sample_float(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                                facet_vec3_in_float wo, const float *u1, const float *u2, size_t n,
                                const facet_samples_float *out)
{
    struct drawn d = {
        .brdf = brdf,
        .tier = tier,
        .wo = {facet_floats(wo.x), facet_floats(wo.y), facet_floats(wo.z)},
        .u = {facet_floats(u1), facet_floats(u2)},
        .wi = {facet_floats(out->wi.x), facet_floats(out->wi.y), facet_floats(out->wi.z)},
        .h = {facet_floats(out->h.x), facet_floats(out->h.y), facet_floats(out->h.z)},
        .weight = {facet_floats(out->weight[0]), facet_floats(out->weight[1]),
                   facet_floats(out->weight[2])},
        .pdf = facet_floats(out->pdf)};
    return draw(&d, sampler, n);
}

facet_status facet_pdf(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                       facet_vec3_in wi, facet_vec3_in wo, size_t n, double *pdf)
{
    const facet_outputs outputs = {.of = {[FACET_PDF] = {pdf, NULL, NULL}}};
    return facet_eval_sampled(brdf, tier, sampler, wi, wo, n, &outputs);
}

facet_status facet_pdf_float(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                             facet_vec3_in_float wi, facet_vec3_in_float wo, size_t n, float *pdf)
{
    const facet_outputs_float outputs = {.of = {[FACET_PDF] = {pdf, NULL, NULL}}};
    return facet_eval_sampled_float(brdf, tier, sampler, wi, wo, n, &outputs);
}
