/*
 * facet_table.h - tabulated slope distributions, radial or over the azimuth as well.
 *
 * The table holds log D(theta), D the normal distribution at alpha = 1, at n
 * nodes uniform in u = tan theta / (scale + tan theta), u = 0 .. 1 (the last
 * node is the horizon).  Between them log(P (1 + tan theta/scale)^4), P = D cos^4
 * theta the slope density, is interpolated: finite at the horizon as D is, and smooth
 * where D is not (tan theta about 1 in a narrow table).  Nodes on a smooth curve (sixth
 * differences of 1e-2 or less) are met by polynomials of degree 7: D of a Beckmann
 * surface between 91 nodes is right to 2e-7 down to 1e-4 of its peak.  Others by a
 * cubic spline that does not ring.
 */
#ifndef FACET_TABLE_H
#define FACET_TABLE_H

#include "facet.h"

#ifdef __cplusplus
extern "C" {
#endif

#define FACET_TABLE_NODES_MIN 4
#define FACET_TABLE_NODES_MAX 4096

/*
 * Build a table: scale in [1e-8, 1e4], log_d finite or very negative (-700 and
 * below count as D = 0).  The table is normalised: integral of D cos theta = 1.
 */
facet_status facet_slope_table_create(double scale, const double *log_d, size_t n,
                                      facet_slope_table **table);
void facet_slope_table_destroy(facet_slope_table *table); /* NULL is allowed */
/*
 * Makes what draft and fast work on, once.  Else their first evaluation does, and where memory
 * ran out exact32 serves in their place.  False: out of memory.
 */
bool facet_slope_table_has_floats(const facet_slope_table *table);

#define FACET_TABLE_TURNS_MIN 4
#define FACET_TABLE_TURNS_MAX 180
#define FACET_TURNED_NODES_MAX 16384 /* of all rows */
#define FACET_TURNED_SCALE_FAR 64 /* a scale of more mean slopes is BAD_TABLE: it tells no sigma */

/*
 * A distribution that is not radial: turns rows of n such nodes, row j at the azimuth pi j/turns of
 * the slope (of the normal, or of its opposite).  P(-x) = P(x), so that half a turn is all of it
 * and the mean slope is (0, 0); the material's roughness stretches and turns it, as it does a
 * radial table.  The first node is the normal, where all rows must agree.  Along the azimuth it is
 * interpolated as along u.
 *
 * sigma is told from behind as well, to 1e-30 of what is in front: to a relative error that grows with
 * the depth (facet_depth_error), for far out a table says little about D between its nodes.
 *
 * Samples of TABLE and NDF: u1 is the azimuth, u2 the slope along it; their density is the pdf to the
 * error of interpolated CDFs, which is 6e-7 in those and 2e-6 in the density of smooth tables
 * (ellipses of axes 1 : 5).
 *
 * Takes 0.1 to 0.6 s, with nodes at random up to 3 s; watch: asked every 30 ms or sooner.
 */
facet_status facet_slope_table_create_turned(double scale, const double *log_d, size_t n,
                                             size_t turns, const facet_watch *watch,
                                             facet_slope_table **table);

#ifdef __cplusplus
}
#endif
#endif
