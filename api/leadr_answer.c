#include "leadr_answer.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

const char *const api_stencils[] = {"central", "forward", "bilinear", NULL};
const char *const api_borders[] = {"periodic", "clamp", "mirror", "trim", NULL};
const char *const api_storages[] = {"float", "half", NULL};
const char *const api_forms[] = {"raw", "central", NULL};
const char *const api_models[] = {"leadr", "clean", "clean_max", NULL};
const char *const api_y_directions[] = {"down", "up", NULL};
const char *const api_previews[] = {"roughness", "normal", "anisotropy", NULL};
const char *const api_compressions[] = {"none", "zip", NULL};

enum { MOMENTS = 5 };

/* ---- What is said in every form ------------------------------------------------------------ */

/* Above this share of a level's variance lost to the stored type the answer warns, or refuses. */
#define LOSS_WARNED 0.01

struct leadr_loss api_leadr_loss(const facet_leadr_summary *summary)
{
    struct leadr_loss all = {0, 0, 0};
    for (size_t i = 0; i < summary->level_count; i++) {
        const facet_leadr_loss *loss = &summary->loss[i];
        if (loss->variance > 0)
            all.level = fmax(all.level, fabs(loss->stored / loss->variance - 1));
        all.texel = fmax(all.texel, loss->worst);
        all.lost += loss->lost;
    }
    return all;
}

static bool loses(const struct leadr_loss *loss)
{
    return loss->lost || loss->level > LOSS_WARNED;
}

/*
 * Central half loses a variance below 3e-8 whole, which is nothing in a flat spot and
 * all there is of a flat map; raw half loses what stands beside a large mean.
 */
bool api_leadr_loss_check(struct call *call, const struct leadr_work *work, bool force)
{
    const struct leadr_loss loss = api_leadr_loss(&work->summary);
    const bool raw = work->options.form == FACET_RAW;
    const struct place at = {NULL, raw ? "form" : "type", 0};
    if (force || work->options.storage != FACET_HALF ||
        !(raw ? loses(&loss) : loss.level > LOSS_WARNED))
        return true;
    return api_problem_at(call->problem, &at,
                          "%s half loses %.2g of a level's variance on this map, and all that of "
                          "%zu texels: use %stype=float; force=true stores it all the same",
                          api_forms[work->options.form], loss.level, loss.lost,
                          raw ? "form=central or " : "");
}

/* A Beckmann material; floored where there is no area in slope space. */
static facet_status material_of(const facet_moments *moments, facet_roughness *roughness,
                                bool *floored)
{
    return facet_moments_to_roughness(moments, FACET_ALPHA_MIN, roughness, floored);
}

void api_leadr_warning(const struct leadr_work *work, char *out, size_t room)
{
    const struct leadr_loss loss = api_leadr_loss(&work->summary);
    const facet_leadr_options *o = &work->options;
    size_t used = 0;
    *out = 0;
    if (loses(&loss))
        used = (size_t)snprintf(out, room,
                                "storing as %s %s loses %.2g of a level's variance, and all that "
                                "of %zu texels%s. ",
                                api_storages[o->storage], api_forms[o->form], loss.level, loss.lost,
                                o->form == FACET_RAW ? "; form=central keeps it" : "");
    facet_roughness roughness;
    bool floored;
    const facet_status status = material_of(&work->summary.mean, &roughness, &floored);
    if (status != FACET_OK)
        snprintf(out + used, room - used, "no material describes the whole map: %s. ",
                 facet_status_text(status));
    else if (floored)
        snprintf(
            out + used, room - used,
            "the whole map has no roughness along some direction; the material's was raised. ");
    if (*out) out[strlen(out) - 1] = 0;
}

static double slope_variance(const facet_moments *m)
{
    return fmax(0, fma(-m->e1, m->e1, m->e3)) + fmax(0, fma(-m->e2, m->e2, m->e4));
}

double api_leadr_ratio(const facet_leadr_summary *s, facet_stencil stencil)
{
    if (!s->has_stencil[FACET_FORWARD] || !s->has_stencil[stencil]) return NAN;
    const double forward = slope_variance(&s->by_stencil[FACET_FORWARD]);
    return forward > 0 ? slope_variance(&s->by_stencil[stencil]) / forward : NAN;
}

