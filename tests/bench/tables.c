/*
 * tables.c - what a tabulated material costs: nanoseconds per fr (Smith, Schlick) in every tier, the error
 * against precise beside what is promised, and what making the table and its floats takes.
 */
#include "draw.h"
#include "slope_table.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { PAIRS = 4096, ROUNDS = 60, NODES = 400, ROWS_NODES = 91, ROWS = 45 };

static struct {
    _Alignas(64) double d[6][PAIRS];
    _Alignas(64) float f[6][PAIRS];
} pairs;

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static void draw_pairs(void)
{
    struct rng rng;
    rng_seed(&rng, 8);
    for (size_t k = 0; k < PAIRS; k++)
        for (int side = 0; side < 6; side += 3) {
            double w[3];
            draw_direction(&rng, 0.05, w);
            for (int j = 0; j < 3; j++) {
                pairs.f[side + j][k] = (float)w[j];
                pairs.d[side + j][k] = pairs.f[side + j][k];
            }
        }
}

/* Of GGX, of Beckmann, of a Beckmann ellipse over the azimuth. */
static const char *const sources[] = {"ggx", "beckmann", "azimuth"};
enum { SOURCES = 3, AZIMUTH = 2 };

static facet_slope_table *table_of(int source)
{
    static double log_d[NODES + ROWS * ROWS_NODES];
    size_t n = source == AZIMUTH ? ROWS_NODES : NODES, rows = source == AZIMUTH ? ROWS : 1;
    facet_slope_table *table = NULL;
    for (size_t k = 0; k < n * rows; k++) {
        double u = (double)(k % n) / (double)(n - 1), r = u / (1 - u);
        double x = cos(FACET_PI * (double)(k / n) / ROWS);
        double square = r * r * (source == AZIMUTH ? 1 + 3 * x * x : 1);
        log_d[k] = source == 0 ? 0 : u < 1 ? 2 * log1p(r * r) - square : -1e4;
    }
    if (source == AZIMUTH)
        facet_slope_table_create_turned(1, log_d, n, rows, NULL, &table);
    else
        facet_slope_table_create(1, log_d, n, &table);
    return table;
}

static void evaluate(const facet_brdf *brdf, facet_tier tier, double *out)
{
    facet_outputs o = {{{NULL}}};
    o.of[FACET_FR][0] = out;
    facet_eval(brdf, tier, (facet_vec3_in){pairs.d[0], pairs.d[1], pairs.d[2]},
               (facet_vec3_in){pairs.d[3], pairs.d[4], pairs.d[5]}, PAIRS, &o);
}

/* As renderers ask: floats of the tiers in floats. */
static double nanoseconds(const facet_brdf *brdf, facet_tier tier)
{
    static double out[PAIRS];
    double least = INFINITY;
    facet_outputs_float o = {{{NULL}}};
    o.of[FACET_FR][0] = (float *)out;
    for (int round = 0; round < ROUNDS; round++) {
        double start = now_ns();
        if (tier == FACET_PRECISE)
            evaluate(brdf, tier, out);
        else
            facet_eval_float(brdf, tier, (facet_vec3_in_float){pairs.f[0], pairs.f[1], pairs.f[2]},
                             (facet_vec3_in_float){pairs.f[3], pairs.f[4], pairs.f[5]}, PAIRS, &o);
        least = fmin(least, (now_ns() - start) / PAIRS);
    }
    return least;
}

static void bench(const facet_slope_table *table, int source, bool leans, const char *isa)
{
    static double exact[PAIRS], y[PAIRS];
    facet_material m = {.ndf = FACET_TABULATED,
                        .table = table,
                        .roughness = {.alpha_x = 0.3, .alpha_y = 0.3},
                        .fresnel = {.kind = FACET_FRESNEL_SCHLICK, .channels = 1, .f0 = {0.04}}};
    if (leans)
        m.roughness = (facet_roughness){
            .alpha_x = 0.3, .alpha_y = 0.4, .rho = 0.3, .slope_x = 0.1, .slope_y = -0.2};
    facet_brdf *brdf = NULL;
    if (facet_brdf_create(&m, &brdf)) return;
    evaluate(brdf, FACET_PRECISE, exact);
    for (int t = FACET_FAST; t < FACET_TIER_COUNT; t++) {
        double worst = 0, bound = INFINITY;
        evaluate(brdf, (facet_tier)t, y);
        for (size_t k = 0; k < PAIRS; k++)
            worst = fmax(worst, fabs(y[k] - exact[k]) / fmax(exact[k], FACET_FLOOR));
        facet_bound(brdf, (facet_tier)t, FACET_FR, 0, &bound);
        printf("%-8s %-8s %-7s %-7s %6.2f ns  error %.1e  promised %.1e\n", isa, sources[source],
               leans ? "leaning" : "even", facet_tier_name((facet_tier)t),
               nanoseconds(brdf, (facet_tier)t), worst, bound);
    }
    facet_brdf_destroy(brdf);
}

int main(void)
{
    const char *isa, *only = getenv("BENCH_ISA");
    draw_pairs();
    for (int source = 0; source < SOURCES; source++) {
        double start = now_ns(), made;
        facet_slope_table *table = table_of(source);
        if (!table) return 1;
        made = now_ns();
        if (!facet_slope_table_has_floats(table)) return 1;
        printf("%s: made in %.2f ms, its floats in %.3f ms\n", sources[source],
               (made - start) / 1e6, (now_ns() - made) / 1e6);
        for (size_t i = 0; (isa = facet_isa_list(i)); i++) {
            if ((only && strcmp(only, isa)) || facet_isa_select(isa)) continue;
            bench(table, source, false, isa);
            if (source != AZIMUTH) bench(table, source, true, isa);
        }
        facet_slope_table_destroy(table);
    }
    return 0;
}
