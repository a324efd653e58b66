#include "png_read.h"
#include "facet_leadr.h"

#include <png.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum {
    ANCILLARY_MAX = 1 << 20, /* bytes a chunk beside the pixels may take or unpack to */
    CACHED_CHUNKS = 16,
    SLACK = 4 << 20,  /* what the library may allocate whatever the file */
    RATIO_MAX = 1032, /* zlib packs no better */
    WATCH_ROWS = 64,
};

struct reader {
    const unsigned char *bytes;
    size_t size, at;
    size_t used, limit; /* the library's memory */
    png_structp png;
    png_infop info;
    const char *channel;
    const facet_watch *watch;
    struct image *image;
    struct image_problem *problem;
    unsigned char *rows; /* one row, or all of an interlaced image */
    size_t row_size;
    int passes, samples, depth; /* of a row as it is handed over: 1 or 3 samples of 8 or 16 bits */
    bool exhausted;             /* the system has no memory */
    bool sound;                 /* no problem but, maybe, one of the library's */
};

/* ---- The library's memory, input and complaints ------------------------------------- */

union block {
    size_t size;
    max_align_t align;
};

static png_voidp reader_alloc(png_structp png, png_alloc_size_t size)
{
    struct reader *r = png_get_mem_ptr(png);
    if (size > r->limit - r->used) return NULL;
    union block *block = malloc(sizeof *block + size);
    if (!block) {
        r->exhausted = true;
        return NULL;
    }
    block->size = size;
    r->used += size;
    return block + 1;
}

static void reader_free(png_structp png, png_voidp memory)
{
    struct reader *r = png_get_mem_ptr(png);
    if (!memory) return;
    union block *block = (union block *)memory - 1;
    r->used -= block->size;
    free(block);
}

static void reader_read(png_structp png, png_bytep to, size_t size)
{
    struct reader *r = png_get_io_ptr(png);
    if (size > r->size - r->at) png_error(png, "the file is cut short");
    memcpy(to, r->bytes + r->at, size);
    r->at += size;
}

static void reader_error(png_structp png, png_const_charp message)
{
    struct reader *r = png_get_error_ptr(png);
    if (r->exhausted)
        api_image_problem(r->problem, IMAGE_NO_MEMORY, "out of memory");
    else
        api_image_problem(r->problem, IMAGE_DAMAGED, "the PNG cannot be read: %s", message);
    png_longjmp(png, 1);
}

static void reader_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

/* The only place the library jumps back to; nothing here lives in registers across it. */
static bool attempt(struct reader *r, void (*step)(struct reader *))
{
    r->sound = true;
    if (setjmp(png_jmpbuf(r->png))) return false;
    step(r);
    return r->sound;
}

/* ---- Steps ------------------------------------------------------------------------------ */

static void fail(struct reader *r, enum image_status status, const char *text)
{
    api_image_problem(r->problem, status, "%s", text);
    r->sound = false;
}

static void read_header(struct reader *r)
{
    png_set_read_fn(r->png, r, reader_read);
    png_set_user_limits(r->png, PNG_UINT_31_MAX, PNG_UINT_31_MAX); /* ours come next */
    png_set_chunk_malloc_max(r->png, ANCILLARY_MAX);
    png_set_chunk_cache_max(r->png, CACHED_CHUNKS);
    png_set_keep_unknown_chunks(r->png, PNG_HANDLE_CHUNK_NEVER, NULL, 0);
    png_read_info(r->png, r->info);
}

/* Undoes packing and palettes, drops alpha; libpng is asked for nothing that changes values. */
static void prepare(struct reader *r)
{
    const int colour = png_get_color_type(r->png, r->info);
    r->depth = png_get_bit_depth(r->png, r->info) == 16 ? 16 : 8;
    r->samples = colour & PNG_COLOR_MASK_COLOR ? 3 : 1;
    if (colour == PNG_COLOR_TYPE_PALETTE)
        png_set_palette_to_rgb(r->png);
    else if (colour == PNG_COLOR_TYPE_GRAY)
        png_set_expand_gray_1_2_4_to_8(r->png);
    png_set_strip_alpha(r->png); /* also what a palette's tRNS becomes */
    r->passes = png_set_interlace_handling(r->png);
    png_read_update_info(r->png, r->info);
    r->row_size = png_get_rowbytes(r->png, r->info);
    if (r->row_size != r->image->width * (size_t)(r->samples * r->depth / 8))
        fail(r, IMAGE_DAMAGED, "the PNG has rows of an unexpected size");
}

static unsigned sample(const struct reader *r, const unsigned char *row, size_t i)
{
    return r->depth == 8 ? row[i] : (unsigned)row[2 * i] << 8 | row[2 * i + 1];
}

