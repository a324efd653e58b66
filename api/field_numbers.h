/*
 * field_numbers.h - the part of field.c that decodes arrays of numbers, whichever their encoding,
 * and the checks of single numbers that both share.
 */
#ifndef API_FIELD_NUMBERS_H
#define API_FIELD_NUMBERS_H

#include "field.h"

/* Of a decoded JSON value; one that stands for an array of the document is an array. */
bool api_json_is_number(const json_t *json);
bool api_json_is_array(const json_t *json);
/* "a number", "an array", ... */
const char *api_json_type_name(const json_t *json);
/* 422: must be `expected`, not what it is.  Returns false. */
bool api_wrong_type(const json_t *json, const char *expected, const struct place *place,
                    struct decoder *decoder);

/* Whether so many elements are allowed; else 422. */
bool api_check_count(size_t count, const struct field *field, const struct place *place,
                     struct decoder *decoder);
/* Whether x is finite and in range; else 422. */
bool api_check_number(double x, const struct field *field, const struct place *place,
                      struct decoder *decoder);

/* COLOUR, NUMBERS, VECTORS, MATRIX, PRINTED; out: the member. */
bool api_decode_numbers(const json_t *json, const struct field *field, void *out,
                        const struct place *place, struct decoder *decoder);

#endif
