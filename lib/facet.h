/*
 * facet.h - microfacet BRDFs: evaluate, sample, and say how accurate that is.
 *
 * Conventions.  Directions are unit vectors in the tangent frame; the
 * macrosurface normal is +z.  wo points toward the viewer and is given, wi
 * points toward the light and is what sampling produces; both point away from
 * the surface.  H = wi + wo (never normalised in advance), h = H/|H|,
 * cos theta_d = |H|/2.  (Heitz & d'Eon 2014 write omega_i for our wo.)
 * The model is the formulas on the components as given, nothing is
 * renormalised: that makes "exact" well defined.  lib/NOTATION.md maps every
 * symbol to its equation and its seed.
 *
 * Batches are structures of arrays of n doubles, or of n floats in the calls
 * whose names end in _float.  A batch call checks its
 * scalar arguments once and returns a status; its elements cannot fail.
 * Outputs must not overlap inputs.  Batch calls never allocate, but
 * for the first of the sampler TABLE for GGX and for Beckmann.
 *
 * Objects are immutable once created: share them between threads freely,
 * destroy each once.
 *
 * The rest of the library: facet_table.h (tabulated slope distributions),
 * facet_fit.h (fit measured materials), facet_leadr.h (slope moments, maps),
 * facet_albedo.h (integrals over the hemisphere), facet_transmission.h (rough dielectrics
 * from both sides), facet_solid_angle.h (filtered importance sampling).
 */
#ifndef FACET_H
#define FACET_H

#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Status ---------------------------------------------------------------- */

#define FACET_STATUS_MAP(X)                                                                        \
    X(OK, "success")                                                                               \
    X(NO_MEMORY, "out of memory")                                                                  \
    X(BAD_ALPHA, "alpha_x and alpha_y must lie in [1e-8, 1e4]")                                    \
    X(BAD_PHI, "phi must lie in [-100, 100]")                                                      \
    X(BAD_RHO, "rho must lie in [-1 + 1e-12, 1 - 1e-12]")                                          \
    X(BAD_MEAN_SLOPE, "the components of mean_slope must lie in [-1e6, 1e6]")                      \
    X(BAD_FRESNEL, "a Fresnel parameter is out of range")                                          \
    X(BAD_TABLE, "a table needs finite data, sorted nodes and a positive scale")                   \
    X(BAD_SIZE, "a size is zero or too large")                                                     \
    X(BAD_DATA, "the data hold nothing that can be used")                                          \
    X(UNSUPPORTED, "this combination is not available")                                            \
    X(NO_CONVERGENCE, "the iteration did not converge")                                            \
    X(CANCELLED, "the caller asked to stop")

typedef enum facet_status {
#define FACET_STATUS_ENUM(name, text) FACET_##name,
    FACET_STATUS_MAP(FACET_STATUS_ENUM)
#undef FACET_STATUS_ENUM
        FACET_STATUS_COUNT
} facet_status;

const char *facet_status_text(facet_status status);

/* ---- Material -------------------------------------------------------------- */

#define FACET_PI 3.14159265358979323846
#define FACET_ALPHA_MIN 1e-8
#define FACET_ALPHA_MAX 1e4
#define FACET_RHO_MAX (1 - 1e-12)
#define FACET_PHI_MAX 100.0
#define FACET_MEAN_SLOPE_MAX 1e6
#define FACET_ETA_MIN 1e-3 /* relative index of refraction, also of conductors */
#define FACET_ETA_MAX 1e3
#define FACET_K_MAX 1e3 /* extinction coefficient of a conductor */

typedef enum facet_ndf { FACET_GGX, FACET_BECKMANN, FACET_TABULATED, FACET_NDF_COUNT } facet_ndf;

/*
 * Affine map from the standard radial slope distribution (alpha = 1) to the
 * surface's slopes (Dupuy eqs. 2.26 and 3.2):
 *   x~ = alpha_x x + slope_x,  y~ = alpha_y (rho x + sqrt(1-rho^2) y) + slope_y.
 * A mean slope of (0, 0) is a central surface.
 *
 * low: what the doubles lack, 0 where they are the caller's own.  Of a thin ellipse 1 - rho^2
 * cancels; with their lows the three hold it to 1e-19.
 */
