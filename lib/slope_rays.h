/*
 * slope_rays.h - draws from a table over the azimuth: the azimuth of a normal, then its slope along
 * that ray (internal).
 */
#ifndef FACET_SLOPE_RAYS_H
#define FACET_SLOPE_RAYS_H

#include "facet.h"
#include "kernel/kernels.h"

/* What is on a ray from u on, with x for u: the integrals of x exp(log_q) dx and x (x - u) exp(log_q)
 * dx.  That of (r - rho) P r dr from rho on is scale^3 g/(1 - u). */
struct slope_tail {
    double n, g;
};
/* From u1 down to u0, inside a cell of log_q; azimuth in units of pi, in [0, 1]. */
struct slope_tail facet_slope_tail_add(const struct kernel_table *table, double azimuth, double u0,
                                       double u1, struct slope_tail beyond);

/* Along rays of azimuth pi j/rows: integrals of P r dr and P r^2 dr from 0 up to the start of each
 * cell and to the end, and what is beyond. */
struct slope_rays {
    size_t rows, cells;
    double *mass, *moment; /* [row][cells + 1] */
    struct slope_tail *tail;
    double numbers[];
};

/* NULL: out of memory. */
struct slope_rays *facet_slope_rays_create(const struct kernel_table *table, size_t rows);

enum { SLOPE_RAYS_MAX = 512 }; /* slope_table_turned.c makes no more rows */

/*
 * The normals seen from a direction: density (c + s r cos(azimuth - psi))+ P(r, azimuth).
 * The azimuth's CDF is tabulated at rows all around, of degree 5 between; at the azimuth, the masses
 * of cells are so between rows, and within its cell the density is the table's.  Seen from behind,
 * c <= 0, a ray falls too steeply for that: its cells are summed.
 */
struct slope_ray_view {
    const struct kernel_table *table;
    const struct slope_rays *rays;
    double c, s, psi;
    double density[2 * SLOPE_RAYS_MAX],
        below[2 * SLOPE_RAYS_MAX + 1]; /* 0 at the end: nothing is seen */
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
