/* sample_floats.h - samples in float32 from wo and u as they were sent, to an answer in float32. */
#ifndef API_SAMPLE_FLOATS_H
#define API_SAMPLE_FLOATS_H

#include "directions.h"
#include "material.h"
#include "pairs.h"
#include "results.h"

enum { SAMPLE_FLOATS_MAX = 512 }; /* at a time */

struct float_samples {
    const struct surface *surface;
    facet_tier tier;
    facet_sampler sampler;
    const struct plan *wo;
    const struct sent_numbers *u;
    const struct pairing *pairing;         /* first: wo, second: u */
    struct results *wi, *weight, *pdf, *h; /* NULL: not asked for */
    size_t wasted;
};

/* Whether all of it is floats: u and wo as sent, the surface, the answer; and the tier has them. */
bool api_takes_float_samples(const struct float_samples *job, enum results_format format);

/*
 * Samples start .. start + n - 1 appended to the results.  False where one is beyond floats, or the
 * sampler will not: then nothing is, and doubles are the ones to ask.
 */
bool api_add_float_samples(struct float_samples *job, size_t start, size_t n);

#endif
