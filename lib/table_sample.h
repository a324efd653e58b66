/* table_sample.h - sampling of tabulated distributions, in double, outside the kernels (internal). */
#ifndef FACET_TABLE_SAMPLE_H
#define FACET_TABLE_SAMPLE_H

#include "kernel/kernels.h"

/* The draw of a method for a tabulated surface, on doubles; NULL: there is none here. */
kernel_sample_fn *facet_table_draw(facet_sampler sampler);

#endif
