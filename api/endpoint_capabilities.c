/* GET /v1/capabilities: what this daemon can do, how accurately, how fast, within which limits. */
#include "endpoint.h"
#include "facet_fit.h"
#include "limits.h"
#include "material.h"
#include "sampler.h"
#include "speed.h"
#include "tolerance.h"

#include <math.h>
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
    int64_t azimuths; /* -1: a radial table, or none */
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
     .doc = "an isotropic material, alpha 0.3, F = 1; of transmission: eta 1.5; of tabulated: GGX "
            "at 25 nodes, any other table promises what it is measured to"},
    {F(speed, azimuths), FIELD_INTEGER,
     .doc = "rows of its slope table, if it is one over the azimuth"},
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

/* What a tier promises of a quantity, and what one costs. */
struct fact {
    _Atomic double bound, ns; /* bound NaN: nothing is promised */
};

/* The materials that are described, and what is known of each: measured once, as an ETag asks for. */
static struct subject {
    facet_ndf ndf;
    size_t azimuths; /* 0: no table, or a radial one */
    bool transmission;
    _Atomic bool known;
    struct fact facts[FACET_TIER_COUNT][FACET_QUANTITY_COUNT];
} subjects[] = {
    {.ndf = FACET_GGX},
    {.ndf = FACET_BECKMANN},
    {.ndf = FACET_TABULATED},
    {.ndf = FACET_TABULATED, .azimuths = FACET_FIT_ROWS / 2},
    {.ndf = FACET_GGX, .transmission = true},
    {.ndf = FACET_BECKMANN, .transmission = true},
};
enum { SUBJECTS = sizeof subjects / sizeof *subjects };

static bool bound_of(const struct surface *surface, facet_tier tier, facet_quantity quantity,
                     double *bound)
{
    if (surface->bsdf) return facet_bsdf_bound(surface->bsdf, tier, quantity, 0, bound);
    return quantity == FACET_PDF
               ? facet_pdf_bound(surface->brdf, tier, FACET_SAMPLER_AUTO, 0, bound)
               : facet_bound(surface->brdf, tier, quantity, 0, bound);
}

/* A table of so many nodes as compact fits have, of GGX: D is the same along all normals. */
static bool open_subject(const struct subject *subject, struct decoder *decoder,
                         struct surface *surface)
{
    enum { NODES = FACET_FIT_COMPACT + 1 };
    static double flat[NODES * FACET_FIT_ROWS / 2]; /* log D */
    struct dielectric glass = {.eta = {.channels = 1, .value = {1.5}}};
    struct slopes slopes = {1, subject->azimuths ? (struct matrix){subject->azimuths, NODES, flat}
                                                 : (struct matrix){NODES, 1, flat}};
    struct material material;
    api_field_clear(api_material_fields, &material);
    material.ndf = (int)subject->ndf;
    material.alpha = ALPHA;
    material.transmission = subject->transmission;
    if (subject->ndf == FACET_TABULATED) material.slopes = &slopes;
    if (subject->transmission)
        material.fresnel = (struct fresnel){.form = FRESNEL_BY_KEY, .dielectric = &glass};
    return api_material_open(&material, NULL, decoder, surface);
}

/* Who measures at the same time keeps what the first one found. */
static bool learn(struct subject *subject, const struct surface *surface, double *room)
{
    for (int t = 0; t < FACET_TIER_COUNT; t++) {
        for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
            struct fact *fact = &subject->facts[t][q];
            double bound, ns, none = 0;
            if (!bound_of(surface, (facet_tier)t, (facet_quantity)q, &bound)) {
                fact->bound = NAN;
                continue;
            }
            if (!api_measure_eval(surface->brdf, surface->bsdf, (facet_tier)t, (facet_quantity)q,
                                  room, &ns))
                return false;
            atomic_compare_exchange_strong(&fact->ns, &none, ns);
            fact->bound = bound;
        }
    }
    subject->known = true;
    return true;
}

static bool learn_all(struct call *call)
{
    struct decoder decoder = api_decoder(call);
    double *room = api_arena_doubles(call->arena, SPEED_ROOM);
    if (!room) return api_problem_memory(call->problem);
    for (int i = 0; i < SUBJECTS; i++) {
        struct surface surface;
        if (subjects[i].known) continue;
        if (!open_subject(&subjects[i], &decoder, &surface)) return false;
        const facet_slope_table *table = surface.facet.table;
        if (table && !facet_slope_table_has_floats(table)) return api_problem_memory(call->problem);
        if (!learn(&subjects[i], &surface, room)) return api_problem_memory(call->problem);
    }
    return true;
}

static bool list_quantities(struct call *call, const struct fact facts[FACET_QUANTITY_COUNT],
                            struct list *out)
{
    struct promise_of_quantity *list = api_arena_array(call->arena, FACET_QUANTITY_COUNT,
                                                       sizeof *list);
    if (!list) return api_problem_memory(call->problem);
    *out = (struct list){0, list};
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (!isnan(facts[q].bound))
            list[out->count++] = (struct promise_of_quantity){quantity_names[q], facts[q].bound,
                                                              facts[q].ns};
    return true;
}

/* One struct speed per subject that the tier has. */
static bool list_speeds(struct call *call, facet_tier tier, bool transmission, struct list *out)
{
    struct speed *speeds = api_arena_array(call->arena, SUBJECTS, sizeof *speeds);
    if (!speeds) return api_problem_memory(call->problem);
    *out = (struct list){0, speeds};
    for (int i = 0; i < SUBJECTS; i++) {
        const struct subject *subject = &subjects[i];
        struct speed *speed = &speeds[out->count];
        if (subject->transmission != transmission) continue;
        if (!list_quantities(call, subject->facts[tier], &speed->quantities)) return false;
        if (!speed->quantities.count) continue;
        const struct promise_of_quantity *fr = speed->quantities.items; /* the first */
        speed->ndf = api_ndf_names[subject->ndf];
        speed->azimuths = subject->azimuths ? (int64_t)subject->azimuths : -1;
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
    return list_limits(call, &out->limits) && list_models(call, &out->models) && learn_all(call) &&
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
