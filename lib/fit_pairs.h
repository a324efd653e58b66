/*
 * fit_pairs.h - a source asked at a grid of pairs, and materials compared with it there.
 */
#ifndef FACET_FIT_PAIRS_H
#define FACET_FIT_PAIRS_H

#include "facet_fit.h"

enum { FIT_SHAPES_MAX = 3 }; /* parameters of a roughness */

/* Pairs with data above the horizon, grouped by theta_d. */
struct fit_pairs {
    size_t count, channels; /* channels 1: the source has no colour */
    double *wi[3], *wo[3];
    double *fr_cos[3];             /* of the source */
    double *log_fr[3];             /* log(FACET_FIT_EPSILON + fr_cos) */
    double *model;                 /* room for fr_cos of an uncoloured material */
    double *slope[FIT_SHAPES_MAX]; /* and for its derivatives */
    double *schlick;               /* (1 - cos theta_d)^5 */
    size_t *group;                 /* index into cos_theta_d */
    double *cos_theta_d;           /* of the groups, decreasing */
    size_t groups;
    void *owned;
};

/*
 * What to ask: every theta_h with every theta_d with azimuths spread over [0, pi)
 * (turns 1: isotropic, phi_h = 0) or over the circle, and as many phi_h as turns.
 * theta_h_of, if not NULL, gives theta_h by index and phi_h instead of the list.
 */
struct fit_grid {
    const double *theta_h, *theta_d; /* theta_d increasing */
    size_t theta_h_count, theta_d_count, azimuths, turns;
    double (*theta_h_of)(const void *user, size_t index, double phi_h);
    const void *user;
};

facet_status facet_fit_pairs_create(const facet_fit_source *source, const struct fit_grid *grid,
                                    struct fit_pairs *pairs);
/* It has data, and both directions lie above the horizon. */
bool facet_fit_sample_is_used(const facet_fit_samples *samples, size_t index);
/*
 * Whether samples of this spread say more than so many parameters of an isotropic model, or of the
 * anisotropic one with two more; elongated: that is seen to be none of the former.
 */
bool facet_fit_is_told(const facet_fit_spread *spread, size_t parameters, bool anisotropic,
                       bool elongated);
/* The samples themselves, grouped by theta_d in so many (at most 255) equal parts of [0, pi/2]. */
facet_status facet_fit_pairs_samples(const facet_fit_samples *samples, size_t groups,
                                     struct fit_pairs *pairs);
/* Backscatter pairs at slopes r and so many azimuths: one group; fr in place of fr_cos. */
facet_status facet_fit_pairs_backscatter(const facet_fit_source *source, const double *r, size_t n,
                                         size_t turns, struct fit_pairs *pairs);
/* Those of the samples with wi and wo within 6 degrees: fr in place of fr_cos; may be none. */
facet_status facet_fit_pairs_near(const facet_fit_samples *samples, struct fit_pairs *pairs);
/* Every stride-th of them, on their own. */
facet_status facet_fit_pairs_thin(const struct fit_pairs *from, size_t stride,
                                  struct fit_pairs *pairs);
void facet_fit_pairs_clear(struct fit_pairs *pairs);

/* fr_cos of the material with F = 1 into out (count numbers). */
facet_status facet_fit_pairs_model(const struct fit_pairs *pairs, const facet_material *material,
                                   double *out);

/*
 * The Fresnel table that brings (1 - kd) F pairs->model + kd cos/pi closest to
 * the source in the sense of facet_fit_error: values[c][g] for each group, gaps
 * filled from their neighbours; false where no group could be determined.
 */
bool facet_fit_fresnel_table(const struct fit_pairs *pairs, const double kd[3],
                             double *const values[3]);

/* The sum of squares that this table leaves. */
double facet_fit_residual(const struct fit_pairs *pairs, const double kd[3],
                          double *const values[3]);

/* rms_log of the best Lambertian surface, whose reflectance is kd. */
double facet_fit_flat_rms(const struct fit_pairs *pairs, double kd[3]);

/* facet_fit_error of a whole candidate; backscatter may hold no pairs. */
facet_status facet_fit_error_of(const struct fit_pairs *pairs, const struct fit_pairs *backscatter,
                                facet_fit_candidate *candidate);
/* Mean over the backscatter pairs between 15 and 70 degrees of log(source/fit), eps guarded. */
facet_status facet_fit_hot_spot(const struct fit_pairs *backscatter,
                                const facet_fit_candidate *candidate, double *mean);

#endif
