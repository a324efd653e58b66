/*
 * exr_read.c - OpenEXR files to planes.
 *
 * OpenEXRCore parses the header, finds and decompresses chunks; picking the
 * channel out of a chunk is done here, because that is where the library's
 * unpackers have had their overruns, and it is ten lines.
 */
#include "exr.h"
#include "facet_leadr.h"

#include <openexr.h>
#include <stdlib.h>
#include <string.h>

enum {
    SLACK = 16 << 20,    /* what the library may allocate whatever the file: PIZ tables, context */
    RATIO_MAX = 2048,    /* no codec here packs better: zlib ends at 1032, RLE at 64 */
    CHUNK_HEAD = 16,     /* a chunk takes 8 bytes in the table and 8 before its data */
    CHANNELS_MAX = 1024, /* in a part */
    CHUNK_MAX = 128 << 20,  /* bytes a chunk may unpack to */
    UNPACKED_MAX = 1 << 30, /* bytes a part may unpack to, all channels */
    LISTED_CHANNELS = 16,   /* named in the message about a missing one */
};

/* ---- The library's memory and input -------------------------------------------------- */

/*
 * The library hands its allocator no context, so the account is the thread's.  A
 * block remembers its size in front, aligned for anything.
 */
static _Thread_local struct {
    size_t used, limit;
    bool exhausted; /* the system, not the limit, refused */
} account;

union block {
    size_t size;
    max_align_t align;
};

static void *account_alloc(size_t size)
{
    if (size > account.limit - account.used) return NULL;
    /* Zeroed: a chunk that unpacks to less than it should must not show old memory. */
    union block *block = calloc(1, sizeof *block + size);
    if (!block) {
        account.exhausted = true;
        return NULL;
    }
    block->size = size;
    account.used += size;
    return block + 1;
}

static void account_free(void *memory)
{
    if (!memory) return;
    union block *block = (union block *)memory - 1;
    account.used -= block->size;
    free(block);
}

struct input {
    const unsigned char *bytes;
    size_t size;
    char message[160]; /* the library's first complaint */
};

static int64_t input_read(exr_const_context_t context, void *user, void *buffer, uint64_t size,
                          uint64_t offset, exr_stream_error_func_ptr_t error)
{
    const struct input *in = user;
    (void)context;
    (void)error;
    if (offset >= in->size) return 0;
    if (size > in->size - offset) size = in->size - offset;
    memcpy(buffer, in->bytes + offset, size);
    return (int64_t)size;
}

static int64_t input_size(exr_const_context_t context, void *user)
{
    (void)context;
    return (int64_t)((const struct input *)user)->size;
}

/* Without a handler the library prints to stderr. */
static void input_error(exr_const_context_t context, exr_result_t code, const char *message)
{
    void *user = NULL;
    (void)code;
    if (exr_get_user_data(context, &user) != EXR_ERR_SUCCESS || !user || !message) return;
    struct input *in = user;
    if (in->message[0]) return;
    size_t n = 0;
    for (; message[n] && n < sizeof in->message - 1; n++)
        in->message[n] = message[n] >= ' ' && message[n] <= '~' ? message[n] : '?';
    in->message[n] = 0;
}

/* ---- What is in the file --------------------------------------------------------------- */

struct reader {
    exr_context_t context;
    struct input input;
    const facet_watch *watch;
    struct image_problem *problem;
    int part;
    bool tiled;
    exr_attr_box2i_t window;
    const exr_attr_chlist_t *channels;
    int chosen;                        /* index into channels */
    int32_t chunk_width, chunk_height; /* of a whole chunk */
};

static enum image_status library_problem(struct reader *r, exr_result_t result)
{
    if (account.exhausted) return api_image_problem(r->problem, IMAGE_NO_MEMORY, "out of memory");
    if (result == EXR_ERR_OUT_OF_MEMORY)
        return api_image_problem(r->problem, IMAGE_DAMAGED,
                                 "the EXR asks for more memory than its size warrants");
    const char *why = r->input.message;
    return api_image_problem(r->problem, IMAGE_DAMAGED, "the EXR cannot be read: %s",
                             why[0] ? why : exr_get_default_error_message(result));
}

static size_t element_size(exr_pixel_type_t type)
{
    return type == EXR_PIXEL_HALF ? 2 : 4;
}

