/*
 * exr_write.c - pyramids to OpenEXR files.
 *
 * OpenEXRCore writes the header.  The chunks are laid out here: rows of every level
 * come interleaved, and a tile that is not compressed goes straight to its place in
 * the file, so that nothing stands in memory twice.  (Its tile writer, 3.1.5, also
 * mistakes the size of the last tiles of every level but the first.)  libdeflate
 * compresses: three times as fast as the zlib behind OpenEXRCore.
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include "exr.h"

#include <libdeflate.h>
#include <openexr.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

enum {
    TILE = 64,
    ZIP_LEVEL = 1,
    CHUNK_HEAD = 20, /* five numbers before a tile */
    OFFSET = 8,      /* its place in the table of chunks */
    HEADER_MAX = 1 << 16,
    /* Noise does not shrink: where a row of tiles saves less than 1 part in SAVED_PARTS, the next
     * ones of its level are stored as they are, twice as many each time up to SKIPPED_MAX. */
    SAVED_PARTS = 32,
    SKIPPED_MAX = 16,
    PACKERS_MAX = 4, /* tiles compressed at a time; a third of a megabyte each */
};

/* What compressing a tile takes. */
struct exr_packer {
    unsigned char *scratch, *packed; /* tiles */
    struct libdeflate_compressor *compressor;
};

struct exr_level_state {
    size_t width, height, across;
    size_t first_tile;   /* index of its first tile in the table of chunks */
    unsigned char *band; /* a row of tiles, each whole, to be compressed; or in the file itself */
    size_t band_size;
    bool compressed;      /* the first of these */
    unsigned skip, skips; /* rows of tiles not to be tried; how many the last failure cost */
};

struct exr_writer {
    struct exr_pyramid pyramid;
    size_t order[EXR_PLANES_MAX]; /* planes by name, as the format wants */
    size_t element, pixel;        /* bytes of a value, of a pixel */
    size_t header_size, tile_count;
    unsigned char *bytes; /* the file: header, table of chunks, chunks */
    size_t size, room;
    struct exr_packer packers[PACKERS_MAX];
    size_t packer_count;
    size_t *packed_sizes;           /* of a row of tiles */
    struct exr_level_state level[]; /* level_count */
};

/* ---- Header --------------------------------------------------------------------------- */

struct header {
    unsigned char bytes[HEADER_MAX];
    size_t size;
};

static int64_t header_write(exr_const_context_t context, void *user, const void *buffer,
                            uint64_t size, uint64_t offset, exr_stream_error_func_ptr_t error)
{
    struct header *h = user;
    (void)context;
    (void)error;
    if (offset > HEADER_MAX || size > HEADER_MAX - offset) return -1;
    memcpy(h->bytes + offset, buffer, size);
    if (offset + size > h->size) h->size = (size_t)(offset + size);
    return (int64_t)size;
}

/* Without a handler the library prints to stderr; its codes say enough here. */
static void silent(exr_const_context_t context, exr_result_t code, const char *message)
{
    (void)context;
    (void)code;
    (void)message;
}

static exr_result_t write_attribute(exr_context_t c, int part, const struct exr_attribute *a)
{
    if (a->text) return exr_attr_set_string(c, part, a->name, a->text);
    return exr_attr_set_double(c, part, a->name, a->number);
}

static exr_result_t describe(exr_context_t c, const struct exr_pyramid *p,
                             const struct exr_attribute *attributes, size_t count)
{
    const exr_pixel_type_t type = p->half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;
    exr_attr_box2i_t window;
    exr_attr_v2f_t center;
    int part = 0;
    memset(&window, 0, sizeof window);
    memset(&center, 0, sizeof center);
    window.max.x = (int32_t)p->widths[0] - 1;
    window.max.y = (int32_t)p->heights[0] - 1;
    exr_result_t result = exr_add_part(c, NULL, EXR_STORAGE_TILED, &part);
    if (result == EXR_ERR_SUCCESS)
        result = exr_initialize_required_attr(
            c, part, &window, &window, 1, &center, 1, EXR_LINEORDER_RANDOM_Y,
            p->compression == EXR_ZIP ? EXR_COMPRESSION_ZIP : EXR_COMPRESSION_NONE);
    if (result == EXR_ERR_SUCCESS)
        result = exr_set_tile_descriptor(c, part, TILE, TILE, EXR_TILE_MIPMAP_LEVELS,
                                         EXR_TILE_ROUND_DOWN);
    for (size_t i = 0; i < p->plane_count && result == EXR_ERR_SUCCESS; i++)
        result = exr_add_channel(c, part, p->names[i], type, EXR_PERCEPTUALLY_LINEAR, 1, 1);
    for (size_t i = 0; i < count && result == EXR_ERR_SUCCESS; i++)
        result = write_attribute(c, part, &attributes[i]);
    return result == EXR_ERR_SUCCESS ? exr_write_header(c) : result;
}

