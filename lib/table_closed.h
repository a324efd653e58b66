/*
 * table_closed.h - GGX and Beckmann sampled through tables of themselves (Heitz & d'Eon 2014, supplement, section 5): the
 * sampler TABLE of a closed distribution (internal).
 */
#ifndef FACET_TABLE_CLOSED_H
#define FACET_TABLE_CLOSED_H

#include "batch.h"
#include "facet_table.h"

/* What the D of such a table is off by, relative, where a density passes FACET_FLOOR; far: behind where a view's sigma does. */
double facet_table_density_error(facet_ndf ndf, bool far);

/* The table at alpha = 1, built when first asked for and kept; NULL: no memory. */
const facet_slope_table *facet_table_of(facet_ndf ndf);

/* The table that sigma is looked up in, if it is: the material's, or with sampler TABLE its own. */
const facet_slope_table *facet_table_behind(const facet_brdf *brdf, facet_sampler sampler);

/* The same surface with that table for its distribution; false: no memory. */
bool facet_table_twin(const facet_brdf *brdf, facet_brdf *twin);

/* PDF and WEIGHT of a batch whose samples were drawn so. */
void facet_table_weigh(const struct batch *batch, size_t n);

#endif
