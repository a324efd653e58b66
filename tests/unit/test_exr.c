/* EXR files: ours read by others, others' read by us, and what nobody should read. */
#include "check.h"
#include "exr.h"
#include "exr_file.h"
#include "facet_leadr.h"
#include "files.h"

#include <math.h>
#include <openexr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* ---- A pyramid whose every value says where it is ------------------------------------------- */

enum { WIDTH = 150, HEIGHT = 170, LEVELS = 8 };

static float value_at(size_t level, size_t plane, size_t x, size_t y)
{
    return (float)(level * 8 + plane * 64) + (float)((x * 7 + y * 13) % 61) / 4 - 100;
}

static void *write_pyramid(bool half, enum exr_compression compression, size_t *size)
{
    static const struct exr_attribute first[] = {{"note", "as long as the other", 0},
                                                 {"texel", NULL, 0}},
                                      last[] = {{"note", "how the test made it", 0},
                                                {"texel", NULL, 0.125}};
    size_t widths[LEVELS], heights[LEVELS];
    for (size_t l = 0; l < LEVELS; l++) {
        widths[l] = WIDTH >> l ? WIDTH >> l : 1;
        heights[l] = HEIGHT >> l ? HEIGHT >> l : 1;
    }
    const struct exr_pyramid p = {.level_count = LEVELS,
                                  .widths = widths,
                                  .heights = heights,
                                  .plane_count = 3,
                                  .names = {"Z", "A", "E1"},
                                  .half = half,
                                  .compression = compression};
    struct image_problem problem = {0};
    struct exr_writer *writer = api_exr_writer_open(&p, first, 2, &problem);
    void *bytes = NULL;
    CHECK(writer);
    if (!writer) return NULL;
    /* Rows of all levels interleaved, as a filter makes them. */
    for (size_t y = 0; y < HEIGHT; y++)
        for (size_t l = 0; l < LEVELS; l++) {
            float row[3][WIDTH];
            if (y >= heights[l]) continue;
            for (size_t k = 0; k < 3; k++)
                for (size_t x = 0; x < widths[l]; x++) row[(k + 1) % 3][x] = value_at(l, k, x, y);
            CHECK(api_exr_writer_begin(writer, l, y, 1));
            api_exr_writer_put(writer, l, y, (const float *const[]){row[0], row[1], row[2]});
            api_exr_writer_end(writer, l, y, 1);
        }
    CHECK_INT(api_exr_writer_finish(writer, last, 2, &bytes, size, &problem), IMAGE_OK);
    api_exr_writer_close(writer);
    return bytes;
}

/* ---- Reading it with the library's own unpacking, at every level
 * --------------------------------- */

struct memory {
    const char *bytes;
    size_t size;
};

static int64_t memory_read(exr_const_context_t c, void *user, void *to, uint64_t n, uint64_t at,
                           exr_stream_error_func_ptr_t error)
{
    const struct memory *m = user;
    (void)c, (void)error;
    if (at > m->size || n > m->size - at) return -1;
    memcpy(to, m->bytes + at, n);
    return (int64_t)n;
}

static void check_tile(exr_context_t c, int level, int x, int y)
{
    enum { TILE = 64 };
    exr_chunk_info_t info;
    exr_decode_pipeline_t pipe = EXR_DECODE_PIPELINE_INITIALIZER;
    static float out[3][TILE * TILE];
    CHECK_INT(exr_read_tile_chunk_info(c, 0, x, y, level, level, &info), EXR_ERR_SUCCESS);
    CHECK_INT(exr_decoding_initialize(c, 0, &info, &pipe), EXR_ERR_SUCCESS);
    CHECK_INT(pipe.channel_count, 3);
    for (int k = 0; k < 3; k++) {
        pipe.channels[k].decode_to_ptr = (uint8_t *)out[k];
        pipe.channels[k].user_bytes_per_element = 4;
        pipe.channels[k].user_data_type = EXR_PIXEL_FLOAT;
        pipe.channels[k].user_pixel_stride = 4;
        pipe.channels[k].user_line_stride = 4 * TILE;
    }
    CHECK_INT(exr_decoding_choose_default_routines(c, 0, &pipe), EXR_ERR_SUCCESS);
    CHECK_INT(exr_decoding_run(c, 0, &pipe), EXR_ERR_SUCCESS);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < info.width * info.height; i++) {
            const int p = i % info.width, q = i / info.width;
            const float want = value_at((size_t)level, (size_t)k, (size_t)(x * TILE + p),
                                        (size_t)(y * TILE + q));
            CHECK(out[k][q * TILE + p] == want);
        }
    exr_decoding_destroy(c, &pipe);
}

