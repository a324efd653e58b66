/*
 * facet_table.h - tabulated radial slope distributions.
 *
 * The table holds log D(theta), D the normal distribution at alpha = 1, at n
 * nodes uniform in u = tan theta / (scale + tan theta), u = 0 .. 1 (the last
 * node is the horizon).  Between the nodes log(P (1 + tan theta/scale)^4), P =
 * D cos^4 theta the slope density, is a cubic spline in u: finite at the horizon
 * as D is, and smooth where D is not (tan theta about 1 in a narrow table).
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

#ifdef __cplusplus
}
#endif
#endif
