/* leadr.c - the MIP pyramid of slope moments (Dupuy chapter 3). */
#include "facet_leadr.h"
#include "slope_rows.h"

#include <math.h>
#include <stdlib.h>

struct facet_leadr {
    size_t count;
    facet_leadr_level level[FACET_MAP_LEVELS_MAX];
    float *planes[FACET_MAP_LEVELS_MAX]; /* the five planes of a level, one after the other */
};

/* Unrounded moments of one level; without the base, which is added where they are stored. */
struct grid {
    size_t width, height;
    double *values; /* five planes, one after the other */
};

/* Level 0 is not kept in double but made again from the heights: it is most of the memory. */
struct source {
    struct facet_slope_rows *rows; /* level 0, or */
    const struct grid *grid;       /* a coarser one */
    double *line;                  /* five lines of scratch for rows */
    size_t width, height;
};

static void source_row(const struct source *s, size_t q, double *e[MOMENT_COUNT])
{
    for (size_t k = 0; k < MOMENT_COUNT; k++)
        e[k] = s->grid ? s->grid->values + (k * s->height + q) * s->width : s->line + k * s->width;
    if (!s->grid) facet_slope_rows_get(s->rows, q, e);
}

static bool cancelled(const facet_watch *watch, size_t row)
{
    return watch && watch->cancelled && row % 64 == 0 && watch->cancelled(watch->user);
}

/* ---- Filter -------------------------------------------------------------------- */

/*
 * Length that cell j of m shares with cell i of n, both tilings of one interval of
 * length m n (so cells are n and m long): an integer.
 */
static double overlap(size_t j, size_t m, size_t i, size_t n)
{
    const size_t low = j * n > i * m ? j * n : i * m;
    const size_t high = (j + 1) * n < (i + 1) * m ? (j + 1) * n : (i + 1) * m;
    return high > low ? (double)(high - low) : 0;
}

/* The columns under one texel of a coarser level: the first and the last may be shared. */
struct span {
    size_t first, last;
    double low, high; /* weights of first and last; 0 for last if it is first */
};

/* n spans over m columns, n <= m, in the weights of overlap; NULL: out of memory. */
static struct span *spans_of(size_t m, size_t n)
{
    struct span *spans = malloc(n * sizeof *spans);
    for (size_t i = 0; spans && i < n; i++) {
        const size_t first = i * m / n, last = ((i + 1) * m - 1) / n;
        spans[i] = (struct span){first, last, overlap(first, m, i, n),
                                 last > first ? overlap(last, m, i, n) : 0};
    }
    return spans;
}

/* One source row into one row of the target; a column inside a span weighs n. */
static void filter_row(double *const e[MOMENT_COUNT], const struct span *spans, double weight,
                       struct grid *to, size_t row)
{
    const size_t n = to->width;
    const double whole = (double)n;
    for (size_t k = 0; k < MOMENT_COUNT; k++) {
        const double *from = e[k];
        double *out = to->values + (k * to->height + row) * n;
        for (size_t i = 0; i < n; i++) {
            const struct span *s = &spans[i];
            double inside = 0;
            for (size_t j = s->first + 1; j < s->last; j++) inside += from[j];
            out[i] += weight * (s->low * from[s->first] + whole * inside + s->high * from[s->last]);
        }
    }
}

/* Each texel of 'to' becomes the mean of its footprint; texels of both tile the map evenly. */
static facet_status filter(const struct source *from, const facet_watch *watch, struct grid *to)
{
    const size_t total = MOMENT_COUNT * to->width * to->height;
    struct span *spans = spans_of(from->width, to->width);
    if (!spans) return FACET_NO_MEMORY;
    for (size_t q = 0; q < from->height; q++) {
        if (cancelled(watch, q)) {
            free(spans);
            return FACET_CANCELLED;
        }
        double *e[MOMENT_COUNT];
        source_row(from, q, e);
        for (size_t r = q * to->height / from->height; r * from->height < (q + 1) * to->height; r++)
            filter_row(e, spans, overlap(q, from->height, r, to->height), to, r);
    }
    free(spans);
    const double area = (double)from->width * (double)from->height;
    for (size_t i = 0; i < total; i++) to->values[i] /= area;
    return FACET_OK;
}

/* ---- Store --------------------------------------------------------------------- */

