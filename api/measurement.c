#include "measurement.h"

#include "bsdf.h"
#include "merl.h"
#include "samples.h"
#include "utia.h"

#include <math.h>

const char *const api_format_names[] = {"merl", "utia", "bsdf", "csv", NULL};

/* What starts like JSON is JSON; all else may be meant as a measurement. */
static bool anything_else(const unsigned char *bytes, size_t size)
{
    size_t i = 0;
    while (i < size &&
           (bytes[i] == ' ' || bytes[i] == '\t' || bytes[i] == '\n' || bytes[i] == '\r'))
        i++;
    return i == size || (bytes[i] != '{' && bytes[i] != '[');
}

const struct medium api_measurement_media[] = {
    [FORMAT_MERL] = {"application/x-merl-brdf", api_merl_matches},
    [FORMAT_UTIA] = {"application/x-utia-brdf", api_utia_matches},
    [FORMAT_BSDF] = {"application/x-rgl-bsdf", api_bsdf_matches},
    [FORMAT_CSV] = {"text/csv", api_csv_matches},
    [FORMAT_COUNT] = {"application/octet-stream", anything_else},
    {0},
};

static bool unknown(const unsigned char *bytes, size_t size, struct problem *problem)
{
    char first[3 * 4 + 1] = "none";
    static const char digit[] = "0123456789abcdef";
    for (size_t i = 0; i < 4 && i < size; i++) {
        first[3 * i] = digit[bytes[i] >> 4];
        first[3 * i + 1] = digit[bytes[i] & 15];
        first[3 * i + 2] = i == 3 || i + 1 == size ? '\0' : ' ';
    }
    return api_problem(
        problem, 422,
        "the body has %zu bytes, the first are %s: that is no measurement; needed is "
        "a MERL .binary (%d bytes), a UTIA .bin (%d bytes), an RGL .bsdf (starts "
        "with \"tensor_file\"), CSV with theta_i, phi_i, theta_o, phi_o, r, g, b, "
        "or JSON",
        size, first, MERL_SIZE, UTIA_SIZE);
}

bool api_measurement_open(const void *bytes, size_t size, int format, struct arena *arena,
                          struct problem *problem, struct measurement *m)
{
    *m = (struct measurement){.format = format};
    for (int k = 0; m->format < 0 && k < FORMAT_COUNT; k++)
        if (api_measurement_media[k].matches(bytes, size)) m->format = k;
    switch (m->format) {
    case FORMAT_MERL: {
        struct merl *merl = api_arena_alloc(arena, sizeof *merl);
        if (!merl) return api_problem_memory(problem);
        m->source = (facet_fit_source){api_merl_evaluate, merl, api_merl_slope_max(), false, NULL};
        return api_merl_open(bytes, size, merl, &m->counts, problem);
    }
    case FORMAT_UTIA: return api_utia_open(bytes, size, arena, problem, m);
    case FORMAT_BSDF: return api_bsdf_open(bytes, size, arena, problem, m);
    case FORMAT_CSV: return api_csv_open(bytes, size, arena, problem, m);
    default: return unknown(bytes, size, problem);
    }
}

struct data_counts api_count_samples(const facet_fit_samples *s)
{
    struct data_counts counts = {.values = (int64_t)s->count};
    for (size_t i = 0; i < s->count; i++)
        counts.negative += s->fr[0][i] < 0 || s->fr[1][i] < 0 || s->fr[2][i] < 0;
    return counts;
}
