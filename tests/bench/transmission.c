/*
 * bench_transmission - nanoseconds per direction of rough glass in every tier, beside the same surface's
 * reflection alone and Walter's formulas as printed, one scalar double at a time (make bench-transmission).
 *
 * All in the same run, turn by turn, the best of many.  wi and wo anywhere on the sphere: of glass half of
 * the pairs are transmission, half of either are from below.
 */
#include "facet_transmission.h"
#include "rng.h"
#include "textbook.h"

#include <math.h>
#include <stdio.h>
#include <time.h>

enum { N = 2048, ROUNDS = 40 };

static const double pi = 3.14159265358979323846;
static double glass[6][N], upper[6][N], u[3][N], out[2][N], sampled[5][N];
static volatile double sink;

static void draw(void)
{
    struct rng rng;
    rng_seed(&rng, 1);
    for (int k = 0; k < N; k++) {
        for (int d = 0; d < 6; d += 3) {
            double z = 2 * rng_uniform(&rng) - 1, phi = 2 * pi * rng_uniform(&rng),
                   s = sqrt((1 - z) * (1 + z));
            const double v[3] = {s * cos(phi), s * sin(phi), z};
            for (int j = 0; j < 3; j++)
                glass[d + j][k] = v[j], upper[d + j][k] = j == 2 ? fabs(z) : v[j];
        }
        for (int j = 0; j < 3; j++) u[j][k] = rng_uniform(&rng);
    }
}

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

/* ---- As printed ---------------------------------------------------------------------------------- */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double fresnel(double c, double eta)
{
    double g2 = eta * eta - 1 + c * c, g = sqrt(fmax(g2, 0));
    if (g2 <= 0) return 1;
    double s = (g - c) / (g + c), p = (c * (g + c) - 1) / (c * (g - c) + 1);
    return 0.5 * s * s * (1 + p * p);
}

/* fr and pdf (Walter 2007, eqs. 20, 21, 38, 41; masking height-correlated, Heitz et al. 2016). */
static double scalar_pair(const facet_material *m, const double wi_[3], const double wo_[3],
                          double *pdf)
{
    double turn = wo_[2] < 0 ? -1 : 1, n = turn < 0 ? 1 / m->fresnel.eta[0] : m->fresnel.eta[0],
           wi[3], wo[3], up[3], h[3], t[3];
    for (int j = 0; j < 3; j++) wi[j] = turn * wi_[j], wo[j] = turn * wo_[j];
    for (int j = 0; j < 3; j++)
        up[j] = turn * wi_[2] < 0 ? -wi[j] : wi[j], h[j] = wi[j] + wo[j],
        t[j] = -(wo[j] + n * wi[j]);
    double so = textbook_area(m->ndf, textbook_stretch(&m->roughness, wo)),
           si = textbook_area(m->ndf, textbook_stretch(&m->roughness, up));
    double c = sqrt(dot(h, h)) / 2, F = fresnel(c, n),
           D = h[2] > 0 ? textbook_density(m->ndf, &m->roughness, h) : 0, fr = 0;
    *pdf = F * D / (4 * so);
    if (wi[2] > 0) fr = F * D / (4 * (so * wi[2] + wo[2] * (si - wi[2])));
    double size = sqrt(dot(t, t)) * (t[2] < 0 ? -1 : 1), co = dot(wo, t) / size,
           ci = dot(wi, t) / size;
    if (!(co > 0 && ci < 0)) return fr;
    double jacobian = n * n * -ci / ((co + n * ci) * (co + n * ci));
    double through = (1 - fresnel(co, n)) * co * textbook_density(m->ndf, &m->roughness, t) / so *
                     jacobian;
    *pdf += through;
    if (wi[2] >= 0) return fr;
    double a = so / wo[2], b = si / -wi[2] - 1;
    return through * exp(lgamma(1 + a) + lgamma(1 + b) - lgamma(1 + a + b)) / -wi[2];
}

static double time_scalar(const facet_material *m)
{
    double start = now_ns(), sum = 0;
    for (int k = 0; k < N; k++) {
        const double wi[3] = {glass[0][k], glass[1][k], glass[2][k]},
                     wo[3] = {glass[3][k], glass[4][k], glass[5][k]};
        double pdf, fr = scalar_pair(m, wi, wo, &pdf);
        sum += fr + pdf;
    }
    sink += sum;
    return (now_ns() - start) / N;
}

/* ---- The service's ------------------------------------------------------------------------------- */

enum { FR, PDF, BOTH, SAMPLE, KINDS };
static const char *const kinds[KINDS] = {"fr", "pdf", "fr and pdf", "sample, weight, pdf"};

