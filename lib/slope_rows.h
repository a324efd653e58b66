/*
 * slope_rows.h - the slopes of a map, some rows of level 0 at a time (internal).
 *
 * Slopes stand in units of the map's own differences (unit_x, unit_y carry them to
 * slopes), so that they are exact and sums of them nearly so.
 */
#ifndef SLOPE_ROWS_H
#define SLOPE_ROWS_H

#include "facet_leadr.h"

/* Of each texel, in this order: mean x~, mean y~, then the covariance xx, yy, xy within it. */
enum { CENTRAL_COUNT = 5 };

/* Beyond the rows of a batch: their neighbours, and the third one a clamped edge needs. */
enum { HELD_BESIDE = 4 };

/* Sums over a row, or the whole map, of what one stencil sees, in its own units. */
struct facet_stencil_sums {
    size_t count;
    double x, y, xx, yy, xy;
    double within; /* variance inside texels, of both slopes */
};

struct facet_slope_row {
    double *at[CENTRAL_COUNT];
    struct facet_stencil_sums sums[FACET_STENCIL_COUNT];
};

struct facet_slope_rows {
    const facet_map_source *source;
    const facet_leadr_options *options;
    double unit_x, unit_y; /* slope for a difference of 1; y signed */
    size_t width, height;  /* of level 0 */
    size_t batch, ring;    /* rows of a batch, rows held */
    double *memory;
    double *held;         /* padded rows of the map, one texel longer at each end; i in i % ring */
    double *first, *last; /* periodic: padded rows 1 and height */
    size_t loaded;        /* rows of the map read so far, in order */
    struct facet_slope_row *row; /* of a batch */
    facet_map_flaw flaw;
    struct facet_stencil_sums sums[FACET_STENCIL_COUNT];
};

/* Checks sizes and options.  At most `batch` rows at a time.  Close also after a failure. */
facet_status facet_slope_rows_open(struct facet_slope_rows *rows, const facet_map_source *source,
                                   const facet_leadr_options *options, size_t batch);
void facet_slope_rows_close(struct facet_slope_rows *rows);

/* Sizes of level 0, or BAD_SIZE. */
facet_status facet_slope_rows_size(const facet_map_source *source,
                                   const facet_leadr_options *options, size_t *width,
                                   size_t *height);

/*
 * Reads what rows q .. q + count - 1 need; batches in order, from q = 0 on.  Then make row q + k in
 * rows->row[k], each once and on any thread, and tally them.  False where flaw.count > 0: the rest
 * is not to be asked for, but facet_slope_rows_finish still counts flaws.
 */
bool facet_slope_rows_load(struct facet_slope_rows *rows, size_t q, size_t count);
void facet_slope_rows_make(const struct facet_slope_rows *rows, size_t q, size_t k);
void facet_slope_rows_tally(struct facet_slope_rows *rows, size_t count);

/* Reads what is left of the map, so that flaw is complete. */
void facet_slope_rows_finish(struct facet_slope_rows *rows);

/* Moments of the whole map by a stencil, after the last row; false: a trimmed map too small. */
bool facet_slope_rows_sums(const struct facet_slope_rows *rows, facet_stencil stencil,
                           facet_moments *moments);

#endif
