#include "leadr_answer.h"
#include "exr.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

const char *const api_stencils[] = {"central", "forward", "bilinear", NULL};
const char *const api_borders[] = {"periodic", "clamp", "mirror", "trim", NULL};
const char *const api_storages[] = {"float", "half", NULL};
const char *const api_forms[] = {"raw", "central", NULL};
const char *const api_y_directions[] = {"down", "up", NULL};

enum {
    PLANES = 5,
    SHOWN_TEXELS = 16, /* levels up to this size are printed whole */
};

/* Above this share of the variance lost to the stored type the answer warns. */
#define LOSS_WARNED 0.01

/* ---- What is said in either form ------------------------------------------------------------- */

/* A Beckmann material of the whole map; floored where the map has no area in slope space. */
static facet_status whole_map(const struct leadr_map *map, facet_moments *moments,
                              facet_roughness *roughness, bool *floored)
{
    const size_t last = facet_leadr_level_count(map->leadr) - 1;
    *moments = facet_leadr_level_at(map->leadr, last)->mean;
    return facet_moments_to_roughness(moments, FACET_ALPHA_MIN, roughness, floored);
}

static double relative_loss(const facet_leadr_loss *loss)
{
    return loss->variance > 0 ? fabs(loss->stored / loss->variance - 1) : 0;
}

/* "" where there is nothing to warn of. */
static void warn(const struct leadr_map *map, char *out, size_t room)
{
    size_t lost = 0, used = 0;
    double worst = 0;
    for (size_t i = 0; i < facet_leadr_level_count(map->leadr); i++) {
        const facet_leadr_loss *loss = &facet_leadr_level_at(map->leadr, i)->loss;
        lost += loss->lost;
        worst = fmax(worst, relative_loss(loss));
    }
    *out = 0;
    if (lost || worst > LOSS_WARNED)
        used = (size_t)snprintf(out, room,
                                "storing as %s %s loses %.2g of a level's variance, and all that "
                                "of %zu texels%s. ",
                                api_storages[map->options.storage], api_forms[map->options.form],
                                worst, lost,
                                map->options.form == FACET_RAW ? "; form=central keeps it" : "");
    facet_moments moments;
    facet_roughness roughness;
    bool floored;
    const facet_status status = whole_map(map, &moments, &roughness, &floored);
    if (status != FACET_OK)
        snprintf(out + used, room - used, "no material describes the whole map: %s. ",
                 facet_status_text(status));
    else if (floored)
        snprintf(
            out + used, room - used,
            "the whole map has no roughness along some direction; the material's was raised. ");
    if (*out) out[strlen(out) - 1] = 0;
}

/* ---- JSON ------------------------------------------------------------------------------------ */

struct level_out {
    int64_t width, height, lost;
    double variance, stored_variance, worst_loss;
    struct numbers moments;
};

struct stencil_out {
    const char *stencil;
    double rms_slope, variance, ratio;
};

struct material_out {
    const char *ndf;
    double alpha_x, alpha_y, rho;
    struct numbers mean_slope;
};

static const struct field level_fields[] = {
    {MEMBER(struct level_out, width), FIELD_INTEGER, FIELD_MUST},
    {MEMBER(struct level_out, height), FIELD_INTEGER, FIELD_MUST},
    {MEMBER(struct level_out, variance), FIELD_NUMBER, FIELD_MUST,
     .doc = "of the slopes within a texel, mean of the level, as computed in double"},
    {MEMBER(struct level_out, stored_variance), FIELD_NUMBER, FIELD_MUST,
     .doc = "the same from the moments as stored"},
    {MEMBER(struct level_out, worst_loss), FIELD_NUMBER, FIELD_MUST,
     .doc = "largest relative error of a texel's variance that storing made"},
    {MEMBER(struct level_out, lost), FIELD_INTEGER, FIELD_MUST,
     .doc = "texels whose variance is no longer positive as stored"},
    {MEMBER(struct level_out, moments), FIELD_VECTORS, .width = PLANES,
     .doc = "of each texel of the coarsest levels, as stored, rows from the top"},
    {0},
};