static enum image_status make_header(const struct exr_pyramid *p,
                                     const struct exr_attribute *attributes, size_t count,
                                     struct header *header, struct image_problem *problem)
{
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_context_t c = NULL;
    header->size = 0;
    init.error_handler_fn = silent;
    init.user_data = header;
    init.write_fn = header_write;
    exr_result_t result = exr_start_write(&c, "body", EXR_WRITE_FILE_DIRECTLY, &init);
    if (result == EXR_ERR_SUCCESS) result = describe(c, p, attributes, count);
    const size_t size = header->size;
    if (c) exr_finish(&c); /* writes a table of chunks, which is made here */
    header->size = size;
    if (result == EXR_ERR_SUCCESS) return IMAGE_OK;
    if (result == EXR_ERR_OUT_OF_MEMORY)
        return api_image_problem(problem, IMAGE_NO_MEMORY, "out of memory");
    return api_image_problem(problem, IMAGE_UNSUPPORTED, "the EXR cannot be written: %s",
                             exr_get_default_error_message(result));
}

/* ---- Bands ------------------------------------------------------------------------------ */

static size_t tile_side(size_t side, size_t index)
{
    const size_t left = side - index * TILE;
    return left < TILE ? left : TILE;
}

/* Pages of the system's own: malloc would keep them while the file fills the memory. */
static unsigned char *band_open(size_t size)
{
    void *pages = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return pages == MAP_FAILED ? NULL : pages;
}

static void band_close(struct exr_level_state *l)
{
    if (l->compressed) munmap(l->band, l->band_size);
    l->compressed = false;
}

/* ---- Open ------------------------------------------------------------------------------- */

static size_t tiles(size_t side)
{
    return (side + TILE - 1) / TILE;
}

/* Everything but pixels and their heads: room for it all is taken at once; what is not written to
 * costs no memory. */
static void lay_out(struct exr_writer *w)
{
    const struct exr_pyramid *p = &w->pyramid;
    size_t pixels = 0;
    for (size_t i = 0; i < p->level_count; i++) {
        struct exr_level_state *l = &w->level[i];
        *l = (struct exr_level_state){.width = p->widths[i],
                                      .height = p->heights[i],
                                      .across = tiles(p->widths[i]),
                                      .first_tile = w->tile_count};
        w->tile_count += l->across * tiles(l->height);
        pixels += l->width * l->height;
    }
    w->size = w->header_size + w->tile_count * OFFSET;
    w->room = w->size + w->tile_count * CHUNK_HEAD + pixels * w->pixel;
}

static void sort_planes(struct exr_writer *w)
{
    for (size_t i = 0; i < w->pyramid.plane_count; i++) {
        size_t at = i;
        for (; at && strcmp(w->pyramid.names[w->order[at - 1]], w->pyramid.names[i]) > 0; at--)
            w->order[at] = w->order[at - 1];
        w->order[at] = i;
    }
}

static bool allocate(struct exr_writer *w)
{
    w->bytes = malloc(w->room);
    if (!w->bytes) return false;
    if (w->pyramid.compression != EXR_ZIP) return true;
    const size_t tile = TILE * TILE * w->pixel, across = w->level[0].across;
    w->packed_sizes = malloc(across * sizeof *w->packed_sizes);
    w->packer_count = !w->pyramid.crew ? 1 : across < PACKERS_MAX ? across : PACKERS_MAX;
    for (size_t i = 0; i < w->packer_count; i++) {
        struct exr_packer *p = &w->packers[i];
        p->scratch = malloc(2 * tile);
        p->compressor = p->scratch ? libdeflate_alloc_compressor(ZIP_LEVEL) : NULL;
        if (!p->compressor) return false;
        p->packed = p->scratch + tile;
    }
    return w->packed_sizes;
}

