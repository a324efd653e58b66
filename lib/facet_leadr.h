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

/* Covariance of the slopes: central second moments. */
typedef struct facet_covariance {
    double xx, yy, xy;
} facet_covariance;

/* E3 - E1^2 and so on, one rounding each (fma): what E3 itself lost is all that is missing. */
facet_covariance facet_covariance_from_moments(const facet_moments *moments);
facet_covariance facet_covariance_from_roughness(const facet_roughness *roughness);
/* The Beckmann roughness of a positive covariance, with its lows; BAD_ALPHA, BAD_RHO where out of range. */
facet_status facet_roughness_from_covariance(const facet_covariance *covariance, double slope_x,
                                             double slope_y, facet_roughness *roughness);
/* The larger eigenvalue: half the square of the larger principal alpha. */
double facet_covariance_largest(const facet_covariance *covariance);

/*
 * The covariance after facet_moments_scale by beta and facet_moments_transform by
 * the jacobian, without forming second moments.  Of each element, *magnitude (may be
 * NULL) is the sum of the absolute values of its terms: the rounding error of an
 * element is at most 4 DBL_EPSILON times that (8 roundings of half of it each).
 */
facet_covariance facet_covariance_transform(const facet_covariance *covariance, double beta,
                                            const double jacobian[4], facet_covariance *magnitude);

/*
 * alpha of the Beckmann surface nearest to a GGX surface of alpha 1, by the squared
 * difference of their slope densities.  Affine maps keep the ratio, so it serves
 * every alpha, anisotropic ones too.  (GGX slopes have no variance, so a GGX
 * roughness enters moments by this equivalent.)  The root of the derivative; a test
 * finds it again by quadrature.
 */
#define FACET_BECKMANN_OF_GGX 1.113287129283

/*
 * Moments after a change of parametrisation (Dupuy section 3.4): given the
 * slopes along (u, v), those along (x, y), where
 * jacobian = { du/dx, du/dy, dv/dx, dv/dy }.
 */
facet_moments facet_moments_transform(const facet_moments *moments, const double jacobian[4]);

/* ---- Maps ---------------------------------------------------------------------------- */

#define FACET_MAP_SIDE_MAX 131072
#define FACET_MAP_PIXELS_MAX ((size_t)8192 * 8192)
#define FACET_MAP_LEVELS_MAX 18

/* What the rows of a map hold: heights, or slopes (x~ of every texel, then y~ of every texel). */
typedef enum facet_map_kind { FACET_HEIGHTS, FACET_SLOPES, FACET_MAP_KIND_COUNT } facet_map_kind;

/*
 * A map, row by row from the top; heights in any unit.  row() may use one buffer
 * for every row.  It is asked for the last row first where the border is periodic,
 * then once for each row in order.
 */
typedef struct facet_map_source {
    facet_map_kind kind;
    size_t width, height;
    const float *(*row)(void *user, size_t row);
    void *user;
} facet_map_source;

/* Heights in memory, rows from the top. */
typedef struct facet_height_map {
    const float *heights; /* width x height, borrowed */
    size_t width, height;
} facet_height_map;

/*
 * How slopes come from heights: the stencil is a model of the surface.
 * CENTRAL  (z[p+1] - z[p-1]) / 2 at each texel (Dupuy section 3.4); blind to
 *          the finest waves, so it sees the least variance.
 * FORWARD  z[p+1] - z[p] at each texel.
 * BILINEAR the exact moments over the cell [p, p+1] x [q, q+1] of the bilinear
 *          surface through the texels, what a renderer displaces.
 * The last two describe the cell between texels: half a texel right of and below
 * the texel they are stored at.
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

/*
 * LEADR     five planes: means and second moments.
 * CLEAN     three: means, and of an isotropic lobe alpha^2 = V11 + V22, the mean of
 *           the squared principal alphas (Dupuy eq. 3.18, with x_h for x_n).
 * CLEAN_MAX the same with the larger principal alpha, alpha^2 = 2 max eigenvalue.
 */
typedef enum facet_moment_model {
    FACET_LEADR,
    FACET_CLEAN,
    FACET_CLEAN_MAX,
    FACET_MOMENT_MODEL_COUNT
} facet_moment_model;

enum { FACET_PLANES_MAX = 5 };

/*
 * RAW      E1..E5; of CLEAN E1, E2, E3 = alpha^2 + E1^2 + E2^2.
 * CENTRED  E1, E2, then the covariance V11, V22, V12; of CLEAN alpha^2.
 */
typedef enum facet_moment_form {
    FACET_RAW,
    FACET_CENTRED,
    FACET_MOMENT_FORM_COUNT
} facet_moment_form;

/* The type the planes will be stored in; they are rounded to it. */
typedef enum facet_storage { FACET_FLOAT, FACET_HALF, FACET_STORAGE_COUNT } facet_storage;

typedef struct facet_leadr_options {
    facet_stencil stencil; /* these two of heights only */
    facet_border border;
    bool y_up;             /* heights: +y points to row 0; false: y grows with the row */
    double scale;          /* multiplies the heights, or the slopes */
    double texel;          /* edge of a (square) texel, in the unit of the scaled heights, > 0 */
    facet_covariance base; /* of a roughness below the map, added as a process; 0: none */
    facet_storage storage;
    facet_moment_form form;
    facet_moment_model model;
} facet_leadr_options;

