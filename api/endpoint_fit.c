/* POST /v1/fit: the smallest material that is close enough to a measurement or to another material.
 */
#include "endpoint.h"
#include "facet_fit.h"
#include "material.h"
#include "merl.h"
#include "speed.h"
#include "tolerance.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { MODEL_AUTO, MODEL_GGX, MODEL_BECKMANN, MODEL_TABULATED };
static const char *const model_names[] = {"auto", "ggx", "beckmann", "tabulated", NULL};
static const char *const masking_names[] = {"smith", NULL};
static const char *const format_names[] = {"merl", NULL};
static const char *const fresnel_names[] = {"schlick", "table", NULL};
static const char *const convention_names[] = {"masking-only", "correlated", NULL};

struct fit_request {
    struct material *source;
    int model, masking, format;
    int64_t resolution;
    double tolerance;
};

struct fit_error {
    double backscatter_max, rms_log;
};

struct candidate {
    const char *model;
    int fresnel;
    double alpha;
    int64_t bytes;
    struct fit_error error;
    double ns_per_eval;
};

struct chosen {
    const char *model;
    int fresnel;
    bool meets_tolerance;
    const char *why;
};

struct fit_response {
    struct material material;
    struct fit_error error;
    struct list candidates;
    struct chosen chosen;
    int source_convention;
    int64_t pairs;
    double epsilon, timing_ms;
};

#define Q(member) MEMBER(struct fit_request, member)

static const struct field request_fields[] = {
    {Q(source), FIELD_OPTION, .fields = api_material_fields, .size = sizeof(struct material),
     .check = api_material_check,
     .doc = "an isotropic material to fit, where the body is not a measurement"},
    {Q(model), FIELD_ENUM, FIELD_DEFAULT, .names = model_names,
     .doc = "auto: the smallest that meets the tolerance"},
    {Q(masking), FIELD_ENUM, FIELD_DEFAULT, .names = masking_names,
     .doc = "masking of the fitted material"},
    {Q(resolution), FIELD_INTEGER, FIELD_DEFAULT, .min = FACET_FIT_RESOLUTION_MIN,
     .max = FACET_FIT_RESOLUTION_MAX, .initial = FACET_FIT_RESOLUTION,
     .doc = "intervals of a tabulated slope distribution"},
    {Q(tolerance), FIELD_NUMBER, FIELD_DEFAULT, .min = 1e-9, .max = 10,
     .initial = FACET_FIT_TOLERANCE, .doc = "the rms_log accepted"},
    {Q(format), FIELD_ENUM, .names = format_names,
     .doc = "of the measurement in the body; told by its content"},
    {0},
};

static const struct field error_fields[] = {
    {MEMBER(struct fit_error, backscatter_max), FIELD_NUMBER, FIELD_MUST,
     .doc = "largest relative error of fr(o,o), down to 1e-4 of each channel's peak"},
    {MEMBER(struct fit_error, rms_log), FIELD_NUMBER, FIELD_MUST,
     .doc = "rms of log((epsilon + fr cos theta_i)/(epsilon + fit)), all channels, over the pairs "
            "with data of a fixed grid uniform in sqrt(theta_h), theta_d, phi_d"},
    {0},
};

static const struct field candidate_fields[] = {
    {MEMBER(struct candidate, model), FIELD_TEXT, FIELD_MUST, .doc = "ndf"},
    {MEMBER(struct candidate, fresnel), FIELD_ENUM, FIELD_MUST, .names = fresnel_names,
     .doc = "form of the Fresnel term"},
    {MEMBER(struct candidate, alpha), FIELD_NUMBER, .doc = "roughness, if it is not tabulated"},
    {MEMBER(struct candidate, bytes), FIELD_INTEGER, FIELD_MUST,
     .doc = "size of its numbers as float64"},
    {MEMBER(struct candidate, error), FIELD_OBJECT, FIELD_MUST, .fields = error_fields,
     .doc = "against the source"},
    {MEMBER(struct candidate, ns_per_eval), FIELD_NUMBER, FIELD_MUST, .unit = "ns",
     .doc = "one fr, one channel, in a batch, to the default tolerance where a tier promises that, "
            "measured for this answer"},
    {0},
};

