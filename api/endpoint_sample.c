/* POST /v1/sample: directions wi drawn for wo. */
#include "diffuse.h"
#include "endpoint.h"
#include "evaluate.h"
#include "facet_solid_angle.h"
#include "limits.h"
#include "random.h"
#include "sample_floats.h"
#include "sampler.h"
#include "sequence.h"
#include "transmission.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { WI, WEIGHT, PDF, H, SOLID_ANGLE, OUTPUT_COUNT };

/* Samples drawn and printed at a time: they stay in the second-level cache. */
enum { CHUNK = 8192 };

/* Those of the member `outputs`; solid_angle has one of its own. */
static const char *const output_names[] = {"wi", "weight", "pdf", "h", NULL};
static const char *const array_names[] = {"wi", "weight", "pdf", "h", "solid_angle"};

struct sample_request {
    struct material material;
    struct directions wo;
    struct sent_numbers u; /* pairs */
    struct numbers u_lobe;
    int64_t n, seed;
    int pairing, sampler, sequence;
    uint32_t outputs;
    int64_t channels;
    bool flat, solid_angle;
    int dtype;
    struct tolerance_request accuracy;
};

struct sample_response {
    struct text *of[OUTPUT_COUNT];
    int64_t count, wasted;
    const char *sampler;
    struct accuracy accuracy;
};

#define R(member) MEMBER(struct sample_request, member)

static const struct field request_fields[] = {
    MATERIAL_FIELD(struct sample_request),
    DIRECTIONS_FIELD(struct sample_request, wo, FIELD_MUST, "towards the viewer"),
    {R(u), FIELD_VECTORS, .width = 2, .min = 0, .max = 1, .open_max = true, .min_items = 1,
     .max_items = LIMIT_EVALUATIONS, .as_sent = true,
     .doc = "[u1,u2] per sample; pairs with wo as pairing says"},
    {R(u_lobe), FIELD_NUMBERS, .min = 0, .max = 1, .open_max = true, .min_items = 1,
     .max_items = LIMIT_EVALUATIONS,
     .doc =
         "with u and a material with transmission: one number per element of u, which reflects where it is "
         "below F(theta_d) and else refracts"},
    {R(n), FIELD_INTEGER, .min = 1, .max = LIMIT_EVALUATIONS,
     .doc = "instead of u: samples per wo, all those of the first wo first"},
    {R(seed), FIELD_INTEGER, .min = 0, .max = 0x1p53,
     .doc =
         "with n: where the sequence starts; random: sample k has u = values 2k and 2k + 1 of the "
         "SplitMix64 stream, u_lobe value k of the stream of 2^64 - 1 - seed; 0 by default"},
    SEQUENCE_FIELD(struct sample_request),
    PAIRING_FIELD(struct sample_request, pairing),
    SAMPLER_FIELD(struct sample_request, "how samples are drawn"),
    {R(outputs), FIELD_SET, FIELD_DEFAULT, .names = output_names,
     .initial = 1 << WI | 1 << WEIGHT | 1 << PDF, .doc = "what to return"},
    {R(solid_angle), FIELD_BOOL, FIELD_DEFAULT,
     .doc =
         "return solid_angle, for filtered importance sampling; of the samplers of normals, without a "
         "diffuse part"},
    CHANNELS_FIELD(struct sample_request),
    FLAT_FIELD(struct sample_request),
    DTYPE_FIELD(struct sample_request),
    TOLERANCE_FIELDS(struct sample_request),
    {0},
};

#define OF(id) .offset = offsetof(struct sample_response, of[id]), .type = FIELD_PRINTED

static const struct field response_fields[] = {
    {.name = "wi",
     OF(WI),
     .width = 3,
     .doc =
         "sampled directions, as JSON with 7 digits or more, which keep their length 1; their floor is "
         "direction_floor, and weight and pdf are those of wi before it was rounded to its digits, which a "
         "narrow lobe tells apart"},
    {.name = "weight", OF(WEIGHT), .doc = "fr cos(theta_i) / pdf; 0 below the horizon"},
    {.name = "pdf", OF(PDF), .width = 1, .doc = "density of wi, per steradian"},
    {.name = "h", OF(H), .width = 3, .doc = "sampled micronormals; their floor is direction_floor"},
    {.name = "solid_angle",
     OF(SOLID_ANGLE),
     .width = 1,
     .doc =
         "steradians of wi that the sample stands for: 4 (wo.h) cos^3(theta_h) A with "
         "A = pi max(alpha_1, alpha_2)^2/N, N samples per wo; 1/(N pdf) is what samples take on average"},
    COUNT_FIELD(struct sample_response),
    {MEMBER(struct sample_response, wasted), FIELD_INTEGER, FIELD_MUST, .min = 0, .max = 0x1p53,
     .doc = "samples below the horizon, weight 0; with transmission those of weight 0"},
    {MEMBER(struct sample_response, sampler), FIELD_TEXT, FIELD_MUST, .doc = "the method used"},
    ACCURACY_FIELD(struct sample_response),
    {0},
};

