/*
 * mip_rows.h - a pyramid of means and covariances, made from rows of its finest
 * level as they come (internal).
 *
 * Each texel of a level is the mean of its footprint of the finest level.  A group
 * of texels merges by the parallel-axis rule, cov = mean(cov_i + d_i d_i^T) with
 * d_i = mean_i - mean, first along the row and then down the rows, from both ends
 * to the middle: the same bits from either side.
 */
#ifndef MIP_ROWS_H
#define MIP_ROWS_H

#include "slope_rows.h"

/* The columns or rows under one texel of a coarser level: the first and the last may be shared. */
struct span {
    size_t first, last;
    double low, whole, high; /* shares of first, of those between, of last (0 if it is first) */
    double all;              /* their sum */
};

struct mip_level {
    size_t width, height;
    size_t parent;              /* the level its texels are made of; level 0 has none */
    size_t done;                /* rows finished */
    struct span *columns;       /* over the parent's; NULL: pairs, or single columns */
    size_t capacity;            /* rows of the parent held, squeezed to this width */
    double *memory;             /* of the rows held, then of the row finished */
    double *row[CENTRAL_COUNT]; /* the row just finished */
};

struct mip_rows {
    size_t count;
    struct mip_level level[FACET_MAP_LEVELS_MAX];
    /* Told of each finished row, those of level 0 too; false ends the work. */
    bool (*finished)(void *user, size_t level, size_t row, double *const at[CENTRAL_COUNT]);
    void *user;
};

/* Close also after a failure: FACET_NO_MEMORY. */
facet_status facet_mip_rows_open(struct mip_rows *mip, size_t width, size_t height);
void facet_mip_rows_close(struct mip_rows *mip);

size_t facet_mip_level_count(size_t width, size_t height);
size_t facet_mip_side(size_t side, size_t level);

/* Row `row` of level 0, in order; finishes whatever rows of coarser levels it completes. */
bool facet_mip_rows_add(struct mip_rows *mip, size_t row, double *const at[CENTRAL_COUNT]);

#endif
