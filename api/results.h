/*
 * results.h - arrays of results, encoded chunk by chunk while they are computed: as JSON, or as
 * little-endian float32 or float64.
 */
#ifndef API_RESULTS_H
#define API_RESULTS_H

#include "text.h"

#include <stdbool.h>

enum results_format { RESULTS_JSON, RESULTS_FLOAT32, RESULTS_FLOAT64 };

/* Bytes of a number; 0 for JSON. */
size_t api_number_size(enum results_format format);

enum results_fault { RESULTS_SOUND, RESULTS_NOT_FINITE, RESULTS_TOO_LARGE };

struct results {
    struct text text; /* or bytes */
    enum results_format format;
    size_t width;             /* numbers per element */
    bool flat;                /* JSON: [x,y,z,x,..] instead of [[x,y,z],..] */
    int digits;               /* JSON */
    size_t count;             /* elements so far */
    enum results_fault fault; /* of the element `count` */
};

void api_results_open(struct results *results, struct arena *arena, size_t width, bool flat,
                      int digits);
void api_results_open_as(struct results *results, struct arena *arena, enum results_format format,
                         size_t width, bool flat, int digits);

/*
 * n more elements, column k of each in columns[k].  False where one is not finite, or too large for
 * a float32: `count` and `fault` tell.
 */
bool api_results_add(struct results *results, double *const columns[], size_t n);
void api_results_close(struct results *results);

/*
 * The same in parts, into bytes that others join: bytes that n elements take at most; and n elements
 * written to *p, which moves to their end, or what is wrong with the first of them that is then `at`.
 * is_first: they open the array.
 */
size_t api_results_room(const struct results *results, size_t n);
enum results_fault api_results_put(const struct results *results, double *const columns[], size_t n,
                                   bool is_first, char **p, size_t *at);
/* Of FLOAT32, from floats; and whether none of them has saturated or is no number. */
bool api_floats_are_sound(const void *floats, size_t n);
char *api_results_write_floats(size_t width, float *const columns[], size_t n, char *p);

#endif
