/* exr.h - OpenEXR files in memory, through OpenEXRCore: heights in, pyramids out. */
#ifndef EXR_H
#define EXR_H

#include "image.h"

#include <stdbool.h>
#include <stdint.h>

/* True if the bytes start like an OpenEXR file. */
bool api_exr_is(const unsigned char *bytes, size_t size);

/*
 * Read one channel of the first part that is not deep and holds it: scanlines or
 * tiles (level 0), half, float or uint.  channel NULL: the only one, else the
 * first of height, displacement, Y, R, Z.  Nothing is trusted: the memory the
 * library may take, its chunks and the size of what they unpack to are bounded
 * by the size of the file.
 * Refused as UNSUPPORTED: deep data, subsampled channels, and the B44 and DWA
 * compressions (lossy: made for what the eye sees, not for differences).
 */
enum image_status api_exr_read(const void *bytes, size_t size, const char *channel,
                               const facet_watch *watch, struct image *image,
                               struct image_problem *problem);

enum { EXR_PLANES_MAX = 8 };

struct exr_level {
    size_t width, height;
    const float *plane[EXR_PLANES_MAX]; /* width x height each */
};

/* A text or a number, never both. */
struct exr_attribute {
    const char *name;
    const char *text; /* NULL: number */
    double number;
};

struct exr_pyramid {
    size_t level_count;
    const struct exr_level *levels; /* sizes halved and rounded down, to 1 x 1 */
    size_t plane_count;
    const char *names[EXR_PLANES_MAX]; /* in alphabetical order, as the format wants */
    bool half;                         /* the planes must hold values binary16 represents */
    bool compress;                     /* ZIP, else none */
    const struct exr_attribute *attributes;
    size_t attribute_count;
};

/* Write one tiled, MIP-mapped part.  *bytes is to be freed. */
enum image_status api_exr_write(const struct exr_pyramid *pyramid, const facet_watch *watch,
                                void **bytes, size_t *size, struct image_problem *problem);

#endif
