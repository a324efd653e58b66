/*
 * facet_fit.h - fit a microfacet material to a BRDF that can be asked, or to samples of one.
 *
 * Backscatter f_r(o, o) determines the slope distribution (Dupuy 2015, ch. 4):
 * with masking only, f_r(o,o) = F0 D G1/(4 cos^2 theta), which is linear in D and
 * solved by power iteration; a height-correlated source is linear in D as well.
 * Both are tried, and the one that explains the rest of the BRDF better is kept.
 * Roughness, Fresnel term and diffuse part are then polished by robust least
 * squares on the logarithm of the whole BRDF.
 *
 * A fitted material is f_r = (1 - kd) f_specular + kd/pi (Dupuy eq. 5.4).
 */
#ifndef FACET_FIT_H
#define FACET_FIT_H

#include "facet.h"
#include "facet_table.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Pairs at which f_r is known, and no others. */
typedef struct facet_fit_samples {
    size_t count;
    facet_vec3_in wi, wo;
    const double *fr[3]; /* per steradian; below 0 counts as 0, not finite as no data */
} facet_fit_samples;

/* The BRDF to fit. */
typedef struct facet_fit_source {
    /*
     * f_r of n pairs in three channels; valid[i] false where there are no data
     * (fr is ignored there).  A status other than FACET_OK ends the fit with it.
     */
    facet_status (*evaluate)(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                             double *const fr[3], bool *valid);
    const void *user;
    double slope_max; /* backscatter is known up to this tan theta; INFINITY: everywhere */
    bool anisotropic; /* the answer may change when wi and wo turn together about the normal */
    const facet_fit_samples *samples; /* not NULL: evaluate is not called */
} facet_fit_source;

#define FACET_FIT_RESOLUTION_MIN 8
#define FACET_FIT_RESOLUTION_MAX 1024
#define FACET_FIT_RESOLUTION 90  /* default */
#define FACET_FIT_TOLERANCE 0.05 /* default */

/* Fewer samples than this determine nothing. */
#define FACET_FIT_SAMPLES_MIN 16

/*
 * What samples tell.  A model is fitted to them where they hold more pairs of directions that it
 * tells apart than it has parameters (a channel): with as many, all data are met and none says
 * whether the model is right.  An anisotropic model moreover needs what an isotropic one does,
 * or as many pairs as that has parameters where it leaves less than half of that one's error: else
 * it is the isotropic one in disguise.
 */
typedef struct facet_fit_spread {
    size_t used;   /* samples with data and both cosines >= 1e-3 */
    size_t round;  /* pairs that an isotropic surface tells apart, which takes turned about the
                      normal, mirrored and exchanged ones for one */
    size_t turned; /* that an anisotropic one does: exchanged, or turned by 180 degrees, one */
} facet_fit_spread;

enum {
    FACET_FIT_SPREAD_MAX = 64, /* round and turned are counted no further */
    FACET_FIT_ROUND_MIN = 3,   /* alpha, F0, and one more */
    FACET_FIT_TURNED_MIN = 5   /* alpha_x, alpha_y, rho, F0, and one more */
};

void facet_fit_spread_of(const facet_fit_samples *samples, facet_fit_spread *spread);

/*
 * The error of a fit: rms of log((FACET_FIT_EPSILON + f_r cos theta_i)/
 * (FACET_FIT_EPSILON + fit)), all channels, over the pairs with data and both
 * cosines >= 1e-3 among theta_h = (pi/2) ((i + 1/2)/45)^2, theta_d = (pi/2)
 * (j + 1/2)/40, phi_d = pi (k + 1/2)/12: the measure of a MERL file, each pair
 * and channel of equal weight.  (Low et al. 2012 compare log(1 + f_r cos theta);
 * here the guard is small enough for dark materials.)  An anisotropic source is asked at
 * 8 phi_h, 15 theta_h, 20 theta_d and 8 phi_d over the whole circle; samples
 * count as they are.
 */
#define FACET_FIT_EPSILON 1e-3

/*
 * Beyond these a surface is not made of the facets fitted to it: a factor of 1.8 in the
 * rms over all directions; a factor of 3 in the mean of the backscatter (facet_fit.hot_spot).
 * Of the 100 materials of MERL the worst is met to 0.48, of two measured
 * retro-reflectors the better to 0.71.
 */
