#include "mip_rows.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

size_t facet_mip_side(size_t side, size_t level)
{
    return side >> level ? side >> level : 1;
}

size_t facet_mip_level_count(size_t width, size_t height)
{
    size_t count = 1;
    while (width >> count || height >> count) count++;
    return count;
}

/* ---- Spans --------------------------------------------------------------------------------- */

/*
 * Of a side of m texels under one of n, n <= m: both tile an interval of length m n,
 * with texels of length n and m, so that every share is an integer and sums of
 * slopes by them are exact as long as they fit a double.
 */
static struct span span_of(size_t m, size_t n, size_t i)
{
    const size_t low = i * m, high = low + m, first = low / n, last = (high - 1) / n;
    if (first == last) return (struct span){first, last, (double)m, 0, 0, (double)m};
    return (struct span){
        first,    last, (double)((first + 1) * n - low), (double)n, (double)(high - last * n),
        (double)m};
}

static struct span *spans_of(size_t m, size_t n)
{
    struct span *spans = malloc(n * sizeof *spans);
    for (size_t i = 0; spans && i < n; i++) spans[i] = span_of(m, n, i);
    return spans;
}

/* ---- Open ------------------------------------------------------------------------------------ */

/* Rows of l that `rows` of its parent, in a row, finish at most. */
static size_t finished_by(const struct mip_level *l, const struct mip_level *p, size_t rows)
{
    const size_t most = rows * l->height / p->height + 2;
    return most < rows ? most : rows;
}

static facet_status open_level(struct mip_rows *mip, size_t index)
{
    struct mip_level *l = &mip->level[index];
    const struct mip_level *p = &mip->level[l->parent];
    if (p->width != l->width && p->width != 2 * l->width) {
        l->columns = spans_of(p->width, l->width);
        if (!l->columns) return FACET_NO_MEMORY;
    }
    l->batch = finished_by(l, p, p->batch);
    /* A span that lacks one row, and a batch; of two that share a row, the second also holds it. */
    l->capacity = (p->height + l->height - 1) / l->height + 1 + p->batch;
    l->memory = malloc((l->capacity + l->batch) * CENTRAL_COUNT * l->width * sizeof *l->memory);
    return l->memory ? FACET_OK : FACET_NO_MEMORY;
}

facet_status facet_mip_rows_open(struct mip_rows *mip, size_t width, size_t height, size_t batch)
{
    facet_status status = FACET_OK;
    mip->count = facet_mip_level_count(width, height);
    for (size_t i = 0; i < mip->count; i++) {
        struct mip_level *l = &mip->level[i];
        *l = (struct mip_level){
            .width = facet_mip_side(width, i), .height = facet_mip_side(height, i), .batch = batch};
        /* The coarsest level whose texels do not straddle this one's; 0 may. */
        for (size_t p = i; p-- > 0 && !l->parent;)
            if (mip->level[p].width % l->width == 0 && mip->level[p].height % l->height == 0)
                l->parent = p;
    }
    for (size_t i = 1; i < mip->count && status == FACET_OK; i++) status = open_level(mip, i);
    return status;
}

void facet_mip_rows_close(struct mip_rows *mip)
{
    for (size_t i = 0; i < mip->count; i++) {
        free(mip->level[i].columns);
        free(mip->level[i].memory);
    }
    mip->count = 0;
}

/* ---- Merge ---------------------------------------------------------------------------------- */

/* Neighbours, two by two. */
static void squeeze_pairs(size_t n, double *const from[CENTRAL_COUNT],
                          double *restrict const to[CENTRAL_COUNT])
{
    const double *x = from[0], *y = from[1];
    for (size_t i = 0; i < n; i++) {
        const double dx = (x[2 * i] - x[2 * i + 1]) / 2, dy = (y[2 * i] - y[2 * i + 1]) / 2;
        to[2][i] = (from[2][2 * i] + from[2][2 * i + 1]) / 2 + dx * dx;
        to[3][i] = (from[3][2 * i] + from[3][2 * i + 1]) / 2 + dy * dy;
        to[4][i] = (from[4][2 * i] + from[4][2 * i + 1]) / 2 + dx * dy;
        to[0][i] = (x[2 * i] + x[2 * i + 1]) / 2;
        to[1][i] = (y[2 * i] + y[2 * i + 1]) / 2;
    }
}

/* Two rows. */
static void merge_pair(size_t n, const double *const a[CENTRAL_COUNT],
                       const double *const b[CENTRAL_COUNT],
                       double *restrict const to[CENTRAL_COUNT])
{
    for (size_t i = 0; i < n; i++) {
        const double dx = (a[0][i] - b[0][i]) / 2, dy = (a[1][i] - b[1][i]) / 2;
        to[2][i] = (a[2][i] + b[2][i]) / 2 + dx * dx;
        to[3][i] = (a[3][i] + b[3][i]) / 2 + dy * dy;
        to[4][i] = (a[4][i] + b[4][i]) / 2 + dx * dy;
        to[0][i] = (a[0][i] + b[0][i]) / 2;
        to[1][i] = (a[1][i] + b[1][i]) / 2;
    }
}

/* Values `stride` apart, in a ring of `capacity`; the span starts at `start`. */
struct line {
    size_t start, stride, capacity;
};

static size_t place_of(const struct line *l, size_t j)
{
    const size_t i = l->start + j;
    return (i >= l->capacity ? i - l->capacity : i) * l->stride;
}

