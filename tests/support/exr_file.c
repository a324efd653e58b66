#include "exr_file.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

struct cursor {
    unsigned char *at;
};

static void put(struct cursor *c, const void *bytes, size_t size)
{
    memcpy(c->at, bytes, size);
    c->at += size;
}

static void put_int(struct cursor *c, uint64_t value, size_t size)
{
    for (size_t i = 0; i < size; i++) *c->at++ = (unsigned char)(value >> 8 * i);
}

static void put_attribute(struct cursor *c, const char *name, const char *type, size_t size)
{
    put(c, name, strlen(name) + 1);
    put(c, type, strlen(type) + 1);
    put_int(c, size, 4);
}

static void put_window(struct cursor *c, const char *name, const struct exr_file *f)
{
    put_attribute(c, name, "box2i", 16);
    put_int(c, (uint32_t)f->x, 4);
    put_int(c, (uint32_t)f->y, 4);
    put_int(c, (uint32_t)(f->x + (int)f->width - 1), 4);
    put_int(c, (uint32_t)(f->y + (int)f->height - 1), 4);
}

static void put_header(struct cursor *c, const struct exr_file *f)
{
    size_t list = 1;
    for (size_t i = 0; i < 4 && f->channels[i]; i++) list += strlen(f->channels[i]) + 17;
    put(c, "\x76\x2f\x31\x01\x02\0\0\0", 8);
    put_attribute(c, "channels", "chlist", list);
    for (size_t i = 0; i < 4 && f->channels[i]; i++) {
        put(c, f->channels[i], strlen(f->channels[i]) + 1);
        put_int(c, f->type, 4);
        put_int(c, 0, 4); /* linear, reserved */
        put_int(c, 1, 4);
        put_int(c, 1, 4);
    }
    put_int(c, 0, 1);
    put_attribute(c, "compression", "compression", 1);
    put_int(c, 0, 1);
    put_window(c, "dataWindow", f);
    put_window(c, "displayWindow", f);
    put_attribute(c, "lineOrder", "lineOrder", 1);
    put_int(c, 0, 1);
    put_attribute(c, "pixelAspectRatio", "float", 4);
    put_int(c, 0x3f800000, 4);
    put_attribute(c, "screenWindowCenter", "v2f", 8);
    put_int(c, 0, 8);
    put_attribute(c, "screenWindowWidth", "float", 4);
    put_int(c, 0x3f800000, 4);
    put_int(c, 0, 1);
}

unsigned char *exr_file(const struct exr_file *f, size_t *size)
{
    enum { HEADER_MAX = 1024 };
    const size_t row = f->width * (f->type == EXR_FILE_HALF ? 2 : 4);
    size_t channels = 0;
    while (channels < 4 && f->channels[channels]) channels++;
    unsigned char *bytes = malloc(HEADER_MAX + f->height * (16 + channels * row));
    if (!bytes) return NULL;
    struct cursor c = {bytes};
    put_header(&c, f);
    const size_t first = (size_t)(c.at - bytes) + 8 * f->height;
    for (size_t q = 0; q < f->height; q++) put_int(&c, first + q * (8 + channels * row), 8);
    for (size_t q = 0; q < f->height; q++) {
        put_int(&c, (uint32_t)(f->y + (int)q), 4);
        put_int(&c, channels * row, 4);
        for (size_t i = 0; i < channels; i++) put(&c, (const char *)f->planes[i] + q * row, row);
    }
    *size = (size_t)(c.at - bytes);
    return bytes;
}

unsigned char *exr_file_of_heights(const float *heights, size_t width, size_t height, size_t *size)
{
    const struct exr_file f = {width, height, 0, 0, {"Y"}, EXR_FILE_FLOAT, {heights}};
    return exr_file(&f, size);
}