static const struct field stencil_fields[] = {
    {MEMBER(struct stencil_out, stencil), FIELD_TEXT, FIELD_MUST},
    {MEMBER(struct stencil_out, rms_slope), FIELD_NUMBER, FIELD_MUST,
     .doc = "sqrt(E3 + E4) of the whole map, without the base roughness"},
    {MEMBER(struct stencil_out, variance), FIELD_NUMBER, FIELD_MUST},
    {MEMBER(struct stencil_out, ratio), FIELD_NUMBER,
     .doc = "of the variance to that of forward differences"},
    {0},
};

static const struct field material_fields[] = {
    {MEMBER(struct material_out, ndf), FIELD_TEXT, FIELD_MUST},
    {MEMBER(struct material_out, alpha_x), FIELD_NUMBER, FIELD_MUST},
    {MEMBER(struct material_out, alpha_y), FIELD_NUMBER, FIELD_MUST},
    {MEMBER(struct material_out, rho), FIELD_NUMBER, FIELD_MUST},
    {MEMBER(struct material_out, mean_slope), FIELD_NUMBERS, FIELD_MUST, .min_items = 2,
     .max_items = 2},
    {0},
};

const struct field api_leadr_fields[] = {
    {MEMBER(struct leadr_out, width), FIELD_INTEGER, FIELD_MUST, .doc = "of the map"},
    {MEMBER(struct leadr_out, height), FIELD_INTEGER, FIELD_MUST},
    {MEMBER(struct leadr_out, channel), FIELD_TEXT, .doc = "of the file"},
    {MEMBER(struct leadr_out, sample), FIELD_TEXT, .doc = "type of the file's samples"},
    {MEMBER(struct leadr_out, stencil), FIELD_ENUM, FIELD_MUST, .names = api_stencils},
    {MEMBER(struct leadr_out, border), FIELD_ENUM, FIELD_MUST, .names = api_borders},
    {MEMBER(struct leadr_out, y), FIELD_ENUM, FIELD_MUST, .names = api_y_directions},
    {MEMBER(struct leadr_out, scale), FIELD_NUMBER, FIELD_MUST},
    {MEMBER(struct leadr_out, texel), FIELD_NUMBER, FIELD_MUST},
    {MEMBER(struct leadr_out, base_alpha), FIELD_NUMBER, FIELD_MUST},
    {MEMBER(struct leadr_out, type), FIELD_ENUM, FIELD_MUST, .names = api_storages},
    {MEMBER(struct leadr_out, form), FIELD_ENUM, FIELD_MUST, .names = api_forms},
    {MEMBER(struct leadr_out, levels), FIELD_LIST, FIELD_MUST, .fields = level_fields,
     .size = sizeof(struct level_out), .doc = "finest first"},
    {MEMBER(struct leadr_out, moments), FIELD_NUMBERS, FIELD_MUST, .min_items = PLANES,
     .max_items = PLANES, .doc = "E1..E5 of the whole map in double, base roughness included"},
    {MEMBER(struct leadr_out, material), FIELD_OPTION, .fields = material_fields,
     .size = sizeof(struct material_out),
     .doc = "the whole map as a Beckmann material, ready for /v1/eval"},
    {MEMBER(struct leadr_out, floored), FIELD_BOOL, FIELD_MAY,
     .doc = "whether an alpha of the material had to be raised to be positive"},
    {MEMBER(struct leadr_out, stencils), FIELD_LIST, FIELD_MUST, .fields = stencil_fields,
     .size = sizeof(struct stencil_out), .doc = "what each stencil sees of this map"},
    {MEMBER(struct leadr_out, warning), FIELD_TEXT, .doc = "what to beware of"},
    {0},
};

static double *five(struct arena *arena, const facet_moments *m)
{
    double *v = api_arena_doubles(arena, PLANES);
    if (v) memcpy(v, (double[]){m->e1, m->e2, m->e3, m->e4, m->e5}, PLANES * sizeof *v);
    return v;
}