const facet_crew *api_leadr_crew(const struct call *call, facet_crew *crew)
{
    *crew = (facet_crew){call->request->share, call->request->crew};
    return crew->share ? crew : NULL;
}

bool api_leadr_filter(struct call *call, struct leadr_work *work, const facet_leadr_sink *sink)
{
    const facet_watch watch = api_watch(call);
    const struct place border = {NULL, "border", 0}, type = {NULL, "type", 0};
    const bool is_half = work->options.storage == FACET_HALF;
    struct leadr_map *map = &work->map;
    facet_crew crew;
    const facet_status status = facet_leadr_filter(
        &map->source, &work->options, &watch, api_leadr_crew(call, &crew), sink, &work->summary);
    if (status == FACET_OK) return true;
    if (status == FACET_NO_MEMORY) return api_problem_memory(call->problem);
    if (status == FACET_BAD_DATA && work->summary.flaw.count)
        return api_leadr_map_flaw(call, map, &work->summary.flaw);
    if (status == FACET_BAD_DATA)
        return api_problem_at(
            call->problem, &type,
            "\"%s\" holds numbers up to %s, and moments of this map are larger: lower "
            "scale%s",
            api_storages[work->options.storage], is_half ? "65504" : "3.4e38",
            is_half ? ", or take \"float\"" : "");
    if (status == FACET_BAD_SIZE && work->options.border == FACET_TRIM)
        return api_problem_at(call->problem, &border, "trim leaves nothing of a map of %zu x %zu",
                              map->width, map->height);
    return api_problem_status(call->problem, status, NULL);
}

/* ---- Schema ---------------------------------------------------------------------------------- */

struct level_out {
    int64_t width, height, lost;
    double variance, stored_variance, worst_loss;
    struct matrix moments;
};

struct stencil_out {
    const char *stencil;
    double rms_slope, variance, ratio;
};

struct leadr_material_out {
    const char *ndf;
    double alpha_x, alpha_y, rho;
    struct numbers mean_slope;
};

struct leadr_probe_out {
    int64_t level, width, height, column, row;
    struct numbers moments;
    struct leadr_material_out *material;
    bool floored;
};

