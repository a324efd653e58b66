/* PNG height maps: every kind written by libpng and read back; bombs; real maps. */
#include "check.h"
#include "files.h"
#include "pfm.h"
#include "png_read.h"

#include <math.h>
#include <png.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct file {
    unsigned char bytes[1 << 18];
    size_t size;
};

static void file_write(png_structp png, png_bytep data, size_t n)
{
    struct file *f = png_get_io_ptr(png);
    if (n > sizeof f->bytes - f->size) png_error(png, "too long for the test");
    memcpy(f->bytes + f->size, data, n);
    f->size += n;
}

static void file_flush(png_structp png)
{
    (void)png;
}

/* The writer is not under test: it does not fail. */
static void fatal(png_structp png, png_const_charp message)
{
    (void)png;
    fprintf(stderr, "libpng: %s\n", message);
    exit(2);
}

enum { WIDTH = 21, HEIGHT = 13 };

/* Sample number i of row y, of a depth. */
static unsigned sample_at(int depth, size_t i, size_t y)
{
    return (unsigned)(i * 2654435761u + y * 40503u) >> 3 & ((1u << depth) - 1);
}

/* grey: every channel of a pixel but alpha holds the same. */
static struct file *make_png(int colour, int depth, bool interlaced, bool grey, const char *text)
{
    struct file *f = calloc(1, sizeof *f);
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, fatal, NULL);
    png_infop info = png_create_info_struct(png);
    const int samples = (colour & PNG_COLOR_MASK_COLOR && colour != PNG_COLOR_TYPE_PALETTE ? 3
                                                                                           : 1) +
                        !!(colour & PNG_COLOR_MASK_ALPHA);
    if (!f) fatal(png, "out of memory");
    png_set_write_fn(png, f, file_write, file_flush);
    png_set_IHDR(png, info, WIDTH, HEIGHT, depth, colour,
                 interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_color palette[16];
    for (int i = 0; i < 16; i++)
        palette[i] = (png_color){(png_byte)(i * 3), (png_byte)(i * 3), (png_byte)(i * 3 + !grey)};
    if (colour == PNG_COLOR_TYPE_PALETTE) png_set_PLTE(png, info, palette, 16);
    png_set_gAMA(png, info, 0.45455);
    png_text comment = {.compression = PNG_TEXT_COMPRESSION_zTXt,
                        .key = (char *)(uintptr_t) "Comment",
                        .text = (char *)(uintptr_t)text};
    if (text) png_set_text(png, info, &comment, 1);
    png_write_info(png, info);
    png_set_packing(png);
    unsigned char rows[HEIGHT][WIDTH * 8];
    png_bytep pointers[HEIGHT];
    for (size_t y = 0; y < HEIGHT; y++) {
        pointers[y] = rows[y];
        for (size_t i = 0; i < (size_t)(WIDTH * samples); i++) {
            const size_t x = i / (size_t)samples, k = i % (size_t)samples;
            const bool alpha = colour & PNG_COLOR_MASK_ALPHA && k == (size_t)samples - 1;
            const unsigned v = sample_at(depth, x + (alpha || !grey ? 100 * k : 0), y);
            if (depth == 16) {
                rows[y][2 * i] = (unsigned char)(v >> 8);
                rows[y][2 * i + 1] = (unsigned char)v;
            } else {
                rows[y][i] = (unsigned char)v;
            }
        }
    }
    png_write_image(png, pointers);
    png_write_end(png, NULL);
    png_destroy_write_struct(&png, &info);
    return f;
}

static void check_values(const struct file *f, const char *channel, int depth, size_t shift,
                         double scale)
{
    struct image image;
    struct image_problem problem = {0};
    CHECK_INT(api_png_read(f->bytes, f->size, channel, NULL, &image, &problem), IMAGE_OK);
    CHECK(image.width == WIDTH && image.height == HEIGHT);
    for (size_t i = 0; image.values && i < WIDTH * HEIGHT; i++)
        CHECK(image.values[i] == (float)(sample_at(depth, i % WIDTH + shift, i / WIDTH) * scale));
    api_image_clear(&image);
}

