/* filtered.h - a relief by its slopes' moments: levels, texels and what they shade like. */
#ifndef FILTERED_H
#define FILTERED_H

#include "facet_leadr.h"
#include "relief.h"

enum way { WAY_CENTRAL, WAY_FORWARD, WAY_BILINEAR, WAY_CLEAN, WAY_NORMAL, WAY_COUNT };

/* The levels of a relief, by way; CLEAN and NORMAL by the bilinear stencil.  NULL where memory fails. */
facet_leadr *filtered_pyramid(const struct relief *r, enum way way);

/* The moments of texel (p, q) of a level; of NORMAL the mean slopes alone. */
facet_moments filtered_texel(const facet_leadr *leadr, enum way way, size_t level, size_t p,
                             size_t q);

enum { FILTERED_MAX = 40 };

/* f_r cos(theta_i) of slopes with these moments above a rough base, n <= FILTERED_MAX pairs; 0 where there is no such material. */
void filtered_shade(const facet_moments *m, double base_alpha, const double (*wi)[3],
                    const double (*wo)[3], size_t n, double *out);

#endif
