#include "image.h"
#include "body.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

/* ---- EXR: magic, version, attributes, offset table, one chunk per line; all little-endian ---- */

struct writer {
    unsigned char *at;
};

static void put(struct writer *w, const void *bytes, size_t n)
{
    memcpy(w->at, bytes, n);
    w->at += n;
}

static void put32(struct writer *w, uint32_t x)
{
    put(w, &x, 4);
}

static void attribute(struct writer *w, const char *name, const char *type, const void *value,
                      uint32_t n)
{
    put(w, name, strlen(name) + 1);
    put(w, type, strlen(type) + 1);
    put32(w, n);
    put(w, value, n);
}

enum { EXR_HEADER_MAX = 512, EXR_PIXELS_MAX = 1 << 24 };

static void exr_header(struct writer *w, size_t width, size_t height)
{
    int32_t window[4] = {0, 0, (int32_t)(uint32_t)(width - 1), (int32_t)(uint32_t)(height - 1)};
    float centre[2] = {0, 0}, one = 1;
    char channels[2 + 16 + 1] = "Y";
    channels[2] = 2; /* float */
    channels[10] = channels[14] = 1;
    put32(w, 20000630);
    put32(w, 2);
    attribute(w, "channels", "chlist", channels, sizeof channels);
    attribute(w, "compression", "compression", "", 1);
    attribute(w, "dataWindow", "box2i", window, 16);
    attribute(w, "displayWindow", "box2i", window, 16);
    attribute(w, "lineOrder", "lineOrder", "", 1);
    attribute(w, "pixelAspectRatio", "float", &one, 4);
    attribute(w, "screenWindowCenter", "v2f", centre, 8);
    attribute(w, "screenWindowWidth", "float", &one, 4);
    put(w, "", 1);
}

/* row(user, y) gives the line's floats. */
static char *exr(size_t width, size_t height, const float *(*row)(void *, size_t), void *user,
                 size_t *size)
{
    int honest = width && height && width <= EXR_PIXELS_MAX / height;
    size_t lines = honest ? height : 0, line = 4 * width;
    unsigned char *bytes = calloc(1, EXR_HEADER_MAX + lines * (16 + (honest ? line : 0)));
    if (!bytes) return NULL;
    struct writer w = {bytes};
    exr_header(&w, width, height);
    uint64_t first = (uint64_t)(w.at - bytes) + 8 * lines;
    for (size_t y = 0; y < lines; y++) {
        uint64_t offset = first + y * (8 + line);
        put(&w, &offset, 8);
    }
    for (size_t y = 0; y < lines; y++) {
        put32(&w, (uint32_t)y);
        put32(&w, (uint32_t)line);
        put(&w, row(user, y), line);
    }
    *size = (size_t)(w.at - bytes);
    return (char *)bytes;
}

static const float *same_row(void *user, size_t y)
{
    (void)y;
    return user;
}

char *image_exr(size_t width, size_t height, float value, size_t *size)
{
    size_t n = width <= EXR_PIXELS_MAX ? width : 1;
    float *row = malloc(4 * n + 4);
    if (!row) return NULL;
    for (size_t i = 0; i < n; i++) row[i] = value;
    char *bytes = exr(width, height, same_row, row, size);
    free(row);
    return bytes;
}

struct pfm {
    const float *pixels; /* bottom row first, as the format has it */
    size_t width, height;
};

static const float *pfm_row(void *user, size_t y)
{
    const struct pfm *pfm = user;
    return pfm->pixels + (pfm->height - 1 - y) * pfm->width;
}

char *image_exr_from_pfm(const char *path, size_t *size)
{
    size_t n = 0;
    char *file = body_read(path, &n), *bytes = NULL;
    int used = 0;
    double scale = 0;
    struct pfm pfm = {0};
    if (file && sscanf(file, "Pf %zu %zu %lf%n", &pfm.width, &pfm.height, &scale, &used) == 3 &&
        scale < 0 && (size_t)used + 1 + 4 * pfm.width * pfm.height <= n) {
        float *aligned = malloc(4 * pfm.width * pfm.height);
        if (aligned) {
            memcpy(aligned, file + used + 1, 4 * pfm.width * pfm.height);
            pfm.pixels = aligned;
            bytes = exr(pfm.width, pfm.height, pfm_row, &pfm, size);
            free(aligned);
        }
    }
    free(file);
    return bytes;
}

/* ---- PNG: signature, then chunks of length, type, data, crc; all big-endian ------------------ */

static void put32_big(struct writer *w, uint32_t x)
{
    unsigned char b[4] = {(unsigned char)(x >> 24), (unsigned char)(x >> 16),
                          (unsigned char)(x >> 8), (unsigned char)x};
    put(w, b, 4);
}

static void chunk(struct writer *w, const char *type, const void *data, size_t n)
{
    put32_big(w, (uint32_t)n);
    unsigned char *from = w->at;
    put(w, type, 4);
    if (n) put(w, data, n);
    put32_big(w, (uint32_t)crc32(0, from, (uInt)(n + 4)));
}

static unsigned char *deflated_zeros(size_t n, size_t *size)
{
    static const unsigned char zeros[1 << 16];
    size_t room = n / 900 + 4096;
    unsigned char *bytes = malloc(room);
    z_stream z = {0};
    if (!bytes || deflateInit(&z, 9) != Z_OK) {
        free(bytes);
        return NULL;
    }
    z.next_out = bytes;
    z.avail_out = (uInt)room;
    for (size_t left = n; left;) {
        size_t now = left < sizeof zeros ? left : sizeof zeros;
        z.next_in = (Bytef *)(uintptr_t)zeros;
        z.avail_in = (uInt)now;
        deflate(&z, Z_NO_FLUSH);
        left -= now;
    }
    deflate(&z, Z_FINISH);
    *size = room - z.avail_out;
    deflateEnd(&z);
    return bytes;
}

char *image_png(size_t width, size_t height, int depth, size_t inflate_to, size_t *size)
{
    size_t n = 0;
    unsigned char *data = deflated_zeros(inflate_to, &n);
    char *bytes = data ? malloc(n + 128) : NULL;
    if (bytes) {
        struct writer w = {(unsigned char *)bytes};
        unsigned char head[13];
        struct writer h = {head};
        put32_big(&h, (uint32_t)width);
        put32_big(&h, (uint32_t)height);
        memcpy(h.at, (unsigned char[]){(unsigned char)depth, 0, 0, 0, 0}, 5);
        put(&w, "\x89PNG\r\n\x1a\n", 8);
        chunk(&w, "IHDR", head, sizeof head);
        chunk(&w, "IDAT", data, n);
        chunk(&w, "IEND", NULL, 0);
        *size = (size_t)(w.at - (unsigned char *)bytes);
    }
    free(data);
    return bytes;
}
