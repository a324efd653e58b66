/*
 * closed.h - BRDFs in closed form to fit, nothing shared with lib: GGX and Beckmann,
 * Schlick, Smith masking correlated or with a hot spot.
 */
#ifndef CLOSED_H
#define CLOSED_H

#include "facet_fit.h"

enum closed_masking {
    CLOSED_CORRELATED,
    CLOSED_HOT_SPOT, /* masking only where wi and wo agree in azimuth, correlated elsewhere */
    CLOSED_SMALLER   /* the smaller of the two G1: masking only in all of backscatter */
};

struct closed {
    facet_ndf ndf;
    double alpha, f0[3];
    enum closed_masking masking;
    double noise, noise_floor; /* relative, and of the peak; 0: none */
    double outliers;           /* the share of values that are a hundredfold */
    unsigned seed;
};

double closed_slope_density(const struct closed *s, double r);
double closed_fr(const struct closed *s, const double i[3], const double o[3], double f0);
facet_fit_source closed_source(const struct closed *closed);

#endif
