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
                                   const facet_leadr_options *options, size_t batch)
{
    *rows = (struct facet_slope_rows){.source = source, .options = options, .batch = batch};
    const facet_status status = facet_slope_rows_size(source, options, &rows->width, &rows->height);
    if (status != FACET_OK) return status;
    const size_t padded = source->width + 2;
    const size_t ring = source->kind == FACET_HEIGHTS ? batch + HELD_BESIDE : 0;
    set_units(rows);
    rows->ring = ring;
    rows->memory = calloc((ring + 2 + batch * CENTRAL_COUNT) * padded, sizeof *rows->memory);
    rows->row = calloc(batch, sizeof *rows->row);
    if (!rows->memory || !rows->row) return FACET_NO_MEMORY;
    rows->held = rows->memory;
    rows->first = rows->held + ring * padded;
    rows->last = rows->first + padded;
    for (size_t k = 0; k < batch * CENTRAL_COUNT; k++)
        rows->row[k / CENTRAL_COUNT].at[k % CENTRAL_COUNT] = rows->last + (k + 1) * padded;
    return FACET_OK;
}

void facet_slope_rows_close(struct facet_slope_rows *rows)
{
    free(rows->memory);
    free(rows->row);
    rows->memory = NULL;
    rows->row = NULL;
}

