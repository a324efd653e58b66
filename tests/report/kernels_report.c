/*
 * kernels_report.c - the service's own kernels in the report: which sampler is worth more, what `auto` goes
 * by, what a density costs beside fr.
 */
#include "kernels_report.h"

#include "facet.h"
#include "rng.h"

#include <math.h>
#include <stdbool.h>
#include <time.h>

#define PI 3.14159265358979323846

const double report_theta[REPORT_THETAS] = {0, 60, 85.94, 89};

double report_now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static const struct lib_row {
    const char *name;
    facet_ndf ndf;
    facet_masking masking;
    facet_sampler plain, other;
} lib_rows[] = {
    {"GGX, Smith", FACET_GGX, FACET_SMITH, FACET_SAMPLER_CAPS, FACET_SAMPLER_BOUNDED},
    {"GGX, V-cavity", FACET_GGX, FACET_VGROOVE, FACET_SAMPLER_CAPS, FACET_SAMPLER_VCAVITY},
    {"Beckmann, V-cavity", FACET_BECKMANN, FACET_VGROOVE, FACET_SAMPLER_SLOPE,
     FACET_SAMPLER_VCAVITY},
};

/* Relative variance of the weights of the library's sampler, and its nanoseconds on floats. */
static double library_variance(const facet_material *m, facet_sampler method, const double o[3],
                               double *ns)
{
    enum { N = 4096, ROUNDS = 24 };
    static float wo[3][N], u[2][N], wi[3][N], weight[N];
    facet_brdf *brdf = NULL;
    struct rng rng;
    rng_seed(&rng, 11);
    double sum = 0, squares = 0;
    *ns = INFINITY;
    if (facet_brdf_create(m, &brdf)) return NAN;
    for (int k = 0; k < N; k++)
        for (int j = 0; j < 3; j++) wo[j][k] = (float)o[j];
    for (int round = 0; round < ROUNDS; round++) {
        for (int k = 0; k < N; k++) {
            u[0][k] = fminf((float)rng_uniform(&rng), 0x1.fffffep-1f);
            u[1][k] = fminf((float)rng_uniform(&rng), 0x1.fffffep-1f);
        }
        facet_samples_float out = {.wi = {wi[0], wi[1], wi[2]}, .weight = {weight, NULL, NULL}};
        double start = report_now_ns();
        facet_sample_float(brdf, FACET_FAST, method, (facet_vec3_in_float){wo[0], wo[1], wo[2]},
                           u[0], u[1], N, &out);
        *ns = fmin(*ns, (report_now_ns() - start) / N);
        for (int k = 0; k < N; k++) sum += weight[k], squares += (double)weight[k] * weight[k];
    }
    facet_brdf_destroy(brdf);
    return squares * N * ROUNDS / (sum * sum) - 1;
}

static void write_library(FILE *md)
{
    static const double some[] = {0.01, 0.1, 0.4, 1, 2};
    int rows = 0, better = 0, above = 0;
    fprintf(
        md,
        "\n## Which sampler: the service's own kernels\n\nFloat, %s, sample and weight. Efficiency is 1/(variance x time) of the "
        "second method over that of the first, plain visible normals.\n\n"
        "| model | alpha | theta | methods | variance | | ns | | efficiency |\n|---|---|---|---|---|---|---|---|---|\n",
        facet_isa());
    for (size_t k = 0; k < sizeof lib_rows / sizeof *lib_rows; k++)
        for (int a = 0; a < 5; a++)
            for (int t = 0; t < 4; t++) {
                const struct lib_row *r = &lib_rows[k];
                facet_material m = {.ndf = r->ndf,
                                    .masking = r->masking,
                                    .fresnel = {.channels = 1},
                                    .roughness = {.alpha_x = some[a], .alpha_y = some[a]}};
                double o[3], ns[2], variance[2];
                double theta = report_theta[t] * PI / 180;
                o[0] = sin(theta), o[1] = 0, o[2] = cos(theta);
                variance[0] = library_variance(&m, r->plain, o, &ns[0]);
                variance[1] = library_variance(&m, r->other, o, &ns[1]);
                if (variance[1] < 1e-9) continue; /* the rounding of floats */
                double gain = variance[0] * ns[0] / (variance[1] * ns[1]);
                rows++, better += gain > 1, above += k == 0 && variance[1] > variance[0];
                fprintf(md, "| %s | %g | %g | %s, %s | %.3g | %.3g | %.2f | %.2f | %.3g |\n",
                        r->name, some[a], report_theta[t], facet_sampler_name(r->plain),
                        facet_sampler_name(r->other), variance[0], variance[1], ns[0], ns[1], gain);
            }
    fprintf(
        md,
        "\nThe second is worth more in %d rows of %d; bounded has a variance above that of caps in %d.\n",
        better, rows, above);
}

/* What `auto` goes by: variance times time summed over wo, cosines and azimuths uniform. */
static double cost_over_views(const facet_material *m, facet_sampler method)
{
    enum { COSINES = 8, AZIMUTHS = 3 };
    double variance = 0, time = 0;
    for (int k = 0; k < COSINES * AZIMUTHS; k++) {
        double z = (k % COSINES + 0.5) / COSINES, s = sqrt((1 - z) * (1 + z)), ns;
        double phi = PI / 4 * (k / COSINES), o[3] = {s * cos(phi), s * sin(phi), z};
        variance += library_variance(m, method, o, &ns);
        time += ns;
    }
    return variance * time;
}

