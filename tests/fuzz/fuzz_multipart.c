/* Any bytes as a multipart body, and every part as a .npy file: all they refer to lies inside. */
#include "fuzz.h"
#include "multipart.h"
#include "npy.h"

#include <stdlib.h>

static void check_npy(const struct part *part)
{
    struct arena arena;
    struct problem problem = {0};
    struct number_array array;
    api_arena_open(&arena, 1 << 20);
    if (api_npy_read(part->bytes, part->size, NULL, &arena, &problem, &array)) {
        size_t item = array.type == ARRAY_FLOAT ? 4 : 8;
        static volatile unsigned char sum; /* asan looks */
        for (size_t i = 0; i < array.count * item; i++)
            sum = sum ^ ((const unsigned char *)array.data)[i];
        if (array.nested && array.rows * array.columns != array.count) abort();
    }
    api_arena_close(&arena);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const types[] = {"multipart/form-data; boundary=b",
                                        "multipart/form-data; boundary=\"b\""};
    struct part parts[PARTS_MAX], whole = {"", (const char *)data, size};
    struct problem problem = {0};
    const char *body = (const char *)data;
    size_t count = 0;
    check_npy(&whole);
    if (!api_multipart(types[size & 1], body, size, parts, &count, &problem)) {
        if (!problem.status && !problem.count) abort();
        return 0;
    }
    for (size_t i = 0; i < count; i++) {
        if (parts[i].bytes < body || parts[i].size > (size_t)(body + size - parts[i].bytes))
            abort();
        check_npy(&parts[i]);
    }
    return 0;
}
