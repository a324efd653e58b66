/* material.h - the `material` member: its struct and table, and what lib makes of it. */
#ifndef API_MATERIAL_H
#define API_MATERIAL_H

#include "facet.h"
#include "field.h"

struct slopes {
    double scale;
    struct numbers log_D;
};

struct schlick {
    struct colour f0;
};

struct dielectric {
    struct colour eta;
};

struct conductor {
    struct colour eta, k;
    int metal; /* row of metals.def */
};

struct fresnel_table {
    struct numbers cos_theta_d;
    struct matrix values; /* 1 or 3 columns */
};

enum { FRESNEL_WORD_IDEAL, FRESNEL_BY_KEY };

struct fresnel {
    int form;
    struct schlick *schlick; /* with FRESNEL_BY_KEY exactly one is not NULL */
    struct dielectric *dielectric;
    struct conductor *conductor;
    struct fresnel_table *table;
};

/* As sent, and as printed back: absent members as field.h says. */
struct material {
    int ndf;
    struct slopes *slopes;
    double alpha;
    double alpha_x, alpha_y, rho;
    double alpha_1, alpha_2, phi;
    struct numbers moments;    /* E1..E5 */
    struct numbers mean_slope; /* x, y */
    int masking, shear;
    struct fresnel fresnel;
    struct colour diffuse; /* kd */
};

extern const struct field api_material_fields[];
extern const char *const api_ndf_names[], *const api_masking_names[], *const api_shear_names[];
extern const char *const api_metal_names[];

/* The check that goes with the table: exactly one form of roughness, and so on. */
bool api_material_check(void *material, const struct place *place, struct decoder *decoder);

#define MATERIAL_FIELD(type_)                                                                      \
    {                                                                                              \
        MEMBER(type_, material), FIELD_OBJECT, FIELD_MUST, .fields = api_material_fields,          \
                                                           .check = api_material_check,            \
                                                           .doc = "What the surface is made of"    \
    }

/* A material ready for lib; everything lives in the arena it was opened in. */
struct surface {
    facet_material facet;
    facet_brdf *brdf;
    size_t channels; /* of coloured quantities: 1 or 3 */
    bool has_diffuse;
    double diffuse[3]; /* kd of each channel; evaluate and sample by diffuse.h */
    /*
     * What rounding in parameters that the service computes (ellipse, moments) adds
     * to the relative error of every quantity; add it to facet_bound's.
     */
    double parameter_error;
};

bool api_material_open(const struct material *material, const struct place *place,
                       struct decoder *decoder, struct surface *surface);

/* Covariance of the slopes from the moments E1..E5 (Dupuy sec. 5.1): xx, yy, xy. */
struct covariance {
    double xx, yy, xy;
};
struct covariance api_covariance(const double moments[5]);

#endif
