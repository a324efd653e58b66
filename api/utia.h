/*
 * utia.h - UTIA .bin measurements (Filip & Vavra 2014): anisotropic, sparse.
 *
 * Layout: 3 colour planes x 6 theta_i x 48 phi_i x 6 theta_o x 48 phi_o little-endian
 * doubles, steps 15 and 7.5 degrees.  A number v below 0 counts as 0; v/140, then the
 * sRGB decoding, times 100 is f_r.  Linear between the angles, phi periodic; no
 * data beyond theta = 75 degrees.  Between nodes 15 degrees apart that broadens every
 * lobe, so a fit looks at nodes alone: they are its samples.
 */
#ifndef API_UTIA_H
#define API_UTIA_H

#include "measurement.h"

enum { UTIA_THETAS = 6, UTIA_PHIS = 48 };
enum {
    UTIA_PLANE = UTIA_THETAS * UTIA_PHIS * UTIA_THETAS * UTIA_PHIS,
    UTIA_SIZE = 24 * UTIA_PLANE
};

/* By size: the format has no mark. */
bool api_utia_matches(const unsigned char *bytes, size_t size);
bool api_utia_open(const void *bytes, size_t size, struct arena *arena, struct problem *problem,
                   struct measurement *measurement);

/* user: the decoded numbers. */
facet_status api_utia_evaluate(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                               double *const fr[3], bool *valid);

#endif
