#include "material.h"

#include "facet_forms.h"
#include "lambert.h"
#include "limits.h"
#include "material_slopes.h"
#include "transmission.h"

#include <float.h>
#include <math.h>
#include <string.h>

const char *const api_ndf_names[] = {"ggx", "beckmann", "tabulated", "lambert", NULL};
const char *const api_masking_names[] = {"smith", "smith_uncorrelated", "vgroove", "none", NULL};
const char *const api_shear_names[] = {"energy_safe", "thesis", NULL};

static const struct metal {
    double eta[3], k[3];
} metals[] = {
#define METAL(name, er, eg, eb, kr, kg, kb, source) {{er, eg, eb}, {kr, kg, kb}},
#include "metals.def"
#undef METAL
};

const char *const api_metal_names[] = {
#define METAL(name, er, eg, eb, kr, kg, kb, source) #name,
#include "metals.def"
#undef METAL
    NULL,
};

/* ---- Tables ------------------------------------------------------------------------- */

static bool check_conductor(void *object, const struct place *place, struct decoder *decoder)
{
    const struct conductor *conductor = object;
    bool has_eta = conductor->eta.channels, has_k = conductor->k.channels;
    if (conductor->metal >= 0 ? !has_eta && !has_k : has_eta && has_k) return true;
    return api_problem_at(decoder->problem, place, "must have either eta and k, or metal");
}

static bool check_table(void *object, const struct place *place, struct decoder *decoder)
{
    const struct fresnel_table *table = object;
    struct place nodes = {place, "cos_theta_d", 0}, values = {place, "values", 0};
    for (size_t i = 1; i < table->cos_theta_d.count; i++) {
        struct place at = {&nodes, NULL, i};
        const double *node = table->cos_theta_d.values + i;
        char value[NUMBER_ROOM], last[NUMBER_ROOM];
        if (node[0] > node[-1]) continue;
        api_number_print(value, node[0]);
        api_number_print(last, node[-1]);
        return api_problem_at(decoder->problem, &at, "%s must be larger than its predecessor %s",
                              value, last);
    }
    if (table->values.columns != 1 && table->values.columns != 3)
        return api_problem_at(decoder->problem, &values, "must hold numbers or [r,g,b]");
    if (table->values.rows != table->cos_theta_d.count)
        return api_problem_at(decoder->problem, &values, "has %zu elements, cos_theta_d has %zu",
                              table->values.rows, table->cos_theta_d.count);
    return true;
}

bool api_material_is_turned(const struct material *material)
{
    return material->slopes && material->slopes->log_D.columns > 1;
}

static const struct field schlick_fields[] = {
    {MEMBER(struct schlick, f0), FIELD_COLOUR, FIELD_MUST, .min = 0, .max = 1,
     .doc = "reflectance at normal incidence"},
    {0},
};

static const struct field dielectric_fields[] = {
    {MEMBER(struct dielectric, eta), FIELD_COLOUR, FIELD_MUST, .min = FACET_ETA_MIN,
     .max = FACET_ETA_MAX, .doc = "index of refraction, inside over outside"},
    {0},
};

static const struct field conductor_fields[] = {
    {MEMBER(struct conductor, eta), FIELD_COLOUR, .min = FACET_ETA_MIN, .max = FACET_ETA_MAX,
     .doc = "real part of the index of refraction"},
    {MEMBER(struct conductor, k), FIELD_COLOUR, .min = 0, .max = FACET_K_MAX,
     .doc = "extinction coefficient"},
    {MEMBER(struct conductor, metal), FIELD_ENUM, .names = api_metal_names,
     .doc = "eta and k of a metal at 630, 532 and 465 nm"},
    {0},
};

static const struct field table_fields[] = {
    {MEMBER(struct fresnel_table, cos_theta_d), FIELD_NUMBERS, FIELD_MUST, .min = 0, .max = 1,
     .min_items = 2, .max_items = LIMIT_TABLE_NODES, .doc = "nodes, increasing"},
    {MEMBER(struct fresnel_table, values), FIELD_MATRIX, FIELD_MUST, .min = 0, .max = 1e6,
     .width = 1, .doc = "a number or [r,g,b] per node; linear between, constant outside"},
    {0},
};

