/*
 * specialised.c - what every loop of lib/kernel/loops.def gains over the general
 * one that would serve in its place, on the same material and pairs.
 *
 * Three ways to be special, one object a line: by shape (isotropic, central; the
 * general loop is the sheared one), by Fresnel kind (one channel of a kind known in
 * advance; the general loop switches), by outputs (fr alone beside all ten; fr and
 * pdf in one pass beside a pass each).  ns: the least of many batches in the
 * first-level cache, the two in turn; gain: how much longer the general loop takes.
 */
#include "brdf.h"
#include "dispatch.h"
#include "draw.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { PAIRS = 1024, ROUNDS = 60, REPEATS = 4, LOOPS_MAX = FACET_QUANTITY_COUNT };

static const char *const quantity_names[] = {
#define QUANTITY(id, name, coloured, doc) name,
#include "quantities.def"
#undef QUANTITY
};
static const char *const ndf_names[] = {[FACET_GGX] = "ggx", [FACET_BECKMANN] = "beckmann"};
static const char *const shape_names[] = {
    [KERNEL_ISO] = "isotropic", [KERNEL_CENTRAL] = "central", [KERNEL_SHEARED] = "sheared"};
static const char *const kind_names[] = {[FACET_FRESNEL_IDEAL] = "ideal",
                                         [FACET_FRESNEL_SCHLICK] = "schlick",
                                         [FACET_FRESNEL_DIELECTRIC] = "dielectric"};
enum { KINDS = sizeof kind_names / sizeof *kind_names };

/* What is compared: one pass each over the same batch. */
struct loops {
    size_t count;
    kernel_eval_fn *of[LOOPS_MAX];
};

/* The pairs in the type that the tier's kernels take. */
struct scene {
    const char *isa;
    facet_ndf ndf;
    enum kernel_shape shape;
    facet_tier tier;
    const struct facet_kernels *kernels;
    const struct facet_samplers *samplers;
    facet_brdf *brdf;
    struct kernel_job job;
};

static _Alignas(64) double directions[6][PAIRS], results[FACET_QUANTITY_COUNT][PAIRS];

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static facet_brdf *brdf_of(facet_ndf ndf, enum kernel_shape shape, facet_fresnel_kind kind)
{
    facet_material m = {.ndf = ndf,
                        .roughness = {.alpha_x = 0.3, .alpha_y = 0.3},
                        .fresnel = {.kind = kind, .channels = 1}};
    if (shape != KERNEL_ISO) m.roughness.alpha_y = 0.4, m.roughness.rho = 0.3;
    if (shape == KERNEL_SHEARED) m.roughness.slope_x = 0.1, m.roughness.slope_y = -0.2;
    m.fresnel.f0[0] = 0.04;
    m.fresnel.eta[0] = 1.5;
    facet_brdf *brdf = NULL;
    return facet_brdf_create(&m, &brdf) ? NULL : brdf;
}

static void fill_directions(enum kernel_io io)
{
    struct rng rng;
    rng_seed(&rng, 6);
    for (size_t k = 0; k < PAIRS; k++) {
        double w[2][3];
        draw_direction(&rng, 0.05, w[0]);
        draw_direction(&rng, 0.05, w[1]);
        for (int j = 0; j < 6; j++) {
            if (io == KERNEL_FLOAT)
                ((float *)(void *)directions[j])[k] = (float)w[j / 3][j % 3];
            else
                directions[j][k] = w[j / 3][j % 3];
        }
    }
}

static bool open_scene(struct scene *s, facet_fresnel_kind kind)
{
    enum kernel_io io = s->tier == FACET_PRECISE ? KERNEL_DOUBLE : KERNEL_FLOAT;
    s->kernels = facet_kernels_for(s->tier, io);
    s->samplers = facet_samplers_for(s->tier, io);
    s->brdf = brdf_of(s->ndf, s->shape, kind);
    if (!s->kernels || !s->brdf) return false;
    fill_directions(io);
    s->job = (struct kernel_job){.kind = kind, .channels = 1, .fresnel = s->brdf->fresnel};
    for (int j = 0; j < 3; j++) s->job.wi[j] = directions[j], s->job.wo[j] = directions[3 + j];
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) s->job.out[q][0] = results[q];
    return true;
}

static double time_of(const struct scene *s, const struct loops *loops)
{
    double start = now_ns();
    for (int r = 0; r < REPEATS; r++)
        for (size_t i = 0; i < loops->count; i++) loops->of[i](&s->brdf->surface, &s->job, PAIRS);
    return (now_ns() - start) / REPEATS / PAIRS;
}

