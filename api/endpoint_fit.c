/* POST /v1/fit: the smallest material that is close enough to a measurement or to another material. */
#include "diffuse.h"
#include "endpoint.h"
#include "export.h"
#include "facet_fit.h"
#include "fit_answer.h"
#include "lambert.h"
#include "material.h"
#include "measurement.h"
#include "picture.h"
#include "samples.h"
#include "transmission.h"

#include <math.h>
#include <string.h>

static const char *const model_names[] = {"auto", "ggx", "beckmann", "tabulated", NULL};
static const unsigned models_of[] = {FACET_FIT_ALL, FACET_FIT_GGX, FACET_FIT_BECKMANN,
                                     FACET_FIT_TABULATED};
static const char *const masking_names[] = {"smith", "vgroove", "none", NULL};
static const facet_masking masking_of[] = {FACET_SMITH, FACET_VGROOVE, FACET_NONE};
enum { ASK_AUTO, ASK_TRUE, ASK_FALSE };
static const char *const ask_names[] = {"auto", "true", "false", NULL};
static const char *const diffuse_names[] = {"auto", "false", NULL};

struct fit_request {
    struct material *source;
    struct samples *samples;
    int model, masking, format, anisotropic, diffuse, exported;
    int64_t resolution;
    double tolerance;
};

#define Q(member) MEMBER(struct fit_request, member)

static const struct field request_fields[] = {
    {Q(source), FIELD_OPTION, .fields = api_material_fields, .size = sizeof(struct material),
     .check = api_material_check,
     .doc = "a material without mean slope to fit, where the body is not a measurement"},
    {Q(samples), FIELD_OPTION, .fields = api_samples_fields, .size = sizeof(struct samples),
     .doc =
         "fr at scattered pairs, instead of source; at least 16, at 3 pairs of directions or more "
         "(turned about the normal, mirrored and exchanged ones are one)"},
    {Q(model), FIELD_ENUM, FIELD_DEFAULT, .names = model_names,
     .doc =
         "auto: the smallest that meets the tolerance; tabulated does not go with samples and UTIA files"},
    {Q(anisotropic), FIELD_ENUM, FIELD_DEFAULT, .names = ask_names,
     .doc = "auto: where the source can be; true needs a source that can be"},
    {Q(diffuse), FIELD_ENUM, FIELD_DEFAULT, .names = diffuse_names,
     .doc = "auto: also with a diffuse part, where that helps"},
    {Q(masking), FIELD_ENUM, FIELD_DEFAULT, .names = masking_names,
     .doc = "masking of the fitted material"},
    {Q(resolution), FIELD_INTEGER, .min = FACET_FIT_RESOLUTION_MIN, .max = FACET_FIT_RESOLUTION_MAX,
     .doc = "intervals of a tabulated slope distribution, and a Fresnel table at every degree; "
            "absent: 90, or tables of a fraction of the nodes where those meet the tolerance"},
    {Q(tolerance), FIELD_NUMBER, FIELD_DEFAULT, .min = 1e-9, .max = 10,
     .initial = FACET_FIT_TOLERANCE, .doc = "the rms_log accepted"},
    {Q(format), FIELD_ENUM, .names = api_format_names,
     .doc = "of the measurement in the body; else told by its content"},
    {.name = "export",
     .offset = offsetof(struct fit_request, exported),
     .type = FIELD_ENUM,
     .names = api_export_names,
     .doc = "also as text for this tool, in its own convention"},
    {0},
};

/* ---- The source ------------------------------------------------------------------------ */

/* f_r of a material; user is its struct surface. */
static facet_status evaluate_surface(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                                     double *const fr[3], bool *valid)
{
    const struct surface *surface = user;
    facet_outputs outputs = {{{NULL}}};
    for (size_t c = 0; c < surface->channels; c++) outputs.of[FACET_FR][c] = fr[c];
    facet_status status = api_surface_eval(surface, FACET_PRECISE, FACET_SAMPLER_AUTO, wi, wo, n,
                                           &outputs);
    for (size_t c = surface->channels; c < 3; c++) memcpy(fr[c], fr[0], n * sizeof *fr[c]);
    memset(valid, true, n);
    return status;
}

