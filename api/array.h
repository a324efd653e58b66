/*
 * array.h - an array of numbers in a request, whichever the encoding: JSON, or the bytes of a part.
 *
 * In a decoded request it stands as a JSON integer, its index among the document's arrays: no text
 * can spell one, since every number of the text becomes a JSON real.
 */
#ifndef API_ARRAY_H
#define API_ARRAY_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

enum array_type { ARRAY_DOUBLE, ARRAY_FLOAT };

enum array_flaw {
    ARRAY_SOUND,
    ARRAY_NO_NUMBER, /* element `column` (of `row`) is `what` */
    ARRAY_NO_ROW,    /* row `row` is `what` */
    ARRAY_RAGGED,    /* row `row` has `found` elements, not `columns` */
    ARRAY_CUT        /* raw bytes, `found`, that are no whole numbers of `columns` bytes */
};

struct number_array {
    enum array_type type;
    const void *data; /* DOUBLE: aligned.  FLOAT: little-endian float32 as they came, not aligned */
    size_t count;     /* of all numbers */
    bool nested;      /* rows, each of as many columns as the first */
    size_t rows, columns;
    enum array_flaw flaw; /* the first; the numbers behind it mean nothing */
    size_t row, column, found;
    const char *what;
};

/* A request: its JSON, and the arrays it refers to. */
struct document {
    json_t *root;
    struct number_array *arrays;
    size_t count, room;
    /* As in api_request: threads that help to read it. */
    void (*share)(void *crew, size_t count, void (*task)(void *arg, size_t index), void *arg);
    void *crew;
};

#endif
