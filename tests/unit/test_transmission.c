/*
 * Rough dielectrics as a whole: what is reflected, transmitted and lost adds up to 1, densities to
 * 1 over the sphere, samples carry what quadrature finds, weights stay below 1.
 */
#include "check.h"
#include "chi_squared.h"
#include "draw.h"
#include "facet_transmission.h"
#include "integrate.h"
#include "normals.h"
#include "textbook.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;

static facet_material glass(facet_ndf ndf, facet_roughness roughness, double eta,
                            facet_masking masking)
{
    facet_material m = {.ndf = ndf,
                        .roughness = roughness,
                        .masking = masking,
                        .fresnel = {.kind = FACET_FRESNEL_DIELECTRIC, .channels = 1}};
    m.fresnel.eta[0] = eta;
    return m;
}

static const facet_roughness surfaces[] = {
    {.alpha_x = 0.4, .alpha_y = 0.4},
    {.alpha_x = 0.3, .alpha_y = 0.8, .rho = 0.5},
    {.alpha_x = 0.5, .alpha_y = 0.4, .rho = -0.3, .slope_x = 0.3, .slope_y = -0.4},
};
static const double indices[] = {1.5, 0.7, 1.05};
/* wo above and below. */
static const double views[][3] = {
    {0, 0, 1}, {0.6, 0, 0.8}, {-0.48, 0.6, -0.64}, {0.8, 0.5625, 0.21}};
enum { SURFACES = 3, INDICES = 3, VIEWS = 4 };

static void unit(const double from[3], double v[3])
{
    double size = sqrt(from[0] * from[0] + from[1] * from[1] + from[2] * from[2]);
    for (int j = 0; j < 3; j++) v[j] = from[j] / size;
}

/* Integrals over the sphere of wi, cell by cell: fr cos above and below, and pdf. */
enum { TILES = 24, SIDE = TILES * GAUSS_NODES, SHARES = 8, CELLS = 2 * SHARES * SHARES };
struct sums {
    double above, below, pdf, cell[CELLS];
};

static int cell_of(const double wi[3])
{
    double turn = atan2(wi[1], wi[0]) / (2 * pi);
    int row = (int)((1 - wi[2]) * SHARES), column = (int)((turn < 0 ? turn + 1 : turn) * SHARES);
    return (row < 2 * SHARES ? row : 2 * SHARES - 1) * SHARES +
           (column < SHARES ? column : SHARES - 1);
}

/* Gauss rules on 2 x TILES by TILES tiles of cos theta and azimuth, which no cell straddles. */
static struct sums integrate(const facet_bsdf *bsdf, const double wo[3])
{
    enum { N = SIDE };
    static double i[3][N], o[3][N], fr_cos[N], pdf[N];
    double x[GAUSS_NODES], w[GAUSS_NODES];
    struct sums sums = {0};
    normals_gauss(x, w);
    for (int row = 0; row < 2 * SIDE; row++) {
        double z = 1 - (row / GAUSS_NODES + x[row % GAUSS_NODES]) / TILES,
               s = sqrt((1 - z) * (1 + z));
        for (int k = 0; k < N; k++) {
            double turn = 2 * pi * (k / GAUSS_NODES + x[k % GAUSS_NODES]) / TILES;
            i[0][k] = s * cos(turn), i[1][k] = s * sin(turn), i[2][k] = z;
            for (int j = 0; j < 3; j++) o[j][k] = wo[j];
        }
        facet_outputs outputs = {.of = {[FACET_FR_COS] = {fr_cos}, [FACET_PDF] = {pdf}}};
        CHECK_INT(facet_bsdf_eval(bsdf, FACET_PRECISE, (facet_vec3_in){i[0], i[1], i[2]},
                                  (facet_vec3_in){o[0], o[1], o[2]}, N, &outputs),
                  FACET_OK);
        for (int k = 0; k < N; k++) {
            double area = 2 * pi * w[row % GAUSS_NODES] * w[k % GAUSS_NODES] / (TILES * TILES);
            const double wi[3] = {i[0][k], i[1][k], i[2][k]};
            *(z > 0 ? &sums.above : &sums.below) += area * fr_cos[k];
            sums.pdf += area * pdf[k];
            sums.cell[cell_of(wi)] += area * pdf[k];
        }
    }
    return sums;
}

