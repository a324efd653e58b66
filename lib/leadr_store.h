/* leadr_store.h - rows of means and covariances to the planes that are stored (internal). */
#ifndef LEADR_STORE_H
#define LEADR_STORE_H

#include "slope_rows.h"

struct leadr_store {
    const facet_leadr_options *options;
    double unit_x, unit_y; /* from slope_rows.h's units to slopes */
    size_t plane_count;
};

/* What storing a row did: sums, not yet means, of the loss. */
struct leadr_stored {
    facet_leadr_loss loss;
    bool overflow;
};

size_t facet_plane_count(facet_moment_model model);

/* A row of n texels to planes, n apart. */
struct leadr_stored facet_leadr_store_row(const struct leadr_store *store, size_t n,
                                          double *const at[CENTRAL_COUNT], float *planes);

/* A row, or a level, into another. */
void facet_leadr_loss_add(facet_leadr_loss *to, const facet_leadr_loss *loss);

#endif
