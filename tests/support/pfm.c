#include "pfm.h"
#include "check.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const struct microsurface microsurfaces[3] = {
    {"heights/microsurface/interferometer_matrix2.pfm", 0.369862e-6, 0.35152685030417763},
    {"heights/microsurface/afm_matrix3.pfm", 39.0625e-9, 0.19235602282848963},
    {"heights/microsurface/interferometer_matrix4.pfm", 0.369862e-6, 0.06776316911544318},
};

float *pfm_read(const char *path, size_t *width, size_t *height)
{
    size_t size = 0;
    char *bytes = check_read_file(path, &size);
    float *z = NULL, scale = 0;
    int used = 0;
    if (bytes && sscanf(bytes, "Pf %zu %zu %f%n", width, height, &scale, &used) == 3 && scale < 0) {
        const size_t row = *width * sizeof *z;
        const char *data = bytes + used + 1; /* one white space ends the header */
        if (size - (size_t)used - 1 == *height * row) z = malloc(*height * row);
        /* The file starts with the bottom row. */
        for (size_t q = 0; z && q < *height; q++)
            memcpy(z + q * *width, data + (*height - 1 - q) * row, row);
    }
    free(bytes);
    return z;
}
