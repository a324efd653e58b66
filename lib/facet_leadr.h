/*
 * facet_leadr.h - slope moments (LEAN/LEADR): what a displaced surface looks
 * like from far away.
 *
 * Moments are linear, so they filter: average them over texels, then turn the
 * mean into a Beckmann roughness (Dupuy 2015, chapter 3).  Slopes are
 * x~ = dz/dx, y~ = dz/dy of the height z (the normal is (-x~, -y~, 1)).
 */
#ifndef FACET_LEADR_H
#define FACET_LEADR_H

#include "facet.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Moments ----------------------------------------------------------------- */

/* e1 = E[x~], e2 = E[y~], e3 = E[x~^2], e4 = E[y~^2], e5 = E[x~ y~]. */
typedef struct facet_moments {
    double e1, e2, e3, e4, e5;
} facet_moments;

/*
 * Beckmann roughness to moments (Dupuy eqs. 3.5-3.9): E3 = alpha_x^2/2 +
 * E1^2 and so on.  Exact but for rounding.
 */
facet_moments facet_moments_from_roughness(const facet_roughness *roughness);

/*
 * Moments to Beckmann roughness.  The covariance must be positive: where it is
 * not, or where a principal alpha lies below alpha_floor, the principal alphas
 * are raised to alpha_floor (the mean and the axes stay; rho is never clamped)
 * and *floored is set.  An ellipse too thin for FACET_RHO_MAX is fattened to
 * alpha_2 = 1e-6 alpha_1, which also counts as floored.
 * alpha_floor 0 refuses instead: BAD_ALPHA for a variance that is not positive,
 * BAD_RHO for an ellipse too thin.  floored may be NULL.
 */
facet_status facet_moments_to_roughness(const facet_moments *moments, double alpha_floor,
                                        facet_roughness *roughness, bool *floored);

/* Moments of the sum of two independent processes, such as a base roughness below a map. */
facet_moments facet_moments_add(const facet_moments *a, const facet_moments *b);

/* Moments after the heights are multiplied by beta. */
facet_moments facet_moments_scale(const facet_moments *moments, double beta);

/*
 * Moments after a change of parametrisation (Dupuy section 3.4): given the
 * slopes along (u, v), those along (x, y), where
 * jacobian = { du/dx, du/dy, dv/dx, dv/dy }.
 */
facet_moments facet_moments_transform(const facet_moments *moments, const double jacobian[4]);

/* ---- Height maps ---------------------------------------------------------------- */

/* Rows from the top; heights in any unit, finite. */
typedef struct facet_height_map {
    const float *heights; /* width x height, borrowed */
    size_t width, height;
} facet_height_map;

#define FACET_MAP_SIDE_MAX 16384
#define FACET_MAP_PIXELS_MAX ((size_t)4096 * 4096)
#define FACET_MAP_LEVELS_MAX 15

/*
 * How slopes come from heights: the stencil is a model of the surface.
 * CENTRAL  (z[p+1] - z[p-1]) / 2 at each texel (Dupuy section 3.4); blind to
 *          the finest waves, so it sees the least variance.
 * FORWARD  z[p+1] - z[p] at each texel.
 * BILINEAR the exact moments over the cell [p, p+1] x [q, q+1] of the bilinear
 *          surface through the texels, what a renderer displaces.
 */
typedef enum facet_stencil {
    FACET_CENTRAL,
    FACET_FORWARD,
    FACET_BILINEAR,
    FACET_STENCIL_COUNT
} facet_stencil;

/*
 * What lies beyond the edge.
 * PERIODIC the opposite edge.
 * CLAMP    the continuation by the parabola through the last three texels, so
 *          that central differences become one-sided ones of second order and a
 *          plane keeps its slope everywhere.
 * MIRROR   the map reflected at its edge: texel -1 is texel 0, n is n-1.
 * TRIM     nothing: only texels whose whole stencil lies in the map are kept.
 *          The result is smaller by 2 (CENTRAL) or 1 (the others) each way.
 */
typedef enum facet_border {
    FACET_PERIODIC,
    FACET_CLAMP,
    FACET_MIRROR,
    FACET_TRIM,
    FACET_BORDER_COUNT
} facet_border;

/* RAW: E1..E5.  CENTRED: E1, E2, then the covariance V11, V22, V12 (E3 - E1^2 ...). */
typedef enum facet_moment_form {
    FACET_RAW,
    FACET_CENTRED,
    FACET_MOMENT_FORM_COUNT
} facet_moment_form;

/* The type the planes will be stored in; they are rounded to it. */
typedef enum facet_storage { FACET_FLOAT, FACET_HALF, FACET_STORAGE_COUNT } facet_storage;

typedef struct facet_leadr_options {
    facet_stencil stencil;
    facet_border border;
    bool y_up;            /* +y points to row 0; false: y grows with the row */
    double scale;         /* multiplies the heights */
    double texel;         /* edge of a (square) texel, in the unit of the scaled heights, > 0 */
    double base_alpha;    /* isotropic Beckmann roughness below the map, added as a process; >= 0 */
    facet_storage storage;
    facet_moment_form form;
} facet_leadr_options;

/* What was stored against what was computed (in double), over one level. */
typedef struct facet_leadr_loss {
    double variance; /* mean over the level of trace Cov, as computed */
    double stored;   /* the same, from the rounded planes */
    double worst;    /* largest relative error of a texel's trace Cov, where it is not 0 */
    size_t lost;     /* texels whose stored covariance has no positive trace though it has one */
} facet_leadr_loss;

typedef struct facet_leadr_level {
    size_t width, height;
    const float *plane[5]; /* in the form and type asked for, base roughness included */
    facet_moments mean;    /* mean over the level, from the unrounded moments, base included */
    facet_leadr_loss loss;
} facet_leadr_level;

/* Heights that are not finite: how many, and where the first is. */
typedef struct facet_map_flaw {
    size_t count, column, row;
} facet_map_flaw;

/* A pyramid: level 0 has a texel per height (TRIM: fewer), the last level is 1 x 1. */
typedef struct facet_leadr facet_leadr;

/*
 * Filter a height map.  Level i is max(1, width >> i) x max(1, height >> i);
 * each of its texels is the mean of its footprint of level 0 (texels that
 * straddle two footprints are split by area), summed in double.
 * Memory: 27 bytes per texel for the planes, 13 more while working.
 * BAD_SIZE: sides or product beyond the limits above, or too small for TRIM.
 * BAD_DATA: heights that are not finite (*flaw, which may be NULL, says where),
 * or slopes too steep for the storage type (flaw->count is 0 then).
 */
facet_status facet_leadr_create(const facet_height_map *map, const facet_leadr_options *options,
                                const facet_watch *watch, facet_map_flaw *flaw,
                                facet_leadr **leadr);
void facet_leadr_destroy(facet_leadr *leadr); /* NULL is allowed */

size_t facet_leadr_level_count(const facet_leadr *leadr);
const facet_leadr_level *facet_leadr_level_at(const facet_leadr *leadr, size_t level);

/* Moments of the whole map for a stencil, without base roughness: to compare stencils. */
facet_status facet_leadr_mean(const facet_height_map *map, const facet_leadr_options *options,
                              const facet_watch *watch, facet_moments *mean);

#ifdef __cplusplus
}
#endif
#endif
