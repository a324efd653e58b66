/*
 * Tables over the azimuth: those of a GGX or Beckmann ellipse are that surface, to a measured
 * error; sigma is the integral of the table's own D within what is promised; a radial one is the
 * radial table; samples have the density that is answered.
 */
#include "check.h"
#include "chi_squared.h"
#include "draw.h"
#include "ellipse_rows.h"
#include "gauss.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

/* Something measured: no ellipse, with noise. */
static facet_slope_table *rough_table(double noise)
{
    enum { N = 46, TURNS = 20 };
    double log_d[TURNS][N];
    struct rng rng;
    rng_seed(&rng, 12);
    for (int j = 0; j < TURNS; j++)
        for (int i = 0; i < N; i++) {
            double u = (double)i / (N - 1), phi = PI * j / TURNS;
            log_d[j][i] = -9 * u + u * u * (2 * cos(2 * phi) + cos(4 * phi - 1)) +
                          (i ? noise * (rng_uniform(&rng) - 0.5) : 0);
        }
    facet_slope_table *table = NULL;
    CHECK_INT(facet_slope_table_create_turned(.3, log_d[0], N, TURNS, NULL, &table), FACET_OK);
    return table;
}

static facet_brdf *surface(facet_ndf ndf, const facet_slope_table *table, facet_roughness roughness)
{
    facet_material m = {
        .ndf = ndf, .roughness = roughness, .table = table, .fresnel = {.channels = 1}};
    facet_brdf *brdf = NULL;
    CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
    return brdf;
}

static const facet_roughness ellipse = {.alpha_x = .4, .alpha_y = .1, .rho = .5},
                             even = {.alpha_x = 1, .alpha_y = 1};

enum { PAIRS = 4000 };
struct pairs {
    double v[6][PAIRS];
};

static struct pairs *draw_pairs(void)
{
    struct pairs *p = malloc(sizeof *p);
    struct rng rng;
    rng_seed(&rng, 5);
    for (size_t k = 0; k < PAIRS && p; k++) {
        double wi[3], wo[3];
        draw_direction(&rng, 0.02, wi);
        draw_direction(&rng, 0.02, wo);
        for (int j = 0; j < 3; j++) p->v[j][k] = wi[j], p->v[3 + j][k] = wo[j];
    }
    return p;
}

static void evaluate(const facet_brdf *brdf, const struct pairs *p, facet_quantity quantity,
                     double *out)
{
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    outputs.of[quantity][0] = out;
    CHECK_INT(facet_eval(brdf, FACET_PRECISE, (facet_vec3_in){p->v[0], p->v[1], p->v[2]},
                         (facet_vec3_in){p->v[3], p->v[4], p->v[5]}, PAIRS, &outputs),
              FACET_OK);
}

/* The largest relative difference where D is at least 1e-4 of its peak. */
static double difference(const facet_brdf *a, const facet_brdf *b, const struct pairs *p,
                         facet_quantity quantity)
{
    static double d[PAIRS], x[PAIRS], y[PAIRS];
    double peak = 0, worst = 0;
    evaluate(a, p, FACET_D, d);
    evaluate(a, p, quantity, x);
    evaluate(b, p, quantity, y);
    for (size_t k = 0; k < PAIRS; k++) peak = fmax(peak, d[k]);
    for (size_t k = 0; k < PAIRS; k++)
        if (d[k] > 1e-4 * peak && x[k] > 0) worst = check_worse(worst, fabs(y[k] / x[k] - 1));
    return worst;
}

static void compare(facet_ndf ndf, size_t turns, double d, double sigma)
{
    facet_slope_table *table = ellipse_rows(ndf, &ellipse, 91, turns);
    struct pairs *pairs = draw_pairs();
    facet_brdf *a = surface(ndf, NULL, ellipse),
               *b = table ? surface(FACET_TABULATED, table, even) : NULL;
    if (a && b && pairs) {
        static const facet_quantity asked[] = {FACET_D,   FACET_SIGMA_O, FACET_FR,
                                               FACET_PDF, FACET_G,       FACET_G1_I};
        const double limit[] = {d, sigma, d + 2 * sigma, d + sigma, 3 * sigma, sigma};
        static const char *const names[] = {"D", "sigma", "fr", "pdf", "G", "G1"};
        for (int q = 0; q < 6; q++) {
            double worst = difference(a, b, pairs, asked[q]);
            check_note(names[q], worst);
            if (!(worst <= limit[q]))
                check_fail(__FILE__, __LINE__, "%s differs by %.3g, of ndf %d", names[q], worst,
                           (int)ndf);
        }
    }
    free(pairs);
    facet_brdf_destroy(a);
    facet_brdf_destroy(b);
    facet_slope_table_destroy(table);
}