typedef struct facet_roughness {
    double alpha_x, alpha_y; /* slope scale, in [FACET_ALPHA_MIN, FACET_ALPHA_MAX] */
    double rho;              /* slope correlation, |rho| <= FACET_RHO_MAX */
    double slope_x, slope_y; /* mean slope, each |.| <= FACET_MEAN_SLOPE_MAX */
    struct {
        double alpha_x, alpha_y, rho;
    } low;
} facet_roughness;

/*
 * The same roughness as an ellipse (Dupuy eqs. 2.29-2.34, signs as in
 * lib/NOTATION.md): alpha_1 >= alpha_2 on the way back, major axis at -phi.
 */
typedef struct facet_ellipse {
    double alpha_1, alpha_2; /* slope scale along the principal axes, > 0 */
    double phi;              /* radians, |phi| <= FACET_PHI_MAX */
} facet_ellipse;

facet_status facet_roughness_check(const facet_roughness *roughness);
facet_status facet_roughness_from_ellipse(const facet_ellipse *ellipse, double slope_x,
                                          double slope_y, facet_roughness *roughness);
facet_ellipse facet_roughness_to_ellipse(const facet_roughness *roughness);

/*
 * Masking.  SMITH is height-correlated.  VGROOVE is the V-cavity model, NONE
 * the normal map of Dupuy table 2.IV (its G may exceed 1; not reciprocal).
 */
typedef enum facet_masking {
    FACET_SMITH,
    FACET_SMITH_UNCORRELATED,
    FACET_VGROOVE,
    FACET_NONE,
    FACET_MASKING_COUNT
} facet_masking;

/*
 * What masking means on a sheared surface (mean slope not 0).  ENERGY_SAFE
 * works in the frame of the mean facet: weights never exceed the Fresnel term,
 * not reciprocal.  THESIS puts Dupuy eq. 3.3 into 2.13: weights may exceed 1,
 * and it answers 0 where its denominator is not positive.  THESIS goes with the
 * Smith maskings only.  On a central surface both are the same.
 */
typedef enum facet_shear { FACET_ENERGY_SAFE, FACET_THESIS, FACET_SHEAR_COUNT } facet_shear;

typedef enum facet_fresnel_kind {
    FACET_FRESNEL_IDEAL,      /* F = 1 */
    FACET_FRESNEL_SCHLICK,    /* f0 */
    FACET_FRESNEL_DIELECTRIC, /* eta; unpolarised, 1 at total reflection */
    FACET_FRESNEL_CONDUCTOR,  /* eta, k; unpolarised */
    FACET_FRESNEL_TABLE,      /* values over cos_theta_d, linear between, constant outside */
    FACET_FRESNEL_COUNT
} facet_fresnel_kind;

/* Fresnel term over cos theta_d; channel i of the answer uses the i-th entry. */
typedef struct facet_fresnel {
    facet_fresnel_kind kind;
    size_t channels;           /* 1 or 3 */
    double f0[3];              /* SCHLICK: in [0, 1] */
    double eta[3];             /* DIELECTRIC, CONDUCTOR: in [FACET_ETA_MIN, FACET_ETA_MAX] */
    double k[3];               /* CONDUCTOR: in [0, FACET_K_MAX] */
    size_t count;              /* TABLE: number of nodes, 2 .. FACET_FRESNEL_NODES_MAX */
    const double *cos_theta_d; /* TABLE: strictly increasing, in [0, 1] */
    const double *values[3];   /* TABLE: each in [0, 1e6] */
} facet_fresnel;

#define FACET_FRESNEL_NODES_MAX 4096

typedef struct facet_slope_table facet_slope_table; /* facet_table.h */

typedef struct facet_material {
    facet_ndf ndf;
    facet_roughness roughness;
    facet_masking masking;
    facet_shear shear;
    facet_fresnel fresnel;
    const facet_slope_table *table; /* TABULATED only; borrowed, must outlive the BRDF */
} facet_material;

/* A material made ready for evaluation. */
typedef struct facet_brdf facet_brdf;

facet_status facet_brdf_create(const facet_material *material, facet_brdf **brdf);
void facet_brdf_destroy(facet_brdf *brdf); /* NULL is allowed */

