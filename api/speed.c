#include "speed.h"

#include "endpoint.h"

#include <math.h>

bool api_measure_eval(const facet_brdf *brdf, const facet_bsdf *bsdf, facet_tier tier,
                      facet_quantity quantity, double *room, double *ns)
{
    enum { N = SPEED_PAIRS, REPEATS = 5 };
    double *v[7];
    for (int k = 0; k < 7; k++) v[k] = room + k * N;
    for (int i = 0; i < N; i++) {
        double z = (i + 0.5) / N, s = sqrt(1 - z * z);
        v[0][i] = s * cos(i), v[1][i] = s * sin(i), v[2][i] = bsdf && i % 2 ? -z : z;
        v[3][i] = 0.6, v[4][i] = 0, v[5][i] = 0.8;
    }
    facet_outputs outputs = {{{NULL}}};
    outputs.of[quantity][0] = v[6];
    const facet_vec3_in wi = {v[0], v[1], v[2]}, wo = {v[3], v[4], v[5]};
    *ns = INFINITY;
    for (int i = 0; i < REPEATS; i++) {
        double start = api_clock();
        if (bsdf ? facet_bsdf_eval(bsdf, tier, wi, wo, N, &outputs)
                 : facet_eval_sampled(brdf, tier, FACET_SAMPLER_AUTO, wi, wo, N, &outputs))
            return false;
        double us = api_clock() - start;
        if (us * 1e3 / N < *ns) *ns = us * 1e3 / N;
    }
    *ns = round(*ns * 100) / 100;
    return true;
}
