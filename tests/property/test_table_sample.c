/* Samples of tabulated materials against the density that eval answers: Kolmogorov-Smirnov by
 * deterministic quantiles, ring by ring and along rings. */
#include "check.h"
#include "draw.h"
#include "facet_table.h"
#include "gauss.h"
#include "rng.h"
#include "scene.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

enum { NODES = 360, QUANTILES = 100, POINTS = 10, TURNS = 16 };

static facet_slope_table *table_of(facet_ndf ndf, double alpha)
{
    static double log_d[NODES];
    double scale = 1.5 * alpha;
    facet_slope_table *table = NULL;
    for (int k = 0; k < NODES; k++) {
        double u = (double)k / (NODES - 1), r = scale * u / (1 - u), x = r / alpha;
        log_d[k] = 2 * log1p(r * r) - (ndf == FACET_GGX ? 2 * log1p(x * x) : x * x);
        if (k == NODES - 1) log_d[k] = ndf == FACET_GGX ? 4 * log(alpha) : -1e4;
    }
    CHECK_INT(facet_slope_table_create(scale, log_d, NODES, &table), FACET_OK);
    return table;
}

/* Probability of the rings from u0 to u1, u = r/(scale + r). */
static double rings(const struct scene *scene, double u0, double u1)
{
    double node[POINTS], weight[POINTS], t[TURNS], w[TURNS], sum = 0;
    static double radius[POINTS * TURNS], turn[POINTS * TURNS], value[POINTS * TURNS];
    facet_gauss_legendre(POINTS, node, weight);
    facet_gauss_legendre(TURNS, t, w);
    double b = scene->scale, end[POINTS];
    for (int p = 0; p < POINTS; p++) {
        double u = u0 + (u1 - u0) * node[p], r = b * u / (1 - u);
        end[p] = scene_turn_end(scene, r);
        for (int k = 0; k < TURNS; k++)
            radius[p * TURNS + k] = r, turn[p * TURNS + k] = end[p] * t[k];
    }
    scene_densities(scene, radius, turn, POINTS * TURNS, value);
    for (int p = 0; p < POINTS; p++) {
        double u = u0 + (u1 - u0) * node[p], r = b * u / (1 - u), ring = 0;
        for (int k = 0; k < TURNS; k++) ring += value[p * TURNS + k] * w[k] * 2 * end[p];
        sum += ring * r * b / ((1 - u) * (1 - u)) * weight[p] * (u1 - u0);
    }
    return sum;
}

/* The same, split at v = |c|/s, where rings begin to be seen in part, and elsewhere. */
static double probability(const struct scene *scene, double u0, double u1)
{
    double v = fabs(scene->c) / scene->s, uv = scene->s > 0 ? v / (scene->scale + v) : 1, sum = 0;
    enum { PARTS = 24 };
    for (int half = 0; half < 2; half++) {
        double a = half ? fmax(u0, uv) : u0, e = half ? u1 : fmin(u1, uv);
        if (!(e > a)) continue;
        int parts = 1 + (int)((e - a) * NODES * 2);
        parts = parts > 60 * PARTS ? 60 * PARTS : parts;
        /* in the square of a variable that grows from v: rings leave it like (r - v)^(1/2) */
        for (int k = 0; k < parts; k++) {
            double from = (double)k / parts, to = (k + 1.0) / parts;
            if (half) from *= from, to *= to;
            sum += rings(scene, a + (e - a) * from, a + (e - a) * to);
        }
    }
    return sum;
}

/* CDF of rings at the quantiles of u1, and of the places along each at one u2. */
static double ring_distance(const struct scene *scene, const double *u1, const double *u2,
                            const double h[3][SCENE_MAX])
{
    double worst = 0, below = 0, at = 0;
    for (size_t k = 0; k <= QUANTILES; k++) {
        double slope[2] = {INFINITY, 0};
        if (k < QUANTILES) scene_slopes(scene, (double[3]){h[0][k], h[1][k], h[2][k]}, slope);
        double r = hypot(slope[0], slope[1]), u = k < QUANTILES ? r / (scene->scale + r) : 1;
        below += probability(scene, at, u);
        at = u;
        worst = check_worse(worst, fabs(below - (k < QUANTILES ? u1[k] : 1)));
        if (k == QUANTILES || k == 0) continue; /* the first ring is a point, or seen in one */
        double c = scene->c, s = scene->s * r, end = scene_turn_end(scene, r),
               phi = atan2(slope[1], slope[0]);
        double share = (c * phi + s * sin(phi)) / (c * end + s * sin(end)) / 2 + 0.5;
        worst = check_worse(worst, fabs(share - u2[k]));
    }
    return worst;
}

