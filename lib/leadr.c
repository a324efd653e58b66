/* leadr.c - the MIP pyramid of slope moments (Dupuy chapter 3), row by row. */
#include "facet_leadr.h"
#include "leadr_store.h"
#include "mip_rows.h"
#include "slope_rows.h"
#include "watch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Rows in work at a time, and below how many texels nobody else is asked for them. */
enum { BATCH_MAX = 8, BATCH_SHARE = 256, WORTH_SHARING = 2048 };

struct filter {
    const facet_leadr_options *options;
    const facet_watch *watch;
    const facet_crew *crew;
    const facet_leadr_sink *sink;
    facet_leadr_summary *summary;
    struct facet_slope_rows rows;
    struct mip_rows mip;
    struct leadr_store store;
    float *planes; /* of the rows of a batch */
    bool overflow;
};

/* Rows first .. first + count - 1 of a level, and what came of each. */
struct batch {
    struct filter *filter;
    size_t level, first, count;
    struct leadr_stored stored[BATCH_MAX];
    bool taken[BATCH_MAX]; /* by the sink */
};

/* Slopes of the one texel of the last level are those of the whole map. */
static void note_mean(struct filter *f, double *const at[CENTRAL_COUNT])
{
    const double ux = f->store.unit_x, uy = f->store.unit_y, x = ux * at[0][0], y = uy * at[1][0];
    const facet_covariance *base = &f->options->base;
    f->summary->mean = (facet_moments){x, y, ux * ux * at[2][0] + base->xx + x * x,
                                       uy * uy * at[3][0] + base->yy + y * y,
                                       ux * uy * at[4][0] + base->xy + x * y};
}

static float *planes_of(const struct filter *f, size_t level, size_t k)
{
    return f->planes + k * f->store.plane_count * f->summary->width[level];
}

/* Row k of a batch to the sink; false: it refuses. */
static bool sink_row(const struct batch *b, size_t k)
{
    const struct filter *f = b->filter;
    const float *plane[FACET_PLANES_MAX] = {NULL};
    for (size_t j = 0; j < f->store.plane_count; j++)
        plane[j] = planes_of(f, b->level, k) + j * f->summary->width[b->level];
    return f->sink->row(f->sink->user, b->level, b->first + k, plane);
}

/* One row, from slopes to what is stored of it and to what coarser levels need; on any thread. */
static void make_row(void *batch_, size_t k)
{
    struct batch *b = batch_;
    struct filter *f = b->filter;
    double *at[CENTRAL_COUNT];
    if (b->level) {
        facet_mip_rows_merge(&f->mip, b->level, k, at);
    } else {
        facet_slope_rows_make(&f->rows, b->first, k);
        memcpy(at, f->rows.row[k].at, sizeof at);
    }
    b->stored[k] = facet_leadr_store_row(&f->store, f->summary->width[b->level], at,
                                         planes_of(f, b->level, k));
    facet_mip_rows_squeeze(&f->mip, b->level, b->first + k, at);
    if (b->level == f->summary->level_count - 1) note_mean(f, at);
    b->taken[k] = !f->sink || !f->sink->begin || sink_row(b, k);
}

/* What a batch brings goes on in order, whoever made it. */
static bool deliver(struct batch *b)
{
    struct filter *f = b->filter;
    if (!b->level) facet_slope_rows_tally(&f->rows, b->count);
    for (size_t k = 0; k < b->count; k++) {
        facet_leadr_loss_add(&f->summary->loss[b->level], &b->stored[k].loss);
        f->overflow |= b->stored[k].overflow;
        if (!b->taken[k] || (f->sink && !f->sink->begin && !sink_row(b, k))) return false;
    }
    return !f->sink || !f->sink->begin || f->sink->end(f->sink->user, b->level, b->first, b->count);
}

/* Of rows from `first` on, those that may be one batch. */
static size_t rows_together(size_t first, size_t count)
{
    const size_t left = FACET_SINK_ROWS - first % FACET_SINK_ROWS;
    return count < left ? count : left;
}

