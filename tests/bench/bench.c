/*
 * bench.c - speed and error together: every quantity, ndf, variant, tier and
 * instruction set against the textbook, in one run.
 *
 * Prints one JSON object a line.  ns: the
 * least of many batches of pairs in the first-level cache; ratio: the textbook's
 * ns over ours, both measured here and now; errors: relative, against the
 * quad-precision reference, over materials and pairs drawn across the variant's
 * whole domain.  The float tiers are fed floats, precise doubles.
 */
#include "../accuracy/reference.h"
#include "draw.h"
#include "yardstick.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { PAIRS = 1024, ROUNDS = 15, REPEATS = 24, MATERIALS = 48, PAIRS_EACH = 256 };

static const char *const quantity_names[] = {
#define QUANTITY(id, name, coloured, doc) name,
#include "quantities.def"
#undef QUANTITY
};

/* What a scene may hold: the members vary over the errors' materials. */
struct variant {
    const char *name;
    facet_fresnel_kind fresnel;
    bool full; /* anisotropic, correlated, sheared */
};

static const struct variant variants[] = {
    {"iso_ideal", FACET_FRESNEL_IDEAL, false},
    {"iso_schlick", FACET_FRESNEL_SCHLICK, false},
    {"full_dielectric", FACET_FRESNEL_DIELECTRIC, true},
};
enum { VARIANTS = sizeof variants / sizeof *variants };

static const struct draw_domain iso_domain = {
    .alpha_min = 1e-4, .alpha_max = 10, .rho_max = 0, .slope_max = 0, .cosine_min = 1e-6};
static const struct draw_domain full_domain = {
    .alpha_min = 0.05, .alpha_max = 2, .rho_max = 0.7, .slope_max = 0.3, .cosine_min = 1e-3};

/* Pairs in both types: the doubles hold what the floats hold.  On cache lines, as large batches are. */
struct pairs {
    size_t n;
    _Alignas(64) double d[6][PAIRS];
    _Alignas(64) float f[6][PAIRS];
};

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static facet_material material_of(facet_ndf ndf, const struct variant *v)
{
    facet_material m = {.ndf = ndf,
                        .roughness = {.alpha_x = 0.3, .alpha_y = 0.3},
                        .fresnel = {.kind = v->fresnel, .channels = 1}};
    if (v->full)
        m.roughness = (facet_roughness){
            .alpha_x = 0.3, .alpha_y = 0.4, .rho = 0.3, .slope_x = 0.1, .slope_y = -0.2};
    m.fresnel.f0[0] = 0.04;
    m.fresnel.eta[0] = 1.5;
    return m;
}

static void fill_pairs(struct pairs *p, struct rng *rng, const struct draw_domain *domain,
                       const facet_material *m, size_t n, bool hard)
{
    p->n = n;
    for (size_t k = 0; k < n; k++) {
        double w[2][3];
        if (hard) {
            draw_pair(rng, domain, m, w[0], w[1]);
        } else {
            draw_direction(rng, 0.05, w[0]);
            draw_direction(rng, 0.05, w[1]);
        }
        for (int j = 0; j < 6; j++) {
            p->f[j][k] = (float)w[j / 3][j % 3];
            p->d[j][k] = p->f[j][k];
        }
    }
}

static void evaluate(const facet_brdf *brdf, facet_tier tier, const struct pairs *p,
                     facet_quantity q, double *out)
{
    if (tier == FACET_PRECISE) {
        facet_outputs o = {{{NULL}}};
        o.of[q][0] = out;
        facet_eval(brdf, tier, (facet_vec3_in){p->d[0], p->d[1], p->d[2]},
                   (facet_vec3_in){p->d[3], p->d[4], p->d[5]}, p->n, &o);
        return;
    }
    facet_outputs_float o = {{{NULL}}};
    o.of[q][0] = (float *)out;
    facet_eval_float(brdf, tier, (facet_vec3_in_float){p->f[0], p->f[1], p->f[2]},
                     (facet_vec3_in_float){p->f[3], p->f[4], p->f[5]}, p->n, &o);
}

static double value_at(facet_tier tier, const double *out, size_t k)
{
    return tier == FACET_PRECISE ? out[k] : (double)((const float *)out)[k];
}

/* The least time of one evaluation, ours and the textbook's in turn. */
struct timing {
    double ours, textbook;
};

static struct timing measure(const facet_material *m, facet_tier tier, facet_quantity q,
                             const struct pairs *p)
{
    static double out[PAIRS];
    struct timing least = {INFINITY, INFINITY};
    struct yardstick y = yardstick_of(m);
    facet_brdf *brdf = NULL;
    if (facet_brdf_create(m, &brdf)) return least;
    double sink = 0;
    for (int round = 0; round < ROUNDS; round++) {
        double start = now_ns();
        for (int r = 0; r < REPEATS; r++) evaluate(brdf, tier, p, q, out);
        least.ours = fmin(least.ours, (now_ns() - start) / REPEATS / (double)p->n);
        start = now_ns();
        for (size_t k = 0; k < p->n; k++) {
            const double wi[3] = {p->d[0][k], p->d[1][k], p->d[2][k]},
                         wo[3] = {p->d[3][k], p->d[4][k], p->d[5][k]};
            sink += yardstick_eval(&y, q, wi, wo);
        }
        least.textbook = fmin(least.textbook, (now_ns() - start) / (double)p->n);
    }
    facet_brdf_destroy(brdf);
    if (sink == 0.123) puts("");
    return least;
}

