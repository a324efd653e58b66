#include "npy.h"

#include <stdint.h>
#include <stdio.h>
#include <string.h>

static const char magic[6] = "\x93NUMPY";

enum { HEADER_MAX = 4096 };

bool api_npy_is(const void *bytes, size_t size)
{
    return size >= sizeof magic && !memcmp(bytes, magic, sizeof magic);
}

/* Behind the key and its colon in the header, a Python dict; NULL: not there. */
static const char *value_of(const char *header, const char *key)
{
    const char *at = strstr(header, key);
    if (!at) return NULL;
    at += strlen(key);
    at += strspn(at, " ");
    return *at == ':' ? at + 1 + strspn(at + 1, " ") : NULL;
}

/* "(3, 4)", "(3,)": the dimensions; -1 where it is no such tuple or a number is too large. */
static int dimensions(const char *p, size_t out[2])
{
    int rank = 0;
    if (!p || *p++ != '(') return -1;
    for (;;) {
        p += strspn(p, " ");
        if (*p == ')') return rank;
        size_t digits = strspn(p, "0123456789"), value = 0;
        if (!digits || digits > 12) return -1;
        for (size_t i = 0; i < digits; i++) value = 10 * value + (size_t)(p[i] - '0');
        if (rank < 2) out[rank] = value;
        rank++;
        p += digits + strspn(p + digits, " ");
        if (*p == ',') p++;
    }
}

/* What a value of the header is, for a message: up to the mark that ends it, which belongs to it. */
static int extent_of(const char *value, char end)
{
    enum { SHOWN = 60 };
    const char *last = value ? strchr(value + (*value == end), end) : NULL;
    size_t n = !value ? 0 : last ? (size_t)(last - value) + 1 : strlen(value);
    return n < SHOWN ? (int)n : SHOWN;
}

/* The text of the header, NUL-terminated, and where the numbers begin; 0: malformed. */
static size_t header_of(const unsigned char *bytes, size_t size, char out[HEADER_MAX + 1])
{
    bool is_short = size > 6 && bytes[6] == 1;
    size_t start = is_short ? 10 : 12, length;
    if (size < start || bytes[6] < 1 || bytes[6] > 3) return 0;
    length = bytes[8] | (size_t)bytes[9] << 8;
    if (!is_short) length |= (size_t)bytes[10] << 16 | (size_t)bytes[11] << 24;
    if (length > HEADER_MAX || length > size - start) return 0;
    memcpy(out, bytes + start, length);
    out[length] = 0;
    return start + length;
}

/* Column by column to row by row. */
static bool transpose(struct number_array *array, struct arena *arena, size_t item)
{
    char *copy = api_arena_alloc(arena, array->count * item);
    const char *from = array->data;
    if (!copy) return false;
    for (size_t i = 0; i < array->rows; i++)
        for (size_t k = 0; k < array->columns; k++)
            memcpy(copy + (i * array->columns + k) * item, from + (k * array->rows + i) * item,
                   item);
    array->data = copy;
    return true;
}

bool api_npy_read(const void *bytes, size_t size, const struct place *place, struct arena *arena,
                  struct problem *problem, struct number_array *array)
{
    char header[HEADER_MAX + 1];
    size_t start = header_of(bytes, size, header), shape[2] = {0, 1};
    const char *descr = start ? value_of(header, "'descr'") : NULL;
    const char *order = start ? value_of(header, "'fortran_order'") : NULL;
    if (!descr || !order)
        return api_problem_at(problem, place, "is no .npy file of version 1 to 3");
    bool is_float = !strncmp(descr, "'<f4'", 5);
    if (!is_float && strncmp(descr, "'<f8'", 5))
        return api_problem_at(
            problem, place,
            "has the dtype %.*s, must have '<f4' or '<f8', little-endian float32 or "
            "float64: .astype('<f4') makes it that",
            extent_of(descr, *descr == '[' ? ']' : '\''), descr);
    const char *sides = value_of(header, "'shape'");
    int rank = dimensions(sides, shape);
    if (rank != 1 && rank != 2)
        return api_problem_at(problem, place,
                              "has the shape %.*s, must have 1 or 2 dimensions, (n,) or (n, m)",
                              extent_of(sides, ')'), sides ? sides : "");
    size_t item = is_float ? sizeof(float) : sizeof(double), room = (size - start) / item;
    if ((shape[1] && shape[0] > room / shape[1]) || shape[0] * shape[1] * item != size - start)
        return api_problem_at(
            problem, place,
            "holds %zu bytes behind its header, not those of %zu x %zu numbers of %zu bytes",
            size - start, shape[0], shape[1], item);
    *array = (struct number_array){.type = is_float ? ARRAY_FLOAT : ARRAY_DOUBLE,
                                   .data = (const char *)bytes + start,
                                   .count = shape[0] * shape[1],
                                   .nested = rank == 2,
                                   .rows = rank == 2 ? shape[0] : 0,
                                   .columns = rank == 2 ? shape[1] : 0};
    bool is_fortran = rank == 2 && !strncmp(order, "True", 4);
    if (is_fortran && !transpose(array, arena, item)) return api_problem_memory(problem);
    return true;
}

void api_npy_header(char out[NPY_HEADER_SIZE], enum array_type type, size_t rows, size_t columns)
{
    char shape[48];
    snprintf(shape, sizeof shape, columns == 1 ? "(%zu,)" : "(%zu, %zu)", rows, columns);
    memset(out, ' ', NPY_HEADER_SIZE);
    memcpy(out, "\x93NUMPY\x01\x00\x76\x00", 10); /* 118 bytes of text follow */
    int n = snprintf(out + 10, NPY_HEADER_SIZE - 10,
                     "{'descr': '%s', 'fortran_order': False, 'shape': %s, }",
                     type == ARRAY_FLOAT ? "<f4" : "<f8", shape);
    out[10 + n] = ' ';
    out[NPY_HEADER_SIZE - 1] = '\n';
}
