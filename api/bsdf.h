/*
 * bsdf.h - RGL .bsdf measurements (Dupuy & Jakob 2018): tensor files.
 *
 * "tensor_file\0", version 1.0, then fields of named arrays.  f_r cos theta_o is
 * stored in coordinates that follow the visible normals: a pair is mapped by the
 * cumulated vndf of wi to the unit square, where rgb (or spectra) is interpolated,
 * and times ndf/(4 sigma).  Spectra are read at 630, 532 and 465 nm.
 */
#ifndef API_BSDF_H
#define API_BSDF_H

#include "measurement.h"

bool api_bsdf_matches(const unsigned char *bytes, size_t size);
bool api_bsdf_open(const void *bytes, size_t size, struct arena *arena, struct problem *problem,
                   struct measurement *measurement);

#endif