/* Heitz's Lambda (the thesis's tables 2.II, 2.III) of a direction that the mean facet sees. */
static double lambda(const facet_material *m, const double k[3])
{
    struct textbook_stretched t = textbook_stretch(&m->roughness, k);
    double v = t.c / t.s;
    if (!(t.c > 0) || t.s == 0) return t.c > 0 ? 0 : INFINITY;
    if (m->ndf == FACET_GGX) return (sqrt(1 + 1 / (v * v)) - 1) / 2;
    return (exp(-v * v) / (v * sqrt(pi)) - erfc(v)) / 2;
}

/* G2/G1(o) of light across or on wo's side. */
static double kept(const facet_material *m, bool across, double lo, double li)
{
    if (isinf(li)) return 0;
    if (m->masking != FACET_SMITH) return 1 / (1 + li);
    return across ? exp(lgamma(2 + lo) + lgamma(1 + li) - lgamma(2 + lo + li))
                  : (1 + lo) / (1 + lo + li);
}

/* What one visible normal h of wo (above) sends where: F and Snell's law by angles, directions by vectors. */
struct split {
    double F, same, across; /* F and the shares that masking keeps, 0 on the wrong side */
    double up[3];           /* -wi of the refracted ray */
    double jacobian;        /* d omega_h / d omega_i there (Walter's eq. 17) */
};

static struct split split_at(const facet_material *m, const double wo[3], double lo, double n,
                             double c, const double same[3], const double h[3])
{
    struct split x = {.F = 1};
    double sine_t = sqrt(fmax((1 - c) * (1 + c), 0)) / n,
           cosine_t = sqrt(fmax((1 - sine_t) * (1 + sine_t), 0));
    if (sine_t < 1) {
        double s = (c - n * cosine_t) / (c + n * cosine_t),
               p = (n * c - cosine_t) / (n * c + cosine_t);
        x.F = (s * s + p * p) / 2;
    }
    for (int j = 0; j < 3; j++) x.up[j] = wo[j] / n - (c / n - cosine_t) * h[j];
    x.jacobian = n * n * cosine_t / pow(c - n * cosine_t, 2);
    if (same[2] > 0) x.same = kept(m, false, lo, lambda(m, same));
    if (x.F < 1 && x.up[2] > 0) x.across = kept(m, true, lo, lambda(m, x.up));
    return x;
}

/* Over the visible normals of wo: what fr cos of the service sends to either side, and what masking takes. */
struct shares {
    double reflected, transmitted, lost;
};

static double fr_cos_of(const facet_bsdf *bsdf, const double wi[3], const double wo[3], double turn)
{
    double v[6], value;
    for (int j = 0; j < 3; j++) v[j] = turn * wi[j], v[3 + j] = turn * wo[j];
    facet_outputs outputs = {.of = {[FACET_FR_COS] = {&value}}};
    facet_bsdf_eval(bsdf, FACET_PRECISE, (facet_vec3_in){&v[0], &v[1], &v[2]},
                    (facet_vec3_in){&v[3], &v[4], &v[5]}, 1, &outputs);
    return value;
}

static struct shares shares_of(const facet_material *m, const facet_bsdf *bsdf, const double wo_[3],
                               int panels)
{
    struct normals_rule rule;
    struct shares sum = {0, 0, 0};
    double wo[3], turn = wo_[2] < 0 ? -1 : 1,
                  n = turn < 0 ? 1 / m->fresnel.eta[0] : m->fresnel.eta[0];
    for (int j = 0; j < 3; j++) wo[j] = turn * wo_[j];
    double lo = lambda(m, wo),
           c_mean = wo[2] - wo[0] * m->roughness.slope_x - wo[1] * m->roughness.slope_y;
    if (!normals_rule_create(m, wo, panels, &rule)) return sum;
    for (size_t k = 0; k < rule.n; k++) {
        const double h[3] = {rule.h[0][k], rule.h[1][k], rule.h[2][k]},
                     same[3] = {rule.i[0][k], rule.i[1][k], rule.i[2][k]};
        double c = rule.cosine[k], seen = rule.weight[k] *
                                          textbook_density(m->ndf, &m->roughness, h) * c /
                                          (c_mean * (1 + lo));
        struct split x = split_at(m, wo, lo, n, c, same, h);
        const double across[3] = {-x.up[0], -x.up[1], -x.up[2]};
        sum.lost += seen * (x.F * (1 - x.same) + (1 - x.F) * (1 - x.across));
        if (same[2] > 0) sum.reflected += rule.weight[k] * 4 * c * fr_cos_of(bsdf, same, wo, turn);
        if (x.across > 0)
            sum.transmitted += rule.weight[k] / x.jacobian * fr_cos_of(bsdf, across, wo, turn);
    }
    normals_rule_destroy(&rule);
    return sum;
}

