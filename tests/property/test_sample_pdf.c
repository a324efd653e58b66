/*
 * The sampler's histogram against its own pdf, by chi^2: cells of square.h, expected
 * counts from quadrature of facet_pdf, counts from facet_sample's wi (of floats at length from its h,
 * see counted_by).  Fixed seeds; every p-value must pass p n > 0.01 (Bonferroni).
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include "check.h"
#include "chi_squared.h"
#include "draw.h"
#include "square.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { SIDE = SQUARE_SIDE, CELLS = SQUARE_CELLS, BATCH = 1000 };

static const facet_roughness roughness[] = {
    {.alpha_x = 0.3, .alpha_y = 0.3},
    {.alpha_x = 1e-3, .alpha_y = 1e-3},
    {.alpha_x = 4, .alpha_y = 4},
    {.alpha_x = 0.05, .alpha_y = 0.8},
    {.alpha_x = 0.4, .alpha_y = 0.7, .rho = -0.95},
    {.alpha_x = 0.3, .alpha_y = 0.3, .slope_x = 0.5, .slope_y = -1},
    {.alpha_x = 0.5, .alpha_y = 0.2, .rho = 0.6, .slope_x = 2, .slope_y = 1},
    {.alpha_x = 0.02, .alpha_y = 0.3, .rho = 0.3, .slope_x = 0.1, .slope_y = 5},
};
static const double degrees[] = {0, 20, 60, 85, 89.9};
enum { SURFACES = sizeof roughness / sizeof *roughness, VIEWS = sizeof degrees / sizeof *degrees };
enum { TESTS = 2 * SURFACES * VIEWS };

/* What is asked of facet_pdf. */
struct density {
    const facet_brdf *brdf;
    facet_tier tier;
    const struct square *square;
    double node[GAUSS_NODES], weight[GAUSS_NODES];
};

/* The share of the part of size^2 at (p, q), by Gauss's rule. */
static double part_of(const struct density *d, double p, double q, double size)
{
    enum { NODES = GAUSS_NODES * GAUSS_NODES };
    double i[3][NODES], o[3][NODES], area[NODES], pdf[NODES], sum = 0;
    for (int k = 0; k < NODES; k++) {
        int a = k / GAUSS_NODES, b = k % GAUSS_NODES;
        double wi[3];
        area[k] = square_direction(d->square, p + size * d->node[a], q + size * d->node[b], wi) *
                  d->weight[a] * d->weight[b];
        for (int j = 0; j < 3; j++) i[j][k] = wi[j], o[j][k] = d->square->wo[j];
    }
    CHECK_INT(facet_pdf(d->brdf, d->tier, d->square->sampler, (facet_vec3_in){i[0], i[1], i[2]},
                        (facet_vec3_in){o[0], o[1], o[2]}, NODES, pdf),
              FACET_OK);
    for (int k = 0; k < NODES; k++) sum += area[k] * pdf[k];
    return sum * size * size;
}

/*
 * The same, by quarters where that makes a difference, as edges do; no more than depth times, and no
 * fewer than `least`: an edge near a cell's end escapes the rule and that of the quarters alike.
 */
static double share_of(const struct density *d, double p, double q, double size, double whole,
                       int depth, int least)
{
    double part[4], sum = 0, half = size / 2;
    if (depth == 0) return whole;
    for (int k = 0; k < 4; k++)
        sum += part[k] = part_of(d, p + half * (k & 1), q + half * (k >> 1), half);
    if (least <= 1 && fabs(sum - whole) < 1e-5 / CELLS) return sum;
    sum = 0;
    for (int k = 0; k < 4; k++)
        sum += share_of(d, p + half * (k & 1), q + half * (k >> 1), half, part[k], depth - 1,
                        least - 1);
    return sum;
}