static const struct field fresnel_keys[] = {
    {MEMBER(struct fresnel, schlick), FIELD_OPTION, .fields = schlick_fields,
     .size = sizeof(struct schlick), .doc = "f0 + (1 - f0)(1 - cos theta_d)^5"},
    {MEMBER(struct fresnel, dielectric), FIELD_OPTION, .fields = dielectric_fields,
     .size = sizeof(struct dielectric), .doc = "unpolarised, 1 at total reflection"},
    {MEMBER(struct fresnel, conductor), FIELD_OPTION, .fields = conductor_fields,
     .size = sizeof(struct conductor), .check = check_conductor, .doc = "unpolarised"},
    {MEMBER(struct fresnel, table), FIELD_OPTION, .fields = table_fields,
     .size = sizeof(struct fresnel_table), .check = check_table, .doc = "values over cos theta_d"},
    {0},
};

static const struct field fresnel_forms[] = {
    [FRESNEL_WORD_IDEAL] = {.name = "ideal", .type = FIELD_WORD, .doc = "F = 1"},
    [FRESNEL_BY_KEY] = {.name = "by key",
                        .type = FIELD_OBJECT,
                        .fields = fresnel_keys,
                        .one_of = true},
    {0},
};

#define ALPHA .min = FACET_ALPHA_MIN, .max = FACET_ALPHA_MAX
#define AXIS .min = FACET_AXIS_MIN, .max = FACET_AXIS_MAX
#define M(member) MEMBER(struct material, member)

const struct field api_material_fields[] = {
    {M(ndf), FIELD_ENUM, FIELD_DEFAULT, .names = api_ndf_names,
     .doc = "distribution of slopes; lambert has none"},
    {M(slopes), FIELD_OPTION, .fields = api_slopes_fields, .size = sizeof(struct slopes),
     .check = api_slopes_check,
     .doc = "the table of a tabulated distribution, as a fit returns it"},
    {M(alpha), FIELD_NUMBER, ALPHA, .doc = "isotropic roughness; 1 for tabulated by default"},
    {M(alpha_x), FIELD_NUMBER, ALPHA, .doc = "roughness along x, with alpha_y"},
    {M(alpha_y), FIELD_NUMBER, ALPHA, .doc = "roughness along y, with alpha_x"},
    {M(rho), FIELD_NUMBER, .min = -FACET_RHO_MAX, .max = FACET_RHO_MAX,
     .doc = "correlation of the slopes, with alpha_x and alpha_y; 0 by default"},
    {M(alpha_1), FIELD_NUMBER, AXIS,
     .doc =
         "roughness along the first axis, with alpha_2; what alpha_x, alpha_y and rho in range make"},
    {M(alpha_2), FIELD_NUMBER, AXIS, .doc = "roughness along the second axis, with alpha_1"},
    {M(phi), FIELD_NUMBER, .min = -FACET_PHI_MAX, .max = FACET_PHI_MAX, .unit = "rad",
     .doc = "the first axis lies at -phi (Dupuy 2.25), with alpha_1 and alpha_2; 0 by default"},
    {M(moments), FIELD_NUMBERS, .min = -2e12, .max = 2e12, .min_items = 5, .max_items = 5,
     .doc = "E[x], E[y], E[x^2], E[y^2], E[xy] of the slopes; beckmann; carries the mean slope"},
    {M(height_scale), FIELD_NUMBER, .min = -1e12, .max = 1e12,
     .doc = "multiplies the heights whose moments are given; 1 by default"},
    {M(jacobian), FIELD_VECTORS, .width = 2, .min = -1e12, .max = 1e12, .min_items = 2,
     .max_items = 2,
     .doc =
         "[[du/dx, du/dy], [dv/dx, dv/dy]]: stretch and shear of the map whose moments along u and v "
         "are given (Dupuy section 3.4); identity by default"},
    {M(base), FIELD_OPTION, .fields = api_base_fields, .size = sizeof(struct material),
     .check = api_base_check,
     .doc = "roughness of the surface below, added as an independent process; beckmann"},
    {M(mean_slope), FIELD_NUMBERS, .min = -FACET_MEAN_SLOPE_MAX, .max = FACET_MEAN_SLOPE_MAX,
     .min_items = 2, .max_items = 2, .doc = "mean slope along x and y; [0,0] by default"},
    {M(masking), FIELD_ENUM, FIELD_DEFAULT, .names = api_masking_names,
     .doc = "masking and shadowing; smith is height-correlated"},
    {M(shear), FIELD_ENUM, FIELD_DEFAULT, .names = api_shear_names,
     .doc = "masking of a surface with a mean slope; with thesis weights may exceed 1"},
    {M(fresnel), FIELD_UNION, FIELD_DEFAULT, .fields = fresnel_forms, .initial = FRESNEL_WORD_IDEAL,
     .doc = "Fresnel term"},
    {M(diffuse), FIELD_COLOUR, .min = 0, .max = 1,
     .doc = "kd of a diffuse part: fr = (1 - kd) specular + kd/pi (Dupuy 5.4), sampled by mixing "
            "cosine samples in; 0 by default"},
    {M(reflectance), FIELD_COLOUR, .min = 0, .max = 1,
     .doc = "of ndf lambert, which has no other member: fr = reflectance/pi"},
    {M(transmission), FIELD_BOOL, FIELD_DEFAULT,
     .doc =
         "rough dielectric: wi and wo may lie below, where the index is eta (Walter et al. 2007); ggx or "
         "beckmann, smith maskings, one eta"},
    {M(transport), FIELD_ENUM, .names = api_transport_names,
     .doc =
         "with transmission: importance, the default, conserves energy over wi; radiance divides what is "
         "transmitted by n^2, n the index on wi's side over that on wo's"},
    {0},
};

