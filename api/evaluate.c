#include "evaluate.h"

#include "diffuse.h"
#include "limits.h"
#include "stream.h"
#include "transmission.h"

#include <math.h>
#include <string.h>

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

/* Chunks in work at a time, a worker each where the server shares them. */
enum { SLOTS = 8 };

/* One chunk: where it is computed and what came of it. */
struct slot {
    double *directions[6]; /* wi, wo */
    facet_outputs outputs;
    struct results part[FACET_QUANTITY_COUNT];
    size_t at, n;
    facet_status status;
    double compute_us, encode_us;
};

struct job {
    struct evaluation *evaluation;
    struct surface surface;
    struct pairs pairs;
    struct promise promise;
    double condition;   /* facet_condition of all pairs */
    double input_error; /* of the directions, times facet_closeness of all pairs */
    size_t channels;
    struct slot slots[SLOTS];
    size_t slot_count;
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
        bool promised = q == FACET_PDF ? facet_pdf_bound(job->surface.brdf, tier, job->evaluation->sampler,
                                                         job->input_error, &b)
                                       : facet_bound(job->surface.brdf, tier, (facet_quantity)q,
                                                     job->input_error, &b);
        if (job->surface.bsdf)
            promised = api_transmission_bound(&job->surface, tier, (facet_quantity)q, job->input_error, &b);
        if (!promised) return false;
        b += job->surface.parameter_error + api_surface_error(&job->surface);
        if (q == FACET_FR || q == FACET_FR_COS || q == FACET_G) b *= job->condition;
        if (b > *bound) *bound = b;
    }
    *bound = api_represented(&job->evaluation->representation, *bound);
    return true;
}

/* Room for one chunk of directions and outputs. */
static bool allocate_slot(struct job *job, struct slot *slot, struct arena *arena)
{
    size_t n = chunk_of(job, 0);
    for (int k = 0; k < 6; k++)
        if (!(slot->directions[k] = api_arena_doubles(arena, n))) return false;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!asked(job->evaluation, q)) continue;
        size_t columns = is_coloured[q] ? job->surface.channels : 1;
        for (size_t c = 0; c < columns; c++)
            if (!(slot->outputs.of[q][c] = api_arena_doubles(arena, n))) return false;
    }
    return true;
}

/* As many slots as there are chunks to share. */
static bool allocate(const struct call *call, struct job *job)
{
    size_t chunks = (job->pairs.pairing.count + CHUNK - 1) / CHUNK;
    job->slot_count = call->request->share && chunks > 1 ? chunks < SLOTS ? chunks : SLOTS : 1;
    for (size_t i = 0; i < job->slot_count; i++)
        if (!allocate_slot(job, &job->slots[i], call->arena)) return false;
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
        double *const *directions = job->slots[0].directions;
        api_pairs_fill(&job->pairs, i, n, directions);
        facet_vec3_in wi = in(directions), wo = in(directions + 3);
        facet_status status = facet_condition(job->surface.brdf, wi, wo, n, &condition);
        if (status) return api_problem_status(call->problem, status, NULL);
        job->condition = fmax(job->condition, condition);
        bool exact_z = !job->pairs.is_half;
        double closeness = job->surface.bsdf ? facet_bsdf_closeness(job->surface.bsdf, wi, wo, n, exact_z)
                                             : facet_closeness(job->surface.brdf, wi, wo, n, exact_z);
        if (error > 0) job->input_error = fmax(job->input_error, error * closeness);
    }
    call->response->trace.compute_us += api_clock() - start;
    return true;
}

/* Some chunks of some quantities, a slot each. */
struct round {
    struct job *job;
    uint32_t outputs;
};