/* against: whose pdf the samples have; bound: of the two. */
static void check_scene(struct scene *scene, facet_sampler against, double bound, const char *name)
{
    static double u1[QUANTILES], u2[QUANTILES], h[3][SCENE_MAX], wi[3][SCENE_MAX], pdf[QUANTILES],
        again[QUANTILES], o[3][QUANTILES];
    for (int k = 0; k < QUANTILES; k++) {
        u1[k] = (double)k / QUANTILES; /* 0 included */
        if (k == QUANTILES - 1) u1[k] = 1 - 1e-9;
        u2[k] = fmod(0.5 + 0.618033988749895 * k, 1);
        for (int j = 0; j < 3; j++) o[j][k] = scene->wo[j];
    }
    scene_draw(scene, FACET_SAMPLER_TABLE, u1, u2, QUANTILES, h, wi, pdf);
    size_t compared = 0;
    double distance = ring_distance(scene, u1, u2, h);
    check_note("Kolmogorov-Smirnov", distance);
    if (!(distance <= 1e-8)) /* asked: 1e-6 */
        check_fail(__FILE__, __LINE__, "%s: distance %.3g, scale %g, wo_z %g, c %g, s %g", name,
                   distance, scene->scale, scene->wo[2], scene->c, scene->s);
    CHECK_INT(facet_pdf(scene->brdf, FACET_PRECISE, against, (facet_vec3_in){wi[0], wi[1], wi[2]},
                        (facet_vec3_in){o[0], o[1], o[2]}, QUANTILES, again),
              FACET_OK);
    for (int k = 0; k < QUANTILES; k++) {
        double dot = 0, flat = 0;
        for (int j = 0; j < 3; j++) dot += scene->wo[j] * h[j][k], flat += wi[j][k] * wi[j][k];
        CHECK(isfinite(pdf[k]) && fabs(flat - 1) < 1e-12);
        /* wi is rounded, which moves its density where wo.h is small and lobes are narrow */
        double moves = 1e-14 /
                       (fabs(dot) * scene->scale * fmin(scene->r.alpha_x, scene->r.alpha_y));
        if (!(moves < 1e-7)) continue;
        CHECK_REL(again[k], pdf[k], bound + moves, 1e-20);
        compared++;
    }
    CHECK(compared >= QUANTILES / 2);
}

static const facet_roughness shapes[] = {
    {.alpha_x = 1, .alpha_y = 1},
    {.alpha_x = 0.5, .alpha_y = 2, .rho = 0.7},
    {.alpha_x = 1, .alpha_y = 1, .slope_x = 0.4, .slope_y = -0.3},
    {.alpha_x = 1.5, .alpha_y = 0.7, .rho = -0.5, .slope_x = -1, .slope_y = 0.5},
};
static const double alphas[] = {0.001, 0.03, 0.3, 1};
static const double views[] = {0, 0.7, 1.4, 1.5691};

TEST(samples_have_the_density_that_eval_answers)
{
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
        for (size_t a = 0; a < 4; a++) {
            facet_slope_table *table = table_of((facet_ndf)ndf, alphas[a]);
            for (size_t s = 0; s < 4 && table; s++) {
                facet_material m = {.ndf = FACET_TABULATED, .roughness = shapes[s], .table = table};
                if (s >= 2) m.roughness.slope_x *= alphas[a], m.roughness.slope_y *= alphas[a];
                facet_brdf *brdf = NULL;
                m.fresnel.channels = 1;
                CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
                struct scene scene = {.brdf = brdf, .r = m.roughness, .scale = 1.5 * alphas[a]};
                for (size_t v = 0; v < 4 && brdf; v++) {
                    scene_look_from(&scene, views[v], 0.3 + (double)v);
                    check_scene(&scene, FACET_SAMPLER_AUTO, 1e-8,
                                ndf == FACET_GGX ? "ggx" : "beckmann");
                }
                facet_brdf_destroy(brdf);
            }
            facet_slope_table_destroy(table);
        }
    }
}

