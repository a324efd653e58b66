/* Tabulated slope distributions against closed forms and brute-force quadrature. */
#include "check.h"
#include "draw.h"
#include "slope_pieces.h"
#include "slope_sheet.h"
#include "slope_table.h"
#include "table_closed.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

enum { GGX, BECKMANN };

static double slope_density(int ndf, double alpha, double r)
{
    double x = r / alpha, a = 1 + x * x;
    return (ndf == GGX ? 1 / (a * a) : exp(-x * x)) / (PI * alpha * alpha);
}

/* E[max(x - v, 0)] of one slope component */
static double psi(int ndf, double alpha, double v)
{
    double x = v / alpha;
    if (ndf == GGX) return alpha / 2 / (sqrt(1 + x * x) + x);
    return alpha * (exp(-x * x) / sqrt(PI) - x * erfc(x)) / 2;
}

static facet_slope_table *tabulate(int ndf, double alpha, double scale, size_t n)
{
    double *log_d = malloc(n * sizeof *log_d);
    facet_slope_table *table = NULL;
    for (size_t i = 0; i < n; i++) {
        double u = (double)i / (double)(n - 1), r = scale * u / (1 - u), x = r / alpha,
               s = 1 + r * r;
        log_d[i] = 2 * log(s) - (ndf == GGX ? 2 * log(1 + x * x) : x * x) + 3;
        if (i == n - 1) log_d[i] = ndf == GGX ? 4 * log(alpha) + 3 : -INFINITY;
    }
    CHECK_INT(facet_slope_table_create(scale, log_d, n, &table), FACET_OK);
    free(log_d);
    return table;
}

static double evaluate(struct kernel_cubic cubic, double u)
{
    double x = u * (double)cubic.cells;
    size_t i = x < (double)cubic.cells ? (size_t)x : cubic.cells - 1;
    const double *c = cubic.c + 4 * i;
    x -= (double)i;
    return c[0] + x * (c[1] + x * (c[2] + x * c[3]));
}

/* psi as kernels.h defines it: sigma(k) = max(c, 0) + s psi(|c|/s) */
static double table_psi(const facet_slope_table *table, double v)
{
    double b = table->view.psi_scale, w = b / (b + v);
    return b * w * exp(evaluate(table->view.log_psi, w));
}

/* 2 pi r P(r) dr/du by the midpoint rule: nothing shared with lib's quadrature. */
static double norm(const facet_slope_table *table)
{
    enum { STEPS = 400000 };
    double b = table->view.slope_scale, sum = 0;
    for (int i = 0; i < STEPS; i++) {
        double u = (i + 0.5) / STEPS, r = b * u / (1 - u), s = 1 + r * r;
        double p = exp(facet_slope_table_log_d(table, r)) / (s * s);
        sum += 2 * PI * r * p * b / ((1 - u) * (1 - u)) / STEPS;
    }
    return sum;
}

/* From in front a density passes its floor as far as 10.2 slopes, from behind as far as D is told at all. */
TEST(tables_of_closed_distributions)
{
    for (int ndf = GGX; ndf <= BECKMANN; ndf++) {
        const facet_slope_table *table = facet_table_of((facet_ndf)ndf);
        double front = 0, behind = 0, end = ndf == GGX ? 1e9 : 25.9;
        for (double r = 1e-9; table && r < end; r += r < 1        ? r * .01
                                                     : ndf == GGX ? r * .01
                                                                  : 1e-3) {
            double x = log(slope_density(ndf, 1, r)) + 2 * log1p(r * r);
            if (ndf == BECKMANN) x = -r * r - log(PI) + 2 * log1p(r * r);
            double error = fabs(expm1(facet_slope_table_log_d(table, r) - x));
            behind = check_worse(behind, error);
            if (r < 13) front = check_worse(front, error);
        }
        check_note("D", behind);
        CHECK(front <= 1e-11 + facet_table_density_error((facet_ndf)ndf, false));
        CHECK(behind <= 1e-11 + facet_table_density_error((facet_ndf)ndf, true));
    }
}

