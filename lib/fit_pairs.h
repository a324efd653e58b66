/*
 * fit_pairs.h - a source asked at a grid of pairs, and materials compared with it there.
 */
#ifndef FACET_FIT_PAIRS_H
#define FACET_FIT_PAIRS_H

#include "facet_fit.h"

/* Pairs with data above the horizon, grouped by theta_d. */
struct fit_pairs {
    size_t count, channels; /* channels 1: the source has no colour */
    double *wi[3], *wo[3];
    double *fr_cos[3];   /* of the source */
    double *log_fr[3];   /* log(FACET_FIT_EPSILON + fr_cos) */
    double *model;       /* room for fr_cos of an uncoloured material */
    size_t *group;       /* index into cos_theta_d */
    double *cos_theta_d; /* of the groups, decreasing */
    size_t groups;
    void *owned;
};

/* What to ask: every theta_h with every theta_d with azimuths spread over [0, pi). */
struct fit_grid {
    const double *theta_h, *theta_d; /* theta_d increasing */
    size_t theta_h_count, theta_d_count, azimuths;
};

facet_status facet_fit_pairs_create(const facet_fit_source *source, const struct fit_grid *grid,
                                    struct fit_pairs *pairs);
/* Backscatter pairs at slopes r: one group; fr in place of fr_cos. */
facet_status facet_fit_pairs_backscatter(const facet_fit_source *source, const double *r, size_t n,
                                         struct fit_pairs *pairs);
void facet_fit_pairs_clear(struct fit_pairs *pairs);

/* fr_cos of the material with F = 1 into pairs->model. */
facet_status facet_fit_pairs_model(struct fit_pairs *pairs, const facet_material *material);

/*
 * The Fresnel terms that bring pairs->model closest to the source in the sense
 * of facet_fit_error.  Table: values[c][g] for each group; returns false where
 * no group could be determined.  Schlick: f0[c], from the table as a start.
 */
bool facet_fit_fresnel_table(const struct fit_pairs *pairs, double *const values[3]);
void facet_fit_fresnel_schlick(const struct fit_pairs *pairs, double *const values[3],
                               double f0[3]);

/* The sum of squares that this table leaves. */
double facet_fit_residual(const struct fit_pairs *pairs, double *const values[3]);

/* facet_fit_error of a whole material. */
facet_status facet_fit_rms_log(const struct fit_pairs *pairs, const facet_material *material,
                               double *rms_log);
facet_status facet_fit_backscatter_max(const struct fit_pairs *pairs,
                                       const facet_material *material, double *error);

#endif
