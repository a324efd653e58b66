/* image.h - one decoded plane of an image, and why there is none. */
#ifndef IMAGE_H
#define IMAGE_H

#include "facet.h"

#include <stddef.h>

enum image_status {
    IMAGE_OK,
    IMAGE_DAMAGED,     /* not what its format says */
    IMAGE_UNSUPPORTED, /* well-formed, but not something we read */
    IMAGE_TOO_LARGE,
    IMAGE_NO_CHANNEL, /* the channel asked for is not there */
    IMAGE_NO_MEMORY,
    IMAGE_CANCELLED
};

struct image {
    float *values; /* rows from the top, owned: api_image_clear */
    size_t width, height;
    size_t released;  /* rows from the top that are gone */
    char channel[64]; /* whose values these are */
    char type[8];     /* "half", "float", "uint", "8-bit", ...: as in the file */
};

struct image_problem {
    enum image_status status;
    char text[320]; /* a sentence for the client */
};

void api_image_clear(struct image *image);

/* The first `rows` rows will not be read any more: their memory goes back, in large pieces. */
void api_image_release(struct image *image, size_t rows);

/* Records the problem and returns its status, for "return api_image_problem(...)"; printf-like. */
__attribute__((format(printf, 3, 4))) enum image_status
api_image_problem(struct image_problem *problem, enum image_status status, const char *format, ...);

/* Checks the sizes against the limits of facet_leadr.h. */
enum image_status api_image_check(size_t width, size_t height, struct image_problem *problem);

/* Checks the sizes and allocates the plane. */
enum image_status api_image_open(struct image *image, size_t width, size_t height,
                                 struct image_problem *problem);

#endif
