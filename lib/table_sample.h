/* table_sample.h - sampling of tabulated distributions, in double, outside the kernels (internal). */
#ifndef FACET_TABLE_SAMPLE_H
#define FACET_TABLE_SAMPLE_H

#include "kernel/kernels.h"

/* The draw of a method for a surface tabulated radially or over the azimuth, on doubles; NULL: there is none here. */
kernel_sample_fn *facet_table_draw(facet_sampler sampler, bool is_turned);

#endif
