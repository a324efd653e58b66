#include "batch.h"

#include <float.h>

double facet_array_get(struct array a, size_t index)
{
    return a.io == KERNEL_FLOAT ? (double)((const float *)a.data)[index]
                                : ((const double *)a.data)[index];
}

void facet_array_put(struct array a, size_t index, double value)
{
    if (a.io == KERNEL_DOUBLE)
        ((double *)a.data)[index] = value;
    else
        ((float *)a.data)[index] = value > FLT_MAX ? FLT_MAX : (float)value;
}

const struct facet_kernels *facet_kernels_nearest(facet_tier tier, enum kernel_io caller,
                                                  enum kernel_io *io)
{
    enum kernel_io other = caller == KERNEL_FLOAT ? KERNEL_DOUBLE : KERNEL_FLOAT;
    const struct facet_kernels *kernels = facet_kernels_for(tier, caller);
    *io = kernels ? caller : other;
    return kernels ? kernels : facet_kernels_for(tier, other);
}

size_t facet_padded(size_t n)
{
    return (n + KERNEL_LANES - 1) / KERNEL_LANES * KERNEL_LANES;
}

void *facet_stage(struct array from, enum kernel_io io, size_t n, double filler, double *to)
{
    struct array out = {to, io};
    for (size_t k = 0; k < n; k++) facet_array_put(out, k, facet_array_get(from, k));
    for (size_t k = n; k < facet_padded(n); k++) facet_array_put(out, k, filler);
    return to;
}

void facet_unstage(const double *from, enum kernel_io io, size_t n, struct array to)
{
    struct array in = {(void *)from, io};
    for (size_t k = 0; to.data && k < n; k++) facet_array_put(to, k, facet_array_get(in, k));
}
