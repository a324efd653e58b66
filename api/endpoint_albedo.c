/* POST /v1/albedo: what a surface reflects in all, by quadrature. */
#include "diffuse.h"
#include "endpoint.h"
#include "evaluate.h"
#include "facet_albedo.h"
#include "limits.h"
#include "transmission.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

struct albedo_request {
    struct material material;
    struct directions wo;
    bool average;
    int64_t channels;
    bool flat;
    struct tolerance_request accuracy;
};

struct albedo_response {
    struct text *albedo, *transmitted;
    struct colour average;
    int64_t count;
    struct accuracy accuracy;
};

#define R(member) MEMBER(struct albedo_request, member)

static const struct field request_fields[] = {
    MATERIAL_FIELD(struct albedo_request),
    DIRECTIONS_FIELD(struct albedo_request, wo, FIELD_MAY, "towards the viewer; at most 4096"),
    {R(average), FIELD_BOOL, FIELD_DEFAULT,
     .doc = "also the cosine-weighted mean over the hemisphere of wo"},
    CHANNELS_FIELD(struct albedo_request),
    FLAT_FIELD(struct albedo_request),
    {.name = "tolerance",
     .offset = offsetof(struct albedo_request, accuracy.tolerance),
     .type = FIELD_NUMBER,
     .min = 1e-15,
     .max = 0.1,
     .doc = "largest relative error accepted in each number, quadrature included; 1e-6 by default"},
    {0},
};

static const struct field response_fields[] = {
    {MEMBER(struct albedo_response, albedo), FIELD_PRINTED,
     .doc =
         "integral of fr cos(theta_i) over wi, for each wo; 0 below the horizon. With transmission: "
         "over wi on wo's side, whichever it is"},
    {MEMBER(struct albedo_response, transmitted), FIELD_PRINTED,
     .doc =
         "with transmission: the same over wi on the other side. With transport importance the two "
         "add up to 1 minus what masking loses"},
    {MEMBER(struct albedo_response, average), FIELD_COLOUR, .min = 0, .max = 0x1p1000,
     .doc = "1/pi integral of albedo cos(theta_o) over wo"},
    COUNT_FIELD(struct albedo_response),
    ACCURACY_FIELD(struct albedo_response),
    {0},
};

struct job {
    const struct albedo_request *in;
    struct surface surface;
    struct plan wo;
    size_t count, channels;
    double *from[3];
    facet_albedo_value *value, *transmitted, mean; /* transmitted NULL without transmission */
    double bound;
    struct promise promise;
    struct results results, beyond; /* of albedo, of transmitted */
};

/*
 * A direction that was computed is off by input_error: over how much of it does
 * the albedo change by itself?  Grazing, over the cosine or the roughness, the larger.
 */
static double direction_error(const struct job *job, size_t i)
{
    if (job->surface.is_lambert) return 0;
    const facet_roughness *r = &job->surface.facet.roughness;
    double lean = fabs(r->slope_x) + fabs(r->slope_y), z = fabs(job->from[2][i]);
    double c = job->from[2][i] - job->from[0][i] * r->slope_x - job->from[1][i] * r->slope_y;
    double scale = fmax(fmin(z, fabs(c)), facet_roughness_to_ellipse(r).alpha_2);
    return job->wo.input_error * 16 * (1 + lean) / fmin(scale, 1);
}

static void widen(struct job *job, const facet_albedo_value *value, double more)
{
    for (size_t c = 0; c < job->surface.channels; c++) {
        double relative = value->error[c] / fmax(fabs(value->value[c]), FACET_FLOOR);
        job->bound = fmax(job->bound, relative + more + job->surface.parameter_error);
    }
}

/* (1 - kd) of the specular albedo, and kd: like signs, so that the error is at most the specular one. */
static void add_diffuse(const struct job *job, facet_albedo_value *albedo)
{
    for (size_t c = 0; c < job->surface.channels; c++)
        albedo->value[c] = api_diffuse_albedo(&job->surface, c, albedo->value[c]);
}

