/* transmission.h - what evaluation, sampling and bounds of a BSDF share (internal). */
#ifndef FACET_TRANSMISSION_INTERNAL_H
#define FACET_TRANSMISSION_INTERNAL_H

#include "facet_transmission.h"

#include "brdf.h"
#include "double_double.h"

/* The surface as wo sees it from one side. */
struct side {
    facet_brdf *brdf;           /* its Fresnel term */
    double index;               /* n = inner/outer */
    struct pair outer, inner;   /* indices on wo's side and on wi's: 1 and eta, or eta and 1 */
    double excess;              /* n^2 - 1 */
};

enum { ABOVE, BELOW, SIDES };

struct facet_bsdf {
    struct side side[SIDES];
    facet_brdf *ideal; /* the same surface with F = 1 */
    facet_ndf ndf;
    bool is_correlated;
    facet_transport transport;
};

/* The side of a direction; 0 counts as above. */
static inline int facet_side(double z)
{
    return z < 0 ? BELOW : ABOVE;
}

/* 1 - F of a normal with cosines c = wo.h and g = n |wi.h|, in positive terms. */
double facet_transmittance(double n, double c, double g);
/* W of facet_transmission.h; sigma(wo), sigma(-wi) and the cosines of wo, -wi with the mean facet. */
double facet_transmission_masking(const facet_bsdf *bsdf, double sigma_o, double cosine_o, double sigma_i,
                                  double cosine_i);
/* What transport makes of what is transmitted: 1 or 1/n^2. */
double facet_transport_scale(const facet_bsdf *bsdf, int side);

enum { TRANSMISSION_BLOCK = 256 };

/* wo turned up and the point reflection of wi with it; the two lobes of n <= TRANSMISSION_BLOCK pairs. */
struct lobes {
    double wi[3][TRANSMISSION_BLOCK], wo[3][TRANSMISSION_BLOCK];
    int side[TRANSMISSION_BLOCK];
    struct {
        double pdf[TRANSMISSION_BLOCK];    /* density of the lobe */
        double weight[TRANSMISSION_BLOCK]; /* its share of fr cos theta_i (IMPORTANCE) over it; 0 on the wrong side */
    } reflected, transmitted;
    /* Of the transmitted lobe; 0 where no normal refracts wo into wi. */
    double D[TRANSMISSION_BLOCK], F[TRANSMISSION_BLOCK], cosine[TRANSMISSION_BLOCK], jacobian[TRANSMISSION_BLOCK];
    double sigma_o[TRANSMISSION_BLOCK], sigma_i[TRANSMISSION_BLOCK]; /* of wo and -wi */
    double fresnel[TRANSMISSION_BLOCK];                              /* of the reflected lobe */
};

/* Fills in wi, wo, side from pairs `start` and on. */
void facet_lobes_turn(struct lobes *lobes, facet_vec3_in wi, facet_vec3_in wo, size_t start, size_t n);

/* Of the reflection from wi to wo. */
facet_status facet_lobes_fresnel(const facet_bsdf *bsdf, struct lobes *lobes, size_t n);
/* Both lobes from wi, wo, side. */
facet_status facet_lobes_eval(const facet_bsdf *bsdf, struct lobes *lobes, size_t n);

#endif
