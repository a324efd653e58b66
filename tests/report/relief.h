/*
 * relief.h - height fields and what they look like by brute force.
 *
 * A relief is the periodic bilinear surface through its heights, texel 1: what a
 * renderer displaces.  Its radiance is summed over points of the surface, each seen
 * and lit or not by a march over the heights, and shaded by a rough surface below.
 * No moment, slope distribution or masking function of the service enters.
 */
#ifndef RELIEF_H
#define RELIEF_H

#include <stdbool.h>
#include <stddef.h>

struct relief {
    size_t side; /* a square, side x side texels */
    float *z;
    double highest;
};

/* Gaussian heights of these correlation lengths (texels) and rms slope along the steeper axis. */
bool relief_gaussian(struct relief *relief, size_t side, double length_x, double length_y,
                     double rms_slope, unsigned long long seed);
/* A square out of measured heights, in units of its texel; its edges do not meet, so look inside. */
bool relief_measured(struct relief *relief, const char *path, double texel, size_t side,
                     double scale);
void relief_free(struct relief *relief);

/* The BRDF below: f(wi, wo) of directions in the frame whose z is the normal. */
struct base {
    double (*f)(const void *data, const double wi[3], const double wo[3]);
    const void *data;
};

/* Beckmann with height-correlated Smith masking; data: const double *alpha. */
double base_beckmann(const void *data, const double wi[3], const double wo[3]);

enum { RELIEF_DIRECTIONS = 24 };

struct view {
    size_t i, o; /* into directions */
};

/*
 * f_r cos(theta_i) that the square [x, x + size) x [y, y + size) shows, for each view:
 * points x points samples, each weighing the area it shows to the viewer.  A point is
 * hidden or shadowed by what lies within `size` of it, which filtering takes away; what
 * the rest of the relief hides a renderer still sees.  NaN where nothing is seen.
 */
void relief_radiance(const struct relief *relief, const struct base *base, double x, double y,
                     double size, int points, const double directions[][3], size_t direction_count,
                     const struct view *views, size_t view_count, double *radiance);

#endif
