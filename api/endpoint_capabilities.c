/* GET /v1/capabilities: what this daemon can do, how accurately, how fast, within which limits. */
#include "endpoint.h"
#include "limits.h"
#include "material.h"
#include "sampler.h"
#include "speed.h"
#include "tolerance.h"

#include <stdatomic.h>

/* Of the materials that are described. */
#define ALPHA 0.3

struct model {
    const char *ndf;
    const char *sampler; /* NULL: cannot be sampled */
    uint32_t samplers, masking, shear;
    bool transmission;
};

struct promise_of_quantity {
    const char *quantity;
    double bound, ns;
};

struct speed {
    const char *ndf;
    double bound, ns_per_eval;
    struct list quantities; /* of struct promise_of_quantity */
};

struct tier {
    const char *name, *domain;
    struct list models, transmission; /* of struct speed */
};

struct capabilities {
    struct list models, tiers, limits;
    uint32_t outputs, metals;
    double tolerance_default;
    const char *isa;
};

static const char *const quantity_names[] = {
#define QUANTITY(id, name, coloured, doc) name,
#include "quantities.def"
#undef QUANTITY
    NULL,
};

#define F(type, member) MEMBER(struct type, member)

static const struct field model_fields[] = {
    {F(model, ndf), FIELD_TEXT, FIELD_MUST, .doc = "distribution of slopes; lambert has none"},
    {F(model, sampler), FIELD_TEXT,
     .doc =
         "how it is sampled unless asked otherwise, if it can be, at alpha 0.3 and smith masking: "
         "\"auto\" goes by the material"},
    {F(model, samplers), FIELD_SET, .names = api_sampler_names,
     .doc = "all the ways it can be sampled, if it can be"},
    {F(model, masking), FIELD_SET, .names = api_masking_names, .doc = "maskings, of microfacets"},
    {F(model, shear), FIELD_SET, .names = api_shear_names, .doc = "forms of shear, of microfacets"},
    {F(model, transmission), FIELD_BOOL, FIELD_MUST,
     .doc =
         "also as a rough dielectric with transmission: smith maskings, energy_safe, visible normals; "
         "the tiers' domains say what each has of it"},
    {0},
};

static const struct field quantity_fields[] = {
    {F(promise_of_quantity, quantity), FIELD_TEXT, FIELD_MUST, .doc = "as in \"outputs\""},
    {F(promise_of_quantity, bound), FIELD_NUMBER, FIELD_MUST, .doc = "relative error promised"},
    {F(promise_of_quantity, ns), FIELD_NUMBER, FIELD_MUST, .unit = "ns",
     .doc = "one, in a batch, measured once, on this machine"},
    {0},
};

static const struct field speed_fields[] = {
    {F(speed, ndf), FIELD_TEXT, FIELD_MUST,
     .doc = "an isotropic material, alpha 0.3, F = 1; of transmission: eta 1.5"},
    {F(speed, bound), FIELD_NUMBER, FIELD_MUST, .doc = "relative error promised for its fr"},
    {F(speed, ns_per_eval), FIELD_NUMBER, FIELD_MUST, .unit = "ns",
     .doc = "one fr, in a batch, measured once, on this machine"},
    {F(speed, quantities), FIELD_LIST, FIELD_MUST, .fields = quantity_fields,
     .size = sizeof(struct promise_of_quantity), .doc = "every output of that material"},
    {0},
};

static const struct field tier_fields[] = {
    {F(tier, name), FIELD_TEXT, FIELD_MUST, .doc = "as in \"tier\" and \"accuracy\""},
    {F(tier, domain), FIELD_TEXT, FIELD_MUST,
     .doc = "where it promises anything; elsewhere the next tier is taken"},
    {F(tier, models), FIELD_LIST, FIELD_MUST, .fields = speed_fields, .size = sizeof(struct speed),
     .doc = "what it promises and costs"},
    {F(tier, transmission), FIELD_LIST, FIELD_MUST, .fields = speed_fields,
     .size = sizeof(struct speed),
     .doc = "the same of rough dielectrics, half of the pairs across the surface"},
    {0},
};