static bool level_moments(struct arena *arena, const facet_leadr_level *level, struct numbers *out)
{
    const size_t n = level->width * level->height;
    double *values = api_arena_doubles(arena, PLANES * n);
    if (!values) return false;
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < PLANES; k++) values[PLANES * i + k] = level->plane[k][i];
    *out = (struct numbers){n, values};
    return true;
}

static bool list_levels(struct arena *arena, const struct leadr_map *map, struct list *list)
{
    const size_t count = facet_leadr_level_count(map->leadr);
    struct level_out *levels = api_arena_array(arena, count, sizeof *levels);
    if (!levels) return false;
    for (size_t i = 0; i < count; i++) {
        const facet_leadr_level *level = facet_leadr_level_at(map->leadr, i);
        levels[i] = (struct level_out){
            .width = (int64_t)level->width,
            .height = (int64_t)level->height,
            .lost = (int64_t)level->loss.lost,
            .variance = level->loss.variance,
            .stored_variance = level->loss.stored,
            .worst_loss = level->loss.worst,
        };
        if (level->width * level->height <= SHOWN_TEXELS &&
            !level_moments(arena, level, &levels[i].moments))
            return false;
    }
    *list = (struct list){count, levels};
    return true;
}

static double slope_variance(const facet_moments *m)
{
    return fmax(0, fma(-m->e1, m->e1, m->e3)) + fmax(0, fma(-m->e2, m->e2, m->e4));
}

static bool list_stencils(struct arena *arena, const struct leadr_map *map, struct list *list)
{
    struct stencil_out *items = api_arena_array(arena, FACET_STENCIL_COUNT, sizeof *items);
    if (!items) return false;
    const double forward = slope_variance(&map->by_stencil[FACET_FORWARD]);
    size_t n = 0;
    for (int s = 0; s < FACET_STENCIL_COUNT; s++) {
        const facet_moments *m = &map->by_stencil[s];
        if (!map->has_stencil[s]) continue;
        items[n].stencil = api_stencils[s];
        items[n].rms_slope = sqrt(m->e3 + m->e4);
        items[n].variance = slope_variance(m);
        items[n++].ratio = forward > 0 ? slope_variance(m) / forward : NAN;
    }
    *list = (struct list){n, items};
    return true;
}

static bool describe_material(struct arena *arena, const struct leadr_map *map,
                              struct leadr_out *out)
{
    facet_moments moments;
    facet_roughness r;
    const facet_status status = whole_map(map, &moments, &r, &out->floored);
    out->moments = (struct numbers){PLANES, five(arena, &moments)};
    if (!out->moments.values) return false;
    if (status != FACET_OK) return true; /* the warning says why there is none */
    double *mean = api_arena_doubles(arena, 2);
    out->material = api_arena_array(arena, 1, sizeof *out->material);
    if (!mean || !out->material) return false;
    mean[0] = r.slope_x;
    mean[1] = r.slope_y;
    *out->material = (struct material_out){"beckmann", r.alpha_x, r.alpha_y, r.rho, {2, mean}};
    return true;
}

static const char *copy(struct arena *arena, const char *text)
{
    return api_arena_text(arena, text, strlen(text));
}

bool api_leadr_json(struct call *call, const struct leadr_map *map)
{
    struct leadr_out *out = call->out;
    const facet_leadr_options *o = &map->options;
    char warning[512];
    warn(map, warning, sizeof warning);
    out->width = (int64_t)map->image.width;
    out->height = (int64_t)map->image.height;
    if (*map->image.type) {
        /* Printed after the map is gone. */
        out->channel = copy(call->arena, map->image.channel);
        out->sample = copy(call->arena, map->image.type);
    }
    out->stencil = (int)o->stencil;
    out->border = (int)o->border;
    out->y = o->y_up;
    out->type = (int)o->storage;
    out->form = (int)o->form;
    out->scale = o->scale;
    out->texel = o->texel;
    out->base_alpha = o->base_alpha;
    bool ok = list_levels(call->arena, map, &out->levels) &&
              list_stencils(call->arena, map, &out->stencils) &&
              describe_material(call->arena, map, out);
    if (*warning) {
        out->warning = copy(call->arena, warning);
        ok = ok && out->warning;
    }
    return ok || api_problem_memory(call->problem);
}

