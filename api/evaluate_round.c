/* evaluate_round.c - chunks of an evaluation shared among threads, and what all pairs have in common. */
#include "evaluate_job.h"

#include <float.h>
#include <math.h>
#include <stdint.h>

void api_share(const struct call *call, size_t count, void (*task)(void *arg, size_t index),
               void *arg)
{
    const struct api_request *request = call->request;
    if (request->share && count > 1)
        request->share(request->crew, count, task, arg);
    else
        for (size_t i = 0; i < count; i++) task(arg, i);
}

/* ---- Rounds -------------------------------------------------------------------------------------- */

/* Bytes of a pair in the answer, about. */
static size_t usual_size(const struct job *job, int quantity)
{
    const struct results *r = &job->results[quantity];
    size_t number = r->format == RESULTS_JSON ? (size_t)r->digits + 4 : api_number_size(r->format);
    return api_width_of(job, quantity) * number;
}

static size_t count_slots(const struct job *job, uint32_t outputs, bool streams)
{
    size_t bytes = 1, chunks = (job->pairs.pairing.count + CHUNK - 1) / CHUNK;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!(outputs >> q & 1)) continue;
        size_t own = usual_size(job, q);
        bytes = !streams ? bytes + own : own > bytes ? own : bytes;
    }
    size_t count = (streams ? STREAM_BYTES : ROUND_BYTES) / (CHUNK * bytes);
    if (count < SLOTS_MIN) count = SLOTS_MIN;
    if (count > SLOTS_MAX) count = SLOTS_MAX;
    return count < chunks ? count : chunks;
}

/* Whole binary answers are written where they stand; the rest goes through the slots. */
static bool open_whole(struct job *job, int quantity)
{
    struct results *r = &job->results[quantity];
    size_t part = api_results_room(r, CHUNK);
    char *bytes = api_text_reserve(&r->text, api_results_room(r, job->pairs.pairing.count));
    for (size_t i = 0; bytes && i < job->slot_count; i++)
        job->slots[i].bytes[quantity] = bytes + i * part;
    return bytes;
}

static bool open_buffers(struct job *job, int quantity, struct arena *arena)
{
    size_t n = job->pairs.pairing.count < CHUNK ? job->pairs.pairing.count : CHUNK;
    for (size_t i = 0; i < job->slot_count; i++)
        if (!(job->slots[i].bytes[quantity] = api_arena_alloc(
                  arena, api_results_room(&job->results[quantity], n))))
            return false;
    return true;
}

bool api_open_slots(const struct call *call, struct job *job, uint32_t outputs, bool streams)
{
    bool whole = !streams && job->evaluation->representation.format != RESULTS_JSON, ok = true;
    int widest = -1;
    job->slot_count = count_slots(job, outputs, streams);
    job->slots = api_arena_array(call->arena, job->slot_count, sizeof *job->slots);
    if (!job->slots) return api_problem_memory(call->problem);
    for (int q = 0; q < FACET_QUANTITY_COUNT && ok; q++) {
        if (!(outputs >> q & 1)) continue;
        if (whole)
            ok = open_whole(job, q);
        else if (!streams)
            ok = open_buffers(job, q, call->arena);
        else if (widest < 0 || api_width_of(job, q) > api_width_of(job, widest))
            widest = q;
    }
    if (widest >= 0) ok = open_buffers(job, widest, call->arena);
    for (size_t i = 0; widest >= 0 && ok && i < job->slot_count; i++) /* one array at a time */
        for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
            job->slots[i].bytes[q] = job->slots[i].bytes[widest];
    return ok || api_problem_memory(call->problem);
}

static bool check_slot(struct call *call, const struct job *job, const struct slot *slot)
{
    if (slot->status) return api_problem_status(call->problem, slot->status, NULL);
    if (slot->fault == RESULTS_SOUND) return true;
    struct results at = job->results[slot->fault_of];
    at.fault = slot->fault;
    at.count = slot->fault_at;
    return api_results_check(&at, api_quantity_names[slot->fault_of], "pair", call->problem);
}