/* False where the channels of a pixel differ and none was named. */
static bool take_row(struct reader *r, const unsigned char *row, float *out)
{
    const double most = r->depth == 8 ? 255 : 65535;
    const size_t n = (size_t)r->samples;
    const size_t wanted = !r->channel || r->samples == 1 ? 0 : strcspn("RGB", r->channel);
    for (size_t i = 0; i < r->image->width; i++) {
        const unsigned v = sample(r, row, n * i + wanted);
        if (n == 3 && !r->channel &&
            (sample(r, row, 3 * i + 1) != v || sample(r, row, 3 * i + 2) != v))
            return false;
        out[i] = (float)(v / most);
    }
    return true;
}

static void read_rows(struct reader *r)
{
    const size_t height = r->image->height, width = r->image->width;
    for (int pass = 0; pass < r->passes; pass++)
        for (size_t y = 0; y < height; y++) {
            unsigned char *row = r->rows + (r->passes == 1 ? 0 : y * r->row_size);
            if (r->watch && r->watch->cancelled && y % WATCH_ROWS == 0 &&
                r->watch->cancelled(r->watch->user)) {
                fail(r, IMAGE_CANCELLED, "cancelled");
                return;
            }
            png_read_row(r->png, row, NULL);
            if (pass < r->passes - 1) continue;
            if (!take_row(r, row, r->image->values + y * width)) {
                fail(r, IMAGE_NO_CHANNEL,
                     "the PNG is coloured, so it is no height map; channel=R, G or B takes one");
                return;
            }
        }
}

/* ---- The door ---------------------------------------------------------------------------- */

bool api_png_is(const unsigned char *bytes, size_t size)
{
    return size >= 8 && !memcmp(bytes, "\x89PNG\r\n\x1a\n", 8);
}

/* Refuses what could not be in a file of this size, then allocates. */
static enum image_status open_image(struct reader *r)
{
    const size_t width = png_get_image_width(r->png, r->info);
    const size_t height = png_get_image_height(r->png, r->info);
    enum image_status status = api_image_check(width, height, r->problem);
    if (status != IMAGE_OK) return status;
    const size_t bits = (size_t)png_get_bit_depth(r->png, r->info) *
                        png_get_channels(r->png, r->info) * width * height;
    if (bits / 8 / RATIO_MAX > r->size)
        return api_image_problem(r->problem, IMAGE_DAMAGED,
                                 "the PNG is too short for its %zu x %zu pixels", width, height);
    return api_image_open(r->image, width, height, r->problem);
}

static enum image_status check_channel(struct reader *r)
{
    const int colour = png_get_color_type(r->png, r->info) & PNG_COLOR_MASK_COLOR;
    const char *c = r->channel;
    if (!c) return IMAGE_OK;
    if (colour ? strlen(c) == 1 && strchr("RGB", *c) : !strcmp(c, "Y")) return IMAGE_OK;
    return api_image_problem(r->problem, IMAGE_NO_CHANNEL,
                             "the PNG has no channel \"%.40s\", only: %s", c,
                             colour ? "R, G, B" : "Y");
}

static enum image_status read_all(struct reader *r)
{
    if (!attempt(r, read_header)) return r->problem->status;
    enum image_status status = check_channel(r);
    if (status == IMAGE_OK) status = open_image(r);
    if (status != IMAGE_OK) return status;
    /* Row buffers of the library: a few rows of at most 8 bytes a pixel. */
    r->limit += 64 * r->image->width;
    if (!attempt(r, prepare)) return r->problem->status;
    r->rows = malloc(r->passes == 1 ? r->row_size : r->row_size * r->image->height);
    if (!r->rows) return api_image_problem(r->problem, IMAGE_NO_MEMORY, "out of memory");
    return attempt(r, read_rows) ? IMAGE_OK : r->problem->status;
}

static void describe(struct reader *r)
{
    const bool grey = r->samples == 1;
    strcpy(r->image->type, r->depth == 8 ? "8-bit" : "16-bit");
    strcpy(r->image->channel, grey ? "Y" : !r->channel ? "R=G=B" : r->channel);
}

enum image_status api_png_read(const void *bytes, size_t size, const char *channel,
                               const facet_watch *watch, struct image *image,
                               struct image_problem *problem)
{
    struct reader r = {.bytes = bytes,
                       .size = size,
                       .limit = SLACK,
                       .channel = channel,
                       .watch = watch,
                       .image = image,
                       .problem = problem};
    *image = (struct image){.values = NULL};
    enum image_status status = IMAGE_NO_MEMORY;
    r.png = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, &r, reader_error, reader_warning, &r,
                                     reader_alloc, reader_free);
    if (r.png) r.info = png_create_info_struct(r.png);
    if (r.info)
        status = read_all(&r);
    else
        api_image_problem(problem, status, "out of memory");
    /* libpng goes on without a comment it had no memory for. */
    if (status == IMAGE_OK && r.exhausted)
        status = api_image_problem(problem, IMAGE_NO_MEMORY, "out of memory");
    if (status == IMAGE_OK) describe(&r);
    if (r.png) png_destroy_read_struct(&r.png, &r.info, NULL);
    free(r.rows);
    if (status != IMAGE_OK) api_image_clear(image);
    return status;
}