/* A variance below this share of E3 + E4 is rounding of the double sums, not surface. */
#define NOISE 1e-14

#define HALF_MAX 65504.0

/* Nearest value of binary16 in one rounding: 11 bits, the last of them 2^-24 at the least. */
static double to_half(double x)
{
    int exponent;
    frexp(x, &exponent);
    const double step = ldexp(1, exponent - 11 > -24 ? exponent - 11 : -24);
    const double y = step * rint(x / step);
    return fabs(y) <= HALF_MAX ? y : copysign(INFINITY, y);
}

static double to_storage(double x, facet_storage storage)
{
    return storage == FACET_HALF ? to_half(x) : (double)(float)x;
}

static double variance(double mean, double square, double sum)
{
    const double v = fma(-mean, mean, square);
    return v > NOISE * sum ? v : 0;
}

struct tally {
    facet_moments mean;
    facet_leadr_loss loss;
    bool overflow;
};

/* One texel, base not yet included, to its five stored values. */
static void store_texel(const double e[MOMENT_COUNT], const facet_leadr_options *o, double base,
                        double s[MOMENT_COUNT], struct tally *t)
{
    const double sum = e[2] + e[3];
    const double v11 = variance(e[0], e[2], sum), v22 = variance(e[1], e[3], sum);
    const bool centred = o->form == FACET_CENTRED;
    s[0] = to_storage(e[0], o->storage);
    s[1] = to_storage(e[1], o->storage);
    s[2] = to_storage((centred ? v11 : e[2]) + base, o->storage);
    s[3] = to_storage((centred ? v22 : e[3]) + base, o->storage);
    const double v12 = v11 > 0 && v22 > 0 ? fma(-e[0], e[1], e[4]) : 0;
    s[4] = to_storage(centred ? v12 : e[4], o->storage);
    for (int k = 0; k < MOMENT_COUNT; k++)
        if (!isfinite(s[k])) t->overflow = true;

    const double exact = v11 + v22 + 2 * base;
    double stored = s[2] + s[3];
    if (!centred) stored = fma(-s[0], s[0], s[2]) + fma(-s[1], s[1], s[3]);
    t->loss.variance += exact;
    t->loss.stored += stored;
    if (exact > 0) {
        t->loss.worst = fmax(t->loss.worst, fabs(stored - exact) / exact);
        if (!(stored > 0)) t->loss.lost++;
    }
}

static facet_status store_level(const struct source *from, const facet_leadr_options *o,
                                const facet_watch *watch, float *planes, facet_leadr_level *level)
{
    const size_t w = from->width, h = from->height;
    const double base = o->base_alpha * o->base_alpha / 2;
    struct tally t = {.overflow = false};
    double total[MOMENT_COUNT] = {0};
    for (size_t q = 0; q < h; q++) {
        if (cancelled(watch, q)) return FACET_CANCELLED;
        double *e[MOMENT_COUNT], line[MOMENT_COUNT] = {0};
        source_row(from, q, e);
        for (size_t p = 0; p < w; p++) {
            const double texel[MOMENT_COUNT] = {e[0][p], e[1][p], e[2][p], e[3][p], e[4][p]};
            double s[MOMENT_COUNT];
            store_texel(texel, o, base, s, &t);
            for (size_t k = 0; k < MOMENT_COUNT; k++) {
                line[k] += texel[k];
                planes[(k * h + q) * w + p] = (float)s[k];
            }
        }
        for (size_t k = 0; k < MOMENT_COUNT; k++) total[k] += line[k];
    }
    const double n = (double)w * (double)h;
    *level = (facet_leadr_level){.width = w, .height = h, .loss = t.loss};
    for (size_t k = 0; k < MOMENT_COUNT; k++) level->plane[k] = planes + k * w * h;
    level->mean = (facet_moments){total[0] / n, total[1] / n, total[2] / n + base,
                                  total[3] / n + base, total[4] / n};
    level->loss.variance /= n;
    level->loss.stored /= n;
    return t.overflow ? FACET_BAD_DATA : FACET_OK;
}

/* ---- Build --------------------------------------------------------------------- */

static size_t level_side(size_t side, size_t level)
{
    return side >> level ? side >> level : 1;
}

/* The next level in double, from the last one where its texels do not straddle, else from level 0.
 */