static const struct field limit_fields[] = {
    {F(api_limit, name), FIELD_TEXT, FIELD_MUST, .doc = "which"},
    {F(api_limit, value), FIELD_INTEGER, FIELD_MUST, .doc = "how much"},
    {F(api_limit, doc), FIELD_TEXT, FIELD_MUST, .doc = "of what"},
    {0},
};

static const struct field response_fields[] = {
    {F(capabilities, models), FIELD_LIST, FIELD_MUST, .fields = model_fields,
     .size = sizeof(struct model), .doc = "materials"},
    {F(capabilities, outputs), FIELD_SET, FIELD_MUST, .names = quantity_names,
     .doc = "what /v1/eval computes"},
    {F(capabilities, metals), FIELD_SET, FIELD_MUST, .names = api_metal_names,
     .doc = "metals with known index of refraction"},
    {F(capabilities, tiers), FIELD_LIST, FIELD_MUST, .fields = tier_fields,
     .size = sizeof(struct tier), .doc = "cheapest first"},
    {F(capabilities, tolerance_default), FIELD_NUMBER, FIELD_MUST,
     .doc = "\"tolerance\" if none is given"},
    {F(capabilities, isa), FIELD_TEXT, FIELD_MUST, .doc = "instruction set in use"},
    {F(capabilities, limits), FIELD_LIST, FIELD_MUST, .fields = limit_fields,
     .size = sizeof(struct api_limit), .doc = "every limit"},
    {0},
};

static uint32_t all_of(const char *const *names)
{
    uint32_t set = 0;
    for (int i = 0; names[i]; i++) set |= UINT32_C(1) << i;
    return set;
}

static bool list_models(struct call *call, struct list *out)
{
    enum { COUNT = NDF_LAMBERT + 1 };
    struct model *models = api_arena_array(call->arena, COUNT, sizeof *models);
    if (!models) return api_problem_memory(call->problem);
    for (int i = 0; i < COUNT; i++) {
        bool has_facets = i < FACET_NDF_COUNT;
        const struct surface plain = {
            .facet = {.ndf = (facet_ndf)i, .roughness = {.alpha_x = ALPHA, .alpha_y = ALPHA}},
            .is_lambert = i == NDF_LAMBERT};
        models[i] = (struct model){api_ndf_names[i],
                                   api_sampler_names[api_sampler_of(&plain, FACET_SAMPLER_AUTO)],
                                   api_samplers(i),
                                   has_facets ? all_of(api_masking_names) : 0,
                                   has_facets ? all_of(api_shear_names) : 0,
                                   has_facets &&
                                       facet_bsdf_sampler_serves(FACET_SAMPLER_AUTO, (facet_ndf)i)};
    }
    *out = (struct list){COUNT, models};
    return true;
}

/* What a number costs, measured once: answers stay the same, as their ETag says. */
static bool cost_of(const struct surface *surface, facet_tier tier, facet_quantity quantity,
                    struct arena *arena, double *ns)
{
    static _Atomic double measured[2][FACET_NDF_COUNT][FACET_TIER_COUNT]
                                  [FACET_QUANTITY_COUNT]; /* 0: not yet */
    _Atomic double *first = &measured[surface->bsdf != NULL][surface->facet.ndf][tier][quantity];
    double none = 0;
    *ns = *first;
    if (*ns != 0) return true;
    if (!api_measure_eval(surface->brdf, surface->bsdf, tier, quantity, arena, ns)) return false;
    if (!atomic_compare_exchange_strong(first, &none, *ns)) *ns = none;
    return true;
}

static bool bound_of(const struct surface *surface, facet_tier tier, facet_quantity quantity,
                     double *bound)
{
    if (surface->bsdf) return facet_bsdf_bound(surface->bsdf, tier, quantity, 0, bound);
    return quantity == FACET_PDF
               ? facet_pdf_bound(surface->brdf, tier, FACET_SAMPLER_AUTO, 0, bound)
               : facet_bound(surface->brdf, tier, quantity, 0, bound);
}

