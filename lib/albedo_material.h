/*
 * albedo_material.h - a material made ready for the quadratures of its albedo (internal).
 *
 * What the albedo of a direction and its mean share: the evaluation of pairs, with its count and its
 * error, and where the Fresnel term bends.
 */
#ifndef FACET_ALBEDO_MATERIAL_H
#define FACET_ALBEDO_MATERIAL_H

#include "albedo_ray.h"
#include "facet_albedo.h"
#include "integrate.h"

enum { ALBEDO_POINTS = INTEGRATE_POINTS };

/* exp(-r^2) beyond is nothing, (r^5)^2 of a Schlick term with f0 = 0 included. */
#define ALBEDO_BECKMANN_END 8.0
/* Slopes beyond this hold 1e-15 of what is seen, and u could not tell them from infinity. */
#define ALBEDO_SLOPE_END 1e15
/* Behind c_o < -BEHIND s the shared factor exp(-v^2) is taken out of D/sigma_o by the kernels only. */
#define ALBEDO_BEHIND 10.0
/* So far behind nothing of a Gaussian's tail can be resolved. */
#define ALBEDO_BLIND 100.0
/* To find out how large an integral is. */
#define ALBEDO_ROUGH 1e-2

struct albedo_material {
    facet_material material;
    facet_brdf *brdf, *standard; /* standard: alpha = 1, for P alone */
    struct albedo_surface surface;
    double det, scale; /* slopes r = scale u/(1 - u) */
    size_t channels, budget, spent, since_asked;
    facet_watch watch;
    double kink[FACET_FRESNEL_NODES_MAX]; /* cos^2 theta_d */
    size_t kinks;
    bool has_root;   /* F leaves a kink like a square root */
    bool is_central; /* no mean slope */
    bool half;       /* a mirror image of one half */
    bool turned;     /* the standard slopes are not radial */
    double condition;
    facet_depth depth;
};

struct albedo_pairs {
    double ix[ALBEDO_POINTS], iy[ALBEDO_POINTS], iz[ALBEDO_POINTS];
    double ox[ALBEDO_POINTS], oy[ALBEDO_POINTS], oz[ALBEDO_POINTS];
    double fr_cos[3][ALBEDO_POINTS], d[ALBEDO_POINTS];
};

/* Fails as facet_brdf_create does; to be closed in any case. */
facet_status facet_albedo_open(struct albedo_material *a, const facet_material *m,
                               const facet_albedo_options *options);
void facet_albedo_close(struct albedo_material *a);

/* fr cos theta_i and D of every pair. */
facet_status facet_albedo_evaluate(struct albedo_material *a, struct albedo_pairs *k);
/* P at r (cosine, sine). */
facet_status facet_albedo_density(const struct albedo_material *a, const double r[ALBEDO_POINTS],
                                  double cosine, double sine, double p[ALBEDO_POINTS]);
/* What the evaluations themselves may be off by, relative: fr cos, D and P. */
double facet_albedo_evaluation_bound(const struct albedo_material *a);
/* CANCELLED if the watch says so; asked every few thousand evaluations. */
facet_status facet_albedo_ask(struct albedo_material *a);
/* The rules' differences are no proof: nothing far below what was aimed at is claimed. */
void facet_albedo_be_modest(const struct albedo_material *a, double tolerance,
                            facet_albedo_value *of);

#endif
