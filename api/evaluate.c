#include "evaluate.h"

#include "diffuse.h"
#include "limits.h"
#include "stream.h"

#include <math.h>
#include <string.h>

#include <math.h>

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
    struct progress *progress; /* of a stream */
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
        if (!facet_bound(job->surface.brdf, tier, (facet_quantity)q, job->input_error, &b))
            return false;
        b += job->surface.parameter_error + api_surface_error(&job->surface);
        if (q == FACET_FR || q == FACET_FR_COS || q == FACET_G) b *= job->condition;
        if (b > *bound) *bound = b;
    }
    *bound = api_represented(&job->evaluation->representation, *bound);
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

static bool print_one(struct call *call, struct job *job, int q, size_t n)
{
    double *const *of = job->outputs.of[q];
    double *columns[3] = {of[0], of[1] ? of[1] : of[0], of[2] ? of[2] : of[0]};
    return api_results_add(&job->results[q], columns, n) ||
           api_results_check(&job->results[q], names[q], "pair", call->problem);
}

static bool print_chunk(struct call *call, struct job *job, size_t n)
{
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (asked(job->evaluation, q) && !print_one(call, job, q, n)) return false;
    return true;
}

static bool compute(struct call *call, struct job *job)
{
    struct api_trace *trace = &call->response->trace;
    for (size_t i = 0, n; i < job->pairs.pairing.count; i += n) {
        n = chunk_of(job, i);
        if (!api_still_wanted(call)) return false;
        double start = api_clock();
        api_pairs_fill(&job->pairs, i, n, job->directions);
        facet_status status =
            api_surface_eval(&job->surface, job->promise.tier, in(job->directions),
                             in(job->directions + 3), n, &job->outputs);
        if (status) return api_problem_status(call->problem, status, NULL);
        double computed = api_clock();
        trace->compute_us += computed - start;
        if (!print_chunk(call, job, n)) return false;
        trace->encode_us += api_clock() - computed;
        trace->evaluations += n;
    }
    return true;
}

static void open_results(struct job *job, struct arena *arena)
{
    const struct evaluation *evaluation = job->evaluation;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (asked(evaluation, q))
            api_results_open_as(&job->results[q], arena, evaluation->representation.format,
                                is_coloured[q] ? job->channels : 1, evaluation->flat,
                                job->promise.digits);
}

static size_t numbers_per_pair(const struct job *job)
{
    size_t n = 0;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (asked(job->evaluation, q)) n += is_coloured[q] ? job->channels : 1;
    return n;
}

static void list_arrays(struct job *job)
{
    struct evaluation *evaluation = job->evaluation;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (asked(evaluation, q))
            evaluation->arrays[evaluation->array_count++] =
                (struct named_results){names[q], &job->results[q]};
}

static void close_results(struct job *job)
{
    struct evaluation *evaluation = job->evaluation;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!asked(evaluation, q)) continue;
        api_results_close(&job->results[q]);
        if (evaluation->representation.format == RESULTS_JSON)
            evaluation->of[q] = &job->results[q].text;
    }
}

/* ---- Block by block ------------------------------------------------------------------------------ */

/* Where a stream stands: elements `at` and on of the array of `results`, and what surrounds arrays. */
struct progress {
    size_t array, at;
    const char *skeleton, *end; /* of JSON: each array is a NUL */
};

static bool wants_stream(const struct call *call, const struct job *job)
{
    const struct representation *r = &job->evaluation->representation;
    size_t bytes = r->format == RESULTS_JSON ? (size_t)job->promise.digits + 3
                                             : api_number_size(r->format);
    return call->request->can_stream && api_can_stream(r) &&
           job->pairs.pairing.count > STREAM_MIN / (bytes * numbers_per_pair(job));
}

/* Arrays that are not there yet: a NUL in the JSON, which holds no other. */
static void mark_arrays(struct job *job, struct arena *arena)
{
    struct evaluation *evaluation = job->evaluation;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!asked(evaluation, q)) continue;
        job->results[q].count = job->pairs.pairing.count;
        if (evaluation->representation.format != RESULTS_JSON) continue;
        job->results[q].text = api_text(arena);
        api_text_bytes(&job->results[q].text, "", 1);
        evaluation->of[q] = &job->results[q].text;
    }
}

/* One chunk of one quantity. */
static bool compute_one(struct call *call, struct job *job, int q, size_t at, size_t n)
{
    facet_outputs outputs = {0};
    if (!api_still_wanted(call)) return false;
    for (int c = 0; c < 3; c++) outputs.of[q][c] = job->outputs.of[q][c];
    api_pairs_fill(&job->pairs, at, n, job->directions);
    facet_status status = facet_eval(job->surface.brdf, job->promise.tier, in(job->directions),
                                     in(job->directions + 3), n, &outputs);
    if (status) return api_problem_status(call->problem, status, NULL);
    return print_one(call, job, q, n);
}

