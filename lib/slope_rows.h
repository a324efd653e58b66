/*
 * slope_rows.h - the slopes of a map, one row of level 0 at a time (internal).
 *
 * Slopes stand in units of the map's own differences (unit_x, unit_y carry them to
 * slopes), so that they are exact and sums of them nearly so.
 */
#ifndef SLOPE_ROWS_H
#define SLOPE_ROWS_H

#include "facet_leadr.h"

/* Of each texel, in this order: mean x~, mean y~, then the covariance xx, yy, xy within it. */
enum { CENTRAL_COUNT = 5 };

enum { HELD_ROWS = 4 }; /* a row, its neighbours, and the third one a clamped edge needs */

/* Sums over the whole map of what one stencil sees, in its own units. */
struct facet_stencil_sums {
    size_t count;
    double x, y, xx, yy, xy;
};

struct facet_slope_rows {
    const facet_map_source *source;
    const facet_leadr_options *options;
    double unit_x, unit_y; /* slope for a difference of 1; y signed */
    size_t width, height;  /* of level 0 */
    double *memory;
    double *held[HELD_ROWS]; /* padded rows of the map, one texel longer at each end; i in i % 4 */
    double *first, *last;    /* periodic: padded rows 1 and height */
    size_t loaded;           /* rows of the map read so far, in order */
    double *at[CENTRAL_COUNT];
    bool zero_covariance; /* no texel of level 0 has slopes that vary within it */
    facet_map_flaw flaw;
    struct facet_stencil_sums sums[FACET_STENCIL_COUNT];
};

/* Checks sizes and options.  Close also after a failure. */
facet_status facet_slope_rows_open(struct facet_slope_rows *rows, const facet_map_source *source,
                                   const facet_leadr_options *options);
void facet_slope_rows_close(struct facet_slope_rows *rows);

/* Sizes of level 0, or BAD_SIZE. */
facet_status facet_slope_rows_size(const facet_map_source *source,
                                   const facet_leadr_options *options, size_t *width,
                                   size_t *height);

/* Row q in rows->at; q = 0, 1, 2, ... in order.  False where flaw.count > 0: the rest is not to be
 * asked for, but facet_slope_rows_finish still counts flaws. */
bool facet_slope_rows_next(struct facet_slope_rows *rows, size_t q);

/* Reads what is left of the map, so that flaw is complete. */
void facet_slope_rows_finish(struct facet_slope_rows *rows);

/* Moments of the whole map by a stencil, after the last row; false: a trimmed map too small. */
bool facet_slope_rows_sums(const struct facet_slope_rows *rows, facet_stencil stencil,
                           facet_moments *moments);

#endif