/* log D of an ellipse of axes 1 : 5 has poles .2 off the real azimuths: 90 rows tell it, 45 hardly. */
TEST(tables_of_ellipses_are_the_ellipses)
{
    compare(FACET_GGX, 90, 1e-5, 5e-7);
    compare(FACET_BECKMANN, 90, 2e-6, 5e-7);
}

TEST(tables_of_fewer_rows_are_the_ellipses)
{
    compare(FACET_GGX, 45, 1e-3, 1e-4);
    compare(FACET_BECKMANN, 45, 2e-6, 1e-6);
}

TEST(a_table_of_equal_rows_is_the_radial_table)
{
    enum { N = 61, TURNS = 5 };
    double log_d[TURNS][N];
    facet_slope_table *turned = NULL, *radial = NULL;
    for (int j = 0; j < TURNS; j++)
        for (int i = 0; i < N; i++) log_d[j][i] = -8. * i / (N - 1) + .4 * sin(.5 * i);
    CHECK_INT(facet_slope_table_create_turned(.4, log_d[0], N, TURNS, NULL, &turned), FACET_OK);
    CHECK_INT(facet_slope_table_create(.4, log_d[0], N, &radial), FACET_OK);
    struct pairs *pairs = draw_pairs();
    facet_brdf *a = radial ? surface(FACET_TABULATED, radial, ellipse) : NULL;
    facet_brdf *b = turned ? surface(FACET_TABULATED, turned, ellipse) : NULL;
    for (int q = 0; q < FACET_QUANTITY_COUNT && a && b && pairs; q++) {
        double worst = difference(a, b, pairs, (facet_quantity)q);
        check_note("of all", worst);
        if (!(worst < 2e-7))
            check_fail(__FILE__, __LINE__, "quantity %d differs by %.3g", q, worst);
    }
    free(pairs);
    facet_brdf_destroy(a);
    facet_brdf_destroy(b);
    facet_slope_table_destroy(turned);
    facet_slope_table_destroy(radial);
}

/* ---- Integrals ------------------------------------------------------------------------------ */

/* P at standard slopes r along azimuths, by the D that eval answers at alpha 1. */
static void densities(const facet_brdf *brdf, const double *r, const double *phi, size_t n,
                      double *p)
{
    double *v = malloc(3 * n * sizeof *v);
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    outputs.of[FACET_D][0] = p;
    for (size_t k = 0; k < n && v; k++) {
        double z = 1 / sqrt(1 + r[k] * r[k]);
        v[k] = r[k] * z * cos(phi[k]), v[n + k] = r[k] * z * sin(phi[k]), v[2 * n + k] = z;
    }
    facet_vec3_in h = {v, v + n, v + 2 * n};
    if (v) CHECK_INT(facet_eval(brdf, FACET_PRECISE, h, h, n, &outputs), FACET_OK);
    for (size_t k = 0; k < n && v; k++)
        p[k] *= v[2 * n + k] * v[2 * n + k] * v[2 * n + k] * v[2 * n + k];
    free(v);
}

/* The integral of (c + s r cos(phi - psi))+ P from u0 to u1 = r/(scale + r), in y = (u - u0)^(1/2),
 * rings cut where it is 0. */
