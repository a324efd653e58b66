/*
 * Samples of tables over the azimuth against the density that eval answers: Kolmogorov-Smirnov by
 * deterministic quantiles, azimuth by azimuth and along them.
 */
#include "check.h"
#include "draw.h"
#include "ellipse_rows.h"
#include "gauss.h"
#include "scene.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

enum { QUANTILES = 100, POINTS = 4, PANELS_U = 240, PANELS_TURN = 360 };

/* u1: its azimuths around the axis from which the sampler counts them. */
struct places {
    double u1[QUANTILES], u2[QUANTILES], u[QUANTILES], phi[QUANTILES];
};

static void find_places(const struct scene *scene, struct places *p)
{
    static double h[3][SCENE_MAX], wi[3][SCENE_MAX], pdf[QUANTILES];
    for (int k = 0; k < QUANTILES; k++) {
        p->u1[k] = (k + 0.5) / QUANTILES;
        p->u2[k] = fmod(0.5 + 0.618033988749895 * k, 1);
    }
    scene_draw(scene, FACET_SAMPLER_TABLE, p->u1, p->u2, QUANTILES, h, wi, pdf);
    for (int k = 0; k < QUANTILES; k++) {
        double slope[2];
        scene_slopes(scene, (double[3]){h[0][k], h[1][k], h[2][k]}, slope);
        double r = hypot(slope[0], slope[1]),
               phi = atan2(slope[1], slope[0]) + atan2(scene->cb, scene->ca);
        p->u[k] = r / (scene->scale + r);
        p->phi[k] = phi - 2 * PI * floor(phi / (2 * PI));
    }
}

/* Probability per azimuth of slopes from u0 to u1, u = r/(scale + r). */
static double along(const struct scene *scene, double phi, double u0, double u1)
{
    static double radius[SCENE_MAX], turn[SCENE_MAX], value[SCENE_MAX], weigh[SCENE_MAX];
    double node[POINTS], weight[POINTS], sum = 0, b = scene->scale;
    if (!(u1 > u0)) return 0;
    facet_gauss_legendre(POINTS, node, weight);
    int panels = 1 + (int)((u1 - u0) * PANELS_U), n = 0;
    for (int k = 0; k < panels * POINTS; k++) {
        double u = u0 + (u1 - u0) * (k / POINTS + node[k % POINTS]) / panels;
        radius[n] = b * u / (1 - u);
        turn[n] = phi - atan2(scene->cb, scene->ca);
        weigh[n] = radius[n] * b / ((1 - u) * (1 - u)) * weight[k % POINTS] * (u1 - u0) / panels;
        if (++n < SCENE_MAX && k + 1 < panels * POINTS) continue;
        scene_densities(scene, radius, turn, (size_t)n, value);
        while (n > 0) n--, sum += value[n] * weigh[n];
    }
    return sum;
}

/* The slopes seen at an azimuth: u from .. to. */
static void seen(const struct scene *scene, double phi, double *from, double *to)
{
    double g = scene->s * cos(phi - atan2(scene->cb, scene->ca)), b = scene->scale;
    double end = g != 0 ? scene->c / (scene->c - b * g) : -1; /* r = -c/g */
    *from = scene->c < 0 ? g > 0 ? end : 1 : 0;
    *to = scene->c >= 0 && g < 0 ? end : 1;
}

static double around(const struct scene *scene, double phi0, double phi1)
{
    double node[POINTS], weight[POINTS], sum = 0;
    facet_gauss_legendre(POINTS, node, weight);
    int panels = 1 + (int)((phi1 - phi0) / (2 * PI) * PANELS_TURN);
    for (int k = 0; k < panels * POINTS; k++) {
        double phi = phi0 + (phi1 - phi0) * (k / POINTS + node[k % POINTS]) / panels, from, to;
        seen(scene, phi, &from, &to);
        sum += weight[k % POINTS] * (phi1 - phi0) / panels * along(scene, phi, from, to);
    }
    return sum;
}

/* CDF of azimuths at the quantiles of u1, and of the places along each at one u2. */
static double distance_of(const struct scene *scene)
{
    struct places p;
    double worst[2] = {0}, below = 0, at = 0;
    find_places(scene, &p);
    for (int k = 0; k <= QUANTILES; k++) {
        below += around(scene, at, k < QUANTILES ? p.phi[k] : 2 * PI);
        worst[0] = check_worse(worst[0], fabs(below - (k < QUANTILES ? p.u1[k] : 1)));
        if (k == QUANTILES) break;
        double from, to;
        at = p.phi[k];
        seen(scene, at, &from, &to);
        double inside = along(scene, at, from, p.u[k]), beyond = along(scene, at, p.u[k], to);
        worst[1] = check_worse(worst[1], fabs(inside / (inside + beyond) - p.u2[k]));
    }
    check_note("azimuth", worst[0]);
    check_note("along", worst[1]);
    return check_worse(worst[0], worst[1]);
}

static void check_scene(const struct scene *scene, facet_ndf ndf, double alpha)
{
    double distance = distance_of(scene);
    check_note("Kolmogorov-Smirnov", distance);
    if (!(distance <= 1e-6))
        check_fail(__FILE__, __LINE__, "ndf %d: %.3g, alpha %g, wo_z %g, c %g, s %g", (int)ndf,
                   distance, alpha, scene->wo[2], scene->c, scene->s);
}

static const double alphas[] = {0.001, 0.03, 0.3, 1};
static const double views[] = {0, 0.7, 1.4, 1.5691};

static const facet_roughness shapes[] = {
    {.alpha_x = 1, .alpha_y = 1},
    {.alpha_x = 0.5, .alpha_y = 2, .rho = 0.7},
    {.alpha_x = 1, .alpha_y = 1, .slope_x = 0.4, .slope_y = -0.3},
    {.alpha_x = 1.5, .alpha_y = 0.7, .rho = -0.5, .slope_x = -1, .slope_y = 0.5},
};

TEST(samples_have_the_density_that_eval_answers)
{
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
        for (int a = 0; a < 4; a++) {
            facet_roughness e = {.alpha_x = 2 * alphas[a], .alpha_y = alphas[a] / 2, .rho = 0.5};
            facet_slope_table *table = ellipse_rows((facet_ndf)ndf, &e, 91, 90);
            for (size_t s = 0; s < 4 && table; s++) {
                if (draw_count(1) == 1 && (2 * ndf + a + (int)s) % 4)
                    continue; /* all in a longer run */
                facet_material m = {.ndf = FACET_TABULATED,
                                    .roughness = shapes[s],
                                    .table = table,
                                    .fresnel = {.channels = 1}};
                m.roughness.slope_x *= alphas[a], m.roughness.slope_y *= alphas[a];
                facet_brdf *brdf = NULL;
                CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
                struct scene scene = {
                    .brdf = brdf, .r = m.roughness, .scale = ellipse_rows_scale(&e)};
                for (size_t v = 0; v < 6 && brdf; v++) {
                    static const double depths[] = {1, 3};
                    double below = PI / 2 + atan(depths[v % 2] * alphas[a]);
                    scene_look_from(&scene, v < 4 ? views[v] : below, 0.3 + (double)v);
                    check_scene(&scene, (facet_ndf)ndf, alphas[a]);
                }
                facet_brdf_destroy(brdf);
            }
            facet_slope_table_destroy(table);
        }
    }
}