static facet_material glass_of(int s, int k, int v, double wo[3])
{
    unit(views[v], wo);
    return glass((s + v) % 2 ? FACET_BECKMANN : FACET_GGX, surfaces[s], indices[k],
                 (k + v) % 2 ? FACET_SMITH : FACET_SMITH_UNCORRELATED);
}

/* A short run (FACET_TEST_SCALE) has fewer cases, held to the same limits. */
static bool is_whole(void)
{
    return draw_count(100) >= 100;
}

static facet_bsdf *open_bsdf(const facet_material *m, facet_transport transport)
{
    facet_bsdf *bsdf = NULL;
    CHECK_INT(facet_bsdf_create(m, transport, &bsdf), FACET_OK);
    return bsdf;
}

TEST(reflected_transmitted_and_lost_are_one)
{
    for (int s = 0; s < SURFACES; s++)
        for (int k = 0; k < INDICES; k++)
            for (int v = 0; v < VIEWS; v++) {
                double wo[3];
                facet_material m = glass_of(s, k, v, wo);
                facet_bsdf *bsdf = open_bsdf(&m, FACET_IMPORTANCE);
                struct shares x = shares_of(&m, bsdf, wo, 2);
                double error = fabs(x.reflected + x.transmitted + x.lost - 1);
                check_note("error", error);
                if (!(error < 1e-6))
                    check_fail(__FILE__, __LINE__, "%.9g + %.9g + %.9g, eta %g: %s", x.reflected,
                               x.transmitted, x.lost, indices[k], draw_text(&m));
                facet_bsdf_destroy(bsdf);
            }
}

/* What masking takes, by adaptive quadrature of the textbook alone: edges and all. */
struct loss {
    const facet_material *m;
    struct normals_map map;
    double wo[3], lo, c_mean, n, p;
    struct integrate_panel inner[64], outer[64];
};

static facet_status loss_across(void *user, const double at[INTEGRATE_POINTS],
                                struct integral of[INTEGRATE_POINTS])
{
    struct loss *l = user;
    for (int i = 0; i < INTEGRATE_POINTS; i++) {
        struct normals_node node = normals_at(&l->map, l->p, at[i]);
        double c = node.cosine, same[3];
        for (int j = 0; j < 3; j++) same[j] = 2 * c * node.h[j] - l->wo[j];
        struct split x = split_at(l->m, l->wo, l->lo, l->n, c, same, node.h);
        double seen = node.area * textbook_density(l->m->ndf, &l->m->roughness, node.h) * c /
                      (l->c_mean * (1 + l->lo));
        double value = seen * (x.F * (1 - x.same) + (1 - x.F) * (1 - x.across));
        of[i] = (struct integral){{isfinite(value) ? value : 0}, {0}};
    }
    return FACET_OK;
}

static facet_status loss_along(void *user, const double at[INTEGRATE_POINTS],
                               struct integral of[INTEGRATE_POINTS])
{
    struct loss *l = user;
    static const double ends[] = {0, 0.5, 1};
    for (int i = 0; i < INTEGRATE_POINTS; i++) {
        const struct integrate rule = {.fn = loss_across,
                                       .user = l,
                                       .values = 1,
                                       .absolute = {1e-7},
                                       .panel = l->inner,
                                       .panels = 64};
        l->p = at[i];
        facet_status status = facet_integrate(&rule, ends, 3, &of[i]);
        if (status) return status;
    }
    return FACET_OK;
}

static double lost_of(const facet_material *m, const double wo[3])
{
    static const double ends[] = {0, 1};
    struct loss l = {.m = m, .n = wo[2] < 0 ? 1 / m->fresnel.eta[0] : m->fresnel.eta[0]};
    struct integral sum;
    for (int j = 0; j < 3; j++) l.wo[j] = wo[2] < 0 ? -wo[j] : wo[j];
    l.map = normals_map(m, l.wo);
    l.lo = lambda(m, l.wo);
    l.c_mean = l.wo[2] - l.wo[0] * m->roughness.slope_x - l.wo[1] * m->roughness.slope_y;
    const struct integrate rule = {.fn = loss_along,
                                   .user = &l,
                                   .values = 1,
                                   .absolute = {3e-7},
                                   .panel = l.outer,
                                   .panels = 64};
    CHECK_INT(facet_integrate(&rule, ends, 2, &sum), FACET_OK);
    check_note("of lost", sum.error[0]);
    return sum.value[0];
}