/* A batch, and then those of the levels made of it: at most FACET_MAP_LEVELS_MAX deep. */
static bool run_batch(struct filter *f, size_t level, size_t first, size_t count)
{
    struct batch b = {.filter = f, .level = level, .first = first, .count = count};
    const facet_leadr_sink *sink = f->sink;
    if (sink && sink->begin && !sink->begin(sink->user, level, first, count)) return false;
    if (f->crew && count > 1 && count * f->summary->width[level] >= WORTH_SHARING)
        f->crew->share(f->crew->user, count, make_row, &b);
    else
        for (size_t k = 0; k < count; k++) make_row(&b, k);
    if (!deliver(&b)) return false;
    for (size_t i = level + 1; i < f->mip.count; i++) {
        struct mip_level *l = &f->mip.level[i];
        if (l->parent != level) continue;
        const size_t ready = facet_mip_rows_ready(&f->mip, i, first + count);
        while (l->done < ready) {
            const size_t n = rows_together(l->done, ready - l->done);
            if (!run_batch(f, i, l->done, n)) return false;
            l->done += n;
        }
    }
    return true;
}

static facet_status run(struct filter *f)
{
    const size_t height = f->rows.height;
    for (size_t q = 0, count; q < height; q += count) {
        count = rows_together(q, height - q < f->rows.batch ? height - q : f->rows.batch);
        if (facet_is_cancelled(f->watch)) return FACET_CANCELLED;
        if (!facet_slope_rows_load(&f->rows, q, count)) break;
        if (!run_batch(f, 0, q, count)) return FACET_NO_MEMORY;
    }
    facet_slope_rows_finish(&f->rows);
    return f->rows.flaw.count || f->overflow ? FACET_BAD_DATA : FACET_OK;
}

/* A few rows at a time, so that their memory is an eighth of the map's or less. */
static size_t batch_of(size_t height)
{
    const size_t batch = height / BATCH_SHARE;
    return batch < 1 ? 1 : batch > BATCH_MAX ? BATCH_MAX : batch;
}

static facet_status open_filter(struct filter *f, const facet_map_source *source)
{
    const facet_leadr_summary *s = f->summary;
    const size_t batch = batch_of(s->height[0]);
    facet_status status = facet_slope_rows_open(&f->rows, source, f->options, batch);
    if (status == FACET_OK) status = facet_mip_rows_open(&f->mip, s->width[0], s->height[0], batch);
    f->store = (struct leadr_store){f->options, f->rows.unit_x, f->rows.unit_y, s->plane_count};
    f->planes = malloc(batch * s->plane_count * s->width[0] * sizeof *f->planes);
    return status == FACET_OK && !f->planes ? FACET_NO_MEMORY : status;
}

static void close_filter(struct filter *f)
{
    facet_slope_rows_close(&f->rows);
    facet_mip_rows_close(&f->mip);
    free(f->planes);
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
        summary->has_stencil[s] = facet_slope_rows_sums(rows, (facet_stencil)s,
                                                        &summary->by_stencil[s]);
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
                                const facet_watch *watch, const facet_crew *crew,
                                const facet_leadr_sink *sink, facet_leadr_summary *summary)
{
    facet_status status = facet_leadr_sizes(source, options, summary);
    if (status != FACET_OK) return status;
    if (!is_base(&options->base)) return FACET_BAD_ALPHA;
    struct filter f = {
        .options = options, .watch = watch, .crew = crew, .sink = sink, .summary = summary};
    status = open_filter(&f, source);
    if (status == FACET_OK) {
        status = run(&f);
        summary->flaw = f.rows.flaw;
        summarize(&f.rows, summary);
    }
    close_filter(&f);
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
    const facet_leadr_sink sink = {.row = keep_row, .user = made};
    facet_status status = facet_leadr_sizes(&source, options, &made->summary);
    if (status == FACET_OK) status = allocate(made);
    if (status == FACET_OK)
        status = facet_leadr_filter(&source, options, watch, NULL, &sink, &made->summary);
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