TEST(closed_forms)
{
    static const double alphas[] = {.001, .01, .1, .4, 1};
    for (int ndf = GGX; ndf <= BECKMANN; ndf++) {
        for (size_t i = 0; i < sizeof alphas / sizeof *alphas; i++) {
            double alpha = alphas[i], worst_d = 0, worst_sigma = 0, worst_psi = 0;
            facet_slope_table *table = tabulate(ndf, alpha, 1.5 * alpha, 181);
            if (!table) return;
            for (double r = 0; r < 100 * alpha; r = r * 1.02 + 1e-3 * alpha) {
                double p = slope_density(ndf, alpha, r), s = 1 + r * r;
                if (p * PI * alpha * alpha < 1e-4) break;
                double d = exp(facet_slope_table_log_d(table, r));
                worst_d = check_worse(worst_d, fabs(d / (p * s * s) - 1));
            }
            for (double v = 0; v < 1000 * alpha; v = v * 1.01 + 1e-4 * alpha) {
                double exact = psi(ndf, alpha, v), error = fabs(table_psi(table, v) - exact);
                worst_sigma = check_worse(worst_sigma, error / (v + exact));
                if (exact > 1e-6 * alpha) worst_psi = check_worse(worst_psi, error / exact);
            }
            CHECK(worst_d < 1e-6);
            CHECK(worst_sigma < 1e-8);
            CHECK(worst_psi < 5e-7);
            CHECK(table->sigma_error < 2.1e-10);
            CHECK(fabs(norm(table) - 1) < 1e-9);
            check_note("D", worst_d);
            check_note("sigma", worst_sigma);
            check_note("psi", worst_psi);
            check_note("norm-1", fabs(norm(table) - 1));
            facet_slope_table_destroy(table);
        }
    }
}

/* The quadrature alone, on a table so fine that its spline is no excuse; and its tabulation far
 * out. */
TEST(psi_by_quadrature)
{
    double alpha = .3;
    facet_slope_table *table = tabulate(GGX, alpha, .45, 2881);
    struct slope_pieces pieces;
    if (!table) return;
    CHECK_INT(facet_slope_pieces_create(.45, table->view.log_q, &pieces), FACET_OK);
    for (double v = 0; v < 1e5; v = v * 1.07 + 1e-4) {
        double derivative, exact = psi(GGX, alpha, v), x = v / alpha, root = sqrt(1 + x * x);
        double got = facet_slope_pieces_psi(&pieces, v, &derivative);
        CHECK_REL(got, exact, 5e-11, 0); /* 8 points on r = v .. 2 v: 1e-11 */
        CHECK_REL(derivative, -1 / (2 * root * (root + x)), 5e-11, 0);
        check_note("psi", fabs(got / exact - 1));
        CHECK_REL(table_psi(table, v), exact, 1e-8, 0);
        check_note("tabulated", fabs(table_psi(table, v) / exact - 1));
    }
    facet_slope_pieces_clear(&pieces);
    facet_slope_table_destroy(table);
}

/* sigma of the table against the integral of the table's own D, over azimuth and radius by brute
 * force. */
static double sigma_brute(const facet_slope_table *table, double v)
{
    enum { RADII = 400000 };
    double b = table->view.slope_scale, sum = 0, u0 = v / (b + v);
    for (int i = 0; i < RADII; i++) { /* u = u0 + (1 - u0) y^2 takes the edge off r = v */
        double y = (i + 0.5) / RADII, u = u0 + (1 - u0) * y * y, r = b * u / (1 - u), s = 1 + r * r;
        double ring = 2 * PI * r * exp(facet_slope_table_log_d(table, r)) / (s * s);
        double cap = r > v ? (sqrt(r * r - v * v) - v * acos(v / r)) / PI : 0;
        sum += ring * cap * b / ((1 - u) * (1 - u)) * (1 - u0) * 2 * y / RADII;
    }
    return sum;
}

