/* leadr_preview.c - one level of a filtered map as a picture for people. */
#include "leadr_answer.h"
#include "png_write.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Keeps the planes of one level. */
struct keeper {
    size_t level, width, height, planes;
    float *values;
};

static bool keep(void *user, size_t level, size_t row, const float *const plane[FACET_PLANES_MAX])
{
    struct keeper *k = user;
    if (level != k->level) return true;
    for (size_t p = 0; p < k->planes; p++)
        memcpy(k->values + (p * k->height + row) * k->width, plane[p], k->width * sizeof(float));
    return true;
}

static unsigned char code(double x)
{
    return (unsigned char)(255 * fmin(fmax(x, 0), 1) + 0.5);
}

static facet_moments texel(const struct keeper *k, const facet_leadr_options *o, size_t i)
{
    float v[FACET_PLANES_MAX] = {0};
    for (size_t p = 0; p < k->planes; p++) v[p] = k->values[p * k->width * k->height + i];
    return facet_moments_of_texel(v, o->form, o->model);
}

static double roughness(const facet_moments *m)
{
    const facet_covariance c = facet_covariance_from_moments(m);
    return sqrt(fmax(0, c.xx + c.yy));
}

/* n/2 + 1/2 of the unit normal (-x, -y, 1). */
static void paint_normal(const facet_moments *m, unsigned char rgb[3])
{
    const double length = sqrt(1 + m->e1 * m->e1 + m->e2 * m->e2);
    const double n[3] = {-m->e1 / length, -m->e2 / length, 1 / length};
    for (int c = 0; c < 3; c++) rgb[c] = code(n[c] / 2 + 0.5);
}

/* Hue: twice the angle of the axis of alpha_1, so that an axis and its opposite agree. */
static void paint_anisotropy(const facet_moments *m, unsigned char rgb[3])
{
    const facet_covariance c = facet_covariance_from_moments(m);
    const double large = facet_covariance_largest(&c), small = fmax(0, c.xx + c.yy - large);
    const double saturation = large > 0 ? 1 - sqrt(small / large) : 0;
    const double angle = atan2(2 * c.xy, c.xx - c.yy), third = 2 * acos(-1) / 3;
    for (int k = 0; k < 3; k++)
        rgb[k] = code(1 - saturation * (0.5 - 0.5 * cos(angle - k * third)));
}

static void paint(const struct keeper *k, const struct leadr_work *work, double range,
                  unsigned char *rgb)
{
    for (size_t i = 0; i < k->width * k->height; i++) {
        const facet_moments m = texel(k, &work->options, i);
        switch ((enum leadr_preview)work->preview) {
        case PREVIEW_ROUGHNESS:
            memset(rgb + 3 * i, code(range > 0 ? roughness(&m) / range : 0), 3);
            break;
        case PREVIEW_NORMAL: paint_normal(&m, rgb + 3 * i); break;
        case PREVIEW_ANISOTROPY: paint_anisotropy(&m, rgb + 3 * i); break;
        }
    }
}

bool api_leadr_picture(struct call *call, struct leadr_work *work)
{
    facet_leadr_summary sizes;
    if (facet_leadr_sizes(&work->map.source, &work->options, &sizes) != FACET_OK)
        return api_leadr_filter(call, work, NULL);
    struct keeper k = {.level = (size_t)work->level, .planes = sizes.plane_count};
    if (k.level >= sizes.level_count) k.level = 0;
    k.width = sizes.width[k.level];
    k.height = sizes.height[k.level];
    const size_t n = k.width * k.height;
    unsigned char *rgb = malloc(3 * n);
    k.values = malloc(k.planes * n * sizeof *k.values);
    const facet_leadr_sink sink = {.row = keep, .user = &k};
    void *bytes = NULL;
    size_t size = 0;
    bool ok = (rgb && k.values) || api_problem_memory(call->problem);
    ok = ok && api_leadr_filter(call, work, &sink);
    if (ok) {
        struct image_problem problem;
        double range = 0;
        for (size_t i = 0; i < n; i++) {
            const facet_moments m = texel(&k, &work->options, i);
            range = fmax(range, roughness(&m));
        }
        paint(&k, work, range, rgb);
        if (work->preview == PREVIEW_ROUGHNESS)
            api_answer_header(call->response, "Facet-Preview-Range", "%.9g", range);
        ok = api_png_write(rgb, k.width, k.height, &bytes, &size, &problem) == IMAGE_OK ||
             api_problem_memory(call->problem);
    }
    free(k.values);
    free(rgb);
    return ok && api_answer_raw(call, API_PNG_TYPE, bytes, size);
}
