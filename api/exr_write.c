/* exr_write.c - pyramids to OpenEXR files. */
#include "exr.h"

#include <openexr.h>
#include <stdlib.h>
#include <string.h>

enum {
    TILE = 64,
    ZIP_LEVEL = 2,
    CHUNK_HEAD = 28, /* five numbers before a tile, its place in the table of chunks */
    HEADER = 4096,
};

/* The file, growing in memory. */
struct output {
    unsigned char *bytes;
    size_t size, room;
    bool no_memory;
};

static int64_t output_write(exr_const_context_t context, void *user, const void *buffer,
                            uint64_t size, uint64_t offset, exr_stream_error_func_ptr_t error)
{
    struct output *out = user;
    (void)context;
    (void)error;
    if (offset > SIZE_MAX / 4 || size > SIZE_MAX / 4) return -1;
    const size_t end = (size_t)(offset + size);
    if (end > out->room) {
        const size_t room = end + end / 2;
        unsigned char *grown = realloc(out->bytes, room);
        if (!grown) {
            out->no_memory = true;
            return -1;
        }
        out->bytes = grown;
        out->room = room;
    }
    if (offset > out->size) memset(out->bytes + out->size, 0, (size_t)offset - out->size);
    memcpy(out->bytes + offset, buffer, size);
    if (end > out->size) out->size = end;
    return (int64_t)size;
}

/* Without a handler the library prints to stderr; its codes say enough here. */
static void silent(exr_const_context_t context, exr_result_t code, const char *message)
{
    (void)context;
    (void)code;
    (void)message;
}

/*
 * An upper bound of the file (a tile that does not shrink is stored as it is), so
 * that it is allocated once; what is not written to costs no memory.
 */
static size_t size_bound(const struct exr_pyramid *p)
{
    size_t bound = HEADER;
    for (size_t i = 0; i < p->attribute_count; i++)
        bound += 64 + (p->attributes[i].text ? strlen(p->attributes[i].text) : 0);
    for (size_t i = 0; i < p->level_count; i++) {
        const size_t w = p->levels[i].width, h = p->levels[i].height;
        bound += ((w + TILE - 1) / TILE) * ((h + TILE - 1) / TILE) * CHUNK_HEAD;
        bound += w * h * p->plane_count * (p->half ? 2 : 4);
    }
    return bound;
}

struct writer {
    exr_context_t context;
    int part;
    const struct exr_pyramid *pyramid;
    const facet_watch *watch;
    bool cancelled;
    uint16_t *halves;                                      /* the planes of one tile */
    exr_result_t (*compress)(exr_encode_pipeline_t *pipe); /* the library's */
};

static exr_result_t write_attribute(struct writer *w, const struct exr_attribute *a)
{
    if (a->text) return exr_attr_set_string(w->context, w->part, a->name, a->text);
    return exr_attr_set_double(w->context, w->part, a->name, a->number);
}

static exr_result_t write_header(struct writer *w)
{
    const struct exr_pyramid *p = w->pyramid;
    const exr_pixel_type_t type = p->half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;
    exr_result_t result = exr_add_part(w->context, NULL, EXR_STORAGE_TILED, &w->part);
    if (result == EXR_ERR_SUCCESS)
        result = exr_initialize_required_attr_simple(
            w->context, w->part, (int32_t)p->levels[0].width, (int32_t)p->levels[0].height,
            p->compress ? EXR_COMPRESSION_ZIP : EXR_COMPRESSION_NONE);
    if (result == EXR_ERR_SUCCESS)
        result = exr_set_tile_descriptor(w->context, w->part, TILE, TILE, EXR_TILE_MIPMAP_LEVELS,
                                         EXR_TILE_ROUND_DOWN);
    if (result == EXR_ERR_SUCCESS && p->compress)
        result = exr_set_zip_compression_level(w->context, w->part, ZIP_LEVEL);
    for (size_t i = 0; i < p->plane_count && result == EXR_ERR_SUCCESS; i++)
        result =
            exr_add_channel(w->context, w->part, p->names[i], type, EXR_PERCEPTUALLY_LINEAR, 1, 1);
    for (size_t i = 0; i < p->attribute_count && result == EXR_ERR_SUCCESS; i++)
        result = write_attribute(w, &p->attributes[i]);
    return result == EXR_ERR_SUCCESS ? exr_write_header(w->context) : result;
}

/* Exact: the value is one binary16 has. */
static uint16_t to_half(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    const uint32_t sign = bits >> 16 & 0x8000u, magnitude = bits & 0x7fffffffu;
    if (magnitude >= 0x38800000u) return (uint16_t)(sign | (magnitude - 0x38000000u) >> 13);
    const float absolute = value < 0 ? -value : value;
    return (uint16_t)(sign | (uint32_t)(absolute * 0x1p24f));
}

/* Where the pipeline takes plane i of the tile at (x, y) from. */
static void aim(struct writer *w, const struct exr_level *level, size_t x, size_t y, size_t i,
                exr_coding_channel_info_t *c)
{
    const float *from = level->plane[i] + y * level->width + x;
    const size_t element = w->pyramid->half ? sizeof *w->halves : sizeof *from;
    size_t line = level->width;
    c->encode_from_ptr = (const uint8_t *)from;
    if (w->pyramid->half) {
        uint16_t *to = w->halves + i * TILE * TILE;
        line = TILE;
        for (int32_t q = 0; q < c->height; q++)
            for (int32_t p = 0; p < c->width; p++)
                to[q * TILE + p] = to_half(from[(size_t)q * level->width + (size_t)p]);
        c->encode_from_ptr = (const uint8_t *)to;
    }
    c->user_bytes_per_element = (int16_t)element;
    c->user_data_type = w->pyramid->half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;
    c->user_pixel_stride = (int32_t)element;
    c->user_line_stride = (int32_t)(line * element);
}

