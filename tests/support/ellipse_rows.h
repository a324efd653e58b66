/*
 * ellipse_rows.h - GGX and Beckmann ellipses as slope tables over the azimuth, for tests.
 */
#ifndef ELLIPSE_ROWS_H
#define ELLIPSE_ROWS_H

#include "facet_table.h"

double ellipse_rows_scale(const facet_roughness *ellipse);

/* At ellipse_rows_scale; NULL: refused. */
facet_slope_table *ellipse_rows(facet_ndf ndf, const facet_roughness *ellipse, size_t n,
                                size_t turns);

#endif