static void check_levels(const void *bytes, size_t size)
{
    struct memory memory = {bytes, size};
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_context_t c = NULL;
    init.user_data = &memory;
    init.read_fn = memory_read;
    CHECK_INT(exr_start_read(&c, "memory", &init), EXR_ERR_SUCCESS);
    if (!c) return;
    int32_t across = 0, down = 0;
    CHECK_INT(exr_get_tile_levels(c, 0, &across, &down), EXR_ERR_SUCCESS);
    CHECK(across == LEVELS && down == LEVELS);
    for (int l = 0; l < LEVELS; l++) {
        int32_t w = 0, h = 0;
        exr_get_level_sizes(c, 0, l, l, &w, &h);
        CHECK(w == (WIDTH >> l ? WIDTH >> l : 1) && h == (HEIGHT >> l ? HEIGHT >> l : 1));
        for (int y = 0; y < (h + 63) / 64; y++)
            for (int x = 0; x < (w + 63) / 64; x++) check_tile(c, l, x, y);
    }
    exr_finish(&c);
}

TEST(every_level_is_where_it_belongs)
{
    for (int i = 0; i < 4; i++) {
        size_t size = 0;
        void *bytes = write_pyramid(i & 1, i & 2 ? EXR_ZIP : EXR_STORE, &size);
        if (bytes) check_levels(bytes, size);
        free(bytes);
    }
}

TEST(written_is_read)
{
    static const char *const names[] = {"A", "E1", "Z"};
    for (int i = 0; i < 12; i++) {
        size_t size = 0;
        void *bytes = write_pyramid(i & 1, i & 2 ? EXR_ZIP : EXR_STORE, &size);
        struct image image;
        struct image_problem problem = {0};
        const size_t plane = (size_t)i / 4;
        CHECK_INT(api_exr_read(bytes, size, names[plane], NULL, &image, &problem), IMAGE_OK);
        CHECK(image.width == WIDTH && image.height == HEIGHT);
        CHECK_STR(image.type, i & 1 ? "half" : "float");
        CHECK_STR(image.channel, names[plane]);
        for (size_t p = 0; image.values && p < WIDTH * HEIGHT; p++)
            CHECK(image.values[p] == value_at(0, plane, p % WIDTH, p / WIDTH));
        api_image_clear(&image);
        free(bytes);
    }
}

/* The output of a command, NUL-terminated, to be freed; NULL if it failed. */
static char *output_of(const char *command, const char *path)
{
    char line[256];
    snprintf(line, sizeof line, "%s %s 2>&1", command, path);
    FILE *pipe = popen(line, "r");
    char *text = calloc(1, 1 << 16);
    if (pipe && text && fread(text, 1, (1 << 16) - 1, pipe) == 0) *text = 0;
    if (pipe && pclose(pipe) == 0) return text;
    free(text);
    return NULL;
}

