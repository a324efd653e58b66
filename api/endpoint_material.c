/* POST /v1/material: one material in every form its roughness can be written. */
#include "endpoint.h"
#include "facet_forms.h"
#include "material.h"
#include "tolerance.h"
#include "transmission.h"

#include <math.h>
#include <stdio.h>

struct material_request {
    struct material material;
};

struct bivariate {
    double alpha_x, alpha_y, rho;
};

struct ellipse {
    double alpha_1, alpha_2, phi;
};

/* NaN: there is no such form. */
struct form_errors {
    double bivariate, ellipse, moments;
};

struct material_response {
    const char *ndf;
    struct bivariate *bivariate;
    struct ellipse *ellipse;
    struct form_errors *error;
    struct numbers mean_slope, mean_normal, moments;
    int64_t azimuths;
    bool isotropic, central, coloured, transmission;
    double eta;
    const char *transport;
    struct list clamped;
    const char *note;
};

static const struct field request_fields[] = {
    MATERIAL_FIELD(struct material_request),
    {0},
};

static const struct field bivariate_fields[] = {
    {MEMBER(struct bivariate, alpha_x), FIELD_NUMBER, FIELD_MUST, .doc = "slope scale along x"},
    {MEMBER(struct bivariate, alpha_y), FIELD_NUMBER, FIELD_MUST, .doc = "slope scale along y"},
    {MEMBER(struct bivariate, rho), FIELD_NUMBER, FIELD_MUST, .min = -1, .max = 1,
     .doc = "slope correlation"},
    {0},
};

static const struct field ellipse_fields[] = {
    {MEMBER(struct ellipse, alpha_1), FIELD_NUMBER, FIELD_MUST, .doc = "larger slope scale"},
    {MEMBER(struct ellipse, alpha_2), FIELD_NUMBER, FIELD_MUST, .doc = "smaller slope scale"},
    {MEMBER(struct ellipse, phi), FIELD_NUMBER, FIELD_MUST, .unit = "rad",
     .doc = "the axis of alpha_1 lies at -phi (Dupuy 2.25)"},
    {0},
};

static const struct field error_fields[] = {
    {MEMBER(struct form_errors, bivariate), FIELD_NUMBER, FIELD_MUST,
     .doc = "of alpha_x, alpha_y, rho"},
    {MEMBER(struct form_errors, ellipse), FIELD_NUMBER,
     .doc = "of alpha_1, alpha_2, phi, whose last digit counts alpha_1/alpha_2 times"},
    {MEMBER(struct form_errors, moments), FIELD_NUMBER,
     .doc = "of the moments, which cancel beside a mean slope"},
    {0},
};

/* Nothing is clamped today: what lies out of range is refused. */
struct clamped {
    const char *member;
};

static const struct field clamped_fields[] = {
    {MEMBER(struct clamped, member), FIELD_TEXT, FIELD_MUST, .doc = "member that was changed"},
    {0},
};

#define O(member) MEMBER(struct material_response, member)

static const struct field response_fields[] = {
    {O(ndf), FIELD_TEXT, FIELD_MUST,
     .doc = "distribution of slopes; lambert has none, and no roughness"},
    {O(bivariate), FIELD_OPTION, .fields = bivariate_fields, .size = sizeof(struct bivariate),
     .doc = "roughness along x and y"},
    {O(ellipse), FIELD_OPTION, .fields = ellipse_fields, .size = sizeof(struct ellipse),
     .doc =
         "roughness along the principal axes; left out, which note says, where doubles hold none "
         "within 0.1"},
    {O(moments), FIELD_NUMBERS, .min_items = 5, .max_items = 5,
     .doc = "beckmann: E[x], E[y], E[x^2], E[y^2], E[xy] of the slopes; left out like the "
            "ellipse"},
    {O(error), FIELD_OPTION, .fields = error_fields, .size = sizeof(struct form_errors),
     .doc =
         "of each form, sent back as it is answered: by how much, relatively, the slopes are wider or "
         "narrower than this material's in the direction where that is most"},
    {O(mean_slope), FIELD_NUMBERS, FIELD_MUST, .min_items = 2, .max_items = 2, .doc = "mean slope"},
    {O(mean_normal), FIELD_NUMBERS, FIELD_MUST, .min_items = 3, .max_items = 3,
     .doc = "normal of the mean slope"},
    {O(azimuths), FIELD_INTEGER, .doc = "rows of a slope table over the azimuth"},
    {O(isotropic), FIELD_BOOL, FIELD_MUST,
     .doc = "alpha_1 = alpha_2, and a slope table over theta alone"},
    {O(central), FIELD_BOOL, FIELD_MUST, .doc = "the mean slope is 0"},
    {O(coloured), FIELD_BOOL, FIELD_MUST, .doc = "fr, fr_cos and F are [r,g,b]"},
    {O(transmission), FIELD_BOOL, FIELD_DEFAULT,
     .doc = "wi and wo may lie on either side of the surface"},
    {O(eta), FIELD_NUMBER, .doc = "with transmission: the index below over that above"},
    {O(transport), FIELD_TEXT, .doc = "with transmission: importance or radiance"},
    {O(clamped), FIELD_LIST, FIELD_MUST, .fields = clamped_fields, .size = sizeof(struct clamped),
     .doc = "members the service changed; what is out of range is refused instead"},
    {O(note), FIELD_TEXT, .doc = "what was made of the base, and why a form is left out"},
    {0},
};

