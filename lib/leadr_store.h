/* leadr_store.h - rows of means and covariances to the planes that are stored (internal). */
#ifndef LEADR_STORE_H
#define LEADR_STORE_H

#include "slope_rows.h"

struct leadr_store {
    const facet_leadr_options *options;
    double unit_x, unit_y; /* from slope_rows.h's units to slopes */
    size_t plane_count;
    double *exact;  /* a row: what is to be stored, in double, and the variance */
    float *rounded; /* the same as stored */
    bool overflow;
};

size_t facet_plane_count(facet_moment_model model);

/* Close also after a failure: FACET_NO_MEMORY. */
facet_status facet_leadr_store_open(struct leadr_store *store, const facet_leadr_options *options,
                                    double unit_x, double unit_y, size_t width);
void facet_leadr_store_close(struct leadr_store *store);

/* A row of n texels to planes in store->rounded, n apart; loss collects sums, not yet means. */
void facet_leadr_store_row(struct leadr_store *store, size_t n, double *const at[CENTRAL_COUNT],
                           facet_leadr_loss *loss);

#endif
