/*
 * evaluate_job.h - how an evaluation runs: in rounds of chunks, each of which one thread stages,
 * evaluates and encodes, block by block, in a slot of its own.
 */
#ifndef API_EVALUATE_JOB_H
#define API_EVALUATE_JOB_H

#include "evaluate.h"

enum {
    CHUNK = 4096, /* pairs in a slot: what is shared among threads */
    BLOCK = 512,  /* pairs staged and evaluated at a time: they stay in the first-level cache */
    ROUND_BYTES = 1 << 21, /* of an answer, about, between two looks at the client */
    STREAM_BYTES =
        1
        << 20, /* the same of a stream: what a slow reader keeps, and at worst the network's thread computes */
    SLOTS_MIN = 8, /* of a round, where there are as many chunks */
    SLOTS_MAX = 128
};

struct slot {
    size_t at, n;                      /* pairs */
    char *bytes[FACET_QUANTITY_COUNT]; /* where its part of each array goes */
    size_t size[FACET_QUANTITY_COUNT]; /* bytes written there */
    facet_status status;
    enum results_fault fault; /* of pair fault_at, quantity fault_of */
    int fault_of;
    size_t fault_at;
    double compute_us, encode_us;
    double clock_us; /* the last look at it */
};

struct job {
    const struct evaluation *evaluation;
    struct surface surface;
    struct pairs pairs;
    struct promise promise;
    double condition;   /* facet_condition of all pairs */
    double input_error; /* of the directions, times facet_closeness of all pairs */
    facet_depth depth;  /* facet_depth_survey of all pairs */
    bool takes_floats;  /* the directions are floats, and the float calls do all that is asked */
    size_t channels;
    uint32_t outputs; /* of this round */
    struct slot *slots;
    size_t slot_count, used;
    struct results results[FACET_QUANTITY_COUNT];
    struct progress *progress; /* of a stream */
};

extern const bool api_quantity_is_coloured[];
extern const char *const api_quantity_names[];

/* Whether the tier runs on floats, in and out. */
bool api_runs_on_floats(const struct job *job, facet_tier tier);

/* One slot of a round, on any thread: nothing of the job but it is written. */
void api_run_slot(void *job, size_t index);

/* task(arg, 0) .. task(arg, count - 1), on as many threads as the server lends. */
void api_share(const struct call *call, size_t count, void (*task)(void *arg, size_t index),
               void *arg);

/* Room for the results of a round of the quantities of `outputs` (a stream's: one of them at a time). */
bool api_open_slots(const struct call *call, struct job *job, uint32_t outputs, bool streams);
/* Chunks from *at on, as many as there are slots; *at moves on.  False: a problem. */
bool api_run_round(struct call *call, struct job *job, uint32_t outputs, size_t *at);

/*
 * What the bound needs to know of all pairs before a tier can be chosen: only the thesis's shear,
 * directions that were computed and not sent, and tables seen from behind need it.  Fills condition, depth
 * and input_error.
 */
bool api_survey_pairs(struct call *call, struct job *job);

/* When call->out is filled: answers block by block. */
bool api_start_stream(struct call *call, struct job *job, const struct evaluation *evaluation);
/* Whether this answer is worth it. */
bool api_wants_stream(const struct call *call, const struct job *job);
/* Marks the arrays in the JSON that surrounds them. */
void api_mark_arrays(struct job *job, struct evaluation *evaluation, struct arena *arena);

static inline bool api_is_asked(const struct job *job, int quantity)
{
    return job->evaluation->outputs >> quantity & 1;
}

static inline size_t api_width_of(const struct job *job, int quantity)
{
    return api_quantity_is_coloured[quantity] ? job->channels : 1;
}

/* The largest facet_depth_error of all that is asked. */
double api_depth_error(const struct job *job, facet_tier tier, const facet_depth *depth);

size_t api_numbers_per_pair(const struct job *job);

#endif
