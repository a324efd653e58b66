/* evaluate.h - what /v1/eval and /v1/pdf share: pairs in, arrays out (evaluate_job.h: how). */
#ifndef API_EVALUATE_H
#define API_EVALUATE_H

#include "endpoint.h"
#include "material.h"
#include "pairs.h"
#include "representation.h"
#include "tolerance.h"

#define CHANNELS_FIELD(type_)                                                                      \
    {                                                                                              \
        MEMBER(type_, channels), FIELD_INTEGER,                                                    \
            .min = 1, .max = 3,                                                                    \
            .doc = "3: [r,g,b] for coloured quantities even if the material is achromatic"         \
    }
#define FLAT_FIELD(type_)                                                                          \
    {                                                                                              \
        MEMBER(type_, flat), FIELD_BOOL, FIELD_DEFAULT,                                            \
            .doc = "arrays of vectors and colours as one flat list"                                \
    }
#define COUNT_FIELD(type_)                                                                         \
    {                                                                                              \
        MEMBER(type_, count), FIELD_INTEGER, FIELD_MUST, .min = 0, .max = 0x1p53,                  \
                                                         .doc = "elements of each array"           \
    }

struct evaluation {
    const struct material *material;
    const struct pair_request *pairs;
    const struct tolerance_request *accuracy;
    uint32_t outputs;      /* a bit per facet_quantity */
    facet_sampler sampler; /* whose pdf; AUTO becomes what it stands for */
    int64_t channels;      /* forced; -1: as the material has */
    bool flat;
    int dtype; /* index into api_dtype_names; -1: not given */
    /* Filled in: */
    struct text *of[FACET_QUANTITY_COUNT]; /* JSON; else all NULL */
    struct representation representation;
    struct named_results arrays[FACET_QUANTITY_COUNT];
    size_t array_count;
    struct job *job; /* what a stream goes on with; NULL: all is computed */
    size_t count;
    struct accuracy answer;
};

bool api_evaluate(struct call *call, struct evaluation *evaluation);
/* When call->out is filled, which an answer is printed from. */
bool api_answer_evaluation(struct call *call, const struct evaluation *evaluation);

/* channels as requested (-1: not), checked against what the material has; 0 and a problem if
 * impossible. */
size_t api_channels(int64_t requested, size_t material, struct problem *problem);
/* Why lib may promise nothing for a surface in any tier, and what helps. */
const char *api_bound_obstacle(const struct surface *surface, double condition, double depth_error,
                               double input_error);

/* 422 at /outputs where an answer would hold too many numbers. */
bool api_numbers_fit(size_t count, size_t per_element, struct problem *problem);

#endif
