/*
 * The sampler's histogram against its own pdf, by chi^2: cells in the square of normals.h, expected
 * counts from quadrature of facet_pdf, counts from facet_sample's wi.  Fixed seeds; the
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

/*
 * The square that a sampler's directions fill: that of the normals seen from wo; of all normals
 * (NDF, whose H may point down); of cosine^2 and azimuth of wi (COSINE).
 */
struct square {
    facet_sampler sampler;
    struct normals_map map;
    double wo[3];
};

static struct square square_of(facet_sampler sampler, const facet_material *m, const double wo[3])
{
    struct square s = {sampler, normals_map(m, sampler == FACET_SAMPLER_NDF ? NULL : wo), {0}};
    memcpy(s.wo, wo, sizeof s.wo);
    return s;
}

static bool where(const struct square *s, const double wi[3], double *p, double *q)
{
    if (s->sampler == FACET_SAMPLER_COSINE) {
        double turn = atan2(wi[1], wi[0]) / (2 * acos(-1));
        *p = wi[0] * wi[0] + wi[1] * wi[1];
        *q = turn < 0 ? turn + 1 : turn;
        return wi[2] > 0 && *p < 1 && *q < 1;
    }
    double H[3] = {wi[0] + s->wo[0], wi[1] + s->wo[1], wi[2] + s->wo[2]};
    for (int j = 0; s->sampler == FACET_SAMPLER_NDF && H[2] < 0 && j < 3; j++) H[j] = -H[j];
    return normals_where(&s->map, H, p, q);
}

/* The mirror images of wo in all normals, seen or not. */
static void mirror_all(const double wo[3], struct normals_rule *rule)
{
    for (size_t k = 0; k < rule->n; k++) {
        double dot = wo[0] * rule->h[0][k] + wo[1] * rule->h[1][k] + wo[2] * rule->h[2][k];
        for (int j = 0; j < 3; j++) {
            rule->i[j][k] = 2 * dot * rule->h[j][k] - wo[j];
            rule->o[j][k] = wo[j];
        }
        rule->cosine[k] = fabs(dot);
    }
}

/* wi over the square of sine^2 and azimuth: d omega = pi dp dq / cosine. */
static void fill_hemisphere(struct normals_rule *rule)
{
    double x[GAUSS_NODES], w[GAUSS_NODES];
    normals_gauss(x, w);
    size_t side = SIDE * GAUSS_NODES;
    for (size_t k = 0; k < rule->n; k++) {
        size_t i = k / side, j = k % side;
        double p = ((double)(i / GAUSS_NODES) + x[i % GAUSS_NODES]) / SIDE;
        double turn = 2 * acos(-1) * ((double)(j / GAUSS_NODES) + x[j % GAUSS_NODES]) / SIDE;
        rule->i[0][k] = sqrt(p) * cos(turn);
        rule->i[1][k] = sqrt(p) * sin(turn);
        rule->i[2][k] = sqrt(1 - p);
        rule->weight[k] = w[i % GAUSS_NODES] * w[j % GAUSS_NODES] / (SIDE * SIDE);
        rule->cosine[k] = acos(-1) / rule->i[2][k] / 4;
    }
}

static bool rule_of(const facet_material *m, facet_sampler sampler, const double wo[3],
                    struct normals_rule *rule)
{
    if (!normals_rule_create(m, sampler == FACET_SAMPLER_NDF ? NULL : wo, SIDE, rule)) return false;
    if (sampler == FACET_SAMPLER_NDF) mirror_all(wo, rule);
    if (sampler == FACET_SAMPLER_COSINE) fill_hemisphere(rule);
    return true;
}

/* Share of each cell by quadrature of the pdf that facet_pdf gives. */
static bool expected_shares(const facet_brdf *brdf, facet_tier tier, const facet_material *m,
                            facet_sampler sampler, const double wo[3], double share[CELLS])
{
    /* The edge of BOUNDED runs through cells, where Gauss's rule is off by 1/16 of a cell in each row. */
    double total = 0, slack = sampler == FACET_SAMPLER_BOUNDED ? 1e-2 : 1e-3;
    memset(share, 0, CELLS * sizeof *share);
    struct normals_rule rule; /* one panel per cell */
    if (!rule_of(m, sampler, wo, &rule)) return false;
    double *pdf = malloc(rule.n * sizeof *pdf);
    bool ok = pdf && facet_pdf(brdf, tier, sampler, (facet_vec3_in){rule.i[0], rule.i[1], rule.i[2]},
                               (facet_vec3_in){rule.o[0], rule.o[1], rule.o[2]}, rule.n,
                               pdf) == FACET_OK;
    for (size_t k = 0; ok && k < rule.n; k++) {
        size_t row = k / (SIDE * GAUSS_NODES) / GAUSS_NODES;
        size_t column = k % (SIDE * GAUSS_NODES) / GAUSS_NODES;
        double part = pdf[k] * 4 * rule.cosine[k] * rule.weight[k];
        share[row * SIDE + column] += part;
        total += part;
    }
    if (ok && !(fabs(total - 1) < slack))
        check_fail(__FILE__, __LINE__, "the pdf of %s integrates to %.9g: %s", facet_sampler_name(sampler),
                   total, draw_text(m));
    free(pdf);
    normals_rule_destroy(&rule);
    return ok;
}