static int find_channel(const exr_attr_chlist_t *list, const char *name)
{
    for (int i = 0; i < list->num_channels; i++)
        if (!strcmp(list->entries[i].name.str, name)) return i;
    return -1;
}

static int choose_channel(const exr_attr_chlist_t *list, const char *name)
{
    static const char *const likely[] = {"height", "displacement", "Y", "R", "Z"};
    if (name) return find_channel(list, name);
    if (list->num_channels == 1) return 0;
    for (size_t i = 0; i < sizeof likely / sizeof *likely; i++) {
        const int found = find_channel(list, likely[i]);
        if (found >= 0) return found;
    }
    return -1;
}

static enum image_status no_channel(struct reader *r, const char *name,
                                    const exr_attr_chlist_t *list)
{
    char names[128] = "";
    size_t used = 0;
    for (int i = 0; i < list->num_channels && i < LISTED_CHANNELS; i++) {
        const char *s = list->entries[i].name.str;
        const size_t n = strlen(s);
        if (used + n + 3 > sizeof names) break;
        if (used) memcpy(names + used, ", ", 2), used += 2;
        memcpy(names + used, s, n + 1);
        used += n;
    }
    if (!name)
        return api_image_problem(r->problem, IMAGE_NO_CHANNEL,
                                 "name the channel of the heights; the EXR has: %s", names);
    return api_image_problem(r->problem, IMAGE_NO_CHANNEL,
                             "the EXR has no channel \"%.40s\", only: %s", name, names);
}

static enum image_status choose_part(struct reader *r, const char *name)
{
    int count = 0, first = -1;
    if (exr_get_count(r->context, &count) != EXR_ERR_SUCCESS) count = 0;
    const exr_attr_chlist_t *first_list = NULL;
    for (r->part = 0; r->part < count; r->part++) {
        exr_storage_t storage;
        if (exr_get_storage(r->context, r->part, &storage) != EXR_ERR_SUCCESS) continue;
        if (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED) continue;
        if (exr_get_channels(r->context, r->part, &r->channels) != EXR_ERR_SUCCESS) continue;
        if (first < 0) {
            first = r->part;
            first_list = r->channels;
        }
        r->tiled = storage == EXR_STORAGE_TILED;
        r->chosen = choose_channel(r->channels, name);
        if (r->chosen >= 0) return IMAGE_OK;
    }
    if (first < 0)
        return api_image_problem(r->problem, IMAGE_UNSUPPORTED,
                                 "the EXR has no scanline or tiled part (deep data are not read)");
    return no_channel(r, name, first_list);
}

/* Multiples of step in [low, high]: the samples a subsampled channel has there. */
static size_t samples(int32_t low, int32_t high, int32_t step)
{
    const int64_t a = low, b = high, s = step;
    const int64_t below = (a - 1 >= 0 ? (a - 1) / s : -((-(a - 1) + s - 1) / s));
    const int64_t up_to = b >= 0 ? b / s : -((-b + s - 1) / s);
    return (size_t)(up_to - below);
}

/* Bytes of one line of one channel over columns x0 .. x1; 0 where it has no sample in line y. */
static size_t line_size(const exr_attr_chlist_entry_t *c, int32_t y, int32_t x0, int32_t x1)
{
    if (y % c->y_sampling != 0) return 0;
    return samples(x0, x1, c->x_sampling) * element_size(c->pixel_type);
}