/*
 * The library (3.1.5) takes the tiles at the right and lower edge of every level
 * but the first for whole ones, so it is told their size.
 */
static exr_result_t tile_info(struct writer *w, int level, int x, int y, exr_chunk_info_t *info)
{
    const struct exr_level *l = &w->pyramid->levels[level];
    const size_t right = l->width - (size_t)x * TILE, lower = l->height - (size_t)y * TILE;
    const exr_result_t result =
        exr_write_tile_chunk_info(w->context, w->part, x, y, level, level, info);
    info->width = (int32_t)(right < TILE ? right : TILE);
    info->height = (int32_t)(lower < TILE ? lower : TILE);
    info->unpacked_size = (uint64_t)info->width * (uint64_t)info->height * w->pyramid->plane_count *
                          (w->pyramid->half ? 2 : 4);
    return result;
}

/*
 * A chunk as long as its raw data is raw, says the format; the library (3.1.5)
 * keeps a compressed one of just that length, which every reader then takes for
 * pixels.  One tile in a hundred of noisy data.
 */
static exr_result_t compress_tile(exr_encode_pipeline_t *pipe)
{
    const struct writer *w = pipe->encoding_user_data;
    const exr_result_t result = w->compress(pipe);
    if (result == EXR_ERR_SUCCESS && pipe->compressed_bytes == pipe->packed_bytes)
        memcpy(pipe->compressed_buffer, pipe->packed_buffer, pipe->packed_bytes);
    return result;
}

static exr_result_t write_tile(struct writer *w, int level, int x, int y)
{
    exr_chunk_info_t info;
    exr_encode_pipeline_t pipe = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_result_t result = tile_info(w, level, x, y, &info);
    if (result == EXR_ERR_SUCCESS)
        result = exr_encoding_initialize(w->context, w->part, &info, &pipe);
    if (result != EXR_ERR_SUCCESS) return result;
    for (int c = 0; c < pipe.channel_count; c++) /* the library sorts channels by name */
        for (size_t i = 0; i < w->pyramid->plane_count; i++)
            if (!strcmp(pipe.channels[c].channel_name, w->pyramid->names[i]))
                aim(w, &w->pyramid->levels[level], (size_t)x * TILE, (size_t)y * TILE, i,
                    &pipe.channels[c]);
    result = exr_encoding_choose_default_routines(w->context, w->part, &pipe);
    if (result == EXR_ERR_SUCCESS && pipe.compress_fn) {
        w->compress = pipe.compress_fn;
        pipe.encoding_user_data = w;
        pipe.compress_fn = compress_tile;
    }
    if (result == EXR_ERR_SUCCESS) result = exr_encoding_run(w->context, w->part, &pipe);
    exr_encoding_destroy(w->context, &pipe);
    return result;
}

static exr_result_t write_levels(struct writer *w)
{
    for (size_t i = 0; i < w->pyramid->level_count; i++) {
        const struct exr_level *level = &w->pyramid->levels[i];
        const int across = (int)((level->width + TILE - 1) / TILE);
        const int down = (int)((level->height + TILE - 1) / TILE);
        for (int y = 0; y < down; y++) {
            w->cancelled = w->watch && w->watch->cancelled && w->watch->cancelled(w->watch->user);
            if (w->cancelled) return EXR_ERR_UNKNOWN;
            for (int x = 0; x < across; x++) {
                const exr_result_t result = write_tile(w, (int)i, x, y);
                if (result != EXR_ERR_SUCCESS) return result;
            }
        }
    }
    return EXR_ERR_SUCCESS;
}

static exr_result_t write_all(struct writer *w)
{
    if (w->pyramid->half) {
        w->halves = malloc(w->pyramid->plane_count * TILE * TILE * sizeof *w->halves);
        if (!w->halves) return EXR_ERR_OUT_OF_MEMORY;
    }
    const exr_result_t result = write_header(w);
    return result == EXR_ERR_SUCCESS ? write_levels(w) : result;
}

enum image_status api_exr_write(const struct exr_pyramid *pyramid, const facet_watch *watch,
                                void **bytes, size_t *size, struct image_problem *problem)
{
    struct output out = {.room = size_bound(pyramid)};
    struct writer w = {.pyramid = pyramid, .watch = watch};
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = silent;
    init.user_data = &out;
    init.write_fn = output_write;
    out.bytes = malloc(out.room);
    if (!out.bytes) return api_image_problem(problem, IMAGE_NO_MEMORY, "out of memory");
    exr_result_t result = exr_start_write(&w.context, "body", EXR_WRITE_FILE_DIRECTLY, &init);
    if (result == EXR_ERR_SUCCESS) result = write_all(&w);
    /* Finishing writes the table of chunks. */
    if (w.context) {
        const exr_result_t finished = exr_finish(&w.context);
        if (result == EXR_ERR_SUCCESS) result = finished;
    }
    free(w.halves);
    if (result == EXR_ERR_SUCCESS) {
        *bytes = out.bytes;
        *size = out.size;
        return IMAGE_OK;
    }
    free(out.bytes);
    if (w.cancelled) return api_image_problem(problem, IMAGE_CANCELLED, "cancelled");
    if (out.no_memory || result == EXR_ERR_OUT_OF_MEMORY)
        return api_image_problem(problem, IMAGE_NO_MEMORY, "out of memory");
    return api_image_problem(problem, IMAGE_UNSUPPORTED, "the EXR cannot be written: %s",
                             exr_get_default_error_message(result));
}
