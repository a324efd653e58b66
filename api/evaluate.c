#include "evaluate.h"

#include <math.h>

#include "limits.h"

static const bool is_coloured[] = {
#define QUANTITY(id, name, coloured, doc) coloured,
#include "quantities.def"
#undef QUANTITY
};

static const char *const names[] = {
#define QUANTITY(id, name, coloured, doc) name,
#include "quantities.def"
#undef QUANTITY
};

struct job {
    struct evaluation *evaluation;
    struct surface surface;
    struct pairs pairs;
    struct promise promise;
    double condition;   /* facet_condition of all pairs */
    double input_error; /* of the directions, times facet_closeness of all pairs */
    size_t channels;
    double *directions[6]; /* wi, wo */
    facet_outputs outputs;
    struct results results[FACET_QUANTITY_COUNT];
};

size_t api_channels(int64_t requested, size_t material, struct problem *problem)
{
    struct place at = {NULL, "channels", 0};
    if (requested < 0) return material;
    if (requested == 3 || (requested == 1 && material == 1)) return (size_t)requested;
    api_problem_at(problem, &at, requested == 1 ? "the material is coloured" : "must be 1 or 3");
    return 0;
}

bool api_numbers_fit(size_t count, size_t per_element, struct problem *problem)
{
    struct place at = {NULL, "outputs", 0};
    if (count <= LIMIT_NUMBERS / per_element) return true;
    return api_problem_at(problem, &at, "%zu x %zu numbers are outside [1, %d]", count, per_element,
                          LIMIT_NUMBERS);
}

static bool asked(const struct evaluation *evaluation, int quantity)
{
    return evaluation->outputs >> quantity & 1;
}

static facet_vec3_in in(double *const v[3])
{
    return (facet_vec3_in){v[0], v[1], v[2]};
}

static size_t chunk_of(const struct job *job, size_t start)
{
    size_t left = job->pairs.pairing.count - start;
    return left < CHUNK ? left : CHUNK;
}

static bool bound_of(const void *asked_, facet_tier tier, double *bound)
{
    const struct job *job = asked_;
    *bound = 0;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        double b;
        if (!asked(job->evaluation, q)) continue;
        bool promised = q == FACET_PDF ? facet_pdf_bound(job->surface.brdf, tier, job->evaluation->sampler,
                                                         job->input_error, &b)
                                       : facet_bound(job->surface.brdf, tier, (facet_quantity)q,
                                                     job->input_error, &b);
        if (!promised) return false;
        b += job->surface.parameter_error;
        if (q == FACET_FR || q == FACET_FR_COS || q == FACET_G) b *= job->condition;
        if (b > *bound) *bound = b;
    }
    return true;
}

/* Room for one chunk of directions and outputs. */
static bool allocate(struct job *job, struct arena *arena)
{
    size_t n = chunk_of(job, 0);
    for (int k = 0; k < 6; k++)
        if (!(job->directions[k] = api_arena_doubles(arena, n))) return false;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!asked(job->evaluation, q)) continue;
        size_t columns = is_coloured[q] ? job->surface.channels : 1;
        for (size_t c = 0; c < columns; c++)
            if (!(job->outputs.of[q][c] = api_arena_doubles(arena, n))) return false;
        size_t width = is_coloured[q] ? job->channels : 1;
        api_results_open(&job->results[q], arena, width, job->evaluation->flat,
                         job->promise.digits);
    }
    return true;
}

/*
 * What the bound needs to know of all pairs before a tier can be chosen: only
 * the thesis's shear, and directions that were computed and not sent, need it.
 */
static bool find_condition(struct call *call, struct job *job)
{
    double start = api_clock(), error = job->pairs.input_error;
    job->condition = 1;
    job->input_error = error;
    if (job->surface.facet.shear != FACET_THESIS && error == 0) return true;
    for (size_t i = 0, n; i < job->pairs.pairing.count; i += n) {
        double condition;
        n = chunk_of(job, i);
        if (!api_still_wanted(call)) return false;
        api_pairs_fill(&job->pairs, i, n, job->directions);
        facet_vec3_in wi = in(job->directions), wo = in(job->directions + 3);
        facet_status status = facet_condition(job->surface.brdf, wi, wo, n, &condition);
        if (status) return api_problem_status(call->problem, status, NULL);
        job->condition = fmax(job->condition, condition);
        double closeness = facet_closeness(job->surface.brdf, wi, wo, n, !job->pairs.is_half);
        if (error > 0) job->input_error = fmax(job->input_error, error * closeness);
    }
    call->response->trace.compute_us += api_clock() - start;
    return true;
}