TEST(sigma_is_the_integral_of_the_tabulated_d)
{
    struct rng rng;
    rng_seed(&rng, 11);
    double log_d[30];
    for (size_t i = 0; i < 30; i++) /* a rough, measured-like table */
        log_d[i] = -6. * (double)i / 30 + .3 * rng_uniform(&rng);
    facet_slope_table *table = NULL;
    CHECK_INT(facet_slope_table_create(.3, log_d, 30, &table), FACET_OK);
    if (!table) return;
    CHECK(fabs(norm(table) - 1) < 1e-8);
    for (double v = 1e-3; v < 30; v *= 2.7) {
        double exact = sigma_brute(table, v), got = table_psi(table, v);
        CHECK_REL(v + got, v + exact, 1e-9, 0);
        CHECK_REL(got, exact, 2e-6, 0);
        check_note("psi", fabs(got / exact - 1));
    }
    check_note("own estimate", table->sigma_error);
    facet_slope_table_destroy(table);
}

/*
 * However far the scale is from the slopes, all of which may lie within one cell: sigma is the integral
 * of D to three times the error stated, as the bounds count it, and where the table is smooth as right as
 * at the slopes' own scale.
 */
TEST(sigma_is_told_at_any_scale)
{
    static const double scales[] = {1e-4, .01, 1, 100, 1e3, 1e4};
    static const size_t nodes[] = {4, 25, 91, 400, 4096};
    for (int k = 0; k < 6 * 5 * 2; k++) {
        double scale = scales[k % 6], worst = 0;
        facet_slope_table *table = tabulate(k / 30, k / 30 ? 1 : .05, scale, nodes[k / 6 % 5]);
        if (!table) return;
        for (double v = 1e-9; v < 1e5; v *= 1.05) {
            double derivative, exact = facet_slope_pieces_psi(&table->pieces, v, &derivative);
            worst = check_worse(worst, fabs(table_psi(table, v) - exact) / (v + exact));
        }
        CHECK(worst <= 3 * table->sigma_error + 2e-10);
        if (scale >= 1) CHECK(table->sigma_error < 1e-9);
        if (scale >= 1) check_note("sigma", worst);
        facet_slope_table_destroy(table);
    }
}

/* Equal rows are a radial table, whose sums are exact: smooth, ending at a cliff, with tails, narrow upon broad. */
static double log_radial(int shape, double r)
{
    if (shape == 0) return fmax(2 * log1p(r * r) - r * r, -1e4);
    if (shape == 1) return r <= .5 ? 0 : -1e4;
    if (shape == 2) return 0; /* GGX */
    double broad = -r * r, narrow = log(900) - 900 * r * r, most = fmax(broad, narrow);
    return fmax(2 * log1p(r * r) + most + log1p(exp(-fabs(broad - narrow))), -1e4);
}

static double equal_rows(int shape, double scale, size_t n, facet_slope_table *table[2],
                         facet_status *status)
{
    enum { TURNS = 6, NODES_MAX = 400 };
    double log_d[TURNS * NODES_MAX];
    for (size_t k = 0; k < TURNS * n; k++) {
        double u = (double)(k % n) / (double)(n - 1);
        log_d[k] = log_radial(shape, u < 1 ? scale * u / (1 - u) : 1e9);
    }
    CHECK_INT(facet_slope_table_create(scale, log_d, n, &table[0]), FACET_OK);
    *status = facet_slope_table_create_turned(scale, log_d, n, TURNS, NULL, &table[1]);
    return table[0] ? table[0]->pieces.piece[0].moment[0] : NAN; /* the mean slope */
}

/* Right to three times the error stated, as bounds count it; a scale too far out is refused. */
TEST(sigma_of_rows_is_as_right_as_stated)
{
    static const double scales[] = {.01, .3, 1, 3, 10, 30, 100, 1e4};
    static const size_t nodes[] = {4, 25, 91};
    /* One of eleven, which meets each shape, scale and number of nodes; all of them in a longer run. */
    size_t step = draw_count(1) > 1 ? 1 : 11;
    for (size_t k = 0; k < 4 * 3 * 8; k += step) {
        double scale = scales[k % 8], worst = 0, derivative;
        facet_slope_table *table[2] = {NULL};
        facet_status status;
        double mean = equal_rows((int)(k / 24), scale, nodes[k / 8 % 3], table, &status);
        if (fabs(scale / mean / FACET_TURNED_SCALE_FAR - 1) > .01)
            CHECK_INT(status, scale > FACET_TURNED_SCALE_FAR * mean ? FACET_BAD_TABLE : FACET_OK);
        if (table[0] && table[1]) {
            double apart = fabs(facet_slope_table_log_d(table[0], 0) -
                                facet_slope_table_log_d_along(table[1], 0, .3));
            for (double v = 1e-8; v < 1e4; v *= 1.1) {
                double b = table[1]->view.psi_scale, w = b / (b + v);
                double exact = facet_slope_pieces_psi(&table[0]->pieces, v, &derivative);
                double got = b * w * exp(slope_log_psi_at(&table[1]->view, 1 - w, .3));
                worst = check_worse(worst, fabs(got - exact) / (v + exact));
            }
            CHECK(apart <= 1e-11); /* both integrate to 1 */
            CHECK(worst <= 3 * table[1]->sigma_error + 1e-8);
            check_note("D", apart);
        }
        for (int i = 0; i < 2; i++) facet_slope_table_destroy(table[i]);
    }
}

