/*
 * kernels.h - the only interface to the compiled kernels.
 *
 * kernel.c is compiled once per (tier, isa) and exports one table of these;
 * everything else in it is static, and it calls nothing.
 */
#ifndef FACET_KERNELS_H
#define FACET_KERNELS_H

#include "facet.h"

/* Piecewise cubic on uniform cells of [0, 1]: c[4 i + j] multiplies t^j, t in [0, 1] local to cell i. */
struct kernel_cubic {
    const double *c;
    size_t cells;
};

/*
 * A tabulated radial slope distribution at alpha = 1.  With r = tan theta and b = slope_scale,
 *   u = r / (b + r)              P(r) = exp(log_q(u)) (1 - u)^4,  D(theta) = P (1 + r^2)^2,
 * free of division by h_z: with R the length of the standard slopes times H_z,
 *   u = R / (b H_z + R)          D = |H|^4 exp(log_q(u)) b^4 / (det (b H_z + R)^4).
 * With a direction k = (s, 0, c), S = b s,
 *   w = S / (S + |c|)            sigma(k) = max(c, 0) + S w exp(log_psi(w)).
 * (log_q, not log D, because it is smooth at the scale b alone; the b in w
 * resolves sigma of narrow tables; the factor w leaves log_psi smooth at 0.)
 * Where D or sigma - max(c, 0) counts as 0 the cubics lie at KERNEL_LOG_ZERO:
 * exp must answer 0 there, and is never handed less.
 */
#define KERNEL_LOG_ZERO (-800.0)

struct kernel_table {
    double slope_scale;
    struct kernel_cubic log_q, log_psi;
};

/* What the kernels need of a material's roughness, derived once (brdf.c). */
struct kernel_surface {
    double alpha_x, alpha_y, rho, kappa; /* kappa = sqrt(1 - rho^2) */
    double rho_alpha_y, rho_alpha_y_low; /* rho alpha_y and what its double lacks */
    double kappa_alpha_y;
    double det, root_det;                /* alpha_x alpha_y kappa and its square root */
    double slope_x, slope_y;
    const struct kernel_table *table;    /* FACET_TABULATED only */
};

/* One channel of a Fresnel term. */
struct kernel_fresnel {
    double f0;
    double eta, k;
    double excess, excess_low; /* eta^2 - k^2 - 1 and what its double lacks */
    size_t count;
    const double *cos_theta_d, *values;
};

/*
 * What is simpler about a surface, and so cheaper.  A loop that is not built
 * for a shape is served by the one for SHEARED, which is general.
 */
enum kernel_shape { KERNEL_ISO, KERNEL_CENTRAL, KERNEL_SHEARED, KERNEL_SHAPE_COUNT };

/* facet_masking and facet_shear in one.  SMITH also serves what does not depend on masking. */
enum kernel_masking {
    KERNEL_SMITH,
    KERNEL_UNCORRELATED,
    KERNEL_VGROOVE,
    KERNEL_NONE,
    KERNEL_SMITH_THESIS,
    KERNEL_UNCORRELATED_THESIS,
    KERNEL_MASKING_COUNT
};

/*
 * The achromatic quantities: fr and fr_cos without their Fresnel term, and
 * what only the library itself asks for.
 */
enum kernel_quantity {
    KERNEL_FR,
    KERNEL_FR_COS,
    KERNEL_PDF,
    KERNEL_D,
    KERNEL_D_VIS,
    KERNEL_G,
    KERNEL_G1_I,
    KERNEL_G1_O,
    KERNEL_SIGMA_O,
    KERNEL_WEIGHT,    /* fr cos / pdf without the Fresnel term */
    KERNEL_CONDITION, /* of the thesis's denominator */
    KERNEL_QUANTITY_COUNT
};

struct kernel_pairs {
    facet_vec3_in wi, wo;
};

typedef void kernel_eval_fn(const struct kernel_surface *surface, const struct kernel_pairs *pairs,
                            size_t n, double *out);
/* theta_d in the form that a Fresnel kind takes it: out, and out + low where it is a pair. */
typedef void kernel_angle_fn(const struct kernel_pairs *pairs, size_t n, double *out, double *low);
/* out = F(angle + low) factor; factor NULL is 1. */
typedef void kernel_fresnel_fn(const struct kernel_fresnel *fresnel, const double *angle,
                               const double *low, const double *factor, size_t n, double *out);
/* wi; h and pdf too unless pdf is NULL. */
typedef void kernel_sample_fn(const struct kernel_surface *surface, facet_vec3_in wo,
                              const double *u1, const double *u2, size_t n, facet_vec3_out wi,
                              facet_vec3_out h, double *pdf);

struct facet_kernels {
    const struct facet_kernels *base; /* the same tier's kernels for base, which has the table loops */
    kernel_eval_fn
        *eval[KERNEL_QUANTITY_COUNT][FACET_NDF_COUNT][KERNEL_SHAPE_COUNT][KERNEL_MASKING_COUNT];
    kernel_angle_fn *angle[FACET_FRESNEL_COUNT];     /* IDEAL is NULL */
    kernel_fresnel_fn *fresnel[FACET_FRESNEL_COUNT];
    kernel_sample_fn *sample[FACET_NDF_COUNT];       /* NULL: no sampler */
};

#endif