/* Share of each cell by quadrature of the pdf that facet_pdf gives; whether they make 1. */
static bool expected_shares(const facet_brdf *brdf, facet_tier tier, const facet_material *m,
                            const struct square *square, int depth, double share[CELLS])
{
    enum { LEAST = 4 };
    struct density d = {.brdf = brdf, .tier = tier, .square = square};
    const double side = 1.0 / SIDE;
    /* Without depth Gauss's rule is off by 1/16 of a cell in each row that an edge runs through. */
    double total = 0, slack = square->is_bent && depth == 0 ? 1e-2 : 1e-3;
    normals_gauss(d.node, d.weight);
    for (int k = 0; k < CELLS; k++) {
        double p = side * (k / SIDE), q = side * (k % SIDE);
        share[k] = part_of(&d, p, q, side);
        if (square->is_bent) share[k] = share_of(&d, p, q, side, share[k], depth, LEAST);
        total += share[k];
    }
    if (fabs(total - 1) < slack) return true;
    check_fail(__FILE__, __LINE__, "the pdf of %s integrates to %.9g: %s",
               facet_sampler_name(square->sampler), total, draw_text(m));
    return false;
}

/*
 * A wi does not tell slopes apart where H = wi + wo is short beside its rounding: a float's at a grazing
 * angle, where a million samples show it; a double's from behind a narrow surface, where a hundred
 * million do (350 alpha behind, 1.6e-6 of the wi stand for slopes that face away).  Its h does.
 */
enum counted_by { BY_WI, BY_H };

/* Counts per cell; the last entry counts what fell outside. */
static void count(const facet_brdf *brdf, facet_tier tier, const struct square *square,
                  enum counted_by by, size_t batches, struct rng *rng, double counts[CELLS + 1])
{
    static double o[3][BATCH], u1[BATCH], u2[BATCH], wi[3][BATCH], h[3][BATCH];
    memset(counts, 0, (CELLS + 1) * sizeof *counts);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < BATCH; k++) o[j][k] = square->wo[j];
    while (batches--) {
        for (int k = 0; k < BATCH; k++) {
            u1[k] = rng_uniform(rng);
            u2[k] = rng_uniform(rng);
        }
        facet_samples s = {.wi = {wi[0], wi[1], wi[2]}, .h = {h[0], h[1], h[2]}};
        CHECK_INT(facet_sample(brdf, tier, square->sampler, (facet_vec3_in){o[0], o[1], o[2]}, u1,
                               u2, BATCH, &s),
                  FACET_OK);
        double *const to_wi[3] = {wi[0], wi[1], wi[2]}, *const to_h[3] = {h[0], h[1], h[2]};
        square_count(square, BATCH, to_wi, by == BY_H ? to_h : NULL, counts);
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
    return cells > 1 ? chi_squared_tail(sum, cells - 1) : 1;
}

static void view(double theta_degrees, double phi, double wo[3])
{
    double theta = theta_degrees * acos(-1) / 180;
    wo[0] = sin(theta) * cos(phi);
    wo[1] = sin(theta) * sin(phi);
    wo[2] = cos(theta);
}

/* The p-value of one sampler, material and direction, which is to pass with `tests` of its like. */
static double p_of(facet_tier tier, facet_sampler sampler, const facet_material *m,
                   const double wo[3], enum counted_by by, size_t batches, int depth, size_t tests,
                   struct rng *rng)
{
    struct square square = square_of(sampler, m, wo);
    static double share[CELLS], counts[CELLS + 1];
    facet_brdf *brdf = NULL;
    double p = 0; /* where there is none to tell */
    CHECK_INT(facet_brdf_create(m, &brdf), FACET_OK);
    if (brdf && expected_shares(brdf, tier, m, &square, depth, share)) {
        count(brdf, tier, &square, by, batches, rng, counts);
        p = p_value(share, counts, (double)batches * BATCH);
    }
    if (!(p * (double)tests > 0.01))
        check_fail(__FILE__, __LINE__, "%s: p = %.3g, %g outside: wo_z %g, %s",
                   facet_sampler_name(sampler), p, counts[CELLS], wo[2], draw_text(m));
    facet_brdf_destroy(brdf);
    return p;
}

