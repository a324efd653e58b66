#include "evaluate_job.h"

#include "diffuse.h"
#include "lambert.h"
#include "limits.h"
#include "sampler.h"
#include "transmission.h"

#include <float.h>
#include <math.h>

size_t api_channels(int64_t requested, size_t material, struct problem *problem)
{
    struct place at = {NULL, "channels", 0};
    if (requested < 0) return material;
    if (requested == 3 || (requested == 1 && material == 1)) return (size_t)requested;
    if (requested == 1)
        api_problem_at(problem, &at,
                       "1 is too few: the material is coloured, its results are [r,g,b]");
    else
        api_problem_at(problem, &at, "%lld must be 1 or 3", (long long)requested);
    return 0;
}

bool api_numbers_fit(size_t count, size_t per_element, struct problem *problem)
{
    struct place at = {NULL, "outputs", 0};
    if (count <= LIMIT_NUMBERS / per_element) return true;
    return api_problem_at(
        problem, &at,
        "%zu elements of %zu numbers are more than the %d numbers of one answer: ask for fewer "
        "outputs, or for at most %zu elements",
        count, per_element, LIMIT_NUMBERS, LIMIT_NUMBERS / per_element);
}

/*
 * Whether the bounds of results in floats hold for what is answered, the rounding in the answer
 * included: a tier in floats hands out floats, in whichever array.
 */
static bool are_floats(const struct job *job)
{
    return job->evaluation->representation.format == RESULTS_FLOAT32 &&
           api_surface_takes_floats(&job->surface);
}

static bool kernel_bound(const struct job *job, facet_tier tier, facet_quantity quantity,
                         double *bound)
{
    const facet_brdf *brdf = job->surface.brdf;
    double error = job->input_error;
    *bound = error; /* a product of the cosine, at most */
    if (job->surface.is_lambert) return true;
    if (job->surface.bsdf)
        return api_transmission_bound(&job->surface, tier, quantity, error, bound);
    if (quantity != FACET_PDF)
        return are_floats(job) ? facet_bound_float(brdf, tier, quantity, error, bound)
                               : facet_bound(brdf, tier, quantity, error, bound);
    return are_floats(job)
               ? facet_pdf_bound_float(brdf, tier, job->evaluation->sampler, error, bound)
               : facet_pdf_bound(brdf, tier, job->evaluation->sampler, error, bound);
}

double api_depth_error(const struct job *job, facet_tier tier, const facet_depth *depth)
{
    double worst = 0;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (api_is_asked(job, q))
            worst = fmax(worst, facet_depth_error(job->surface.brdf, tier, (facet_quantity)q,
                                                  job->evaluation->sampler, depth));
    return worst;
}

static bool bound_of(const void *job_, facet_tier tier, double *bound)
{
    const struct job *job = job_;
    *bound = 0;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        double b;
        if (!api_is_asked(job, q)) continue;
        if (!kernel_bound(job, tier, (facet_quantity)q, &b)) return false;
        b += job->surface.parameter_error + api_surface_error(&job->surface) +
             facet_depth_error(job->surface.brdf, tier, (facet_quantity)q, job->evaluation->sampler,
                               &job->depth);
        if (q == FACET_FR || q == FACET_FR_COS || q == FACET_G) b *= job->condition;
        if (b > *bound) *bound = b;
    }
    if (!are_floats(job)) *bound = api_represented(&job->evaluation->representation, *bound);
    return true;
}

/* Of a material that floats evaluate as it is, directions that floats hold. */
static bool takes_floats(const struct job *job)
{
    return job->evaluation->representation.format != RESULTS_FLOAT64 &&
           api_surface_takes_floats(&job->surface) && api_pairs_are_floats(&job->pairs);
}

const char *api_bound_obstacle(const struct surface *surface, double condition, double depth_error,
                               double input_error)
{
    const facet_roughness *r = &surface->facet.roughness;
    if (depth_error >= 1)
        return "from so far behind the mean facets a table tells nothing of what is seen; GGX and Beckmann have "
               "other samplers";
    if (condition > 1 / DBL_EPSILON)
        return "shear \"thesis\" divides by what cancels or underflows at these directions; \"energy_safe\" does "
               "not";
    if (surface->parameter_error >= 1)
        return "the slopes' covariance is so close to singular that rounding leaves nothing of it; alpha_1, "
               "alpha_2 and phi, or a rougher base, keep it";
    if (input_error > 0)
        return "these directions were computed, and their rounding is too much for this surface; send them as "
               "vectors";
    if (r->slope_x != 0 || r->slope_y != 0)
        return "the mean slope is so many times the roughness that its rounding hides the surface; less mean "
               "slope or more roughness has one";
    if (surface->facet.ndf == FACET_TABULATED)
        return "a table whose log_D jumps this much between nodes, or a Fresnel term this steep, magnifies every "
               "rounding; a smoother one has a bound";
    return "a Fresnel term this steep magnifies every rounding";
}

static void join_round(struct job *job)
{
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (size_t i = 0; i < job->used && api_is_asked(job, q); i++) {
            const struct slot *slot = &job->slots[i];
            struct results *r = &job->results[q];
            r->count += slot->n;
            if (r->format == RESULTS_JSON)
                api_text_bytes(&r->text, slot->bytes[q], slot->size[q]);
            else
                api_text_commit(&r->text, slot->size[q]); /* it was written there */
        }
}

