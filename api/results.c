#include "results.h"

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
    *results = (struct results){.text = api_text(arena),
                                .format = format,
                                .width = width,
                                .flat = flat,
                                .digits = digits};
}

size_t api_number_size(enum results_format format)
{
    return format == RESULTS_JSON ? 0 : format == RESULTS_FLOAT32 ? sizeof(float) : sizeof(double);
}

/* Elements i .. i + n - 1 as JSON; their end. */
static char *write_json(const struct results *r, double *const columns[], size_t i, size_t n,
                        bool is_first, char *p)
{
    bool nested = r->width > 1 && !r->flat;
    for (size_t end = i + n; i < end; i++) {
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

static char *write_floats(size_t width, double *const columns[], size_t i, size_t n, char *p)
{
    for (size_t k = 0; k < width; k++)
        for (size_t j = 0; j < n; j++) {
            float x = (float)columns[k][i + j];
            memcpy(p + (j * width + k) * sizeof x, &x, sizeof x);
        }
    return p + n * width * sizeof(float);
}

static char *write_doubles(size_t width, double *const columns[], size_t i, size_t n, char *p)
{
    for (size_t k = 0; k < width; k++)
        for (size_t j = 0; j < n; j++)
            memcpy(p + (j * width + k) * sizeof(double), &columns[k][i + j], sizeof(double));
    return p + n * width * sizeof(double);
}

/* The largest number that rounds to a float. */
static const double float_max = 0x1.fffffefffffffp127;

static bool all_below(const struct results *r, double *const columns[], size_t n, double max)
{
    bool good = true;
    for (size_t k = 0; k < r->width; k++)
        for (size_t i = 0; i < n; i++) good &= fabs(columns[k][i]) <= max;
    return good;
}

/* Moves count to the first element beyond max. */
static bool find_fault(struct results *r, double *const columns[], size_t n)
{
    double max = r->format == RESULTS_FLOAT32 ? float_max : DBL_MAX;
    for (size_t i = 0; i < n; i++, r->count++)
        for (size_t k = 0; k < r->width; k++)
            if (!(fabs(columns[k][i]) <= max)) {
                r->fault = isfinite(columns[k][i]) ? RESULTS_TOO_LARGE : RESULTS_NOT_FINITE;
                return false;
            }
    return true;
}

bool api_results_add(struct results *r, double *const columns[], size_t n)
{
    if (!all_below(r, columns, n, r->format == RESULTS_FLOAT32 ? float_max : DBL_MAX))
        return find_fault(r, columns, n);
    for (size_t i = 0, some; i < n; i += some) {
        some = n - i < BLOCK ? n - i : BLOCK;
        char *begin = api_text_reserve(&r->text, some * (r->width * (NUMBER_ROOM + 1) + 3)), *end;
        if (!begin) return true; /* the text remembers */
        if (r->format == RESULTS_JSON)
            end = write_json(r, columns, i, some, !r->count && !i, begin);
        else if (r->format == RESULTS_FLOAT32)
            end = write_floats(r->width, columns, i, some, begin);
        else
            end = write_doubles(r->width, columns, i, some, begin);
        api_text_commit(&r->text, (size_t)(end - begin));
    }
    r->count += n;
    return true;
}

void api_results_close(struct results *results)
{
    if (results->format == RESULTS_JSON) api_text_put(&results->text, results->count ? "]" : "[]");
}
