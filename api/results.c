#include "results.h"

#include "triples.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { BLOCK = 64 }; /* elements written between two looks at the room */

void api_results_open(struct results *results, struct arena *arena, size_t width, bool flat,
                      int digits)
{
    api_results_open_as(results, arena, RESULTS_JSON, width, flat, digits);
}

void api_results_open_as(struct results *results, struct arena *arena, enum results_format format,
                         size_t width, bool flat, int digits)
{
    *results = (struct results){
        .text = api_text(arena), .format = format, .width = width, .flat = flat, .digits = digits};
}

size_t api_number_size(enum results_format format)
{
    return format == RESULTS_JSON ? 0 : format == RESULTS_FLOAT32 ? sizeof(float) : sizeof(double);
}

size_t api_results_room(const struct results *r, size_t n)
{
    return r->format == RESULTS_JSON ? n * (r->width * (NUMBER_ROOM + 1) + 3)
                                     : n * r->width * api_number_size(r->format);
}

static char *write_json(const struct results *r, double *const columns[], size_t n, bool is_first,
                        char *p)
{
    bool nested = r->width > 1 && !r->flat;
    for (size_t i = 0; i < n; i++) {
        *p++ = is_first ? '[' : ',';
        is_first = false;
        if (nested) *p++ = '[';
        for (size_t k = 0; k < r->width; k++) {
            if (k) *p++ = ',';
            p += r->digits == NUMBER_SHORTEST
                     ? api_number_print(p, columns[k][i])
                     : api_number_print_digits(p, columns[k][i], r->digits);
        }
        if (nested) *p++ = ']';
    }
    return p;
}

static char *write_doubles(size_t width, double *const columns[], size_t n, char *p)
{
    for (size_t k = 0; k < width; k++)
        for (size_t i = 0; i < n; i++)
            memcpy(p + (i * width + k) * sizeof(double), &columns[k][i], sizeof(double));
    return p + n * width * sizeof(double);
}

static char *write_rounded(size_t width, double *const columns[], size_t n, char *p)
{
    size_t done = width == 1 ? put_narrowed(p, columns[0], n) : 0;
    for (size_t k = 0; k < width; k++)
        for (size_t i = done; i < n; i++) {
            float x = (float)columns[k][i];
            memcpy(p + (i * width + k) * sizeof x, &x, sizeof x);
        }
    return p + n * width * sizeof(float);
}

bool api_floats_are_sound(const void *floats, size_t n)
{
    const char *p = floats;
    const float4 most = {FLT_MAX, FLT_MAX, FLT_MAX, FLT_MAX};
    int4 good = {-1, -1, -1, -1};
    bool rest = true;
    size_t i = 0;
    for (; i + 4 <= n; i += 4) {
        float4 v;
        memcpy(&v, p + i * sizeof(float), sizeof v);
        good &= (v < most) & (v > -most);
    }
    for (; i < n; i++) {
        float x;
        memcpy(&x, p + i * sizeof x, sizeof x);
        rest &= fabsf(x) < FLT_MAX;
    }
    return rest & !!(good[0] & good[1] & good[2] & good[3]);
}

char *api_results_write_floats(size_t width, float *const columns[], size_t n, char *p)
{
    if (width == 1) memcpy(p, columns[0], n * sizeof(float));
    for (size_t k = 0; k < width && width > 1; k++)
        for (size_t i = 0; i < n; i++)
            memcpy(p + (i * width + k) * sizeof(float), &columns[k][i], sizeof(float));
    return p + n * width * sizeof(float);
}

/* The largest number that rounds to a float. */
static const double float_max = 0x1.fffffefffffffp127;

static bool all_below(const struct results *r, double *const columns[], size_t n, double max)
{
    const double2 most = {max, max};
    int4 good = {-1, -1, -1, -1}; /* two halves each */
    bool rest = true;
    for (size_t k = 0; k < r->width; k++) {
        size_t i = 0;
        for (; i + 2 <= n; i += 2) {
            double2 v;
            memcpy(&v, columns[k] + i, sizeof v);
            good &= (int4)(v <= most) & (int4)(v >= -most);
        }
        for (; i < n; i++) rest &= fabs(columns[k][i]) <= max;
    }
    return rest & !!(good[0] & good[1] & good[2] & good[3]);
}

static enum results_fault fault_of(const struct results *r, double *const columns[], size_t n,
                                   size_t *at)
{
    double max = r->format == RESULTS_FLOAT32 ? float_max : DBL_MAX;
    if (all_below(r, columns, n, max)) return RESULTS_SOUND;
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < r->width; k++) {
            double x = columns[k][i];
            *at = i;
            if (!(fabs(x) <= max)) return isfinite(x) ? RESULTS_TOO_LARGE : RESULTS_NOT_FINITE;
        }
    return RESULTS_SOUND;
}

enum results_fault api_results_put(const struct results *r, double *const columns[], size_t n,
                                   bool is_first, char **p, size_t *at)
{
    char *begin = *p;
    if (r->format == RESULTS_FLOAT32) {
        /* Looked at as they are written: half as many bytes. */
        *p = write_rounded(r->width, columns, n, begin);
        if (api_floats_are_sound(begin, n * r->width)) return RESULTS_SOUND;
    }
    enum results_fault fault = fault_of(r, columns, n, at);
    if (fault == RESULTS_SOUND && r->format == RESULTS_JSON)
        *p = write_json(r, columns, n, is_first, begin);
    else if (fault == RESULTS_SOUND && r->format == RESULTS_FLOAT64)
        *p = write_doubles(r->width, columns, n, begin);
    return fault;
}

bool api_results_add(struct results *r, double *const columns[], size_t n)
{
    for (size_t i = 0, some; i < n; i += some) {
        some = n - i < BLOCK ? n - i : BLOCK;
        double *here[3];
        size_t at = 0;
        for (size_t k = 0; k < r->width; k++) here[k] = columns[k] + i;
        char *begin = api_text_reserve(&r->text, api_results_room(r, some)), *end = begin;
        if (!begin) return true; /* the text remembers */
        r->fault = api_results_put(r, here, some, !r->count, &end, &at);
        r->count += r->fault == RESULTS_SOUND ? some : at;
        if (r->fault != RESULTS_SOUND) return false;
        api_text_commit(&r->text, (size_t)(end - begin));
    }
    return true;
}

void api_results_close(struct results *results)
{
    if (results->format == RESULTS_JSON) api_text_put(&results->text, results->count ? "]" : "[]");
}