static double visible(const facet_brdf *brdf, double scale, double c, double s, double psi,
                      double u0, double u1)
{
    enum { PARTS = 160, POINTS = 6, TURNS = 512 };
    double node[POINTS], weight[POINTS], sum = 0;
    static double r[POINTS * TURNS], phi[POINTS * TURNS], p[POINTS * TURNS], t[TURNS], w[TURNS];
    facet_gauss_legendre(POINTS, node, weight);
    facet_gauss_legendre(TURNS, t, w);
    for (int part = 0; part < PARTS; part++) {
        double factor[POINTS], end[POINTS];
        for (int k = 0; k < POINTS; k++) {
            double y = (part + node[k]) / PARTS, u = u0 + (u1 - u0) * y * y,
                   ring = scale * u / (1 - u);
            double cosine = s > 0 ? -c / (s * ring) : -1;
            end[k] = cosine > -1 ? cosine < 1 ? acos(cosine) : 0 : PI;
            factor[k] = ring * scale / ((1 - u) * (1 - u)) * (u1 - u0) * 2 * y * weight[k] / PARTS;
            for (int j = 0; j < TURNS; j++)
                r[k * TURNS + j] = ring, phi[k * TURNS + j] = psi + end[k] * (2 * t[j] - 1);
        }
        densities(brdf, r, phi, POINTS * TURNS, p);
        for (int k = 0; k < POINTS * TURNS; k++)
            sum += factor[k / TURNS] * 2 * end[k / TURNS] * w[k % TURNS] * p[k] *
                   (c + s * r[k] * cos(phi[k] - psi));
    }
    return sum;
}

/* The bound is of wo as deep as this. */
static void check_view(facet_brdf *brdf, double scale, double theta, double psi)
{
    double c = cos(theta), s = sin(theta), sigma, bound = 0, o[3] = {s * cos(psi), s * sin(psi), c};
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    outputs.of[FACET_SIGMA_O][0] = &sigma;
    facet_vec3_in wo = {&o[0], &o[1], &o[2]};
    CHECK_INT(facet_eval(brdf, FACET_PRECISE, wo, wo, 1, &outputs), FACET_OK);
    double edge = s > 0 ? fabs(c) / (fabs(c) + s * scale) : 1;
    double exact = (c > 0 ? visible(brdf, scale, c, s, psi, 0, edge) : 0) +
                   (edge < 1 ? visible(brdf, scale, c, s, psi, edge, 1) : 0);
    facet_depth depth = {0, 0, 0};
    facet_depth_survey(brdf, FACET_SAMPLER_AUTO, wo, wo, 1, &depth);
    CHECK(facet_bound(brdf, FACET_PRECISE, FACET_SIGMA_O, 0, &bound));
    bound += facet_depth_error(brdf, FACET_PRECISE, FACET_SIGMA_O, FACET_SAMPLER_AUTO, &depth);
    check_note(c > 0 ? "bound" : "bound behind", bound);
    CHECK(c < 0 || bound < 1e-6);
    check_note(c > 0 ? "of the bound" : "of the bound behind",
               fabs(sigma / exact - 1) / (bound + 3e-8));
    CHECK_REL(sigma, exact, bound + 3e-8, FACET_FLOOR * s * scale);
    if (s == 0) CHECK_REL(exact, 1, 1e-7, 0); /* asked: 1e-6 */
}

static void check_sigma(const facet_slope_table *table, double scale)
{
    static const double views[][2] = {{0, 0},      {.7, 2},    {1.2, .3},
                                      {1.45, 1.1}, {1.55, -2}, {1.5707, 2.9}};
    static const double depths[] = {.02, .3, 1, 2, 4, 8};
    facet_brdf *brdf = table ? surface(FACET_TABULATED, table, even) : NULL;
    for (int v = 0; v < 6 && brdf; v++) {
        check_view(brdf, scale, views[v][0], views[v][1]);
        for (int k = 0; k < 3; k++)
            check_view(brdf, scale, PI / 2 + atan(depths[v] * scale), .2 + 1.1 * k);
    }
    facet_brdf_destroy(brdf);
}

TEST(sigma_is_the_integral_of_the_own_d)
{
    for (int k = 0; k < 2; k++) {
        facet_slope_table *table = ellipse_rows(k ? FACET_BECKMANN : FACET_GGX, &ellipse, 91, 45);
        check_sigma(table, 1.5 * .2);
        facet_slope_table_destroy(table);
    }
    for (int k = 0; k < 3; k++) {
        facet_slope_table *table = rough_table(.3 * k);
        check_sigma(table, .3);
        facet_slope_table_destroy(table);
    }
}

/* ---- Samples -------------------------------------------------------------------------------- */

/* Normals by bins of (u, azimuth) of standard slopes, against D_vis or D h_z summed over them. */
enum { BINS_U = 12, BINS_TURN = 24, BINS = BINS_U * BINS_TURN };

struct scene {
    const facet_brdf *brdf;
    facet_sampler sampler;
    double scale, wo[3];
};

