/*
 * lift.h - arrays of numbers lifted out of JSON text before jansson sees it.
 *
 * jansson takes 50 bytes and 300 ns for a number; an array of them costs 8 bytes and 15 ns here.
 * What is left is the request's structure, in which an integer stands for each array and every
 * other number has a fraction or an exponent.
 */
#ifndef API_LIFT_H
#define API_LIFT_H

#include "arena.h"
#include "array.h"
#include "problem.h"

struct lifted {
    char *text; /* malloc'd, of `size` bytes */
    size_t size;
};

/*
 * Appends the arrays to document (its room growing in the arena) and writes the text.  False: a
 * problem, 400 with line and column for what is no JSON inside an array of numbers, for nesting
 * past the limit and for a NUL byte (which ends the text for jansson).
 */
bool api_lift(const char *bytes, size_t size, struct arena *arena, struct document *document,
              struct problem *problem, struct lifted *out);

/* Where in the bytes the offset-th byte of the text came from. */
size_t api_lift_origin(const char *bytes, size_t size, const struct lifted *lifted, size_t offset);

/* 400: not JSON, with line and column of that byte.  Returns false. */
bool api_lift_refuse(const char *bytes, size_t offset, const char *why, struct problem *problem);

/* One more array of the document; false: out of memory. */
bool api_document_add(struct document *document, struct arena *arena,
                      const struct number_array *array);

#endif
