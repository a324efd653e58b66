/*
 * samplers.h - the sampling methods of the literature, one scalar function each, in plain double.
 *
 * Written from the papers for the report and as a yardstick of speed: nothing of lib is in here.
 * Axis-aligned central surfaces.  wo is given, wi = 2 (wo.h) h - wo is sampled; u1, u2 in [0, 1).
 */
#ifndef REPORT_SAMPLERS_H
#define REPORT_SAMPLERS_H

struct surface {
    enum { GGX, BECKMANN } ndf;
    enum { SMITH, V_CAVITY } masking; /* SMITH: height-correlated */
    double alpha_x, alpha_y;
};

/* pdf_over_d: density per solid angle of wi over D; weight = fr cos theta_i / pdf, 0 where wi lies below the horizon. */
struct sample {
    double wi[3], h[3], pdf_over_d, weight;
};
double sample_pdf(const struct surface *surface, const struct sample *sample);

typedef void sampler(const struct surface *surface, const double wo[3], double u1, double u2,
                     struct sample *sample);

sampler sample_ndf;       /* Walter et al. 2007: all normals, seen or not */
sampler sample_caps;      /* Dupuy & Benyoub 2023; GGX */
sampler sample_bounded;   /* Eto & Tokuyoshi 2023; GGX, below the horizon as little as a cap can */
sampler sample_slope_ggx; /* Heitz & d'Eon 2014, quantiles exact */
sampler sample_slope_beckmann; /* the same for Beckmann, CDF inverted by Newton's method */
sampler sample_vcavity;        /* Heitz & d'Eon 2014, algorithm 3: visible normals of V-cavities */

struct method {
    const char *name;
    sampler *sample;
    int ndf;     /* the distribution it is for; -1: both */
    int masking; /* the masking it samples exactly; -1: none */
};
extern const struct method methods[];
enum { METHOD_COUNT = 6 };

/* fr cos theta_i of a mirror-like microsurface (F = 1). */
double surface_fr_cos(const struct surface *surface, const double wi[3], const double wo[3]);

/*
 * Of caps on isotropic GGX, in quadruple precision from the same u: the cosine of wi, whose
 * sign says whether the sample is wasted.
 */
double caps_cosine_quad(double alpha, double cos_theta_o, double sin_theta_o, double u1, double u2);

#endif