TEST(grey_of_every_depth)
{
    for (int depth = 1; depth <= 16; depth *= 2)
        for (int interlaced = 0; interlaced < 2; interlaced++) {
            struct file *f = make_png(PNG_COLOR_TYPE_GRAY, depth, interlaced, true, NULL);
            if (f) check_values(f, NULL, depth, 0, 1.0 / ((1 << depth) - 1));
            if (f) check_values(f, "Y", depth, 0, 1.0 / ((1 << depth) - 1));
            free(f);
        }
}

TEST(alpha_is_ignored)
{
    for (int depth = 8; depth <= 16; depth *= 2) {
        struct file *grey = make_png(PNG_COLOR_TYPE_GRAY_ALPHA, depth, false, true, NULL);
        struct file *rgb = make_png(PNG_COLOR_TYPE_RGB_ALPHA, depth, true, true, NULL);
        if (grey) check_values(grey, NULL, depth, 0, 1.0 / ((1 << depth) - 1));
        if (rgb) check_values(rgb, NULL, depth, 0, 1.0 / ((1 << depth) - 1));
        free(grey);
        free(rgb);
    }
}

TEST(grey_in_colour_and_colour)
{
    struct image image;
    struct image_problem problem = {0};
    struct file *grey = make_png(PNG_COLOR_TYPE_RGB, 8, false, true, NULL);
    struct file *colour = make_png(PNG_COLOR_TYPE_RGB, 16, false, false, NULL);
    struct file *palette = make_png(PNG_COLOR_TYPE_PALETTE, 4, false, true, NULL);
    struct file *bluish = make_png(PNG_COLOR_TYPE_PALETTE, 4, true, false, NULL);
    if (!grey || !colour || !palette || !bluish) return;
    check_values(grey, NULL, 8, 0, 1 / 255.0);
    check_values(palette, NULL, 4, 0, 3 / 255.0);
    check_values(colour, "R", 16, 0, 1 / 65535.0);
    check_values(colour, "G", 16, 100, 1 / 65535.0);
    check_values(colour, "B", 16, 200, 1 / 65535.0);
    CHECK_INT(api_png_read(colour->bytes, colour->size, NULL, NULL, &image, &problem),
              IMAGE_NO_CHANNEL);
    CHECK_INT(api_png_read(bluish->bytes, bluish->size, NULL, NULL, &image, &problem),
              IMAGE_NO_CHANNEL);
    CHECK_INT(api_png_read(colour->bytes, colour->size, "Y", NULL, &image, &problem),
              IMAGE_NO_CHANNEL);
    CHECK_STR(problem.text, "the PNG has no channel \"Y\", only: R, G, B");
    CHECK_INT(api_png_read(grey->bytes, grey->size, "", NULL, &image, &problem), IMAGE_NO_CHANNEL);
    free(grey), free(colour), free(palette), free(bluish);
}

static void read_any(const char *path, const void *bytes, size_t size)
{
    struct image image;
    struct image_problem problem = {0};
    const enum image_status status = api_png_read(bytes, size, NULL, NULL, &image, &problem);
    if (status == IMAGE_OK)
        CHECK(image.values && image.width && image.height);
    else if (image.values || !*problem.text || status != problem.status)
        check_fail(__FILE__, __LINE__, "%s: half an answer", path);
    api_image_clear(&image);
}

TEST(every_cut_is_refused)
{
    struct file *f = make_png(PNG_COLOR_TYPE_GRAY, 16, true, true, NULL);
    if (!f) return;
    for (size_t n = 0; n < f->size - 40; n++) {
        unsigned char *copy = malloc(n + 1);
        struct image image;
        struct image_problem problem = {0};
        if (!copy) break;
        memcpy(copy, f->bytes, n);
        CHECK_INT(api_png_read(copy, n, NULL, NULL, &image, &problem), IMAGE_DAMAGED);
        free(copy);
    }
    free(f);
}

