/* UTIA: the bytes as a file; every 4096th input filled up to the right size. */
#include "opened.h"

#include "utia.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static unsigned char *file;
    static unsigned count;
    if (!file) file = calloc(1, UTIA_SIZE);
    fuzz_open(data, size, FORMAT_UTIA);
    if (!file || size < 8 || count++ % 4096) return 0; /* a whole file takes milliseconds */
    for (size_t at = 0; at < UTIA_SIZE; at += 8) memcpy(file + at, data + at % (size - 7), 8);
    return fuzz_open(file, UTIA_SIZE, -1);
}