/* Row i of the map, counted from 1, padded. */
static double *held(const struct facet_slope_rows *rows, size_t i)
{
    return rows->held + i % rows->ring * (rows->source->width + 2);
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

/* Reads the map up to row i, counted from 1; of slopes into rows->row from 0 on. */
static void load(struct facet_slope_rows *rows, size_t i)
{
    const facet_map_source *s = rows->source;
    for (size_t k = 0; rows->loaded < i; k = (k + 1) % rows->batch) {
        const size_t row = rows->loaded++, planes = s->kind == FACET_SLOPES ? 2 : 1;
        const float *from = s->row(s->user, row);
        if (!all_finite(from, planes * s->width)) note_flaws(rows, from, planes * s->width, row);
        if (rows->flaw.count) continue;
        if (s->kind == FACET_SLOPES) {
            double *const *at = rows->row[k].at;
            for (size_t p = 0; p < s->width; p++) at[0][p] = from[p];
            for (size_t p = 0; p < s->width; p++) at[1][p] = from[s->width + p];
            continue;
        }
        double *out = held(rows, row + 1);
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
    double *out = held(rows, low ? 0 : h + 1);
    if (border == FACET_PERIODIC) {
        memcpy(out, low ? rows->last : rows->first, (w + 2) * sizeof *out);
        return;
    }
    const struct ghost v = ghost_of(low, h, border);
    const double *a = held(rows, v.at[0]);
    if (v.weight[1] == 0) {
        memcpy(out, a, (w + 2) * sizeof *out);
        return;
    }
    const double *b = held(rows, v.at[1]), *c = held(rows, v.at[2]);
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
static struct facet_stencil_sums sums_of(size_t n, const double *x, const double *y)
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
    double of[5];
    for (size_t k = 0; k < 5; k++) of[k] = (s[k][0] + s[k][1]) + (s[k][2] + s[k][3]);
    return (struct facet_stencil_sums){n, of[0], of[1], of[2], of[3], of[4], 0};
}

/* What `stencil` sees in row i of the map, counted from 1, into at[0], at[1], and at[2] of
 * BILINEAR; how many texels. */
static size_t apply(const struct facet_slope_rows *rows, facet_stencil stencil, size_t i,
                    double *const at[CENTRAL_COUNT])
{
    const bool trims = rows->options->border == FACET_TRIM;
    const size_t trim = trims ? trim_of(stencil) : 0, reach = trim == 2;
    const size_t w = rows->source->width, h = rows->source->height;
    if (w <= trim || i <= reach || i > h - (trims ? 1 : 0)) return 0;
    const size_t n = w - trim, from = 1 + reach;
    const double *above = held(rows, i - 1) + from, *here = held(rows, i) + from;
    const double *below = held(rows, i + 1) + from;
    if (stencil == FACET_CENTRAL) central_row(n, above, here, below, at[0], at[1]);
    if (stencil == FACET_FORWARD) forward_row(n, here, below, at[0], at[1]);
    if (stencil == FACET_BILINEAR) bilinear_row(n, here, below, at[0], at[1], at[2]);
    return n;
}

/* Row i by a stencil, and its sums. */
static void sum_up(const struct facet_slope_rows *rows, facet_stencil stencil, size_t i,
                   struct facet_slope_row *row)
{
    const size_t n = apply(rows, stencil, i, row->at);
    row->sums[stencil] = sums_of(n, row->at[0], row->at[1]);
    if (stencil != FACET_BILINEAR) return;
    double within = 0;
    for (size_t p = 0; p < n; p++) within += row->at[2][p];
    row->sums[stencil].within = within;
}

/* Every stencil in row i of the map, the one asked for last, so that it stays in row->at. */
static void look(const struct facet_slope_rows *rows, size_t i, struct facet_slope_row *row)
{
    const facet_stencil stencil = rows->options->stencil;
    for (int s = 0; s < FACET_STENCIL_COUNT; s++)
        if (s != (int)stencil) sum_up(rows, (facet_stencil)s, i, row);
    sum_up(rows, stencil, i, row);
    if (stencil == FACET_BILINEAR)
        memcpy(row->at[3], row->at[2], rows->width * sizeof **row->at);
    else
        memset(row->at[2], 0, rows->width * sizeof **row->at);
}

/* Whatever looking at rows first .. last of the map, counted from 1, needs. */
static bool load_around(struct facet_slope_rows *rows, size_t first, size_t last)
{
    const size_t h = rows->source->height;
    /* A clamped edge looks at three rows. */
    const size_t up_to = first == 1 && last < 2 ? 3 : last + 1;
    load(rows, up_to < h ? up_to : h);
    if (rows->flaw.count) return false;
    if (first == 1) make_ghost(rows, true);
    if (last == h) make_ghost(rows, false);
    return true;
}

/* Row i of the map only for the sums of the whole. */
static void look_beside(struct facet_slope_rows *rows, size_t i)
{
    if (!load_around(rows, i, i)) return;
    look(rows, i, rows->row);
    facet_slope_rows_tally(rows, 1);
}

/* What of the map, counted from 1, row 0 of level 0 is. */
static size_t first_row(const struct facet_slope_rows *rows)
{
    return rows->options->border == FACET_TRIM && trim_of(rows->options->stencil) == 2 ? 2 : 1;
}

bool facet_slope_rows_load(struct facet_slope_rows *rows, size_t q, size_t count)
{
    const facet_map_source *s = rows->source;
    if (s->kind == FACET_SLOPES) {
        load(rows, q + count);
        return !rows->flaw.count;
    }
    const size_t first = first_row(rows);
    if (q == 0 && rows->options->border == FACET_PERIODIC)
        read_row(rows, s->height - 1, rows->last);
    if (q == 0 && first == 2) look_beside(rows, 1);
    return !rows->flaw.count && load_around(rows, q + first, q + first + count - 1);
}

void facet_slope_rows_make(const struct facet_slope_rows *rows, size_t q, size_t k)
{
    if (rows->source->kind == FACET_HEIGHTS) look(rows, q + k + first_row(rows), &rows->row[k]);
}

void facet_slope_rows_tally(struct facet_slope_rows *rows, size_t count)
{
    for (size_t k = 0; k < count; k++)
        for (int s = 0; s < FACET_STENCIL_COUNT; s++) {
            const struct facet_stencil_sums *row = &rows->row[k].sums[s];
            struct facet_stencil_sums *sums = &rows->sums[s];
            sums->count += row->count;
            sums->x += row->x;
            sums->y += row->y;
            sums->xx += row->xx;
            sums->yy += row->yy;
            sums->xy += row->xy;
            sums->within += row->within;
        }
}

void facet_slope_rows_finish(struct facet_slope_rows *rows)
{
    const facet_map_source *s = rows->source;
    /* The rows a trimmed map ends before, for the stencils that reach less far. */
    if (s->kind == FACET_HEIGHTS && rows->options->border == FACET_TRIM && !rows->flaw.count)
        for (size_t i = rows->height + first_row(rows); i <= s->height && !rows->flaw.count; i++)
            look_beside(rows, i);
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
    const double xx = s->xx + s->within, yy = s->yy + s->within;
    *moments = (facet_moments){ux * (s->x / n), uy * (s->y / n), ux * ux * (xx / n),
                               uy * uy * (yy / n), ux * uy * (s->xy / n)};
    return true;
}