/* ---- Roughness --------------------------------------------------------------------------- */

static bool given(double x)
{
    return !isnan(x);
}

/* Of the members of one form: `needed` are all there or none is, `extra` only beside them. */
static bool check_form(const struct material *m, const struct place *place, struct decoder *decoder)
{
    const struct {
        double first, second, extra;
        const char *name_first, *name_second, *name_extra;
    } forms[] = {
        {m->alpha_x, m->alpha_y, m->rho, "alpha_x", "alpha_y", "rho"},
        {m->alpha_1, m->alpha_2, m->phi, "alpha_1", "alpha_2", "phi"},
    };
    for (int i = 0; i < 2; i++) {
        bool any = given(forms[i].first) || given(forms[i].second) || given(forms[i].extra);
        struct place first = {place, forms[i].name_first, 0},
                     second = {place, forms[i].name_second, 0};
        if (any && !given(forms[i].first))
            return api_problem_at(decoder->problem, &first, "is required with %s",
                                  given(forms[i].second) ? forms[i].name_second
                                                         : forms[i].name_extra);
        if (any && !given(forms[i].second))
            return api_problem_at(decoder->problem, &second, "is required with %s",
                                  forms[i].name_first);
    }
    return true;
}

/* One roughness, by its first member that is there; a table is one by itself. */
static bool check_one_form(const struct material *m, const struct place *place,
                           struct decoder *decoder)
{
    const struct {
        bool is_given;
        const char *name;
    } members[] = {
        {given(m->alpha), "alpha"}, {given(m->alpha_x), "alpha_x"}, {given(m->alpha_y), "alpha_y"},
        {given(m->rho), "rho"},     {given(m->alpha_1), "alpha_1"}, {given(m->alpha_2), "alpha_2"},
        {given(m->phi), "phi"},     {m->moments.values, "moments"},
    };
    static const int form[] = {0, 1, 1, 1, 2, 2, 2, 3};
    static const char forms[] = "alpha, or alpha_x and alpha_y, or alpha_1 and alpha_2, or moments";
    int first = -1;
    for (int i = 0; i < (int)(sizeof members / sizeof *members); i++) {
        if (!members[i].is_given) continue;
        if (first < 0) first = i;
        if (form[i] != form[first])
            return api_problem_at(decoder->problem, place,
                                  "must have exactly one roughness, not %s beside %s: %s",
                                  members[i].name, members[first].name, forms);
    }
    return first >= 0 || m->ndf == FACET_TABULATED ||
           api_problem_at(decoder->problem, place, "must have exactly one roughness: %s", forms);
}

bool api_roughness_check(const struct material *m, const struct place *place,
                         struct decoder *decoder)
{
    struct place moments = {place, "moments", 0};
    if (!check_one_form(m, place, decoder) || !check_form(m, place, decoder)) return false;
    if (!m->moments.values) return true;
    if (m->ndf != FACET_BECKMANN)
        return api_problem_at(decoder->problem, &moments, "need ndf \"beckmann\"");
    if (m->mean_slope.values)
        return api_problem_at(decoder->problem, &moments, "carry the mean slope: drop mean_slope");
    return true;
}

