/*
 * merl.h - MERL .binary measurements (Matusik et al. 2003), read in place.
 *
 * Layout: three little-endian int32 (90, 90, 180), then for each colour plane
 * 90 x 90 x 180 little-endian doubles over theta_h, theta_d, phi_d.  A number
 * stands for f_r at theta_h = (pi/2)(i/90)^2, theta_d = (pi/2) j/90, phi_d = pi
 * k/180; negative means no data.
 */
#ifndef API_MERL_H
#define API_MERL_H

#include "measurement.h"

enum { MERL_SIZE = 12 + 3 * 8 * 90 * 90 * 180 };

/* Of this size, or starting with these dimensions: merl_open then says what is wrong with it. */
bool api_merl_matches(const unsigned char *bytes, size_t size);

/* The bytes are borrowed. */
struct merl {
    const unsigned char *bytes;
};

/* counts: a colour with a negative channel is missing. */
bool api_merl_open(const void *bytes, size_t size, struct merl *merl, struct data_counts *counts,
                   struct problem *problem);

/*
 * f_r by trilinear interpolation in the coordinates in which the data are
 * uniform (sqrt(theta_h), theta_d, phi_d); user is the struct merl.  No data
 * where more than half of the weight falls on cells without.
 */
facet_status api_merl_evaluate(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                               double *const fr[3], bool *valid);

/* tan theta_h of the last row: backscatter is known up to there. */
double api_merl_slope_max(void);

#endif
