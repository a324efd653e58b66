#include "lift.h"

#include "lift_rows.h"
#include "limits.h"
#include "number.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SMALL = 64 }; /* numbers that are gathered on the stack */

struct scan {
    const char *begin, *at, *end;
    int depth;
    struct arena *arena;
    struct document *document;
    struct problem *problem;
    char *text;
    size_t size, room;
};

/* Numbers as they are found: few on the stack, more in memory that grows. */
struct gathered {
    struct scan *scan;
    double small[SMALL];
    double *values;
    size_t count, room;
};

bool api_lift_refuse(const char *bytes, size_t offset, const char *why, struct problem *problem)
{
    int line = 1;
    size_t start = 0;
    for (size_t i = 0; i < offset; i++)
        if (bytes[i] == '\n') {
            line++;
            start = i + 1;
        }
    return api_problem(problem, 400, "not JSON: line %d column %zu: %s", line, offset - start + 1,
                       why);
}

static bool refuse(struct scan *scan, const char *why)
{
    return api_lift_refuse(scan->begin, (size_t)(scan->at - scan->begin), why, scan->problem);
}

static bool put(struct scan *scan, const char *bytes, size_t size)
{
    if (size > scan->room - scan->size) {
        size_t room = 2 * (scan->size + size) + 256;
        char *more = realloc(scan->text, room);
        if (!more) return api_problem_memory(scan->problem);
        scan->text = more;
        scan->room = room;
    }
    memcpy(scan->text + scan->size, bytes, size);
    scan->size += size;
    return true;
}

bool api_document_add(struct document *document, struct arena *arena,
                      const struct number_array *array)
{
    if (document->count == document->room) {
        size_t room = document->room ? 2 * document->room : 8;
        struct number_array *more = api_arena_alloc(arena, room * sizeof *more);
        if (!more) return false;
        if (document->count) memcpy(more, document->arrays, document->count * sizeof *more);
        document->arrays = more;
        document->room = room;
    }
    document->arrays[document->count++] = *array;
    return true;
}

/* ---- Numbers ------------------------------------------------------------------------------- */

static void discard(struct gathered *numbers)
{
    if (numbers->values != numbers->small) free(numbers->values);
    numbers->values = numbers->small;
}

/* For at least one more; realloc moves pages, not bytes, once there are many. */
static bool grow_to(struct gathered *numbers, size_t least)
{
    size_t room = numbers->room + numbers->room / 2;
    if (room < least) room = least;
    double *more = NULL;
    if (room <= numbers->scan->arena->room / sizeof *more)
        more = realloc(numbers->values == numbers->small ? NULL : numbers->values,
                       room * sizeof *more);
    if (!more) return false;
    if (numbers->values == numbers->small) memcpy(more, numbers->small, sizeof numbers->small);
    numbers->values = more;
    numbers->room = room;
    return true;
}

static bool grow(struct gathered *numbers)
{
    return grow_to(numbers, 0);
}

static bool take_numbers(void *numbers_, const double *values, size_t n)
{
    struct gathered *numbers = numbers_;
    if (n > numbers->room - numbers->count && !grow_to(numbers, numbers->count + n)) return false;
    if (n) memcpy(numbers->values + numbers->count, values, n * sizeof *values);
    numbers->count += n;
    return true;
}

/* The numbers to the arena; NULL: out of memory. */
static const double *keep(struct gathered *numbers)
{
    struct arena *arena = numbers->scan->arena;
    size_t bytes = numbers->count * sizeof(double);
    if (numbers->values == numbers->small) {
        double *copy = api_arena_doubles(arena, numbers->count);
        if (copy) memcpy(copy, numbers->small, bytes);
        return copy;
    }
    double *values = realloc(numbers->values, bytes);
    if (!values) values = numbers->values;
    numbers->values = numbers->small;
    return api_arena_adopt(arena, values, bytes);
}

/* ---- Arrays ---------------------------------------------------------------------------------- */

enum outcome {
    LIFTED,
    LEFT,  /* it holds something else: jansson's */
    FAILED /* a problem is set */
};

static void skip_space(struct scan *scan)
{
    while (scan->at < scan->end &&
           (*scan->at == ' ' || *scan->at == '\n' || *scan->at == '\t' || *scan->at == '\r'))
        scan->at++;
}

/* The next byte that is no white space; 0 at the end. */
static char next(struct scan *scan)
{
    skip_space(scan);
    return scan->at < scan->end ? *scan->at : 0;
}

static bool starts_number(char c)
{
    return c == '-' || (c >= '0' && c <= '9');
}