static const struct field level_fields[] = {
    {MEMBER(struct level_out, width), FIELD_INTEGER, FIELD_MUST},
    {MEMBER(struct level_out, height), FIELD_INTEGER, FIELD_MUST},
    {MEMBER(struct level_out, variance), FIELD_NUMBER, FIELD_MUST,
     .doc = "of the slopes within a texel (of CLEAN alpha^2), mean of the level, as computed in "
            "double"},
    {MEMBER(struct level_out, stored_variance), FIELD_NUMBER, FIELD_MUST,
     .doc = "the same from the moments as stored"},
    {MEMBER(struct level_out, worst_loss), FIELD_NUMBER, FIELD_MUST,
     .doc = "largest relative error of a texel's variance that storing made"},
    {MEMBER(struct level_out, lost), FIELD_INTEGER, FIELD_MUST,
     .doc = "texels whose variance is no longer positive as stored"},
    {MEMBER(struct level_out, moments), FIELD_MATRIX,
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
    {MEMBER(struct leadr_material_out, ndf), FIELD_TEXT, FIELD_MUST},
    {MEMBER(struct leadr_material_out, alpha_x), FIELD_NUMBER, FIELD_MUST},
    {MEMBER(struct leadr_material_out, alpha_y), FIELD_NUMBER, FIELD_MUST},
    {MEMBER(struct leadr_material_out, rho), FIELD_NUMBER, FIELD_MUST},
    {MEMBER(struct leadr_material_out, mean_slope), FIELD_NUMBERS, FIELD_MUST, .min_items = 2,
     .max_items = 2},
    {0},
};

static const struct field probe_fields[] = {
    {MEMBER(struct leadr_probe_out, level), FIELD_INTEGER, FIELD_MUST},
    {MEMBER(struct leadr_probe_out, width), FIELD_INTEGER, FIELD_MUST, .doc = "of the level"},
    {MEMBER(struct leadr_probe_out, height), FIELD_INTEGER, FIELD_MUST},
    {MEMBER(struct leadr_probe_out, column), FIELD_INTEGER, FIELD_MUST},
    {MEMBER(struct leadr_probe_out, row), FIELD_INTEGER, FIELD_MUST},
    {MEMBER(struct leadr_probe_out, moments), FIELD_NUMBERS, FIELD_MUST, .min_items = MOMENTS,
     .max_items = MOMENTS, .doc = "E1..E5 that the texel stands for as stored"},
    {MEMBER(struct leadr_probe_out, material), FIELD_OPTION, .fields = material_fields,
     .size = sizeof(struct leadr_material_out),
     .doc = "the texel as a Beckmann material, ready for /v1/eval; absent where none has its mean "
            "slope or roughness"},
    {MEMBER(struct leadr_probe_out, floored), FIELD_BOOL, FIELD_MAY,
     .doc = "whether an alpha had to be raised to be positive"},
    {0},
};

static const struct field error_fields[] = {
    {MEMBER(struct leadr_error_out, level), FIELD_NUMBER, FIELD_MUST,
     .doc = "largest relative error of the mean variance of a level"},
    {MEMBER(struct leadr_error_out, texel), FIELD_NUMBER, FIELD_MUST,
     .doc = "largest relative error of the variance of a texel"},
    {MEMBER(struct leadr_error_out, lost), FIELD_INTEGER, FIELD_MUST,
     .doc = "texels whose variance is no longer positive"},
    {0},
};

#define O(member) MEMBER(struct leadr_out, member)

const struct field api_leadr_fields[] = {
    {O(width), FIELD_INTEGER, FIELD_MUST, .doc = "of the map"},
    {O(height), FIELD_INTEGER, FIELD_MUST},
    {O(kind), FIELD_ENUM, FIELD_MUST, .names = api_leadr_kinds},
    {O(channel), FIELD_TEXT, .doc = "of the file"},
    {O(sample), FIELD_TEXT, .doc = "type of the file's samples"},
    {O(encoding), FIELD_ENUM, .names = api_leadr_encodings, .doc = "of normals and slopes"},
    {O(stencil), FIELD_ENUM, .names = api_stencils, .doc = "of displacement maps"},
    {O(border), FIELD_ENUM, .names = api_borders, .doc = "of displacement maps"},
    {O(y), FIELD_ENUM, FIELD_MUST, .names = api_y_directions},
    {O(scale), FIELD_NUMBER, FIELD_MUST},
    {O(texel), FIELD_NUMBER, .doc = "of displacement maps"},
    {O(base_alpha), FIELD_NUMBER, .doc = "of an isotropic base, as Beckmann"},
    {O(base_alpha_x), FIELD_NUMBER, .doc = "of an anisotropic base, as Beckmann"},
    {O(base_alpha_y), FIELD_NUMBER},
    {O(base_rho), FIELD_NUMBER},
    {O(base_note), FIELD_TEXT, .doc = "what was made of the base"},
    {O(model), FIELD_ENUM, FIELD_MUST, .names = api_models},
    {O(type), FIELD_ENUM, FIELD_MUST, .names = api_storages},
    {O(form), FIELD_ENUM, FIELD_MUST, .names = api_forms},
    {O(levels), FIELD_LIST, FIELD_MUST, .fields = level_fields, .size = sizeof(struct level_out),
     .doc = "finest first"},
    {O(moments), FIELD_NUMBERS, FIELD_MUST, .min_items = MOMENTS, .max_items = MOMENTS,
     .doc = "E1..E5 of the whole map in double, base roughness included"},
    {O(variance_error), FIELD_OBJECT, FIELD_MUST, .fields = error_fields,
     .doc = "what the stored type and form lose, over all levels"},
    {O(material), FIELD_OPTION, .fields = material_fields,
     .size = sizeof(struct leadr_material_out),
     .doc = "the whole map as a Beckmann material, ready for /v1/eval"},
    {O(floored), FIELD_BOOL, FIELD_MAY,
     .doc = "whether an alpha of the material had to be raised to be positive"},
    {O(probe), FIELD_OPTION, .fields = probe_fields, .size = sizeof(struct leadr_probe_out),
     .doc = "the texel asked for with at and level"},
    {O(stencils), FIELD_LIST, .fields = stencil_fields, .size = sizeof(struct stencil_out),
     .doc = "what each stencil sees of this displacement map"},
    {O(warning), FIELD_TEXT, .doc = "what to beware of"},
    {0},
};

/* ---- JSON ----------------------------------------------------------------------------------- */

static double *five(struct arena *arena, const facet_moments *m)
{
    double *v = api_arena_doubles(arena, MOMENTS);
    if (v) memcpy(v, (double[]){m->e1, m->e2, m->e3, m->e4, m->e5}, MOMENTS * sizeof *v);
    return v;
}

static bool describe_material(struct arena *arena, const facet_moments *moments,
                              struct numbers *printed, struct leadr_material_out **material,
                              bool *floored)
{
    facet_roughness r;
    *printed = (struct numbers){MOMENTS, five(arena, moments)};
    if (!printed->values) return false;
    /* The warning of a whole map says why there is none. */
    if (material_of(moments, &r, floored) != FACET_OK) return true;
    double *mean = api_arena_doubles(arena, 2);
    *material = api_arena_array(arena, 1, sizeof **material);
    if (!mean || !*material) return false;
    mean[0] = r.slope_x;
    mean[1] = r.slope_y;
    **material = (struct leadr_material_out){"beckmann", r.alpha_x, r.alpha_y, r.rho, {2, mean}};
    return true;
}

/* Keeps the levels that are printed, and the texel asked for. */
struct keeper {
    const facet_leadr_summary *sizes;
    double *texels[FACET_MAP_LEVELS_MAX];
    float texel[FACET_PLANES_MAX];
    size_t level, column, row;
};

static bool keep(void *user, size_t level, size_t row, const float *const plane[FACET_PLANES_MAX])
{
    struct keeper *k = user;
    const size_t w = k->sizes->width[level], planes = k->sizes->plane_count;
    if (level == k->level && row == k->row)
        for (size_t p = 0; p < planes; p++) k->texel[p] = plane[p][k->column];
    for (size_t i = 0; k->texels[level] && i < w; i++)
        for (size_t p = 0; p < planes; p++)
            k->texels[level][(row * w + i) * planes + p] = plane[p][i];
    return true;
}

static bool run(struct call *call, struct leadr_work *work, struct keeper *k)
{
    facet_leadr_summary sizes;
    *k = (struct keeper){.sizes = &sizes, .level = FACET_MAP_LEVELS_MAX};
    /* What is wrong with the sizes, the filter says. */
    (void)facet_leadr_sizes(&work->map.source, &work->options, &sizes);
    for (size_t i = 0; i < sizes.level_count; i++) {
        const size_t n = sizes.width[i] * sizes.height[i];
        if (n > LEADR_SHOWN_TEXELS) continue;
        k->texels[i] = api_arena_doubles(call->arena, n * sizes.plane_count);
        if (!k->texels[i]) return api_problem_memory(call->problem);
    }
    if (work->level >= 0 && (size_t)work->level < sizes.level_count) {
        k->level = (size_t)work->level;
        k->column = (size_t)(work->at[0] * (double)sizes.width[k->level]);
        k->row = (size_t)(work->at[1] * (double)sizes.height[k->level]);
    }
    const facet_leadr_sink sink = {.row = keep, .user = k};
    const bool ok = api_leadr_filter(call, work, &sink);
    k->sizes = &work->summary;
    return ok;
}

static bool list_levels(struct arena *arena, const struct keeper *k, struct list *list)
{
    const facet_leadr_summary *s = k->sizes;
    struct level_out *levels = api_arena_array(arena, s->level_count, sizeof *levels);
    if (!levels) return false;
    for (size_t i = 0; i < s->level_count; i++) {
        levels[i] = (struct level_out){
            .width = (int64_t)s->width[i],
            .height = (int64_t)s->height[i],
            .lost = (int64_t)s->loss[i].lost,
            .variance = s->loss[i].variance,
            .stored_variance = s->loss[i].stored,
            .worst_loss = s->loss[i].worst,
            .moments = {s->width[i] * s->height[i], s->plane_count, k->texels[i]},
        };
    }
    *list = (struct list){s->level_count, levels};
    return true;
}

static bool list_stencils(struct arena *arena, const facet_leadr_summary *s, struct list *list)
{
    struct stencil_out *items = api_arena_array(arena, FACET_STENCIL_COUNT, sizeof *items);
    if (!items) return false;
    size_t n = 0;
    for (int i = 0; i < FACET_STENCIL_COUNT; i++) {
        const facet_moments *m = &s->by_stencil[i];
        if (!s->has_stencil[i]) continue;
        items[n++] = (struct stencil_out){api_stencils[i], sqrt(m->e3 + m->e4), slope_variance(m),
                                          api_leadr_ratio(s, (facet_stencil)i)};
    }
    if (n) *list = (struct list){n, items};
    return true;
}

static const char *copy(struct arena *arena, const char *text)
{
    return api_arena_text(arena, text, strlen(text));
}

static void describe_options(const struct leadr_work *work, struct leadr_out *out)
{
    const facet_leadr_options *o = &work->options;
    out->kind = (int)work->map.kind;
    out->y = o->y_up;
    out->type = (int)o->storage;
    out->form = (int)o->form;
    out->model = (int)o->model;
    out->scale = o->scale;
    out->base_note = work->base_note;
    if (work->base_alpha[0] == work->base_alpha[1] && work->base_rho == 0) {
        out->base_alpha = work->base_alpha[0];
    } else {
        out->base_alpha_x = work->base_alpha[0];
        out->base_alpha_y = work->base_alpha[1];
        out->base_rho = work->base_rho;
    }
    if (work->map.kind != LEADR_DISPLACEMENT) {
        out->encoding = work->map.encoding;
        return;
    }
    out->stencil = (int)o->stencil;
    out->border = (int)o->border;
    out->texel = o->texel;
}

static bool describe_probe(struct arena *arena, const struct leadr_work *work,
                           const struct keeper *k, struct leadr_out *out)
{
    const facet_leadr_options *o = &work->options;
    if (k->level >= FACET_MAP_LEVELS_MAX) return true;
    struct leadr_probe_out *p = out->probe = api_arena_array(arena, 1, sizeof *p);
    if (!p) return false;
    p->level = (int64_t)k->level;
    p->width = (int64_t)k->sizes->width[k->level];
    p->height = (int64_t)k->sizes->height[k->level];
    p->column = (int64_t)k->column;
    p->row = (int64_t)k->row;
    const facet_moments m = facet_moments_of_texel(k->texel, o->form, o->model);
    return describe_material(arena, &m, &p->moments, &p->material, &p->floored);
}

bool api_leadr_json(struct call *call, struct leadr_work *work)
{
    struct leadr_out *out = call->out;
    struct arena *arena = call->arena;
    struct keeper k;
    char warning[512];
    if (!run(call, work, &k)) return false;
    api_leadr_warning(work, warning, sizeof warning);
    out->width = (int64_t)work->map.width;
    out->height = (int64_t)work->map.height;
    const struct image *image = &work->map.planes[0];
    if (*image->type) {
        /* Printed after the map is gone. */
        out->channel = copy(arena, image->channel);
        out->sample = copy(arena, image->type);
    }
    describe_options(work, out);
    const struct leadr_loss loss = api_leadr_loss(&work->summary);
    out->variance_error = (struct leadr_error_out){loss.level, loss.texel, (int64_t)loss.lost};
    bool ok = list_levels(arena, &k, &out->levels) &&
              list_stencils(arena, &work->summary, &out->stencils) &&
              describe_material(arena, &work->summary.mean, &out->moments, &out->material,
                                &out->floored) &&
              describe_probe(arena, work, &k, out);
    if (*warning) {
        out->warning = copy(arena, warning);
        ok = ok && out->warning;
    }
    return ok || api_problem_memory(call->problem);
}
