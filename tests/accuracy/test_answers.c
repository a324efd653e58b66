/*
 * Random requests through the public door: the numbers of every answer against
 * the quad-precision reference on the numbers sent, those of a table against precise.  The error never exceeds the
 * bound answered.  FACET_TEST_SCALE=100 asks a million pairs.
 */
#include "ask.h"
#include "check.h"
#include "draw.h"
#include "facet_table.h"
#include "form.h"
#include "reference.h"
#include "reference_samplers.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PAIRS = 20 };

static const struct draw_domain domain = {
    .alpha_min = 1e-4, .alpha_max = 10, .rho_max = 0.95, .slope_max = 0.5, .cosine_min = 1e-6};

struct text {
    char bytes[16384];
    size_t size;
};

__attribute__((format(printf, 2, 3))) static void put(struct text *t, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    t->size += (size_t)vsnprintf(t->bytes + t->size, sizeof t->bytes - t->size, format, list);
    va_end(list);
}

static void put_directions(struct text *t, const char *name, double w[PAIRS][3])
{
    put(t, ",\"%s\":[", name);
    for (int k = 0; k < PAIRS; k++)
        put(t, "%s[%.17g,%.17g,%.17g]", k ? "," : "", w[k][0], w[k][1], w[k][2]);
    put(t, "]");
}

/* A table between GGX and Beckmann. */
enum { NODES = 33 };
#define SCALE 1.5

static double log_d_at(int k)
{
    double u = (double)k / (NODES - 1), r = SCALE * u / (1 - u);
    return k == NODES - 1 ? -30 : 2 * log1p(r * r) - 30 * r * r / (25 + r * r) - 4 * log1p(r);
}

static const facet_slope_table *table_of(void)
{
    static facet_slope_table *table;
    double log_d[NODES];
    for (int k = 0; k < NODES; k++) log_d[k] = log_d_at(k);
    if (!table) CHECK_INT(facet_slope_table_create(SCALE, log_d, NODES, &table), FACET_OK);
    return table;
}

static void put_material(struct text *t, const facet_material *m)
{
    static const char *const ndfs[] = {"ggx", "beckmann", "tabulated"}, *const maskings[] = {
                                                                            "smith",
                                                                            "smith_uncorrelated",
                                                                            "vgroove", "none"};
    const facet_roughness *r = &m->roughness;
    put(t,
        "{\"material\":{\"ndf\":\"%s\",\"alpha_x\":%.17g,\"alpha_y\":%.17g,\"rho\":%.17g,\"mean_slope\":[%.17g,%.17g],\"masking\":\"%s\"",
        ndfs[m->ndf], r->alpha_x, r->alpha_y, r->rho, r->slope_x, r->slope_y, maskings[m->masking]);
    if (m->ndf == FACET_TABULATED) {
        put(t, ",\"slopes\":{\"scale\":%g,\"log_D\":[", SCALE);
        for (int k = 0; k < NODES; k++) put(t, "%s%.17g", k ? "," : "", log_d_at(k));
        put(t, "]}");
    }
    const facet_fresnel *f = &m->fresnel;
    if (f->kind == FACET_FRESNEL_SCHLICK)
        put(t, ",\"fresnel\":{\"schlick\":{\"f0\":%.17g}}", f->f0[0]);
    if (f->kind == FACET_FRESNEL_DIELECTRIC)
        put(t, ",\"fresnel\":{\"dielectric\":{\"eta\":%.17g}}", f->eta[0]);
    put(t, "}");
}

static double length(const double w[3])
{
    return hypot(hypot(w[0], w[1]), w[2]);
}

static facet_material any_material(struct rng *rng)
{
    facet_material m = {.ndf = (facet_ndf)(rng_uniform(rng) * FACET_NDF_COUNT),
                        .fresnel = {.channels = 1}};
    if (m.ndf == FACET_TABULATED) m.table = table_of();
    m.masking = rng_uniform(rng) < 0.7 ? FACET_SMITH
                                       : (facet_masking)(rng_uniform(rng) * FACET_MASKING_COUNT);
    draw_roughness(rng, &domain, &m.roughness);
    m.fresnel.kind = (facet_fresnel_kind)(rng_uniform(rng) * 3); /* ideal, Schlick, dielectric */
    m.fresnel.f0[0] = rng_uniform(rng);
    m.fresnel.eta[0] = 1.01 + 2 * rng_uniform(rng);
    return m;
}

static const struct {
    const char *name;
    facet_quantity quantity;
} asked[] = {{"fr", FACET_FR}, {"pdf", FACET_PDF}, {"D", FACET_D}};
enum { ASKED = sizeof asked / sizeof *asked };

/* An answer of either encoding. */
struct told {
    double y[ASKED][PAIRS], bound;
    const char *tier;
    bool as_form, floats;
};

