/* What lib promises (facet_bound, facet_condition) against the reference, on every instruction set. */
#include "check.h"
#include "draw.h"
#include "reference.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { PAIRS_MAX = 37 };

struct batch {
    size_t n;
    double i[3][PAIRS_MAX], o[3][PAIRS_MAX];
    double y[FACET_QUANTITY_COUNT][3][PAIRS_MAX];
};

static const struct {
    const char *name;
    bool coloured;
} quantities[] = {
#define QUANTITY(id, name, coloured, doc) {name, coloured},
#include "quantities.def"
#undef QUANTITY
};

/* The maskings with the shear forms they allow. */
static const struct {
    facet_masking masking;
    facet_shear shear;
} models[] = {
    {FACET_SMITH, FACET_ENERGY_SAFE},   {FACET_SMITH_UNCORRELATED, FACET_ENERGY_SAFE},
    {FACET_SMITH, FACET_THESIS},        {FACET_SMITH_UNCORRELATED, FACET_THESIS},
    {FACET_VGROOVE, FACET_ENERGY_SAFE}, {FACET_NONE, FACET_ENERGY_SAFE},
};
enum { MODELS = sizeof models / sizeof *models };

static size_t sampled[FACET_TIER_COUNT][FACET_QUANTITY_COUNT][2][MODELS][FACET_FRESNEL_COUNT];

static void get(const double v[3][PAIRS_MAX], size_t k, double out[3])
{
    for (int j = 0; j < 3; j++) out[j] = v[j][k];
}

static void run(const facet_brdf *brdf, facet_tier tier, size_t channels, struct batch *b)
{
    facet_vec3_in wi = {b->i[0], b->i[1], b->i[2]}, wo = {b->o[0], b->o[1], b->o[2]};
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (size_t c = 0; c < (quantities[q].coloured ? channels : 1); c++)
            outputs.of[q][c] = b->y[q][c];
    CHECK_INT(facet_eval(brdf, tier, wi, wo, b->n, &outputs), FACET_OK);
}

static void draw_batch(struct rng *rng, const struct draw_domain *domain, const facet_material *m,
                       struct batch *b)
{
    b->n = 1 + (size_t)(rng_uniform(rng) * PAIRS_MAX);
    for (size_t k = 0; k < b->n; k++) {
        double wi[3], wo[3];
        draw_pair(rng, domain, m, wi, wo);
        for (int j = 0; j < 3; j++) {
            b->i[j][k] = wi[j];
            b->o[j][k] = wo[j];
        }
    }
}

static bool conditioned(int q)
{
    return q == FACET_FR || q == FACET_FR_COS || q == FACET_G;
}

/* The factor by which this pair's bound grows (thesis shear only), as lib itself says. */
static double growth(const facet_brdf *brdf, const facet_material *m, const double wi[3],
                     const double wo[3])
{
    double condition = 1;
    if (m->shear != FACET_THESIS) return 1;
    facet_vec3_in i = {&wi[0], &wi[1], &wi[2]}, o = {&wo[0], &wo[1], &wo[2]};
    CHECK_INT(facet_condition(brdf, i, o, 1, &condition), FACET_OK);
    CHECK(condition >= 1);
    return condition;
}

struct row {
    facet_tier tier;
    int quantity, ndf, model, fresnel;
};

static void check_value(const struct row *row, const facet_material *m, const double wi[3],
                        const double wo[3], double y, quad x, double bound)
{
    if (x > DBL_MAX || x < -DBL_MAX) return; /* no double is near it */
    double error = reference_error(y, x, FACET_FLOOR);
    char name[48];
    snprintf(name, sizeof name, "%s/%s/%s", row->ndf == FACET_GGX ? "ggx" : "beckmann",
             facet_tier_name(row->tier), quantities[row->quantity].name);
    if (isfinite(error) && bound > 0) check_note(name, error / bound);
    if (error <= bound) return;
    check_fail(__FILE__, __LINE__,
               "%s is %.17g, not %.17g: error %.3g, bound %.3g\n    %s\n    "
               "wi {%.17g, %.17g, %.17g} wo {%.17g, %.17g, %.17g}",
               name, y, (double)x, error, bound, draw_text(m), wi[0], wi[1], wi[2], wo[0], wo[1],
               wo[2]);
}

