#include "fit_answer.h"

#include "speed.h"
#include "tolerance.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const char *const fresnel_names[] = {"schlick", "table", NULL};
static const char *const convention_names[] = {"masking-only", "correlated", NULL};

/* ---- Table ---------------------------------------------------------------------------------- */

static const struct field worst_fields[] = {
    {MEMBER(struct worst_pair, log), FIELD_NUMBER, FIELD_MUST, .min = 0, .max = 1e3,
     .doc = "the largest of the logarithms that rms_log is made of"},
    {MEMBER(struct worst_pair, wi), FIELD_NUMBERS, FIELD_MUST, .min_items = 3, .max_items = 3,
     .doc = "where: towards the light"},
    {MEMBER(struct worst_pair, wo), FIELD_NUMBERS, FIELD_MUST, .min_items = 3, .max_items = 3,
     .doc = "where: towards the viewer"},
    {0},
};

static const struct field error_fields[] = {
    {MEMBER(struct fit_error, backscatter_max), FIELD_NUMBER,
     .doc = "largest relative error of fr(o,o), down to 1e-4 of each channel's peak; absent where "
            "the source is samples"},
    {MEMBER(struct fit_error, rms_log), FIELD_NUMBER, FIELD_MUST,
     .doc = "rms of log((epsilon + fr cos theta_i)/(epsilon + fit)), all channels, all of equal "
            "weight, over the pairs with data of a fixed grid uniform in sqrt(theta_h), theta_d, "
            "phi_d, or over the samples"},
    {MEMBER(struct fit_error, rms_log_channel), FIELD_NUMBERS, FIELD_MUST, .min_items = 3,
     .max_items = 3, .doc = "the same of red, green and blue"},
    {MEMBER(struct fit_error, worst), FIELD_OBJECT, FIELD_MUST, .fields = worst_fields,
     .doc = "the pair that is worst met"},
    {0},
};

#define C(member) MEMBER(struct fit_candidate, member)

static const struct field candidate_fields[] = {
    {C(model), FIELD_TEXT, FIELD_MUST, .doc = "ndf"},
    {C(fresnel), FIELD_ENUM, FIELD_MUST, .names = fresnel_names, .doc = "form of the Fresnel term"},
    {C(diffuse), FIELD_BOOL, FIELD_MUST, .doc = "with a diffuse part"},
    {C(anisotropic), FIELD_BOOL, FIELD_MUST, .doc = "with alpha_x, alpha_y, rho"},
    {C(alpha), FIELD_NUMBER, .doc = "roughness, if it is isotropic and not tabulated"},
    {C(alpha_x), FIELD_NUMBER, .doc = "roughness along x, if it is anisotropic"},
    {C(alpha_y), FIELD_NUMBER, .doc = "roughness along y"},
    {C(rho), FIELD_NUMBER, .doc = "correlation of the slopes"},
    {C(f0), FIELD_NUMBERS, .doc = "of a Schlick term: one or three"},
    {C(kd), FIELD_NUMBERS, .doc = "diffuse part: one or three"},
    {C(nodes), FIELD_INTEGER, .doc = "of its Fresnel table"},
    {C(slopes), FIELD_INTEGER, .doc = "nodes of its slope table, or of each row of it"},
    {C(azimuths), FIELD_INTEGER, .doc = "rows of its slope table, if it is one over the azimuth"},
    {C(bytes), FIELD_INTEGER, FIELD_MUST, .doc = "size of its numbers as float64"},
    {C(error), FIELD_OBJECT, FIELD_MUST, .fields = error_fields, .doc = "against the source"},
    {C(ns_per_eval), FIELD_NUMBER, FIELD_MUST, .unit = "ns",
     .doc = "one fr, one channel, in a batch, to the default tolerance where a tier promises that, "
            "measured for this answer"},
    {0},
};

static const struct field chosen_fields[] = {
    {MEMBER(struct fit_chosen, model), FIELD_TEXT, .doc = "ndf; absent where nothing fits"},
    {MEMBER(struct fit_chosen, fresnel), FIELD_ENUM, .names = fresnel_names,
     .doc = "form of the Fresnel term"},
    {MEMBER(struct fit_chosen, diffuse), FIELD_BOOL, FIELD_MUST, .doc = "with a diffuse part"},
    {MEMBER(struct fit_chosen, meets_tolerance), FIELD_BOOL, FIELD_MUST,
     .doc = "rms_log is at most the tolerance"},
    {MEMBER(struct fit_chosen, why), FIELD_TEXT, FIELD_MUST, .doc = "the reason, in a sentence"},
    {0},
};