static void read_json(const struct answer *a, struct told *told)
{
    json_t *accuracy = json_object_get(a->json, "accuracy");
    told->tier = json_string_value(json_object_get(accuracy, "tier"));
    told->bound = answer_bound(a);
    for (size_t j = 0; j < ASKED; j++)
        for (size_t k = 0; k < PAIRS; k++) told->y[j][k] = answer_number(a, asked[j].name, k);
}

static void read_bytes(const struct answer *a, struct told *told)
{
    const char *layout = "", *answer = "{}";
    for (size_t i = 0; i < a->response.header_count; i++) {
        if (!strcmp(a->response.headers[i].name, "Facet-Layout"))
            layout = a->response.headers[i].value;
        if (!strcmp(a->response.headers[i].name, "Facet-Answer"))
            answer = a->response.headers[i].value;
    }
    json_t *root = json_loads(answer, 0, NULL), *accuracy = json_object_get(root, "accuracy");
    told->bound = answer_value(json_object_get(accuracy, "bound"));
    for (int t = 0; t < FACET_TIER_COUNT; t++) {
        const char *name = facet_tier_name((facet_tier)t),
                   *tier = json_string_value(json_object_get(accuracy, "tier"));
        if (tier && !strcmp(tier, name)) told->tier = name;
    }
    json_decref(root);
    told->floats = strstr(layout, "<f4");
    CHECK_INT(a->response.body_size,
              ASKED * PAIRS * (told->floats ? sizeof(float) : sizeof(double)));
    for (size_t j = 0; j < ASKED; j++)
        for (size_t k = 0; k < PAIRS; k++) {
            size_t i = j * PAIRS + k;
            told->y[j][k] = told->floats ? ((const float *)a->response.body)[i]
                                         : ((const double *)a->response.body)[i];
        }
}

/* The pdf of what auto stands for. */
static quad exact_pdf(const facet_material *m, const double wi[3], const double wo[3],
                      const struct reference *x)
{
    const quad i[3] = {wi[0], wi[1], wi[2]}, H[3] = {i[0] + wo[0], i[1] + wo[1], i[2] + wo[2]};
    switch (facet_sampler_auto(m)) {
    case FACET_SAMPLER_BOUNDED: return reference_pdf_by(REFERENCE_BOUNDED, m, i, wo, H);
    case FACET_SAMPLER_VCAVITY: return reference_pdf_by(REFERENCE_VCAVITY, m, i, wo, H);
    default: return x->of[FACET_PDF][0];
    }
}

/* What is asked, exactly; of a table what precise answers, which may itself err by so much. */
static double model_at(const facet_material *m, const double wi[3], const double wo[3],
                       quad x[ASKED])
{
    struct reference exact;
    if (m->ndf != FACET_TABULATED) reference_eval(m, wi, wo, &exact);
    for (size_t j = 0; j < ASKED && m->ndf != FACET_TABULATED; j++)
        x[j] = asked[j].quantity == FACET_PDF ? exact_pdf(m, wi, wo, &exact)
                                              : exact.of[asked[j].quantity][0];
    if (m->ndf != FACET_TABULATED) return 0;
    double y[ASKED], worst = 0;
    facet_brdf *brdf = NULL;
    facet_outputs outputs = {{{NULL}}};
    CHECK_INT(facet_brdf_create(m, &brdf), FACET_OK);
    for (size_t j = 0; j < ASKED; j++) outputs.of[asked[j].quantity][0] = &y[j];
    facet_eval(brdf, FACET_PRECISE, (facet_vec3_in){&wi[0], &wi[1], &wi[2]},
               (facet_vec3_in){&wo[0], &wo[1], &wo[2]}, 1, &outputs);
    for (size_t j = 0; j < ASKED; j++) {
        double bound;
        CHECK(facet_bound(brdf, FACET_PRECISE, asked[j].quantity, 0, &bound));
        worst = fmax(worst, bound);
        x[j] = (quad)y[j];
    }
    facet_brdf_destroy(brdf);
    return worst;
}

static void check_told(const facet_material *m, const struct told *told, double wi[PAIRS][3],
                       double wo[PAIRS][3], size_t tiers[FACET_TIER_COUNT])
{
    for (int t = 0; t < FACET_TIER_COUNT; t++)
        tiers[t] += told->tier && !strcmp(told->tier, facet_tier_name((facet_tier)t));
    for (size_t k = 0; k < PAIRS; k++) {
        quad x[ASKED];
        double own = model_at(m, wi[k], wo[k], x);
        for (size_t j = 0; j < ASKED; j++) {
            double y = told->y[j][k], error = reference_error(y, x[j], FACET_FLOOR);
            if (error <= told->bound + own) continue;
            /* On an edge of what is drawn, which lies below the horizon, either side will do. */
            bool is_pdf = asked[j].quantity == FACET_PDF;
            if (is_pdf && wi[k][2] <= 0 && (y == 0) != (x[j] == 0)) continue;
            check_fail(__FILE__, __LINE__,
                       "%s is %.17g, not %.17g: error %.3g, answered bound %.3g, %s%s\n    %s\n    "
                       "wi {%.17g, %.17g, %.17g} wo {%.17g, %.17g, %.17g}",
                       asked[j].name, y, (double)x[j], error, told->bound,
                       told->tier ? told->tier : "?",
                       told->as_form ? told->floats ? " in floats" : " as a form" : "",
                       draw_text(m), wi[k][0], wi[k][1], wi[k][2], wo[k][0], wo[k][1], wo[k][2]);
        }
    }
}

