/*
 * export_target.h - the model of another tool, in ours: what it computes for the numbers
 * that are written for it, so that the loss can be measured.
 */
#ifndef API_EXPORT_TARGET_H
#define API_EXPORT_TARGET_H

#include "fit_answer.h"

struct target {
    facet_material material; /* GGX or Beckmann; Schlick, conductor or table */
    double specular[3];      /* f_r = specular material + diffuse/pi */
    double diffuse[3];
    bool dimmed; /* glTF: the diffuse part times 1 - F */
};

/* The candidate that a tool of these abilities holds best: the chosen one if it can. */
const facet_fit_candidate *api_export_choose(const facet_fit *fit,
                                             const facet_fit_candidate *chosen, bool beckmann,
                                             bool table);

/* eta and k of a conductor closest to a Schlick term over theta_d (Gulbrandsen 2014's n, k). */
void api_export_conductor(const double f0[3], double eta[3], double k[3]);

/* rms of log((eps + f_r cos)/(eps + target)) over a grid; false: out of memory. */
bool api_export_loss(struct call *call, const facet_fit_candidate *candidate,
                     const struct target *target, double *rms);

#endif