/* Nodes off a smooth curve by noise of any size: between them the table is off by little more. */
TEST(noise_does_not_ring)
{
    enum { N = 91, BETWEEN = 16 };
    static const double noises[] = {1e-5, 1e-4, 3e-4, 1e-3, 1e-2, .1};
    struct rng rng;
    rng_seed(&rng, 5);
    for (size_t k = 0; k < sizeof noises / sizeof *noises; k++) {
        double log_d[N], worst = 0, scale = .3, alpha = .2;
        for (size_t i = 0; i < N; i++) {
            double u = (double)i / (N - 1), r = scale * u / (1 - u),
                   smooth = i == N - 1 ? 4 * log(alpha)
                                       : 2 * log((1 + r * r) / (1 + r * r / (alpha * alpha)));
            log_d[i] = smooth + noises[k] * (2 * rng_uniform(&rng) - 1);
        }
        facet_slope_table *table = NULL;
        CHECK_INT(facet_slope_table_create(scale, log_d, N, &table), FACET_OK);
        if (!table) return;
        double norm = facet_slope_table_log_d(table, 0) - log_d[0];
        for (size_t i = 0; i < BETWEEN * (N - 1); i++) {
            double u = (double)i / (BETWEEN * (N - 1)), r = scale * u / (1 - u);
            double smooth = 2 * log((1 + r * r) / (1 + r * r / (alpha * alpha)));
            worst = fmax(worst, fabs(facet_slope_table_log_d(table, r) - norm - smooth));
        }
        CHECK(worst <= 2 * noises[k] + 1e-6);
        check_note("in noises", worst / noises[k]);
        facet_slope_table_destroy(table);
    }
}

TEST(zeros_do_not_ring)
{
    double log_d[64];
    for (size_t i = 0; i < 64; i++)
        log_d[i] = i < 20 ? -.02 * (double)i : i < 40 ? -INFINITY : -1e5;
    facet_slope_table *table = NULL;
    CHECK_INT(facet_slope_table_create(1, log_d, 64, &table), FACET_OK);
    if (!table) return;
    for (int i = 0; i <= 6300; i++) {
        double u = i / 6300., y = evaluate(table->view.log_q, u);
        CHECK(y >= KERNEL_LOG_ZERO - 1e-9);
        if (u > 20 / 63.) CHECK_REL(y, KERNEL_LOG_ZERO, 1e-15, 0);
        if (u < 19 / 63.) {
            double r = u / (1 - u), d = facet_slope_table_log_d(table, r),
                   d0 = facet_slope_table_log_d(table, 0);
            CHECK(fabs(d - d0 + .02 * 63 * u) < .01);
        }
    }
    CHECK(fabs(norm(table) - 1) < 1e-4); /* the midpoint rule sees a step */
    facet_slope_table_destroy(table);
    for (size_t i = 0; i < 64; i++)
        log_d[i] = i < 20 ? -.02 * (double)i : -690; /* a cliff, but not 0 */
    CHECK_INT(facet_slope_table_create(1, log_d, 64, &table), FACET_OK);
    if (!table) return;
    for (int i = 0; i <= 6300; i++) {
        double u = i / 6300.;
        double r = u / (1 - u), d = facet_slope_table_log_d(table, r),
               d0 = facet_slope_table_log_d(table, 0);
        if (u < 19 / 63.) CHECK(fabs(d - d0 + .02 * 63 * u) < .01);
        CHECK(evaluate(table->view.log_q, u) >= KERNEL_LOG_ZERO);
    }
    facet_slope_table_destroy(table);
}

