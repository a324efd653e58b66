/*
 * reference.h - every quantity of lib/quantities.def in quadruple precision,
 * straight from the definitions, on the double components as given.
 *
 * It shares nothing with lib but facet.h.  Exponentials are kept apart from
 * their factors, so that D / sigma is right where both underflow.
 */
#ifndef REFERENCE_H
#define REFERENCE_H

#include "facet.h"

typedef __float128 quad;

struct reference {
    quad of[FACET_QUANTITY_COUNT][3];
    quad condition; /* of the thesis's denominator; 1 for other materials */
};

void reference_eval(const facet_material *material, const double wi[3], const double wo[3],
                    struct reference *result);

/* The same for an exact wi and its H = wi + wo, which need not be doubles. */
void reference_eval_exact(const facet_material *material, const quad wi[3], const double wo[3],
                          const quad H[3], struct reference *result);

/* A roughness with its lows; kappa = sqrt(1 - rho^2). */
struct reference_roughness {
    quad alpha_x, alpha_y, rho, kappa;
};
struct reference_roughness reference_roughness(const facet_roughness *roughness);
/* How far it is from an ellipse, in units of the slopes along its axes. */
double reference_shape_error(const facet_roughness *roughness, const facet_ellipse *ellipse);

/* The roughness seen from k: standard slope statistics along k (thesis eq. 3.3). */
struct reference_view {
    quad a, b, c, s;
};
struct reference_view reference_project(const facet_roughness *roughness, const quad k[3]);
/* D of the direction H, of any length. */
quad reference_ndf(const facet_material *material, const quad H[3]);

quad reference_sigma(const facet_material *material, const double k[3]);
/* The same from its definition, the integral of max(<k, h>, 0) D over the hemisphere. */
quad reference_sigma_integral(const facet_material *material, const double k[3]);

quad reference_fresnel(const facet_fresnel *fresnel, quad cos_theta_d, size_t channel);
/* Dielectric as thesis table 2.I prints it: reference_fresnel uses complex amplitudes. */
quad reference_fresnel_table_2_1(quad eta, quad cos_theta_d);

struct reference_sample {
    quad wi[3], h[3], pdf, weight[3];
};

/* u1, u2 strictly inside (0, 1) for Beckmann, whose slopes are infinite at the ends. */
void reference_sample(const facet_material *material, const double wo[3], double u1, double u2,
                      struct reference_sample *result);

/* |y - x| / max(|x|, floor); infinite if y is not a number. */
double reference_error(double y, quad x, double floor);

#endif
