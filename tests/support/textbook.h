/*
 * textbook.h - directional albedo by a model and a quadrature of their own: textbook formulas, wi in
 * spherical coordinates about wo, recursive Gauss rules.  Nothing is shared with lib but facet.h's structs.
 */
#ifndef TEXTBOOK_H
#define TEXTBOOK_H

#include "facet.h"

/* A direction seen by the stretched surface: its cosine to the mean facet and its length along it. */
struct textbook_stretched {
    double c, s;
};
struct textbook_stretched textbook_stretch(const facet_roughness *r, const double k[3]);

/* The projected area sigma of the surface toward it. */
double textbook_area(facet_ndf ndf, struct textbook_stretched k);

/* D of the normal along H, of any length. */
double textbook_density(facet_ndf ndf, const facet_roughness *r, const double H[3]);

typedef double textbook_function(void *user, double x);
/* One Gauss rule over [a, b]. */
double textbook_piece(textbook_function *f, void *user, double a, double b);
/* Halves until halving changes no more than error, a third less at each step; 0 unless a < b. */
double textbook_integral(textbook_function *f, void *user, double a, double b, double error);

/* Of any untabulated, energy-safe material (first channel). */
double textbook_albedo(const facet_material *m, const double o[3], double error);

#endif
