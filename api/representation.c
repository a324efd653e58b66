#include "representation.h"

#include "media.h"
#include "npy.h"
#include "npz.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define JSON_TYPE "application/json"
#define BYTES_TYPE "application/octet-stream"
#define NPY_TYPE "application/x-npy"
#define NPZ_TYPE "application/zip"

const char *const api_array_answers[] = {BYTES_TYPE, NPY_TYPE, NPZ_TYPE, NULL};
const char *const api_dtype_names[] = {"float32", "float64", NULL};
enum { DTYPE_FLOAT32, DTYPE_FLOAT64 };

#define FLOAT_ROUNDING 0x1p-24 /* relative */

/* What the client accepts, as api_promise takes it. */
static double accepted(const struct tolerance_request *request)
{
    if (!isnan(request->tolerance)) return request->tolerance;
    return request->tier >= 0 ? INFINITY : TOLERANCE_DEFAULT;
}

/* Three significant digits, upwards, but not past a tolerance that the bound meets. */
static double shown(double bound, double tolerance)
{
    char text[NUMBER_ROOM];
    double up;
    snprintf(text, sizeof text, "%.2e", bound * 1.0051);
    up = strtod(text, NULL);
    return bound <= tolerance && up > tolerance ? tolerance : up;
}

bool api_represent(const struct call *call, int dtype, const struct tolerance_request *request,
                   size_t count, struct representation *out)
{
    const struct place at = {NULL, "dtype", 0};
    double tolerance = accepted(request);
    *out = (struct representation){.type = api_answer_type(call, JSON_TYPE)};
    if (!strcmp(out->type, JSON_TYPE)) return true;
    if (!strcmp(out->type, NPY_TYPE) && count != 1)
        return api_problem(call->problem, 406, "%s holds one array and %zu were asked for: use %s",
                           NPY_TYPE, count, NPZ_TYPE);
    if (dtype == DTYPE_FLOAT32 && tolerance <= FLOAT_ROUNDING)
        return api_problem_at(call->problem, &at,
                              "float32 rounds by %.2g, which is not below the tolerance %.3g",
                              FLOAT_ROUNDING, tolerance);
    bool is_float = dtype == DTYPE_FLOAT32 || (dtype < 0 && tolerance >= FLOAT_TOLERANCE);
    out->format = is_float ? RESULTS_FLOAT32 : RESULTS_FLOAT64;
    out->rounding = is_float ? FLOAT_ROUNDING : 0;
    return true;
}

double api_represented(const struct representation *representation, double bound)
{
    return bound + representation->rounding * (1 + bound);
}

void api_represent_bound(const struct representation *representation,
                         const struct tolerance_request *request, struct promise *promise)
{
    if (representation->format != RESULTS_JSON)
        promise->bound = shown(promise->arithmetic, accepted(request));
}

bool api_results_check(const struct results *results, const char *name, const char *what,
                       struct problem *problem)
{
    const struct place at = {NULL, "dtype", 0};
    if (results->fault == RESULTS_TOO_LARGE)
        return api_problem_at(
            problem, &at, "%s of %s %zu is too large for float32: \"dtype\":\"float64\" holds it",
            name, what, results->count);
    if (results->fault == RESULTS_NOT_FINITE)
        return api_problem(problem, 500, "%s of %s %zu is not finite", name, what, results->count);
    return true;
}

/* ---- Headers --------------------------------------------------------------------------------- */

static bool header_of(struct call *call, const char *name, const struct text *text)
{
    size_t size;
    char *value = api_text_take(text, &size);
    if (!value) return api_problem_memory(call->problem);
    bool fits = size < sizeof((struct api_header *)0)->value;
    if (fits) api_answer_header(call->response, name, "%s", value);
    free(value);
    return fits || api_problem(call->problem, 500, "the header %s does not fit", name);
}

bool api_represent_headers(struct call *call, const struct named_results *arrays, size_t count)
{
    struct text layout = api_text(call->arena), answer = api_text(call->arena);
    for (size_t i = 0; i < count; i++) {
        const struct results *r = arrays[i].results;
        api_text_print(&layout, "%s{\"name\":\"%s\",\"dtype\":\"%s\",\"shape\":[%zu", i ? "," : "[",
                       arrays[i].name, r->format == RESULTS_FLOAT32 ? "<f4" : "<f8", r->count);
        if (r->width > 1) api_text_print(&layout, ",%zu", r->width);
        api_text_put(&layout, "]}");
    }
    api_text_put(&layout, "]");
    api_encode(&answer, call->endpoint->response, call->out);
    return header_of(call, "Facet-Layout", &layout) && header_of(call, "Facet-Answer", &answer);
}

/* ---- Bodies ---------------------------------------------------------------------------------- */

static void join_arrays(struct text *text, const struct named_results *arrays, size_t count)
{
    for (size_t i = 0; i < count; i++) api_text_join(text, &arrays[i].results->text);
}

bool api_can_stream(const struct representation *representation)
{
    return strcmp(representation->type, NPZ_TYPE);
}

size_t api_prefix_size(const struct representation *representation)
{
    return strcmp(representation->type, NPY_TYPE) ? 0 : NPY_HEADER_SIZE;
}

bool api_prefix_piece(struct call *call, const struct representation *representation,
                      const struct results *r, struct piece *piece)
{
    *piece = (struct piece){"", api_prefix_size(representation)};
    if (!piece->size) return true;
    char *header = api_arena_alloc(call->arena, NPY_HEADER_SIZE);
    if (!header) return api_problem_memory(call->problem);
    api_npy_header(header, r->format == RESULTS_FLOAT32 ? ARRAY_FLOAT : ARRAY_DOUBLE, r->count,
                   r->width);
    piece->bytes = header;
    return true;
}

bool api_answer_arrays(struct call *call, const struct representation *representation,
                       const struct named_results *arrays, size_t count)
{
    struct text text = api_text(call->arena);
    bool is_npz = !strcmp(representation->type, NPZ_TYPE);
    size_t size;
    double start = api_clock();
    struct piece prefix;
    if (!api_represent_headers(call, arrays, count) ||
        !api_prefix_piece(call, representation, arrays->results, &prefix))
        return false;
    if (prefix.size) api_text_bytes(&text, prefix.bytes, prefix.size);
    if (is_npz)
        api_npz_write(&text, arrays, count);
    else
        join_arrays(&text, arrays, count);
    char *bytes = api_text_take(&text, &size);
    if (!bytes) return api_problem_memory(call->problem);
    if (is_npz) api_npz_sum((unsigned char *)bytes, size);
    call->response->trace.encode_us += api_clock() - start;
    return api_answer_raw(call, representation->type, bytes, size);
}
