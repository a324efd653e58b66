/*
 * check.h - a test is TEST(name) { CHECK...; }, one program per file, main() in main.c.
 *
 * A failed check prints both operands and marks the test; the test goes on.
 * Output: one line "ok|FAIL|skip program/name [isa]" per test, which make counts.
 */
#ifndef CHECK_H
#define CHECK_H

#include "rng.h"

#include <stdbool.h>
#include <stddef.h>

typedef void check_fn(void);
void check_register(const char *name, check_fn *fn);

#define TEST(name)                                                                                 \
    static void test_##name(void);                                                                 \
    __attribute__((constructor)) static void register_##name(void)                                 \
    {                                                                                              \
        check_register(#name, test_##name);                                                        \
    }                                                                                              \
    static void test_##name(void)

/* Marks the running test as failed; printf-like. */
__attribute__((format(printf, 3, 4))) void check_fail(const char *file, int line,
                                                      const char *format, ...);
/* Marks the running test as skipped, with the reason; return right after. */
void check_skip(const char *why);
/* The largest value seen under this name is printed with the result: measured errors stay visible. */
void check_note(const char *name, double value);

#define CHECK(condition)                                                                           \
    do {                                                                                           \
        if (!(condition)) check_fail(__FILE__, __LINE__, "%s", #condition);                        \
    } while (0)

#define CHECK_INT(actual, expected)                                                                \
    do {                                                                                           \
        long long a_ = (long long)(actual), e_ = (long long)(expected);                            \
        if (a_ != e_) check_fail(__FILE__, __LINE__, "%s is %lld, not %lld", #actual, a_, e_);     \
    } while (0)

/* |actual - expected| <= bound max(|expected|, floor); NaN fails. */
#define CHECK_REL(actual, expected, bound, floor_)                                                 \
    do {                                                                                           \
        double a_ = (actual), e_ = (expected), b_ = (bound), f_ = (floor_);                        \
        if (!check_within(a_, e_, b_, f_))                                                         \
            check_fail(__FILE__, __LINE__, "%s is %.17g, not %.17g (bound %.3g)", #actual, a_, e_, \
                       b_);                                                                        \
    } while (0)

#define CHECK_STR(actual, expected)                                                                \
    do {                                                                                           \
        const char *a_ = (actual), *e_ = (expected);                                               \
        if (!check_same_text(a_, e_))                                                              \
            check_fail(__FILE__, __LINE__, "%s is \"%s\", not \"%s\"", #actual,                    \
                       a_ ? a_ : "(null)", e_ ? e_ : "(null)");                                    \
    } while (0)

/* The larger of two errors; NaN if one of them is, which fmax would forget. */
double check_worse(double a, double b);
bool check_within(double actual, double expected, double bound, double floor);
bool check_same_text(const char *a, const char *b);

/* The file's bytes, NUL-terminated, to be freed; NULL if it cannot be read. */
void *check_read_file(const char *path, size_t *size);
/* Path of a file in shared data, or NULL (skip then): $FACET_DATA, else ../shared/data. Static buffer. */
const char *check_data(const char *relative);

#endif
