/*
 * yardstick.h - the textbook: Dupuy's thesis as its listings print it (with the
 * corrections of the errata), scalar double with libm.  What make bench measures
 * against; nothing else uses it.
 */
#ifndef YARDSTICK_H
#define YARDSTICK_H

#include "facet.h"

/* A material in the thesis's own parameters. */
struct yardstick {
    facet_ndf ndf; /* GGX or BECKMANN */
    double ax, ay, rho, sqrt_one_minus_rho_sqr;
    double tx_n, ty_n;          /* mean slope */
    facet_fresnel_kind fresnel; /* IDEAL, SCHLICK or DIELECTRIC */
    double f0, eta;
};

struct yardstick yardstick_of(const facet_material *material);

/* One quantity of FR (listings 2.2-2.12, 3.1, 3.3), PDF, D, D_VIS, G, G1_I, G1_O, F, SIGMA_O. */
double yardstick_eval(const struct yardstick *m, facet_quantity quantity, const double wi[3],
                      const double wo[3]);

/* Listings 2.9 and 3.3 with table 2.V, GGX by Heitz & d'Eon's slopes (seed 003): wi and its weight. */
void yardstick_sample(const struct yardstick *m, const double wo[3], double u1, double u2,
                      double wi[3], double *weight);

#endif
