/*
 * reference_transmission.h - a rough dielectric in quadruple precision, from Walter et al. 2007 as
 * printed (eqs. 16, 20, 21): no point reflection, F from its amplitudes and 1 - F by subtraction.
 */
#ifndef REFERENCE_TRANSMISSION_H
#define REFERENCE_TRANSMISSION_H

#include "facet_transmission.h"
#include "reference.h"

struct reference_bsdf {
    quad of
        [FACET_QUANTITY_COUNT]; /* FR, FR_COS and PDF on either side of the surface, the others across it */
    quad reflected, transmitted; /* densities of the lobes */
};

void reference_bsdf(const facet_material *material, facet_transport transport, const double wi[3],
                    const double wo[3], struct reference_bsdf *result);

/*
 * wi of the same numbers: the reference's normal, Snell's law, F from its amplitudes.  False where F is so
 * close to u[2] that rounding may choose the other lobe.
 */
bool reference_bsdf_sample(const facet_material *material, const double wo[3], const double u[3],
                           quad wi[3]);

/* Gamma(1 + a) Gamma(1 + b) / Gamma(1 + a + b). */
quad reference_opposite(quad a, quad b);

#endif