/* The service's own quadrature, and that of the textbook's losses. */
TEST(albedo_of_both_sides)
{
    static const int chosen[][2] = {{0, 1}, {0, 2}, {1, 0}, {2, 2}, {2, 3}};
    const facet_albedo_options options = {.tolerance = 1e-7, .evaluations_max = 1 << 22};
    for (size_t k = 0; k < (is_whole() ? sizeof chosen / sizeof *chosen : 2); k++) {
        double wo[3];
        facet_albedo_value reflected, transmitted;
        facet_material m = glass_of(chosen[k][0], (chosen[k][0] + chosen[k][1]) % INDICES,
                                    chosen[k][1], wo);
        facet_bsdf *bsdf = open_bsdf(&m, FACET_IMPORTANCE);
        CHECK_INT(facet_bsdf_albedo(bsdf, (facet_vec3_in){&wo[0], &wo[1], &wo[2]}, 1, &options,
                                    &reflected, &transmitted, NULL),
                  FACET_OK);
        double sum = reflected.value[0] + transmitted.value[0] + lost_of(&m, wo);
        check_note("1 - sum", fabs(sum - 1));
        check_note("claimed", reflected.error[0] + transmitted.error[0]);
        CHECK(reflected.error[0] + transmitted.error[0] < 1e-6);
        if (!(fabs(sum - 1) < 1e-6))
            check_fail(__FILE__, __LINE__, "the sum is 1 %+.3g: %s", sum - 1, draw_text(&m));
        facet_bsdf_destroy(bsdf);
    }
}

/* Where no edge (the horizon, the critical angle) crosses the sphere a fixed rule is enough; nearly so in the last. */
static const struct {
    int surface, index, view;
    double limit;
} smooth[] = {{0, 0, 0, 1e-6}, {0, 0, 1, 1e-6}, {1, 0, 0, 1e-6},
              {2, 0, 0, 1e-6}, {0, 2, 1, 1e-6}, {1, 1, 2, 1e-5}};
enum { SMOOTH = sizeof smooth / sizeof *smooth };

struct tally {
    size_t n;
    double above, below, cell[CELLS];
};

/* n samples: pdf and weight are those that evaluation finds at wi, no weight beyond 1 (and a tier's rounding). */
static struct tally draw(const facet_bsdf *bsdf, facet_tier tier, const double wo[3], size_t n,
                         unsigned long long seed)
{
    const double rounding = tier == FACET_PRECISE ? 1e-12 : 1e-3;
    enum { BATCH = 500 };
    static double u[3][BATCH], o[3][BATCH], i[3][BATCH], weight[BATCH], pdf[BATCH], fr_cos[BATCH],
        again[BATCH];
    struct tally tally = {.n = n};
    struct rng rng;
    rng_seed(&rng, seed);
    for (size_t start = 0; start < n; start += BATCH) {
        for (int k = 0; k < BATCH; k++)
            for (int j = 0; j < 3; j++) u[j][k] = rng_uniform(&rng), o[j][k] = wo[j];
        facet_vec3_in from = {o[0], o[1], o[2]}, to = {i[0], i[1], i[2]};
        facet_samples samples = {.wi = {i[0], i[1], i[2]}, .weight = {weight}, .pdf = pdf};
        CHECK_INT(facet_bsdf_sample(bsdf, tier, FACET_SAMPLER_AUTO, from, u[0], u[1], u[2], BATCH,
                                    &samples),
                  FACET_OK);
        facet_outputs outputs = {.of = {[FACET_FR_COS] = {fr_cos}, [FACET_PDF] = {again}}};
        CHECK_INT(facet_bsdf_eval(bsdf, tier, to, from, BATCH, &outputs), FACET_OK);
        for (int k = 0; k < BATCH; k++) {
            const double wi[3] = {i[0][k], i[1][k], i[2][k]};
            check_note("pdf", fabs(pdf[k] / again[k] - 1));
            CHECK_REL(pdf[k], again[k], tier == FACET_PRECISE ? 1e-9 : 0, 0);
            CHECK_REL(weight[k] * pdf[k], fr_cos[k], fmax(1e-9, rounding), 1e-12);
            CHECK(weight[k] >= 0 && weight[k] <= 1 + rounding);
            *(wi[2] > 0 ? &tally.above : &tally.below) += weight[k] / (double)n;
            tally.cell[cell_of(wi)]++;
        }
    }
    return tally;
}