bool api_run_round(struct call *call, struct job *job, uint32_t outputs, size_t *at)
{
    struct api_trace *trace = &call->response->trace;
    if (!api_still_wanted(call)) return false;
    job->outputs = outputs;
    job->used = 0;
    while (job->used < job->slot_count && *at < job->pairs.pairing.count) {
        struct slot *slot = &job->slots[job->used++];
        size_t left = job->pairs.pairing.count - *at;
        slot->at = *at;
        slot->n = left < CHUNK ? left : CHUNK;
        slot->fault = RESULTS_SOUND;
        slot->status = FACET_OK;
        slot->compute_us = slot->encode_us = 0;
        for (int q = 0; q < FACET_QUANTITY_COUNT; q++) slot->size[q] = 0;
        *at += slot->n;
    }
    api_share(call, job->used, api_run_slot, job);
    for (size_t i = 0; i < job->used; i++) {
        if (!check_slot(call, job, &job->slots[i])) return false;
        trace->compute_us += job->slots[i].compute_us;
        trace->encode_us += job->slots[i].encode_us;
    }
    return true;
}

/* ---- A look at all pairs ------------------------------------------------------------------------- */

struct look {
    const struct job *job;
    size_t at;
    struct seen {
        facet_status status;
        double condition, closeness;
        facet_depth depth;
    } seen[SLOTS_MAX];
};

static double closeness_of(const struct job *job, facet_vec3_in wi, facet_vec3_in wo, size_t n)
{
    const bool exact_z = !job->pairs.is_half;
    return job->surface.bsdf ? facet_bsdf_closeness(job->surface.bsdf, wi, wo, n, exact_z)
                             : facet_closeness(job->surface.brdf, wi, wo, n, exact_z);
}

static void look_at_chunk(void *look_, size_t index)
{
    struct look *look = look_;
    const struct job *job = look->job;
    double v[6][BLOCK], *const in[6] = {v[0], v[1], v[2], v[3], v[4], v[5]};
    const facet_vec3_in wi = {v[0], v[1], v[2]}, wo = {v[3], v[4], v[5]};
    struct seen seen = {.condition = 1, .closeness = 1};
    size_t at = look->at + index * CHUNK, end = at + CHUNK, count = job->pairs.pairing.count;
    if (end > count) end = count;
    for (size_t n; at < end && !seen.status; at += n) {
        double condition;
        n = end - at < BLOCK ? end - at : BLOCK;
        api_pairs_fill(&job->pairs, at, n, false, in);
        seen.status = facet_condition(job->surface.brdf, wi, wo, n, &condition);
        seen.condition = fmax(seen.condition, condition);
        facet_depth_survey(job->surface.brdf, job->evaluation->sampler, wi, wo, n, &seen.depth);
        if (job->pairs.input_error > 0)
            seen.closeness = fmax(seen.closeness, closeness_of(job, wi, wo, n));
    }
    look->seen[index] = seen;
}

bool api_survey_pairs(struct call *call, struct job *job)
{
    double start = api_clock(), error = job->pairs.input_error;
    size_t count = job->pairs.pairing.count;
    struct look look = {.job = job};
    job->condition = 1;
    job->input_error = error;
    const facet_depth deepest = {DBL_MAX, DBL_MAX, DBL_MAX};
    if (job->surface.facet.shear != FACET_THESIS && error == 0 &&
        api_depth_error(job, FACET_PRECISE, &deepest) == 0)
        return true;
    for (; look.at < count; look.at += SLOTS_MAX * (size_t)CHUNK) {
        size_t chunks = (count - look.at + CHUNK - 1) / CHUNK;
        if (chunks > SLOTS_MAX) chunks = SLOTS_MAX;
        if (!api_still_wanted(call)) return false;
        api_share(call, chunks, look_at_chunk, &look);
        for (size_t i = 0; i < chunks; i++) {
            const struct seen *seen = &look.seen[i];
            if (seen->status) return api_problem_status(call->problem, seen->status, NULL);
            job->condition = fmax(job->condition, seen->condition);
            job->depth.wo = fmax(job->depth.wo, seen->depth.wo);
            job->depth.least = fmax(job->depth.least, seen->depth.least);
            job->depth.most = fmax(job->depth.most, seen->depth.most);
            job->input_error = fmax(job->input_error, error * seen->closeness);
        }
    }
    call->response->trace.compute_us += api_clock() - start;
    return true;
}