/* Of glass where there is one, else of reflection. */
static double time_lib(const facet_bsdf *bsdf, const facet_brdf *brdf, facet_tier tier, int kind)
{
    double(*v)[N] = bsdf ? glass : upper;
    const facet_vec3_in wi = {v[0], v[1], v[2]}, wo = {v[3], v[4], v[5]};
    facet_outputs outputs = {0};
    const facet_samples samples = {
        .wi = {sampled[0], sampled[1], sampled[2]}, .weight = {sampled[3]}, .pdf = sampled[4]};
    if (kind != PDF) outputs.of[FACET_FR][0] = out[0];
    if (kind != FR) outputs.of[FACET_PDF][0] = out[1];
    double start = now_ns();
    if (kind != SAMPLE && bsdf)
        facet_bsdf_eval(bsdf, tier, wi, wo, N, &outputs);
    else if (kind != SAMPLE)
        facet_eval(brdf, tier, wi, wo, N, &outputs);
    else if (bsdf)
        facet_bsdf_sample(bsdf, tier, FACET_SAMPLER_AUTO, wo, u[0], u[1], u[2], N, &samples);
    else
        facet_sample(brdf, tier, FACET_SAMPLER_AUTO, wo, u[0], u[1], N, &samples);
    double took = (now_ns() - start) / N;
    sink += out[0][0] + out[1][0] + sampled[3][0];
    return took;
}

/* Largest relative deviation of the scalar form from precise: that both are the same model, and what it loses. */
static double deviation(const facet_material *m, const facet_bsdf *bsdf)
{
    double worst = 0;
    time_lib(bsdf, NULL, FACET_PRECISE, BOTH);
    for (int k = 0; k < N; k++) {
        const double wi[3] = {glass[0][k], glass[1][k], glass[2][k]},
                     wo[3] = {glass[3][k], glass[4][k], glass[5][k]};
        double pdf, fr = scalar_pair(m, wi, wo, &pdf);
        worst = fmax(worst, fmax(fabs(fr - out[0][k]) / fmax(out[0][k], 1e-30),
                                 fabs(pdf - out[1][k]) / fmax(out[1][k], 1e-30)));
    }
    return worst;
}

static void measure(facet_ndf ndf)
{
    facet_material m = {.ndf = ndf,
                        .roughness = {.alpha_x = 0.3, .alpha_y = 0.3},
                        .fresnel = {.kind = FACET_FRESNEL_DIELECTRIC, .channels = 1}};
    double best[2][FACET_TIER_COUNT][KINDS], scalar = INFINITY, bound;
    facet_bsdf *bsdf = NULL;
    facet_brdf *brdf = NULL;
    m.fresnel.eta[0] = 1.5;
    if (facet_bsdf_create(&m, FACET_IMPORTANCE, &bsdf) == FACET_OK &&
        facet_brdf_create(&m, &brdf) == FACET_OK) {
        for (int round = 0; round < ROUNDS; round++) {
            scalar = fmin(scalar, time_scalar(&m));
            for (int t = 0; t < FACET_TIER_COUNT; t++)
                for (int kind = 0; kind < KINDS; kind++)
                    for (int g = 0; g < 2; g++) {
                        double took = time_lib(g ? bsdf : NULL, brdf, (facet_tier)t, kind);
                        best[g][t][kind] = round ? fmin(best[g][t][kind], took) : took;
                    }
        }
        printf("\n%s: scalar double, fr and pdf: %.0f ns, within %.1e\n",
               ndf == FACET_GGX ? "ggx" : "beckmann", scalar, deviation(&m, bsdf));
        printf("%-8s %9s", "tier", "bound");
        for (int kind = 0; kind < KINDS; kind++) printf(" %20s", kinds[kind]);
        puts("   ratio to scalar");
        for (int t = 0; t < FACET_TIER_COUNT; t++) {
            facet_bsdf_bound(bsdf, (facet_tier)t, FACET_FR, 0, &bound);
            printf("%-8s %9.1e", facet_tier_name((facet_tier)t), bound);
            for (int kind = 0; kind < KINDS; kind++)
                printf(" %11.1f (%6.1f)", best[1][t][kind], best[0][t][kind]);
            printf(" %8.0f\n", scalar / best[1][t][BOTH]);
        }
    }
    facet_bsdf_destroy(bsdf);
    facet_brdf_destroy(brdf);
}

int main(void)
{
    draw();
    printf(
        "%s, %d pairs a call in doubles; alpha 0.3, eta 1.5, smith; ns a direction (of reflection alone)\n",
        facet_isa(), N);
    measure(FACET_GGX);
    measure(FACET_BECKMANN);
    return 0;
}
