/*
 * slope_rays.h - draws from a table over the azimuth: the azimuth of a normal, then its slope along
 * that ray (internal).
 */
#ifndef FACET_SLOPE_RAYS_H
#define FACET_SLOPE_RAYS_H

#include "facet.h"
#include "kernel/kernels.h"

/* Integrals of P r dr and P r^2 dr from 0 along rays of azimuth pi j/rows, up to the start of each
 * cell and to the end. */
struct slope_rays {
    size_t rows, cells;
    double *mass, *moment; /* [row][cells + 1] */
    double numbers[];
};

/* NULL: out of memory. */
struct slope_rays *facet_slope_rays_create(const struct kernel_table *table, size_t rows);

enum { SLOPE_RAYS_MAX = 512 }; /* slope_table_turned.c makes no more rows */

/*
 * The normals seen from a direction: density (c + s r cos(azimuth - psi))+ P(r, azimuth), c > 0.
 * The azimuth's CDF is tabulated at rows all around, cubic between; at the azimuth, the masses of
 * cells are cubic between rows, and within its cell the density is the table's.
 */
struct slope_ray_view {
    const struct kernel_table *table;
    const struct slope_rays *rays;
    double c, s, psi;
    double density[2 * SLOPE_RAYS_MAX], below[2 * SLOPE_RAYS_MAX + 1];
};

void facet_slope_ray_view(const struct kernel_table *table, const struct slope_rays *rays, double c,
                          double s, double psi, struct slope_ray_view *view);

/* A standard normal, not of length 1: (radius cos, radius sin, rest), and exp(log_q) there. */
struct slope_ray_place {
    double azimuth, u, q;
};
struct slope_ray_place facet_slope_ray_draw(const struct slope_ray_view *view, double u1,
                                            double u2);

#endif
