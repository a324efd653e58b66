/* png_read.h - PNG files in memory, through libpng: heights in [0, 1]. */
#ifndef PNG_READ_H
#define PNG_READ_H

#include "image.h"

#include <stdbool.h>

/* True if the bytes start like a PNG file. */
bool api_png_is(const unsigned char *bytes, size_t size);

/*
 * Read one plane: the stored value over the largest its bit depth holds.  No gamma,
 * no colour profile: a height is a number.  Alpha is ignored.
 * channel NULL: grey; for a colour or palette image the value its three channels
 * share, refused as NO_CHANNEL where they differ.  "R", "G", "B" take that one,
 * "Y" grey only.  Dimensions, memory and work are bounded by the file's size.
 */
enum image_status api_png_read(const void *bytes, size_t size, const char *channel,
                               const facet_watch *watch, struct image *image,
                               struct image_problem *problem);

#endif
