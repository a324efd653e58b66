/* exr_file.h - uncompressed scanline OpenEXR files put together byte by byte, by no library. */
#ifndef EXR_FILE_H
#define EXR_FILE_H

#include <stddef.h>

enum exr_file_type { EXR_FILE_UINT, EXR_FILE_HALF, EXR_FILE_FLOAT };

struct exr_file {
    size_t width, height;
    int x, y;                /* corner of the data window */
    const char *channels[4]; /* alphabetical; NULL ends */
    enum exr_file_type type; /* of every channel */
    const void *planes[4];   /* width x height samples of that type each */
};

/* To be freed; NULL if out of memory. */
unsigned char *exr_file(const struct exr_file *file, size_t *size);

/* One float channel "Y". */
unsigned char *exr_file_of_heights(const float *heights, size_t width, size_t height, size_t *size);

#endif
