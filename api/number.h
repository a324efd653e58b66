/*
 * number.h - decimal text to double and back, exactly.
 *
 * Both directions multiply a 64-bit significand by a 128-bit power of ten and look whether the
 * error of that product can matter: if it can (about once in 2^60 random numbers, and for exact
 * halves) the C library decides.  So every result is the correctly rounded one.  The method is
 * that of Lemire 2021, "Number Parsing at a Gigabyte per Second"; the shortest digits are found as
 * by Giulietti 2020, "The Schubfach way to render doubles".
 */
#ifndef API_NUMBER_H
#define API_NUMBER_H

#include <stdbool.h>
#include <stddef.h>

/*
 * The JSON number (RFC 8259 section 6) that begins at `at`, nearest double, ties to even; an
 * infinity where it is too large.  Returns its end, or NULL where no number begins.  Reads nothing
 * at or past `end`.
 */
const char *api_number_parse(const char *at, const char *end, double *value);

/*
 * Numbers separated by commas and white space, at most `room` of them; how many.  *at moves to what
 * is not taken; *expecting: another element belongs there, since nothing or a comma came before.
 */
size_t api_number_run(const char **at, const char *end, double *out, size_t room, bool *expecting);

/*
 * Behind a row of an array: as many more of ",[x,y,..]" as are whole and fit, each of so many columns;
 * their number.  *at moves behind the last of them.
 */
size_t api_number_rows(const char **at, const char *end, double *out, size_t room, size_t columns);

/* Room for any number printed here; no NUL is written past it. */
enum { NUMBER_ROOM = 40, NUMBER_SHORTEST = 0, NUMBER_DIGITS_MAX = 17 };

/*
 * Shortest decimal that reads back as value, with the shorter of 1e4 and 10000; NUL-terminated.
 * Returns its length.  "null" for what is not finite.
 */
int api_number_print(char *out, double value);

/*
 * The same of value rounded to so many significant digits, 1 .. 17; trailing zeros are dropped.
 * What would round to more than the largest double keeps all its digits.
 */
int api_number_print_digits(char *out, double value, int digits);

#endif