struct job {
    const struct sample_request *in;
    struct surface surface;
    struct plan wo;
    struct pairing pairing; /* first: wo, second: u */
    struct promise promise;
    double input_error; /* of wo, times facet_closeness of all of them */
    facet_depth depth;  /* of all wo */
    bool is_dense;      /* with transmission: some wo are on the side of the larger index */
    double *from[3], *u[3], *wi[3], *h[3], *weight[3], *pdf, *solid_angle;
    struct results results[OUTPUT_COUNT];
    struct representation representation;
    facet_sampler sampler;
    size_t channels, wasted;
};

static bool asked(const struct job *job, int output)
{
    return output == SOLID_ANGLE ? job->in->solid_angle : job->in->outputs >> output & 1;
}

static double depth_error(const struct job *job, facet_tier tier, const facet_depth *depth)
{
    return facet_sample_depth_error(job->surface.brdf, tier, job->sampler, depth);
}

static bool bound_of(const void *asked_, facet_tier tier, double *bound)
{
    const struct job *job = asked_;
    bool promised = job->surface.bsdf
                        ? api_transmission_sample_bound(&job->surface, tier, job->sampler,
                                                        job->is_dense, job->input_error, bound)
                        : api_surface_sample_bound(&job->surface, tier, job->sampler,
                                                   job->input_error, bound);
    if (!promised) return false;
    *bound += job->surface.parameter_error + depth_error(job, tier, &job->depth);
    *bound = api_represented(&job->representation, *bound);
    return true;
}

/* u as a list, and not n. */
static bool is_listed(const struct sample_request *in)
{
    return in->u.numbers.values || in->u.floats;
}

/* Beside a listed u, and with it alone. */
static bool check_lobe(const struct sample_request *in, struct problem *problem)
{
    struct place at = {NULL, "u_lobe", 0};
    bool wanted = in->material.transmission && is_listed(in);
    if (wanted && !in->u_lobe.values)
        return api_problem_at(problem, &at, "is required with u and transmission");
    if (!wanted && in->u_lobe.values)
        return api_problem_at(problem, &at,
                              in->material.transmission ? "needs u"
                                                        : "needs a material with transmission");
    if (wanted && in->u_lobe.count != in->u.numbers.count)
        return api_problem_at(problem, &at, "has %zu elements, u has %zu", in->u_lobe.count,
                              in->u.numbers.count);
    return true;
}

/* u as a list pairs like directions; n per wo is every k of n with every wo. */
static bool pair_up(struct job *job, struct problem *problem)
{
    static const char *const names[] = {"wo", "u"};
    const struct sample_request *in = job->in;
    bool by_n = in->n > 0, by_list = is_listed(in);
    struct place u = {NULL, "u", 0}, n = {NULL, "n", 0}, seed = {NULL, "seed", 0},
                 sequence = {NULL, "sequence", 0};
    if (by_n == by_list)
        return api_problem_at(problem, by_n ? &n : &u, by_n ? "excludes u" : "or n is required");
    if (in->seed >= 0 && !by_n) return api_problem_at(problem, &seed, "needs n");
    if (in->sequence != SEQUENCE_RANDOM && !by_n)
        return api_problem_at(problem, &sequence, "needs n");
    if (by_list)
        return api_pairing(job->wo.count, in->u.numbers.count, in->pairing, names, problem,
                           &job->pairing);
    if ((size_t)in->n > LIMIT_EVALUATIONS / job->wo.count)
        return api_problem_at(problem, &n, "%lld samples of %zu directions are outside [1, %d]",
                              (long long)in->n, job->wo.count, LIMIT_EVALUATIONS);
    job->pairing = (struct pairing){job->wo.count, (size_t)in->n, (size_t)in->n * job->wo.count,
                                    true};
    return true;
}

