/* MERL: the bytes as a file, and as the numbers of a file of the right size. */
#include "opened.h"

#include "merl.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static unsigned char *file;
    if (!file) file = calloc(1, MERL_SIZE);
    fuzz_open(data, size, -1);
    fuzz_open(data, size, FORMAT_MERL);
    if (!file || size < 8) return 0;
    struct merl merl = {file};
    facet_fit_source source = {api_merl_evaluate, &merl, api_merl_slope_max(), false, NULL};
    for (size_t at = 12; at + 8 <= MERL_SIZE;
         at += 8 * 99991) { /* only numbers that open accepts */
        double value;
        memcpy(&value, data + at / 8 % (size - 7), 8);
        if (!isfinite(value) || fabs(value) > 1e300) value = -1;
        memcpy(file + at, &value, 8);
    }
    fuzz_ask(&source);
    return 0;
}