static void compare(const struct scene *s, const char *by, const char *what,
                    const struct loops *special, const struct loops *general)
{
    double ours = INFINITY, theirs = INFINITY;
    for (size_t i = 0; i < LOOPS_MAX; i++)
        if ((i < special->count && !special->of[i]) || (i < general->count && !general->of[i]))
            return;
    for (int round = 0; round < ROUNDS; round++) {
        ours = fmin(ours, time_of(s, special));
        theirs = fmin(theirs, time_of(s, general));
    }
    printf(
        "{\"by\":\"%s\",\"loop\":\"%s %s\",\"ndf\":\"%s\",\"tier\":\"%s\",\"isa\":\"%s\",\"ns\":%.3f,\"general_ns\":%.3f,\"gain\":%.3f}\n",
        by, shape_names[s->shape], what, ndf_names[s->ndf], facet_tier_name(s->tier), s->isa, ours,
        theirs, theirs / ours - 1);
    fflush(stdout);
}

/* Every quantity's own loop of this shape beside that for sheared surfaces. */
static void compare_shapes(const struct scene *s)
{
    if (s->shape == KERNEL_SHEARED) return;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        kernel_eval_fn *const(*of)[KERNEL_MASKING_COUNT] = s->kernels->eval[q][s->ndf];
        struct loops special = {1, {of[s->shape][KERNEL_SMITH]}},
                     general = {1, {of[KERNEL_SHEARED][KERNEL_SMITH]}};
        compare(s, "shape", quantity_names[q], &special, &general);
    }
}

/* The loop that serves a quantity where no Fresnel kind is known. */
static kernel_eval_fn *serving(const struct scene *s, int q)
{
    kernel_eval_fn *const(
        *of)[KERNEL_MASKING_COUNT] = s->kernels->eval[q][q == FACET_F ? FACET_GGX : s->ndf];
    if (q == FACET_F) return of[KERNEL_ISO][KERNEL_SMITH];
    return of[s->shape][KERNEL_SMITH] ? of[s->shape][KERNEL_SMITH]
                                      : of[KERNEL_SHEARED][KERNEL_SMITH];
}

static void compare_outputs(const struct scene *s)
{
    struct loops fr = {1, {serving(s, FACET_FR)}}, all = {0, {NULL}};
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) all.of[all.count++] = serving(s, q);
    compare(s, "outputs", "fr alone, not all ten", &fr, &all);
    struct loops joint = {1, {s->kernels->fr_pdf[s->ndf][s->shape]}},
                 two = {2, {serving(s, FACET_FR), serving(s, FACET_PDF)}};
    compare(s, "outputs", "fr and pdf at once", &joint, &two);
    enum { BOUNDED = FACET_SAMPLER_BOUNDED };
    struct loops bounded = {1, {s->samplers->fr_pdf[s->ndf][BOUNDED][s->shape]}},
                 each = {2, {serving(s, FACET_FR), s->samplers->pdf[s->ndf][BOUNDED][s->shape]}};
    compare(s, "outputs", "fr and pdf of bounded caps at once", &bounded, &each);
}

static void compare_all(struct scene s)
{
    for (int kind = 0; kind < KINDS; kind++) {
        if (!open_scene(&s, (facet_fresnel_kind)kind)) continue;
        if (kind == FACET_FRESNEL_SCHLICK) compare_shapes(&s), compare_outputs(&s);
        struct loops special = {1, {s.kernels->fr_achromatic[s.ndf][s.shape][kind]}},
                     general = {1, {serving(&s, FACET_FR)}};
        char name[48];
        snprintf(name, sizeof name, "fr, %s", kind_names[kind]);
        compare(&s, "fresnel", name, &special, &general);
        facet_brdf_destroy(s.brdf);
    }
}

int main(void)
{
    const char *wanted = getenv("BENCH_ISA"), *isa;
    for (size_t i = 0; (isa = facet_isa_list(i)); i++) {
        if ((wanted && *wanted && !strstr(wanted, isa)) || facet_isa_select(isa)) continue;
        for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++)
            for (int shape = 0; shape < KERNEL_SHAPE_COUNT; shape++)
                for (int tier = 0; tier < FACET_TIER_COUNT; tier++)
                    compare_all((struct scene){.isa = isa,
                                               .ndf = (facet_ndf)ndf,
                                               .shape = (enum kernel_shape)shape,
                                               .tier = (facet_tier)tier});
    }
    return 0;
}
