/* slope_rows.c - heights to slopes: stencils and borders (Dupuy section 3.4). */
#include "slope_rows.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Texels between the two heights of a difference; BILINEAR adds two differences. */
static double span_of(facet_stencil stencil)
{
    return stencil == FACET_FORWARD ? 1 : 2;
}

/* How much smaller a trimmed map is, each way. */
static size_t trim_of(facet_stencil stencil)
{
    return stencil == FACET_CENTRAL ? 2 : 1;
}

static void set_units(struct facet_slope_rows *rows)
{
    const facet_leadr_options *o = rows->options;
    rows->unit_x = rows->unit_y = o->scale;
    if (rows->source->kind == FACET_SLOPES) return;
    rows->unit_x = o->scale / (span_of(o->stencil) * o->texel);
    rows->unit_y = o->y_up ? -rows->unit_x : rows->unit_x;
}

facet_status facet_slope_rows_size(const facet_map_source *source, const facet_leadr_options *o,
                                   size_t *width, size_t *height)
{
    const size_t w = source->width, h = source->height;
    if (!(isfinite(o->scale) && isfinite(o->texel) && o->texel > 0)) return FACET_BAD_SIZE;
    if (w == 0 || h == 0 || w > FACET_MAP_SIDE_MAX || h > FACET_MAP_SIDE_MAX ||
        w * h > FACET_MAP_PIXELS_MAX)
        return FACET_BAD_SIZE;
    const bool trims = o->border == FACET_TRIM && source->kind == FACET_HEIGHTS;
    const size_t trimmed = trims ? trim_of(o->stencil) : 0;
    if (w <= trimmed || h <= trimmed) return FACET_BAD_SIZE;
    *width = w - trimmed;
    *height = h - trimmed;
    return FACET_OK;
}

facet_status facet_slope_rows_open(struct facet_slope_rows *rows, const facet_map_source *source,
                                   const facet_leadr_options *options)
{
    *rows = (struct facet_slope_rows){.source = source, .options = options};
    const facet_status status = facet_slope_rows_size(source, options, &rows->width, &rows->height);
    if (status != FACET_OK) return status;
    const size_t padded = source->width + 2;
    const size_t held = source->kind == FACET_HEIGHTS ? HELD_ROWS + 2 : 0;
    set_units(rows);
    rows->memory = calloc((held + CENTRAL_COUNT) * padded, sizeof *rows->memory);
    if (!rows->memory) return FACET_NO_MEMORY;
    double *at = rows->memory;
    for (int k = 0; k < CENTRAL_COUNT; k++, at += padded) rows->at[k] = at;
    if (held) {
        for (int i = 0; i < HELD_ROWS; i++, at += padded) rows->held[i] = at;
        rows->first = at;
        rows->last = at + padded;
    }
    rows->zero_covariance = !held || options->stencil != FACET_BILINEAR;
    return FACET_OK;
}

void facet_slope_rows_close(struct facet_slope_rows *rows)
{
    free(rows->memory);
    rows->memory = NULL;
}

/* ---- Rows of the map ------------------------------------------------------------------- */

static void note_flaws(struct facet_slope_rows *rows, const float *from, size_t n, size_t row)
{
    for (size_t p = 0; p < n; p++) {
        if (isfinite(from[p])) continue;
        if (!rows->flaw.count++) {
            rows->flaw.column = p % rows->source->width;
            rows->flaw.row = row;
        }
    }
}

/* x * 0 is 0 for every finite x. */
static bool all_finite(const float *from, size_t n)
{
    float sum[8] = {0};
    size_t p = 0;
    for (; p + 8 <= n; p += 8)
        for (size_t k = 0; k < 8; k++) sum[k] += from[p + k] * 0;
    for (; p < n; p++) sum[0] += from[p] * 0;
    return sum[0] + sum[1] + sum[2] + sum[3] + sum[4] + sum[5] + sum[6] + sum[7] == 0;
}

/*
 * The height at an edge's ghost as a weighted sum of texels; i counts from 1, so
 * that 0 and n + 1 are the ghosts.
 */
struct ghost {
    size_t at[3]; /* from 1 */
    double weight[3];
};

static struct ghost ghost_of(bool low, size_t n, facet_border border)
{
    if (border == FACET_PERIODIC) return (struct ghost){{low ? n : 1, 1, 1}, {1, 0, 0}};
    /* TRIM never looks at a ghost; any height will do. */
    if (border != FACET_CLAMP || n == 1) return (struct ghost){{low ? 1 : n, 1, 1}, {1, 0, 0}};
    if (n == 2) return (struct ghost){{low ? 1 : 2, low ? 2 : 1, 1}, {2, -1, 0}};
    if (low) return (struct ghost){{1, 2, 3}, {3, -3, 1}};
    return (struct ghost){{n, n - 1, n - 2}, {3, -3, 1}};
}