/* Every number of the batch against the reference; bound < 0: what facet_bound says. */
static void check_batch(const facet_brdf *brdf, struct row row, const facet_material *m,
                        const struct batch *b, double forced)
{
    double bound[FACET_QUANTITY_COUNT];
    bool promised[FACET_QUANTITY_COUNT];
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        promised[q] = facet_bound(brdf, row.tier, (facet_quantity)q, 0, &bound[q]);
        if (forced > 0) {
            if (!promised[q] || !(bound[q] <= forced))
                check_fail(__FILE__, __LINE__, "%s promises %.3g, not %.3g: %s", quantities[q].name,
                           promised[q] ? bound[q] : INFINITY, forced, draw_text(m));
            promised[q] = true;
            bound[q] = forced;
        }
    }
    for (size_t k = 0; k < b->n; k++) {
        double wi[3], wo[3];
        struct reference x;
        get(b->i, k, wi);
        get(b->o, k, wo);
        reference_eval(m, wi, wo, &x);
        double grown = growth(brdf, m, wi, wo);
        if (!(grown * 4 >= (double)x.condition) && grown < 1e6)
            check_fail(__FILE__, __LINE__, "condition %.17g, not %.17g: %s", grown,
                       (double)x.condition, draw_text(m));
        for (row.quantity = 0; row.quantity < FACET_QUANTITY_COUNT; row.quantity++) {
            int q = row.quantity;
            double limit = bound[q] * (conditioned(q) ? grown : 1);
            if (!promised[q] || limit > 0.5) continue;
            sampled[row.tier][q][row.ndf][row.model][row.fresnel]++;
            for (size_t c = 0; c < (quantities[q].coloured ? m->fresnel.channels : 1); c++)
                check_value(&row, m, wi, wo, b->y[q][c][k], x.of[q][c], limit);
        }
    }
}

static void check_rows(size_t least)
{
    struct row r;
    for (int t = 0; t < FACET_TIER_COUNT; t++)
        for (r.quantity = 0; r.quantity < FACET_QUANTITY_COUNT; r.quantity++)
            for (r.ndf = 0; r.ndf < 2; r.ndf++)
                for (r.model = 0; r.model < MODELS; r.model++)
                    for (r.fresnel = 0; r.fresnel < FACET_FRESNEL_COUNT; r.fresnel++) {
                        size_t n = sampled[t][r.quantity][r.ndf][r.model][r.fresnel];
                        if (n < least)
                            check_fail(__FILE__, __LINE__,
                                       "tier %d %s ndf %d model %d fresnel %d: %zu samples", t,
                                       quantities[r.quantity].name, r.ndf, r.model, r.fresnel, n);
                    }
}

static void walk(const struct draw_domain *domain, size_t materials, facet_tier tier, double forced,
                 unsigned long long seed)
{
    struct rng rng;
    rng_seed(&rng, seed);
    static struct batch b;
    struct row row = {.tier = tier};
    for (row.ndf = 0; row.ndf < 2; row.ndf++)
        for (row.model = 0; row.model < MODELS; row.model++)
            for (row.fresnel = 0; row.fresnel < FACET_FRESNEL_COUNT; row.fresnel++)
                for (size_t k = 0; k < materials; k++) {
                    facet_material m = {.ndf = (facet_ndf)row.ndf,
                                        .masking = models[row.model].masking,
                                        .shear = models[row.model].shear};
                    draw_roughness(&rng, domain, &m.roughness);
                    draw_fresnel(&rng, (facet_fresnel_kind)row.fresnel, &m.fresnel);
                    for (int c = 0; c < 3 && forced > 0; c++)
                        m.fresnel.eta[c] = fmax(m.fresnel.eta[c], 0.1);
                    facet_brdf *brdf = NULL;
                    CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
                    if (!brdf) continue;
                    draw_batch(&rng, domain, &m, &b);
                    run(brdf, tier, m.fresnel.channels, &b);
                    check_batch(brdf, row, &m, &b, forced);
                    facet_brdf_destroy(brdf);
                }
}

TEST(bounds_hold_everywhere)
{
    memset(sampled, 0, sizeof sampled);
    for (int tier = 0; tier < FACET_TIER_COUNT; tier++)
        walk(&draw_everywhere, draw_count(30), (facet_tier)tier, 0, 1);
    if (draw_count(100) >= 100) check_rows(50);
}

TEST(bounds_hold_on_ordinary_materials)
{
    memset(sampled, 0, sizeof sampled);
    for (int tier = 0; tier < FACET_TIER_COUNT; tier++)
        walk(&draw_ordinary, draw_count(20), (facet_tier)tier, 0, 2);
    if (draw_count(100) >= 100) check_rows(50);
}

/* Issue 2: precise is within 1e-12 there, and says so (eta from .01 up: F at .001 is promised to
 * 2e-12). */
TEST(precise_is_within_1e_12_on_ordinary_materials)
{
    walk(&draw_ordinary, draw_count(20), FACET_PRECISE, 1e-12, 3);
}

/*
 * Components handed over with an absolute error: what lib makes of them against the exact value of
 * the unperturbed pair; the bound is asked for that error times the pair's closeness.
 */
static void perturb(struct rng *rng, double error, const struct batch *exact, struct batch *rounded)
{
    *rounded = *exact;
    for (int j = 0; j < 3; j++)
        for (size_t k = 0; k < exact->n; k++) {
            rounded->i[j][k] += error * 0.99 * (2 * rng_uniform(rng) - 1);
            rounded->o[j][k] += error * 0.99 * (2 * rng_uniform(rng) - 1);
        }
}

