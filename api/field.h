/*
 * field.h - field tables: one table per JSON object, read four times.
 *
 * A table describes the members of a C struct.  It decodes JSON (and query
 * members) into the struct, prints the struct as JSON, prints itself as OpenAPI,
 * and says what is wrong where.  Members not in the table are refused.
 *
 * An absent member leaves a value that no request can contain (see below), and
 * such values are left out when printing.
 */
#ifndef API_FIELD_H
#define API_FIELD_H

#include "arena.h"
#include "array.h"
#include "problem.h"
#include "text.h"

#include <stdint.h>

enum field_type {
    FIELD_END,     /* ends a table */
    FIELD_NUMBER,  /* double; absent NaN */
    FIELD_INTEGER, /* int64_t; absent -1 */
    FIELD_BOOL,    /* bool; absent false, printed but where it is the default */
    FIELD_ENUM,    /* int, index into names; absent -1.  JSON true means the name "true" */
    FIELD_SET,     /* uint32_t, a bit per name; absent 0 */
    FIELD_TEXT,    /* const char *; absent NULL */
    FIELD_COLOUR,  /* struct colour: x or [r,g,b]; absent channels = 0 */
    FIELD_NUMBERS, /* struct numbers; absent values = NULL */
    FIELD_VECTORS, /* struct numbers of `width` each: [[x,y,z],..] or [x,y,z,..]; absent values =
                      NULL */
    FIELD_MATRIX,  /* struct matrix: rows of equal length; with width 1 also a plain list, which is
                      one column; absent values = NULL */
    FIELD_OBJECT,  /* struct in place, by `fields` */
    FIELD_OPTION,  /* pointer to a struct of `size` bytes, by `fields`; absent NULL */
    FIELD_LIST,    /* struct list of structs of `size` bytes, by `fields`; absent items = NULL */
    FIELD_UNION,   /* struct that starts with int form, the index into `fields` of the alternative
                      whose JSON type matches; the alternatives' offsets are into that struct;
                      absent form = -1 */
    FIELD_WORD,    /* an alternative of a union: the string `name`, which stores nothing */
    FIELD_PRINTED, /* struct text *, answers only: an array printed elsewhere, of `width` numbers
                      per element (0: either one or three); absent NULL */
};

enum field_presence { FIELD_MAY, FIELD_MUST, FIELD_DEFAULT };

struct colour {
    size_t channels; /* 1 or 3 */
    double value[3];
};

struct numbers {
    size_t count; /* of numbers, or of vectors */
    const double *values;
};

/*
 * The member of an as_sent field: little-endian float32, not aligned, or else doubles.  Floats of a
 * field without range have not been looked at: they may be infinite or NaN.
 */
struct sent_numbers {
    struct numbers numbers; /* values NULL with floats */
    const void *floats;
};

struct matrix {
    size_t rows, columns;
    const double *values; /* row after row */
};

struct list {
    size_t count;
    const void *items;
};

struct decoder {
    struct arena *arena;
    struct problem *problem;
    facet_watch watch; /* of the request; some fields take long to make */
};

struct field {
    const char *name;
    size_t offset;
    enum field_type type; /* these two follow MEMBER(...) by position: */
    enum field_presence
        presence;             /* {MEMBER(struct s, n), FIELD_INTEGER, FIELD_MUST, .min = 1, ...} */
    double min, max;          /* range of each number if min < max */
    bool open_min, open_max;  /* the end itself is outside */
    double initial;           /* with FIELD_DEFAULT: the value, index, mask or form */
    const char *const *names; /* ENUM, SET: NULL-terminated */
    const struct field *fields;
    size_t size;                 /* OPTION, LIST */
    size_t width;                /* VECTORS, PRINTED, MATRIX */
    size_t min_items, max_items; /* NUMBERS, VECTORS, LIST; max 0: unlimited */
    bool as_sent;                /* NUMBERS, VECTORS: struct sent_numbers */
    bool one_of;                 /* OBJECT, OPTION: exactly one member */
    /* Called on a struct decoded without error: what a table cannot say. */
    bool (*check)(void *object, const struct place *place, struct decoder *decoder);
    const char *doc;
    const char *unit;
};

/* .name and .offset of a member whose JSON name is its C name. */
#define MEMBER(type_, member_) .name = #member_, .offset = offsetof(type_, member_)

/* Decode a JSON object; false with errors in decoder->problem. */
bool api_decode(const json_t *json, const struct field *fields, void *object,
                const struct place *place, struct decoder *decoder);
/*
 * The members of a query (a=1&b=x) by the same table: numbers and words stand
 * without quotes; only flat members can be written so.  With json not NULL its
 * members and those of the query are decoded together.
 */
bool api_decode_query(const char *query, const json_t *json, const struct field *fields,
                      void *object, struct decoder *decoder);
/* Every member absent or at its default. */
void api_field_clear(const struct field *fields, void *object);

/* Whether a member says more than that it is absent or at its default; for words, options and numbers. */
bool api_field_is_given(const struct field *field, const void *object);

/* Print a struct as a JSON object. */
void api_encode(struct text *text, const struct field *fields, const void *object);

/* "[1e-8, 1e4]", "(0, 1)"; for error details and documents. */
void api_field_range(const struct field *field, char *out, size_t room);

#endif