/* GGX and Beckmann by tables of their own, against eval's density and against the table's. */
TEST(closed_distributions_by_their_tables)
{
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
        for (size_t s = 0; s < 4; s++) {
            facet_material m = {.ndf = (facet_ndf)ndf, .roughness = shapes[s]};
            m.roughness.alpha_x *= 0.3, m.roughness.alpha_y *= 0.3;
            m.fresnel.channels = 1;
            facet_brdf *brdf = NULL;
            CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
            struct scene scene = {
                .brdf = brdf, .r = m.roughness, .scale = ndf == FACET_GGX ? 1 : 8};
            for (size_t v = 0; v < 4 && brdf; v++) {
                scene_look_from(&scene, views[v], 0.3 + (double)v);
                check_scene(&scene, FACET_SAMPLER_TABLE, 1e-8, "a table of its own");
                check_scene(&scene, facet_sampler_visible(m.ndf), 4e-8, "a table of its own");
            }
            double bound;
            CHECK(!facet_sample_bound(brdf, FACET_FAST, FACET_SAMPLER_TABLE, 0, &bound));
            CHECK(facet_sample_bound(brdf, FACET_PRECISE, FACET_SAMPLER_TABLE, 0, &bound) &&
                  bound < 3e-7);
            facet_brdf_destroy(brdf);
        }
    }
}

/* All normals: the ring of GGX's table with u1 of them inside is GGX's own, and both densities agree. */
TEST(all_normals_are_those_of_the_source)
{
    static double u1[QUANTILES], u2[QUANTILES], h[3][SCENE_MAX], wi[3][SCENE_MAX], pdf[QUANTILES],
        again[QUANTILES], o[3][QUANTILES];
    facet_slope_table *table = table_of(FACET_GGX, 0.3);
    facet_material m = {
        .ndf = FACET_TABULATED,
        .roughness = {.alpha_x = 0.5, .alpha_y = 2, .rho = 0.7, .slope_x = 0.1, .slope_y = -0.2},
        .table = table};
    facet_brdf *brdf = NULL;
    m.fresnel.channels = 1;
    CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
    if (!brdf) return;
    struct scene scene = {.brdf = brdf, .r = m.roughness, .scale = 0.45};
    size_t compared = 0;
    scene_look_from(&scene, 0.7, 2);
    for (int k = 0; k < QUANTILES; k++) {
        u1[k] = k == QUANTILES - 1 ? 1 - 1e-9 : (double)k / QUANTILES;
        u2[k] = fmod(0.618033988749895 * k, 1);
        for (int j = 0; j < 3; j++) o[j][k] = scene.wo[j];
    }
    scene_draw(&scene, FACET_SAMPLER_NDF, u1, u2, QUANTILES, h, wi, pdf);
    CHECK_INT(facet_pdf(brdf, FACET_PRECISE, FACET_SAMPLER_NDF,
                        (facet_vec3_in){wi[0], wi[1], wi[2]}, (facet_vec3_in){o[0], o[1], o[2]},
                        QUANTILES, again),
              FACET_OK);
    for (int k = 0; k < QUANTILES; k++) {
        double slope[2], dot = 0;
        scene_slopes(&scene, (double[3]){h[0][k], h[1][k], h[2][k]}, slope);
        double x2 = (slope[0] * slope[0] + slope[1] * slope[1]) / 0.09;
        CHECK(fabs(x2 / (1 + x2) - u1[k]) < 1e-6);
        for (int j = 0; j < 3; j++) dot += scene.wo[j] * h[j][k];
        if (!(fabs(dot) > 1e-3)) continue;
        CHECK_REL(again[k], pdf[k], 1e-9, 1e-20);
        compared++;
    }
    CHECK(compared >= QUANTILES / 2);
    facet_brdf_destroy(brdf);
    facet_slope_table_destroy(table);
}