static void write_choice(FILE *md)
{
    static const double radii[][2] = {{0.03, 0.03}, {0.1, 0.1}, {0.2, 0.1}, {0.4, 0.1}, {1, 0.1},
                                      {0.3, 0.3},   {1, 0.3},   {1, 1},     {2, 2}};
    fprintf(
        md,
        "\n### What `auto` goes by\n\nVariance times time summed over wo, of plain visible normals "
        "(`caps`, `slope`) over that of the other. `auto` takes `bounded` for GGX of minor radius 0.1 or "
        "more, where only long ellipses lose and they little, and `vcavity` for Beckmann with V-cavities.\n\n"
        "| alpha_1 | alpha_2 | GGX, Smith: bounded | GGX, V-cavity: bounded | vcavity | "
        "Beckmann, V-cavity: vcavity |\n|---|---|---|---|---|---|\n");
    for (size_t k = 0; k < sizeof radii / sizeof *radii; k++) {
        facet_material m = {.fresnel = {.channels = 1},
                            .roughness = {.alpha_x = radii[k][0], .alpha_y = radii[k][1]}};
        fprintf(md, "| %g | %g | %.2f |", radii[k][0], radii[k][1],
                cost_over_views(&m, FACET_SAMPLER_CAPS) /
                    cost_over_views(&m, FACET_SAMPLER_BOUNDED));
        m.masking = FACET_VGROOVE;
        double caps = cost_over_views(&m, FACET_SAMPLER_CAPS);
        fprintf(md, " %.2f | %.2f |", caps / cost_over_views(&m, FACET_SAMPLER_BOUNDED),
                caps / cost_over_views(&m, FACET_SAMPLER_VCAVITY));
        m.ndf = FACET_BECKMANN;
        fprintf(md, " %.2f |\n",
                cost_over_views(&m, FACET_SAMPLER_SLOPE) /
                    cost_over_views(&m, FACET_SAMPLER_VCAVITY));
    }
}

/* Nanoseconds of fr and the sampler's pdf of a pair, floats, over the whole hemisphere. */
static double time_of_pdf(const facet_brdf *brdf, facet_tier tier, facet_sampler method)
{
    enum { N = 4096, ROUNDS = 400 };
    static float d[6][N], fr[N], pdf[N];
    const facet_outputs_float out = {.of = {[FACET_FR] = {fr}, [FACET_PDF] = {pdf}}};
    const facet_vec3_in_float wi = {d[0], d[1], d[2]}, wo = {d[3], d[4], d[5]};
    struct rng rng;
    rng_seed(&rng, 13);
    double best = INFINITY;
    for (int k = 0; k < 2 * N; k++) {
        double z = rng_uniform(&rng), phi = 2 * PI * rng_uniform(&rng), s = sqrt((1 - z) * (1 + z));
        float(*v)[N] = d + (k < N ? 0 : 3);
        v[0][k % N] = (float)(s * cos(phi)), v[1][k % N] = (float)(s * sin(phi)),
                 v[2][k % N] = (float)z;
    }
    for (int round = 0; round < ROUNDS; round++) {
        double start = report_now_ns();
        facet_eval_sampled_float(brdf, tier, method, wi, wo, N, &out);
        best = fmin(best, (report_now_ns() - start) / N);
    }
    return best;
}

/* What whoever mixes samples of f with samples of lights pays for the better sampler. */
static void write_price(FILE *md)
{
    fprintf(
        md,
        "\n### What the density of the better sampler costs\n\nGGX, Smith, alpha 0.3: fr and pdf of a pair, ns; in brackets the bound "
        "of the pdf. Either "
        "shares a loop with fr, and in fast it meets the default tolerance of 1e-6.\n\n| tier | caps | bounded (`auto`) | |\n|---|---|---|---|\n");
    facet_material m = {.ndf = FACET_GGX,
                        .fresnel = {.channels = 1},
                        .roughness = {.alpha_x = 0.3, .alpha_y = 0.3}};
    facet_brdf *brdf = NULL;
    if (facet_brdf_create(&m, &brdf)) return;
    for (int t = FACET_DRAFT; t <= FACET_EXACT32; t++) {
        double ns[2], bound[2];
        for (int k = 0; k < 2; k++) {
            facet_sampler method = k ? FACET_SAMPLER_BOUNDED : FACET_SAMPLER_CAPS;
            ns[k] = time_of_pdf(brdf, (facet_tier)t, method);
            facet_pdf_bound_float(brdf, (facet_tier)t, method, 0, &bound[k]);
        }
        fprintf(md, "| %s | %.2f (%.2g) | %.2f (%.2g) | %.1f× |\n", facet_tier_name((facet_tier)t),
                ns[0], bound[0], ns[1], bound[1], ns[1] / ns[0]);
    }
    facet_brdf_destroy(brdf);
}

void report_kernels(FILE *md)
{
    write_library(md);
    write_choice(md);
    write_price(md);
}
