/*
 * samples.h - f_r at scattered pairs: the member `samples` of a request, and CSV.
 *
 * CSV: a line per pair with theta_i, phi_i, theta_o, phi_o (radians), r, g, b (per
 * steradian), separated by commas, semicolons or blanks; a first line of these names
 * may order them differently; lines that start with # do not count.  A value that is
 * empty or nan (in any case, with a sign or none) is missing, below 0 counts as 0; both are counted.
 */
#ifndef API_SAMPLES_H
#define API_SAMPLES_H

#include "directions.h"
#include "measurement.h"

struct samples {
    struct directions wi, wo;
    struct matrix fr; /* 1 or 3 columns */
};
extern const struct field api_samples_fields[];

bool api_samples_open(const struct samples *samples, const struct place *place,
                      struct decoder *decoder, struct measurement *measurement);

bool api_csv_matches(const unsigned char *bytes, size_t size);
bool api_csv_open(const void *bytes, size_t size, struct arena *arena, struct problem *problem,
                  struct measurement *measurement);

#endif
