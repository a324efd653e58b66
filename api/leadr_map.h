/* leadr_map.h - the body of POST /v1/leadr as rows of heights or slopes. */
#ifndef LEADR_MAP_H
#define LEADR_MAP_H

#include "endpoint.h"
#include "facet_leadr.h"
#include "image.h"

enum leadr_kind { LEADR_DISPLACEMENT, LEADR_NORMAL, LEADR_SLOPE };

/* How numbers in a file stand for components of a normal or a slope. */
enum leadr_encoding { LEADR_SIGNED, LEADR_UNORM, LEADR_UNORM_MID, LEADR_UNORM_XY };

extern const char *const api_leadr_kinds[], *const api_leadr_encodings[];

struct leadr_map {
    enum leadr_kind kind;
    int encoding;           /* of kinds but displacement; else -1 */
    struct image planes[2]; /* heights, or slopes along x and y */
    float *row;             /* of slopes: both, one after the other */
    size_t next;            /* rows before it are gone */
    size_t width, height;
    facet_map_source source;
};

/*
 * kind, channel (NULL: by default) and encoding (-1: by default) are as in the
 * request.  `heights` are those of a JSON body.  Fills a map that stays where it is:
 * source points to it.  A map is read once: rows go as they are read.
 * False: call->problem is set; clear all the same.
 */
bool api_leadr_map_read(struct call *call, enum leadr_kind kind, const char *channel, int encoding,
                        const struct matrix *heights, struct leadr_map *map);
void api_leadr_map_clear(struct leadr_map *map);

/* What facet_leadr_filter found in it.  Returns false. */
bool api_leadr_map_flaw(struct call *call, const struct leadr_map *map, const facet_map_flaw *flaw);

/* The media a map may come in. */
extern const struct medium api_leadr_media[];
#define API_EXR_TYPE "image/x-exr"
#define API_PNG_TYPE "image/png"

#endif
