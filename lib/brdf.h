/* brdf.h - a prepared material: what evaluation, sampling and bounds share. */
#ifndef FACET_BRDF_H
#define FACET_BRDF_H

#include "kernel/kernels.h"

struct facet_brdf {
    facet_material material; /* the Fresnel term's pointers are not used */
    struct kernel_surface surface;
    enum kernel_shape shape;
    enum kernel_masking masking;
    facet_sampler automatic; /* what AUTO stands for */
    size_t channels;
    bool floats_hold; /* the float kernels' intermediate values stay in range */
    double depth;     /* facet_brdf_expect's */
    struct kernel_fresnel fresnel[3];
    double tables[]; /* the Fresnel table's nodes and values */
};

/* z - x slope_x - y slope_y, which cancels, right to rounding: a direction's cosine with the mean facet times its length. */
double facet_mean_cosine(const struct kernel_surface *surface, double x, double y, double z);

#endif