/* Whatever a table may hold: gaps, cliffs, noise. */
static facet_slope_table *any_table(struct rng *rng, double *scale)
{
    double log_d[48];
    size_t n = 4 + (size_t)(rng_uniform(rng) * 44);
    double height = rng_log(rng, 0.1, 600);
    for (size_t i = 0; i < n; i++)
        log_d[i] = rng_uniform(rng) < 0.1 ? -1e4 : (rng_uniform(rng) - 0.5) * height;
    log_d[(size_t)(rng_uniform(rng) * (double)(n - 1))] = 1;
    facet_slope_table *table = NULL;
    *scale = rng_log(rng, 1e-8, 1e4);
    facet_status status = facet_slope_table_create(*scale, log_d, n, &table);
    CHECK(status == FACET_OK || status == FACET_BAD_TABLE);
    return table;
}

/* Its own table tells Beckmann's tail as far behind as it says, and how well. */
TEST(beckmann_from_behind_by_its_table)
{
    enum { N = 64 };
    CHECK_INT(facet_sampler_prepare(FACET_SAMPLER_TABLE, FACET_BECKMANN), FACET_OK);
    for (double v = 1; v < 26; v += .7) {
        facet_material m = {.ndf = FACET_BECKMANN,
                            .roughness = {.alpha_x = .01, .alpha_y = .01, .slope_x = .01 * v},
                            .fresnel = {.channels = 1}};
        static double o[3][N], wi[3][N], u[2][N], by_table[N], by_slope[N];
        facet_samples out = {.wi = {wi[0], wi[1], wi[2]}};
        const facet_vec3_in from = {o[0], o[1], o[2]}, to = {wi[0], wi[1], wi[2]};
        facet_brdf *brdf = NULL;
        facet_depth depth = {0, 0, 0};
        double bound = 0, own = 0;
        for (int k = 0; k < N; k++) o[0][k] = 1, u[0][k] = (k + .5) / N, u[1][k] = .3;
        u[0][N - 1] = 1 - 0x1p-53;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        facet_sample(brdf, FACET_PRECISE, FACET_SAMPLER_SLOPE, from, u[0], u[1], N, &out);
        facet_pdf(brdf, FACET_PRECISE, FACET_SAMPLER_TABLE, to, from, N, by_table);
        facet_pdf(brdf, FACET_PRECISE, FACET_SAMPLER_SLOPE, to, from, N, by_slope);
        facet_depth_survey(brdf, FACET_SAMPLER_TABLE, to, from, N, &depth);
        CHECK_REL(depth.wo, v, 1e-12, 0);
        CHECK(facet_pdf_bound(brdf, FACET_PRECISE, FACET_SAMPLER_TABLE, 0, &bound));
        CHECK(facet_pdf_bound(brdf, FACET_PRECISE, FACET_SAMPLER_SLOPE, 0, &own));
        bound += own +
                 facet_depth_error(brdf, FACET_PRECISE, FACET_PDF, FACET_SAMPLER_TABLE, &depth);
        CHECK(v < 23.6 ? bound < 2e-6 : v < 24.1 || bound == INFINITY);
        for (int k = 0; k < N && bound < 1; k++) CHECK_REL(by_table[k], by_slope[k], bound, 0);
        depth = (facet_depth){0, 0, 0};
        facet_depth_survey(brdf, FACET_SAMPLER_SLOPE, to, from, N, &depth);
        CHECK(depth.wo == 0 &&
              facet_depth_error(brdf, FACET_PRECISE, FACET_PDF, FACET_SAMPLER_SLOPE, &depth) == 0);
        facet_brdf_destroy(brdf);
    }
}