static const struct field data_fields[] = {
    {MEMBER(struct fit_data, format), FIELD_TEXT, FIELD_MUST, .doc = "as it was read"},
    {MEMBER(struct fit_data, values), FIELD_INTEGER, FIELD_MUST, .doc = "colours in the data"},
    {MEMBER(struct fit_data, missing), FIELD_INTEGER, FIELD_MUST,
     .doc = "of them without data: negative in MERL, empty or nan in CSV; not used"},
    {MEMBER(struct fit_data, negative), FIELD_INTEGER, FIELD_MUST,
     .doc = "of them with a channel below 0 that counted as 0"},
    {0},
};

static const struct field export_fields[] = {
    {MEMBER(struct fit_export, tool), FIELD_TEXT, FIELD_MUST, .doc = "as requested"},
    {MEMBER(struct fit_export, text), FIELD_TEXT, FIELD_MUST, .doc = "to paste"},
    {MEMBER(struct fit_export, lost), FIELD_TEXT, FIELD_MUST,
     .doc = "what the target's model cannot hold, in a sentence"},
    {MEMBER(struct fit_export, rms_log), FIELD_NUMBER, FIELD_MUST,
     .doc =
         "rms of log((epsilon + fr cos theta_i)/(epsilon + target)), the chosen material against "
         "the target's model, over a grid of directions"},
    {0},
};

#define A(member) MEMBER(struct fit_response, member)

const struct field api_fit_response_fields[] = {
    {A(material), FIELD_OPTION, .fields = api_material_fields, .size = sizeof(struct material),
     .doc = "the chosen material, as /v1/eval takes it"},
    {A(error), FIELD_OBJECT, FIELD_MUST, .fields = error_fields,
     .doc = "of the chosen material against the source; of the best one where nothing fits"},
    {A(fits), FIELD_BOOL, FIELD_MUST,
     .doc = "false: no candidate comes close; then there is a material only if its model was asked "
            "for by name"},
    {A(fits_why), FIELD_TEXT, .doc = "why it does not fit"},
    {A(candidates), FIELD_LIST, FIELD_MUST, .fields = candidate_fields,
     .size = sizeof(struct fit_candidate),
     .doc = "those that no smaller candidate equals in rms_log, by growing size"},
    {A(considered), FIELD_INTEGER, FIELD_MUST, .doc = "candidates that were fitted"},
    {A(chosen), FIELD_OBJECT, FIELD_MUST, .fields = chosen_fields, .doc = "which, and why"},
    {A(source_convention), FIELD_ENUM, .names = convention_names,
     .doc = "the relation of masking and shadowing in the source's backscatter under which the fit "
            "predicts the rest better; isotropic sources fitted with smith"},
    {A(data), FIELD_OPTION, .fields = data_fields, .size = sizeof(struct fit_data),
     .doc = "what a measurement held"},
    {.name = "export",
     .offset = offsetof(struct fit_response, exported),
     .type = FIELD_OPTION,
     .fields = export_fields,
     .size = sizeof(struct fit_export),
     .doc = "the fitted material for another tool"},
    {A(pairs), FIELD_INTEGER, FIELD_MUST, .doc = "pairs that rms_log was taken over"},
    {A(epsilon), FIELD_NUMBER, FIELD_MUST, .unit = "1/sr", .doc = "that of rms_log"},
    {A(timing_ms), FIELD_NUMBER, FIELD_MUST, .unit = "ms", .doc = "time the fit took"},
    {0},
};

/* Less correlation than this is rounding of the fit. */
#define RHO_ROUNDING 1e-12

/* ---- Material --------------------------------------------------------------------------------- */

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

static bool describe_slopes(struct call *call, const facet_fit *fit,
                            const facet_fit_candidate *from, struct material *to)
{
    const size_t rows = from->log_d_rows, n = rows * from->log_d_nodes;
    double *copy = api_arena_doubles(call->arena, n);
    to->slopes = api_arena_array(call->arena, 1, sizeof *to->slopes);
    if (!copy || !to->slopes) return api_problem_memory(call->problem);
    memcpy(copy, from->log_d, n * sizeof *copy);
    *to->slopes = (struct slopes){fit->table_scale,
                                  rows > 1 ? (struct matrix){rows, from->log_d_nodes, copy}
                                           : (struct matrix){n, 1, copy}};
    return true;
}

