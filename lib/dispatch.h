/* dispatch.h - which compiled kernels serve a tier on the selected instruction set. */
#ifndef FACET_DISPATCH_H
#define FACET_DISPATCH_H

#include "kernel/kernels.h"
#include "kernel/refraction.h"

/* The element type of a kernel's arrays. */
enum kernel_io { KERNEL_FLOAT, KERNEL_DOUBLE, KERNEL_IO_COUNT };

/* NULL where the tier has no kernels for that type. */
const struct facet_kernels *facet_kernels_for(facet_tier tier, enum kernel_io io);
const struct facet_samplers *facet_samplers_for(facet_tier tier, enum kernel_io io);
/* Of doubles; every tier has them. */
const struct facet_refractions *facet_refractions_for(facet_tier tier);

#endif
