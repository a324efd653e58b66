/* leadr_answer.h - a filtered map as JSON or as an EXR file. */
#ifndef LEADR_ANSWER_H
#define LEADR_ANSWER_H

#include "endpoint.h"
#include "facet_leadr.h"
#include "image.h"

#define API_EXR_TYPE "image/x-exr"

struct leadr_map {
    struct image image;
    facet_leadr_options options;
    bool compress;
    facet_leadr *leadr;
    facet_moments by_stencil[FACET_STENCIL_COUNT]; /* of the whole map, without the base */
    bool has_stencil[FACET_STENCIL_COUNT];
};

/* The words of the options, in the order of lib's enumerations. */
extern const char *const api_stencils[],
    *const api_borders[], *const api_storages[], *const api_forms[], *const api_y_directions[];

/* The JSON answer, by api_leadr_fields. */
struct material_out;
struct leadr_out {
    int64_t width, height;
    const char *channel, *sample;
    int stencil, border, y, type, form;
    double scale, texel, base_alpha;
    struct list levels, stencils;
    struct numbers moments;
    struct material_out *material;
    bool floored;
    const char *warning;
};

extern const struct field api_leadr_fields[];

/* Fill call->out.  False: call->problem is set. */
bool api_leadr_json(struct call *call, const struct leadr_map *map);
/* Answer a file. */
bool api_leadr_exr(struct call *call, const struct leadr_map *map);

#endif
