/* fit_pure.h - is an extracted anisotropic slope distribution that of a model? */
#ifndef FACET_FIT_PURE_H
#define FACET_FIT_PURE_H

#include "fit_turn.h"

/*
 * rms of log P about the nearest elliptical GGX or Beckmann distribution, down to 1e-4 of the
 * peak: 1/sqrt(P) of the one and log P of the other are quadratic in the slopes, so that both
 * are linear least squares.  INFINITY where they have no solution.
 */
double facet_fit_turn_purity(const struct fit_turn *turn, facet_ndf ndf);

#endif
