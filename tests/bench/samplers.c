/*
 * bench_samplers - nanoseconds of a sample with reflection and weight: float, best instruction set,
 * against the same method as the papers have it, one scalar double at a time (make bench-samplers).
 *
 * Both in the same run, turn by turn, the best of many: what remains is their ratio.
 */
#include "facet.h"

#include "../report/samplers.h"
#include "rng.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { N = 4096, ROUNDS = 60 };

static const struct row {
    facet_sampler sampler;
    facet_ndf ndf;
    sampler *scalar;
    double asked; /* 0: nothing */
} rows[] = {
    {FACET_SAMPLER_CAPS, FACET_GGX, sample_caps, 9},
    {FACET_SAMPLER_BOUNDED, FACET_GGX, sample_bounded, 8},
    {FACET_SAMPLER_NDF, FACET_GGX, sample_ndf, 9},
    {FACET_SAMPLER_NDF, FACET_BECKMANN, sample_ndf, 0},
    {FACET_SAMPLER_SLOPE, FACET_BECKMANN, sample_slope_beckmann, 15},
    {FACET_SAMPLER_SLOPE, FACET_GGX, sample_slope_ggx, 0},
    {FACET_SAMPLER_VCAVITY, FACET_GGX, sample_vcavity, 0},
    {FACET_SAMPLER_VCAVITY, FACET_BECKMANN, sample_vcavity, 0},
};
enum { ROWS = sizeof rows / sizeof *rows };
static const double asked_pdf = 1.4;

static double wo[N][3], u[2][N];
static float wo_float[3][N], u_float[2][N], wi[3][N], weight[N], pdf[N];
static volatile double sink;

static void draw(void)
{
    struct rng rng;
    rng_seed(&rng, 1);
    for (int k = 0; k < N; k++) {
        double z = rng_uniform(&rng), phi = 6.283185307179586 * rng_uniform(&rng),
               s = sqrt((1 - z) * (1 + z));
        wo[k][0] = s * cos(phi), wo[k][1] = s * sin(phi), wo[k][2] = z;
        for (int j = 0; j < 3; j++) wo_float[j][k] = (float)wo[k][j];
        for (int j = 0; j < 2; j++)
            u_float[j][k] = fminf((float)(u[j][k] = rng_uniform(&rng)), 0x1.fffffep-1f);
    }
}

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static double time_scalar(const struct row *row, const struct surface *s)
{
    double start = now_ns(), sum = 0;
    for (int k = 0; k < N; k++) {
        struct sample sample;
        row->scalar(s, wo[k], u[0][k], u[1][k], &sample);
        sum += sample.weight + sample.wi[2];
    }
    sink += sum;
    return (now_ns() - start) / N;
}

static double time_lib(const struct row *row, const facet_brdf *brdf, bool with_pdf)
{
    facet_samples_float out = {
        .wi = {wi[0], wi[1], wi[2]}, .weight = {weight, NULL, NULL}, .pdf = with_pdf ? pdf : NULL};
    double start = now_ns();
    facet_status status = facet_sample_float(
        brdf, FACET_FAST, row->sampler,
        (facet_vec3_in_float){wo_float[0], wo_float[1], wo_float[2]}, u_float[0], u_float[1], N,
        &out);
    double took = (now_ns() - start) / N;
    sink += weight[0];
    return status == FACET_OK ? took : NAN;
}

/* Is what was asked there? */
static bool measure(const struct row *row)
{
    bool vcavity = row->sampler == FACET_SAMPLER_VCAVITY;
    facet_material m = {
        .ndf = row->ndf, .roughness = {.alpha_x = 0.3, .alpha_y = 0.5}, .fresnel = {.channels = 1}};
    struct surface s = {.alpha_x = 0.3, .alpha_y = 0.5};
    m.masking = vcavity ? FACET_VGROOVE : FACET_SMITH;
    s.ndf = row->ndf == FACET_GGX ? GGX : BECKMANN;
    s.masking = vcavity ? V_CAVITY : SMITH;
    facet_brdf *brdf = NULL;
    if (facet_brdf_create(&m, &brdf)) return false;
    double scalar = INFINITY, plain = INFINITY, full = INFINITY;
    for (int round = 0; round < ROUNDS; round++) {
        scalar = fmin(scalar, time_scalar(row, &s));
        for (int k = 0; k < 8; k++) {
            plain = fmin(plain, time_lib(row, brdf, false));
            full = fmin(full, time_lib(row, brdf, true));
        }
    }
    facet_brdf_destroy(brdf);
    char asked[16] = "";
    if (row->asked > 0) snprintf(asked, sizeof asked, ">= %g", row->asked);
    printf("%-8s %-9s %12.1f %12.2f %8.1f  %-6s %12.2f %8.2f  <= %g\n",
           facet_sampler_name(row->sampler), row->ndf == FACET_GGX ? "ggx" : "beckmann", scalar,
           plain, scalar / plain, asked, full, full / plain, asked_pdf);
    return scalar / plain >= row->asked && full / plain <= asked_pdf;
}

int main(void)
{
    bool all = true;
    draw();
    printf(
        "%s, float, %d samples a call; alpha 0.3 x 0.5, all directions; vcavity with vgroove masking\n",
        facet_isa(), N);
    printf("%-8s %-9s %12s %12s %8s  %-6s %12s %8s  asked\n", "sampler", "ndf", "scalar ns", "ns",
           "ratio", "asked", "with pdf", "/ ns");
    for (int k = 0; k < ROWS; k++) all &= measure(&rows[k]);
    puts(all ? "all that was asked is there" : "NOT all that was asked is there");
    return 0;
}
