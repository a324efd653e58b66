/*
 * The sampler's histogram against its own pdf, by chi^2: cells in the square of normals.h, expected
 * counts from quadrature of facet_eval's pdf, counts from facet_sample's wi.  Fixed seeds; the
 * smallest of all p-values must pass p n > 0.01 (Bonferroni).
 */
#include "check.h"
#include "draw.h"
#include "normals.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 12, CELLS = SIDE * SIDE, BATCH = 1000 };

static const facet_roughness roughness[] = {
    {0.3, 0.3, 0, 0, 0},   {1e-3, 1e-3, 0, 0, 0},    {4, 4, 0, 0, 0},
    {0.05, 0.8, 0, 0, 0},  {0.4, 0.7, -0.95, 0, 0},  {0.3, 0.3, 0, 0.5, -1},
    {0.5, 0.2, 0.6, 2, 1}, {0.02, 0.3, 0.3, 0.1, 5},
};
static const double degrees[] = {0, 20, 60, 85, 89.9};
enum { SURFACES = sizeof roughness / sizeof *roughness, VIEWS = sizeof degrees / sizeof *degrees };
enum { TESTS = 2 * SURFACES * VIEWS };

/* Upper tail of the incomplete gamma function, Q(a, x): series below a + 1, else Lentz's fraction.
 */
static double gamma_tail(double a, double x)
{
    double front = exp(-x + a * log(x) - lgamma(a));
    if (x <= 0) return 1;
    if (x < a + 1) {
        double term = 1 / a, sum = term;
        for (int n = 1; n < 2000 && term > sum * 1e-16; n++) sum += term *= x / (a + n);
        return 1 - front * sum;
    }
    double b = x + 1 - a, c = 1e300, d = 1 / b, h = d;
    for (int n = 1; n < 2000; n++) {
        double an = -n * (n - a);
        b += 2;
        d = 1 / (an * d + b);
        c = b + an / c;
        h *= c * d;
        if (fabs(c * d - 1) < 1e-15) break;
    }
    return front * h;
}

/* Share of each cell by quadrature of the pdf that facet_eval gives. */
static bool expected_shares(const facet_brdf *brdf, facet_tier tier, const facet_material *m,
                            const double wo[3], double share[CELLS])
{
    double total = 0;
    memset(share, 0, CELLS * sizeof *share);
    struct normals_rule rule; /* one panel per cell */
    if (!normals_rule_create(m, wo, SIDE, &rule)) return false;
    double *pdf = malloc(rule.n * sizeof *pdf);
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    outputs.of[FACET_PDF][0] = pdf;
    bool ok = pdf && facet_eval(brdf, tier, (facet_vec3_in){rule.i[0], rule.i[1], rule.i[2]},
                                (facet_vec3_in){rule.o[0], rule.o[1], rule.o[2]}, rule.n,
                                &outputs) == FACET_OK;
    for (size_t k = 0; ok && k < rule.n; k++) {
        size_t row = k / (SIDE * GAUSS_NODES) / GAUSS_NODES;
        size_t column = k % (SIDE * GAUSS_NODES) / GAUSS_NODES;
        double part = pdf[k] * 4 * rule.cosine[k] * rule.weight[k];
        share[row * SIDE + column] += part;
        total += part;
    }
    if (ok && !(fabs(total - 1) < 1e-3))
        check_fail(__FILE__, __LINE__, "the pdf integrates to %.9g: %s", total, draw_text(m));
    free(pdf);
    normals_rule_destroy(&rule);
    return ok;
}

/* Counts per cell; the last entry counts what fell outside. */
static void count(const facet_brdf *brdf, facet_tier tier, const facet_material *m,
                  const double wo[3], size_t batches, struct rng *rng, double counts[CELLS + 1])
{
    static double o[3][BATCH], u1[BATCH], u2[BATCH], wi[3][BATCH];
    struct normals_map map = normals_map(m, wo);
    memset(counts, 0, (CELLS + 1) * sizeof *counts);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < BATCH; k++) o[j][k] = wo[j];
    while (batches--) {
        for (int k = 0; k < BATCH; k++) {
            u1[k] = rng_uniform(rng);
            u2[k] = rng_uniform(rng);
        }
        facet_samples s = {.wi = {wi[0], wi[1], wi[2]}};
        CHECK_INT(facet_sample(brdf, tier, (facet_vec3_in){o[0], o[1], o[2]}, u1, u2, BATCH, &s),
                  FACET_OK);
        for (int k = 0; k < BATCH; k++) {
            double p, q, H[3] = {wi[0][k] + wo[0], wi[1][k] + wo[1], wi[2][k] + wo[2]};
            bool inside = normals_where(&map, H, &p, &q);
            size_t cell = inside ? (size_t)(p * SIDE) * SIDE + (size_t)(q * SIDE) : CELLS;
            counts[cell < CELLS ? cell : CELLS]++;
        }
    }
}

