/* make_map WIDTH HEIGHT noise|smooth|8bit FILE: an uncompressed float EXR of waves, periodic. */
#include "exr_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int argc, char **argv)
{
    if (argc != 5) return 2;
    const size_t w = strtoul(argv[1], NULL, 10), h = strtoul(argv[2], NULL, 10);
    const int noise = !strcmp(argv[3], "noise"), coarse = !strcmp(argv[3], "8bit");
    enum { OCTAVES = 8 };
    const double turn = 2 * acos(-1);
    float *z = malloc(w * h * sizeof *z);
    double *across = malloc(OCTAVES * w * sizeof *across);
    unsigned long long state = 1;
    if (!z || !across) return 1;
    for (size_t k = 0; k < OCTAVES; k++)
        for (size_t p = 0; p < w; p++)
            across[k * w + p] = sin(turn * (1 << k) * (double)p / (double)w + (double)k);
    for (size_t q = 0; q < h; q++) {
        double down[OCTAVES];
        for (int k = 0; k < OCTAVES; k++)
            down[k] = cos(turn * (1 << k) * (double)q / (double)h + k * k) / (1 << k);
        for (size_t p = 0; p < w; p++) {
            double sum = 0;
            for (size_t k = 0; k < OCTAVES; k++) sum += across[k * w + p] * down[k];
            state = state * 6364136223846793005ull + 1442695040888963407ull;
            if (noise) sum += 1e-3 * (double)(state >> 40) * 0x1p-24;
            if (coarse) sum = rint(sum * 64) / 64;
            z[q * w + p] = (float)(0.01 * sum);
        }
    }
    size_t size = 0;
    unsigned char *exr = exr_file_of_heights(z, w, h, &size);
    FILE *file = exr ? fopen(argv[4], "wb") : NULL;
    const int ok = file && fwrite(exr, 1, size, file) == size && fclose(file) == 0;
    free(exr);
    free(across);
    free(z);
    return ok ? 0 : 1;
}
