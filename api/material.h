/* material.h - the `material` member: its struct and table, and what lib makes of it. */
#ifndef API_MATERIAL_H
#define API_MATERIAL_H

#include "facet.h"
#include "facet_transmission.h"
#include "field.h"

struct slopes {
    double scale;
    struct matrix log_D; /* one column: radial; else a row per azimuth */
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

/* Of `ndf`, beside lib's: no distribution of slopes at all. */
enum { NDF_LAMBERT = FACET_NDF_COUNT };

/* As sent, and as printed back: absent members as field.h says. */
struct material {
    int ndf;
    struct slopes *slopes;
    double alpha;
    double alpha_x, alpha_y, rho;
    double alpha_1, alpha_2, phi;
    struct numbers moments;    /* E1..E5 */
    double height_scale;       /* of the moments' heights */
    struct numbers jacobian;   /* du/dx, du/dy, dv/dx, dv/dy */
    struct material *base;     /* ndf, a roughness and mean_slope alone */
    struct numbers mean_slope; /* x, y */
    int masking, shear;
    struct fresnel fresnel;
    struct colour diffuse;     /* kd */
    struct colour reflectance; /* of ndf lambert */
    bool transmission;
    int transport; /* a facet_transport */
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

/* Tabulated over the azimuth as well. */
bool api_material_is_turned(const struct material *material);

/* A material ready for lib; everything lives in the arena it was opened in. */
struct surface {
    facet_material facet;
    facet_brdf *brdf;
    facet_bsdf *bsdf; /* of both sides, with transmission; else NULL */
    size_t channels;  /* of coloured quantities: 1 or 3 */
    bool has_diffuse;
    bool is_lambert; /* the diffuse part is all: facet and brdf stand for nothing, with weight 0 */
    double diffuse[3]; /* kd, or reflectance, of each channel; evaluate and sample by diffuse.h */
    /*
     * What rounding in parameters that the service computes (ellipse, moments) adds
     * to the relative error of every quantity; add it to facet_bound's.
     */
    double parameter_error;
    const char *note; /* what was made of the base; NULL: nothing to say */
};

bool api_material_open(const struct material *material, const struct place *place,
                       struct decoder *decoder, struct surface *surface);

/*
 * By how much a relative error of all slopes grows in a quantity: at most 4 + 2 + 2
 * in D, det and sigma of GGX; Beckmann's exponent t <= 150 (beyond, results are
 * below the floor) has 2 t.  A table may be as steep as Beckmann.
 */
double api_slope_gain(facet_ndf ndf);
/* The same of a computed roughness that keeps its lows (facet.h): alpha_x is rounded, the others follow it. */
double api_rounding_error(facet_ndf ndf);

/* material_process.c: moments with height_scale and jacobian, and a base below; Beckmann.  Roughness
 * and mean slope of the surface alone are there already unless it has moments. */
extern const struct field api_base_fields[];
bool api_base_check(void *base, const struct place *place, struct decoder *decoder);
bool api_process_check(const struct material *material, const struct place *place,
                       struct decoder *decoder);
bool api_process_open(const struct material *material, const facet_roughness *base,
                      const struct place *place, struct decoder *decoder, struct surface *surface);

/* Exactly one form of roughness, whole. */
bool api_roughness_check(const struct material *material, const struct place *place,
                         struct decoder *decoder);

/* 422: a roughness that was computed is out of its ranges; what it is and what status says of it. */
bool api_roughness_refuse(const facet_roughness *roughness, facet_status status,
                          const struct place *place, struct decoder *decoder);

#endif