struct exr_writer *api_exr_writer_open(const struct exr_pyramid *pyramid,
                                       const struct exr_attribute *attributes,
                                       size_t attribute_count, struct image_problem *problem)
{
    struct header *header = malloc(sizeof *header);
    struct exr_writer *w = header ? calloc(1, sizeof *w + pyramid->level_count * sizeof *w->level)
                                  : NULL;
    if (w) {
        w->pyramid = *pyramid;
        w->element = pyramid->half ? 2 : 4;
        w->pixel = w->element * pyramid->plane_count;
        sort_planes(w);
    }
    if (!w)
        api_image_problem(problem, IMAGE_NO_MEMORY, "out of memory");
    else if (make_header(pyramid, attributes, attribute_count, header, problem) == IMAGE_OK) {
        w->header_size = header->size;
        lay_out(w);
        if (allocate(w)) {
            free(header);
            return w;
        }
        api_image_problem(problem, IMAGE_NO_MEMORY, "out of memory");
    }
    free(header);
    api_exr_writer_close(w);
    return NULL;
}

void api_exr_writer_close(struct exr_writer *w)
{
    if (!w) return;
    for (size_t i = 0; i < w->pyramid.level_count; i++) band_close(&w->level[i]);
    for (size_t i = 0; i < w->packer_count; i++) {
        libdeflate_free_compressor(w->packers[i].compressor);
        free(w->packers[i].scratch);
    }
    free(w->packed_sizes);
    free(w->bytes);
    free(w);
}

/* ---- Rows --------------------------------------------------------------------------------- */

/* Exact: the value is one binary16 has. */
static uint16_t to_half(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    const uint32_t sign = bits >> 16 & 0x8000u, magnitude = bits & 0x7fffffffu;
    const float absolute = value < 0 ? -value : value;
    if (magnitude >= 0x38800000u) return (uint16_t)(sign | (magnitude - 0x38000000u) >> 13);
    return (uint16_t)(sign | (uint32_t)(absolute * 0x1p24f));
}

static void put(unsigned char *to, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++) to[i] = (unsigned char)(value >> 8 * i);
}

/* Files are little-endian. */
static void put_values(const float *from, size_t n, bool half, unsigned char *to)
{
    if (half) {
        for (size_t i = 0; i < n; i++) put(to + 2 * i, to_half(from[i]), 2);
        return;
    }
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    memcpy(to, from, n * sizeof *from);
#else
    for (size_t i = 0; i < n; i++) {
        uint32_t bits;
        memcpy(&bits, &from[i], sizeof bits);
        put(to + 4 * i, bits, 4);
    }
#endif
}

/* The head of the tile's chunk at the end of the file, and its place in the table. */
static unsigned char *add_chunk(struct exr_writer *w, size_t level, size_t x, size_t y,
                                size_t data_size)
{
    const struct exr_level_state *l = &w->level[level];
    put(w->bytes + w->header_size + (l->first_tile + y * l->across + x) * OFFSET, w->size, OFFSET);
    unsigned char *at = w->bytes + w->size;
    const size_t head[5] = {x, y, level, level, data_size};
    for (int i = 0; i < 5; i++) put(at + 4 * i, head[i], 4);
    w->size += CHUNK_HEAD + data_size;
    return at + CHUNK_HEAD;
}

/* The format's ZIP: bytes of even and odd places apart, differences, zlib.  0: it does not shrink. */
static size_t compress(const struct exr_packer *p, const unsigned char *from, size_t size)
{
    unsigned char *to = p->scratch, *odd = to + (size + 1) / 2;
    for (size_t i = 0; i < size / 2; i++) {
        to[i] = from[2 * i];
        odd[i] = from[2 * i + 1];
    }
    if (size % 2) to[size / 2] = from[size - 1];
    /* Backwards, so that each difference finds its neighbour as it was. */
    for (size_t i = size; i-- > 1;) to[i] = (unsigned char)(to[i] - to[i - 1] + 128);
    /* A chunk as long as its pixels is taken for pixels, so it must be shorter. */
    return size > 1 ? libdeflate_zlib_compress(p->compressor, to, size, p->packed, size - 1) : 0;
}

/* A tile of a row of tiles `height` high. */
static unsigned char *tile_of(const struct exr_writer *w, const struct exr_level_state *l,
                              size_t height, size_t x, size_t *size)
{
    *size = tile_side(l->width, x) * height * w->pixel;
    return l->band + x * TILE * height * w->pixel;
}

struct packing {
    struct exr_writer *writer;
    const struct exr_level_state *level;
    size_t height;
};