static void pad_row(const struct facet_slope_rows *rows, double *row)
{
    const size_t w = rows->source->width;
    for (int end = 0; end < 2; end++) {
        const struct ghost h = ghost_of(end == 0, w, rows->options->border);
        double sum = 0;
        for (int k = 0; k < 3; k++)
            if (h.weight[k] != 0) sum += h.weight[k] * row[h.at[k]];
        row[end ? w + 1 : 0] = sum;
    }
}

static void read_row(struct facet_slope_rows *rows, size_t row, double *out)
{
    const size_t w = rows->source->width;
    const float *from = rows->source->row(rows->source->user, row);
    for (size_t p = 0; p < w; p++) out[p + 1] = from[p];
    pad_row(rows, out);
}

/* Reads the map up to row i, counted from 1. */
static void load(struct facet_slope_rows *rows, size_t i)
{
    const facet_map_source *s = rows->source;
    while (rows->loaded < i) {
        const size_t row = rows->loaded++, planes = s->kind == FACET_SLOPES ? 2 : 1;
        const float *from = s->row(s->user, row);
        if (!all_finite(from, planes * s->width)) note_flaws(rows, from, planes * s->width, row);
        if (rows->flaw.count) continue;
        if (s->kind == FACET_SLOPES) {
            for (size_t p = 0; p < s->width; p++) rows->at[0][p] = from[p];
            for (size_t p = 0; p < s->width; p++) rows->at[1][p] = from[s->width + p];
            continue;
        }
        double *out = rows->held[(row + 1) % HELD_ROWS];
        for (size_t p = 0; p < s->width; p++) out[p + 1] = from[p];
        pad_row(rows, out);
        if (row == 0) memcpy(rows->first, out, (s->width + 2) * sizeof *out);
    }
}

/* The ghost row above (low) or below the map, where row i - 1 or i + 1 would be held. */
static void make_ghost(struct facet_slope_rows *rows, bool low)
{
    const size_t w = rows->source->width, h = rows->source->height;
    const facet_border border = rows->options->border;
    double *out = rows->held[low ? 0 : (h + 1) % HELD_ROWS];
    if (border == FACET_PERIODIC) {
        memcpy(out, low ? rows->last : rows->first, (w + 2) * sizeof *out);
        return;
    }
    const struct ghost v = ghost_of(low, h, border);
    const double *a = rows->held[v.at[0] % HELD_ROWS];
    if (v.weight[1] == 0) {
        memcpy(out, a, (w + 2) * sizeof *out);
        return;
    }
    const double *b = rows->held[v.at[1] % HELD_ROWS], *c = rows->held[v.at[2] % HELD_ROWS];
    for (size_t p = 0; p < w + 2; p++)
        out[p] = v.weight[0] * a[p] + v.weight[1] * b[p] + v.weight[2] * c[p];
}

/* ---- Stencils ---------------------------------------------------------------------------- */

static void central_row(size_t n, const double *above, const double *here, const double *below,
                        double *restrict x, double *restrict y)
{
    const double *left = here - 1, *right = here + 1;
    for (size_t p = 0; p < n; p++) x[p] = right[p] - left[p];
    for (size_t p = 0; p < n; p++) y[p] = below[p] - above[p];
}

static void forward_row(size_t n, const double *here, const double *below, double *restrict x,
                        double *restrict y)
{
    for (size_t p = 0; p < n; p++) x[p] = here[p + 1] - here[p];
    for (size_t p = 0; p < n; p++) y[p] = below[p] - here[p];
}

/*
 * Over the unit cell x~ = a0 + (a1 - a0) v and y~ = b0 + (b1 - b0) u: linear, and
 * independent of each other, so mean (a0 + a1)/2 and variance (a1 - a0)^2/12 are
 * exact, and in units of half a difference a0 + a1 and (a1 - a0)^2/3.  Both slopes
 * vary by the same a1 - a0 = b1 - b0.
 */
static void bilinear_row(size_t n, const double *here, const double *below, double *restrict x,
                         double *restrict y, double *restrict v)
{
    for (size_t p = 0; p < n; p++) {
        const double a0 = here[p + 1] - here[p], a1 = below[p + 1] - below[p];
        const double b0 = below[p] - here[p], b1 = below[p + 1] - here[p + 1];
        x[p] = a0 + a1;
        y[p] = b0 + b1;
        v[p] = (a1 - a0) * (a1 - a0) / 3;
    }
}

/* Four sums side by side: the order is fixed, and a processor adds them at once. */
static void add_sums(struct facet_stencil_sums *sums, size_t n, const double *x, const double *y)
{
    double s[5][4] = {{0}};
    for (size_t p = 0; p < n / 4 * 4; p += 4)
        for (size_t k = 0; k < 4; k++) {
            s[0][k] += x[p + k];
            s[1][k] += y[p + k];
            s[2][k] += x[p + k] * x[p + k];
            s[3][k] += y[p + k] * y[p + k];
            s[4][k] += x[p + k] * y[p + k];
        }
    for (size_t p = n / 4 * 4; p < n; p++) {
        s[0][0] += x[p];
        s[1][0] += y[p];
        s[2][0] += x[p] * x[p];
        s[3][0] += y[p] * y[p];
        s[4][0] += x[p] * y[p];
    }
    double *const to[] = {&sums->x, &sums->y, &sums->xx, &sums->yy, &sums->xy};
    for (size_t k = 0; k < 5; k++) *to[k] += (s[k][0] + s[k][1]) + (s[k][2] + s[k][3]);
    sums->count += n;
}