/* ---- Speed and accuracy ------------------------------------------------------ */

/*
 * A tier is a promise about error, not an algorithm.  lib/accuracy.def holds
 * the promises, cheapest tier first; tests enforce them.
 */
typedef enum facet_tier {
    FACET_DRAFT, /* float, estimates of quotients and roots where the processor has good ones (AVX-512) */
    FACET_FAST,    /* float */
    FACET_EXACT32, /* double inside, so that rounding a result to float is all its error */
    FACET_PRECISE, /* double, compensated where terms cancel */
    FACET_TIER_COUNT
} facet_tier;

/* The quantities of lib/quantities.def, in its order. */
typedef enum facet_quantity {
#define QUANTITY(id, name, coloured, doc) FACET_##id,
#include "quantities.def"
#undef QUANTITY
    FACET_QUANTITY_COUNT
} facet_quantity;

/*
 * A number y that stands for an exact value x obeys
 * |y - x| <= bound max(|x|, FACET_FLOOR).
 */
#define FACET_FLOOR 1e-30

/*
 * The bound promised for one quantity of this material, to which facet_depth_error adds.  input_error: absolute
 * error of the direction components handed over times facet_closeness of them,
 * 0 when they are the caller's own numbers.  False where the tier promises
 * nothing.
 */
bool facet_bound(const facet_brdf *brdf, facet_tier tier, facet_quantity quantity,
                 double input_error, double *bound);

/* The same for facet_eval_float, which hands out floats. */
bool facet_bound_float(const facet_brdf *brdf, facet_tier tier, facet_quantity quantity,
                       double input_error, double *bound);

/* How directions are sampled: see facet_sample. */
#define FACET_SAMPLER_MAP(X)                                                                       \
    X(AUTO, "auto")       /* facet_sampler_auto's */                                               \
    X(CAPS, "caps")       /* visible normals by spherical caps; GGX */                             \
    X(BOUNDED, "bounded") /* those caps, cut to what may rise above the horizon; GGX */            \
    X(SLOPE, "slope")     /* visible normals by inverting the CDF of slopes */                     \
    X(NDF, "ndf")         /* all normals, seen or not */                                           \
    X(COSINE, "cosine")   /* wi by its cosine, whatever the material */                            \
    X(VCAVITY, "vcavity") /* visible normals of V-cavities (masking VGROOVE) */                    \
    X(TABLE, "table")     /* visible normals of a table; for GGX and Beckmann one of their own */

typedef enum facet_sampler {
#define FACET_SAMPLER_ENUM(id, name) FACET_SAMPLER_##id,
    FACET_SAMPLER_MAP(FACET_SAMPLER_ENUM)
#undef FACET_SAMPLER_ENUM
        FACET_SAMPLER_COUNT
} facet_sampler;

const char *facet_sampler_name(facet_sampler sampler);
/* Whether this distribution can be sampled so; AUTO: whether it can be sampled at all. */
bool facet_sampler_serves(facet_sampler sampler, facet_ndf ndf);
/* CAPS for GGX, SLOPE for Beckmann, TABLE for tables, AUTO for nothing: their density is FACET_PDF. */
facet_sampler facet_sampler_visible(facet_ndf ndf);
/*
 * What AUTO stands for: what was measured to have the least variance times time over all wo (README, Samplers).
 * BOUNDED for GGX without a mean slope whose minor radius is 0.1 or more, VCAVITY for Beckmann under VGROOVE,
 * otherwise facet_sampler_visible's.
 */
facet_sampler facet_sampler_auto(const facet_material *material);
/*
 * Makes what TABLE needs for GGX and Beckmann, once.  Else the first call does, and a bound asked for
 * before is none where memory ran out: NO_MEMORY here tells.
 */
facet_status facet_sampler_prepare(facet_sampler sampler, facet_ndf ndf);

/*
 * The same for facet_sample: pdf relative as above; the components of wi and h
 * absolute, that is with a floor of 1; the weight is that of a wi within the bound
 * (and so is the pdf of NDF, which has a pole at wi = -wo).
 */
bool facet_sample_bound(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                        double input_error, double *bound);
/* The same for facet_pdf.  BOUNDED: on the side of the edge on which rounding put wi. */
bool facet_pdf_bound(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                     double input_error, double *bound);

