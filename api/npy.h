/* npy.h - NumPy's .npy files: version 1 to 3, little-endian float32 or float64 (NEP 1). */
#ifndef API_NPY_H
#define API_NPY_H

#include "arena.h"
#include "array.h"
#include "problem.h"

bool api_npy_is(const void *bytes, size_t size);

/*
 * One or two dimensions.  The array refers to the bytes; in Fortran order to a copy in the arena.
 * False: 422 at place.
 */
bool api_npy_read(const void *bytes, size_t size, const struct place *place, struct arena *arena,
                  struct problem *problem, struct number_array *array);

enum { NPY_HEADER_SIZE = 128 };

/* The header of `rows` vectors of `columns` (1: no second dimension), before their bytes. */
void api_npy_header(char out[NPY_HEADER_SIZE], enum array_type type, size_t rows, size_t columns);

#endif