static const struct field chosen_fields[] = {
    {MEMBER(struct chosen, model), FIELD_TEXT, FIELD_MUST, .doc = "ndf"},
    {MEMBER(struct chosen, fresnel), FIELD_ENUM, FIELD_MUST, .names = fresnel_names,
     .doc = "form of the Fresnel term"},
    {MEMBER(struct chosen, meets_tolerance), FIELD_BOOL, FIELD_MUST,
     .doc = "rms_log is at most the tolerance"},
    {MEMBER(struct chosen, why), FIELD_TEXT, FIELD_MUST, .doc = "the reason, in a sentence"},
    {0},
};

#define A(member) MEMBER(struct fit_response, member)

static const struct field response_fields[] = {
    {A(material), FIELD_OBJECT, FIELD_MUST, .fields = api_material_fields,
     .doc = "the chosen material, as /v1/eval takes it"},
    {A(error), FIELD_OBJECT, FIELD_MUST, .fields = error_fields,
     .doc = "of the chosen material against the source"},
    {A(candidates), FIELD_LIST, FIELD_MUST, .fields = candidate_fields,
     .size = sizeof(struct candidate), .doc = "all that were fitted, by growing size"},
    {A(chosen), FIELD_OBJECT, FIELD_MUST, .fields = chosen_fields, .doc = "which, and why"},
    {A(source_convention), FIELD_ENUM, FIELD_MUST, .names = convention_names,
     .doc = "the relation of masking and shadowing in the source's backscatter under which the fit "
            "predicts the rest better"},
    {A(pairs), FIELD_INTEGER, FIELD_MUST, .doc = "pairs that rms_log was taken over"},
    {A(epsilon), FIELD_NUMBER, FIELD_MUST, .unit = "1/sr", .doc = "that of rms_log"},
    {A(timing_ms), FIELD_NUMBER, FIELD_MUST, .unit = "ms", .doc = "time the fit took"},
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
    facet_status status = facet_eval(surface->brdf, FACET_PRECISE, wi, wo, n, &outputs);
    for (size_t c = surface->channels; c < 3; c++) memcpy(fr[c], fr[0], n * sizeof *fr[c]);
    memset(valid, true, n);
    return status;
}

static bool open_material(struct call *call, struct surface *surface, facet_fit_source *source)
{
    const struct fit_request *in = call->in;
    struct decoder decoder = {call->arena, call->problem};
    struct place place = {NULL, "source", 0}, format = {NULL, "format", 0};
    if (in->format >= 0)
        return api_problem_at(call->problem, &format, "goes with a measurement as the body");
    if (!in->source)
        return api_problem_at(call->problem, &place,
                              "is required where the body is not a measurement");
    if (!api_material_open(in->source, &place, &decoder, surface)) return false;
    const facet_roughness *r = &surface->facet.roughness;
    if (r->alpha_x != r->alpha_y || r->rho != 0 || r->slope_x != 0 || r->slope_y != 0)
        return api_problem_at(
            call->problem, &place,
            "must be isotropic and have no mean slope: nothing else is fitted yet");
    *source = (facet_fit_source){evaluate_surface, surface, INFINITY};
    return true;
}

static bool open_source(struct call *call, struct merl *merl, struct surface *surface,
                        facet_fit_source *source)
{
    if (!call->medium) return open_material(call, surface, source);
    *source = (facet_fit_source){api_merl_evaluate, merl, api_merl_slope_max()};
    return api_merl_open(call->request->body, call->request->body_size, merl, call->problem);
}

/* ---- The answer --------------------------------------------------------------------------- */

static bool is_table(const facet_material *material)
{
    return material->fresnel.kind == FACET_FRESNEL_TABLE;
}