/* null, true or false at this place; NULL if it is none. */
static const char *literal(struct scan *scan)
{
    static const struct {
        const char *word, *what;
    } literals[] = {{"null", "null"}, {"true", "a boolean"}, {"false", "a boolean"}};
    for (size_t i = 0; i < sizeof literals / sizeof *literals; i++) {
        size_t n = strlen(literals[i].word);
        if ((size_t)(scan->end - scan->at) < n || memcmp(scan->at, literals[i].word, n)) continue;
        scan->at += n;
        return literals[i].what;
    }
    return NULL;
}

static void flaw_at(struct number_array *array, enum array_flaw flaw, size_t column,
                    const char *what)
{
    if (array->flaw) return;
    array->flaw = flaw;
    array->row = array->rows;
    array->column = column;
    array->what = what;
}

/* What stands where a number or a row should: a literal is a flaw, what holds more is left. */
static enum outcome take_other(struct scan *scan, struct number_array *array, enum array_flaw flaw,
                               size_t column)
{
    double value;
    char c = next(scan);
    if (c == '[' || c == '{' || c == '"') return LEFT;
    const char *what = literal(scan), *end;
    if (!what && flaw == ARRAY_NO_ROW && (end = api_number_parse(scan->at, scan->end, &value))) {
        what = "a number";
        scan->at = end;
    }
    if (!what) {
        bool is_number = api_number_parse(scan->at, scan->end, &value);
        refuse(scan, is_number ? "the number is too large" : "a number is expected");
        return FAILED;
    }
    flaw_at(array, flaw, column, what);
    return LIFTED;
}

/* Behind an element: a comma, with more to come, or the closing bracket. */
static enum outcome take_separator(struct scan *scan, bool *ended)
{
    char c = next(scan);
    if (c != ',' && c != ']') {
        refuse(scan, ", or ] is expected");
        return FAILED;
    }
    scan->at++;
    *ended = c == ']';
    return LIFTED;
}

/* Behind the opening bracket of a list that is not empty. */
static enum outcome take_list(struct scan *scan, struct number_array *array,
                              struct gathered *numbers, size_t *length)
{
    size_t n = 0, taken;
    for (bool expecting, ended = false; !ended;) {
        if (numbers->count == numbers->room && !grow(numbers)) {
            api_problem_memory(scan->problem);
            return FAILED;
        }
        double *values = numbers->values + numbers->count;
        taken = api_number_run(&scan->at, scan->end, values, numbers->room - numbers->count,
                               &expecting);
        numbers->count += taken;
        n += taken;
        if (taken && expecting && numbers->count == numbers->room) continue;
        enum outcome outcome = LIFTED;
        if (expecting) outcome = take_other(scan, array, ARRAY_NO_NUMBER, n++);
        if (outcome == LIFTED) outcome = take_separator(scan, &ended);
        if (outcome != LIFTED) return outcome;
    }
    *length = n;
    return LIFTED;
}

/* One element of an array of rows. */
static enum outcome take_row(struct scan *scan, struct number_array *array,
                             struct gathered *numbers)
{
    size_t length = 0;
    if (next(scan) != '[') {
        enum outcome outcome = take_other(scan, array, ARRAY_NO_ROW, 0);
        array->rows++;
        return outcome;
    }
    scan->at++;
    if (next(scan) == ']')
        scan->at++;
    else if (!array->rows && !starts_number(next(scan)))
        return LEFT;
    else {
        enum outcome outcome = take_list(scan, array, numbers, &length);
        if (outcome != LIFTED) return outcome;
    }
    if (!array->rows) array->columns = length;
    if (length != array->columns && !array->flaw) {
        flaw_at(array, ARRAY_RAGGED, 0, NULL);
        array->found = length;
    }
    array->rows++;
    return LIFTED;
}

/* What follows a row and is like it: all the others, of an array that is large and sound. */
static enum outcome take_like_rows(struct scan *scan, struct number_array *array,
                                   struct gathered *numbers)
{
    size_t before = numbers->count;
    if (!array->columns || array->flaw) return LIFTED;
    if (array->rows == 1 && !api_lift_rows(scan->document, &scan->at, scan->end, array->columns,
                                           take_numbers, numbers)) {
        api_problem_memory(scan->problem);
        return FAILED;
    }
    numbers->count += array->columns *
                      api_number_rows(&scan->at, scan->end, numbers->values + numbers->count,
                                      numbers->room - numbers->count, array->columns);
    array->rows += (numbers->count - before) / array->columns;
    return LIFTED;
}

