/*
 * albedo_ray.h - where the integrand of an albedo is smooth (internal).
 *
 * The variable of integration is the standard slope (x, y) = r (cos phi, sin phi)
 * of the micronormal h that reflects wo into wi.  With the surface's slopes s and
 *   q = c - a x - b y = (wo.h)/h_z        N = 1 + |s|^2 = 1/h_z^2
 * (c, a, b of kernel/surface.h) everything that bends is a polynomial along a ray phi:
 * wi = 2 q/N (-s, 1) - wo stands on the horizon where 2 q = N z_o, which is the
 * circle of centre -(x_o, y_o)/z_o and radius 1/z_o; cos theta_d = q/sqrt N.
 */
#ifndef FACET_ALBEDO_RAY_H
#define FACET_ALBEDO_RAY_H

#include "facet.h"

/* A direction of view against the surface. */
struct albedo_view {
    double x, y, z;
    double a, b, c;
};

struct albedo_surface {
    facet_roughness roughness;
    double kappa_alpha_y, rho_alpha_y, alpha_1;
    bool is_rough;   /* wi near the pole is a cusp of the masking: its width is 1/alpha_1 */
    bool is_thin;    /* the horizon is a long ellipse in standard slopes */
    bool is_careful; /* break at every feature there may be, however small */
};

/* One ray: q = c - g r, N = n[0] + n[1] r + n[2] r^2, s = mean + (dx, dy) r. */
struct albedo_ray {
    double cosine, sine, dx, dy, c, g, n[3];
};

struct albedo_view facet_albedo_view_of(const struct albedo_surface *surface, double x, double y,
                                        double z);
struct albedo_ray facet_albedo_ray_of(const struct albedo_surface *surface,
                                      const struct albedo_view *view, double phi);

/* The part of the ray whose wi lies above the horizon; false: none. */
bool facet_albedo_ray_lit(const struct albedo_ray *ray, const struct albedo_view *view, double *low,
                          double *high);

/* Where theta_d has this cosine: at most 2 radii; returns how many (some may be negative). */
size_t facet_albedo_ray_cosine(const struct albedo_ray *ray, double cosine_squared, double r[2]);
/* Where wi stands on the edge of the mean facet, c_i = 0: at most 2. */
size_t facet_albedo_ray_edge(const struct albedo_ray *ray, double r[2]);
/* Where the ray refracted into an index n < 1 times wo's grazes the horizon, excess = n^2 - 1: at most 2. */
size_t facet_albedo_ray_refracted(const struct albedo_ray *ray, const struct albedo_view *view,
                                  double excess, double r[2]);
/* Where the minimum of the V-cavities' G changes over: at most 5. */
size_t facet_albedo_ray_vgroove(const struct albedo_ray *ray, double r[5]);

/*
 * Azimuths at which the integral over a ray bends, as a function of the azimuth: the plane of wo, the axes of
 * the horizon's ellipse, rays that touch it, and the ray through the h of wi = pole.  Ascending
 * from the first, over one turn (or half of one, if the other half is its mirror image).
 */
enum { ALBEDO_AZIMUTHS_MAX = 96 };
size_t facet_albedo_azimuths(const struct albedo_surface *surface, const struct albedo_view *view,
                             bool half, double phi[ALBEDO_AZIMUTHS_MAX]);
/* The standard slope of the h that reflects wo to the pole. */
double facet_albedo_pole(const struct albedo_surface *surface, const struct albedo_view *view,
                         double *phi);

#endif