/* Counts per cell; the last entry counts what fell outside. */
static void count(const facet_brdf *brdf, facet_tier tier, const struct square *square,
                  size_t batches, struct rng *rng, double counts[CELLS + 1])
{
    static double o[3][BATCH], u1[BATCH], u2[BATCH], wi[3][BATCH];
    memset(counts, 0, (CELLS + 1) * sizeof *counts);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < BATCH; k++) o[j][k] = square->wo[j];
    while (batches--) {
        for (int k = 0; k < BATCH; k++) {
            u1[k] = rng_uniform(rng);
            u2[k] = rng_uniform(rng);
        }
        facet_samples s = {.wi = {wi[0], wi[1], wi[2]}};
        CHECK_INT(facet_sample(brdf, tier, square->sampler, (facet_vec3_in){o[0], o[1], o[2]}, u1, u2,
                               BATCH, &s),
                  FACET_OK);
        for (int k = 0; k < BATCH; k++) {
            double p, q, one[3] = {wi[0][k], wi[1][k], wi[2][k]};
            size_t cell = where(square, one, &p, &q) ? (size_t)(p * SIDE) * SIDE + (size_t)(q * SIDE) : CELLS;
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

/* The p-value of one sampler, material and direction; 1 where there is no such sampler. */
static double p_of(facet_tier tier, facet_sampler sampler, const facet_material *m, const double wo[3],
                   size_t batches, struct rng *rng)
{
    static double share[CELLS], counts[CELLS + 1];
    facet_brdf *brdf = NULL;
    double p = 1;
    CHECK_INT(facet_brdf_create(m, &brdf), FACET_OK);
    if (brdf && expected_shares(brdf, tier, m, sampler, wo, share)) {
        struct square square = square_of(sampler, m, wo);
        count(brdf, tier, &square, batches, rng, counts);
        p = p_value(share, counts, (double)batches * BATCH);
    }
    if (!(p * TESTS > 0.01))
        check_fail(__FILE__, __LINE__, "%s: p = %.3g, %g outside: wo_z %g, %s", facet_sampler_name(sampler), p,
                   counts[CELLS], wo[2], draw_text(m));
    facet_brdf_destroy(brdf);
    return p;
}

static void chi_squared(facet_tier tier, facet_sampler sampler, size_t batches)
{
    struct rng rng;
    rng_seed(&rng, 31);
    double worst = 1;
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++)
        for (int k = 0; facet_sampler_serves(sampler, (facet_ndf)ndf) && k < SURFACES * VIEWS; k++) {
            int s = k / VIEWS, v = k % VIEWS;
            facet_material m = {.ndf = (facet_ndf)ndf, .roughness = roughness[s]};
            m.fresnel.channels = 1;
            double wo[3];
            view(degrees[v], 0.7 + s, wo);
            worst = fmin(worst, p_of(tier, sampler, &m, wo, batches, &rng));
        }
    check_note("smallest p times tests", worst * TESTS);
}

TEST(precise_samples_follow_the_pdf)
{
    chi_squared(FACET_PRECISE, FACET_SAMPLER_AUTO, draw_count(50));
}

TEST(fast_samples_follow_the_pdf)
{
    chi_squared(FACET_FAST, FACET_SAMPLER_AUTO, draw_count(20));
}

TEST(bounded_samples_follow_their_pdf)
{
    chi_squared(FACET_PRECISE, FACET_SAMPLER_BOUNDED, draw_count(30));
    chi_squared(FACET_FAST, FACET_SAMPLER_BOUNDED, draw_count(20));
}

TEST(slope_samples_follow_the_pdf)
{
    chi_squared(FACET_PRECISE, FACET_SAMPLER_SLOPE, draw_count(10));
    chi_squared(FACET_FAST, FACET_SAMPLER_SLOPE, draw_count(20));
}

TEST(samples_of_all_normals_follow_their_pdf)
{
    chi_squared(FACET_PRECISE, FACET_SAMPLER_NDF, draw_count(20));
    chi_squared(FACET_FAST, FACET_SAMPLER_NDF, draw_count(20));
}

TEST(cosine_samples_follow_their_pdf)
{
    chi_squared(FACET_FAST, FACET_SAMPLER_COSINE, draw_count(10));
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