static bool describe_material(struct call *call, const facet_fit *fit,
                              const facet_fit_candidate *candidate, struct material *to)
{
    const facet_material *from = &candidate->material;
    const facet_roughness *r = &from->roughness;
    api_field_clear(api_material_fields, to);
    to->ndf = (int)from->ndf;
    to->masking = (int)from->masking;
    if (candidate->anisotropic) {
        to->alpha_x = r->alpha_x;
        to->alpha_y = r->alpha_y;
        to->rho = fabs(r->rho) < RHO_ROUNDING ? 0 : r->rho;
    } else if (from->ndf != FACET_TABULATED) {
        to->alpha = r->alpha_x;
    }
    if (candidate->has_diffuse) {
        to->diffuse.channels = from->fresnel.channels;
        memcpy(to->diffuse.value, candidate->diffuse, sizeof candidate->diffuse);
    }
    if (from->ndf == FACET_TABULATED && !describe_slopes(call, fit, candidate, to)) return false;
    return describe_fresnel(call, &from->fresnel, &to->fresnel);
}

/* ---- Candidates -------------------------------------------------------------------------------- */

static bool copy_numbers(struct call *call, const double *from, size_t n, struct numbers *to)
{
    double *copy = api_arena_doubles(call->arena, n);
    if (!copy) return api_problem_memory(call->problem);
    memcpy(copy, from, n * sizeof *copy);
    *to = (struct numbers){n, copy};
    return true;
}

static bool describe_error(struct call *call, const facet_fit_error *from, struct fit_error *to)
{
    to->backscatter_max = from->backscatter_max;
    to->rms_log = from->rms_log;
    to->worst.log = from->worst;
    return copy_numbers(call, from->channel, 3, &to->rms_log_channel) &&
           copy_numbers(call, from->worst_wi, 3, &to->worst.wi) &&
           copy_numbers(call, from->worst_wo, 3, &to->worst.wo);
}

static bool measure(struct call *call, const facet_material *material, double *ns)
{
    facet_brdf *brdf;
    double *room = api_arena_doubles(call->arena, SPEED_ROOM);
    if (!room) return api_problem_memory(call->problem);
    facet_status status = facet_brdf_create(material, &brdf);
    if (status) return api_problem_status(call->problem, status, NULL);
    facet_tier tier = (facet_tier)0;
    double bound;
    while (tier < FACET_PRECISE &&
           !(facet_bound(brdf, tier, FACET_FR, 0, &bound) && bound <= TOLERANCE_DEFAULT))
        tier++;
    bool ok = api_measure_eval(brdf, NULL, tier, FACET_FR, room, ns);
    facet_brdf_destroy(brdf);
    return ok || api_problem_memory(call->problem);
}

static bool describe_candidate(struct call *call, const facet_fit_candidate *from,
                               struct fit_candidate *to)
{
    const facet_material *m = &from->material;
    const facet_roughness *r = &m->roughness;
    size_t channels = m->fresnel.channels;
    api_field_clear(candidate_fields, to);
    to->model = api_ndf_names[m->ndf];
    to->fresnel = is_table(m);
    to->diffuse = from->has_diffuse;
    to->anisotropic = from->anisotropic;
    to->bytes = (int64_t)from->bytes;
    if (from->anisotropic) {
        to->alpha_x = r->alpha_x;
        to->alpha_y = r->alpha_y;
        to->rho = fabs(r->rho) < RHO_ROUNDING ? 0 : r->rho;
    } else if (m->ndf != FACET_TABULATED) {
        to->alpha = r->alpha_x;
    }
    if (is_table(m)) to->nodes = (int64_t)m->fresnel.count;
    if (m->ndf == FACET_TABULATED) to->slopes = (int64_t)from->log_d_nodes;
    if (from->log_d_rows > 1) to->azimuths = (int64_t)from->log_d_rows;
    if (!is_table(m) && !copy_numbers(call, m->fresnel.f0, channels, &to->f0)) return false;
    if (from->has_diffuse && !copy_numbers(call, from->diffuse, channels, &to->kd)) return false;
    return describe_error(call, &from->error, &to->error) && measure(call, m, &to->ns_per_eval);
}

/* By growing size, only what is better than all that is smaller: the Pareto front. */
static bool list_candidates(struct call *call, const facet_fit *fit, struct list *out)
{
    struct fit_candidate *list = api_arena_array(call->arena, fit->count, sizeof *list);
    if (!list) return api_problem_memory(call->problem);
    double best = INFINITY;
    size_t n = 0;
    for (size_t i = 0; i < fit->count; i++) {
        const facet_fit_candidate *c = &fit->candidate[i];
        if (!(c->error.rms_log < best)) continue;
        best = c->error.rms_log;
        if (!describe_candidate(call, c, &list[n++])) return false;
    }
    *out = (struct list){n, list};
    return true;
}

/* ---- Choice --------------------------------------------------------------------------------------- */

static const facet_fit_candidate *best_of(const facet_fit *fit)
{
    const facet_fit_candidate *best = &fit->candidate[0];
    for (size_t i = 1; i < fit->count; i++)
        if (fit->candidate[i].error.rms_log < best->error.rms_log) best = &fit->candidate[i];
    return best;
}

