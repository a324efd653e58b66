/*
 * kernels.h - the only interface to the compiled kernels, with refraction.h for rough dielectrics.
 *
 * kernel.c and sampler.c are compiled once per (tier, io, isa) and export one
 * table each; everything else in them is static, and they call nothing.
 */
#ifndef FACET_KERNELS_H
#define FACET_KERNELS_H

#include "facet.h"

#include <stdatomic.h>

/* Piecewise cubic on uniform cells of [0, 1]: c[4 i + j] multiplies t^j, t in [0, 1] local to cell i. */
struct kernel_cubic {
    const double *c;
    size_t cells;
};

/*
 * Bicubic patches on uniform cells of [0, 1] x [0, 1), the second periodic: of cell i and turn j,
 * c[16 (cells j + i) + 4 k + m] multiplies s^k t^m, t in [0, 1] local to the cell, s to the turn.
 */
struct kernel_sheet {
    const double *c;
    size_t cells, turns;
};

/*
 * A tabulated radial slope distribution at alpha = 1.  With r = tan theta and b = slope_scale,
 *   u = r / (b + r)              P(r) = exp(log_q(u)) (1 - u)^4,  D(theta) = P (1 + r^2)^2,
 * free of division by h_z: with R the length of the standard slopes times H_z,
 *   u = R / (b H_z + R)          D = |H|^4 exp(log_q(u)) b^4 / (det (b H_z + R)^4).
 * With a direction k = (s, 0, c), S = psi_scale s,
 *   w = S / (S + |c|)            sigma(k) = max(c, 0) + S w exp(log_psi(w)).
 * (log_q, not log D, because it is smooth at the scale b alone; psi_scale is b, or, where b is far
 * beyond the slopes there are, theirs: it resolves sigma; the factor w leaves log_psi smooth at 0.)
 * Where D or sigma - max(c, 0) counts as 0 the cubics lie at KERNEL_LOG_ZERO:
 * exp must answer 0 there, and is never handed less.
 *
 * One that is not radial, P(-x) = P(x), has sheets in place of the cubics, over the azimuth of the slope,
 * in units of pi, as well: turned_q(u, azimuth) for log_q, and for log_psi, at 1 - w and the azimuth of k,
 *   log_psi = psi_top - KERNEL_PSI_UNIT/turned_psi.
 * (Far behind it falls like the square of |c| over a width that depends on the azimuth: its
 * reciprocal is smooth where the logarithm itself takes a grid several times finer each way.)
 */
#define KERNEL_LOG_ZERO (-800.0)
#define KERNEL_PSI_UNIT 16.0
/* A sheet that swings counts as no less: there is nothing to see. */
#define KERNEL_PSI_LEAST 0.018

/*
 * A cubic or a sheet for the float tiers: its logarithms to base 2 (of turned_psi the reciprocals
 * of what they are below psi_top), each half of [0, 1] counted from its own end, for both u and 1 - u
 * are to keep their digits.  First the `half` cells from 0 on, then as many from 1 back, t with them;
 * of a sheet all turns of the first half, then all of the second.
 */
struct kernel_halves {
    const float *c;
    size_t cells, half, turns; /* no turns: cubics */
};

struct kernel_floats {
    struct kernel_halves q, psi;
    float c[];
};

struct kernel_table {
    double slope_scale, psi_scale;
    struct kernel_cubic log_q, log_psi;
    struct kernel_sheet turned_q, turned_psi; /* no turns: it is radial */
    double psi_top;
    /* Floats hold sigma seen from behind where |c| is no more than this times s: beyond they lose it, and D. */
    double behind_most;
    _Atomic(struct kernel_floats *) floats; /* made when a float tier is first asked for */
};

/*
 * What the kernels need of a material's roughness, derived once (brdf.c).
 * x_low: what the double x lacks.
 */
struct kernel_surface {
    double alpha_x;
    double rho_alpha_y, rho_alpha_y_low;
    double kappa_alpha_y, kappa_alpha_y_low; /* kappa = sqrt(1 - rho^2) */
    double det, det_low, root_det;           /* det = alpha_x alpha_y kappa */
    double peak;                             /* 1/(pi det) */
    double inverse_x, inverse_y;             /* 1 / alpha_x, 1 / (kappa alpha_y) */
    double tilt;                             /* rho / (kappa alpha_x) */
    double inverse_alpha2;                   /* isotropic */
    double slope_x, slope_y;
    double mean; /* the mean slope in standard slopes, no less than its length there */
    const struct kernel_table *table;   /* FACET_TABULATED only */
    double cap_rise, cap_a2, cap_whole; /* bounded caps (sample.h): |1 - A^2|, A^2, 1 + A^2 */
};

