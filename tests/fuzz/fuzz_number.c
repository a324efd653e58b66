/* The number codec on any bytes: reads what strtod reads, prints what reads back. */
#include "fuzz.h"
#include "number.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void check_printed(double x, int digits)
{
    char text[NUMBER_ROOM], expected[64];
    double back = 0;
    int n = digits ? api_number_print_digits(text, x, digits) : api_number_print(text, x);
    if (n <= 0 || n >= NUMBER_ROOM || api_number_parse(text, text + n, &back) != text + n) abort();
    snprintf(expected, sizeof expected, "%.*e", digits ? digits - 1 : 16, x);
    double rounded = digits ? strtod(expected, NULL) : x;
    /* What would round to more than the largest double keeps all its digits. */
    if (back != (isinf(rounded) ? x : rounded)) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    enum { LONGEST = 4000 };
    char copy[LONGEST + 1];
    const char *text = (const char *)data;
    double value = 0, bits;
    const char *end = api_number_parse(text, text + size, &value);
    if (end && size <= LONGEST) {
        memcpy(copy, data, size);
        copy[end - text] = 0; /* strtod also knows hexadecimal */
        char *stop;
        double expected = strtod(copy, &stop);
        if (stop - copy != end - text || memcmp(&expected, &value, sizeof value)) abort();
    }
    double run[8];
    bool expecting;
    const char *at = text;
    size_t n = api_number_run(&at, text + size, run, size % 9, &expecting);
    if (n > size % 9 || at < text || at > text + size) abort();
    if (size >= 9) {
        memcpy(&bits, data, 8);
        if (isfinite(bits)) check_printed(bits, data[8] % 18);
    }
    return 0;
}