bool api_material_check(void *material, const struct place *place, struct decoder *decoder)
{
    const struct material *m = material;
    if (m->ndf == NDF_LAMBERT || m->reflectance.channels)
        return api_lambert_check(m, place, decoder);
    struct place slopes = {place, "slopes", 0}, shear = {place, "shear", 0};
    if (m->ndf == FACET_TABULATED && !m->slopes)
        return api_problem_at(decoder->problem, &slopes, "is required with ndf \"tabulated\"");
    if (m->ndf != FACET_TABULATED && m->slopes)
        return api_problem_at(decoder->problem, &slopes, "needs ndf \"tabulated\"");
    if (m->shear == FACET_THESIS && m->masking != FACET_SMITH &&
        m->masking != FACET_SMITH_UNCORRELATED)
        return api_problem_at(decoder->problem, &shear, "\"thesis\" needs a smith masking");
    return api_roughness_check(m, place, decoder) && api_process_check(m, place, decoder) &&
           api_transmission_check(m, place, decoder);
}

double api_slope_gain(facet_ndf ndf)
{
    return ndf == FACET_GGX ? 8 : 304;
}

double api_rounding_error(facet_ndf ndf)
{
    return api_slope_gain(ndf) * (DBL_EPSILON / 2);
}

bool api_roughness_refuse(const facet_roughness *r, facet_status status, const struct place *place,
                          struct decoder *decoder)
{
    char x[NUMBER_ROOM], y[NUMBER_ROOM], rho[NUMBER_ROOM];
    api_number_print(x, r->alpha_x);
    api_number_print(y, r->alpha_y);
    api_number_print(rho, r->rho);
    return api_problem_at(decoder->problem, place, "alpha_x %s, alpha_y %s, rho %s: %s", x, y, rho,
                          facet_status_text(status));
}

static bool open_ellipse(const struct material *m, const struct place *place,
                         struct decoder *decoder, struct surface *surface)
{
    facet_ellipse ellipse = {m->alpha_1, m->alpha_2, given(m->phi) ? m->phi : 0};
    facet_roughness *r = &surface->facet.roughness;
    struct place at = {place, "alpha_1", 0};
    facet_status status = facet_roughness_from_ellipse(&ellipse, r->slope_x, r->slope_y, r);
    if (status) return api_roughness_refuse(r, status, &at, decoder);
    if (r->low.alpha_x != 0) surface->parameter_error = api_rounding_error(surface->facet.ndf);
    return true;
}

/* Of the surface alone; nothing where it has moments. */
static bool open_alone(const struct material *m, const struct place *place, struct decoder *decoder,
                       struct surface *surface)
{
    facet_roughness *r = &surface->facet.roughness;
    if (m->mean_slope.values) {
        r->slope_x = m->mean_slope.values[0];
        r->slope_y = m->mean_slope.values[1];
    }
    if (m->moments.values) return true;
    if (given(m->alpha_1)) return open_ellipse(m, place, decoder, surface);
    r->alpha_x = given(m->alpha_x) ? m->alpha_x : given(m->alpha) ? m->alpha : 1;
    r->alpha_y = given(m->alpha_x) ? m->alpha_y : r->alpha_x;
    r->rho = given(m->rho) ? m->rho : 0;
    return true;
}

static bool open_roughness(const struct material *m, const struct place *place,
                           struct decoder *decoder, struct surface *surface)
{
    struct surface base = {.facet.ndf = surface->facet.ndf};
    struct place at = {place, "base", 0};
    if (!open_alone(m, place, decoder, surface)) return false;
    if (!m->moments.values && !m->base) return true;
    if (m->base && !open_alone(m->base, &at, decoder, &base)) return false;
    surface->parameter_error += base.parameter_error;
    return api_process_open(m, &base.facet.roughness, place, decoder, surface);
}

/* ---- Fresnel -------------------------------------------------------------------------------- */

static void spread(const struct colour *colour, double out[3])
{
    for (int i = 0; i < 3; i++) out[i] = colour->value[colour->channels == 3 ? i : 0];
}