static facet_status next_grid(const struct source *zero, const facet_watch *watch, size_t level,
                              struct grid *grid)
{
    struct grid next = {level_side(zero->width, level), level_side(zero->height, level), NULL};
    next.values = calloc(MOMENT_COUNT * next.width * next.height, sizeof *next.values);
    if (!next.values) return FACET_NO_MEMORY;
    struct source from = *zero;
    if (grid->values && grid->width % next.width == 0 && grid->height % next.height == 0)
        from = (struct source){.grid = grid, .width = grid->width, .height = grid->height};
    const facet_status status = filter(&from, watch, &next);
    free(grid->values);
    *grid = next;
    return status;
}

static facet_status build(facet_leadr *leadr, struct facet_slope_rows *rows,
                          const facet_leadr_options *options, const facet_watch *watch)
{
    struct source zero = {.rows = rows, .width = rows->width, .height = rows->height};
    zero.line = malloc(MOMENT_COUNT * zero.width * sizeof *zero.line);
    struct grid grid = {0, 0, NULL};
    facet_status status = zero.line ? FACET_OK : FACET_NO_MEMORY;
    for (size_t i = 0; status == FACET_OK; i++) {
        if (i > 0) status = next_grid(&zero, watch, i, &grid);
        if (status != FACET_OK) break;
        const struct source from = {.rows = rows,
                                    .grid = i ? &grid : NULL,
                                    .line = zero.line,
                                    .width = level_side(zero.width, i),
                                    .height = level_side(zero.height, i)};
        leadr->planes[i] = malloc(MOMENT_COUNT * from.width * from.height * sizeof(float));
        if (!leadr->planes[i]) {
            status = FACET_NO_MEMORY;
            break;
        }
        status = store_level(&from, options, watch, leadr->planes[i], &leadr->level[i]);
        leadr->count = i + 1;
        if (from.width == 1 && from.height == 1) break;
    }
    free(grid.values);
    free(zero.line);
    return status;
}

static facet_map_flaw find_flaw(const facet_height_map *map)
{
    facet_map_flaw flaw = {0, 0, 0};
    for (size_t i = map->width * map->height; i-- > 0;) {
        if (isfinite(map->heights[i])) continue;
        flaw = (facet_map_flaw){flaw.count + 1, i % map->width, i / map->width};
    }
    return flaw;
}

facet_status facet_leadr_create(const facet_height_map *map, const facet_leadr_options *options,
                                const facet_watch *watch, facet_map_flaw *flaw, facet_leadr **leadr)
{
    *leadr = NULL;
    if (flaw) *flaw = (facet_map_flaw){0, 0, 0};
    if (!(options->base_alpha >= 0 && options->base_alpha <= FACET_ALPHA_MAX))
        return FACET_BAD_ALPHA;
    struct facet_slope_rows rows;
    facet_status status = facet_slope_rows_open(&rows, map, options);
    facet_leadr *made = status == FACET_OK ? calloc(1, sizeof *made) : NULL;
    if (status == FACET_OK && !made) status = FACET_NO_MEMORY;
    if (status == FACET_OK) {
        const facet_map_flaw found = find_flaw(map);
        if (flaw) *flaw = found;
        status = found.count ? FACET_BAD_DATA : build(made, &rows, options, watch);
    }
    facet_slope_rows_close(&rows);
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
    return leadr->count;
}

const facet_leadr_level *facet_leadr_level_at(const facet_leadr *leadr, size_t level)
{
    return level < leadr->count ? &leadr->level[level] : NULL;
}

facet_status facet_leadr_mean(const facet_height_map *map, const facet_leadr_options *options,
                              const facet_watch *watch, facet_moments *mean)
{
    struct facet_slope_rows rows;
    facet_status status = facet_slope_rows_open(&rows, map, options);
    double *line = status == FACET_OK ? malloc(MOMENT_COUNT * rows.width * sizeof *line) : NULL;
    if (status == FACET_OK && !line) status = FACET_NO_MEMORY;
    struct grid one = {1, 1, (double[MOMENT_COUNT]){0}};
    if (status == FACET_OK) {
        const struct source from = {
            .rows = &rows, .line = line, .width = rows.width, .height = rows.height};
        status = filter(&from, watch, &one);
    }
    const double *v = one.values;
    if (status == FACET_OK) *mean = (facet_moments){v[0], v[1], v[2], v[3], v[4]};
    free(line);
    facet_slope_rows_close(&rows);
    return status;
}