static bool open_material(struct call *call, struct surface *surface, struct measurement *m)
{
    const struct fit_request *in = call->in;
    struct decoder decoder = api_decoder(call);
    struct place place = {NULL, "source", 0};
    if (!api_material_open(in->source, &place, &decoder, surface) ||
        !api_lambert_refuse(in->source, &place, "has no microfacets to fit", call->problem) ||
        !api_transmission_refuse(in->source, &place,
                                 "true is not fitted: the models of a fit only reflect",
                                 call->problem))
        return false;
    const facet_roughness *r = &surface->facet.roughness;
    if (r->slope_x != 0 || r->slope_y != 0)
        return api_problem_at(call->problem, &place,
                              "must have no mean slope: sheared surfaces are not fitted yet");
    bool anisotropic = r->alpha_x != r->alpha_y || r->rho != 0 ||
                       api_material_is_turned(in->source);
    *m = (struct measurement){.format = -1};
    m->source = (facet_fit_source){evaluate_surface, surface, INFINITY, anisotropic, NULL};
    return true;
}

static bool open_source(struct call *call, struct surface *surface, struct measurement *m)
{
    const struct fit_request *in = call->in;
    struct decoder decoder = api_decoder(call);
    struct place source = {NULL, "source", 0}, samples = {NULL, "samples", 0},
                 format = {NULL, "format", 0};
    if (call->medium) {
        size_t told = (size_t)(call->medium - api_measurement_media);
        int which = in->format >= 0 ? in->format : told < FORMAT_COUNT ? (int)told : -1;
        return api_measurement_open(call->request->body, call->request->body_size, which,
                                    call->arena, call->problem, m);
    }
    if (in->format >= 0)
        return api_problem_at(call->problem, &format, "goes with a measurement as the body");
    if (in->source && in->samples)
        return api_problem_at(call->problem, &samples, "excludes source");
    if (in->samples) return api_samples_open(in->samples, &samples, &decoder, m);
    if (in->source) return open_material(call, surface, m);
    return api_problem_at(call->problem, &source,
                          "or samples is required where the body is not a measurement");
}

/* ---- The fit ------------------------------------------------------------------------------ */

static bool choose_options(struct call *call, const struct measurement *m,
                           facet_fit_options *options)
{
    const struct fit_request *in = call->in;
    struct place anisotropic = {NULL, "anisotropic", 0}, model = {NULL, "model", 0};
    if (in->anisotropic == ASK_TRUE && !m->source.anisotropic)
        return api_problem_at(call->problem, &anisotropic,
                              "the source is isotropic: it does not say how it looks when turned");
    facet_fit_spread spread = {.turned = FACET_FIT_TURNED_MIN};
    if (m->source.samples) facet_fit_spread_of(m->source.samples, &spread);
    if (in->anisotropic == ASK_TRUE && spread.turned < FACET_FIT_TURNED_MIN)
        return api_problem_at(
            call->problem, &anisotropic,
            "needs %d pairs of directions (exchanged ones, and such as are turned "
            "by 180 degrees, are one); the samples lie at %zu",
            FACET_FIT_TURNED_MIN, spread.turned);
    if (models_of[in->model] == FACET_FIT_TABULATED && m->source.samples)
        return api_problem_at(
            call->problem, &model,
            "\"tabulated\" needs backscatter at every angle, which samples and UTIA "
            "files do not hold");
    *options = (facet_fit_options){
        .masking = masking_of[in->masking],
        .resolution = in->resolution < 0 ? FACET_FIT_RESOLUTION : (size_t)in->resolution,
        .compact = in->resolution < 0,
        .models = models_of[in->model],
        .anisotropic = in->anisotropic != ASK_FALSE && m->source.anisotropic,
        .diffuse = in->diffuse == 0};
    return true;
}

static bool is_measured(const struct call *call)
{
    const struct fit_request *in = call->in;
    return call->medium || in->samples;
}

static bool describe_data(struct call *call, const struct measurement *m)
{
    struct fit_response *out = call->out;
    if (!is_measured(call)) return true;
    out->data = api_arena_array(call->arena, 1, sizeof *out->data);
    if (!out->data) return api_problem_memory(call->problem);
    *out->data = (struct fit_data){m->format >= 0 ? api_format_names[m->format] : "samples",
                                   m->counts.values, m->counts.missing, m->counts.negative};
    return true;
}

