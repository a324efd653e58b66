/*
 * draw.h - random materials and directions for the accuracy and property tests.
 *
 * Directions come in kinds that aim where formulas break: grazing, near the
 * mirror direction, at the pole, equal, opposite, on the edge c = 0 of what the
 * mean facet sees, below the horizon, rounded to float.
 */
#ifndef DRAW_H
#define DRAW_H

#include "check.h"
#include "facet.h"

struct draw_domain {
    double alpha_min, alpha_max;
    double rho_max;    /* 1 - |rho| is drawn log-uniformly down to 1 - rho_max */
    double slope_max;  /* of the mean slope's components */
    double cosine_min; /* of both directions */
    bool below;        /* directions below the horizon too */
};

extern const struct draw_domain draw_everywhere; /* all that facet.h allows */
extern const struct draw_domain draw_ordinary;   /* where issue 2 asks for 1e-12 */

/* n times $FACET_TEST_SCALE (1 if unset), at least 1. */
size_t draw_count(size_t n);

void draw_roughness(struct rng *rng, const struct draw_domain *domain, facet_roughness *roughness);

/* A Fresnel term of the kind; a table borrows static nodes. */
void draw_fresnel(struct rng *rng, facet_fresnel_kind kind, facet_fresnel *fresnel);

/* A unit vector, its cosine at least cosine_min. */
void draw_direction(struct rng *rng, double cosine_min, double k[3]);

void draw_pair(struct rng *rng, const struct draw_domain *domain, const facet_material *material,
               double wi[3], double wo[3]);

/* "{.ndf = ..}" as one writes it in C, for messages; static buffer. */
const char *draw_text(const facet_material *material);

#endif