static void listed_u(const struct sent_numbers *u, size_t i, double *u1, double *u2)
{
    float f[2];
    if (u->floats) {
        memcpy(f, (const char *)u->floats + i * sizeof f, sizeof f);
        *u1 = f[0];
        *u2 = f[1];
    } else {
        *u1 = u->numbers.values[2 * i];
        *u2 = u->numbers.values[2 * i + 1];
    }
}

static void fill_u(const struct job *job, size_t start, size_t n)
{
    const bool by_list = is_listed(job->in);
    const struct sample_request *in = job->in;
    uint64_t seed = in->seed < 0 ? 0 : (uint64_t)in->seed;
    for (size_t i = 0; i < n; i++) {
        size_t k = start + i;
        if (by_list) {
            size_t at = job->pairing.outer         ? k % in->u.numbers.count
                        : in->u.numbers.count == 1 ? 0
                                                   : k;
            listed_u(&in->u, at, &job->u[0][i], &job->u[1][i]);
            if (job->surface.bsdf) job->u[2][i] = in->u_lobe.values[at];
        } else {
            uint64_t each = (uint64_t)in->n;
            double u[2];
            api_sequence((enum sequence)in->sequence, seed, k / each, k % each, each, u);
            job->u[0][i] = u[0];
            job->u[1][i] = u[1];
            if (job->surface.bsdf) job->u[2][i] = api_random(~seed, k);
        }
    }
}

static bool allocate(struct job *job, struct arena *arena)
{
    size_t n = job->pairing.count < CHUNK ? job->pairing.count : CHUNK;
    double **const wanted[] = {&job->from[0], &job->from[1], &job->from[2], &job->u[0],
                               &job->u[1],    &job->wi[0],   &job->wi[1],   &job->wi[2]};
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++)
        if (!(*wanted[i] = api_arena_doubles(arena, n))) return false;
    for (size_t k = 0; k < 3 && asked(job, H); k++)
        if (!(job->h[k] = api_arena_doubles(arena, n))) return false;
    if (job->surface.bsdf && !(job->u[2] = api_arena_doubles(arena, n))) return false;
    /* with transmission the weight says what is wasted */
    for (size_t k = 0; k < job->surface.channels && (asked(job, WEIGHT) || job->surface.bsdf); k++)
        if (!(job->weight[k] = api_arena_doubles(arena, n))) return false;
    if (asked(job, SOLID_ANGLE) && !(job->solid_angle = api_arena_doubles(arena, n))) return false;
    return !asked(job, PDF) || (job->pdf = api_arena_doubles(arena, n));
}

static void open_results(struct job *job, struct arena *arena)
{
    /* However coarse the bound: a direction of length 1 is to be one when it is sent back. */
    enum { DIRECTION_DIGITS = 7 };
    const size_t widths[OUTPUT_COUNT] = {3, job->channels, 1, 3, 1};
    for (int i = 0; i < OUTPUT_COUNT; i++) {
        const int least = i == WI || i == H ? DIRECTION_DIGITS : 1, digits = job->promise.digits;
        api_results_open_as(&job->results[i], arena, job->representation.format, widths[i],
                            job->in->flat, digits < least ? least : digits);
    }
}

static bool print_chunk(struct call *call, struct job *job, size_t n)
{
    double *const *w = job->weight;
    double *weight[3] = {w[0], w[1] ? w[1] : w[0], w[2] ? w[2] : w[0]};
    double *pdf[1] = {job->pdf}, *solid_angle[1] = {job->solid_angle};
    double *const *const columns[OUTPUT_COUNT] = {job->wi, weight, pdf, job->h, solid_angle};
    for (int i = 0; i < OUTPUT_COUNT; i++) {
        if (asked(job, i) && !api_results_add(&job->results[i], columns[i], n))
            return api_results_check(&job->results[i], array_names[i], "sample", call->problem);
    }
    return true;
}