static bool answer(struct call *call, const struct measurement *m, const facet_fit *fit)
{
    const struct fit_request *in = call->in;
    struct fit_response *out = call->out;
    const facet_fit_candidate *chosen;
    const char *asked = in->model ? model_names[in->model] : "";
    if (!describe_data(call, m) || !api_fit_answer(call, fit, in->tolerance, asked, &chosen))
        return false;
    if (in->exported >= 0 && chosen) {
        out->exported = api_arena_array(call->arena, 1, sizeof *out->exported);
        if (!out->exported) return api_problem_memory(call->problem);
        if (!api_export(call, in->exported, fit, chosen, out->exported)) return false;
    }
    const char *type = api_answer_type(call, "application/json");
    if (!strcmp(type, PICTURE_TYPE)) return api_picture(call, &m->source, fit, chosen);
    return true;
}

/* Why nothing could be fitted. */
static bool refuse(struct call *call, const facet_fit_samples *samples)
{
    facet_fit_spread spread = {.round = FACET_FIT_ROUND_MIN};
    if (samples) facet_fit_spread_of(samples, &spread);
    if (samples && spread.used < FACET_FIT_SAMPLES_MIN)
        return api_problem(call->problem, 422,
                           "%zu of the %zu samples have both cosines of 1e-3 or more; at least %d "
                           "are needed",
                           spread.used, samples->count, FACET_FIT_SAMPLES_MIN);
    if (spread.round < FACET_FIT_ROUND_MIN)
        return api_problem(call->problem, 422,
                           "the %zu samples lie at %zu pair%s of directions (turned about the "
                           "normal, mirrored and exchanged ones are one), which a roughness and a "
                           "Fresnel term meet whatever the values; at least %d are needed",
                           spread.used, spread.round, spread.round == 1 ? "" : "s",
                           FACET_FIT_ROUND_MIN);
    return api_problem(call->problem, 422,
                       "the source has no backscatter that a microfacet surface could be "
                       "fitted to");
}

static bool handle(struct call *call)
{
    struct fit_response *out = call->out;
    struct measurement m;
    struct surface surface;
    facet_fit_options options;
    facet_fit fit;
    facet_watch watch = api_watch(call);
    double start = api_clock();
    if (!open_source(call, &surface, &m) || !choose_options(call, &m, &options)) return false;
    facet_status status = facet_fit_create(&m.source, &options, &watch, &fit);
    if (status == FACET_BAD_DATA) return refuse(call, m.source.samples);
    if (status) return api_problem_status(call->problem, status, NULL);
    bool ok = answer(call, &m, &fit);
    facet_fit_clear(&fit);
    double us = api_clock() - start;
    out->timing_ms = round(us / 10) / 100;
    call->response->trace.compute_us += us;
    return ok;
}

static const char *const answers[] = {PICTURE_TYPE, NULL};

const struct endpoint api_endpoint_fit = {
    .method = "POST",
    .path = "/v1/fit",
    .summary = "Fit a material to a measurement",
    .doc = "The body is a measurement, the options then stand in the query: a MERL .binary "
           "(34,992,012 bytes), a UTIA .bin (1,990,656 bytes, anisotropic), an RGL .bsdf, or CSV "
           "(theta_i, phi_i, theta_o, phi_o in radians, r, g, b); or it is JSON with a material "
           "to fit as source, or samples. Slope distribution from backscatter by power iteration "
           "(Dupuy 2015, ch. 4); roughness, Fresnel term and diffuse part by robust least squares "
           "on the logarithm of the whole BRDF. image/svg+xml shows source against fit.",
    .request = request_fields,
    .request_size = sizeof(struct fit_request),
    .response = api_fit_response_fields,
    .response_size = sizeof(struct fit_response),
    .bodies = api_measurement_media,
    .answers = answers,
    .is_long = true,
    .example = "{\"source\":{\"ndf\":\"beckmann\",\"alpha\":0.15},\"model\":\"tabulated\","
               "\"diffuse\":\"false\",\"resolution\":24}",
    .handle = handle,
};