static bool describe_fresnel(struct call *call, const facet_fresnel *from, struct fresnel *to)
{
    to->form = FRESNEL_BY_KEY;
    if (from->kind == FACET_FRESNEL_SCHLICK) {
        to->schlick = api_arena_array(call->arena, 1, sizeof *to->schlick);
        if (!to->schlick) return api_problem_memory(call->problem);
        to->schlick->f0.channels = from->channels;
        memcpy(to->schlick->f0.value, from->f0, sizeof from->f0);
        return true;
    }
    size_t n = from->count, channels = from->channels;
    double *values = api_arena_doubles(call->arena, n * (1 + channels));
    to->table = api_arena_array(call->arena, 1, sizeof *to->table);
    if (!values || !to->table) return api_problem_memory(call->problem);
    memcpy(values + n * channels, from->cos_theta_d, n * sizeof *values);
    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < channels; c++) values[i * channels + c] = from->values[c][i];
    *to->table = (struct fresnel_table){{n, values + n * channels}, {n, channels, values}};
    return true;
}

/* `to` was cleared: all its members are absent. */
static bool describe_material(struct call *call, const facet_fit *fit, const facet_material *from,
                              struct material *to)
{
    to->ndf = (int)from->ndf;
    to->masking = (int)from->masking;
    if (from->ndf != FACET_TABULATED) {
        to->alpha = from->roughness.alpha_x;
    } else {
        double *log_d = api_arena_doubles(call->arena, fit->table_nodes);
        to->slopes = api_arena_array(call->arena, 1, sizeof *to->slopes);
        if (!log_d || !to->slopes) return api_problem_memory(call->problem);
        memcpy(log_d, fit->table_log_d, fit->table_nodes * sizeof *log_d);
        *to->slopes = (struct slopes){fit->table_scale, {fit->table_nodes, log_d}};
    }
    return describe_fresnel(call, &from->fresnel, &to->fresnel);
}

static bool measure(struct call *call, const facet_material *material, double *ns)
{
    facet_brdf *brdf;
    facet_status status = facet_brdf_create(material, &brdf);
    if (status) return api_problem_status(call->problem, status, NULL);
    facet_tier tier = FACET_FAST;
    double bound;
    while (tier < FACET_PRECISE &&
           !(facet_bound(brdf, tier, FACET_FR, 0, &bound) && bound <= TOLERANCE_DEFAULT))
        tier++;
    bool ok = api_measure_eval(brdf, tier, call->arena, ns);
    facet_brdf_destroy(brdf);
    return ok || api_problem_memory(call->problem);
}

static bool list_candidates(struct call *call, const facet_fit *fit, struct list *out)
{
    struct candidate *list = api_arena_array(call->arena, FACET_FIT_CANDIDATES, sizeof *list);
    if (!list) return api_problem_memory(call->problem);
    for (size_t i = 0; i < FACET_FIT_CANDIDATES; i++) {
        const facet_fit_candidate *c = &fit->candidate[i];
        const facet_fit_error *error = &c->error;
        bool tabulated = c->material.ndf == FACET_TABULATED;
        list[i] = (struct candidate){.model = api_ndf_names[c->material.ndf],
                                     .fresnel = is_table(&c->material),
                                     .alpha = tabulated ? NAN : c->material.roughness.alpha_x,
                                     .bytes = (int64_t)c->bytes,
                                     .error = {error->backscatter_max, error->rms_log}};
        if (!measure(call, &c->material, &list[i].ns_per_eval)) return false;
    }
    *out = (struct list){FACET_FIT_CANDIDATES, list};
    return true;
}

static bool is_asked_for(int model, const facet_fit_candidate *candidate)
{
    static const int models[] = {[FACET_GGX] = MODEL_GGX,
                                 [FACET_BECKMANN] = MODEL_BECKMANN,
                                 [FACET_TABULATED] = MODEL_TABULATED};
    return model == MODEL_AUTO || model == models[candidate->material.ndf];
}

/* Is a the better choice?  Those that meet the tolerance first, by size, then by error. */
static bool is_better(const facet_fit_candidate *a, const facet_fit_candidate *b, double tolerance)
{
    bool meets = a->error.rms_log <= tolerance, other = b->error.rms_log <= tolerance;
    if (meets != other) return meets;
    if (meets && a->bytes != b->bytes) return a->bytes < b->bytes;
    return a->error.rms_log < b->error.rms_log;
}

