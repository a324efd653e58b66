/*
 * facet_fit.h - fit a microfacet material to any isotropic BRDF that can be asked.
 *
 * Backscatter f_r(o, o) determines the slope distribution (Dupuy 2015, ch. 4):
 * with masking only, f_r(o,o) = F0 D G1/(4 cos^2 theta), which is linear in D and
 * solved by power iteration; a height-correlated source is linear in D as well.
 * Both are tried, and the one that predicts the rest of the BRDF better is kept.
 * The Fresnel term is what is left of the BRDF once D and masking are divided out.
 */
#ifndef FACET_FIT_H
#define FACET_FIT_H

#include "facet.h"
#include "facet_table.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The BRDF to fit, isotropic: it may be asked at any azimuth. */
typedef struct facet_fit_source {
    /*
     * f_r of n pairs in three channels; valid[i] false where there are no data
     * (fr is ignored there).  A status other than FACET_OK ends the fit with it.
     */
    facet_status (*evaluate)(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                             double *const fr[3], bool *valid);
    const void *user;
    double slope_max; /* backscatter is known up to this tan theta; INFINITY: everywhere */
} facet_fit_source;

#define FACET_FIT_RESOLUTION_MIN 8
#define FACET_FIT_RESOLUTION_MAX 1024
#define FACET_FIT_RESOLUTION 90  /* default */
#define FACET_FIT_TOLERANCE 0.05 /* default */

/*
 * The error of a fit: rms of log((FACET_FIT_EPSILON + f_r cos theta_i)/
 * (FACET_FIT_EPSILON + fit)), all channels, over the pairs with data and both
 * cosines >= 1e-3 among theta_h = (pi/2) ((i + 1/2)/45)^2, theta_d = (pi/2)
 * (j + 1/2)/40, phi_d = pi (k + 1/2)/12: the measure of a MERL file.
 */
#define FACET_FIT_EPSILON 1e-3

typedef struct facet_fit_error {
    double rms_log;
    double backscatter_max; /* relative error of f_r(o,o), down to 1e-4 of each channel's peak */
} facet_fit_error;

/* A material that facet_brdf_create takes as it is.  It borrows from the facet_fit. */
typedef struct facet_fit_candidate {
    facet_material material;
    size_t bytes; /* of the numbers that describe it, as float64 */
    facet_fit_error error;
} facet_fit_candidate;

/* Which relation of masking and shadowing the backscatter of the source obeys. */
typedef enum facet_fit_convention {
    FACET_FIT_MASKING_ONLY, /* G(o,o) = G1(o): real surfaces, the hot spot */
    FACET_FIT_CORRELATED,   /* G(o,o) = 1/(2/G1 - 1): what height-correlated renderers make */
    FACET_FIT_CONVENTION_COUNT
} facet_fit_convention;

/*
 * GGX and Beckmann with a Schlick term, then with a tabulated Fresnel term, and
 * a tabulated slope distribution with a tabulated Fresnel term: by growing size.
 */
enum { FACET_FIT_CANDIDATES = 5 };

typedef struct facet_fit {
    facet_fit_candidate candidate[FACET_FIT_CANDIDATES];
    facet_fit_convention convention;
    double table_scale; /* what facet_slope_table_create took: tan theta at u = 1/2 */
    const double *table_log_d;
    size_t table_nodes; /* resolution + 1 */
    size_t pairs;       /* that rms_log was taken over */
    void *owned;
} facet_fit;

/*
 * resolution: intervals of the returned slope table, FACET_FIT_RESOLUTION_MIN ..
 * FACET_FIT_RESOLUTION_MAX.  masking: of the fitted materials, FACET_SMITH.
 * FACET_BAD_DATA where the source has no usable backscatter.
 */
facet_status facet_fit_isotropic(const facet_fit_source *source, facet_masking masking,
                                 size_t resolution, const facet_watch *watch, facet_fit *fit);
void facet_fit_clear(facet_fit *fit);

#ifdef __cplusplus
}
#endif
#endif
