#include "png_write.h"

#include <png.h>
#include <stdlib.h>
#include <string.h>

enum { PNG_COMPRESSION = 1 };

struct output {
    unsigned char *bytes;
    size_t size, room;
};

static void output_write(png_structp png, png_bytep from, size_t size)
{
    struct output *out = png_get_io_ptr(png);
    if (size > out->room - out->size) {
        const size_t room = 2 * out->room + size;
        unsigned char *grown = realloc(out->bytes, room);
        if (!grown) png_error(png, "out of memory");
        out->bytes = grown;
        out->room = room;
    }
    memcpy(out->bytes + out->size, from, size);
    out->size += size;
}

static void output_flush(png_structp png)
{
    (void)png;
}

/* The only ways it fails are memory and a bug. */
static void output_error(png_structp png, png_const_charp message)
{
    (void)message;
    png_longjmp(png, 1);
}

static void silent(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

/* The place the library jumps back to; nothing here lives in registers across it. */
static bool write_all(png_structp png, png_infop info, struct output *out, const unsigned char *rgb,
                      size_t width, size_t height)
{
    if (setjmp(png_jmpbuf(png))) return false;
    png_set_write_fn(png, out, output_write, output_flush);
    png_set_compression_level(png, PNG_COMPRESSION);
    png_set_user_limits(png, PNG_UINT_31_MAX, PNG_UINT_31_MAX); /* ours were met before */
    png_set_IHDR(png, info, (png_uint_32)width, (png_uint_32)height, 8, PNG_COLOR_TYPE_RGB,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    for (size_t y = 0; y < height; y++) png_write_row(png, rgb + 3 * y * width);
    png_write_end(png, info);
    return true;
}

enum image_status api_png_write(const unsigned char *rgb, size_t width, size_t height, void **bytes,
                                size_t *size, struct image_problem *problem)
{
    struct output out = {.room = 4096};
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, output_error, silent);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    out.bytes = info ? malloc(out.room) : NULL;
    const bool ok = out.bytes && write_all(png, info, &out, rgb, width, height);
    if (png) png_destroy_write_struct(&png, &info);
    if (ok) {
        *bytes = out.bytes;
        *size = out.size;
        return IMAGE_OK;
    }
    free(out.bytes);
    return api_image_problem(problem, IMAGE_NO_MEMORY, "out of memory");
}