static bool list_quantities(struct call *call, const struct surface *surface, facet_tier tier,
                            struct list *out)
{
    struct promise_of_quantity *list = api_arena_array(call->arena, FACET_QUANTITY_COUNT,
                                                       sizeof *list);
    if (!list) return api_problem_memory(call->problem);
    *out = (struct list){0, list};
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        struct promise_of_quantity *one = &list[out->count];
        one->quantity = quantity_names[q];
        if (!bound_of(surface, tier, (facet_quantity)q, &one->bound)) continue;
        if (!cost_of(surface, tier, (facet_quantity)q, call->arena, &one->ns))
            return api_problem_memory(call->problem);
        out->count++;
    }
    return true;
}

/* One struct speed per analytic distribution that the tier has. */
static bool list_speeds(struct call *call, facet_tier tier, bool transmission, struct list *out)
{
    static const facet_ndf analytic[] = {FACET_GGX, FACET_BECKMANN};
    enum { COUNT = sizeof analytic / sizeof *analytic };
    struct decoder decoder = {call->arena, call->problem};
    struct dielectric glass = {.eta = {.channels = 1, .value = {1.5}}};
    struct speed *speeds = api_arena_array(call->arena, COUNT, sizeof *speeds);
    if (!speeds) return api_problem_memory(call->problem);
    *out = (struct list){0, speeds};
    for (int i = 0; i < COUNT; i++) {
        struct material material;
        struct surface surface;
        api_field_clear(api_material_fields, &material);
        material.ndf = analytic[i];
        material.alpha = ALPHA;
        material.transmission = transmission;
        if (transmission)
            material.fresnel = (struct fresnel){.form = FRESNEL_BY_KEY, .dielectric = &glass};
        if (!api_material_open(&material, NULL, &decoder, &surface)) return false;
        struct speed *speed = &speeds[out->count];
        speed->ndf = api_ndf_names[analytic[i]];
        if (!list_quantities(call, &surface, tier, &speed->quantities)) return false;
        if (!speed->quantities.count) continue;
        const struct promise_of_quantity *fr = speed->quantities.items; /* the first */
        speed->bound = fr->bound;
        speed->ns_per_eval = fr->ns;
        out->count++;
    }
    return true;
}

static bool describe_tier(struct call *call, int tier, struct tier *out)
{
    *out = (struct tier){.name = api_tier_names[tier],
                         .domain = facet_tier_domain((facet_tier)tier)};
    return list_speeds(call, (facet_tier)tier, false, &out->models) &&
           list_speeds(call, (facet_tier)tier, true, &out->transmission);
}

static bool list_tiers(struct call *call, struct list *out)
{
    struct tier *tiers = api_arena_array(call->arena, FACET_TIER_COUNT, sizeof *tiers);
    if (!tiers) return api_problem_memory(call->problem);
    for (int i = 0; i < FACET_TIER_COUNT; i++)
        if (!describe_tier(call, i, &tiers[i])) return false;
    *out = (struct list){FACET_TIER_COUNT, tiers};
    return true;
}

static bool list_limits(struct call *call, struct list *out)
{
    size_t n = api_limit_count();
    struct api_limit *limits = api_arena_array(call->arena, n, sizeof *limits);
    if (!limits) return api_problem_memory(call->problem);
    api_limits(limits);
    *out = (struct list){n, limits};
    return true;
}

static bool handle(struct call *call)
{
    struct capabilities *out = call->out;
    out->outputs = all_of(quantity_names);
    out->metals = all_of(api_metal_names);
    out->tolerance_default = TOLERANCE_DEFAULT;
    out->isa = facet_isa();
    return list_limits(call, &out->limits) && list_models(call, &out->models) &&
           list_tiers(call, &out->tiers);
}

const struct endpoint api_endpoint_capabilities = {
    .method = "GET",
    .path = "/v1/capabilities",
    .summary = "Models, samplers, tiers, limits",
    .response = response_fields,
    .response_size = sizeof(struct capabilities),
    .handle = handle,
};
