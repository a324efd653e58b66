/* png_write.h - 8-bit RGB pictures, through libpng. */
#ifndef PNG_WRITE_H
#define PNG_WRITE_H

#include "image.h"

#include <stdbool.h>

/* rgb: width x height x 3, rows from the top.  *bytes is to be freed. */
enum image_status api_png_write(const unsigned char *rgb, size_t width, size_t height, void **bytes,
                                size_t *size, struct image_problem *problem);

#endif
