/*
 * text.h - growing text made of pieces in an arena.
 *
 * Nothing is copied as it grows, and one text is appended to another by moving
 * its pieces: an answer's arrays are printed apart from each other while they
 * are computed and joined once at the end.  A failed allocation is remembered
 * in `failed`; ask once at the end.
 */
#ifndef API_TEXT_H
#define API_TEXT_H

#include "arena.h"
#include "number.h"

#include <stdbool.h>
#include <stddef.h>

struct text {
    struct arena *arena;
    struct text_piece *first, *last;
    size_t size;
    bool failed;
};

struct text api_text(struct arena *arena);
/* Room for `size` bytes at the end, NULL if there is none; commit says how many were written. */
char *api_text_reserve(struct text *text, size_t size);
void api_text_commit(struct text *text, size_t size);
void api_text_bytes(struct text *text, const char *bytes, size_t size);
void api_text_put(struct text *text, const char *string);
/* At most a few hundred bytes in one call. */
__attribute__((format(printf, 2, 3))) void api_text_print(struct text *text, const char *format,
                                                          ...);
/* A JSON string with its quotes. */
void api_text_string(struct text *text, const char *string);
/* A finite number with `digits` significant digits; NUMBER_SHORTEST: the fewest that read back as
 * it. */
void api_text_number(struct text *text, double value, int digits);
/* Moves all of `tail` to the end of text; tail is empty afterwards. */
void api_text_join(struct text *text, struct text *tail);
/* One malloc'd, NUL-terminated copy; NULL if anything failed. */
char *api_text_take(const struct text *text, size_t *size);

#endif