static int bin_of(const struct scene *scene, const double h[3])
{
    double r = hypot(h[0], h[1]) / h[2], u = r / (scene->scale + r),
           turn = atan2(h[1], h[0]) / (2 * PI);
    int i = (int)(u * BINS_U), j = (int)((turn - floor(turn)) * BINS_TURN);
    return (i < BINS_U ? i : BINS_U - 1) * BINS_TURN + (j < BINS_TURN ? j : BINS_TURN - 1);
}

/* The probability of each bin by midpoints: sum of (c + s r cos)+ P, or of P. */
static void expect(const struct scene *scene, double share[BINS])
{
    enum { FINE_U = 360, FINE_TURN = 720 };
    static double r[FINE_TURN], phi[FINE_TURN], p[FINE_TURN];
    double sum = 0;
    for (int k = 0; k < BINS; k++) share[k] = 0;
    for (int i = 0; i < FINE_U; i++) {
        double u = (i + 0.5) / FINE_U, ring = scene->scale * u / (1 - u),
               z = 1 / sqrt(1 + ring * ring);
        for (int j = 0; j < FINE_TURN; j++) r[j] = ring, phi[j] = 2 * PI * (j + 0.5) / FINE_TURN;
        densities(scene->brdf, r, phi, FINE_TURN, p);
        for (int j = 0; j < FINE_TURN; j++) {
            double h[3] = {z * ring * cos(phi[j]), z * ring * sin(phi[j]), z};
            double seen = h[0] * scene->wo[0] + h[1] * scene->wo[1] + h[2] * scene->wo[2];
            double x = p[j] * ring / ((1 - u) * (1 - u)) *
                       (scene->sampler == FACET_SAMPLER_NDF ? 1 : fmax(seen, 0) / z);
            share[bin_of(scene, h)] += x;
            sum += x;
        }
    }
    for (int k = 0; k < BINS; k++) share[k] /= sum;
}

static void check_samples(const struct scene *scene)
{
    enum { ROUNDS = 20, N = 4096 };
    static double count[BINS], share[BINS], u[2][N], wi[3][N], h[3][N], pdf[N], weight[N], again[N],
        o[3][N];
    struct rng rng;
    rng_seed(&rng, 77);
    for (int k = 0; k < BINS; k++) count[k] = 0;
    double bound, total = 0, rounds = ceil(ROUNDS * (double)draw_count(10) / 10);
    CHECK(facet_sample_bound(scene->brdf, FACET_PRECISE, scene->sampler, 0, &bound));
    for (int round_ = 0; round_ < rounds; round_++) {
        for (int k = 0; k < N; k++) {
            u[0][k] = rng_uniform(&rng), u[1][k] = rng_uniform(&rng);
            for (int j = 0; j < 3; j++) o[j][k] = scene->wo[j];
        }
        facet_vec3_in wo = {o[0], o[1], o[2]};
        facet_samples samples = {
            .wi = {wi[0], wi[1], wi[2]}, .h = {h[0], h[1], h[2]}, .weight = {weight}, .pdf = pdf};
        CHECK_INT(
            facet_sample(scene->brdf, FACET_PRECISE, scene->sampler, wo, u[0], u[1], N, &samples),
            FACET_OK);
        CHECK_INT(facet_pdf(scene->brdf, FACET_PRECISE, scene->sampler,
                            (facet_vec3_in){wi[0], wi[1], wi[2]}, wo, N, again),
                  FACET_OK);
        for (int k = 0; k < N; k++) {
            const double at[3] = {h[0][k], h[1][k], h[2][k]};
            count[bin_of(scene, at)]++;
            if (wi[2][k] > .01) CHECK_REL(again[k], pdf[k], 1e-9, 1e-30);
            if (scene->sampler == FACET_SAMPLER_TABLE && !(weight[k] >= 0 && weight[k] <= 1 + 1e-6))
                check_fail(__FILE__, __LINE__, "weight %.17g", weight[k]);
        }
        total += N;
    }
    expect(scene, share);
    double chi = 0, freedom = -1, rest = 0, counted = 0;
    for (int k = 0; k < BINS; k++) {
        double expected = share[k] * total;
        if (expected < 20) {
            rest += expected, counted += count[k];
            continue;
        }
        chi += (count[k] - expected) * (count[k] - expected) / expected;
        freedom++;
    }
    if (rest > 20) chi += (counted - rest) * (counted - rest) / rest, freedom++;
    double tail = chi_squared_tail(chi, freedom);
    check_note("1 - p", 1 - tail);
    if (!(tail > 1e-4))
        check_fail(__FILE__, __LINE__, "chi^2 %.4g of %g: p %.3g, sampler %d, wo.z %g", chi,
                   freedom, tail, (int)scene->sampler, scene->wo[2]);
}

