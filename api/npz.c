#include "npz.h"

#include "npy.h"
#include "representation.h"

#include <libdeflate.h>
#include <stdint.h>
#include <string.h>

/* Sizes of the records without names, and where in them the sum and the size stand. */
enum { LOCAL = 30, CENTRAL = 46, END = 22, LOCAL_SUM = 14, CENTRAL_SUM = 16, CENTRAL_SIZE = 20 };
enum { CENTRAL_NAME_SIZE = 28, CENTRAL_OFFSET = 42, VERSION = 20, DATE_1980 = 1 << 5 | 1 };

static void put(unsigned char *at, uint32_t value, int bytes)
{
    for (int i = 0; i < bytes; i++) at[i] = (unsigned char)(value >> 8 * i);
}

static uint32_t get(const unsigned char *at, int bytes)
{
    uint32_t value = 0;
    for (int i = 0; i < bytes; i++) value |= (uint32_t)at[i] << 8 * i;
    return value;
}

/* What local and central headers share, from the version needed to the name's length. */
static void describe(unsigned char *at, uint32_t size, size_t name_size)
{
    memset(at, 0, 26);
    put(at, VERSION, 2);
    put(at + 8, DATE_1980, 2);
    put(at + 14, size, 4);
    put(at + 18, size, 4);
    put(at + 22, (uint32_t)name_size, 2);
}

static void put_name(struct text *text, const char *name)
{
    api_text_put(text, name);
    api_text_put(text, ".npy");
}

static size_t size_of(const struct results *r)
{
    return NPY_HEADER_SIZE + r->text.size;
}

static void write_file(struct text *text, const struct named_results *array)
{
    struct results *r = array->results;
    unsigned char header[LOCAL];
    char npy[NPY_HEADER_SIZE];
    put(header, 0x04034b50, 4);
    describe(header + 4, (uint32_t)size_of(r), strlen(array->name) + 4);
    api_text_bytes(text, (const char *)header, LOCAL);
    put_name(text, array->name);
    api_npy_header(npy, r->format == RESULTS_FLOAT32 ? ARRAY_FLOAT : ARRAY_DOUBLE, r->count,
                   r->width);
    api_text_bytes(text, npy, NPY_HEADER_SIZE);
    api_text_join(text, &r->text);
}

void api_npz_write(struct text *text, const struct named_results *arrays, size_t count)
{
    struct text directory = api_text(text->arena);
    for (size_t i = 0; i < count; i++) {
        unsigned char header[CENTRAL] = {0};
        put(header, 0x02014b50, 4);
        put(header + 4, VERSION, 2);
        describe(header + 6, (uint32_t)size_of(arrays[i].results), strlen(arrays[i].name) + 4);
        put(header + CENTRAL_OFFSET, (uint32_t)text->size, 4);
        api_text_bytes(&directory, (const char *)header, CENTRAL);
        put_name(&directory, arrays[i].name);
        write_file(text, &arrays[i]);
    }
    unsigned char end[END] = {0};
    put(end, 0x06054b50, 4);
    put(end + 8, (uint32_t)count, 2);
    put(end + 10, (uint32_t)count, 2);
    put(end + 12, (uint32_t)directory.size, 4);
    put(end + 16, (uint32_t)text->size, 4);
    api_text_join(text, &directory);
    api_text_bytes(text, (const char *)end, END);
}

void api_npz_sum(unsigned char *bytes, size_t size)
{
    const unsigned char *end = bytes + size - END;
    unsigned char *entry = bytes + get(end + 16, 4);
    for (uint32_t i = get(end + 10, 2); i; i--) {
        uint32_t name = get(entry + CENTRAL_NAME_SIZE, 2);
        unsigned char *local = bytes + get(entry + CENTRAL_OFFSET, 4);
        uint32_t sum = libdeflate_crc32(0, local + LOCAL + name, get(entry + CENTRAL_SIZE, 4));
        put(local + LOCAL_SUM, sum, 4);
        put(entry + CENTRAL_SUM, sum, 4);
        entry += CENTRAL + name;
    }
}