static bool choose(struct call *call, const facet_fit *fit, const facet_fit_candidate **chosen)
{
    const struct fit_request *in = call->in;
    struct fit_response *out = call->out;
    char why[160];
    size_t considered = 0;
    *chosen = NULL;
    for (size_t i = 0; i < FACET_FIT_CANDIDATES; i++) {
        const facet_fit_candidate *candidate = &fit->candidate[i];
        if (!is_asked_for(in->model, candidate)) continue;
        considered++;
        if (!*chosen || is_better(candidate, *chosen, in->tolerance)) *chosen = candidate;
    }
    bool meets = (*chosen)->error.rms_log <= in->tolerance;
    const char *asked = in->model == MODEL_AUTO ? "" : model_names[in->model],
               *space = *asked ? " " : "";
    if (!meets)
        snprintf(why, sizeof why, "no %s%scandidate meets the tolerance %g; this one is closest",
                 asked, space, in->tolerance);
    else
        snprintf(why, sizeof why, "the smallest of %zu %s%scandidate%s whose rms_log meets %g",
                 considered, asked, space, considered == 1 ? "" : "s", in->tolerance);
    out->chosen =
        (struct chosen){api_ndf_names[(*chosen)->material.ndf], is_table(&(*chosen)->material),
                        meets, api_arena_text(call->arena, why, strlen(why))};
    return out->chosen.why || api_problem_memory(call->problem);
}

static bool answer(struct call *call, const facet_fit *fit)
{
    struct fit_response *out = call->out;
    const facet_fit_candidate *chosen;
    if (!list_candidates(call, fit, &out->candidates) || !choose(call, fit, &chosen)) return false;
    out->error = (struct fit_error){chosen->error.backscatter_max, chosen->error.rms_log};
    out->source_convention = (int)fit->convention;
    out->pairs = (int64_t)fit->pairs;
    out->epsilon = FACET_FIT_EPSILON;
    return describe_material(call, fit, &chosen->material, &out->material);
}

static bool handle(struct call *call)
{
    const struct fit_request *in = call->in;
    struct fit_response *out = call->out;
    struct merl merl;
    struct surface surface;
    facet_fit_source source;
    facet_fit fit;
    facet_watch watch = api_watch(call);
    double start = api_clock();
    if (!open_source(call, &merl, &surface, &source)) return false;
    facet_status status =
        facet_fit_isotropic(&source, FACET_SMITH, (size_t)in->resolution, &watch, &fit);
    if (status == FACET_BAD_DATA)
        return api_problem(call->problem, 422,
                           "the source has no backscatter that a microfacet surface could be "
                           "fitted to");
    if (status) return api_problem_status(call->problem, status, NULL);
    bool ok = answer(call, &fit);
    facet_fit_clear(&fit);
    double us = api_clock() - start;
    out->timing_ms = round(us / 10) / 100;
    call->response->trace.compute_us += us;
    return ok;
}

static const struct medium bodies[] = {
    {"application/x-merl-brdf", api_merl_matches},
    {0},
};

const struct endpoint api_endpoint_fit = {
    .method = "POST",
    .path = "/v1/fit",
    .summary = "Fit a material to a measurement",
    .doc = "The body is a MERL .binary (34,992,012 bytes), the options then stand in the query; or "
           "JSON with a material to fit as source. The fit is isotropic: slope distribution from "
           "backscatter by power iteration (Dupuy 2015, ch. 4), roughness and Fresnel term by "
           "least squares on the logarithm of the whole BRDF.",
    .request = request_fields,
    .request_size = sizeof(struct fit_request),
    .response = response_fields,
    .response_size = sizeof(struct fit_response),
    .bodies = bodies,
    .is_long = true,
    .example = "{\"source\":{\"ndf\":\"beckmann\",\"alpha\":0.15},\"model\":\"tabulated\"}",
    .handle = handle,
};
