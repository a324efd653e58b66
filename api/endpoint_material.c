/* POST /v1/material: one material in every form its roughness can be written. */
#include "endpoint.h"
#include "material.h"
#include "transmission.h"

#include <math.h>

struct material_request {
    struct material material;
};

struct bivariate {
    double alpha_x, alpha_y, rho;
};

struct ellipse {
    double alpha_1, alpha_2, phi;
};

struct material_response {
    const char *ndf;
    struct bivariate *bivariate;
    struct ellipse *ellipse;
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
     .doc = "roughness along the principal axes"},
    {O(moments), FIELD_NUMBERS, .min_items = 5, .max_items = 5,
     .doc = "beckmann: E[x], E[y], E[x^2], E[y^2], E[xy] of the slopes"},
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
    {O(note), FIELD_TEXT, .doc = "what was made of the base"},
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

static bool describe_roughness(struct call *call, const facet_roughness *r)
{
    struct material_response *out = call->out;
    facet_ellipse e = facet_roughness_to_ellipse(r);
    out->bivariate = api_arena_alloc(call->arena, sizeof *out->bivariate);
    out->ellipse = api_arena_alloc(call->arena, sizeof *out->ellipse);
    if (!out->bivariate || !out->ellipse) return api_problem_memory(call->problem);
    *out->bivariate = (struct bivariate){r->alpha_x, r->alpha_y, r->rho};
    *out->ellipse = (struct ellipse){e.alpha_1, e.alpha_2, e.phi};
    return true;
}

static bool describe(struct call *call, const struct surface *surface, const struct material *in)
{
    struct material_response *out = call->out;
    const facet_roughness *r = &surface->facet.roughness;
    double x = r->slope_x, y = r->slope_y, length = sqrt(1 + x * x + y * y);
    double moments[] = {x, y, r->alpha_x * r->alpha_x / 2 + x * x,
                        r->alpha_y * r->alpha_y / 2 + y * y,
                        r->rho * r->alpha_x * r->alpha_y / 2 + x * y};
    out->ndf = api_ndf_names[in->ndf];
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
    /* As they came, where they are the material's own. */
    const bool own = in->moments.values && !in->base && !in->jacobian.values &&
                     isnan(in->height_scale);
    out->note = surface->note;
    if (in->ndf == FACET_BECKMANN &&
        !numbers(call, own ? in->moments.values : moments, 5, &out->moments))
        return false;
    return numbers(call, (double[]){x, y}, 2, &out->mean_slope) &&
           numbers(call, (double[]){(0 - x) / length, (0 - y) / length, 1 / length}, 3,
                   &out->mean_normal);
}

static bool handle(struct call *call)
{
    const struct material_request *in = call->in;
    struct decoder decoder = {call->arena, call->problem};
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