static enum outcome take_array(struct scan *scan, struct number_array *array,
                               struct gathered *numbers)
{
    size_t length;
    scan->at++;
    char c = next(scan);
    if (starts_number(c)) return take_list(scan, array, numbers, &length);
    if (c != '[' || scan->depth + 2 > LIMIT_JSON_DEPTH) return LEFT;
    array->nested = true;
    for (bool ended = false; !ended;) {
        enum outcome outcome = take_row(scan, array, numbers);
        if (outcome == LIFTED) outcome = take_like_rows(scan, array, numbers);
        if (outcome == LIFTED) outcome = take_separator(scan, &ended);
        if (outcome != LIFTED) return outcome;
    }
    return array->columns ? LIFTED : LEFT;
}

static enum outcome lift_array(struct scan *scan)
{
    const char *begin = scan->at;
    struct number_array array = {.type = ARRAY_DOUBLE};
    struct gathered numbers = {.scan = scan, .room = SMALL};
    char index[24];
    numbers.values = numbers.small;
    enum outcome outcome = LEFT;
    if (scan->depth < LIMIT_JSON_DEPTH) outcome = take_array(scan, &array, &numbers);
    if (outcome == LIFTED) {
        array.data = keep(&numbers);
        array.count = numbers.count;
        /* Between spaces, lest it join what else stands there: [1][2], [1]25. */
        int n = snprintf(index, sizeof index, " %zu ", scan->document->count);
        if (!array.data || !api_document_add(scan->document, scan->arena, &array)) {
            api_problem_memory(scan->problem);
            outcome = FAILED;
        } else if (!put(scan, index, (size_t)n)) {
            outcome = FAILED;
        }
    }
    discard(&numbers);
    if (outcome == LEFT) scan->at = begin;
    return outcome;
}

/* ---- The structure around them ---------------------------------------------------------------- */

/* A string as it stands, to its closing quote or the end. */
static bool copy_string(struct scan *scan)
{
    const char *begin = scan->at++;
    for (; scan->at < scan->end && *scan->at != '"'; scan->at++) {
        if (!*scan->at) return refuse(scan, "a NUL byte");
        if (*scan->at == '\\' && scan->at + 1 < scan->end && scan->at[1]) scan->at++;
    }
    if (scan->at < scan->end) scan->at++;
    return put(scan, begin, (size_t)(scan->at - begin));
}

/* What jansson takes for one number, if it is one: never an integer. */
static bool copy_number(struct scan *scan)
{
    const char *begin = scan->at;
    bool is_real = false;
    for (; scan->at < scan->end; scan->at++) {
        char c = *scan->at;
        bool marks = c == '.' || c == 'e' || c == 'E';
        if (!marks && !starts_number(c) && c != '+') break;
        is_real |= marks;
    }
    return put(scan, begin, (size_t)(scan->at - begin)) && (is_real || put(scan, "e0", 2));
}

static bool copy_other(struct scan *scan)
{
    char c = *scan->at;
    if (!c) return refuse(scan, "a NUL byte");
    if ((c == '[' || c == '{') && ++scan->depth > LIMIT_JSON_DEPTH)
        return refuse(scan, "nested too deeply");
    if ((c == ']' || c == '}') && scan->depth) scan->depth--;
    scan->at++;
    return put(scan, &c, 1);
}

static bool step(struct scan *scan)
{
    char c = *scan->at;
    if (c == '"') return copy_string(scan);
    if (starts_number(c)) return copy_number(scan);
    if (c == '[') {
        enum outcome outcome = lift_array(scan);
        if (outcome != LEFT) return outcome == LIFTED;
    }
    return copy_other(scan);
}

bool api_lift(const char *bytes, size_t size, struct arena *arena, struct document *document,
              struct problem *problem, struct lifted *out)
{
    struct scan scan = {.begin = bytes,
                        .at = bytes,
                        .end = bytes + size,
                        .arena = arena,
                        .document = document,
                        .problem = problem};
    while (scan.at < scan.end)
        if (!step(&scan)) {
            free(scan.text);
            return false;
        }
    *out = (struct lifted){scan.text, scan.size};
    return true;
}

/*
 * The two differ at a lifted array, which is numbers, literals and brackets in the bytes and digits
 * between spaces in the text, and at the e0 behind an integer, which no byte that follows one can equal.
 */
size_t api_lift_origin(const char *bytes, size_t size, const struct lifted *lifted, size_t offset)
{
    size_t in = 0, out = 0;
    while (in < size && out < offset && out < lifted->size) {
        if (bytes[in] == lifted->text[out]) {
            in++;
            out++;
        } else if (bytes[in] == '[') {
            int depth = 0;
            do {
                depth += (bytes[in] == '[') - (bytes[in] == ']');
            } while (++in < size && depth);
            while (++out < lifted->size && lifted->text[out] != ' ') continue;
            out++;
        } else {
            out += 2;
        }
    }
    return in;
}