/* Every packer_count-th tile, from this packer's on, in place; on any thread. */
static void pack_tiles(void *packing_, size_t packer)
{
    const struct packing *packing = packing_;
    struct exr_writer *w = packing->writer;
    for (size_t x = packer, size; x < packing->level->across; x += w->packer_count) {
        unsigned char *tile = tile_of(w, packing->level, packing->height, x, &size);
        const size_t packed = compress(&w->packers[packer], tile, size);
        if (packed) memcpy(tile, w->packers[packer].packed, packed);
        w->packed_sizes[x] = packed ? packed : size;
    }
}

/* A new row of tiles: where nothing is to be compressed, its chunks are laid out at once. */
static bool begin_band(struct exr_writer *w, size_t level, size_t y)
{
    struct exr_level_state *l = &w->level[level];
    const size_t height = tile_side(l->height, y);
    if (w->pyramid.compression == EXR_ZIP && !l->skip) {
        l->band_size = l->width * height * w->pixel;
        l->band = band_open(l->band_size);
        l->compressed = l->band;
        return l->band;
    }
    if (l->skip) l->skip--;
    l->band = w->bytes + w->size;
    for (size_t x = 0; x < l->across; x++)
        add_chunk(w, level, x, y, tile_side(l->width, x) * height * w->pixel);
    return true;
}

static void end_band(struct exr_writer *w, size_t level, size_t y)
{
    struct exr_level_state *l = &w->level[level];
    if (!l->compressed) return;
    const size_t height = tile_side(l->height, y);
    struct packing packing = {w, l, height};
    const facet_crew *crew = w->pyramid.crew;
    if (crew && l->across > 1)
        crew->share(crew->user, w->packer_count, pack_tiles, &packing);
    else
        for (size_t p = 0; p < w->packer_count; p++) pack_tiles(&packing, p);
    size_t saved = 0;
    for (size_t x = 0, size; x < l->across; x++) {
        const unsigned char *tile = tile_of(w, l, height, x, &size);
        const size_t stored = w->packed_sizes[x];
        memcpy(add_chunk(w, level, x, y, stored), tile, stored);
        saved += size - stored;
    }
    const bool worth = saved >= l->band_size / SAVED_PARTS;
    band_close(l);
    l->skips = worth ? 0 : l->skips ? 2 * l->skips : 1;
    if (l->skips > SKIPPED_MAX) l->skips = SKIPPED_MAX;
    l->skip = l->skips;
}

_Static_assert((int)FACET_SINK_ROWS == (int)TILE,
               "rows that come together are of one row of tiles");

bool api_exr_writer_begin(struct exr_writer *w, size_t level, size_t first, size_t count)
{
    (void)count;
    return first % TILE != 0 || begin_band(w, level, first / TILE);
}

void api_exr_writer_end(struct exr_writer *w, size_t level, size_t first, size_t count)
{
    const size_t end = first + count;
    if (end % TILE == 0 || end == w->level[level].height) end_band(w, level, first / TILE);
}

void api_exr_writer_put(const struct exr_writer *w, size_t level, size_t row,
                        const float *const *planes)
{
    const struct exr_level_state *l = &w->level[level];
    const size_t y = row / TILE, inside = row % TILE, height = tile_side(l->height, y);
    const size_t head = l->compressed ? 0 : CHUNK_HEAD;
    for (size_t x = 0; x < l->across; x++) {
        const size_t width = tile_side(l->width, x);
        unsigned char *to = l->band + x * (head + TILE * height * w->pixel) + head +
                            inside * width * w->pixel;
        for (size_t k = 0; k < w->pyramid.plane_count; k++, to += width * w->element)
            put_values(planes[w->order[k]] + x * TILE, width, w->pyramid.half, to);
    }
}

/* ---- Finish ---------------------------------------------------------------------------------- */

enum image_status api_exr_writer_finish(struct exr_writer *w,
                                        const struct exr_attribute *attributes,
                                        size_t attribute_count, void **bytes, size_t *size,
                                        struct image_problem *problem)
{
    struct header *header = malloc(sizeof *header);
    if (!header) return api_image_problem(problem, IMAGE_NO_MEMORY, "out of memory");
    enum image_status status = make_header(&w->pyramid, attributes, attribute_count, header,
                                           problem);
    if (status == IMAGE_OK && header->size != w->header_size)
        status = api_image_problem(problem, IMAGE_UNSUPPORTED,
                                   "the EXR's header changed its length");
    if (status == IMAGE_OK) {
        memcpy(w->bytes, header->bytes, header->size);
        *bytes = w->bytes; /* what is not written to costs no memory */
        *size = w->size;
        w->bytes = NULL;
    }
    free(header);
    return status;
}
