/* evaluate_stream.c - an evaluation answered block by block: array after array, a round at a time. */
#include "evaluate_job.h"

#include "stream.h"

#include <string.h>

/* Where a stream stands: pairs `at` and on of an array, and what surrounds arrays. */
struct progress {
    size_t array, at;
    const char *skeleton, *end; /* of JSON: each array is a NUL */
    struct piece *pieces;       /* of one round */
    size_t count;
};

bool api_wants_stream(const struct call *call, const struct job *job)
{
    const struct representation *r = &job->evaluation->representation;
    size_t bytes = r->format == RESULTS_JSON ? (size_t)job->promise.digits + 3
                                             : api_number_size(r->format);
    return call->request->can_stream && api_can_stream(r) &&
           job->pairs.pairing.count > STREAM_MIN / (bytes * api_numbers_per_pair(job));
}

void api_mark_arrays(struct job *job, struct evaluation *evaluation, struct arena *arena)
{
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!api_is_asked(job, q)) continue;
        job->results[q].count = job->pairs.pairing.count;
        if (evaluation->representation.format != RESULTS_JSON) continue;
        job->results[q].text = api_text(arena);
        api_text_bytes(&job->results[q].text, "", 1); /* a NUL, of which the JSON holds no other */
        evaluation->of[q] = &job->results[q].text;
    }
}

static void add_piece(struct progress *progress, const char *bytes, size_t size)
{
    if (size) progress->pieces[progress->count++] = (struct piece){bytes, size};
}

/* The skeleton up to the next array, or its end. */
static void add_skeleton(struct progress *progress)
{
    size_t left = (size_t)(progress->end - progress->skeleton);
    const char *mark = left ? memchr(progress->skeleton, 0, left) : NULL;
    size_t n = mark ? (size_t)(mark - progress->skeleton) : left;
    add_piece(progress, progress->skeleton, n);
    progress->skeleton += n + (mark != NULL);
}

static bool produce(struct call *call, struct pieces *out)
{
    struct job *job = call->producer;
    const struct evaluation *evaluation = job->evaluation;
    struct progress *progress = job->progress;
    const struct results *results = evaluation->arrays[progress->array].results;
    int quantity = (int)(results - job->results);
    progress->count = 0;
    if (!progress->at) {
        add_skeleton(progress);
        if (!api_prefix_piece(call, &evaluation->representation, results,
                              &progress->pieces[progress->count]))
            return false;
        progress->count += progress->pieces[progress->count].size > 0;
    }
    if (!api_run_round(call, job, UINT32_C(1) << quantity, &progress->at)) return false;
    for (size_t i = 0; i < job->used; i++)
        add_piece(progress, job->slots[i].bytes[quantity], job->slots[i].size[quantity]);
    if (progress->at == job->pairs.pairing.count) {
        if (results->format == RESULTS_JSON) add_piece(progress, "]", 1);
        progress->array++;
        progress->at = 0;
    }
    out->ended = progress->array == evaluation->array_count;
    if (out->ended) add_skeleton(progress);
    out->list = progress->pieces;
    out->count = progress->count;
    return true;
}

static size_t bytes_of(const struct job *job)
{
    const struct representation *r = &job->evaluation->representation;
    if (r->format == RESULTS_JSON) return API_SIZE_UNKNOWN;
    return api_prefix_size(r) +
           api_number_size(r->format) * api_numbers_per_pair(job) * job->pairs.pairing.count;
}

/* The JSON around the arrays. */
static bool keep_skeleton(struct call *call, struct progress *progress)
{
    struct text text = api_text(call->arena);
    size_t size;
    api_encode(&text, call->endpoint->response, call->out);
    api_text_put(&text, "\n");
    char *skeleton = api_text_take(&text, &size);
    if (skeleton) skeleton = api_arena_adopt(call->arena, skeleton, size);
    if (!skeleton) return api_problem_memory(call->problem);
    progress->skeleton = skeleton;
    progress->end = skeleton + size;
    return true;
}

/* call->out is what surrounds the arrays; it and the evaluation are the caller's until then. */
bool api_start_stream(struct call *call, struct job *job, const struct evaluation *evaluation)
{
    enum { BESIDES = 4 }; /* pieces: skeleton, header, bracket, skeleton */
    struct evaluation *kept = api_arena_array(call->arena, 1, sizeof *kept);
    struct progress *progress = api_arena_array(call->arena, 1, sizeof *progress);
    if (!kept || !progress || !api_open_slots(call, job, evaluation->outputs, true))
        return api_problem_memory(call->problem);
    progress->pieces = api_arena_array(call->arena, job->slot_count + BESIDES,
                                       sizeof *progress->pieces);
    if (!progress->pieces) return api_problem_memory(call->problem);
    *kept = *evaluation;
    job->evaluation = kept;
    job->progress = progress;
    bool ok = kept->representation.format == RESULTS_JSON
                  ? keep_skeleton(call, progress)
                  : api_represent_headers(call, kept->arrays, kept->array_count);
    if (!ok) return false;
    call->response->content_type = kept->representation.type;
    call->response->body_size = bytes_of(job);
    call->response->trace.evaluations = job->pairs.pairing.count;
    call->producer = job;
    call->produce = produce;
    return true;
}