/* What `stencil` sees in row i of the map, counted from 1, into at[0], at[1], and at[2] of
 * BILINEAR. */
static size_t apply(struct facet_slope_rows *rows, facet_stencil stencil, size_t i)
{
    const bool trims = rows->options->border == FACET_TRIM;
    const size_t trim = trims ? trim_of(stencil) : 0, reach = trim == 2;
    const size_t w = rows->source->width, h = rows->source->height;
    if (w <= trim || i <= reach || i > h - (trims ? 1 : 0)) return 0;
    const size_t n = w - trim, from = 1 + reach;
    const double *here = rows->held[i % HELD_ROWS] + from;
    const double *below = rows->held[(i + 1) % HELD_ROWS] + from;
    const double *above = rows->held[(i + HELD_ROWS - 1) % HELD_ROWS] + from;
    if (stencil == FACET_CENTRAL) central_row(n, above, here, below, rows->at[0], rows->at[1]);
    if (stencil == FACET_FORWARD) forward_row(n, here, below, rows->at[0], rows->at[1]);
    if (stencil == FACET_BILINEAR)
        bilinear_row(n, here, below, rows->at[0], rows->at[1], rows->at[2]);
    return n;
}

static void tally(struct facet_slope_rows *rows, facet_stencil stencil, size_t n)
{
    struct facet_stencil_sums *sums = &rows->sums[stencil];
    if (!n) return;
    add_sums(sums, n, rows->at[0], rows->at[1]);
    if (stencil != FACET_BILINEAR) return;
    double v = 0;
    for (size_t p = 0; p < n; p++) v += rows->at[2][p];
    sums->xx += v;
    sums->yy += v;
}

/* Every stencil in row i of the map, the one asked for last, so that it stays in rows->at. */
static void look(struct facet_slope_rows *rows, size_t i)
{
    const size_t h = rows->source->height;
    load(rows, i + 1 < h ? i + 1 : h);
    if (rows->flaw.count) return;
    if (i == 1) make_ghost(rows, true);
    if (i == h) make_ghost(rows, false);
    for (int s = 0; s < FACET_STENCIL_COUNT; s++)
        if (s != (int)rows->options->stencil)
            tally(rows, (facet_stencil)s, apply(rows, (facet_stencil)s, i));
    const facet_stencil stencil = rows->options->stencil;
    tally(rows, stencil, apply(rows, stencil, i));
    if (stencil == FACET_BILINEAR)
        memcpy(rows->at[3], rows->at[2], rows->width * sizeof **rows->at);
    else
        memset(rows->at[2], 0, rows->width * sizeof **rows->at);
}

bool facet_slope_rows_next(struct facet_slope_rows *rows, size_t q)
{
    const facet_map_source *s = rows->source;
    if (s->kind == FACET_SLOPES) {
        load(rows, q + 1);
        return !rows->flaw.count;
    }
    const bool trims = rows->options->border == FACET_TRIM;
    if (q == 0) {
        if (rows->options->border == FACET_PERIODIC) read_row(rows, s->height - 1, rows->last);
        /* A clamped edge looks at three rows. */
        load(rows, s->height < 3 ? s->height : 3);
        if (trims && trim_of(rows->options->stencil) == 2) look(rows, 1);
    }
    const size_t offset = trims && trim_of(rows->options->stencil) == 2 ? 2 : 1;
    if (!rows->flaw.count) look(rows, q + offset);
    return !rows->flaw.count;
}

void facet_slope_rows_finish(struct facet_slope_rows *rows)
{
    const facet_map_source *s = rows->source;
    /* The rows a trimmed map ends before, for the stencils that reach less far. */
    const bool more =
        s->kind == FACET_HEIGHTS && rows->options->border == FACET_TRIM && !rows->flaw.count;
    const size_t seen = rows->height + (trim_of(rows->options->stencil) == 2);
    if (more)
        for (size_t i = seen + 1; i <= s->height; i++) look(rows, i);
    load(rows, s->height);
}

bool facet_slope_rows_sums(const struct facet_slope_rows *rows, facet_stencil stencil,
                           facet_moments *moments)
{
    const struct facet_stencil_sums *s = &rows->sums[stencil];
    const facet_leadr_options *o = rows->options;
    if (!s->count) return false;
    const double n = (double)s->count, ux = o->scale / (span_of(stencil) * o->texel);
    const double uy = o->y_up ? -ux : ux;
    *moments = (facet_moments){ux * (s->x / n), uy * (s->y / n), ux * ux * (s->xx / n),
                               uy * uy * (s->yy / n), ux * uy * (s->xy / n)};
    return true;
}