/* Every shape and angle, each of which must pass; AUTO: each ndf's sampler of visible normals. */
static void chi_squared(facet_tier tier, facet_sampler sampler, size_t batches)
{
    struct rng rng;
    rng_seed(&rng, 31);
    double worst = 1;
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++)
        for (int k = 0; facet_sampler_serves(sampler, (facet_ndf)ndf) && k < SURFACES * VIEWS;
             k++) {
            int s = k / VIEWS, v = k % VIEWS;
            facet_material m = {.ndf = (facet_ndf)ndf, .roughness = roughness[s]};
            m.fresnel.channels = 1;
            double wo[3];
            view(degrees[v], 0.7 + s, wo);
            facet_sampler named = sampler == FACET_SAMPLER_AUTO ? facet_sampler_visible(m.ndf)
                                                                : sampler;
            worst = fmin(worst, p_of(tier, named, &m, wo, BY_WI, batches, 0, TESTS, &rng));
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

TEST(vcavity_samples_follow_their_pdf)
{
    chi_squared(FACET_PRECISE, FACET_SAMPLER_VCAVITY, draw_count(20));
    chi_squared(FACET_FAST, FACET_SAMPLER_VCAVITY, draw_count(20));
}

TEST(cosine_samples_follow_their_pdf)
{
    chi_squared(FACET_PRECISE, FACET_SAMPLER_COSINE, draw_count(10));
    chi_squared(FACET_FAST, FACET_SAMPLER_COSINE, draw_count(10));
}

/* ---- on a whole grid, at length ------------------------------------------------------------- */

static const double grid_alpha[] = {1e-3, 1e-2, 0.1, 0.5, 1, 4},
                    grid_degrees[] = {0, 30, 60, 85, 89.9};
enum { GRID_MAX = 2000 };
static const char *const grid_shape[] = {"isotropic", "rho .7", "sheared"};

struct grid_point {
    facet_sampler sampler;
    facet_material material;
    int shape;
    double degrees, wo[3];
};

/* Of the processor: what others do beside counts not. */
static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* The k-th of the grid; false past the last. */
static bool grid_at(size_t k, struct grid_point *at)
{
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++)
        for (int sampler = FACET_SAMPLER_AUTO + 1; sampler < FACET_SAMPLER_COUNT; sampler++) {
            enum { ALPHAS = 6, SHAPES = 3, DEGREES = 5, EACH = ALPHAS * SHAPES * DEGREES };
            if (!facet_sampler_serves((facet_sampler)sampler, (facet_ndf)ndf)) continue;
            if (k >= EACH) {
                k -= EACH;
                continue;
            }
            double alpha = grid_alpha[k % ALPHAS];
            *at = (struct grid_point){
                .sampler = (facet_sampler)sampler,
                .material = {.ndf = (facet_ndf)ndf, .fresnel = {.channels = 1}},
                .shape = (int)(k / ALPHAS % SHAPES),
                .degrees = grid_degrees[k / ALPHAS / SHAPES]};
            at->material.roughness = (facet_roughness){.alpha_x = alpha, .alpha_y = alpha};
            if (at->shape == 1)
                at->material.roughness.alpha_y = 0.5 * alpha, at->material.roughness.rho = 0.7;
            if (at->shape == 2)
                at->material.roughness.slope_x = 0.3, at->material.roughness.slope_y = -0.2;
            view(at->degrees, 0.7 + 1.3 * (double)(k % 5), at->wo);
            return true;
        }
    return false;
}

/*
 * Which tier: floats have every other point whose slopes they tell apart (a float's h does to
 * 6e-8/alpha about a mean slope).  By what does not step with alpha or angle.
 */
static facet_tier tier_at(const struct grid_point *at, size_t k)
{
    bool resolves = at->shape != 2 || at->material.roughness.alpha_x >= 0.1;
    return resolves && at->sampler != FACET_SAMPLER_TABLE && (k * 2654435761u >> 16 & 1)
               ? FACET_FAST
               : FACET_PRECISE;
}

/* Whether there is something to count: Beckmann's own table ends 25 standard slopes behind. */
static bool is_told(const struct grid_point *at)
{
    const struct normals_map map = normals_map(&at->material, at->wo);
    return at->sampler != FACET_SAMPLER_TABLE || map.ggx || map.c > -25 * map.s;
}

static enum counted_by counted_at(const struct grid_point *at, facet_tier tier)
{
    const facet_roughness *r = &at->material.roughness;
    const double *o = at->wo;
    bool behind = o[2] < o[0] * r->slope_x + o[1] * r->slope_y;
    return tier < FACET_EXACT32 || behind ? BY_H : BY_WI;
}

/* What processes share: who takes the next point, and what was found. */
struct sweep {
    _Atomic size_t next;
    double p[GRID_MAX]; /* not a number until it is found */
};

