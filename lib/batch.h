/*
 * batch.h - a batch on its way to the kernels: arrays of float or double, cut
 * into blocks, converted and padded where the kernels take another type or
 * whole vectors only.  Internal; eval.c and sample.c build on it.
 */
#ifndef FACET_BATCH_H
#define FACET_BATCH_H

#include "brdf.h"
#include "dispatch.h"

/* A block and what it yields stay in the first-level cache. */
enum { BLOCK = 512, LONG_BLOCK = 2048 };

/* An array of either type. */
struct array {
    void *data; /* NULL: none */
    enum kernel_io io;
};

static inline struct array facet_array_at(struct array a, size_t offset)
{
    if (!a.data) return a;
    size_t size = a.io == KERNEL_FLOAT ? sizeof(float) : sizeof(double);
    return (struct array){(char *)a.data + offset * size, a.io};
}

/* The kernels only read what they are given to read. */
static inline struct array facet_doubles(const double *v)
{
    return (struct array){(void *)v, KERNEL_DOUBLE};
}

static inline struct array facet_floats(const float *v)
{
    return (struct array){(void *)v, KERNEL_FLOAT};
}

double facet_array_get(struct array array, size_t index);
/* What no float is near saturates. */
void facet_array_put(struct array array, size_t index, double value);

/* A batch as its caller holds it: out is of the type of wi and wo, or wherever the tier runs on doubles alone; NULL is not computed. */
struct batch {
    const facet_brdf *brdf;
    facet_tier tier;
    facet_sampler sampler; /* whose density PDF and WEIGHT are; AUTO: visible normals' own */
    struct array wi[3], wo[3];
    struct array out[KERNEL_QUANTITY_COUNT][3];
};

/*
 * The sampler a batch is to have: AUTO for one that draws visible normals with
 * their plain density.  UNSUPPORTED where it does not serve the material.
 */
facet_status facet_batch_sampler(const facet_brdf *brdf, facet_sampler sampler,
                                 facet_sampler *density);

/* Evaluates n elements (eval.c). */
void facet_batch_run(const struct batch *batch, size_t n);

/* The tier whose loops serve a material: to look up in draft's precision would be no faster than in fast's. */
facet_tier facet_served_tier(const facet_brdf *brdf, facet_tier tier);

/* The tier that really runs: floats do not hold everything. */
facet_tier facet_batch_tier(const facet_brdf *brdf, facet_tier tier);

/* The kernels that a tier has for callers of this type, and the type that they take. */
const struct facet_kernels *facet_kernels_nearest(facet_tier tier, enum kernel_io caller,
                                                  enum kernel_io *io);

/*
 * n <= BLOCK elements of one array converted to the kernels' type and padded to
 * whole vectors with `filler`; `to` again.
 */
void *facet_stage(struct array from, enum kernel_io io, size_t n, double filler, double *to);

/* n, rounded up to whole vectors. */
size_t facet_padded(size_t n);

/* The other way: n elements from the kernels' array to the caller's, if it has one. */
void facet_unstage(const double *from, enum kernel_io io, size_t n, struct array to);

#endif