/* Refused by the header: nothing of the size claimed is allocated. */
TEST(bombs)
{
    static const uint32_t sizes[][2] = {
        {0, 1},       {0x7fffffff, 0x7fffffff}, {1u << 16, 1u << 15}, {16384, 16384},
        {4096, 4096}, {0xffffffffu, 1}};
    static const enum image_status expected[] = {IMAGE_DAMAGED,   IMAGE_TOO_LARGE, IMAGE_TOO_LARGE,
                                                 IMAGE_TOO_LARGE, IMAGE_DAMAGED,   IMAGE_DAMAGED};
    struct file *f = make_png(PNG_COLOR_TYPE_GRAY, 8, false, true, NULL);
    for (size_t i = 0; f && i < sizeof sizes / sizeof *sizes; i++) {
        struct image image;
        struct image_problem problem = {0};
        for (int b = 0; b < 4; b++) {
            f->bytes[16 + b] = (unsigned char)(sizes[i][0] >> (24 - 8 * b));
            f->bytes[20 + b] = (unsigned char)(sizes[i][1] >> (24 - 8 * b));
        }
        uint32_t crc = 0xffffffffu; /* of type and data of IHDR */
        for (int k = 12; k < 29; k++) {
            crc ^= f->bytes[k];
            for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
        }
        for (int b = 0; b < 4; b++) f->bytes[29 + b] = (unsigned char)(~crc >> (24 - 8 * b));
        CHECK_INT(api_png_read(f->bytes, f->size, NULL, NULL, &image, &problem), expected[i]);
        CHECK(!image.values && *problem.text);
        if (i == 4) CHECK_STR(problem.text, "the PNG is too short for its 4096 x 4096 pixels");
    }
    free(f);
}

/* A comment that unpacks to 50 MB beside a small image: skipped or refused, never unpacked whole. */
TEST(a_comment_that_explodes)
{
    char *text = malloc(50 << 20);
    if (!text) return;
    memset(text, ' ', (50 << 20) - 1);
    text[(50 << 20) - 1] = 0;
    struct file *f = make_png(PNG_COLOR_TYPE_GRAY, 8, false, true, text);
    free(text);
    CHECK(f && f->size > 40000);
    if (f) read_any("comment", f->bytes, f->size);
    free(f);
}

TEST(every_file_of_pngsuite_and_testpngs)
{
    char path[512];
    const char *folder = check_data("png");
    if (!folder) {
        check_skip("no shared data");
        return;
    }
    snprintf(path, sizeof path, "%s", folder);
    CHECK(files_each(path, read_any) > 180);
}

/* The 16-bit PNG of a measured surface against its float original: 65535 steps between known ends. */
TEST(real_maps_of_16_bits)
{
    static const struct {
        const char *pfm, *png;
        double low, high;
    } maps[] = {{"heights/microsurface/interferometer_matrix2.pfm",
                 "heights/microsurface/interferometer_matrix2_16.png", -1.91437e-6, 1.48793e-6},
                {"heights/microsurface/afm_matrix3.pfm", "heights/microsurface/afm_matrix3_16.png",
                 -1.6861e-7, 2.4022e-7}};
    for (int i = 0; i < 2; i++) {
        size_t width, height, size;
        const char *path = check_data(maps[i].pfm);
        float *z = path ? pfm_read(path, &width, &height) : NULL;
        path = check_data(maps[i].png);
        unsigned char *bytes = path ? check_read_file(path, &size) : NULL;
        struct image image = {.values = NULL};
        struct image_problem problem = {0};
        if (!z || !bytes) {
            check_skip("no shared data");
        } else {
            CHECK_INT(api_png_read(bytes, size, NULL, NULL, &image, &problem), IMAGE_OK);
            CHECK(image.width == width && image.height == height);
            CHECK_STR(image.type, "16-bit");
            double worst = 0;
            for (size_t p = 0; image.values && p < width * height; p++)
                worst = check_worse(
                    worst,
                    fabs(maps[i].low + image.values[p] * (maps[i].high - maps[i].low) - z[p]));
            check_note("worst error in steps", worst * 65535 / (maps[i].high - maps[i].low));
            /* Half a step, and the five or six digits the ends are given with. */
            CHECK(worst < 0.6 * (maps[i].high - maps[i].low) / 65535 + 5e-12);
        }
        api_image_clear(&image);
        free(bytes);
        free(z);
    }
}