TEST(samples_have_the_density_that_is_answered)
{
    static const double views[][3] = {
        {0, 0, 1}, {.6, 0, .8}, {-.48, .8, .36}, {.28, .959, .043}, {.9, .3, -.1}};
    for (int source = 0; source < 3; source++) {
        facet_slope_table *table = source == 2 ? rough_table(0.2)
                                               : ellipse_rows(source ? FACET_BECKMANN : FACET_GGX,
                                                              &ellipse, 91, 45);
        facet_brdf *brdf = table ? surface(FACET_TABULATED, table, even) : NULL;
        for (int v = 0; v < 6 && brdf; v++) {
            if (draw_count(1) == 1 && (source + v) % 2) continue; /* all in a longer run */
            struct scene scene = {
                brdf, v == 5 ? FACET_SAMPLER_NDF : FACET_SAMPLER_TABLE, .3, {0, 0, 1}};
            memcpy(scene.wo, views[v % 5], sizeof scene.wo);
            check_samples(&scene);
        }
        facet_brdf_destroy(brdf);
        facet_slope_table_destroy(table);
    }
}

/* How far the stretching of u at a random place is from the density that is answered there. */
static double stretched(const facet_brdf *brdf, struct rng *rng)
{
    const double step = 1e-7, p = .02 + .96 * rng_uniform(rng), q = .02 + .96 * rng_uniform(rng);
    const double theta = 1.3 * rng_uniform(rng), phi = 6 * rng_uniform(rng);
    const double u1[3] = {p, p + step, p}, u2[3] = {q, q, q + step};
    double o[3][3], h[3][3], wi[3][3], pdf[3], d[2][3], dot = 0;
    for (int k = 0; k < 3; k++)
        o[0][k] = sin(theta) * cos(phi), o[1][k] = sin(theta) * sin(phi), o[2][k] = cos(theta);
    facet_samples samples = {.wi = {wi[0], wi[1], wi[2]}, .h = {h[0], h[1], h[2]}, .pdf = pdf};
    CHECK_INT(facet_sample(brdf, FACET_PRECISE, FACET_SAMPLER_TABLE,
                           (facet_vec3_in){o[0], o[1], o[2]}, u1, u2, 3, &samples),
              FACET_OK);
    for (int e = 0; e < 2; e++)
        for (int j = 0; j < 3; j++) d[e][j] = (h[j][e + 1] - h[j][0]) / step;
    double x = d[0][1] * d[1][2] - d[0][2] * d[1][1], y = d[0][2] * d[1][0] - d[0][0] * d[1][2],
           z = d[0][0] * d[1][1] - d[0][1] * d[1][0];
    for (int j = 0; j < 3; j++) dot += h[j][0] * o[j][0];
    return fabs(pdf[0] * 4 * dot * sqrt(x * x + y * y + z * z) - 1); /* d wi = 4 wo.h d h */
}

/* The map itself, not its histogram; of which difference quotients leave some. */
TEST(the_map_has_the_density)
{
    static const double limit[] = {2e-5, 2e-5};
    static const char *const name[] = {"smooth", "steep"};
    for (int k = 0; k < 2; k++) {
        facet_slope_table *table = k ? ellipse_rows(FACET_BECKMANN, &ellipse, 91, 45)
                                     : rough_table(0);
        facet_brdf *brdf = table ? surface(FACET_TABULATED, table, even) : NULL;
        struct rng rng;
        rng_seed(&rng, 3);
        double worst = 0;
        for (int n = 0; n < 2000 && brdf; n++) worst = check_worse(worst, stretched(brdf, &rng));
        check_note(name[k], worst);
        CHECK(worst < limit[k]);
        facet_brdf_destroy(brdf);
        facet_slope_table_destroy(table);
    }
}

/* ---- Refused -------------------------------------------------------------------------------- */