/* Of the specular part; a Lambert surface has none, and what it reflects is known. */
static facet_status integrate(struct call *call, struct job *job)
{
    if (job->surface.is_lambert) return FACET_OK;
    struct api_trace *trace = &call->response->trace;
    double tolerance = isnan(job->in->accuracy.tolerance) ? TOLERANCE_DEFAULT
                                                          : job->in->accuracy.tolerance;
    size_t each = job->count ? LIMIT_ALBEDO_EVALUATIONS / job->count : 0, spent = 0, mean = 0;
    facet_albedo_options options = {
        .tolerance = fmax(0.5 * tolerance, 1e-15), /* the rest is for evaluation and printing */
        .evaluations_max = each < 1 << 22 ? each : 1 << 22,
        .watch = api_watch(call),
    };
    facet_vec3_in wo = {job->from[0], job->from[1], job->from[2]};
    double start = api_clock();
    facet_status status = job->transmitted
                              ? facet_bsdf_albedo(job->surface.bsdf, wo, job->count, &options,
                                                  job->value, job->transmitted, &spent)
                              : facet_albedo(&job->surface.facet, wo, job->count, &options,
                                             job->value, &spent);
    options.evaluations_max = LIMIT_ALBEDO_EVALUATIONS / 2;
    if (!status && job->in->average)
        status = facet_albedo_average(&job->surface.facet, &options, &job->mean, &mean);
    trace->compute_us += api_clock() - start;
    trace->evaluations += spent + mean;
    return status;
}

static bool compute(struct call *call, struct job *job)
{
    facet_status status = integrate(call, job);
    if (status) return api_problem_status(call->problem, status, NULL);
    for (size_t i = 0; i < job->count; i++) {
        double z = job->from[2][i];
        if (!(job->transmitted ? z != 0 : z > 0)) continue;
        widen(job, &job->value[i], direction_error(job, i));
        if (job->transmitted) widen(job, &job->transmitted[i], direction_error(job, i));
        add_diffuse(job, &job->value[i]);
    }
    if (job->in->average) {
        widen(job, &job->mean, 0);
        add_diffuse(job, &job->mean);
    }
    return true;
}

static bool bound_of(const void *asked, facet_tier tier, double *bound)
{
    const struct job *job = asked;
    *bound = job->bound;
    return tier == FACET_PRECISE;
}

/* Seen from behind its mean facet, a narrow surface shows its far tail alone: an albedo near or below the floor. */
static const char *obstacle(const struct job *job)
{
    const facet_roughness *r = &job->surface.facet.roughness;
    for (size_t i = 0; i < job->count; i++) {
        double c = job->from[2][i] - job->from[0][i] * r->slope_x - job->from[1][i] * r->slope_y;
        if (job->from[2][i] > 0 && c < 0)
            return "some wo see the mean facet from behind, where a narrow surface shows its far tail alone and the "
                   "quadrature finds too little; more roughness, less mean slope or other wo have one";
    }
    return "the quadrature ended with an error as large as the albedo; more roughness, less mean slope, or no "
           "average, has one";
}

/* Albedos are looked at: only the digits that the tolerance needs. */
static bool promise(struct call *call, struct job *job)
{
    struct tolerance_request request = {job->in->accuracy.tolerance, -1};
    if (!api_promise(&request, bound_of, job, obstacle(job), call->problem, &job->promise))
        return false;
    api_promise_fewer_digits(&request, &job->promise);
    return true;
}

static bool print_values(struct call *call, struct job *job, facet_albedo_value *values,
                         struct results *results)
{
    api_results_open(results, call->arena, job->channels, job->in->flat, job->promise.digits);
    for (size_t i = 0; i < job->count; i++) {
        double *v = values[i].value, *rest = job->surface.channels == 3 ? v + 1 : v;
        double *columns[3] = {v, rest, job->surface.channels == 3 ? v + 2 : v};
        if (!api_results_add(results, columns, 1))
            return api_problem(call->problem, 500, "the albedo of direction %zu is not finite", i);
    }
    api_results_close(results);
    return true;
}

