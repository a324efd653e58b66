/* facet_solid_angle.h - how much of the incident sphere a sample stands for, for filtered importance sampling. */
#ifndef FACET_SOLID_ANGLE_H
#define FACET_SOLID_ANGLE_H

#include "facet.h"

#ifdef __cplusplus
extern "C" {
#endif

/*
 * The solid angle of wi, in steradians, that one of `samples` samples of a wo stands
 * for; its square root is the width of the filter that filtered importance sampling
 * wants there (Dupuy section 3.4):
 *   omega = 4 <o,h> cos^3 theta_h A,  A = pi max(alpha_1, alpha_2)^2 / samples.
 * A is the area of a sample in slope space: what 1/(samples P) is at the peak of an
 * isotropic slope density P, and round for every other, so that samples overlap.
 * cos^3 theta_h carries slopes to normals, 4 <o,h> normals to wi.  (The thesis
 * prints theta_o for theta_h and leaves the factor of A open.)  Against the mean of
 * the samples around, 1/(samples pdf), it is G1_o alpha_1/alpha_2 for the mirror
 * direction of a central surface, 1/2 (Beckmann) or 1/4 (GGX) for the median sample
 * from above, and less in the tails, where samples lie further apart.
 * 0 where wi = -wo.  roughness as facet_brdf_create takes it, samples > 0.
 */
void facet_solid_angle(const facet_roughness *roughness, double samples, facet_vec3_in wi,
                       facet_vec3_in wo, size_t n, double *solid_angle);

#ifdef __cplusplus
}
#endif
#endif
