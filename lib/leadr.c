/* leadr.c - the MIP pyramid of slope moments (Dupuy chapter 3), row by row. */
#include "facet_leadr.h"
#include "leadr_store.h"
#include "mip_rows.h"
#include "slope_rows.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct filter {
    const facet_leadr_options *options;
    const facet_watch *watch;
    const facet_leadr_sink *sink;
    facet_leadr_summary *summary;
    struct leadr_store store;
};

enum { WATCH_ROWS = 64 };

static bool cancelled(const facet_watch *watch, size_t row)
{
    return watch && watch->cancelled && row % WATCH_ROWS == 0 && watch->cancelled(watch->user);
}

/* Slopes of the one texel of the last level are those of the whole map. */
static void note_mean(struct filter *f, double *const at[CENTRAL_COUNT])
{
    const double ux = f->store.unit_x, uy = f->store.unit_y, x = ux * at[0][0], y = uy * at[1][0];
    const facet_covariance *base = &f->options->base;
    f->summary->mean = (facet_moments){x, y, ux * ux * at[2][0] + base->xx + x * x,
                                       uy * uy * at[3][0] + base->yy + y * y,
                                       ux * uy * at[4][0] + base->xy + x * y};
}

/* A row of some level is finished. */
static bool finished(void *user, size_t level, size_t row, double *const at[CENTRAL_COUNT])
{
    struct filter *f = user;
    const size_t n = f->summary->width[level];
    facet_leadr_store_row(&f->store, n, at, &f->summary->loss[level]);
    if (level == f->summary->level_count - 1) note_mean(f, at);
    if (!f->sink) return true;
    const float *plane[FACET_PLANES_MAX] = {NULL};
    for (size_t k = 0; k < f->store.plane_count; k++) plane[k] = f->store.rounded + k * n;
    return f->sink->row(f->sink->user, level, row, plane);
}

static facet_status run(struct filter *f, struct facet_slope_rows *rows)
{
    struct mip_rows mip = {.finished = finished, .user = f};
    facet_status status = facet_mip_rows_open(&mip, rows->width, rows->height);
    for (size_t q = 0; q < rows->height && status == FACET_OK; q++) {
        if (cancelled(f->watch, q))
            status = FACET_CANCELLED;
        else if (!facet_slope_rows_next(rows, q))
            break;
        else if (!facet_mip_rows_add(&mip, q, rows->at))
            status = FACET_NO_MEMORY;
    }
    facet_mip_rows_close(&mip);
    if (status == FACET_OK) facet_slope_rows_finish(rows);
    if (status == FACET_OK && (rows->flaw.count || f->store.overflow)) status = FACET_BAD_DATA;
    return status;
}

static void summarize(const struct facet_slope_rows *rows, facet_leadr_summary *summary)
{
    for (size_t i = 0; i < summary->level_count; i++) {
        const double n = (double)summary->width[i] * (double)summary->height[i];
        summary->loss[i].variance /= n;
        summary->loss[i].stored /= n;
    }
    if (rows->source->kind != FACET_HEIGHTS) return;
    for (int s = 0; s < FACET_STENCIL_COUNT; s++)
        summary->has_stencil[s] =
            facet_slope_rows_sums(rows, (facet_stencil)s, &summary->by_stencil[s]);
}

static bool is_base(const facet_covariance *c)
{
    return c->xx >= 0 && c->yy >= 0 && isfinite(c->xx) && isfinite(c->yy) &&
           c->xy * c->xy <= c->xx * c->yy;
}

facet_status facet_leadr_sizes(const facet_map_source *source, const facet_leadr_options *options,
                               facet_leadr_summary *summary)
{
    size_t width = 0, height = 0;
    *summary = (facet_leadr_summary){.plane_count = facet_plane_count(options->model)};
    const facet_status status = facet_slope_rows_size(source, options, &width, &height);
    if (status != FACET_OK) return status;
    summary->level_count = facet_mip_level_count(width, height);
    for (size_t i = 0; i < summary->level_count; i++) {
        summary->width[i] = facet_mip_side(width, i);
        summary->height[i] = facet_mip_side(height, i);
    }
    return FACET_OK;
}