static bool print_chunk(struct call *call, struct job *job, size_t n)
{
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!asked(job->evaluation, q)) continue;
        double *const *of = job->outputs.of[q];
        double *columns[3] = {of[0], of[1] ? of[1] : of[0], of[2] ? of[2] : of[0]};
        if (!api_results_add(&job->results[q], columns, n))
            return api_problem(call->problem, 500, "%s of pair %zu is not finite", names[q],
                               job->results[q].count);
    }
    return true;
}

/* The pdf of a sampler is asked for alone. */
static facet_status run(const struct job *job, size_t n)
{
    const facet_brdf *brdf = job->surface.brdf;
    facet_vec3_in wi = in(job->directions), wo = in(job->directions + 3);
    if (job->evaluation->sampler == FACET_SAMPLER_AUTO)
        return facet_eval(brdf, job->promise.tier, wi, wo, n, &job->outputs);
    return facet_pdf(brdf, job->promise.tier, job->evaluation->sampler, wi, wo, n,
                     job->outputs.of[FACET_PDF][0]);
}

static bool compute(struct call *call, struct job *job)
{
    struct api_trace *trace = &call->response->trace;
    for (size_t i = 0, n; i < job->pairs.pairing.count; i += n) {
        n = chunk_of(job, i);
        if (!api_still_wanted(call)) return false;
        double start = api_clock();
        api_pairs_fill(&job->pairs, i, n, job->directions);
        facet_status status = run(job, n);
        if (status) return api_problem_status(call->problem, status, NULL);
        double computed = api_clock();
        trace->compute_us += computed - start;
        if (!print_chunk(call, job, n)) return false;
        trace->encode_us += api_clock() - computed;
        trace->evaluations += n;
    }
    return true;
}

static size_t numbers_per_pair(const struct job *job)
{
    size_t n = 0;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (asked(job->evaluation, q)) n += is_coloured[q] ? job->channels : 1;
    return n;
}

bool api_evaluate(struct call *call, struct evaluation *evaluation)
{
    struct decoder decoder = {call->arena, call->problem};
    struct place material = {NULL, "material", 0};
    double start = api_clock();
    struct job *job = api_arena_array(call->arena, 1, sizeof *job);
    if (!job) return api_problem_memory(call->problem);
    job->evaluation = evaluation;
    if (!api_pairs(evaluation->pairs, &decoder, &job->pairs) ||
        !api_material_open(evaluation->material, &material, &decoder, &job->surface))
        return false;
    job->channels = api_channels(evaluation->channels, job->surface.channels, call->problem);
    if (!job->channels ||
        !api_numbers_fit(job->pairs.pairing.count, numbers_per_pair(job), call->problem))
        return false;
    if (!allocate(job, call->arena)) return api_problem_memory(call->problem);
    if (!find_condition(call, job) ||
        !api_promise(evaluation->accuracy, bound_of, job, call->problem, &job->promise))
        return false;
    api_promise_fewer_digits(evaluation->accuracy, &job->promise);
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) job->results[q].digits = job->promise.digits;
    call->response->trace.decode_us += api_clock() - start - call->response->trace.compute_us;
    call->response->trace.tier = api_tier_names[job->promise.tier];
    if (!compute(call, job)) return false;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!asked(evaluation, q)) continue;
        api_results_close(&job->results[q]);
        evaluation->of[q] = &job->results[q].text;
    }
    evaluation->count = job->pairs.pairing.count;
    evaluation->answer =
        (struct accuracy){api_tier_names[job->promise.tier], job->promise.bound, FACET_FLOOR, NAN};
    return true;
}