/* ---- errors --------------------------------------------------------------------------- */

struct errors {
    double max, square;
    size_t count;
};

/* The textbook comes after the tiers. */
enum { TEXTBOOK = FACET_TIER_COUNT };
static struct errors errors[FACET_QUANTITY_COUNT][FACET_TIER_COUNT + 1];

static void add_error(struct errors *e, double y, quad x)
{
    double error = reference_error(y, x, FACET_FLOOR);
    e->max = fmax(e->max, error);
    e->square += error * error;
    e->count++;
}

static void compare(const facet_material *m, const facet_brdf *brdf, const struct pairs *p)
{
    static double out[FACET_QUANTITY_COUNT][FACET_TIER_COUNT][PAIRS];
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (int t = 0; t < FACET_TIER_COUNT; t++)
            evaluate(brdf, (facet_tier)t, p, (facet_quantity)q, out[q][t]);
    for (size_t k = 0; k < p->n; k++) {
        const double wi[3] = {p->d[0][k], p->d[1][k], p->d[2][k]},
                     wo[3] = {p->d[3][k], p->d[4][k], p->d[5][k]};
        struct reference x;
        struct yardstick y = yardstick_of(m);
        reference_eval(m, wi, wo, &x);
        for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
            add_error(&errors[q][TEXTBOOK], yardstick_eval(&y, (facet_quantity)q, wi, wo),
                      x.of[q][0]);
        for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
            for (int t = 0; t < FACET_TIER_COUNT; t++) {
                double bound;
                if (!facet_bound(brdf, (facet_tier)t, (facet_quantity)q, 0, &bound)) continue;
                if (t < FACET_PRECISE && x.of[q][0] > 3e38Q) continue; /* saturates */
                add_error(&errors[q][t], value_at((facet_tier)t, out[q][t], k), x.of[q][0]);
            }
    }
}

static void find_errors(facet_ndf ndf, const struct variant *v)
{
    static struct pairs p;
    const struct draw_domain *domain = v->full ? &full_domain : &iso_domain;
    struct rng rng;
    rng_seed(&rng, 5);
    memset(errors, 0, sizeof errors);
    for (size_t k = 0; k < draw_count(MATERIALS); k++) {
        facet_material m = material_of(ndf, v);
        facet_brdf *brdf = NULL;
        if (v->full)
            draw_roughness(&rng, domain, &m.roughness);
        else
            m.roughness.alpha_x = m.roughness.alpha_y = rng_log(&rng, domain->alpha_min,
                                                                domain->alpha_max);
        m.fresnel.f0[0] = 0.02 + 0.9 * rng_uniform(&rng);
        m.fresnel.eta[0] = 1.2 + rng_uniform(&rng);
        if (facet_brdf_create(&m, &brdf)) continue;
        fill_pairs(&p, &rng, domain, &m, PAIRS_EACH, true);
        compare(&m, brdf, &p);
        facet_brdf_destroy(brdf);
    }
}

/* ---- all of it ----------------------------------------------------------------------------- */

static bool wanted(const char *filter, const char *name)
{
    return !filter || !*filter || strstr(filter, name);
}

static double ghz;

/* A dependent addition takes a cycle. */
static double measure_clock(void)
{
    enum { STEPS = 100000000 };
    double best = 0;
    for (int round = 0; round < 3; round++) {
        double start = now_ns();
        unsigned long x = 1;
        for (long i = 0; i < STEPS; i++) {
            x += 3;
            __asm__ volatile("" : "+r"(x));
        }
        best = fmax(best, STEPS / (now_ns() - start));
    }
    return best;
}

static void bench(facet_ndf ndf, const struct variant *v, const char *isa)
{
    static struct pairs p;
    const facet_material m = material_of(ndf, v);
    struct rng rng;
    rng_seed(&rng, 6);
    fill_pairs(&p, &rng, &full_domain, &m, PAIRS, false);
    find_errors(ndf, v);
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (int t = 0; t < FACET_TIER_COUNT; t++) {
            const struct errors *e = &errors[q][t];
            if (!e->count || !wanted(getenv("BENCH_QUANTITY"), quantity_names[q])) continue;
            struct timing time = measure(&m, (facet_tier)t, (facet_quantity)q, &p);
            printf(
                "{\"quantity\":\"%s\",\"ndf\":\"%s\",\"variant\":\"%s\",\"tier\":\"%s\",\"isa\":\"%s\",\"ns\":%.3f,"
                "\"ratio\":%.1f,\"max_rel\":%.2g,\"rms_rel\":%.2g,\"textbook_max_rel\":%.2g,\"ghz\":%.2f}\n",
                q == FACET_FR ? "eval" : quantity_names[q], ndf == FACET_GGX ? "ggx" : "beckmann",
                v->name, facet_tier_name((facet_tier)t), isa, time.ours, time.textbook / time.ours,
                e->max, sqrt(e->square / (double)e->count), fmin(errors[q][TEXTBOOK].max, 1), ghz);
            fflush(stdout);
        }
}

int main(void)
{
    const char *isa;
    ghz = measure_clock();
    for (size_t i = 0; (isa = facet_isa_list(i)); i++) {
        if (!wanted(getenv("BENCH_ISA"), isa) || facet_isa_select(isa)) continue;
        for (int ndf = 0; ndf < 2; ndf++)
            for (size_t v = 0; v < VARIANTS; v++) bench((facet_ndf)ndf, &variants[v], isa);
    }
    return 0;
}
