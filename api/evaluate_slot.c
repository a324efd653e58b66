/* evaluate_slot.c - one chunk of an evaluation: staged, evaluated and encoded block by block. */
#include "evaluate_job.h"

#include "diffuse.h"

const bool api_quantity_is_coloured[] = {
#define QUANTITY(id, name, coloured, doc) coloured,
#include "quantities.def"
#undef QUANTITY
};

const char *const api_quantity_names[] = {
#define QUANTITY(id, name, coloured, doc) name,
#include "quantities.def"
#undef QUANTITY
};

/* A block of pairs and what comes of it: on the stack, which is warm and cannot fail. */
struct scratch {
    double in[6][BLOCK], out[FACET_QUANTITY_COUNT][3][BLOCK];
    float float_in[6][BLOCK], float_out[FACET_QUANTITY_COUNT][3][BLOCK];
    bool again, float_again; /* what all pairs share is there */
};

bool api_runs_on_floats(const struct job *job, facet_tier tier)
{
    bool keeps_doubles = job->evaluation->representation.format != RESULTS_FLOAT32;
    return job->takes_floats && tier < (keeps_doubles ? FACET_EXACT32 : FACET_PRECISE);
}

static bool is_wanted(const struct job *job, int quantity)
{
    return job->outputs >> quantity & 1;
}

/* The channels that the material has; an answer may repeat one. */
static size_t columns_of(const struct job *job, int quantity)
{
    return api_quantity_is_coloured[quantity] ? job->surface.channels : 1;
}

/* ---- In doubles ------------------------------------------------------------------------------ */

static facet_status evaluate_doubles(const struct job *job, struct scratch *s, size_t at, size_t n)
{
    double *const in[6] = {s->in[0], s->in[1], s->in[2], s->in[3], s->in[4], s->in[5]};
    facet_outputs outputs = {0};
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (size_t c = 0; c < columns_of(job, q) && is_wanted(job, q); c++)
            outputs.of[q][c] = s->out[q][c];
    api_pairs_fill(&job->pairs, at, n, s->again, in);
    s->again = true;
    return api_surface_eval(&job->surface, job->promise.tier, job->evaluation->sampler,
                            (facet_vec3_in){in[0], in[1], in[2]},
                            (facet_vec3_in){in[3], in[4], in[5]}, n, &outputs);
}

/* False: a fault. */
static bool encode_doubles(const struct job *job, struct slot *slot, struct scratch *s, size_t at,
                           size_t n)
{
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!is_wanted(job, q)) continue;
        double *columns[3];
        size_t has = columns_of(job, q), where = 0;
        for (size_t c = 0; c < 3; c++) columns[c] = s->out[q][c < has ? c : 0];
        char *begin = slot->bytes[q] + slot->size[q], *end = begin;
        slot->fault = api_results_put(&job->results[q], columns, n, at == 0, &end, &where);
        if (slot->fault != RESULTS_SOUND) {
            slot->fault_of = q;
            slot->fault_at = at + where;
            return false;
        }
        slot->size[q] += (size_t)(end - begin);
    }
    return true;
}

/* ---- In floats ------------------------------------------------------------------------------- */

static facet_status evaluate_floats(const struct job *job, struct scratch *s, size_t at, size_t n)
{
    float *const in[6] = {s->float_in[0], s->float_in[1], s->float_in[2],
                          s->float_in[3], s->float_in[4], s->float_in[5]};
    const facet_vec3_in_float wi = {in[0], in[1], in[2]}, wo = {in[3], in[4], in[5]};
    facet_outputs_float outputs = {0};
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (size_t c = 0; c < columns_of(job, q) && is_wanted(job, q); c++)
            outputs.of[q][c] = s->float_out[q][c];
    api_pairs_fill_floats(&job->pairs, at, n, s->float_again, in);
    s->float_again = true;
    return facet_eval_sampled_float(job->surface.brdf, job->promise.tier, job->evaluation->sampler,
                                    wi, wo, n, &outputs);
}

/* Not where a result is beyond floats: doubles are then the ones to ask. */
static bool are_sound(const struct job *job, const struct scratch *s, size_t n)
{
    bool sound = true;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (size_t c = 0; c < columns_of(job, q) && is_wanted(job, q); c++)
            sound = sound && api_floats_are_sound(s->float_out[q][c], n);
    return sound;
}

static void encode_floats(const struct job *job, struct slot *slot, struct scratch *s, size_t n)
{
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!is_wanted(job, q)) continue;
        float *columns[3];
        size_t has = columns_of(job, q);
        for (size_t c = 0; c < 3; c++) columns[c] = s->float_out[q][c < has ? c : 0];
        char *p = slot->bytes[q] + slot->size[q];
        slot->size[q] += (size_t)(api_results_write_floats(job->results[q].width, columns, n, p) -
                                  p);
    }
}

static void widen(const struct job *job, struct scratch *s, size_t n)
{
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (size_t c = 0; c < columns_of(job, q) && is_wanted(job, q); c++)
            for (size_t i = 0; i < n; i++) s->out[q][c][i] = s->float_out[q][c][i];
}

/*
 * Microseconds since the last look at the clock: where one thing ends the next begins.  Only in a slot's
 * first block: a look costs a twentieth of a block's float32.
 */
static double lap(struct slot *slot, size_t at)
{
    if (at != slot->at) return 0;
    const double now = api_clock(), spent = now - slot->clock_us;
    slot->clock_us = now;
    return spent;
}

/* As in its first block it was divided in all of it. */
static void divide_time(struct slot *slot, double start)
{
    const double first = slot->compute_us + slot->encode_us;
    const double blocks = first > 0 ? (api_clock() - start) / first : 1;
    slot->compute_us *= blocks;
    slot->encode_us *= blocks;
}

/* Whether the block is done: not where a result is beyond floats. */
static bool run_floats(const struct job *job, struct slot *slot, struct scratch *s, size_t at,
                       size_t n)
{
    slot->status = evaluate_floats(job, s, at, n);
    slot->compute_us += lap(slot, at);
    if (slot->status) return true;
    bool sound = are_sound(job, s, n);
    if (sound && job->evaluation->representation.format == RESULTS_FLOAT32) {
        encode_floats(job, slot, s, n);
    } else if (sound) {
        widen(job, s, n);
        encode_doubles(job, slot, s, at, n);
    }
    slot->encode_us += lap(slot, at);
    return sound;
}

static bool run_doubles(const struct job *job, struct slot *slot, struct scratch *s, size_t at,
                        size_t n)
{
    slot->status = evaluate_doubles(job, s, at, n);
    slot->compute_us += lap(slot, at);
    bool ok = !slot->status && encode_doubles(job, slot, s, at, n);
    slot->encode_us += lap(slot, at);
    return ok;
}

void api_run_slot(void *job_, size_t index)
{
    struct job *job = job_;
    struct slot *slot = &job->slots[index];
    struct scratch scratch;
    bool on_floats = api_runs_on_floats(job, job->promise.tier);
    scratch.again = scratch.float_again = false;
    const double start = slot->clock_us = api_clock();
    for (size_t done = 0, n; done < slot->n && !slot->status && slot->fault == RESULTS_SOUND;
         done += n) {
        n = slot->n - done < BLOCK ? slot->n - done : BLOCK;
        if (on_floats && run_floats(job, slot, &scratch, slot->at + done, n)) continue;
        if (!run_doubles(job, slot, &scratch, slot->at + done, n)) return;
    }
    divide_time(slot, start);
}