/* Cells that expect fewer than ten are joined, with all that fell outside. */
static double p_value(const double share[CELLS], const double counts[CELLS + 1], double n)
{
    double sum = 0, few = 0, few_counts = counts[CELLS];
    int cells = 0;
    for (int k = 0; k < CELLS; k++) {
        double wanted = share[k] * n;
        if (wanted < 10) {
            few += wanted;
            few_counts += counts[k];
            continue;
        }
        sum += (counts[k] - wanted) * (counts[k] - wanted) / wanted;
        cells++;
    }
    if (few >= 5) {
        sum += (few_counts - few) * (few_counts - few) / few;
        cells++;
    } else if (few_counts > few + 20) {
        return 0;
    }
    return cells > 1 ? gamma_tail(0.5 * (cells - 1), 0.5 * sum) : 1;
}

static void view(double theta_degrees, double phi, double wo[3])
{
    double theta = theta_degrees * acos(-1) / 180;
    wo[0] = sin(theta) * cos(phi);
    wo[1] = sin(theta) * sin(phi);
    wo[2] = cos(theta);
}

static void chi_squared(facet_tier tier, size_t batches)
{
    struct rng rng;
    rng_seed(&rng, 31);
    double worst = 1;
    static double share[CELLS], counts[CELLS + 1];
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++)
        for (int s = 0; s < SURFACES; s++)
            for (int v = 0; v < VIEWS; v++) {
                facet_material m = {.ndf = (facet_ndf)ndf, .roughness = roughness[s]};
                m.fresnel.channels = 1;
                double wo[3];
                view(degrees[v], 0.7 + s, wo);
                facet_brdf *brdf = NULL;
                CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
                if (brdf && expected_shares(brdf, tier, &m, wo, share)) {
                    count(brdf, tier, &m, wo, batches, &rng, counts);
                    double p = p_value(share, counts, (double)batches * BATCH);
                    worst = fmin(worst, p);
                    if (!(p * TESTS > 0.01))
                        check_fail(__FILE__, __LINE__,
                                   "p = %.3g, %g outside: ndf %d surface %d "
                                   "theta %g",
                                   p, counts[CELLS], ndf, s, degrees[v]);
                }
                facet_brdf_destroy(brdf);
            }
    check_note("smallest p times tests", worst * TESTS);
}

TEST(precise_samples_follow_the_pdf)
{
    chi_squared(FACET_PRECISE, draw_count(50));
}

TEST(fast_samples_follow_the_pdf)
{
    chi_squared(FACET_FAST, draw_count(20));
}

/* chi^2 itself: known quantiles, 3.841 (1 degree) and 18.307 (10 degrees) at 5 %. */
TEST(the_test_of_the_test)
{
    CHECK_REL(gamma_tail(0.5, 3.841458820694124 / 2), 0.05, 1e-12, 0);
    CHECK_REL(gamma_tail(5, 18.307038053275146 / 2), 0.05, 1e-12, 0);
    static double share[CELLS], counts[CELLS + 1];
    for (int k = 0; k < CELLS; k++) {
        share[k] = 1.0 / CELLS;
        counts[k] = 100 + (k & 1 ? 10 : -10); /* each cell off by one standard deviation */
    }
    counts[CELLS] = 0;
    CHECK(p_value(share, counts, 100 * CELLS) > 0.3);
    for (int k = 0; k < CELLS; k++) counts[k] = 100 + (k & 1 ? 20 : -20);
    CHECK(p_value(share, counts, 100 * CELLS) < 1e-20);
}