/* p of the samples' counts by cell against the quadrature of pdf; cells that expect few are one. */
static double p_value(const struct sums *sums, const struct tally *tally)
{
    double chi2 = 0, cells = -1, rest = 0, rest_count = 0, n = (double)tally->n;
    for (int c = 0; c < CELLS; c++) {
        double expected = sums->cell[c] * n;
        if (expected < 8) {
            rest += expected, rest_count += tally->cell[c];
            continue;
        }
        chi2 += pow(tally->cell[c] - expected, 2) / expected, cells++;
    }
    if (rest > 8) chi2 += pow(rest_count - rest, 2) / rest, cells++;
    return chi_squared_tail(chi2, cells);
}

/* No weight is beyond 1: the variance of their mean is at most share (1 - share)/n. */
static void check_estimate(double estimate, double share, size_t n)
{
    CHECK(share > 0 && share < 1);
    CHECK(fabs(estimate - share) < 5 * sqrt(share * (1 - share) / (double)n));
}

/* pdf over the sphere by quadrature, samples by cell, and their weights against the shares of the furnace. */
TEST(samples_follow_their_pdf)
{
    size_t n = draw_count(60) * 1000;
    for (int t = 0; t < (is_whole() ? SMOOTH : 2); t++) {
        double wo[3];
        facet_material m = glass_of(smooth[t].surface, smooth[t].index, smooth[t].view, wo);
        facet_bsdf *bsdf = open_bsdf(&m, FACET_IMPORTANCE);
        struct sums sums = integrate(bsdf, wo);
        struct shares x = shares_of(&m, bsdf, wo, 12);
        bool up = wo[2] > 0;
        CHECK_REL(sums.pdf, 1, smooth[t].limit, 0);
        CHECK_REL(up ? sums.above : sums.below, x.reflected, 5e-4,
                  0); /* a fixed rule meets the horizon there */
        CHECK_REL(up ? sums.below : sums.above, x.transmitted, 1e-6, 0);
        for (int tier = 0; tier < FACET_TIER_COUNT; tier++) {
            struct tally tally = draw(bsdf, (facet_tier)tier, wo, n,
                                      100 + (unsigned)(FACET_TIER_COUNT * t + tier));
            check_estimate(up ? tally.above : tally.below, x.reflected, n);
            check_estimate(up ? tally.below : tally.above, x.transmitted, n);
            double p = p_value(&sums, &tally);
            check_note("-p", -p);
            if (!(p * SMOOTH * FACET_TIER_COUNT > 0.01))
                check_fail(__FILE__, __LINE__, "p = %g in %d tests", p, SMOOTH * FACET_TIER_COUNT);
        }
        facet_bsdf_destroy(bsdf);
    }
}

/* On every side of every surface: samples in numbers, and their estimate of the furnace. */
TEST(samples_agree_with_the_furnace)
{
    size_t n = draw_count(8) * 1000;
    for (int s = 0; s < SURFACES; s++)
        for (int v = 0; v < VIEWS; v++) {
            double wo[3];
            facet_material m = glass_of(s, v % INDICES, v, wo);
            facet_bsdf *bsdf = open_bsdf(&m, FACET_IMPORTANCE);
            struct shares x = shares_of(&m, bsdf, wo, 2);
            struct tally tally = draw(bsdf, FACET_PRECISE, wo, n, 7 + (unsigned)(s * VIEWS + v));
            CHECK(fabs(tally.above + tally.below - (x.reflected + x.transmitted)) <
                  5 * sqrt((x.lost + 1e-3) / (double)n) + 1e-3);
            facet_bsdf_destroy(bsdf);
        }
}