static enum image_status check_channels(struct reader *r)
{
    const exr_attr_chlist_entry_t *chosen = &r->channels->entries[r->chosen];
    if (chosen->x_sampling != 1 || chosen->y_sampling != 1)
        return api_image_problem(r->problem, IMAGE_UNSUPPORTED, "channel \"%.40s\" is subsampled",
                                 chosen->name.str);
    if (r->channels->num_channels > CHANNELS_MAX)
        return api_image_problem(r->problem, IMAGE_TOO_LARGE, "the EXR has %d channels; at most %d",
                                 r->channels->num_channels, CHANNELS_MAX);
    for (int i = 0; i < r->channels->num_channels; i++) {
        const exr_attr_chlist_entry_t *c = &r->channels->entries[i];
        const bool sane = c->x_sampling >= 1 && c->y_sampling >= 1 &&
                          (unsigned)c->pixel_type < EXR_PIXEL_LAST_TYPE;
        if (!sane) return api_image_problem(r->problem, IMAGE_DAMAGED, "the EXR has a bad channel");
    }
    exr_compression_t compression;
    if (exr_get_compression(r->context, r->part, &compression) != EXR_ERR_SUCCESS)
        return api_image_problem(r->problem, IMAGE_DAMAGED, "the EXR names no compression");
    switch (compression) {
    case EXR_COMPRESSION_NONE:
    case EXR_COMPRESSION_RLE:
    case EXR_COMPRESSION_ZIPS:
    case EXR_COMPRESSION_ZIP:
    case EXR_COMPRESSION_PIZ:
    case EXR_COMPRESSION_PXR24: return IMAGE_OK;
    default:
        return api_image_problem(r->problem, IMAGE_UNSUPPORTED,
                                 "the EXR is compressed with B44, DWA or something newer; "
                                 "use none, RLE, ZIP, PIZ or PXR24");
    }
}

/* Refuses whatever could not be in a file of this size, before anything is allocated for it. */
static enum image_status check_chunks(struct reader *r, size_t width, size_t height)
{
    uint32_t tile_width = 0, tile_height = 0;
    exr_tile_level_mode_t levels;
    exr_tile_round_mode_t rounding;
    int32_t lines = 0, chunks = 0;
    exr_result_t result;
    if (r->tiled) {
        result = exr_get_tile_descriptor(r->context, r->part, &tile_width, &tile_height, &levels,
                                         &rounding);
    } else {
        result = exr_get_scanlines_per_chunk(r->context, r->part, &lines);
        tile_width = (uint32_t)width;
        tile_height = (uint32_t)lines;
    }
    if (result == EXR_ERR_SUCCESS) result = exr_get_chunk_count(r->context, r->part, &chunks);
    if (result != EXR_ERR_SUCCESS) return library_problem(r, result);
    if (tile_width < 1 || tile_height < 1 || tile_width > FACET_MAP_SIDE_MAX ||
        tile_height > FACET_MAP_SIDE_MAX || chunks < 1)
        return api_image_problem(r->problem, IMAGE_DAMAGED, "the EXR has bad tile sizes");
    r->chunk_width = (int32_t)tile_width;
    r->chunk_height = (int32_t)tile_height;

    size_t pixel = 0;
    for (int i = 0; i < r->channels->num_channels; i++)
        pixel += element_size(r->channels->entries[i].pixel_type);
    const size_t across = (width + tile_width - 1) / tile_width;
    const size_t down = (height + tile_height - 1) / tile_height;
    const size_t unpacked = width * height * pixel;
    if ((size_t)chunks < across * down || (size_t)chunks > r->input.size / CHUNK_HEAD ||
        unpacked / RATIO_MAX > r->input.size)
        return api_image_problem(r->problem, IMAGE_DAMAGED,
                                 "the EXR is too short for its %zu x %zu pixels", width, height);
    const size_t chunk = (tile_width < width ? tile_width : width) *
                         (tile_height < height ? tile_height : height) * pixel;
    if (unpacked > UNPACKED_MAX || chunk > CHUNK_MAX)
        return api_image_problem(r->problem, IMAGE_TOO_LARGE,
                                 "the EXR unpacks to %zu bytes in chunks of %zu; at most %d and %d",
                                 unpacked, chunk, UNPACKED_MAX, CHUNK_MAX);
    /* Packed, unpacked and two scratch buffers of the largest chunk. */
    account.limit = SLACK + 2 * r->input.size + 4 * chunk;
    return IMAGE_OK;
}

/* ---- Chunks ---------------------------------------------------------------------------- */

