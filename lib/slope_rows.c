/* slope_rows.c - heights to slopes to moments: stencils and borders (Dupuy section 3.4). */
#include "slope_rows.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

static const size_t NOT_HELD = SIZE_MAX;

facet_status facet_slope_rows_open(struct facet_slope_rows *rows, const facet_height_map *map,
                                   const facet_leadr_options *o)
{
    *rows = (struct facet_slope_rows){.map = map, .stencil = o->stencil, .border = o->border};
    if (!(isfinite(o->scale) && isfinite(o->texel) && o->texel > 0)) return FACET_BAD_SIZE;
    if (map->width == 0 || map->height == 0 || map->width > FACET_MAP_SIDE_MAX ||
        map->height > FACET_MAP_SIDE_MAX || map->width * map->height > FACET_MAP_PIXELS_MAX)
        return FACET_BAD_SIZE;
    size_t trimmed = 0;
    if (o->border == FACET_TRIM) trimmed = o->stencil == FACET_CENTRAL ? 2 : 1;
    if (map->width <= trimmed || map->height <= trimmed) return FACET_BAD_SIZE;
    rows->width = map->width - trimmed;
    rows->height = map->height - trimmed;
    rows->offset = trimmed == 2;
    const double span = o->stencil == FACET_CENTRAL ? 2 : 1; /* texels between the two heights */
    rows->per_x = o->scale / (span * o->texel);
    rows->per_y = o->y_up ? -rows->per_x : rows->per_x;
    rows->padded = malloc(3 * (map->width + 2) * sizeof *rows->padded);
    for (int i = 0; i < 3; i++) rows->held[i] = NOT_HELD;
    return rows->padded ? FACET_OK : FACET_NO_MEMORY;
}

void facet_slope_rows_close(struct facet_slope_rows *rows)
{
    free(rows->padded);
    rows->padded = NULL;
}

/*
 * The height at an edge's ghost as a weighted sum of texels of the map; i counts
 * from 1, so that 0 and n + 1 are the ghosts.
 */
struct ghost {
    size_t at[3]; /* from 0 */
    double weight[3];
};

static struct ghost ghost_of(size_t i, size_t n, facet_border border)
{
    if (i >= 1 && i <= n) return (struct ghost){{i - 1, 0, 0}, {1, 0, 0}};
    const bool low = i == 0;
    if (border == FACET_PERIODIC) return (struct ghost){{low ? n - 1 : 0, 0, 0}, {1, 0, 0}};
    /* TRIM never looks at a ghost; any height will do. */
    if (border != FACET_CLAMP || n == 1) return (struct ghost){{low ? 0 : n - 1, 0, 0}, {1, 0, 0}};
    if (n == 2) return (struct ghost){{!low, low, 0}, {2, -1, 0}};
    if (low) return (struct ghost){{0, 1, 2}, {3, -3, 1}};
    return (struct ghost){{n - 1, n - 2, n - 3}, {3, -3, 1}};
}

/* Row i - 1 of the map with its ghosts, i = 0 .. height + 1. */
static const double *padded_row(struct facet_slope_rows *rows, size_t i)
{
    const size_t w = rows->map->width, slot = i % 3;
    double *out = rows->padded + slot * (w + 2);
    if (rows->held[slot] == i) return out;
    rows->held[slot] = i;
    const struct ghost v = ghost_of(i, rows->map->height, rows->border);
    const float *z = rows->map->heights;
    if (v.weight[1] == 0) {
        for (size_t p = 0; p < w; p++) out[p + 1] = z[v.at[0] * w + p];
    } else {
        for (size_t p = 0; p < w; p++)
            out[p + 1] = v.weight[0] * z[v.at[0] * w + p] + v.weight[1] * z[v.at[1] * w + p] +
                         v.weight[2] * z[v.at[2] * w + p];
    }
    for (size_t end = 0; end <= w + 1; end += w + 1) {
        const struct ghost h = ghost_of(end, w, rows->border);
        double sum = 0;
        for (int k = 0; k < 3; k++)
            if (h.weight[k] != 0) sum += h.weight[k] * out[1 + h.at[k]];
        out[end] = sum;
    }
    return out;
}

static void central_row(const struct facet_slope_rows *rows, const double *above,
                        const double *here, const double *below, double *const e[MOMENT_COUNT])
{
    for (size_t p = 0; p < rows->width; p++) {
        const double x = rows->per_x * (here[p + 1] - here[p - 1]);
        const double y = rows->per_y * (below[p] - above[p]);
        e[0][p] = x;
        e[1][p] = y;
        e[2][p] = x * x;
        e[3][p] = y * y;
        e[4][p] = x * y;
    }
}

static void forward_row(const struct facet_slope_rows *rows, const double *here,
                        const double *below, double *const e[MOMENT_COUNT])
{
    for (size_t p = 0; p < rows->width; p++) {
        const double x = rows->per_x * (here[p + 1] - here[p]);
        const double y = rows->per_y * (below[p] - here[p]);
        e[0][p] = x;
        e[1][p] = y;
        e[2][p] = x * x;
        e[3][p] = y * y;
        e[4][p] = x * y;
    }
}

/*
 * Over the unit cell x~ = a0 + (a1 - a0) v and y~ = b0 + (b1 - b0) u: linear, and
 * independent of each other, so the moments are closed.
 */
static void bilinear_row(const struct facet_slope_rows *rows, const double *here,
                         const double *below, double *const e[MOMENT_COUNT])
{
    for (size_t p = 0; p < rows->width; p++) {
        const double a0 = rows->per_x * (here[p + 1] - here[p]);
        const double a1 = rows->per_x * (below[p + 1] - below[p]);
        const double b0 = rows->per_y * (below[p] - here[p]);
        const double b1 = rows->per_y * (below[p + 1] - here[p + 1]);
        e[0][p] = (a0 + a1) / 2;
        e[1][p] = (b0 + b1) / 2;
        e[2][p] = (a0 * a0 + a0 * a1 + a1 * a1) / 3;
        e[3][p] = (b0 * b0 + b0 * b1 + b1 * b1) / 3;
        e[4][p] = e[0][p] * e[1][p];
    }
}

void facet_slope_rows_get(struct facet_slope_rows *rows, size_t q, double *const e[MOMENT_COUNT])
{
    const size_t i = q + rows->offset + 1, first = rows->offset + 1;
    const double *here = padded_row(rows, i) + first, *below = padded_row(rows, i + 1) + first;
    switch (rows->stencil) {
    case FACET_FORWARD:
        forward_row(rows, here, below, e);
        return;
    case FACET_BILINEAR:
        bilinear_row(rows, here, below, e);
        return;
    default:
        central_row(rows, padded_row(rows, i - 1) + first, here, below, e);
        return;
    }
}