/* How floats do it where they do; wasted counts on. */
static struct float_samples float_samples_of(struct job *job)
{
    struct results *r[OUTPUT_COUNT];
    for (int i = 0; i < OUTPUT_COUNT; i++) r[i] = asked(job, i) ? &job->results[i] : NULL;
    return (struct float_samples){&job->surface,
                                  job->promise.tier,
                                  job->sampler,
                                  &job->wo,
                                  &job->in->u,
                                  &job->pairing,
                                  r[WI],
                                  r[WEIGHT],
                                  r[PDF],
                                  r[H],
                                  0};
}

static bool compute(struct call *call, struct job *job)
{
    struct float_samples floats = float_samples_of(job);
    const bool on_floats = !asked(job, SOLID_ANGLE) &&
                           api_takes_float_samples(&floats, job->representation.format);
    const size_t most = on_floats ? SAMPLE_FLOATS_MAX : CHUNK;
    struct api_trace *trace = &call->response->trace;
    facet_samples samples = {{job->wi[0], job->wi[1], job->wi[2]},
                             {job->h[0], job->h[1], job->h[2]},
                             {job->weight[0], job->weight[1], job->weight[2]},
                             job->pdf};
    facet_vec3_in from = {job->from[0], job->from[1], job->from[2]};
    for (size_t i = 0, n; i < job->pairing.count; i += n) {
        n = job->pairing.count - i < most ? job->pairing.count - i : most;
        if (!api_still_wanted(call)) return false;
        double start = api_clock();
        trace->evaluations += n;
        if (on_floats && api_add_float_samples(&floats, i, n)) {
            trace->compute_us += api_clock() - start;
            continue;
        }
        api_pairing_fill(&job->pairing, true, &job->wo, i, n, job->from);
        fill_u(job, i, n);
        facet_status status = job->surface.bsdf
                                  ? facet_bsdf_sample(job->surface.bsdf, job->promise.tier,
                                                      job->sampler, from, job->u[0], job->u[1],
                                                      job->u[2], n, &samples)
                                  : api_surface_sample(&job->surface, job->promise.tier,
                                                       job->sampler, from, job->u[0], job->u[1], n,
                                                       &samples);
        if (status) return api_problem_status(call->problem, status, NULL);
        if (asked(job, SOLID_ANGLE))
            facet_solid_angle(
                &job->surface.facet.roughness, (double)(job->pairing.count / job->wo.count),
                (facet_vec3_in){job->wi[0], job->wi[1], job->wi[2]}, from, n, job->solid_angle);
        for (size_t k = 0; k < n; k++)
            job->wasted += !((job->surface.bsdf ? job->weight[0] : job->wi[2])[k] > 0);
        double computed = api_clock();
        trace->compute_us += computed - start;
        if (!print_chunk(call, job, n)) return false;
        trace->encode_us += api_clock() - computed;
    }
    job->wasted += floats.wasted;
    return true;
}

/* What the bound needs to know of every wo before a tier can be chosen: fills input_error and is_dense. */
static bool survey_wo(struct call *call, struct job *job)
{
    double error = job->wo.input_error;
    facet_vec3_in wo = {job->from[0], job->from[1], job->from[2]};
    job->input_error = error;
    const facet_depth deepest = {DBL_MAX, DBL_MAX, DBL_MAX};
    const bool deep = depth_error(job, FACET_PRECISE, &deepest) > 0;
    for (size_t i = 0, n; (error > 0 || job->surface.bsdf || deep) && i < job->wo.count; i += n) {
        n = job->wo.count - i < CHUNK ? job->wo.count - i : CHUNK;
        if (!api_still_wanted(call)) return false;
        api_plan_fill(&job->wo, i, n, job->from[0], job->from[1], job->from[2]);
        bool below_is_dense = job->surface.facet.fresnel.eta[0] > 1;
        for (size_t k = 0; k < n; k++)
            job->is_dense = job->is_dense || (wo.z[k] < 0) == below_is_dense;
        job->input_error = fmax(job->input_error,
                                error * facet_closeness(job->surface.brdf, wo, wo, n, true));
        if (deep) facet_depth_survey(job->surface.brdf, job->sampler, wo, wo, n, &job->depth);
    }
    return true;
}

/* It is of slopes: those of a cosine sample are not the material's. */
static bool check_solid_angle(const struct job *job, struct problem *problem)
{
    struct place at = {NULL, "solid_angle", 0};
    if (!job->in->solid_angle) return true;
    if (job->sampler == FACET_SAMPLER_COSINE)
        return api_problem_at(problem, &at, "is of the samplers of normals, not of \"cosine\"");
    if (job->surface.facet.ndf == FACET_TABULATED)
        return api_problem_at(
            problem, &at,
            "is of \"ggx\" and \"beckmann\", whose roughness says how wide a sample is");
    return !(job->surface.has_diffuse || job->surface.bsdf) ||
           api_problem_at(problem, &at,
                          "is of materials without a diffuse part and without transmission");
}

