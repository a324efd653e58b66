#include "leadr_map.h"
#include "exr.h"
#include "png_read.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const api_leadr_kinds[] = {"displacement", "normal", "slope", NULL};
const char *const api_leadr_encodings[] = {"signed", "unorm", "unorm_mid", "unorm_xy", NULL};

const struct medium api_leadr_media[] = {
    {API_EXR_TYPE, api_exr_is},
    {API_PNG_TYPE, api_png_is},
    {NULL, NULL},
};

/* ---- Files ------------------------------------------------------------------------------ */

static bool refuse_image(struct call *call, const struct image_problem *image)
{
    const struct place at = {NULL, "channel", 0};
    switch (image->status) {
    case IMAGE_NO_MEMORY: return api_problem_memory(call->problem);
    case IMAGE_CANCELLED: return api_problem_status(call->problem, FACET_CANCELLED, NULL);
    case IMAGE_TOO_LARGE: return api_problem(call->problem, 413, "%s", image->text);
    case IMAGE_NO_CHANNEL: return api_problem_at(call->problem, &at, "%s", image->text);
    default: return api_problem(call->problem, 422, "%s", image->text);
    }
}

static bool is_png(const struct call *call)
{
    return call->medium->matches == api_png_is;
}

static enum image_status read_file(struct call *call, const char *channel, struct image *image,
                                   struct image_problem *problem)
{
    const struct api_request *request = call->request;
    const facet_watch watch = api_watch(call);
    return (is_png(call) ? api_png_read : api_exr_read)(request->body, request->body_size, channel,
                                                        &watch, image, problem);
}

/*
 * Only differences count, so the first height is taken off before rounding to
 * float: a large common offset costs nothing.
 */
static bool read_matrix(struct call *call, const struct matrix *m, struct image *image)
{
    struct image_problem problem;
    const struct place at = {NULL, "heights", 0};
    if (!m->values) return api_problem_at(call->problem, &at, "is required without a file");
    if (api_image_open(image, m->columns, m->rows, &problem) != IMAGE_OK)
        return refuse_image(call, &problem);
    for (size_t i = 0; i < m->rows * m->columns; i++)
        image->values[i] = (float)(m->values[i] - m->values[0]);
    return true;
}

/* ---- Slopes ------------------------------------------------------------------------------ */

/* Channels tried where none is named: the first set of which the file has every one. */
static const char *const sets[][3] = {
    {"R", "G", "B"},
    {"X", "Y", "Z"},
    {"x", "y", "z"},
    {"E1", "E2", NULL},
};

/* Reads `count` planes named by set; NO_CHANNEL leaves none. */
static enum image_status read_set(struct call *call, const char *const *set, size_t count,
                                  struct image planes[3], struct image_problem *problem)
{
    enum image_status status = IMAGE_OK;
    for (size_t i = 0; i < count && status == IMAGE_OK; i++)
        status = set[i] ? read_file(call, set[i], &planes[i], problem) : IMAGE_NO_CHANNEL;
    /* Parts of a file may differ in size. */
    for (size_t i = 1; i < count && status == IMAGE_OK; i++)
        if (planes[i].width != planes[0].width || planes[i].height != planes[0].height)
            status = api_image_problem(problem, IMAGE_UNSUPPORTED, "the channels differ in size");
    if (status != IMAGE_OK)
        for (size_t i = 0; i < count; i++) api_image_clear(&planes[i]);
    return status;
}

/* "nx,ny,nz": as many names as planes, or a problem. */
static bool split(struct call *call, const char *channel, size_t count, const char *set[3])
{
    const struct place at = {NULL, "channel", 0};
    char *text = api_arena_text(call->arena, channel, strlen(channel));
    if (!text) return api_problem_memory(call->problem);
    size_t n = 0;
    for (char *name = text; name; n++) {
        char *comma = strchr(name, ',');
        if (comma) *comma++ = 0;
        if (n < count) set[n] = name;
        name = comma;
    }
    if (n == count) return true;
    return api_problem_at(call->problem, &at, "names %zu channels; this kind of map has %zu", n,
                          count);
}

static bool read_planes(struct call *call, const char *channel, size_t count,
                        struct image planes[3])
{
    struct image_problem problem = {0}, first = {0};
    const char *named[3] = {NULL, NULL, NULL};
    if (channel) {
        if (!split(call, channel, count, named)) return false;
        return read_set(call, named, count, planes, &problem) == IMAGE_OK ||
               refuse_image(call, &problem);
    }
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
        const enum image_status status = read_set(call, sets[i], count, planes, &problem);
        if (status == IMAGE_OK) return true;
        if (i == 0) first = problem;
        if (status != IMAGE_NO_CHANNEL) return refuse_image(call, &problem);
    }
    return refuse_image(call, &first);
}

/* value = (multiply * c - minus) / divide of a number c, which of a PNG is the code itself. */
struct decoding {
    double code, multiply, minus, divide;
    bool integer;
};

/* c = 0 is -1 of unorm, 1 is 1; of unorm_mid the middle code of the file's depth is exactly 0. */
static struct decoding decoding_of(const struct leadr_map *map, const char *type, bool is_z)
{
    const bool integer = strstr(type, "-bit"), mid = map->encoding == LEADR_UNORM_MID;
    const double most = !strcmp(type, "16-bit") ? 65535 : integer || mid ? 255 : 1;
    struct decoding d = {most, 1, 0, most, integer};
    if (map->encoding == LEADR_SIGNED || (map->encoding == LEADR_UNORM_XY && is_z)) return d;
    d.multiply = mid ? 1 : 2;
    d.minus = mid ? (most + 1) / 2 : most;
    d.divide = mid ? (most - 1) / 2 : most;
    return d;
}