TEST(the_tools_of_openexr_agree)
{
    char path[] = "/tmp/facet_test_exr_XXXXXX";
    const int fd = mkstemp(path);
    size_t size = 0;
    void *bytes = write_pyramid(false, EXR_ZIP, &size);
    if (fd < 0 || !bytes || write(fd, bytes, size) != (ssize_t)size) {
        check_fail(__FILE__, __LINE__, "no temporary file");
    } else if (system("command -v exrheader exrinfo exrmaketiled >/dev/null 2>&1") != 0) {
        check_skip("the package openexr is not installed");
    } else {
        char *header = output_of("exrheader", path), *info = output_of("exrinfo -v", path);
        CHECK(header && strstr(header, "A, 32-bit floating-point, sampling 1 1"));
        CHECK(header && strstr(header, "E1, 32-bit floating-point, sampling 1 1"));
        CHECK(header && strstr(header, "mip-map"));
        CHECK(header && strstr(header, "tile size 64 by 64 pixels"));
        CHECK(header && strstr(header, "how the test made it"));
        CHECK(header && strstr(header, "texel (type double): 0.125"));
        CHECK(info && strstr(info, "150"));
        /* The C++ library reads every pixel of level 0. */
        char out[64];
        snprintf(out, sizeof out, "%s.copy", path);
        char command[160];
        snprintf(command, sizeof command, "exrmaketiled -o -z none %s %s", path, out);
        CHECK_INT(system(command), 0);
        size_t copy_size = 0;
        void *copy = check_read_file(out, &copy_size);
        struct image image;
        struct image_problem problem;
        CHECK_INT(api_exr_read(copy, copy_size, "Z", NULL, &image, &problem), IMAGE_OK);
        for (size_t p = 0; image.values && p < WIDTH * HEIGHT; p++)
            CHECK(image.values[p] == value_at(0, 2, p % WIDTH, p / WIDTH));
        api_image_clear(&image);
        free(copy);
        unlink(out);
        free(header);
        free(info);
    }
    if (fd >= 0) {
        close(fd);
        unlink(path);
    }
    free(bytes);
}

/* ---- Files of others
 * ------------------------------------------------------------------------------ */

TEST(types_and_windows)
{
    const uint16_t halves[6] = {0x3c00, 0xc000, 0x0001, 0x7bff, 0x8000, 0x3555};
    const double half_values[6] = {1, -2, 0x1p-24, 65504, 0, 0.333251953125};
    const uint32_t uints[6] = {0, 1, 77, 1u << 24, 4294967295u, 12};
    const float floats[6] = {0, -1.5f, 1e-30f, 3e38f, 7, 8};
    const void *planes[] = {uints, halves, floats};
    for (int type = 0; type < 3; type++) {
        const struct exr_file f = {
            3, 2, -5, type == 2 ? 1000 : -1, {"Y"}, (enum exr_file_type)type, {planes[type]}};
        size_t size = 0;
        unsigned char *bytes = exr_file(&f, &size);
        struct image image;
        struct image_problem problem = {0};
        CHECK_INT(api_exr_read(bytes, size, NULL, NULL, &image, &problem), IMAGE_OK);
        for (int i = 0; image.values && i < 6; i++) {
            const double want = type == 0   ? (float)uints[i]
                                : type == 1 ? half_values[i]
                                            : (double)floats[i];
            CHECK(image.values[i] == (float)want);
        }
        api_image_clear(&image);
        free(bytes);
    }
}

static enum image_status read_channel(const char *const names[4], const char *channel, char *got,
                                      struct image_problem *problem)
{
    static const float planes[4][4] = {{1}, {2}, {3}, {4}};
    struct exr_file f = {.width = 2, .height = 2, .type = EXR_FILE_FLOAT};
    for (int i = 0; i < 4; i++) {
        f.channels[i] = names[i];
        f.planes[i] = planes[i];
    }
    size_t size = 0;
    unsigned char *bytes = exr_file(&f, &size);
    struct image image;
    const enum image_status status = api_exr_read(bytes, size, channel, NULL, &image, problem);
    if (status == IMAGE_OK) {
        strcpy(got, image.channel);
        for (int i = 0; i < 4; i++)
            if (!strcmp(names[i], got)) {
                CHECK(image.values[0] == planes[i][0]);
                break;
            }
    }
    api_image_clear(&image);
    free(bytes);
    return status;
}

TEST(which_channel)
{
    const char *const rgb[4] = {"A", "B", "G", "R"}, *const odd[4] = {"a", "b"};
    const char *const depth[4] = {"A", "Y", "Z", "height"}, *const one[4] = {"bump"};
    struct image_problem problem = {0};
    char got[64] = "";
    CHECK_INT(read_channel(rgb, NULL, got, &problem), IMAGE_OK);
    CHECK_STR(got, "R");
    CHECK_INT(read_channel(rgb, "G", got, &problem), IMAGE_OK);
    CHECK_STR(got, "G");
    CHECK_INT(read_channel(depth, NULL, got, &problem), IMAGE_OK);
    CHECK_STR(got, "height");
    CHECK_INT(read_channel(one, NULL, got, &problem), IMAGE_OK);
    CHECK_STR(got, "bump");
    CHECK_INT(read_channel(rgb, "Z", got, &problem), IMAGE_NO_CHANNEL);
    CHECK_STR(problem.text, "the EXR has no channel \"Z\", only: A, B, G, R");
    CHECK_INT(read_channel(odd, NULL, got, &problem), IMAGE_NO_CHANNEL);
    CHECK_STR(problem.text, "name the channel of the heights; the EXR has: a, b");
}