/* Rough and smooth, straight and grazing, from either side: a normal reflects with probability F, and pdf is eval's. */
static void check_lobes(const facet_material *m, const double wo_[3], unsigned long long seed)
{
    enum { N = 400 };
    static double u[3][N], o[3][N], i[3][N], h[3][N], pdf[N], again[N];
    facet_bsdf *bsdf = open_bsdf(m, FACET_IMPORTANCE);
    struct rng rng;
    rng_seed(&rng, seed);
    for (int k = 0; k < N; k++)
        for (int j = 0; j < 3; j++) u[j][k] = rng_uniform(&rng), o[j][k] = wo_[j];
    facet_vec3_in from = {o[0], o[1], o[2]}, to = {i[0], i[1], i[2]};
    facet_samples samples = {.wi = {i[0], i[1], i[2]}, .h = {h[0], h[1], h[2]}, .pdf = pdf};
    facet_outputs outputs = {.of = {[FACET_PDF] = {again}}};
    CHECK_INT(facet_bsdf_sample(bsdf, FACET_PRECISE, FACET_SAMPLER_AUTO, from, u[0], u[1], u[2], N,
                                &samples),
              FACET_OK);
    CHECK_INT(facet_bsdf_eval(bsdf, FACET_PRECISE, to, from, N, &outputs), FACET_OK);
    double n = wo_[2] < 0 ? 1 / m->fresnel.eta[0] : m->fresnel.eta[0], sum = 0, spread = 1e-9;
    double least = facet_roughness_to_ellipse(&m->roughness).alpha_2;
    for (int k = 0; k < N; k++) {
        double c = 0, d = 0, normal[3] = {h[0][k], h[1][k], h[2][k]};
        for (int j = 0; j < 3; j++) c += o[j][k] * normal[j], d += i[j][k] * normal[j];
        struct split x = split_at(m, wo_, 0, n, fabs(c), normal, normal);
        sum += (c * d > 0) - x.F;
        spread += x.F * (1 - x.F);
        /* A rounded wi moves the slope of h by 1e-16/|n - 1|, over alpha. */
        CHECK_REL(pdf[k], again[k], 1e-13 / fabs(n - 1) / (least * fabs(c)), 1e-12);
    }
    check_note("sigmas", fabs(sum) / sqrt(spread));
    CHECK(fabs(sum) < 4.5 * sqrt(spread) + 1e-6);
    facet_bsdf_destroy(bsdf);
}

TEST(normals_reflect_with_probability_f)
{
    static const double alphas[] = {1e-3, 0.1, 4}, degrees[] = {0, 30, 60, 85, 89.9};
    static const facet_roughness shapes[] = {
        {.alpha_x = 1, .alpha_y = 1},
        {.alpha_x = 1, .alpha_y = 0.4, .rho = 0.7},
        {.alpha_x = 0.7, .alpha_y = 1, .slope_x = 0.3, .slope_y = -0.2},
    };
    for (size_t k = 0; k < 3 * 3 * 5 * 4; k++) {
        facet_roughness r = shapes[k % 3];
        double alpha = alphas[k / 3 % 3], theta = degrees[k / 9 % 5] * pi / 180,
               side = k / 45 % 2 ? -1 : 1;
        r.alpha_x *= alpha, r.alpha_y *= alpha, r.slope_x *= alpha, r.slope_y *= alpha;
        facet_material m = glass(k / 90 ? FACET_BECKMANN : FACET_GGX, r, k % 2 ? 1.5 : 0.8,
                                 FACET_SMITH);
        const double wo[3] = {side * sin(theta) * 0.6, side * sin(theta) * 0.8, side * cos(theta)};
        check_lobes(&m, wo, k);
    }
}

/* What transport means, which materials there are. */
TEST(conventions)
{
    double wo[3], y[2][2];
    facet_material m = glass_of(0, 0, 1, wo);
    for (int t = 0; t < 2; t++) {
        facet_bsdf *bsdf = open_bsdf(&m, (facet_transport)t);
        for (int side = 0; side < 2; side++) {
            const double wi[3] = {-0.36, 0.1, -sqrt(1 - 0.36 * 0.36 - 0.01)};
            y[t][side] = fr_cos_of(bsdf, wi, wo, side ? -1 : 1);
        }
        facet_bsdf_destroy(bsdf);
    }
    CHECK(y[0][0] > 0 && y[0][1] > 0);
    CHECK_REL(y[1][0] * 2.25, y[0][0], 1e-15, 0);
    CHECK_REL(y[1][1] / 2.25, y[0][1], 1e-15, 0);
    facet_bsdf *bsdf = NULL;
    for (int eta = 0; eta < 2; eta++) {
        m.fresnel.eta[0] = eta;
        CHECK_INT(facet_bsdf_create(&m, FACET_IMPORTANCE, &bsdf), FACET_BAD_FRESNEL);
    }
    m.fresnel.kind = FACET_FRESNEL_SCHLICK;
    CHECK_INT(facet_bsdf_create(&m, FACET_IMPORTANCE, &bsdf), FACET_UNSUPPORTED);
    CHECK(!bsdf);
    facet_bsdf_destroy(NULL);
}
