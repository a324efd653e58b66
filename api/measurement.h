/*
 * measurement.h - a measured BRDF in a request's body, whatever its format.
 *
 * Told by content or by a `format` given; what is missing or negative is handled
 * by each format's rule and counted.
 */
#ifndef API_MEASUREMENT_H
#define API_MEASUREMENT_H

#include "arena.h"
#include "endpoint.h"
#include "facet_fit.h"
#include "problem.h"

enum { FORMAT_MERL, FORMAT_UTIA, FORMAT_BSDF, FORMAT_CSV, FORMAT_COUNT };
extern const char *const api_format_names[];
/* For endpoint.bodies: one per format, then one for what no format knows. */
extern const struct medium api_measurement_media[];

/* Colours in the data: all there are, those without data, those with a negative channel. */
struct data_counts {
    int64_t values, missing, negative;
};

struct measurement {
    int format;
    facet_fit_source source;
    struct data_counts counts;
};

/*
 * format: FORMAT_* as requested, -1: by content.  The bytes are borrowed, the rest
 * lives in the arena.  422 says what was found and what is needed.
 */
bool api_measurement_open(const void *bytes, size_t size, int format, struct arena *arena,
                          struct problem *problem, struct measurement *measurement);

/* Counts of samples given as numbers. */
struct data_counts api_count_samples(const facet_fit_samples *samples);

#endif