static size_t check_computed(const facet_brdf *brdf, struct row row, const facet_material *m,
                             const struct batch *exact, const struct batch *rounded, size_t k,
                             double error)
{
    double wi[3], wo[3];
    size_t checked = 0;
    struct reference x;
    get(exact->i, k, wi);
    get(exact->o, k, wo);
    facet_vec3_in i = {&rounded->i[0][k], &rounded->i[1][k], &rounded->i[2][k]};
    facet_vec3_in o = {&rounded->o[0][k], &rounded->o[1][k], &rounded->o[2][k]};
    double close = facet_closeness(brdf, i, o, 1, false), grown = growth(brdf, m, wi, wo);
    reference_eval(m, wi, wo, &x);
    for (row.quantity = 0; row.quantity < FACET_QUANTITY_COUNT; row.quantity++) {
        facet_quantity q = (facet_quantity)row.quantity;
        double bound;
        if (!facet_bound(brdf, row.tier, q, error * close, &bound)) continue;
        double limit = bound * (conditioned(row.quantity) ? grown : 1);
        if (limit > 0.1) continue;
        checked++;
        check_value(&row, m, wi, wo, rounded->y[q][0][k], x.of[q][0], limit);
    }
    return checked;
}

TEST(bounds_hold_for_computed_directions)
{
    static struct batch exact, rounded;
    struct rng rng;
    struct row row;
    rng_seed(&rng, 4);
    size_t checked = 0;
    for (size_t n = draw_count(1500); n--;) {
        row = (struct row){.tier = (facet_tier)(n % FACET_TIER_COUNT), .ndf = n / 4 & 1};
        row.model = (int)(n / 8 % MODELS);
        double error = rng_log(&rng, 1e-16, 1e-6);
        facet_material m = {.ndf = (facet_ndf)row.ndf,
                            .masking = models[row.model].masking,
                            .shear = models[row.model].shear};
        draw_roughness(&rng, &draw_ordinary, &m.roughness);
        draw_fresnel(&rng, (facet_fresnel_kind)(n / 48 % FACET_FRESNEL_COUNT), &m.fresnel);
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (!brdf) continue;
        draw_batch(&rng, &draw_ordinary, &m, &exact);
        perturb(&rng, error, &exact, &rounded);
        run(brdf, row.tier, m.fresnel.channels, &rounded);
        for (size_t k = 0; k < exact.n; k++)
            checked += check_computed(brdf, row, &m, &exact, &rounded, k, error);
        facet_brdf_destroy(brdf);
    }
    check_note("checked", (double)checked);
    CHECK(checked >= 20 * draw_count(1500));
}

/*
 * Nearly opposite directions of length 1 to a float's rounding, seen from behind a leaning Beckmann surface: h
 * may turn its back on wo, and the exponent of D/sigma is below 0.
 */
TEST(densities_of_normals_that_turn_their_back)
{
    struct rng rng;
    size_t n = draw_count(4000), beyond = 0;
    rng_seed(&rng, 77);
    for (size_t k = 0; k < n; k++) {
        double alpha = 0.05 + 0.3 * rng_uniform(&rng), lean = alpha * (4 + 8 * rng_uniform(&rng)),
               wi[3], wo[3], pdf, bound;
        facet_material m = {.ndf = FACET_BECKMANN,
                            .roughness = {.alpha_x = alpha, .alpha_y = alpha, .slope_y = lean},
                            .fresnel = {.channels = 1}};
        facet_brdf *brdf = NULL;
        struct reference x;
        draw_direction(&rng, 0.05, wo);
        wo[1] = fabs(wo[1]); /* away from the mean slope */
        double step = pow(10, -6 + 3 * rng_uniform(&rng));
        for (int j = 0; j < 3; j++)
            wi[j] = (float)(step * (rng_uniform(&rng) - 0.5) - wo[j]), wo[j] = (float)wo[j];
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (!brdf) continue;
        reference_eval(&m, wi, wo, &x);
        beyond += wo[0] * (wi[0] + wo[0]) + wo[1] * (wi[1] + wo[1]) + wo[2] * (wi[2] + wo[2]) < 0;
        const facet_outputs outputs = {.of = {[FACET_PDF] = {&pdf}}};
        for (int t = 0; t < FACET_TIER_COUNT; t++) {
            facet_tier tier = (facet_tier)t;
            if (!facet_bound(brdf, tier, FACET_PDF, 0, &bound) || x.of[FACET_PDF][0] > 1e300Q)
                continue;
            CHECK_INT(facet_eval(brdf, tier, (facet_vec3_in){&wi[0], &wi[1], &wi[2]},
                                 (facet_vec3_in){&wo[0], &wo[1], &wo[2]}, 1, &outputs),
                      FACET_OK);
            double error = reference_error(pdf, x.of[FACET_PDF][0], FACET_FLOOR);
            check_note(facet_tier_name(tier), error / bound);
            if (!(error <= bound))
                check_fail(__FILE__, __LINE__, "%s pdf is %.17g, not %.17g, bound %.3g: %s",
                           facet_tier_name(tier), pdf, (double)x.of[FACET_PDF][0], bound,
                           draw_text(&m));
        }
        facet_brdf_destroy(brdf);
    }
    check_note("beyond", (double)beyond / (double)n);
    CHECK(20 * beyond >= n);
}