/* The same for facet_pdf_float. */
bool facet_pdf_bound_float(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                           double input_error, double *bound);

const char *facet_tier_name(facet_tier tier);
/* For people: the materials it promises anything for (facet_bound decides). */
const char *facet_tier_domain(facet_tier tier);

/*
 * The instruction set in use ("base", "avx2", ...).  Select one to test or
 * measure it; NULL restores the best this processor has.  Not to be called
 * while another thread is inside the library.
 */
const char *facet_isa(void);
facet_status facet_isa_select(const char *name);
/* The index-th instruction set this binary holds and this processor runs; NULL past the last. */
const char *facet_isa_list(size_t index);

/* ---- Evaluate ---------------------------------------------------------------- */

typedef struct facet_vec3_in {
    const double *x, *y, *z;
} facet_vec3_in;

typedef struct facet_vec3_out {
    double *x, *y, *z;
} facet_vec3_out;

/*
 * What to compute: NULL is not computed.  Coloured quantities (quantities.def)
 * use as many entries as the Fresnel term has channels, the others entry 0.
 */
typedef struct facet_outputs {
    double *of[FACET_QUANTITY_COUNT][3];
} facet_outputs;

/*
 * Evaluate n pairs.  fr and fr_cos are 0 where wi or wo lies on or below the
 * horizon; D and what follows from it is 0 where H points on or below it.
 */
facet_status facet_eval(const facet_brdf *brdf, facet_tier tier, facet_vec3_in wi, facet_vec3_in wo,
                        size_t n, const facet_outputs *outputs);

/*
 * The same on floats, which the float tiers take as they are.  A result beyond
 * FLT_MAX saturates there.
 */
typedef struct facet_vec3_in_float {
    const float *x, *y, *z;
} facet_vec3_in_float;

typedef struct facet_vec3_out_float {
    float *x, *y, *z;
} facet_vec3_out_float;

typedef struct facet_outputs_float {
    float *of[FACET_QUANTITY_COUNT][3];
} facet_outputs_float;

facet_status facet_eval_float(const facet_brdf *brdf, facet_tier tier, facet_vec3_in_float wi,
                              facet_vec3_in_float wo, size_t n, const facet_outputs_float *outputs);

/*
 * The same, but that FACET_PDF is what facet_pdf has for this sampler, its bound facet_pdf_bound's.
 * UNSUPPORTED where it does not serve the distribution.
 */
facet_status facet_eval_sampled(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                                facet_vec3_in wi, facet_vec3_in wo, size_t n,
                                const facet_outputs *outputs);
facet_status facet_eval_sampled_float(const facet_brdf *brdf, facet_tier tier,
                                      facet_sampler sampler, facet_vec3_in_float wi,
                                      facet_vec3_in_float wo, size_t n,
                                      const facet_outputs_float *outputs);

/*
 * With shear THESIS the denominator of fr cancels or underflows: the largest
 * sum-of-magnitudes / |denominator| over these pairs, by which the bound of
 * fr, fr_cos and G grows; beyond 1e300 where nothing is left of a sigma.  1 for
 * every other material.
 */
facet_status facet_condition(const facet_brdf *brdf, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                             double *condition);

/*
 * How close these pairs come to where an error in the directions outgrows every
 * bound: the largest 1 / min(1, |H|, |c_i|, |c_o|), c the cosine with the mean
 * facet.  facet_bound's input_error is to be multiplied by it.  exact_z: the z
 * components are right to rounding (as from angles), so that z itself is no such
 * place.
 */
double facet_closeness(const facet_brdf *brdf, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                       bool exact_z);

/*
 * From how far behind the mean facets a surface is looked at, in its slopes (of alpha = 1 where it is not a
 * table): wo, and of pairs above the horizon the lesser and the greater of both; 0 in front, and where nothing
 * is seen.  Begin with zeros; each survey raises them.
 */
typedef struct facet_depth {
    double wo, least, most;
} facet_depth;

void facet_depth_survey(const facet_brdf *brdf, facet_sampler sampler, facet_vec3_in wi,
                        facet_vec3_in wo, size_t n, facet_depth *depth);

