#include "filtered.h"

#include <string.h>

facet_leadr *filtered_pyramid(const struct relief *r, enum way way)
{
    const facet_height_map map = {r->z, r->side, r->side};
    facet_leadr_options o = {.scale = 1, .texel = 1, .form = FACET_CENTRED};
    o.stencil = way < WAY_CLEAN ? (facet_stencil)way : FACET_BILINEAR;
    o.model = way == WAY_CLEAN ? FACET_CLEAN : FACET_LEADR;
    facet_leadr *leadr = NULL;
    return facet_leadr_create(&map, &o, NULL, NULL, &leadr) == FACET_OK ? leadr : NULL;
}

facet_moments filtered_texel(const facet_leadr *leadr, enum way way, size_t level, size_t p,
                             size_t q)
{
    const facet_leadr_level *l = facet_leadr_level_at(leadr, level);
    float v[FACET_PLANES_MAX] = {0};
    for (size_t k = 0; k < FACET_PLANES_MAX && l->plane[k]; k++)
        v[k] = l->plane[k][q * l->width + p];
    if (way == WAY_NORMAL) v[2] = v[3] = v[4] = 0;
    return facet_moments_of_texel(v, FACET_CENTRED, way == WAY_CLEAN ? FACET_CLEAN : FACET_LEADR);
}

void filtered_shade(const facet_moments *m, double base_alpha, const double (*wi)[3],
                    const double (*wo)[3], size_t n, double *out)
{
    const facet_roughness below = {.alpha_x = base_alpha, .alpha_y = base_alpha};
    const facet_moments base = facet_moments_from_roughness(&below),
                        sum = facet_moments_add(m, &base);
    facet_material material = {.ndf = FACET_BECKMANN, .fresnel = {.channels = 1}};
    facet_brdf *brdf = NULL;
    double k[6][FILTERED_MAX];
    for (size_t v = 0; v < n; v++)
        for (int c = 0; c < 3; c++) k[c][v] = wi[v][c], k[3 + c][v] = wo[v][c];
    const facet_vec3_in i = {k[0], k[1], k[2]}, o = {k[3], k[4], k[5]};
    facet_outputs outputs = {{{NULL}}};
    outputs.of[FACET_FR_COS][0] = out;
    memset(out, 0, n * sizeof *out);
    if (facet_moments_to_roughness(&sum, FACET_ALPHA_MIN, &material.roughness, NULL) == FACET_OK &&
        facet_brdf_create(&material, &brdf) == FACET_OK)
        facet_eval(brdf, FACET_PRECISE, i, o, n, &outputs);
    facet_brdf_destroy(brdf);
}