#define FACET_FIT_RMS_MAX 0.6
#define FACET_FIT_HOT_SPOT_MAX 1.1

typedef struct facet_fit_error {
    double rms_log;
    double channel[3];      /* rms_log of each channel */
    double backscatter_max; /* relative error of f_r(o,o), down to 1e-4 of each channel's peak;
                               NAN: no backscatter is known */
    double worst;           /* the largest |log| of them all, and where */
    double worst_wi[3], worst_wo[3];
} facet_fit_error;

/* A material that facet_brdf_create takes as it is.  It borrows from the facet_fit. */
typedef struct facet_fit_candidate {
    facet_material material;
    bool anisotropic, has_diffuse;
    double diffuse[3]; /* kd: f_r = (1 - kd) f_specular + kd/pi */
    /* TABULATED: what facet_slope_table_create took with facet_fit.table_scale, or with rows
       facet_slope_table_create_turned */
    const double *log_d;
    size_t log_d_nodes, log_d_rows; /* of each row; 1: no rows */
    size_t bytes;                   /* of the numbers that describe it, as float64 */
    facet_fit_error error;
} facet_fit_candidate;

/* Which relation of masking and shadowing the backscatter of the source obeys. */
typedef enum facet_fit_convention {
    FACET_FIT_MASKING_ONLY, /* G(o,o) = G1(o): real surfaces, the hot spot */
    FACET_FIT_CORRELATED,   /* G(o,o) = 1/(2/G1 - 1): what height-correlated renderers make */
    FACET_FIT_CONVENTION_COUNT
} facet_fit_convention;

typedef enum facet_fit_models {
    FACET_FIT_GGX = 1 << FACET_GGX,
    FACET_FIT_BECKMANN = 1 << FACET_BECKMANN,
    FACET_FIT_TABULATED = 1 << FACET_TABULATED,
    FACET_FIT_ALL = FACET_FIT_GGX | FACET_FIT_BECKMANN | FACET_FIT_TABULATED
} facet_fit_models;

typedef struct facet_fit_options {
    facet_masking masking; /* of the fitted materials: SMITH, VGROOVE or NONE */
    size_t resolution;     /* intervals of the slope table */
    unsigned models;       /* facet_fit_models */
    bool anisotropic;      /* alpha_x, alpha_y, rho; only from an anisotropic source or samples */
    bool diffuse;          /* also with a diffuse part */
    bool compact;          /* also with fewer nodes in every table: FACET_FIT_COMPACT intervals of
                              slopes, a sixth of the Fresnel nodes */
} facet_fit_options;

/*
 * GGX and Beckmann with Schlick and with a Fresnel table, tabulated with a table, each
 * without and with a diffuse part; where it is anisotropic, the first two also isotropic, and the third
 * also over the azimuth, at FACET_FIT_ROWS rows; those with tables also compact, which halves the rows.
 */
enum { FACET_FIT_CANDIDATES_MAX = 28, FACET_FIT_COMPACT = 24, FACET_FIT_ROWS = 24 };

typedef struct facet_fit {
    size_t count; /* by growing size */
    facet_fit_candidate candidate[FACET_FIT_CANDIDATES_MAX];
    facet_fit_convention convention;
    bool has_convention; /* false where it means nothing: samples, other masking than SMITH, an
                             anisotropic source that is no model under either */
    double table_scale;  /* of the slope tables: tan theta at u = 1/2 */
    size_t pairs;        /* that the errors were taken over */
    double flat_rms;     /* rms_log of the best Lambertian surface: what a fit must explain */
    double flat_kd[3];   /* its reflectance */
    double hot_spot;     /* mean log of backscatter over the best candidate's, from 15 to 70 degrees
                           off the normal; of samples, those within 6 degrees of it; NAN: not known */
    void *owned;
} facet_fit;

/*
 * UNSUPPORTED: options that do not go together.  BAD_DATA where the source has
 * no usable backscatter, or samples tell too little (facet_fit_spread).
 */
facet_status facet_fit_create(const facet_fit_source *source, const facet_fit_options *options,
                              const facet_watch *watch, facet_fit *fit);
void facet_fit_clear(facet_fit *fit);

#ifdef __cplusplus
}
#endif
#endif