static float from_half(uint16_t h)
{
    const uint32_t sign = (uint32_t)(h & 0x8000u) << 16, exponent = (h >> 10) & 31u;
    uint32_t bits = h & 0x3ffu;
    float value;
    if (exponent == 0) {
        value = (float)bits * 0x1p-24f;
        return sign ? -value : value;
    }
    bits = sign | (exponent == 31 ? 0x7f800000u : (exponent + 112) << 23) | bits << 13;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Files are little-endian. */
static void convert(const unsigned char *from, exr_pixel_type_t type, size_t n, float *to)
{
    for (size_t i = 0; i < n; i++) {
        if (type == EXR_PIXEL_HALF) {
            to[i] = from_half((uint16_t)(from[2 * i] | from[2 * i + 1] << 8));
            continue;
        }
        const unsigned char *b = from + 4 * i;
        const uint32_t bits = b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 |
                              (uint32_t)b[3] << 24;
        if (type == EXR_PIXEL_UINT)
            to[i] = (float)bits;
        else
            memcpy(&to[i], &bits, sizeof bits);
    }
}

/* Columns and lines of one chunk, from 0. */
struct area {
    int32_t x, y, width, height;
};

static size_t area_size(const struct reader *r, const struct area *a)
{
    size_t sum = 0;
    for (int32_t q = 0; q < a->height; q++)
        for (int i = 0; i < r->channels->num_channels; i++)
            sum += line_size(&r->channels->entries[i], r->window.min.y + a->y + q,
                             r->window.min.x + a->x, r->window.min.x + a->x + a->width - 1);
    return sum;
}

/* A chunk holds its lines one after the other, and in a line channel after channel. */
static void pick(const struct reader *r, const struct area *a, const unsigned char *data,
                 struct image *image)
{
    for (int32_t q = 0; q < a->height; q++)
        for (int i = 0; i < r->channels->num_channels; i++) {
            const exr_attr_chlist_entry_t *c = &r->channels->entries[i];
            if (i == r->chosen)
                convert(data, c->pixel_type, (size_t)a->width,
                        image->values + (size_t)(a->y + q) * image->width + a->x);
            data += line_size(c, r->window.min.y + a->y + q, r->window.min.x + a->x,
                              r->window.min.x + a->x + a->width - 1);
        }
}

/* Run the library's read and decompress stages, not its unpacking, and pick the channel out. */
static exr_result_t decode(struct reader *r, const struct area *a, const exr_chunk_info_t *info,
                           exr_decode_pipeline_t *pipe, bool *started, struct image *image)
{
    exr_result_t result = *started ? exr_decoding_update(r->context, r->part, info, pipe)
                                   : exr_decoding_initialize(r->context, r->part, info, pipe);
    if (result != EXR_ERR_SUCCESS) return result;
    if (!*started) {
        *started = true;
        if (r->chosen >= pipe->channel_count) return EXR_ERR_CORRUPT_CHUNK;
        /* A stride no file has keeps it from choosing to read straight into the channel. */
        exr_coding_channel_info_t *c = &pipe->channels[r->chosen];
        c->decode_to_ptr = (uint8_t *)image->values;
        c->user_pixel_stride = 64;
        c->user_line_stride = 64;
        result = exr_decoding_choose_default_routines(r->context, r->part, pipe);
        if (result != EXR_ERR_SUCCESS) return result;
        pipe->unpack_and_convert_fn = NULL;
    }
    result = exr_decoding_run(r->context, r->part, pipe);
    if (result != EXR_ERR_SUCCESS) return result;
    if (!pipe->unpacked_buffer) return EXR_ERR_CORRUPT_CHUNK;
    pick(r, a, pipe->unpacked_buffer, image);
    return EXR_ERR_SUCCESS;
}

static exr_result_t find_chunk(struct reader *r, const struct area *a, exr_chunk_info_t *info)
{
    exr_result_t result;
    if (r->tiled)
        result = exr_read_tile_chunk_info(r->context, r->part, a->x / r->chunk_width,
                                          a->y / r->chunk_height, 0, 0, info);
    else
        result = exr_read_scanline_chunk_info(r->context, r->part, r->window.min.y + a->y, info);
    if (result != EXR_ERR_SUCCESS) return result;
    const size_t size = area_size(r, a);
    const bool sane = info->width == a->width && info->height == a->height &&
                      info->unpacked_size == size && info->packed_size <= r->input.size &&
                      (info->packed_size == size ||
                       (info->packed_size < size && info->compression != EXR_COMPRESSION_NONE));
    return sane ? EXR_ERR_SUCCESS : EXR_ERR_BAD_CHUNK_LEADER;
}

static enum image_status read_chunks(struct reader *r, struct image *image)
{
    const int32_t width = (int32_t)image->width, height = (int32_t)image->height;
    exr_decode_pipeline_t pipe = EXR_DECODE_PIPELINE_INITIALIZER;
    exr_result_t result = EXR_ERR_SUCCESS;
    bool started = false, stopped = false;
    struct area a = {0, 0, 0, 0};
    for (; a.y < height && result == EXR_ERR_SUCCESS && !stopped; a.y += r->chunk_height) {
        a.height = height - a.y < r->chunk_height ? height - a.y : r->chunk_height;
        for (a.x = 0; a.x < width && result == EXR_ERR_SUCCESS; a.x += r->chunk_width) {
            a.width = width - a.x < r->chunk_width ? width - a.x : r->chunk_width;
            exr_chunk_info_t info;
            result = find_chunk(r, &a, &info);
            if (result == EXR_ERR_SUCCESS) result = decode(r, &a, &info, &pipe, &started, image);
        }
        stopped = r->watch && r->watch->cancelled && r->watch->cancelled(r->watch->user);
    }
    if (started) exr_decoding_destroy(r->context, &pipe);
    if (result != EXR_ERR_SUCCESS) return library_problem(r, result);
    return stopped ? api_image_problem(r->problem, IMAGE_CANCELLED, "cancelled") : IMAGE_OK;
}

/* ---- The door ---------------------------------------------------------------------------- */

bool api_exr_is(const unsigned char *bytes, size_t size)
{
    return size >= 4 && !memcmp(bytes, "\x76\x2f\x31\x01", 4);
}

static enum image_status read_part(struct reader *r, const char *channel, struct image *image)
{
    enum image_status status = choose_part(r, channel);
    if (status == IMAGE_OK) status = check_channels(r);
    if (status != IMAGE_OK) return status;
    const exr_result_t result = exr_get_data_window(r->context, r->part, &r->window);
    if (result != EXR_ERR_SUCCESS) return library_problem(r, result);
    const int64_t width = (int64_t)r->window.max.x - r->window.min.x + 1;
    const int64_t height = (int64_t)r->window.max.y - r->window.min.y + 1;
    if (width < 1 || height < 1)
        return api_image_problem(r->problem, IMAGE_DAMAGED, "the EXR has an empty data window");
    status = api_image_check((size_t)width, (size_t)height, r->problem);
    if (status == IMAGE_OK) status = check_chunks(r, (size_t)width, (size_t)height);
    if (status == IMAGE_OK)
        status = api_image_open(image, (size_t)width, (size_t)height, r->problem);
    if (status == IMAGE_OK) status = read_chunks(r, image);
    return status;
}

static void describe(const struct reader *r, struct image *image)
{
    static const char *const types[] = {"uint", "half", "float"};
    const exr_attr_chlist_entry_t *c = &r->channels->entries[r->chosen];
    strncpy(image->channel, c->name.str, sizeof image->channel - 1);
    strncpy(image->type, types[c->pixel_type], sizeof image->type - 1);
}

enum image_status api_exr_read(const void *bytes, size_t size, const char *channel,
                               const facet_watch *watch, struct image *image,
                               struct image_problem *problem)
{
    struct reader r = {.input = {bytes, size, ""}, .watch = watch, .problem = problem};
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = input_error;
    init.alloc_fn = account_alloc;
    init.free_fn = account_free;
    init.user_data = &r.input;
    init.read_fn = input_read;
    init.size_fn = input_size;
    init.max_image_width = init.max_image_height = FACET_MAP_SIDE_MAX;
    init.max_tile_width = init.max_tile_height = FACET_MAP_SIDE_MAX;
    init.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
    account.used = 0;
    account.exhausted = false;
    account.limit = SLACK + 2 * size;
    *image = (struct image){.values = NULL};
    const exr_result_t result = exr_start_read(&r.context, "body", &init);
    enum image_status status;
    if (result != EXR_ERR_SUCCESS) {
        status = library_problem(&r, result);
    } else {
        status = read_part(&r, channel, image);
        /* The library goes on without an attribute it had no memory for. */
        if (status == IMAGE_OK && account.exhausted) status = library_problem(&r, result);
        if (status == IMAGE_OK) describe(&r, image);
    }
    if (r.context) exr_finish(&r.context);
    if (status != IMAGE_OK) api_image_clear(image);
    return status;
}