/* ---- What must not be read
 * -------------------------------------------------------------------------- */

static void read_any(const char *path, const void *bytes, size_t size)
{
    struct image image;
    struct image_problem problem = {0};
    const enum image_status status = api_exr_read(bytes, size, NULL, NULL, &image, &problem);
    if (status == IMAGE_OK)
        CHECK(image.values && image.width && image.height);
    else if (image.values || !*problem.text || status != problem.status)
        check_fail(__FILE__, __LINE__, "%s: half an answer", path);
    api_image_clear(&image);
}

TEST(every_cut_and_many_changes_of_a_file)
{
    size_t size = 0;
    unsigned char *bytes = write_pyramid(true, EXR_ZIP, &size);
    unsigned char *copy = malloc(size);
    if (!bytes || !copy) return;
    for (size_t n = 0; n < size; n += n < 2000 ? 1 : 97) {
        memcpy(copy, bytes, n); /* so that reading past the end is seen */
        read_any("cut", copy, n);
    }
    struct rng rng;
    rng_seed(&rng, 11);
    for (int i = 0; i < 3000; i++) {
        memcpy(copy, bytes, size);
        const size_t range = i % 2 ? size : 1200; /* the header, more often */
        for (int k = 0; k < 1 + i % 3; k++)
            copy[(size_t)(rng_uniform(&rng) * (double)range)] = (unsigned char)(rng_uniform(&rng) *
                                                                                256);
        read_any("changed", copy, size);
    }
    free(copy);
    free(bytes);
}

/* A file of a few hundred bytes that claims what it cannot hold. */
TEST(impossible_sizes)
{
    static const uint32_t sizes[][2] = {{0, 0},
                                        {0, 5},
                                        {1, 1u << 31},
                                        {1u << 31, 1},
                                        {1u << 16, 1u << 15},
                                        {16384, 16384},
                                        {4096, 4096},
                                        {16384, 1},
                                        {0xffffffffu, 0xffffffffu}};
    const float z[1] = {0};
    size_t size = 0;
    unsigned char *bytes = exr_file_of_heights(z, 1, 1, &size);
    for (size_t i = 0; bytes && i < sizeof sizes / sizeof *sizes; i++) {
        unsigned char *window = bytes;
        while (memcmp(window, "dataWindow", 11)) window++;
        window += 11 + 6 + 4 + 8;
        for (int b = 0; b < 4; b++) {
            window[b] = (unsigned char)((sizes[i][0] - 1) >> 8 * b);
            window[4 + b] = (unsigned char)((sizes[i][1] - 1) >> 8 * b);
        }
        struct image image;
        struct image_problem problem = {0};
        CHECK(api_exr_read(bytes, size, NULL, NULL, &image, &problem) != IMAGE_OK);
        CHECK(!image.values && *problem.text);
    }
    free(bytes);
}

static bool stop(void *user)
{
    (void)user;
    return true;
}

TEST(cancelled)
{
    const facet_watch watch = {stop, NULL};
    const float z[4] = {0};
    size_t size = 0;
    unsigned char *bytes = exr_file_of_heights(z, 2, 2, &size);
    struct image image;
    struct image_problem problem = {0};
    CHECK_INT(api_exr_read(bytes, size, NULL, &watch, &image, &problem), IMAGE_CANCELLED);
    CHECK(!image.values);
    free(bytes);
}

TEST(every_file_of_openexr_and_tinyexr)
{
    const char *folder = check_data("exr");
    if (!folder) {
        check_skip("no shared data");
        return;
    }
    char path[512];
    snprintf(path, sizeof path, "%s", folder);
    CHECK(files_each(path, read_any) > 200);
}