TEST(what_is_no_table_is_refused)
{
    double log_d[5][6] = {{0}};
    facet_slope_table *table;
    CHECK_INT(facet_slope_table_create_turned(.3, log_d[0], 3, 5, NULL, &table), FACET_BAD_SIZE);
    CHECK_INT(facet_slope_table_create_turned(.3, log_d[0], 6, 3, NULL, &table), FACET_BAD_SIZE);
    CHECK_INT(
        facet_slope_table_create_turned(.3, log_d[0], 6, FACET_TABLE_TURNS_MAX + 1, NULL, &table),
        FACET_BAD_SIZE);
    CHECK_INT(
        facet_slope_table_create_turned(.3, log_d[0], FACET_TURNED_NODES_MAX, 5, NULL, &table),
        FACET_BAD_SIZE);
    CHECK_INT(facet_slope_table_create_turned(0, log_d[0], 6, 5, NULL, &table), FACET_BAD_TABLE);
    log_d[2][0] = 1e-9;
    CHECK_INT(facet_slope_table_create_turned(.3, log_d[0], 6, 5, NULL, &table), FACET_BAD_TABLE);
    log_d[2][0] = 0, log_d[2][3] = NAN;
    CHECK_INT(facet_slope_table_create_turned(.3, log_d[0], 6, 5, NULL, &table), FACET_BAD_TABLE);
    log_d[2][3] = 0;
    CHECK_INT(facet_slope_table_create_turned(.3, log_d[0], 6, 5, NULL, &table), FACET_OK);
    facet_slope_table_destroy(table);
}

/* Gaps, cliffs, spikes, a horizon that is all there is: finite and no less than 0. */
TEST(wild_tables_answer_numbers)
{
    struct rng rng;
    rng_seed(&rng, 9);
    for (size_t round_ = draw_count(4); round_--;) {
        enum { N = 12, TURNS = 7 };
        double log_d[TURNS][N];
        for (int k = 0; k < TURNS * N; k++) {
            double x = rng_uniform(&rng);
            log_d[k / N][k % N] = x < .2   ? -2000
                                  : x < .3 ? 200 * rng_uniform(&rng)
                                           : -30 * rng_uniform(&rng);
        }
        for (int j = 0; j < TURNS; j++) log_d[j][0] = log_d[0][0];
        facet_slope_table *table = NULL;
        facet_status status = facet_slope_table_create_turned(pow(10, -3 + 4 * rng_uniform(&rng)),
                                                              log_d[0], N, TURNS, NULL, &table);
        CHECK(status == FACET_OK || status == FACET_BAD_TABLE);
        facet_roughness leaning = ellipse;
        if (round_ % 2) leaning.slope_x = .4, leaning.slope_y = -.1;
        facet_brdf *brdf = table ? surface(FACET_TABULATED, table, leaning) : NULL;
        struct pairs *pairs = brdf ? draw_pairs() : NULL;
        for (int k = 0; k < PAIRS && pairs; k += 3) pairs->v[5][k] *= -1;
        static double y[PAIRS], u[PAIRS], wi[3][PAIRS], weight[PAIRS];
        for (int q = 0; q < FACET_QUANTITY_COUNT && pairs; q++) {
            evaluate(brdf, pairs, (facet_quantity)q, y);
            for (int k = 0; k < PAIRS; k++)
                if (!(y[k] >= 0 && y[k] < INFINITY))
                    check_fail(__FILE__, __LINE__, "quantity %d is %g", q, y[k]);
        }
        if (pairs) {
            static double v[PAIRS];
            for (int k = 0; k < PAIRS; k++) u[k] = (k % 50) / 50., v[k] = fabs(pairs->v[5][k]);
            facet_samples samples = {.wi = {wi[0], wi[1], wi[2]}, .weight = {weight}, .pdf = y};
            CHECK_INT(facet_sample(brdf, FACET_PRECISE, FACET_SAMPLER_AUTO,
                                   (facet_vec3_in){pairs->v[3], pairs->v[4], pairs->v[5]}, u, v, 64,
                                   &samples),
                      FACET_OK);
            for (int k = 0; k < 64; k++)
                if (!(isfinite(wi[0][k] + wi[1][k] + wi[2][k] + weight[k] + y[k]) && y[k] >= 0))
                    check_fail(__FILE__, __LINE__, "sample %d", k);
        }
        free(pairs);
        facet_brdf_destroy(brdf);
        facet_slope_table_destroy(table);
    }
}
