/*
 * mip_rows.h - a pyramid of means and covariances, made from rows of its finest
 * level as they come, some at a time (internal).
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
    size_t parent;        /* the level its texels are made of; level 0 has none */
    size_t done;          /* rows finished */
    size_t batch;         /* rows that one batch of level 0 finishes, at most */
    struct span *columns; /* over the parent's; NULL: pairs, or single columns */
    size_t capacity;      /* rows of the parent held, squeezed to this width */
    double *memory;       /* of the rows held, then of the rows finished */
};

struct mip_rows {
    size_t count;
    struct mip_level level[FACET_MAP_LEVELS_MAX];
};

/* Of at most `batch` rows of level 0 at a time.  Close also after a failure: FACET_NO_MEMORY. */
facet_status facet_mip_rows_open(struct mip_rows *mip, size_t width, size_t height, size_t batch);
void facet_mip_rows_close(struct mip_rows *mip);

size_t facet_mip_level_count(size_t width, size_t height);
size_t facet_mip_side(size_t side, size_t level);

/* A row of a level for all that are made of it; rows of a batch on any thread. */
void facet_mip_rows_squeeze(struct mip_rows *mip, size_t level, size_t row,
                            double *const at[CENTRAL_COUNT]);

/* How many rows of a level are finished once `rows` of its parent are there. */
size_t facet_mip_rows_ready(const struct mip_rows *mip, size_t level, size_t rows);

/* Row level->done + k of a level, finished: k < level->batch, on any thread. */
void facet_mip_rows_merge(const struct mip_rows *mip, size_t level, size_t k,
                          double *at[CENTRAL_COUNT]);

#endif