static bool print(struct call *call, struct job *job, struct albedo_response *out)
{
    if (!print_values(call, job, job->value, &job->results)) return false;
    if (job->count) out->albedo = &job->results.text;
    if (job->transmitted && !print_values(call, job, job->transmitted, &job->beyond)) return false;
    if (job->transmitted) out->transmitted = &job->beyond.text;
    if (!job->in->average) return true;
    out->average.channels = job->channels;
    for (size_t c = 0; c < job->channels; c++) { /* to the same digits */
        char text[NUMBER_ROOM];
        double value = job->mean.value[job->surface.channels == 3 ? c : 0];
        snprintf(text, sizeof text, "%.*e", job->promise.digits - 1, value);
        out->average.value[c] = strtod(text, NULL);
    }
    return true;
}

static bool prepare(struct call *call, struct job *job)
{
    struct decoder decoder = api_decoder(call);
    const struct place material = {NULL, "material", 0}, wo = {NULL, "wo", 0};
    const struct albedo_request *in = job->in;
    bool has_wo = in->wo.form >= 0;
    if (!has_wo && !in->average)
        return api_problem_at(call->problem, &wo, "or average is required");
    if (has_wo && !api_plan(&in->wo, &wo, &decoder, &job->wo)) return false;
    job->count = has_wo ? job->wo.count : 0;
    if (job->count > LIMIT_ALBEDO_DIRECTIONS)
        return api_problem_at(call->problem, &wo, "%zu directions are outside [1, %d]", job->count,
                              LIMIT_ALBEDO_DIRECTIONS);
    if (!api_material_open(&in->material, &material, &decoder, &job->surface) ||
        (in->average &&
         !api_transmission_refuse(&in->material, &material,
                                  "true has no mean albedo: ask for directions, without average",
                                  call->problem)))
        return false;
    job->channels = api_channels(in->channels, job->surface.channels, call->problem);
    if (!job->channels) return false;
    for (int k = 0; k < 3; k++)
        if (!(job->from[k] = api_arena_doubles(call->arena, job->count + 1)))
            return api_problem_memory(call->problem);
    job->value = api_arena_array(call->arena, job->count + 1, sizeof *job->value);
    if (!job->value) return api_problem_memory(call->problem);
    if (job->surface.bsdf && !(job->transmitted = api_arena_array(call->arena, job->count + 1,
                                                                  sizeof *job->transmitted)))
        return api_problem_memory(call->problem);
    if (has_wo) api_plan_fill(&job->wo, 0, job->count, job->from[0], job->from[1], job->from[2]);
    return true;
}

static bool handle(struct call *call)
{
    struct albedo_response *out = call->out;
    double start = api_clock();
    struct job *job = api_arena_array(call->arena, 1, sizeof *job);
    if (!job) return api_problem_memory(call->problem);
    job->in = call->in;
    if (!prepare(call, job)) return false;
    call->response->trace.decode_us += api_clock() - start;
    call->response->trace.tier = api_tier_names[FACET_PRECISE];
    if (!compute(call, job) || !promise(call, job) || !print(call, job, out)) return false;
    out->count = (int64_t)job->count;
    out->accuracy = (struct accuracy){api_tier_names[job->promise.tier], job->promise.bound,
                                      FACET_FLOOR, NAN, NAN};
    return true;
}

const struct endpoint api_endpoint_albedo = {
    .method = "POST",
    .path = "/v1/albedo",
    .summary = "Directional albedo and its mean, by quadrature",
    .doc = "With the ideal Fresnel term this is the white furnace: 1 minus what masking loses. "
           "A tolerance that the quadrature does not reach is refused with the bound it reached.",
    .request = request_fields,
    .request_size = sizeof(struct albedo_request),
    .response = response_fields,
    .response_size = sizeof(struct albedo_response),
    .is_long = true,
    .example = "{\"material\":{\"ndf\":\"ggx\",\"alpha\":1},\"wo\":[[0,0,1]],\"tolerance\":1e-9}",
    .handle = handle,
};