/* Adds term(first + j) for j = 0 .. n - 1 by their shares, from both ends: those inside weigh
 * alike. */
#define SPAN_SUM(total, s, n, term)                                                                \
    do {                                                                                           \
        double inside = 0;                                                                         \
        size_t a = 1, b = (n)-1;                                                                   \
        for (; a + 1 < b; a++, b--) inside += term(a) + term(b - 1);                               \
        if (a < b) inside += term(a);                                                              \
        (total) = (((s)->low * term(0) + (s)->high * term((n)-1)) + (s)->whole * inside) /         \
                  (s)->all;                                                                        \
    } while (0)

/* One texel from a span of texels in the planes of `from`. */
static void merge_span(const struct span *s, const double *const from[CENTRAL_COUNT],
                       const struct line *line, double out[CENTRAL_COUNT])
{
    const size_t n = s->last - s->first + 1;
    const double *x = from[0], *y = from[1];
    if (n == 1) {
        for (size_t k = 0; k < CENTRAL_COUNT; k++) out[k] = from[k][place_of(line, 0)];
        return;
    }
#define VALUE(j) values[place_of(line, j)]
    for (size_t k = 0; k < CENTRAL_COUNT; k++) {
        const double *values = from[k];
        SPAN_SUM(out[k], s, n, VALUE);
    }
#undef VALUE
    double xx, yy, xy;
#define DX(j) (x[place_of(line, j)] - out[0])
#define DY(j) (y[place_of(line, j)] - out[1])
#define XX(j) (DX(j) * DX(j))
#define YY(j) (DY(j) * DY(j))
#define XY(j) (DX(j) * DY(j))
    SPAN_SUM(xx, s, n, XX);
    SPAN_SUM(yy, s, n, YY);
    SPAN_SUM(xy, s, n, XY);
#undef DX
#undef DY
#undef XX
#undef YY
#undef XY
    out[2] += xx;
    out[3] += yy;
    out[4] += xy;
}

/* One row of the parent to this level's width. */
static void squeeze(const struct mip_level *l, size_t parent_width,
                    double *const from[CENTRAL_COUNT], double *const to[CENTRAL_COUNT])
{
    if (l->columns) {
        const double *const planes[] = {from[0], from[1], from[2], from[3], from[4]};
        for (size_t i = 0; i < l->width; i++) {
            const struct line line = {l->columns[i].first, 1, SIZE_MAX};
            double out[CENTRAL_COUNT];
            merge_span(&l->columns[i], planes, &line, out);
            for (size_t k = 0; k < CENTRAL_COUNT; k++) to[k][i] = out[k];
        }
    } else if (parent_width == l->width) {
        for (size_t k = 0; k < CENTRAL_COUNT; k++) memcpy(to[k], from[k], l->width * sizeof **to);
    } else {
        squeeze_pairs(l->width, from, to);
    }
}

/* Row i of the parent among those held: planes of l->width each. */
static double *held(const struct mip_level *l, size_t i)
{
    return l->memory + i % l->capacity * CENTRAL_COUNT * l->width;
}

/* The rows of a span, merged into `to`. */
static void merge_rows(const struct mip_level *l, const struct span *s,
                       double *const to[CENTRAL_COUNT])
{
    const size_t n = l->width;
    const double *a = held(l, s->first), *b = held(l, s->last);
    if (s->last == s->first + 1 && s->low == s->high) {
        const double *const pa[] = {a, a + n, a + 2 * n, a + 3 * n, a + 4 * n};
        const double *const pb[] = {b, b + n, b + 2 * n, b + 3 * n, b + 4 * n};
        merge_pair(n, pa, pb, to);
        return;
    }
    const struct line line = {s->first % l->capacity, CENTRAL_COUNT * n, l->capacity};
    for (size_t i = 0; i < n; i++) {
        const double *at = l->memory + i, *const planes[] = {at, at + n, at + 2 * n, at + 3 * n,
                                                             at + 4 * n};
        double out[CENTRAL_COUNT];
        merge_span(s, planes, &line, out);
        for (size_t k = 0; k < CENTRAL_COUNT; k++) to[k][i] = out[k];
    }
}

void facet_mip_rows_squeeze(struct mip_rows *mip, size_t level, size_t row,
                            double *const at[CENTRAL_COUNT])
{
    for (size_t i = level + 1; i < mip->count; i++) {
        struct mip_level *l = &mip->level[i];
        if (l->parent != level) continue;
        const size_t n = l->width;
        double *to = held(l, row);
        double *const planes[] = {to, to + n, to + 2 * n, to + 3 * n, to + 4 * n};
        squeeze(l, mip->level[level].width, at, planes);
    }
}

size_t facet_mip_rows_ready(const struct mip_rows *mip, size_t level, size_t rows)
{
    const struct mip_level *l = &mip->level[level], *p = &mip->level[l->parent];
    size_t ready = l->done;
    while (ready < l->height && span_of(p->height, l->height, ready).last < rows) ready++;
    return ready;
}

void facet_mip_rows_merge(const struct mip_rows *mip, size_t level, size_t k,
                          double *at[CENTRAL_COUNT])
{
    const struct mip_level *l = &mip->level[level], *p = &mip->level[l->parent];
    double *to = l->memory + (l->capacity + k) * CENTRAL_COUNT * l->width;
    for (size_t j = 0; j < CENTRAL_COUNT; j++) at[j] = to + j * l->width;
    const struct span s = span_of(p->height, l->height, l->done + k);
    merge_rows(l, &s, at);
}