TEST(extremes_stay_finite)
{
    static const double scales[] = {1e-8, 1, 1e4};
    static const double shapes[][4] = {
        {0, 0, 0, 0},          {0, -699, 0, -699},       {600, -900, -900, -900},
        {-900, -900, -900, 0}, {-699, -699, -699, -699}, {1e6, -1e6, 1e6, -1e6},
        {-900, 2, -900, -900}, {1e300, 0, 0, 0},
    };
    for (size_t k = 0; k < 3; k++) {
        for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
            facet_slope_table *table = NULL;
            facet_status status = facet_slope_table_create(scales[k], shapes[i], 4, &table);
            CHECK(status == FACET_OK || status == FACET_BAD_TABLE);
            if (!table) continue;
            for (int j = 0; j <= 1000; j++) {
                CHECK(isfinite(evaluate(table->view.log_q, j / 1000.)));
                CHECK(isfinite(evaluate(table->view.log_psi, j / 1000.)));
            }
            CHECK(isfinite(table->sigma_error) && isfinite(table->psi_error));
            facet_slope_table_destroy(table);
        }
    }
}

static bool is_over(void *left)
{
    return (*(long *)left)-- <= 0;
}

TEST(whoever_waits_for_a_table_may_leave)
{
    enum { N = 12, TURNS = 5, MANY = 1000000 };
    long left = MANY;
    const facet_watch watch = {is_over, &left};
    double log_d[TURNS * N];
    facet_slope_table *table;
    for (int k = 0; k < TURNS * N; k++) log_d[k] = -(k % N);
    CHECK_INT(facet_slope_table_create_turned(.3, log_d, N, TURNS, &watch, &table), FACET_OK);
    facet_slope_table_destroy(table);
    const long asked = MANY - left;
    CHECK(asked > 100);
    for (long after = 0; after < asked; after += 1 + asked / 40) {
        left = after;
        CHECK_INT(facet_slope_table_create_turned(.3, log_d, N, TURNS, &watch, &table),
                  FACET_CANCELLED);
        CHECK(!table);
        CHECK_INT(left, -1); /* it asked no more */
    }
    /* Slopes far below the scale are refused by the sums that come first: those ask too. */
    for (int k = 0; k < TURNS * N; k++) log_d[k] = k % N ? -2000 : 0;
    left = MANY;
    CHECK_INT(facet_slope_table_create_turned(1e4, log_d, N, TURNS, &watch, &table),
              FACET_BAD_TABLE);
    CHECK(left <= MANY - TURNS);
}

TEST(bad_tables)
{
    double log_d[5] = {0, 0, 0, 0, 0};
    facet_slope_table *table = (facet_slope_table *)&log_d;
    CHECK_INT(facet_slope_table_create(1, log_d, 3, &table), FACET_BAD_SIZE);
    CHECK(table == NULL);
    CHECK_INT(facet_slope_table_create(1, log_d, FACET_TABLE_NODES_MAX + 1, &table),
              FACET_BAD_SIZE);
    CHECK_INT(facet_slope_table_create(9e-9, log_d, 5, &table), FACET_BAD_TABLE);
    CHECK_INT(facet_slope_table_create(1.1e4, log_d, 5, &table), FACET_BAD_TABLE);
    CHECK_INT(facet_slope_table_create(NAN, log_d, 5, &table), FACET_BAD_TABLE);
    log_d[2] = NAN;
    CHECK_INT(facet_slope_table_create(1, log_d, 5, &table), FACET_BAD_TABLE);
    log_d[2] = INFINITY;
    CHECK_INT(facet_slope_table_create(1, log_d, 5, &table), FACET_BAD_TABLE);
    for (size_t i = 0; i < 5; i++) log_d[i] = -INFINITY;
    CHECK_INT(facet_slope_table_create(1, log_d, 5, &table), FACET_BAD_TABLE);
    CHECK(table == NULL);
    facet_slope_table_destroy(NULL);
}