/* On any thread: nothing of the request but its slot is written. */
static void run_slot(void *round_, size_t index)
{
    const struct round *round = round_;
    struct job *job = round->job;
    struct slot *slot = &job->slots[index];
    facet_outputs outputs = {0};
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (int c = 0; c < 3 && round->outputs >> q & 1; c++) outputs.of[q][c] = slot->outputs.of[q][c];
    double start = api_clock();
    api_pairs_fill(&job->pairs, slot->at, slot->n, slot->directions);
    slot->status = api_surface_eval(&job->surface, job->promise.tier, job->evaluation->sampler, in(slot->directions),
                                    in(slot->directions + 3), slot->n, &outputs);
    double computed = api_clock();
    for (int q = 0; q < FACET_QUANTITY_COUNT && !slot->status; q++) {
        double *const *of = outputs.of[q];
        double *columns[3] = {of[0], of[1] ? of[1] : of[0], of[2] ? of[2] : of[0]};
        /* A fault stays in the part, where join finds it. */
        if (round->outputs >> q & 1) (void)api_results_add(&slot->part[q], columns, slot->n);
    }
    slot->compute_us = computed - start;
    slot->encode_us = api_clock() - computed;
}

static void close_arena(void *arena)
{
    api_arena_close(arena);
}

/* The slot's chunk from `at` on, its text in an arena of its own that `owner` ends. */
static bool prepare_slot(struct job *job, struct slot *slot, uint32_t outputs, size_t at, struct arena *owner)
{
    struct arena *arena = api_arena_array(owner, 1, sizeof *arena);
    if (!arena) return false;
    api_arena_open(arena, LIMIT_REQUEST_MEMORY);
    if (!api_arena_defer(owner, close_arena, arena)) return false;
    slot->at = at;
    slot->n = chunk_of(job, at);
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!(outputs >> q & 1)) continue;
        slot->part[q] = job->results[q];
        slot->part[q].text = api_text(arena);
        slot->part[q].count = at;
    }
    return true;
}

static bool join_slot(struct call *call, struct job *job, struct slot *slot, uint32_t outputs)
{
    struct api_trace *trace = &call->response->trace;
    if (slot->status) return api_problem_status(call->problem, slot->status, NULL);
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!(outputs >> q & 1)) continue;
        if (slot->part[q].fault != RESULTS_SOUND)
            return api_results_check(&slot->part[q], names[q], "pair", call->problem);
        api_text_join(&job->results[q].text, &slot->part[q].text);
        job->results[q].count = slot->part[q].count;
    }
    trace->compute_us += slot->compute_us;
    trace->encode_us += slot->encode_us;
    return true;
}

/* Chunks from *at on, as many as there are slots, into the results; *at moves on. */
static bool run_round(struct call *call, struct job *job, uint32_t outputs, struct arena *owner, size_t *at)
{
    const struct api_request *request = call->request;
    struct round round = {job, outputs};
    size_t used = 0;
    if (!api_still_wanted(call)) return false;
    while (used < job->slot_count && *at < job->pairs.pairing.count) {
        struct slot *slot = &job->slots[used++];
        if (!prepare_slot(job, slot, outputs, *at, owner)) return api_problem_memory(call->problem);
        *at += slot->n;
    }
    if (used > 1)
        request->share(request->crew, used, run_slot, &round);
    else
        run_slot(&round, 0);
    for (size_t i = 0; i < used; i++)
        if (!join_slot(call, job, &job->slots[i], outputs)) return false;
    return true;
}

static bool compute(struct call *call, struct job *job)
{
    for (size_t at = 0; at < job->pairs.pairing.count;)
        if (!run_round(call, job, job->evaluation->outputs, call->arena, &at)) return false;
    call->response->trace.evaluations += job->pairs.pairing.count;
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
    if (!progress->at) {
        put_skeleton(progress, block);
        results->count = job->pairs.pairing.count;
        api_represent_prefix(&evaluation->representation, results, block);
        api_results_open_as(results, block->arena, results->format, results->width, results->flat,
                            results->digits);
    }
    if (progress->at) results->text = api_text(block->arena);
    uint32_t quantity = UINT32_C(1) << (results - job->results);
    if (!run_round(call, job, quantity, block->arena, &progress->at)) return false;
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
    if (!allocate(call, job)) return api_problem_memory(call->problem);
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
