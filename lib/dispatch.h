/* dispatch.h - which compiled kernels serve a tier on the selected instruction set. */
#ifndef FACET_DISPATCH_H
#define FACET_DISPATCH_H

#include "kernel/kernels.h"

const struct facet_kernels *facet_kernels_for(facet_tier tier);

#endif