/* A point has no more samples than this: table is scalar, 800 ns each. */
static double most_of(facet_sampler sampler)
{
    return sampler == FACET_SAMPLER_TABLE ? 1e7 : INFINITY;
}

static void take_points(struct sweep *sweep, size_t points, size_t stride, double samples,
                        bool tells)
{
    const size_t tests = (points - stride / 2 + stride - 1) / stride;
    for (size_t i; (i = sweep->next++) < tests;) {
        struct grid_point at;
        struct rng rng;
        size_t k = stride / 2 + i * stride;
        if (!grid_at(k, &at)) return;
        rng_seed(&rng, 32 + k);
        facet_tier tier = tier_at(&at, k);
        double start = seconds(), drawn = fmin(samples, most_of(at.sampler));
        if (!is_told(&at)) {
            sweep->p[i] = 1;
            continue;
        }
        sweep->p[i] = p_of(tier, at.sampler, &at.material, at.wo, counted_at(&at, tier),
                           (size_t)(drawn / BATCH), 7, tests, &rng);
        if (!tells) continue;
        printf("%-8s %-8s %-9s alpha %-5g theta %-4g %-7s %g samples  %5.1f s  p = %.4g\n",
               at.material.ndf == FACET_GGX ? "ggx" : "beckmann", facet_sampler_name(at.sampler),
               grid_shape[at.shape], at.material.roughness.alpha_x, at.degrees,
               facet_tier_name(tier), drawn, seconds() - start, sweep->p[i]);
        fflush(stdout);
    }
}

/* In as many processes as there are processors. */
static void share_points(struct sweep *sweep, size_t points, double samples)
{
    long workers = sysconf(_SC_NPROCESSORS_ONLN);
    for (long w = 0; w < workers; w++) {
        pid_t child = fork();
        CHECK(child >= 0);
        if (child == 0) {
            take_points(sweep, points, 1, samples, true);
            _exit(0);
        }
    }
    while (wait(NULL) > 0) continue;
}

/*
 * Every sampler, distribution, shape, alpha and angle: some of them with 10^6 samples each, or all of
 * them with $FACET_CHI2 samples (make chi2), their figures printed.  A run that was ended goes on where
 * $FACET_CHI2_FROM says.
 */
TEST(every_sampler_at_length)
{
    const char *asked = getenv("FACET_CHI2"), *from = getenv("FACET_CHI2_FROM");
    const size_t first = asked && from ? strtoul(from, NULL, 10) : 0, stride = asked ? 1 : 151;
    size_t points = 0, tests = 0;
    double samples = asked ? strtod(asked, NULL) : BATCH * (double)draw_count(1000), worst = 1;
    struct grid_point at;
    while (grid_at(points, &at)) points++;
    struct sweep *sweep = mmap(NULL, sizeof *sweep, PROT_READ | PROT_WRITE,
                               MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (sweep == MAP_FAILED || points > GRID_MAX) {
        check_fail(__FILE__, __LINE__, "no place for %zu points", points);
        return;
    }
    sweep->next = first;
    for (size_t i = 0; i < GRID_MAX; i++) sweep->p[i] = NAN;
    fflush(stdout);
    if (asked)
        share_points(sweep, points, samples);
    else
        take_points(sweep, points, stride, samples, false);
    for (size_t k = stride / 2; k < points; k += stride) tests++;
    for (size_t i = first; i < tests; i++) {
        if (!(sweep->p[i] * (double)tests > 0.01))
            check_fail(__FILE__, __LINE__, "point %zu: p = %.3g", i, sweep->p[i]);
        worst = fmin(worst, sweep->p[i]);
    }
    munmap(sweep, sizeof *sweep);
    check_note("tests", (double)tests);
    check_note("samples each", samples);
    check_note("smallest p times tests", worst * (double)tests);
}

/* chi^2 itself: known quantiles, 3.841 (1 degree) and 18.307 (10 degrees) at 5 %. */
TEST(the_test_of_the_test)
{
    CHECK_REL(chi_squared_tail(3.841458820694124, 1), 0.05, 1e-12, 0);
    CHECK_REL(chi_squared_tail(18.307038053275146, 10), 0.05, 1e-12, 0);
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
