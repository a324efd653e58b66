/*
 * fit_backscatter.h - slope distribution from backscatter, roughness from a slope distribution.
 */
#ifndef FACET_FIT_BACKSCATTER_H
#define FACET_FIT_BACKSCATTER_H

#include "facet_fit.h"

/* f_r(o,o) at slopes r = tan theta_o, mean of the channels; beyond the data f_r cos theta is kept. */
facet_status facet_fit_backscatter(const facet_fit_source *source, const double *r, size_t n,
                                   double *fr);

/* The slope about which half the facets are flatter: a first look, blind to masking. */
facet_status facet_fit_median_slope(const facet_fit_source *source, double *median);

/* A radial slope density P at Gauss nodes, solving the backscatter equation. */
struct fit_density {
    double scale; /* nodes r = scale u/(1-u) */
    size_t count;
    double *r, *weight, *p; /* sum of 2 pi weight p = 1 */
    double f0;              /* normal reflectance, mean of the channels */
};

/*
 * With masking SMITH by power iteration, under a convention; VGROOVE and NONE
 * give P at once (Dupuy 2015, eqs. 4.17 and 4.18 with table 2.IV).
 */
facet_status facet_fit_density_create(const facet_fit_source *source, facet_masking masking,
                                      facet_fit_convention convention, double scale, size_t count,
                                      struct fit_density *density);
void facet_fit_density_clear(struct fit_density *density);

/* log D at the n nodes of a facet_slope_table: the equation itself interpolates (Nystroem). */
facet_status facet_fit_density_table(const facet_fit_source *source, facet_masking masking,
                                     facet_fit_convention convention,
                                     const struct fit_density *density, size_t n, double *log_d);

/* alpha of GGX or Beckmann: moments, then least squares on log P; rms: what is left of log P. */
double facet_fit_alpha(const struct fit_density *density, facet_ndf ndf, double *rms);

/* The parts that the anisotropic solution shares. */
double facet_fit_gain(double r, double fr);

#endif
