/*
 * square.h - the unit square that a sampler's directions fill, in cells of equal sides, for
 * histograms of what it draws: that of the normals seen from wo (normals.h); of all normals where
 * they need not be seen (NDF; VCAVITY from behind the mean facet), H turned up; of sine^2 and
 * azimuth of wi (COSINE).
 */
#ifndef SQUARE_H
#define SQUARE_H

#include "normals.h"

enum { SQUARE_SIDE = 12, SQUARE_CELLS = SQUARE_SIDE * SQUARE_SIDE };

struct square {
    facet_sampler sampler;
    bool is_all, is_bent; /* is_bent: the density has an edge or a kink within cells */
    struct normals_map map;
    double wo[3];
    /* Where the cells after the first begin, in what needs no arc tangent; infinity beyond. */
    double p_at[16], q_at[16];
};

struct square square_of(facet_sampler sampler, const facet_material *material, const double wo[3]);

/* wi at (p, q); returns its solid angle per unit of the square. */
double square_direction(const struct square *square, double p, double q, double wi[3]);

/* Adds n samples to the counts of their cells, those outside to the last; h NULL: that of wi. */
void square_count(const struct square *square, size_t n, double *const wi[3], double *const h[3],
                  double counts[SQUARE_CELLS + 1]);

#endif