static bool numbers(struct call *call, const double *values, size_t n, struct numbers *out)
{
    double *copy = api_arena_doubles(call->arena, n);
    if (!copy) return api_problem_memory(call->problem);
    for (size_t i = 0; i < n; i++) copy[i] = values[i];
    *out = (struct numbers){n, copy};
    return true;
}

/* One more sentence of the note. */
static bool add_note(struct call *call, const char *more)
{
    enum { ROOM = 400 };
    struct material_response *out = call->out;
    char *text = api_arena_alloc(call->arena, ROOM);
    if (!text) return api_problem_memory(call->problem);
    snprintf(text, ROOM, "%s%s%s", out->note ? out->note : "", out->note ? "; " : "", more);
    out->note = text;
    return true;
}

static bool describe_ellipse(struct call *call, const facet_roughness *r)
{
    struct material_response *out = call->out;
    facet_ellipse e;
    double lost;
    if (!facet_ellipse_readable(r, &e, &lost))
        return add_note(call, "no ellipse: a double does not hold the angle of one so thin");
    out->ellipse = api_arena_alloc(call->arena, sizeof *out->ellipse);
    if (!out->ellipse) return api_problem_memory(call->problem);
    *out->ellipse = (struct ellipse){e.alpha_1, e.alpha_2, e.phi};
    out->error->ellipse = api_bound_up(lost);
    return true;
}

static bool describe_roughness(struct call *call, const facet_roughness *r)
{
    struct material_response *out = call->out;
    facet_roughness plain = *r;
    plain.low.alpha_x = plain.low.alpha_y = plain.low.rho = 0;
    out->bivariate = api_arena_alloc(call->arena, sizeof *out->bivariate);
    out->error = api_arena_alloc(call->arena, sizeof *out->error);
    if (!out->bivariate || !out->error) return api_problem_memory(call->problem);
    *out->bivariate = (struct bivariate){r->alpha_x, r->alpha_y, r->rho};
    *out->error = (struct form_errors){api_bound_up(facet_roughness_difference(r, &plain)), NAN,
                                       NAN};
    return describe_ellipse(call, r);
}

static bool describe_moments(struct call *call, const struct surface *surface,
                             const struct material *in)
{
    struct material_response *out = call->out;
    facet_moments m;
    double lost = 0;
    /* As they came, where they are the material's own. */
    const bool own = in->moments.values && !in->base && !in->jacobian.values &&
                     isnan(in->height_scale);
    if (own)
        m = (facet_moments){in->moments.values[0], in->moments.values[1], in->moments.values[2],
                            in->moments.values[3], in->moments.values[4]};
    else if (!facet_moments_readable(&surface->facet.roughness, &m, &lost))
        return add_note(call,
                        "no moments: beside this mean slope doubles do not hold the roughness");
    out->error->moments = api_bound_up(lost);
    return numbers(call, (double[]){m.e1, m.e2, m.e3, m.e4, m.e5}, 5, &out->moments);
}

static bool describe(struct call *call, const struct surface *surface, const struct material *in)
{
    struct material_response *out = call->out;
    const facet_roughness *r = &surface->facet.roughness;
    double x = r->slope_x, y = r->slope_y, length = sqrt(1 + x * x + y * y);
    out->ndf = api_ndf_names[in->ndf];
    out->note = surface->note;
    if (!surface->is_lambert && !describe_roughness(call, r)) return false;
    const bool is_turned = api_material_is_turned(in);
    if (is_turned) out->azimuths = (int64_t)in->slopes->log_D.rows;
    out->isotropic = r->alpha_x == r->alpha_y && r->rho == 0 && !is_turned;
    out->central = x == 0 && y == 0;
    out->coloured = surface->channels == 3;
    out->transmission = surface->bsdf != NULL;
    out->eta = NAN;
    if (out->transmission) {
        out->eta = surface->facet.fresnel.eta[0];
        out->transport = api_transport_names[in->transport < 0 ? FACET_IMPORTANCE : in->transport];
    }
    out->clamped.items = "";
    if (in->ndf == FACET_BECKMANN && !describe_moments(call, surface, in)) return false;
    return numbers(call, (double[]){x, y}, 2, &out->mean_slope) &&
           numbers(call, (double[]){(0 - x) / length, (0 - y) / length, 1 / length}, 3,
                   &out->mean_normal);
}

static bool handle(struct call *call)
{
    const struct material_request *in = call->in;
    struct decoder decoder = api_decoder(call);
    struct place place = {NULL, "material", 0};
    struct surface surface;
    return api_material_open(&in->material, &place, &decoder, &surface) &&
           describe(call, &surface, &in->material);
}

const struct endpoint api_endpoint_material = {
    .method = "POST",
    .path = "/v1/material",
    .summary = "A material's roughness in every form",
    .request = request_fields,
    .request_size = sizeof(struct material_request),
    .response = response_fields,
    .response_size = sizeof(struct material_response),
    .is_long = true, /* slopes over the azimuth take 50 ms and more */
    .grows_by_words = true,
    .example = "{\"material\":{\"ndf\":\"beckmann\",\"alpha_x\":0.2,\"alpha_y\":0.4,\"rho\":0.5}}",
    .handle = handle,
};