/* ---- EXR ---------------------------------------------------------------------------------------
 */

static const char comments[] =
    "LEADR slope moments (Dupuy 2015, chapter 3). Slopes are x = dz/dx, y = dz/dy of the height z, "
    "x to the right. E1 = E[x], E2 = E[y], E3 = E[x^2], E4 = E[y^2], E5 = E[x y]; "
    "V11 = E3 - E1^2, V22 = E4 - E2^2, V12 = E5 - E1 E2. A Beckmann lobe has alpha_x^2 = 2 V11, "
    "alpha_y^2 = 2 V22, rho = V12 / sqrt(V11 V22), mean slope (E1, E2). leadrBaseAlpha is already "
    "in. Each level is the mean of its footprint of level 0.";

bool api_leadr_exr(struct call *call, const struct leadr_map *map)
{
    static const char *const names[FACET_MOMENT_FORM_COUNT][PLANES] = {
        {"E1", "E2", "E3", "E4", "E5"}, {"E1", "E2", "V11", "V22", "V12"}};
    static const char *const wraps[] = {"periodic", "clamp", "mirror", "clamp"};
    const facet_leadr_options *o = &map->options;
    char warning[512], source[96];
    warn(map, warning, sizeof warning);
    snprintf(source, sizeof source, "%s %s", *map->image.type ? map->image.type : "JSON",
             map->image.channel);
    const struct exr_attribute attributes[] = {
        {"software", "facetd " FACET_VERSION, 0},
        {"comments", comments, 0},
        {"wrapmodes", wraps[o->border], 0},
        {"leadrStencil", api_stencils[o->stencil], 0},
        {"leadrBorder", api_borders[o->border], 0},
        {"leadrY", api_y_directions[o->y_up], 0},
        {"leadrForm", api_forms[o->form], 0},
        {"leadrSource", source, 0},
        {"leadrWarning", warning, 0},
        {"leadrScale", NULL, o->scale},
        {"leadrTexel", NULL, o->texel},
        {"leadrBaseAlpha", NULL, o->base_alpha},
    };
    struct exr_level levels[FACET_MAP_LEVELS_MAX];
    struct exr_pyramid pyramid = {
        .level_count = facet_leadr_level_count(map->leadr),
        .levels = levels,
        .plane_count = PLANES,
        .half = o->storage == FACET_HALF,
        .compress = map->compress,
        .attributes = attributes,
        .attribute_count = sizeof attributes / sizeof *attributes,
    };
    for (size_t k = 0; k < PLANES; k++) pyramid.names[k] = names[o->form][k];
    for (size_t i = 0; i < pyramid.level_count; i++) {
        const facet_leadr_level *level = facet_leadr_level_at(map->leadr, i);
        levels[i] = (struct exr_level){.width = level->width, .height = level->height};
        for (size_t k = 0; k < PLANES; k++) levels[i].plane[k] = level->plane[k];
    }
    const facet_watch watch = api_watch(call);
    struct image_problem problem = {0};
    void *bytes = NULL;
    size_t size = 0;
    switch (api_exr_write(&pyramid, &watch, &bytes, &size, &problem)) {
    case IMAGE_OK:
        return api_answer_raw(call, API_EXR_TYPE, bytes, size);
    case IMAGE_NO_MEMORY:
        return api_problem_memory(call->problem);
    case IMAGE_CANCELLED:
        return api_problem_status(call->problem, FACET_CANCELLED, NULL);
    default:
        return api_problem(call->problem, 500, "%s", problem.text);
    }
}
