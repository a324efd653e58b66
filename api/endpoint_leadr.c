/* POST /v1/leadr: a displacement map to slope moments for every distance (Dupuy chapter 3). */
#include "endpoint.h"
#include "exr.h"
#include "facet_leadr.h"
#include "leadr_answer.h"
#include "limits.h"
#include "png_read.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

_Static_assert(LIMIT_MAP_PIXELS == FACET_MAP_PIXELS_MAX, "the map is checked in lib");
_Static_assert(LIMIT_MAP_SIDE == FACET_MAP_SIDE_MAX, "the map is checked in lib");

struct leadr_request {
    struct matrix heights;
    const char *channel;
    int kind, stencil, border, y, type, form, compression;
    double scale, texel, base_alpha;
};

static const char *const kinds[] = {"displacement", NULL};
static const char *const compressions[] = {"none", "zip", NULL};

static const struct field request_fields[] = {
    {MEMBER(struct leadr_request, heights), FIELD_MATRIX,
     .doc = "rows of heights from the top, in a JSON body; else the body is an EXR or PNG file"},
    {MEMBER(struct leadr_request, kind), FIELD_ENUM, FIELD_DEFAULT, .names = kinds,
     .doc = "what the map holds"},
    {MEMBER(struct leadr_request, channel), FIELD_TEXT,
     .doc = "channel of the file; default: the only one, else the first of height, displacement, "
            "Y, R, Z of an EXR, and the value all channels of a PNG share"},
    {MEMBER(struct leadr_request, scale), FIELD_NUMBER, FIELD_DEFAULT, .min = -1e12, .max = 1e12,
     .initial = 1, .doc = "multiplies the heights; those of a PNG lie in [0, 1]"},
    {MEMBER(struct leadr_request, texel), FIELD_NUMBER, .min = 0, .max = 1e12, .open_min = true,
     .doc = "edge of a (square) texel in the unit of the scaled heights; default 1/width: the map "
            "is 1 wide"},
    {MEMBER(struct leadr_request, stencil), FIELD_ENUM, FIELD_DEFAULT, .names = api_stencils,
     .doc = "slopes from heights: central differences, forward differences, or the exact moments "
            "of the bilinear surface through the texels"},
    {MEMBER(struct leadr_request, border), FIELD_ENUM, FIELD_DEFAULT, .names = api_borders,
     .doc = "beyond the edge: the opposite edge, a parabola through the last three texels, the "
            "reflected map, or nothing (the result is smaller by the stencil's reach)"},
    {MEMBER(struct leadr_request, y), FIELD_ENUM, FIELD_DEFAULT, .names = api_y_directions,
     .doc = "which way +y points: down the rows, or up"},
    {MEMBER(struct leadr_request, base_alpha), FIELD_NUMBER, FIELD_DEFAULT, .min = 0,
     .max = FACET_ALPHA_MAX, .initial = 0,
     .doc = "isotropic Beckmann roughness below the map, added to the moments"},
    {MEMBER(struct leadr_request, type), FIELD_ENUM, FIELD_DEFAULT, .names = api_storages,
     .doc = "what the moments are stored as"},
    {MEMBER(struct leadr_request, form), FIELD_ENUM, FIELD_DEFAULT, .names = api_forms,
     .doc = "raw: E1..E5; central: E1, E2 and the covariance V11, V22, V12, which loses less"},
    {MEMBER(struct leadr_request, compression), FIELD_ENUM, FIELD_DEFAULT, .names = compressions,
     .doc = "of the EXR answered; zip saves up to half on 8-bit maps, nothing on noisy ones, and "
            "takes "
            "longer than all the rest"},
    {0},
};

/* ---- The map ----------------------------------------------------------------------------- */

static bool refuse_image(struct call *call, const struct image_problem *image)
{
    const struct place at = {NULL, "channel", 0};
    switch (image->status) {
    case IMAGE_NO_MEMORY:
        return api_problem_memory(call->problem);
    case IMAGE_CANCELLED:
        return api_problem_status(call->problem, FACET_CANCELLED, NULL);
    case IMAGE_TOO_LARGE:
        return api_problem(call->problem, 413, "%s", image->text);
    case IMAGE_NO_CHANNEL:
        return api_problem_at(call->problem, &at, "%s", image->text);
    default:
        return api_problem(call->problem, 422, "%s", image->text);
    }
}

/*
 * Only differences count, so the first height is taken off before rounding to
 * float: a large common offset costs nothing.
 */
static bool image_of_matrix(struct call *call, const struct matrix *m, struct image *image)
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

static bool read_map(struct call *call, struct image *image)
{
    const struct leadr_request *in = call->in;
    const struct api_request *request = call->request;
    if (!call->medium) return image_of_matrix(call, &in->heights, image);
    const facet_watch watch = api_watch(call);
    struct image_problem problem = {0};
    const bool is_png = call->medium->matches == api_png_is;
    const enum image_status status =
        is_png
            ? api_png_read(request->body, request->body_size, in->channel, &watch, image, &problem)
            : api_exr_read(request->body, request->body_size, in->channel, &watch, image, &problem);
    return status == IMAGE_OK || refuse_image(call, &problem);
}