/* The sorted candidates' first that meets the tolerance; else the closest. */
static const facet_fit_candidate *smallest(const facet_fit *fit, double tolerance, bool *meets)
{
    for (size_t i = 0; i < fit->count; i++) {
        if (!(fit->candidate[i].error.rms_log <= tolerance)) continue;
        *meets = true;
        return &fit->candidate[i];
    }
    *meets = false;
    return best_of(fit);
}

/* Of the error of a Lambertian surface: what is left where a lobe is seen; where it may be chance. */
#define SEEN 0.5
#define CHANCE 0.9
/* An error that is rounding alone, of which no share says anything. */
#define EXACT 1e-9

/*
 * A lobe that a Lambertian surface does as well without is the fit's invention: measurements that are
 * diffuse, or so dark that all is below epsilon, are met by any narrow enough.
 */
static bool has_no_lobe(const facet_fit *fit, double tolerance)
{
    double flat = fit->flat_rms, rms = best_of(fit)->error.rms_log;
    return flat <= EXACT || rms > CHANCE * flat ||
           (flat <= fmin(tolerance, FACET_FIT_TOLERANCE) && rms > SEEN * flat);
}

/* Empty: it fits. */
static void judge(const facet_fit *fit, double tolerance, bool measured, const char *asked,
                  char *why, size_t room)
{
    double rms = best_of(fit)->error.rms_log;
    why[0] = 0;
    if (measured && rms <= FACET_FIT_RMS_MAX && has_no_lobe(fit, tolerance))
        snprintf(
            why, room,
            "nothing here tells a lobe: {\"ndf\":\"lambert\",\"reflectance\":[%.3g,%.3g,%.3g]} "
            "is off by rms_log %.3g, the closest candidate by %.3g",
            fit->flat_kd[0], fit->flat_kd[1], fit->flat_kd[2], fit->flat_rms, rms);
    else if (rms > FACET_FIT_RMS_MAX)
        snprintf(
            why, room,
            "the closest of %zu %s%scandidates is off by rms_log %.3g, %.3g is the most that is "
            "called a fit: %s",
            fit->count, asked, *asked ? " " : "", rms, FACET_FIT_RMS_MAX,
            *asked ? "try model auto" : "no microfacet surface looks like this");
    else if (fit->hot_spot > FACET_FIT_HOT_SPOT_MAX)
        snprintf(why, room,
                 "light that comes back where it came from is %.3g times that of the closest "
                 "candidate: this is a retro-reflector, which no microfacet surface is",
                 exp(fit->hot_spot));
}

static bool refuse(struct call *call, const facet_fit *fit, const char *why)
{
    struct fit_response *out = call->out;
    out->fits_why = out->chosen.why = api_arena_text(call->arena, why, strlen(why));
    out->chosen.fresnel = -1;
    return (out->chosen.why || api_problem_memory(call->problem)) &&
           describe_error(call, &best_of(fit)->error, &out->error);
}

bool api_fit_answer(struct call *call, const facet_fit *fit, double tolerance, const char *asked,
                    const facet_fit_candidate **chosen)
{
    struct fit_response *out = call->out;
    char why[300];
    bool meets;
    *chosen = NULL;
    out->considered = (int64_t)fit->count;
    out->source_convention = fit->has_convention ? (int)fit->convention : -1;
    out->pairs = (int64_t)fit->pairs;
    out->epsilon = FACET_FIT_EPSILON;
    if (!list_candidates(call, fit, &out->candidates)) return false;
    judge(fit, tolerance, out->data != NULL, asked, why, sizeof why);
    if (*why && !*asked) return refuse(call, fit, why);
    out->fits = !*why;
    if (*why && !(out->fits_why = api_arena_text(call->arena, why, strlen(why))))
        return api_problem_memory(call->problem);
    const facet_fit_candidate *c = *chosen = smallest(fit, tolerance, &meets);
    const char *space = *asked ? " " : "";
    if (meets)
        snprintf(why, sizeof why, "the smallest of %zu %s%scandidate%s whose rms_log meets %g",
                 fit->count, asked, space, fit->count == 1 ? "" : "s", tolerance);
    else
        snprintf(why, sizeof why, "no %s%scandidate meets the tolerance %g; this one is closest",
                 asked, space, tolerance);
    out->chosen = (struct fit_chosen){api_ndf_names[c->material.ndf], is_table(&c->material),
                                      c->has_diffuse, meets,
                                      api_arena_text(call->arena, why, strlen(why))};
    out->material = api_arena_array(call->arena, 1, sizeof *out->material);
    if (!out->chosen.why || !out->material) return api_problem_memory(call->problem);
    return describe_error(call, &c->error, &out->error) &&
           describe_material(call, fit, c, out->material);
}
