/*
 * scene.h - a view of a surface in standard slopes, and the density of what it sees there as eval
 * answers it, for tests of samplers by their CDFs.
 */
#ifndef SCENE_H
#define SCENE_H

#include "facet.h"

/* So many places or samples at once. */
enum { SCENE_MAX = 160 };

struct scene {
    const facet_brdf *brdf;
    facet_roughness r;
    double scale, wo[3], c, s, ca, cb; /* standard frame: along wo */
};

void scene_look_from(struct scene *scene, double theta, double phi);

/* The slope (along, across) of a micronormal; slopes point away from where normals lean. */
void scene_slopes(const struct scene *scene, const double h[3], double slope[2]);

/* D_vis as eval answers it, per area of standard slopes: D_vis h_z^3 det, at n places on rings. */
void scene_densities(const struct scene *scene, const double *radius, const double *turn, size_t n,
                     double *out);

/* How far a ring is seen to either side. */
double scene_turn_end(const struct scene *scene, double radius);

/* h and wi of n samples in precise. */
void scene_draw(const struct scene *scene, facet_sampler sampler, const double *u1,
                const double *u2, size_t n, double h[3][SCENE_MAX], double wi[3][SCENE_MAX],
                double *pdf);

#endif