/* Visible normals are all there are, from however far behind: within what is said of that depth. */
TEST(visible_normals_from_far_behind)
{
    static const double depths[] = {3, 7.9, 9, 15, 23};
    facet_slope_table *table = table_of(FACET_BECKMANN, .3);
    for (size_t k = 0; k < sizeof depths / sizeof *depths && table; k++) {
        facet_material m = {.ndf = FACET_TABULATED,
                            .table = table,
                            .roughness = {.alpha_x = 1, .alpha_y = 1, .slope_x = .3 * depths[k]},
                            .fresnel = {.channels = 1}};
        struct scene scene = {.r = m.roughness, .scale = .45};
        facet_brdf *brdf = NULL;
        double bound = 0;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        scene.brdf = brdf;
        scene_look_from(&scene, PI / 2, 0);
        facet_depth depth = {.wo = -scene.c / scene.s};
        CHECK(facet_bound(brdf, FACET_PRECISE, FACET_D_VIS, 0, &bound));
        bound += facet_depth_error(brdf, FACET_PRECISE, FACET_D_VIS, FACET_SAMPLER_AUTO, &depth);
        CHECK(bound < 1e-4);
        CHECK_REL(probability(&scene, 0, 1), 1, bound, 0);
        facet_brdf_destroy(brdf);
    }
    facet_slope_table_destroy(table);
}

TEST(any_table_any_view_any_u)
{
    enum { N = 48 };
    static const double ends[] = {0, 0x1p-53, 0x1p-1074, 0.5, 1 - 0x1p-53};
    static double o[3][N], wi[3][N], h[3][N], pdf[N], weight[N], u[2][N];
    struct rng rng;
    size_t rounds = draw_count(40), ran = 0;
    rng_seed(&rng, 77);
    for (size_t round = 0; round < rounds; round++) {
        double scale;
        facet_slope_table *table = any_table(&rng, &scale);
        if (!table) continue;
        facet_material m = {.ndf = FACET_TABULATED, .table = table};
        draw_roughness(&rng, &draw_everywhere, &m.roughness);
        m.fresnel.channels = 1;
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        ran += brdf != NULL;
        for (int k = 0; k < N && brdf; k++) {
            double wo[3];
            draw_direction(&rng, rng_uniform(&rng) < 0.5 ? 0.05 : 1e-9, wo);
            if (rng_uniform(&rng) < 0.2) wo[2] = -wo[2];
            for (int j = 0; j < 3; j++) o[j][k] = k < 2 ? (j == 2) * (k ? -1 : 1) : wo[j];
            for (int j = 0; j < 2; j++)
                u[j][k] = rng_uniform(&rng) < 0.5 ? rng_uniform(&rng)
                                                  : ends[(size_t)(rng_uniform(&rng) * 5)];
        }
        facet_sampler sampler = rng_uniform(&rng) < 0.8 ? FACET_SAMPLER_TABLE : FACET_SAMPLER_NDF;
        facet_samples out = {{wi[0], wi[1], wi[2]}, {h[0], h[1], h[2]}, {weight}, pdf};
        if (brdf)
            CHECK_INT(facet_sample(brdf, FACET_PRECISE, sampler, (facet_vec3_in){o[0], o[1], o[2]},
                                   u[0], u[1], N, &out),
                      FACET_OK);
        for (int k = 0; k < N && brdf; k++) {
            double size = 0, wo = 0;
            for (int j = 0; j < 3; j++) size += wi[j][k] * wi[j][k], wo += o[j][k] * o[j][k];
            bool good = fabs(size / wo - 1) < 1e-9 && h[2][k] >= 0 && pdf[k] >= 0 &&
                        pdf[k] <= DBL_MAX && weight[k] >= 0 && weight[k] <= DBL_MAX &&
                        (wi[2][k] > 0 || weight[k] == 0);
            if (!good)
                check_fail(
                    __FILE__, __LINE__,
                    "%s: wi (%g, %g, %g) h_z %g pdf %g weight %g from wo (%.17g, %.17g, %.17g) u (%.17g, %.17g) scale %g: %s",
                    facet_sampler_name(sampler), wi[0][k], wi[1][k], wi[2][k], h[2][k], pdf[k],
                    weight[k], o[0][k], o[1][k], o[2][k], u[0][k], u[1][k], scale, draw_text(&m));
        }
        facet_brdf_destroy(brdf);
        facet_slope_table_destroy(table);
    }
    check_note("of all", (double)ran / (double)rounds);
    CHECK(4 * ran >= rounds);
}