/* Also in place: w is what is sent.  volatile: gcc 12 takes vectors of (double)(float)x for x. */
static void round_to_floats(double w[PAIRS][3], float out[PAIRS][3])
{
    for (int k = 0; k < PAIRS; k++)
        for (int j = 0; j < 3; j++) {
            volatile float f = (float)w[k][j];
            w[k][j] = out[k][j] = f;
        }
}

/* As JSON, or as a form of floats that is answered in bytes. */
static struct answer ask_pairs(struct text *t, double wi[PAIRS][3], double wo[PAIRS][3],
                               double tolerance, bool as_form)
{
    static const char rest[] = ",\"outputs\":[\"fr\",\"pdf\",\"D\"],\"tolerance\":";
    if (!as_form) {
        put_directions(t, "wi", wi);
        put_directions(t, "wo", wo);
    }
    put(t, "%s%.17g}", rest, tolerance);
    if (!as_form) return ask_post("/v1/eval", t->bytes);
    float in[2][PAIRS][3];
    struct form form = {0};
    round_to_floats(wi, in[0]);
    round_to_floats(wo, in[1]);
    form_add_text(&form, "request", t->bytes);
    form_add(&form, "wi", in[0], sizeof in[0]);
    form_add(&form, "wo", in[1], sizeof in[1]);
    form_end(&form);
    struct answer a = ask_with((struct api_request){.method = "POST",
                                                    .path = "/v1/eval",
                                                    .content_type = FORM_TYPE,
                                                    .accept = "application/octet-stream",
                                                    .body = form.bytes,
                                                    .body_size = form.size});
    form_clear(&form);
    return a;
}

TEST(no_error_exceeds_the_bound_answered)
{
    struct rng rng;
    rng_seed(&rng, 41);
    size_t pairs = 0, refused = 0, in_floats = 0, tiers[2][FACET_TIER_COUNT] = {{0}};
    for (size_t n = draw_count(500); n--;) {
        static double wi[PAIRS][3], wo[PAIRS][3];
        struct text t = {.size = 0};
        struct told told = {.tier = NULL};
        facet_material m = any_material(&rng);
        bool as_form = (n & 3) == 3, floats = (n & 3) == 1;
        told.as_form = as_form;
        for (int k = 0; k < PAIRS; k++) {
            do { /* what is not a unit vector is normalised first, or refused */
                draw_pair(&rng, &domain, &m, wi[k], wo[k]);
            } while (fabs(length(wi[k]) - 1) > 1e-7 || fabs(length(wo[k]) - 1) > 1e-7);
            for (int j = 0; j < 3 && floats; j++)
                wi[k][j] = (float)wi[k][j], wo[k][j] = (float)wo[k][j];
        }
        put_material(&t, &m);
        struct answer a = ask_pairs(&t, wi, wo, rng_log(&rng, 1e-15, 1e-1), as_form);
        if (a.response.status == 200) {
            if (as_form)
                read_bytes(&a, &told);
            else
                read_json(&a, &told);
            check_told(&m, &told, wi, wo, tiers[m.ndf == FACET_TABULATED]);
            pairs += PAIRS;
            in_floats += told.floats ? PAIRS : 0;
        } else {
            refused++;
            CHECK_INT(a.response.status, 422);
        }
        answer_clear(&a);
    }
    check_note("pairs", (double)pairs);
    check_note("answered in floats", (double)in_floats);
    check_note("refused", (double)refused);
    for (int t = 0; t < FACET_TIER_COUNT; t++)
        check_note(facet_tier_name((facet_tier)t), (double)tiers[0][t]);
    check_note("draft, tables", (double)tiers[1][FACET_DRAFT]);
    check_note("exact32, tables", (double)tiers[1][FACET_EXACT32]);
    if (draw_count(100) < 100) return;
    for (int t = 0; t < FACET_TIER_COUNT; t++) CHECK(tiers[0][t]);
    CHECK(tiers[1][FACET_DRAFT] && tiers[1][FACET_EXACT32]); /* which promise all that there is */
    CHECK(in_floats);
}