/* The skeleton up to the next array, or its end. */
static void put_skeleton(struct progress *progress, struct text *block)
{
    size_t left = (size_t)(progress->end - progress->skeleton);
    const char *mark = left ? memchr(progress->skeleton, 0, left) : NULL;
    size_t n = mark ? (size_t)(mark - progress->skeleton) : left;
    if (n) api_text_bytes(block, progress->skeleton, n);
    progress->skeleton += n + (mark != NULL);
}

static bool produce(struct call *call, struct text *block, bool *ended)
{
    struct job *job = call->producer;
    const struct evaluation *evaluation = job->evaluation;
    struct progress *progress = job->progress;
    struct results *results = evaluation->arrays[progress->array].results;
    size_t n = chunk_of(job, progress->at);
    if (!progress->at) {
        put_skeleton(progress, block);
        results->count = job->pairs.pairing.count;
        api_represent_prefix(&evaluation->representation, results, block);
        api_results_open_as(results, block->arena, results->format, results->width, results->flat,
                            results->digits);
    }
    if (progress->at) results->text = api_text(block->arena);
    if (!compute_one(call, job, (int)(results - job->results), progress->at, n)) return false;
    progress->at += n;
    if (progress->at == job->pairs.pairing.count) {
        api_results_close(results);
        progress->array++;
        progress->at = 0;
    }
    api_text_join(block, &results->text);
    *ended = progress->array == evaluation->array_count;
    if (*ended) put_skeleton(progress, block);
    return true;
}

static size_t bytes_of(const struct job *job)
{
    const struct representation *r = &job->evaluation->representation;
    if (r->format == RESULTS_JSON) return API_SIZE_UNKNOWN;
    return api_prefix_size(r) +
           api_number_size(r->format) * numbers_per_pair(job) * job->pairs.pairing.count;
}

/* call->out is what surrounds the arrays; it and the evaluation are the caller's until then. */
static bool start_stream(struct call *call, const struct evaluation *evaluation)
{
    struct job *job = evaluation->job;
    struct text text = api_text(call->arena);
    struct evaluation *kept = api_arena_array(call->arena, 1, sizeof *kept);
    job->progress = api_arena_array(call->arena, 1, sizeof *job->progress);
    if (!kept || !job->progress) return api_problem_memory(call->problem);
    *kept = *evaluation;
    job->evaluation = kept;
    if (kept->representation.format == RESULTS_JSON) {
        size_t size;
        api_encode(&text, call->endpoint->response, call->out);
        api_text_put(&text, "\n");
        char *skeleton = api_text_take(&text, &size);
        if (skeleton) skeleton = api_arena_adopt(call->arena, skeleton, size);
        if (!skeleton) return api_problem_memory(call->problem);
        job->progress->skeleton = skeleton;
        job->progress->end = skeleton + size;
    } else if (!api_represent_headers(call, kept->arrays, kept->array_count)) {
        return false;
    }
    call->response->content_type = kept->representation.type;
    call->response->body_size = bytes_of(job);
    call->response->trace.evaluations = job->pairs.pairing.count;
    call->producer = job;
    call->produce = produce;
    return true;
}

bool api_answer_evaluation(struct call *call, const struct evaluation *evaluation)
{
    if (evaluation->job) return start_stream(call, evaluation);
    if (evaluation->representation.format == RESULTS_JSON) return true;
    return api_answer_arrays(call, &evaluation->representation, evaluation->arrays,
                             evaluation->array_count);
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
    list_arrays(job);
    if (!api_represent(call, evaluation->dtype, evaluation->accuracy, evaluation->array_count,
                       &evaluation->representation) ||
        !find_condition(call, job) ||
        !api_promise(evaluation->accuracy, bound_of, job, call->problem, &job->promise))
        return false;
    api_promise_fewer_digits(evaluation->accuracy, &job->promise);
    api_represent_bound(&evaluation->representation, evaluation->accuracy, &job->promise);
    open_results(job, call->arena);
    call->response->trace.decode_us += api_clock() - start - call->response->trace.compute_us;
    call->response->trace.tier = api_tier_names[job->promise.tier];
    if (wants_stream(call, job)) {
        evaluation->job = job;
        mark_arrays(job, call->arena);
    } else {
        if (!compute(call, job)) return false;
        close_results(job);
    }
    evaluation->count = job->pairs.pairing.count;
    evaluation->answer =
        (struct accuracy){api_tier_names[job->promise.tier], job->promise.bound, FACET_FLOOR, NAN};
    return true;
}
