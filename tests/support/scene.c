#include "scene.h"

#include "check.h"

#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846

static double kappa(const facet_roughness *r)
{
    return sqrt((1 - r->rho) * (1 + r->rho));
}

void scene_look_from(struct scene *scene, double theta, double phi)
{
    const facet_roughness *r = &scene->r;
    double *wo = scene->wo;
    wo[0] = sin(theta) * cos(phi), wo[1] = sin(theta) * sin(phi), wo[2] = cos(theta);
    double a = r->alpha_x * wo[0] + r->rho * r->alpha_y * wo[1], b = kappa(r) * r->alpha_y * wo[1];
    scene->s = hypot(a, b);
    scene->c = wo[2] - wo[0] * r->slope_x - wo[1] * r->slope_y;
    scene->ca = scene->s > 0 ? a / scene->s : 1;
    scene->cb = scene->s > 0 ? b / scene->s : 0;
}

void scene_slopes(const struct scene *scene, const double h[3], double slope[2])
{
    const facet_roughness *r = &scene->r;
    double x = (-h[0] / h[2] - r->slope_x) / r->alpha_x;
    double y = ((-h[1] / h[2] - r->slope_y) / r->alpha_y - r->rho * x) / kappa(r);
    slope[0] = -(x * scene->ca + y * scene->cb);
    slope[1] = -(y * scene->ca - x * scene->cb);
}

void scene_densities(const struct scene *scene, const double *radius, const double *turn, size_t n,
                     double *out)
{
    static double i[3][SCENE_MAX], o[3][SCENE_MAX], z[SCENE_MAX];
    const facet_roughness *r = &scene->r;
    for (size_t k = 0; k < n; k++) {
        double along = radius[k] * cos(turn[k]), across = radius[k] * sin(turn[k]);
        double x = -(along * scene->ca - across * scene->cb),
               y = -(along * scene->cb + across * scene->ca);
        double h[3] = {-(r->alpha_x * x + r->slope_x),
                       -(r->alpha_y * (r->rho * x + kappa(r) * y) + r->slope_y), 1};
        double length = sqrt(h[0] * h[0] + h[1] * h[1] + 1), dot = 0;
        for (int j = 0; j < 3; j++) h[j] /= length, dot += h[j] * scene->wo[j];
        for (int j = 0; j < 3; j++) i[j][k] = 2 * dot * h[j] - scene->wo[j], o[j][k] = scene->wo[j];
        z[k] = h[2];
    }
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    outputs.of[FACET_D_VIS][0] = out;
    CHECK_INT(facet_eval(scene->brdf, FACET_PRECISE, (facet_vec3_in){i[0], i[1], i[2]},
                         (facet_vec3_in){o[0], o[1], o[2]}, n, &outputs),
              FACET_OK);
    double det = r->alpha_x * r->alpha_y * kappa(r);
    for (size_t k = 0; k < n; k++) out[k] *= z[k] * z[k] * z[k] * det;
}

double scene_turn_end(const struct scene *scene, double radius)
{
    double cosine = -scene->c / (scene->s * radius);
    return cosine > -1 ? cosine < 1 ? acos(cosine) : 0 : PI;
}

void scene_draw(const struct scene *scene, facet_sampler sampler, const double *u1,
                const double *u2, size_t n, double h[3][SCENE_MAX], double wi[3][SCENE_MAX],
                double *pdf)
{
    static double o[3][SCENE_MAX];
    for (size_t k = 0; k < n; k++)
        for (int j = 0; j < 3; j++) o[j][k] = scene->wo[j];
    facet_samples out = {{wi[0], wi[1], wi[2]}, {h[0], h[1], h[2]}, {0}, pdf};
    CHECK_INT(facet_sample(scene->brdf, FACET_PRECISE, sampler, (facet_vec3_in){o[0], o[1], o[2]},
                           u1, u2, n, &out),
              FACET_OK);
}
