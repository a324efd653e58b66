/* slope_rows.h - the slope moments of a height map, one row of level 0 at a time (internal). */
#ifndef SLOPE_ROWS_H
#define SLOPE_ROWS_H

#include "facet_leadr.h"

enum { MOMENT_COUNT = 5 };

struct facet_slope_rows {
    const facet_height_map *map;
    facet_stencil stencil;
    facet_border border;
    double per_x, per_y;  /* slope for a height difference of 1 between neighbours; y signed */
    size_t width, height; /* of level 0 */
    size_t offset;        /* of level 0 in the map: 1 for trimmed central differences */
    double *padded;       /* three rows of the map, one texel longer at each end */
    size_t held[3];       /* which row of the map (plus 1) each holds; 0 .. height + 1 */
};

/* Checks sizes and options.  Close also after a failure. */
facet_status facet_slope_rows_open(struct facet_slope_rows *rows, const facet_height_map *map,
                                   const facet_leadr_options *options);
void facet_slope_rows_close(struct facet_slope_rows *rows);

/* Moments of row q (q < height), width of each; cheapest for increasing q. */
void facet_slope_rows_get(struct facet_slope_rows *rows, size_t q, double *const e[MOMENT_COUNT]);

#endif
