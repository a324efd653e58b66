/*
 * refraction.h - the interface to the compiled kernels of rough dielectrics (refraction.c,
 * facet_transmission.h): one table per (tier, isa), all of arrays of doubles.
 */
#ifndef FACET_REFRACTION_H
#define FACET_REFRACTION_H

#include "kernels.h"

/*
 * Below this W, and above this a = 1 + Lambda(o), masking across the surface hangs on sigmas by
 * more than the float tiers and exact32 have room for: strays (transmission_bounds.c).
 */
#define TRANSMISSION_WEIGHT_LEAST 0x1p-7
#define TRANSMISSION_LAMBDA_MOST 0x1p10

/* The side that wo is on. */
enum { ABOVE, BELOW, SIDES };

/* The surface as wo sees it from one side. */
struct kernel_side {
    double index;              /* n = inner/outer */
    double excess, excess_low; /* n^2 - 1 and what its double lacks */
    double scale;              /* of what is transmitted: 1 or 1/n^2 */
};

/*
 * What there is to ask for.  D and what follows are of the normal that refracts wo into wi (0 where
 * there is none) and of wo and wi turned up; all or none.
 */
enum refraction_output {
    REFRACTION_FR,
    REFRACTION_FR_COS,
    REFRACTION_PDF,
    REFRACTION_WEIGHT,  /* fr cos theta_i / pdf */
    REFRACTION_MASKING, /* W, across */
    REFRACTION_FRESNEL, /* of the reflection */
    REFRACTION_D,
    REFRACTION_F,
    REFRACTION_COSINE, /* |wo.h| */
    REFRACTION_SIGMA_O,
    REFRACTION_SIGMA_I,
    REFRACTION_OUTPUT_COUNT
};

/* One batch. */
struct kernel_refraction {
    const double *wi[3], *wo[3];
    double eta;
    struct kernel_side side[SIDES];
    bool is_correlated;
    /* Of samples: density of the lobe that was chosen, negative where it is the transmitted one; NULL: of wi as it is. */
    const double *chosen;
    double *out[REFRACTION_OUTPUT_COUNT]; /* NULL: not computed */
};

/* Visible normals h of wo turned up with their D(h)/(4 sigma(wo)), and what reflects there, turned up with wo. */
struct kernel_normals {
    const double *h[3], *pdf, *u; /* u: reflects where it is below F */
    double *wi[3];  /* in: as reflected; out: of the lobe that was chosen, turned back */
    double *chosen; /* as kernel_refraction's; precise alone */
};

/* n is a multiple of KERNEL_LANES.  True if some result is not a number, as kernel_eval_fn. */
typedef bool kernel_refract_fn(const struct kernel_surface *surface,
                               const struct kernel_refraction *job, size_t n);

struct facet_refractions {
    kernel_refract_fn *eval[FACET_NDF_COUNT];
    /* Reads wo and the sides of the job. */
    void (*choose)(const struct kernel_refraction *job, const struct kernel_normals *normals,
                   size_t n);
    /* Gamma(1 + a) Gamma(1 + b) / Gamma(1 + a + b) (opposite.h). */
    void (*opposite)(const double *a, const double *b, double *to, size_t n);
    /* 1 - F of normals with cosines c = wo.h and g = n |wi.h|. */
    void (*transmittance)(double index, const double *c, const double *g, double *to, size_t n);
};

#endif
