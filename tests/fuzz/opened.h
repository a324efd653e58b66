/* opened.h - a fuzzed body through one reader, and what it then says of a few directions. */
#ifndef FUZZ_OPENED_H
#define FUZZ_OPENED_H

#include "measurement.h"

#include <math.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Every answer must be finite where it is valid. */
static inline void fuzz_ask(const facet_fit_source *source)
{
    enum { N = 16 };
    double v[6][N], fr[3][N], *const out[3] = {fr[0], fr[1], fr[2]};
    bool valid[N];
    for (int k = 0; k < N; k++) {
        double ti = k % 4 * 0.52, pi = k * 1.1, to = k / 4 * 0.51, po = k * -0.7;
        v[0][k] = sin(ti) * cos(pi), v[1][k] = sin(ti) * sin(pi), v[2][k] = cos(ti);
        v[3][k] = sin(to) * cos(po), v[4][k] = sin(to) * sin(po), v[5][k] = cos(to);
    }
    if (source->samples) {
        for (size_t i = 0; i < source->samples->count; i++)
            for (int c = 0; c < 3; c++)
                if (!isfinite(source->samples->fr[c][i]) || !(source->samples->wi.z[i] > 0))
                    abort();
        return;
    }
    if (source->evaluate(source->user, (facet_vec3_in){v[0], v[1], v[2]},
                         (facet_vec3_in){v[3], v[4], v[5]}, N, out, valid) != FACET_OK)
        abort();
    for (int k = 0; k < N; k++)
        for (int c = 0; c < 3; c++)
            if (valid[k] && !isfinite(fr[c][k])) abort();
}

/* Opens the bytes as this format; a refusal must be a 422 or 503 with a text. */
static inline int fuzz_open(const uint8_t *data, size_t size, int format)
{
    struct arena arena;
    struct problem problem = {0};
    struct measurement m;
    api_arena_open(&arena, (size_t)1 << 28);
    if (api_measurement_open(data, size, format, &arena, &problem, &m))
        fuzz_ask(&m.source);
    else if ((problem.status != 422 && problem.status != 503) || !*problem.detail)
        abort();
    api_arena_close(&arena);
    return 0;
}

#endif