/*
 * What the bound of a quantity grows by at such depths.  Radial tables: where sigma is fainter than
 * FACET_FLOOR it is told less well, and where it is next to 0 not at all: INFINITY.  Over the azimuth it is told
 * less well from all behind, and not at all where it is fainter than that.  Of PDF with sampler TABLE for GGX
 * and Beckmann too; 0 for everything else.
 */
double facet_depth_error(const facet_brdf *brdf, facet_tier tier, facet_quantity quantity,
                         facet_sampler sampler, const facet_depth *depth);
/* The same for facet_sample_bound. */
double facet_sample_depth_error(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                                const facet_depth *depth);

/* ---- Sample ------------------------------------------------------------------- */

/* What to compute: NULL is not computed, and a vec3 is all or nothing. */
typedef struct facet_samples {
    facet_vec3_out wi; /* required */
    facet_vec3_out h;  /* the sampled micronormal */
    double *weight[3]; /* fr cos theta_i / pdf; 0 below the horizon */
    double *pdf;       /* per solid angle of wi */
} facet_samples;

/*
 * Sample wi for wo; u1, u2 in [0, 1).  UNSUPPORTED where the sampler does not
 * serve the distribution.  h, taken back through the sampler's CDFs, gives u again
 * within 1e-12 (precise) or 1e-6 (fast), but for what its rounding to the arrays' type does.
 * By sampler:
 *   CAPS     visible normals of GGX, reflected (Dupuy & Benyoub 2023); any shear.
 *   BOUNDED  the same caps without most of what would go below the horizon (Eto &
 *            Tokuyoshi 2023), by the principal axes of the ellipse; isotropic
 *            alpha > 1 by their tighter form.  That is CAPS where the mean slope is
 *            not 0 or wo is below the horizon.
 *   SLOPE    visible normals: monotone inversion of the slope CDF along wo, then
 *            across, for GGX in closed form but for one angle (Heitz & d'Eon 2014).
 *   NDF      normals by D h_z (Walter et al. 2007); many are not seen, weights have
 *            no bound.
 *   COSINE   wi with density cos theta_i / pi, for what is nearly diffuse; h is the
 *            half vector.
 *   VCAVITY  the normals that VGROOVE shows wo, so that its weight never exceeds the Fresnel
 *            term: tan theta_h by u1, the azimuth about wo's by u2, both monotone
 *            (Heitz & d'Eon 2014, algorithm 3, its random swap folded into the azimuth); any shear.
 *   TABLE    visible normals of a tabulated distribution: the ring of slopes, then the
 *            place on it, both CDFs inverted exactly, in double whatever the tier.  u1 grows
 *            with |slope|; where a table has a gap, within 1e-12 of its level u1 may fall on
 *            either side.  GGX and Beckmann: of a table of 1025 nodes (Heitz & d'Eon 2014,
 *            supplement, section 5), which has their CDF within 1e-8; pdf is the table's.  That
 *            table is made by the first call that needs it, which may be NO_MEMORY.
 */
facet_status facet_sample(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                          facet_vec3_in wo, const double *u1, const double *u2, size_t n,
                          const facet_samples *samples);

/* The same on floats. */
typedef struct facet_samples_float {
    facet_vec3_out_float wi;
    facet_vec3_out_float h;
    float *weight[3];
    float *pdf;
} facet_samples_float;

facet_status facet_sample_float(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                                facet_vec3_in_float wo, const float *u1, const float *u2, size_t n,
                                const facet_samples_float *samples);

/*
 * Density with which the sampler makes wi from wo, per solid angle, over the whole
 * sphere; 0 where it never goes.
 */
facet_status facet_pdf(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                       facet_vec3_in wi, facet_vec3_in wo, size_t n, double *pdf);

/* The same on floats. */
facet_status facet_pdf_float(const facet_brdf *brdf, facet_tier tier, facet_sampler sampler,
                             facet_vec3_in_float wi, facet_vec3_in_float wo, size_t n, float *pdf);

/* ---- Long work ------------------------------------------------------------------ */

/* Asked between chunks of long work; true ends it with FACET_CANCELLED.  NULL: never. */
typedef struct facet_watch {
    bool (*cancelled)(void *user);
    void *user;
} facet_watch;

#ifdef __cplusplus
}
#endif
#endif
