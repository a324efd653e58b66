/* image.h - small writers of EXR and PNG bodies, honest and dishonest; no image library. */
#ifndef CLIENT_IMAGE_H
#define CLIENT_IMAGE_H

#include <stddef.h>

/*
 * An uncompressed scanline EXR with one float channel Y of a constant value.
 * More than 2^24 pixels, or none: the header alone, which promises what never comes.
 */
char *image_exr(size_t width, size_t height, float value, size_t *size);
/* The same from a portable float map, top row first; NULL if it cannot be read. */
char *image_exr_from_pfm(const char *path, size_t *size);
/* A grey PNG whose one IDAT inflates to that many zero bytes, whatever the header promises. */
char *image_png(size_t width, size_t height, int depth, size_t inflate, size_t *size);

#endif