static double decode(const struct decoding *d, float value)
{
    const double c = d->code * value;
    return (d->multiply * (d->integer ? rint(c) : c) - d->minus) / d->divide;
}

/* Slope of the plane with normal n: x~ = -n_x / n_z; whatever the length of n.  NaN where n does
 * not point up: lib counts it. */
static void normals_to_slopes(const struct leadr_map *map, struct image planes[3])
{
    struct decoding d[3];
    for (int k = 0; k < 3; k++) d[k] = decoding_of(map, planes[k].type, k == 2);
    float *x = planes[0].values, *y = planes[1].values;
    const float *z = planes[2].values;
    for (size_t i = 0; i < planes[0].width * planes[0].height; i++) {
        const double nz = decode(&d[2], z[i]);
        x[i] = nz > 0 ? (float)(-decode(&d[0], x[i]) / nz) : NAN;
        y[i] = nz > 0 ? (float)(-decode(&d[1], y[i]) / nz) : NAN;
    }
}

static void decode_slopes(const struct leadr_map *map, struct image planes[2])
{
    for (int k = 0; k < 2; k++) {
        const struct decoding d = decoding_of(map, planes[k].type, false);
        for (size_t i = 0; i < planes[k].width * planes[k].height; i++)
            planes[k].values[i] = (float)decode(&d, planes[k].values[i]);
    }
}

#define NEEDS_FILE "needs a file: JSON bodies hold heights"

static bool read_slopes(struct call *call, const char *channel, struct leadr_map *map)
{
    struct image planes[3] = {{0}, {0}, {0}};
    const struct place at = {NULL, "kind", 0};
    const bool normal = map->kind == LEADR_NORMAL;
    if (!call->medium) return api_problem_at(call->problem, &at, NEEDS_FILE);
    if (!read_planes(call, channel, normal ? 3 : 2, planes)) return false;
    if (map->encoding < 0) {
        const bool is_float = !strcmp(planes[0].type, "half") || !strcmp(planes[0].type, "float");
        map->encoding = is_float ? LEADR_SIGNED : LEADR_UNORM;
    }
    if (normal)
        normals_to_slopes(map, planes);
    else
        decode_slopes(map, planes);
    api_image_clear(&planes[2]);
    map->planes[0] = planes[0];
    map->planes[1] = planes[1];
    map->row = malloc(2 * planes[0].width * sizeof *map->row);
    return map->row || api_problem_memory(call->problem);
}

/* ---- Rows --------------------------------------------------------------------------------- */

static const float *next_row(void *user, size_t row)
{
    struct leadr_map *map = user;
    const size_t w = map->width;
    /* The last row may be asked for before its turn. */
    if (row == map->next) {
        for (int k = 0; k < 2; k++) api_image_release(&map->planes[k], row);
        map->next++;
    }
    if (!map->row) return map->planes[0].values + row * w;
    for (size_t k = 0; k < 2; k++)
        memcpy(map->row + k * w, map->planes[k].values + row * w, w * sizeof(float));
    return map->row;
}

bool api_leadr_map_read(struct call *call, enum leadr_kind kind, const char *channel, int encoding,
                        const struct matrix *heights, struct leadr_map *map)
{
    struct image_problem problem = {0};
    const struct place at = {NULL, "encoding", 0}, of_file = {NULL, "channel", 0};
    *map = (struct leadr_map){.kind = kind, .encoding = encoding};
    if (kind == LEADR_DISPLACEMENT && encoding >= 0)
        return api_problem_at(call->problem, &at, "is of normal and slope maps");
    if (kind == LEADR_DISPLACEMENT && channel && !call->medium)
        return api_problem_at(call->problem, &of_file, NEEDS_FILE);
    if (kind != LEADR_DISPLACEMENT) {
        if (!read_slopes(call, channel, map)) return false;
    } else if (!call->medium) {
        if (!read_matrix(call, heights, &map->planes[0])) return false;
    } else if (read_file(call, channel, &map->planes[0], &problem) != IMAGE_OK) {
        return refuse_image(call, &problem);
    }
    map->width = map->planes[0].width;
    map->height = map->planes[0].height;
    map->source = (facet_map_source){kind == LEADR_DISPLACEMENT ? FACET_HEIGHTS : FACET_SLOPES,
                                     map->width, map->height, next_row, map};
    return true;
}

void api_leadr_map_clear(struct leadr_map *map)
{
    for (int k = 0; k < 2; k++) api_image_clear(&map->planes[k]);
    free(map->row);
    map->row = NULL;
}

bool api_leadr_map_flaw(struct call *call, const struct leadr_map *map, const facet_map_flaw *flaw)
{
    static const char *const what[] = {"heights are not finite",
                                       "normals are not finite or do not point up",
                                       "slopes are not finite"};
    const struct place all = {NULL, "heights", 0}, row = {&all, NULL, flaw->row},
                       at = {&row, NULL, flaw->column};
    if (!call->medium) return api_problem_at(call->problem, &at, "does not fit a float");
    /* Both slopes of a normal are counted. */
    const size_t count = map->kind == LEADR_NORMAL ? (flaw->count + 1) / 2 : flaw->count;
    return api_problem(call->problem, 422, "%zu %s, the first in column %zu of row %zu", count,
                       what[map->kind], flaw->column, flaw->row);
}