/* What was stored against what was computed (in double), over one level. */
typedef struct facet_leadr_loss {
    double variance; /* mean over the level of trace Cov (CLEAN: alpha^2), as computed */
    double stored;   /* the same, from the rounded planes */
    double worst;    /* largest relative error of a texel's variance, where it is not 0 */
    size_t lost;     /* texels whose stored variance is not positive though it has one */
} facet_leadr_loss;

/* Values that are not finite (of slopes also: not where a surface could be): how many, and where
 * the first is. */
typedef struct facet_map_flaw {
    size_t count, column, row;
} facet_map_flaw;

/* ---- Filter ------------------------------------------------------------------------------ */

/* Level 0 has a texel per texel of the map (TRIM: fewer); the last level is 1 x 1. */
typedef struct facet_leadr_summary {
    size_t level_count, plane_count;
    size_t width[FACET_MAP_LEVELS_MAX], height[FACET_MAP_LEVELS_MAX];
    facet_leadr_loss loss[FACET_MAP_LEVELS_MAX];
    facet_moments mean; /* of the whole map, unrounded, base included */
    /* Heights: what each stencil sees of the whole map, base not included. */
    facet_moments by_stencil[FACET_STENCIL_COUNT];
    bool has_stencil[FACET_STENCIL_COUNT]; /* a trimmed map may hold one and not another */
    facet_map_flaw flaw;
} facet_leadr_summary;

/*
 * Where finished rows go: those of one level in order, levels interleaved, a row
 * valid during the call.  False ends the work with FACET_NO_MEMORY.
 */
typedef struct facet_leadr_sink {
    bool (*row)(void *user, size_t level, size_t row, const float *const plane[FACET_PLANES_MAX]);
    void *user;
    /*
     * NULL, or: begin is told of `count` rows of a level, from `first` on, that come next, in any
     * order and on any thread, and then end.  They lie within one multiple of FACET_SINK_ROWS.
     */
    bool (*begin)(void *user, size_t level, size_t first, size_t count);
    bool (*end)(void *user, size_t level, size_t first, size_t count);
} facet_leadr_sink;

enum { FACET_SINK_ROWS = 64 };

/*
 * Others who help: runs task(arg, 0) .. task(arg, count - 1), on any threads, and
 * returns when all have ended.
 */
typedef struct facet_crew {
    void (*share)(void *user, size_t count, void (*task)(void *arg, size_t index), void *arg);
    void *user;
} facet_crew;

/* The sizes of the levels a map will have: fills level_count, plane_count, width, height. */
facet_status facet_leadr_sizes(const facet_map_source *source, const facet_leadr_options *options,
                               facet_leadr_summary *summary);

/*
 * Filter a map in one pass over its rows, in memory for a few rows (1/256 of them).  Level i is
 * max(1, width >> i) x max(1, height >> i); each of its texels is the mean of its
 * footprint of level 0 (texels that straddle two footprints are split by area),
 * merged in double in central form by the parallel-axis rule, so that no variance
 * is ever a difference of large numbers.  The result does not depend on the side
 * from which the map is read: mirrored central differences give mirrored levels,
 * bit for bit; nor on the crew, which may be NULL: nobody helps.  source, and a
 * sink without begin, are called by the caller's thread alone.  sink may be NULL:
 * only the summary is wanted.
 * BAD_SIZE: sides or product beyond the limits above, or too small for TRIM.
 * BAD_DATA: values that are not finite (summary->flaw says where), or slopes too
 * steep for the storage type (flaw.count is 0 then).
 */
facet_status facet_leadr_filter(const facet_map_source *source, const facet_leadr_options *options,
                                const facet_watch *watch, const facet_crew *crew,
                                const facet_leadr_sink *sink, facet_leadr_summary *summary);

/* ---- The same, kept in memory -------------------------------------------------------------- */

typedef struct facet_leadr_level {
    size_t width, height;
    const float *plane[FACET_PLANES_MAX]; /* in the form, model and type asked for; NULL past
                                             plane_count */
    facet_leadr_loss loss;
} facet_leadr_level;

typedef struct facet_leadr facet_leadr;

/* Planes take 27 bytes per texel.  flaw may be NULL. */
facet_status facet_leadr_create(const facet_height_map *map, const facet_leadr_options *options,
                                const facet_watch *watch, facet_map_flaw *flaw,
                                facet_leadr **leadr);
void facet_leadr_destroy(facet_leadr *leadr); /* NULL is allowed */

size_t facet_leadr_level_count(const facet_leadr *leadr);
const facet_leadr_level *facet_leadr_level_at(const facet_leadr *leadr, size_t level);
const facet_leadr_summary *facet_leadr_summary_of(const facet_leadr *leadr);

/*
 * The moments one stored texel stands for, of any form and model, from its
 * plane_count values; of CLEAN those of an isotropic lobe.
 */
facet_moments facet_moments_of_texel(const float *values, facet_moment_form form,
                                     facet_moment_model model);

#ifdef __cplusplus
}
#endif
#endif