facet_status facet_leadr_filter(const facet_map_source *source, const facet_leadr_options *options,
                                const facet_watch *watch, const facet_leadr_sink *sink,
                                facet_leadr_summary *summary)
{
    facet_status status = facet_leadr_sizes(source, options, summary);
    if (status != FACET_OK) return status;
    if (!is_base(&options->base)) return FACET_BAD_ALPHA;
    struct filter f = {.options = options, .watch = watch, .sink = sink, .summary = summary};
    struct facet_slope_rows rows;
    status = facet_slope_rows_open(&rows, source, options);
    if (status == FACET_OK)
        status = facet_leadr_store_open(&f.store, options, rows.unit_x, rows.unit_y, rows.width);
    if (status == FACET_OK) {
        status = run(&f, &rows);
        summary->flaw = rows.flaw;
        summarize(&rows, summary);
    }
    facet_leadr_store_close(&f.store);
    facet_slope_rows_close(&rows);
    return status;
}

/* ---- In memory ---------------------------------------------------------------------------- */

struct facet_leadr {
    facet_leadr_summary summary;
    facet_leadr_level level[FACET_MAP_LEVELS_MAX];
    float *planes[FACET_MAP_LEVELS_MAX]; /* the planes of a level, one after the other */
};

static const float *row_of_map(void *user, size_t row)
{
    const facet_height_map *map = user;
    return map->heights + row * map->width;
}

static bool keep_row(void *user, size_t level, size_t row,
                     const float *const plane[FACET_PLANES_MAX])
{
    struct facet_leadr *leadr = user;
    const size_t w = leadr->level[level].width, h = leadr->level[level].height;
    for (size_t k = 0; k < leadr->summary.plane_count; k++)
        memcpy(leadr->planes[level] + (k * h + row) * w, plane[k], w * sizeof(float));
    return true;
}

static facet_status allocate(struct facet_leadr *leadr)
{
    const facet_leadr_summary *s = &leadr->summary;
    for (size_t i = 0; i < s->level_count; i++) {
        const size_t n = s->width[i] * s->height[i];
        leadr->level[i] = (facet_leadr_level){.width = s->width[i], .height = s->height[i]};
        leadr->planes[i] = malloc(s->plane_count * n * sizeof(float));
        if (!leadr->planes[i]) return FACET_NO_MEMORY;
        for (size_t k = 0; k < s->plane_count; k++)
            leadr->level[i].plane[k] = leadr->planes[i] + k * n;
    }
    return FACET_OK;
}

facet_status facet_leadr_create(const facet_height_map *map, const facet_leadr_options *options,
                                const facet_watch *watch, facet_map_flaw *flaw, facet_leadr **leadr)
{
    facet_height_map copy = *map;
    const facet_map_source source = {FACET_HEIGHTS, map->width, map->height, row_of_map, &copy};
    struct facet_leadr *made = calloc(1, sizeof *made);
    *leadr = NULL;
    if (flaw) *flaw = (facet_map_flaw){0, 0, 0};
    if (!made) return FACET_NO_MEMORY;
    const facet_leadr_sink sink = {keep_row, made};
    facet_status status = facet_leadr_sizes(&source, options, &made->summary);
    if (status == FACET_OK) status = allocate(made);
    if (status == FACET_OK)
        status = facet_leadr_filter(&source, options, watch, &sink, &made->summary);
    if (flaw) *flaw = made->summary.flaw;
    for (size_t i = 0; i < FACET_MAP_LEVELS_MAX; i++) made->level[i].loss = made->summary.loss[i];
    if (status == FACET_OK)
        *leadr = made;
    else
        facet_leadr_destroy(made);
    return status;
}

void facet_leadr_destroy(facet_leadr *leadr)
{
    if (!leadr) return;
    for (size_t i = 0; i < FACET_MAP_LEVELS_MAX; i++) free(leadr->planes[i]);
    free(leadr);
}

size_t facet_leadr_level_count(const facet_leadr *leadr)
{
    return leadr->summary.level_count;
}

const facet_leadr_level *facet_leadr_level_at(const facet_leadr *leadr, size_t level)
{
    return level < leadr->summary.level_count ? &leadr->level[level] : NULL;
}

const facet_leadr_summary *facet_leadr_summary_of(const facet_leadr *leadr)
{
    return &leadr->summary;
}