static void open_conductor(const struct conductor *conductor, facet_fresnel *fresnel)
{
    fresnel->kind = FACET_FRESNEL_CONDUCTOR;
    if (conductor->metal >= 0) {
        fresnel->channels = 3;
        memcpy(fresnel->eta, metals[conductor->metal].eta, sizeof fresnel->eta);
        memcpy(fresnel->k, metals[conductor->metal].k, sizeof fresnel->k);
        return;
    }
    bool coloured = conductor->eta.channels == 3 || conductor->k.channels == 3;
    fresnel->channels = coloured ? 3 : 1;
    spread(&conductor->eta, fresnel->eta);
    spread(&conductor->k, fresnel->k);
}

static bool open_table(const struct fresnel_table *table, struct decoder *decoder,
                       facet_fresnel *fresnel)
{
    size_t n = table->cos_theta_d.count, channels = table->values.columns;
    double *columns = api_arena_doubles(decoder->arena, n * channels);
    if (!columns) return api_problem_memory(decoder->problem);
    for (size_t c = 0; c < channels; c++) {
        for (size_t i = 0; i < n; i++) columns[c * n + i] = table->values.values[i * channels + c];
        fresnel->values[c] = columns + c * n;
    }
    fresnel->kind = FACET_FRESNEL_TABLE;
    fresnel->channels = channels;
    fresnel->count = n;
    fresnel->cos_theta_d = table->cos_theta_d.values;
    return true;
}

static bool open_fresnel(const struct fresnel *in, struct decoder *decoder, facet_fresnel *fresnel)
{
    *fresnel = (facet_fresnel){.kind = FACET_FRESNEL_IDEAL, .channels = 1};
    if (in->form != FRESNEL_BY_KEY) return true;
    if (in->table) return open_table(in->table, decoder, fresnel);
    if (in->conductor) {
        open_conductor(in->conductor, fresnel);
        return true;
    }
    const struct colour *colour = in->schlick ? &in->schlick->f0 : &in->dielectric->eta;
    fresnel->kind = in->schlick ? FACET_FRESNEL_SCHLICK : FACET_FRESNEL_DIELECTRIC;
    fresnel->channels = colour->channels;
    spread(colour, in->schlick ? fresnel->f0 : fresnel->eta);
    return true;
}

/* ---- Open ----------------------------------------------------------------------------------- */

static void destroy_brdf(void *brdf)
{
    facet_brdf_destroy(brdf);
}

/* A coloured diffuse part makes a specular one of one channel into three alike. */
static void open_diffuse(const struct material *material, struct surface *surface)
{
    const struct colour *diffuse = surface->is_lambert ? &material->reflectance
                                                       : &material->diffuse;
    facet_fresnel *f = &surface->facet.fresnel;
    if (diffuse->channels == 0) return;
    spread(diffuse, surface->diffuse);
    surface->has_diffuse = surface->is_lambert ||
                           fmax(surface->diffuse[0],
                                fmax(surface->diffuse[1], surface->diffuse[2])) > 0;
    if (diffuse->channels == 1 || f->channels == 3) return;
    f->channels = 3;
    for (int c = 1; c < 3; c++) {
        f->f0[c] = f->f0[0];
        f->eta[c] = f->eta[0];
        f->k[c] = f->k[0];
        f->values[c] = f->values[0];
    }
}

bool api_material_open(const struct material *material, const struct place *place,
                       struct decoder *decoder, struct surface *surface)
{
    *surface = (struct surface){0};
    facet_material *facet = &surface->facet;
    surface->is_lambert = material->ndf == NDF_LAMBERT;
    facet->ndf = surface->is_lambert ? FACET_GGX : (facet_ndf)material->ndf;
    facet->masking = (facet_masking)material->masking;
    facet->shear = (facet_shear)material->shear;
    if (!open_roughness(material, place, decoder, surface)) return false;
    if (!open_fresnel(&material->fresnel, decoder, &facet->fresnel)) return false;
    if (material->slopes && !api_slopes_open(material->slopes, place, decoder, facet)) return false;
    open_diffuse(material, surface);
    surface->channels = facet->fresnel.channels;
    facet_status status = facet_brdf_create(facet, &surface->brdf);
    if (status) return api_problem_status(decoder->problem, status, place);
    if (!api_arena_defer(decoder->arena, destroy_brdf, surface->brdf))
        return api_problem_memory(decoder->problem);
    return api_transmission_open(material, place, decoder, surface);
}
