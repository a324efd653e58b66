/*
 * normals.h - deterministic quadrature over the normals seen from a direction.
 *
 * The plane of standard slopes, turned so that x runs along wo, is mapped to
 * the unit square: GGX by x = tan psi, y = sqrt(1 + x^2) tan chi, where its
 * density is smooth; Beckmann linearly, to where exp(-x^2) is nothing.  The
 * seen half-plane x < v = c/s fills the square.
 */
#ifndef NORMALS_H
#define NORMALS_H

#include "facet.h"

struct normals_map {
    facet_roughness roughness;
    bool ggx;
    double cosine, sine; /* azimuth of wo in the standard slope plane */
    double c, s;         /* <wo, h> = (c - s x) h_z */
    double low, high;    /* of psi (GGX) or x (Beckmann) */
};

/* A normal with its solid angle and, for a direction, <wo, h>. */
struct normals_node {
    double h[3], area, cosine;
};

/* wo NULL: all normals. */
struct normals_map normals_map(const facet_material *material, const double wo[3]);

/* The normal at (p, q) of the unit square; area is per unit of the square. */
struct normals_node normals_at(const struct normals_map *map, double p, double q);

/* Beckmann: exp(-x^2) is nothing beyond, 4e-25. */
#define NORMALS_BECKMANN_END 7.5

enum { GAUSS_NODES = 16 };
/* Gauss-Legendre on [0, 1]. */
void normals_gauss(double node[GAUSS_NODES], double weight[GAUSS_NODES]);

/*
 * A rule over the square of panels^2 cells: its n = (GAUSS_NODES panels)^2
 * nodes, their mirror directions wi, and weights: the sum of weight f is the
 * integral of f over solid angles of h; times 4 cosine, of wi.
 */
struct normals_rule {
    size_t n;
    double *i[3], *o[3], *weight, *cosine, *h[3];
};
bool normals_rule_create(const facet_material *material, const double wo[3], int panels,
                         struct normals_rule *rule);
void normals_rule_destroy(struct normals_rule *rule);

#endif
