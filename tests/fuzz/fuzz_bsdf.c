/* Tensor files (RGL .bsdf). */
#include "opened.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    return fuzz_open(data, size, FORMAT_BSDF);
}