/* One channel of a Fresnel term. */
struct kernel_fresnel {
    double f0;
    double eta, k;
    double excess, excess_low; /* eta^2 - k^2 - 1 and what its double lacks */
    double least;              /* F at normal incidence, or the smallest node */
    size_t count;
    const double *cos_theta_d, *values;
};

/*
 * What is simpler about a surface, and so cheaper.  A loop that is not built
 * for a shape is served by the one for the next, up to SHEARED, which is general.
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

/* facet_quantity's, in its order, and what only the library itself asks for. */
enum kernel_quantity {
#define QUANTITY(id, name, coloured, doc) KERNEL_##id,
#include "quantities.def"
#undef QUANTITY
    KERNEL_WEIGHT,    /* fr cos / pdf */
    KERNEL_CONDITION, /* of the thesis's denominator */
    KERNEL_QUANTITY_COUNT
};

/* Batches are whole vectors: their length is a multiple of this, whatever the instruction set. */
enum { KERNEL_LANES = 16 };

/*
 * One batch.  Arrays hold the io type of the kernels: float or double.
 */
struct kernel_job {
    const void *wi[3], *wo[3];
    /* Sampling: u in [0, 1), and where the samples go (h, pdf NULL: not computed). */
    const void *u[2];
    void *sampled_wi[3], *sampled_h[3], *sampled_pdf;
    size_t *again; /* as many as there are draws */
    /* Evaluation. */
    enum kernel_masking masking; /* of the loops that take any */
    facet_fresnel_kind kind;
    size_t channels;
    const struct kernel_fresnel *fresnel; /* a channel each */
    void *out[KERNEL_QUANTITY_COUNT][3];
};

/*
 * True if some pair is beyond the range of the kernel's arithmetic (|H| too
 * short, a result too large): its result is not a number, and eval.c evaluates
 * it again in precise.
 */
typedef bool kernel_eval_fn(const struct kernel_surface *surface, const struct kernel_job *job,
                            size_t n);
/* How many draws hang on the last bits of a float: job->again has their places, and sample.c makes them again in exact32. */
typedef size_t kernel_sample_fn(const struct kernel_surface *surface, const struct kernel_job *job,
                                size_t n);

struct facet_kernels {
    kernel_eval_fn
        *eval[KERNEL_QUANTITY_COUNT][FACET_NDF_COUNT][KERNEL_SHAPE_COUNT][KERNEL_MASKING_COUNT];
    /* SMITH alone; NULL: eval's. */
    kernel_eval_fn
        *fr_achromatic[FACET_NDF_COUNT][KERNEL_SHAPE_COUNT][FACET_FRESNEL_COUNT]; /* one channel */
    kernel_eval_fn *fr_pdf[FACET_NDF_COUNT][KERNEL_SHAPE_COUNT];                  /* both at once */
};

enum { KERNEL_SAMPLER_COUNT = FACET_SAMPLER_TABLE }; /* table_sample.c draws TABLE, the last */

/*
 * sampler.c's: how each method draws, and the density and weight that go with it
 * (into out[KERNEL_PDF] and out[KERNEL_WEIGHT]).  pdf and weight NULL where draw
 * is not: visible normals, facet_kernels' own.
 */
struct facet_samplers {
    kernel_sample_fn *draw[FACET_NDF_COUNT][KERNEL_SAMPLER_COUNT]; /* NULL: not in this tier */
    kernel_eval_fn *pdf[FACET_NDF_COUNT][KERNEL_SAMPLER_COUNT][KERNEL_SHAPE_COUNT];
    kernel_eval_fn
        *fr_pdf[FACET_NDF_COUNT][KERNEL_SAMPLER_COUNT][KERNEL_SHAPE_COUNT]; /* as above */
    kernel_eval_fn *weight[FACET_NDF_COUNT][KERNEL_SAMPLER_COUNT][KERNEL_MASKING_COUNT];
};

#endif
