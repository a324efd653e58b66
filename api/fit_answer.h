/* fit_answer.h - the answer of /v1/fit: its table, and what a facet_fit becomes in it. */
#ifndef API_FIT_ANSWER_H
#define API_FIT_ANSWER_H

#include "endpoint.h"
#include "facet_fit.h"
#include "material.h"
#include "measurement.h"

struct worst_pair {
    double log;
    struct numbers wi, wo;
};

struct fit_error {
    double backscatter_max, rms_log;
    struct numbers rms_log_channel;
    struct worst_pair worst;
};

struct fit_candidate {
    const char *model;
    int fresnel;
    bool diffuse, anisotropic;
    double alpha, alpha_x, alpha_y, rho;
    struct numbers f0, kd;
    int64_t nodes, slopes, azimuths; /* -1: no such table */
    int64_t bytes;
    struct fit_error error;
    double ns_per_eval;
};

struct fit_chosen {
    const char *model;
    int fresnel;
    bool diffuse, meets_tolerance;
    const char *why;
};

struct fit_data {
    const char *format;
    int64_t values, missing, negative;
};

struct fit_export {
    const char *tool, *text, *lost;
    double rms_log;
};

struct fit_response {
    bool fits;
    const char *fits_why;
    struct material *material;
    struct fit_error error;
    struct list candidates;
    struct fit_chosen chosen;
    int64_t considered;
    int source_convention;
    struct fit_data *data;
    struct fit_export *exported;
    int64_t pairs;
    double epsilon, timing_ms;
};

extern const struct field api_fit_response_fields[];

/*
 * Fills in all but data, export and timing; *chosen is a candidate of fit, NULL
 * where the source is no microfacet surface.
 */
bool api_fit_answer(struct call *call, const facet_fit *fit, double tolerance, const char *asked,
                    const facet_fit_candidate **chosen);

#endif
