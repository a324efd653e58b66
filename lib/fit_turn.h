/*
 * fit_turn.h - the slope distribution of an anisotropic source from its backscatter.
 */
#ifndef FACET_FIT_TURN_H
#define FACET_FIT_TURN_H

#include "facet_fit.h"

/*
 * P at Gauss nodes r of the radius and uniform azimuths of the normal, solving the
 * backscatter equation: the anisotropic form of Dupuy 2015, alg. 1.
 */
struct fit_turn {
    double scale;
    size_t radii, turns;
    double *r, *weight; /* r dr of a radius, times the step of phi */
    double *p;          /* [radius][turn]; sum of weight p = 1 */
    double f0;
    void *owned;
};

facet_status facet_fit_turn_create(const facet_fit_source *source, facet_masking masking,
                                   facet_fit_convention convention, double scale, size_t radii,
                                   size_t turns, const facet_watch *watch, struct fit_turn *turn);
void facet_fit_turn_clear(struct fit_turn *turn);

/* From E|x~| along four axes (Dupuy sec. 4.2): alpha_x, alpha_y, rho of GGX or Beckmann. */
facet_roughness facet_fit_turn_roughness(const struct fit_turn *turn, facet_ndf ndf);

/*
 * log D at the n nodes of a facet_slope_table in the standard slopes of this
 * roughness: the mean over the azimuth; or rows of them over it, each the mean of both its sides.
 */
facet_status facet_fit_turn_table(const facet_fit_source *source, facet_masking masking,
                                  facet_fit_convention convention, const struct fit_turn *turn,
                                  const facet_roughness *roughness, double scale, size_t n,
                                  size_t rows, double *log_d);

#endif