/* The places in whole arrays of the slots that the next round will use. */
static void move_slots(struct job *job, size_t at)
{
    if (job->evaluation->representation.format == RESULTS_JSON) return;
    size_t chunks = (job->pairs.pairing.count - at + CHUNK - 1) / CHUNK;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (size_t i = 0; i < job->slot_count && i < chunks && api_is_asked(job, q); i++)
            job->slots[i].bytes[q] += api_results_room(&job->results[q], CHUNK) * job->slot_count;
}

static bool compute(struct call *call, struct job *job)
{
    const uint32_t outputs = job->evaluation->outputs;
    if (!api_open_slots(call, job, outputs, false)) return false;
    for (size_t at = 0; at < job->pairs.pairing.count; move_slots(job, at)) {
        if (!api_run_round(call, job, outputs, &at)) return false;
        join_round(job);
    }
    call->response->trace.evaluations += job->pairs.pairing.count;
    return true;
}

static void open_results(struct job *job, struct arena *arena)
{
    const struct evaluation *evaluation = job->evaluation;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (api_is_asked(job, q))
            api_results_open_as(&job->results[q], arena, evaluation->representation.format,
                                api_width_of(job, q), evaluation->flat, job->promise.digits);
}

size_t api_numbers_per_pair(const struct job *job)
{
    size_t n = 0;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (api_is_asked(job, q)) n += api_width_of(job, q);
    return n;
}

static void list_arrays(struct job *job, struct evaluation *evaluation)
{
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (api_is_asked(job, q))
            evaluation->arrays[evaluation->array_count++] = (struct named_results){
                api_quantity_names[q], &job->results[q]};
}

static void close_results(struct job *job, struct evaluation *evaluation)
{
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        if (!api_is_asked(job, q)) continue;
        api_results_close(&job->results[q]);
        if (evaluation->representation.format == RESULTS_JSON)
            evaluation->of[q] = &job->results[q].text;
    }
}

bool api_answer_evaluation(struct call *call, const struct evaluation *evaluation)
{
    if (evaluation->job) return api_start_stream(call, evaluation->job, evaluation);
    if (evaluation->representation.format == RESULTS_JSON) return true;
    return api_answer_arrays(call, &evaluation->representation, evaluation->arrays,
                             evaluation->array_count);
}

/* G and G1 divide by a sigma that may underflow where the mean slope turns the surface away. */
static double ceiling_of(const struct job *job)
{
    const facet_roughness *r = &job->surface.facet.roughness;
    const bool divides = api_is_asked(job, FACET_G) || api_is_asked(job, FACET_G1_I) ||
                         api_is_asked(job, FACET_G1_O);
    return divides && (r->slope_x != 0 || r->slope_y != 0) ? DBL_MAX : NAN;
}

bool api_evaluate(struct call *call, struct evaluation *evaluation)
{
    struct decoder decoder = api_decoder(call);
    struct place material = {NULL, "material", 0};
    double start = api_clock();
    struct job *job = api_arena_array(call->arena, 1, sizeof *job);
    if (!job) return api_problem_memory(call->problem);
    job->evaluation = evaluation;
    if (!api_pairs(evaluation->pairs, &decoder, &job->pairs) ||
        !api_material_open(evaluation->material, &material, &decoder, &job->surface) ||
        !api_lambert_check_outputs(evaluation->material, evaluation->outputs, call->problem))
        return false;
    evaluation->sampler = api_sampler_of(&job->surface, evaluation->sampler);
    job->channels = api_channels(evaluation->channels, job->surface.channels, call->problem);
    if (!job->channels ||
        !api_numbers_fit(job->pairs.pairing.count, api_numbers_per_pair(job), call->problem))
        return false;
    list_arrays(job, evaluation);
    if (!api_represent(call, evaluation->dtype, evaluation->accuracy, evaluation->array_count,
                       &evaluation->representation) ||
        !api_survey_pairs(call, job))
        return false;
    job->takes_floats = takes_floats(job);
    if (!api_promise(evaluation->accuracy, bound_of, job,
                     api_bound_obstacle(&job->surface, job->condition,
                                        api_depth_error(job, FACET_PRECISE, &job->depth),
                                        job->input_error),
                     call->problem, &job->promise) ||
        !api_surface_ready(&job->surface, job->promise.tier, call->problem))
        return false;
    api_promise_fewer_digits(evaluation->accuracy, &job->promise);
    api_represent_bound(&evaluation->representation, evaluation->accuracy, &job->promise);
    open_results(job, call->arena);
    call->response->trace.decode_us += api_clock() - start - call->response->trace.compute_us;
    call->response->trace.tier = api_tier_names[job->promise.tier];
    if (api_wants_stream(call, job)) {
        evaluation->job = job;
        api_mark_arrays(job, evaluation, call->arena);
    } else {
        if (!compute(call, job)) return false;
        close_results(job, evaluation);
    }
    evaluation->count = job->pairs.pairing.count;
    evaluation->answer = (struct accuracy){api_tier_names[job->promise.tier], job->promise.bound,
                                           FACET_FLOOR, NAN, ceiling_of(job)};
    return true;
}