static bool prepare(struct call *call, struct job *job)
{
    struct decoder decoder = api_decoder(call);
    struct place material = {NULL, "material", 0}, wo = {NULL, "wo", 0};
    const struct sample_request *in = job->in;
    if (!api_plan(&in->wo, &wo, &decoder, &job->wo) || !pair_up(job, call->problem) ||
        !check_lobe(in, call->problem) ||
        !api_material_open(&in->material, &material, &decoder, &job->surface))
        return false;
    job->sampler = api_sampler_of(&job->surface, job->sampler);
    job->channels = api_channels(in->channels, job->surface.channels, call->problem);
    if (!job->channels || !check_solid_angle(job, call->problem)) return false;
    size_t numbers = (asked(job, WI) ? 3 : 0) + (asked(job, WEIGHT) ? job->channels : 0) +
                     asked(job, PDF) + (asked(job, H) ? 3 : 0) + asked(job, SOLID_ANGLE);
    if (!api_numbers_fit(job->pairing.count, numbers, call->problem)) return false;
    if (!allocate(job, call->arena)) return api_problem_memory(call->problem);
    if (!survey_wo(call, job)) return false;
    if (!api_represent(call, in->dtype, &in->accuracy,
                       (size_t)__builtin_popcount(in->outputs) + in->solid_angle,
                       &job->representation) ||
        !api_promise(&in->accuracy, bound_of, job,
                     api_bound_obstacle(&job->surface, 1,
                                        depth_error(job, FACET_PRECISE, &job->depth),
                                        job->input_error),
                     call->problem, &job->promise) ||
        (asked(job, WEIGHT) && !api_surface_ready(&job->surface, job->promise.tier, call->problem)))
        return false;
    api_represent_bound(&job->representation, &in->accuracy, &job->promise);
    open_results(job, call->arena);
    return true;
}

static bool answer(struct call *call, struct job *job)
{
    struct sample_response *out = call->out;
    struct named_results arrays[OUTPUT_COUNT];
    size_t count = 0;
    for (int i = 0; i < OUTPUT_COUNT; i++) {
        if (!asked(job, i)) continue;
        api_results_close(&job->results[i]);
        arrays[count++] = (struct named_results){array_names[i], &job->results[i]};
        if (job->representation.format == RESULTS_JSON) out->of[i] = &job->results[i].text;
    }
    return job->representation.format == RESULTS_JSON ||
           api_answer_arrays(call, &job->representation, arrays, count);
}

static bool handle(struct call *call)
{
    struct sample_response *out = call->out;
    double start = api_clock();
    struct job *job = api_arena_array(call->arena, 1, sizeof *job);
    if (!job) return api_problem_memory(call->problem);
    job->in = call->in;
    if (!api_sampler(job->in->sampler, true, &job->in->material, call->problem, &job->sampler) ||
        !prepare(call, job))
        return false;
    out->sampler = api_sampler_names[job->sampler];
    call->response->trace.decode_us += api_clock() - start;
    call->response->trace.tier = api_tier_names[job->promise.tier];
    if (!compute(call, job)) return false;
    out->count = (int64_t)job->pairing.count;
    out->wasted = (int64_t)job->wasted;
    out->accuracy = (struct accuracy){api_tier_names[job->promise.tier], job->promise.bound,
                                      FACET_FLOOR, asked(job, WI) || asked(job, H) ? 1 : NAN, NAN};
    return answer(call, job);
}

const struct endpoint api_endpoint_sample = {
    .method = "POST",
    .path = "/v1/sample",
    .summary = "Sample directions of light for directions of view",
    .request = request_fields,
    .request_size = sizeof(struct sample_request),
    .response = response_fields,
    .response_size = sizeof(struct sample_response),
    .answers = api_array_answers,
    .is_long = true,
    .grows_by_words = true,
    .example = "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[-0.6,0,0.8]],"
               "\"u\":[[0.25,0.5],[0.5,0.75]]}",
    .handle = handle,
};