/* ---- The pyramid --------------------------------------------------------------------------- */

static bool refuse_flaw(struct call *call, const facet_map_flaw *flaw)
{
    if (!flaw->count)
        return api_problem(call->problem, 422,
                           "the moments overflow the type they are to be stored in");
    if (call->medium)
        return api_problem(call->problem, 422,
                           "%zu heights are not finite, the first in column %zu of row %zu",
                           flaw->count, flaw->column, flaw->row);
    const struct place all = {NULL, "heights", 0}, row = {&all, NULL, flaw->row},
                       at = {&row, NULL, flaw->column};
    return api_problem_at(call->problem, &at, "does not fit a float");
}

static bool refuse_map(struct call *call, facet_status status, const struct leadr_map *map,
                       const facet_map_flaw *flaw)
{
    const struct place at = {NULL, "border", 0};
    if (status == FACET_NO_MEMORY) return api_problem_memory(call->problem);
    if (status == FACET_BAD_DATA) return refuse_flaw(call, flaw);
    if (status == FACET_BAD_SIZE && map->options.border == FACET_TRIM)
        return api_problem_at(call->problem, &at, "trim leaves nothing of a map of %zu x %zu",
                              map->image.width, map->image.height);
    return api_problem_status(call->problem, status, NULL);
}

static bool build(struct call *call, struct leadr_map *map)
{
    const facet_watch watch = api_watch(call);
    const facet_height_map heights = {map->image.values, map->image.width, map->image.height};
    facet_map_flaw flaw = {0, 0, 0};
    facet_status status = facet_leadr_create(&heights, &map->options, &watch, &flaw, &map->leadr);
    for (int s = 0; status == FACET_OK && s < FACET_STENCIL_COUNT; s++) {
        facet_leadr_options options = map->options;
        options.stencil = (facet_stencil)s;
        status = facet_leadr_mean(&heights, &options, &watch, &map->by_stencil[s]);
        /* A trimmed map may hold one stencil and not another: that one is left out. */
        map->has_stencil[s] = status == FACET_OK;
        if (status == FACET_BAD_SIZE) status = FACET_OK;
    }
    return status == FACET_OK || refuse_map(call, status, map, &flaw);
}

static void take_options(const struct leadr_request *in, struct leadr_map *map)
{
    map->options = (facet_leadr_options){
        .stencil = (facet_stencil)in->stencil,
        .border = (facet_border)in->border,
        .y_up = in->y == 1,
        .scale = in->scale,
        .texel = isnan(in->texel) ? 1.0 / (double)map->image.width : in->texel,
        .base_alpha = in->base_alpha,
        .storage = (facet_storage)in->type,
        .form = (facet_moment_form)in->form,
    };
    map->compress = in->compression == 1;
}

static bool answer(struct call *call, const struct leadr_map *map)
{
    const char *type = api_answer_type(call, call->medium ? API_EXR_TYPE : "application/json");
    return strcmp(type, API_EXR_TYPE) ? api_leadr_json(call, map) : api_leadr_exr(call, map);
}

static bool handle(struct call *call)
{
    struct leadr_map map = {.image.values = NULL};
    struct api_trace *trace = &call->response->trace;
    double start = api_clock();
    bool ok = read_map(call, &map.image);
    trace->decode_us += api_clock() - start;
    start = api_clock();
    if (ok) {
        take_options(call->in, &map);
        ok = build(call, &map);
        trace->evaluations = map.image.width * map.image.height;
        trace->compute_us += api_clock() - start;
    }
    start = api_clock();
    ok = ok && answer(call, &map);
    trace->encode_us += api_clock() - start;
    facet_leadr_destroy(map.leadr);
    api_image_clear(&map.image);
    return ok;
}

static const struct medium bodies[] = {
    {API_EXR_TYPE, api_exr_is},
    {"image/png", api_png_is},
    {NULL, NULL},
};

static const char *const answers[] = {API_EXR_TYPE, NULL};

const struct endpoint api_endpoint_leadr = {
    .method = "POST",
    .path = "/v1/leadr",
    .summary = "Slope moments of a displacement map, for every distance",
    .doc = "Body: an EXR or PNG map with the options in the query (answered by default with one "
           "tiled MIP-mapped EXR of E1..E5), or JSON heights (answered with JSON).",
    .request = request_fields,
    .request_size = sizeof(struct leadr_request),
    .response = api_leadr_fields,
    .response_size = sizeof(struct leadr_out),
    .bodies = bodies,
    .answers = answers,
    .is_long = true,
    .example = "{\"heights\":[[0,1,0,1],[1,0,2,0],[0,1,0,1],[1,0,1,0]],\"scale\":0.1,"
               "\"border\":\"clamp\",\"stencil\":\"bilinear\"}",
    .handle = handle,
};
