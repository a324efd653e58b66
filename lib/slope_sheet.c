#include "slope_sheet.h"

#include "slope_spline.h"

#include <math.h>
#include <stdlib.h>

/* Nodes before and after a turn around, so that the spline along it is the same wherever it starts. */
enum { WRAP = 12 };

/* Derivatives along u this steep, per cell, lie at breaks or where D is nothing: they do not bend
 * the azimuth. */
#define STEEP 20.0

struct sheet {
    size_t n, turns, parts, cells;
    const double *y;
    double *row;            /* [turn][cell][4]: cubics along u */
    double *ahead, *behind; /* [knot][turn]: derivatives along the azimuth after node turn and
                               before the next */
    double *column, *cubics, *work;
};

/* Of row j (any number) at the start of cell `knot`; the nodes themselves are exact. */
static double value_at(const struct sheet *s, size_t knot, size_t j)
{
    size_t turn = j % s->turns;
    if (knot % s->parts == 0) return s->y[turn * s->n + knot / s->parts];
    return s->row[4 * (turn * s->cells + knot)];
}

static double along_u(const struct sheet *s, size_t cell, int end, size_t j)
{
    const double *c = s->row + 4 * (j % s->turns * s->cells + cell);
    return end ? c[1] + 2 * c[2] + 3 * c[3] : c[1];
}

/* Congruent to -WRAP. */
static size_t first_wrapped(size_t turns)
{
    return turns * WRAP - WRAP;
}

facet_status facet_slope_refine(const double *y, size_t n, size_t turns, size_t parts, double *fine)
{
    size_t column = turns + 1 + 2 * WRAP;
    double *room = malloc((3 + 4 * parts) * column * sizeof *room);
    if (!room) return FACET_NO_MEMORY;
    for (size_t i = 0; i < n; i++) {
        const double *c = room + 3 * column + 4 * WRAP * parts;
        for (size_t k = 0; k < column; k++) room[k] = y[(first_wrapped(turns) + k) % turns * n + i];
        facet_slope_spline(room, column, parts, NULL, room + 3 * column, room + column);
        for (size_t j = 0; j < turns * parts; j++)
            fine[j * n + i] = j % parts ? c[4 * j] : y[j / parts * n + i];
    }
    free(room);
    return FACET_OK;
}

static void turn_columns(struct sheet *s)
{
    size_t count = s->turns + 1 + 2 * WRAP, before = first_wrapped(s->turns);
    for (size_t knot = 0; knot <= s->cells; knot++) {
        for (size_t k = 0; k < count; k++) s->column[k] = value_at(s, knot, before + k);
        facet_slope_spline(s->column, count, 1, NULL, s->cubics, s->work);
        for (size_t j = 0; j < s->turns; j++) {
            const double *c = s->cubics + 4 * (j + WRAP);
            s->ahead[knot * s->turns + j] = c[1];
            s->behind[knot * s->turns + j] = c[1] + 2 * c[2] + 3 * c[3];
        }
    }
}

/* The mixed derivative at row j, by central differences of the fourth order. */
static double mixed(const struct sheet *s, size_t cell, int end, size_t j)
{
    double d[5];
    for (size_t k = 0; k < 5; k++) {
        d[k] = along_u(s, cell, end, j + 2 * s->turns + k - 2);
        if (!(fabs(d[k]) <= STEEP)) return 0;
    }
    return (8 * (d[3] - d[1]) - (d[4] - d[0])) / 12;
}

static void fill_patch(const struct sheet *s, size_t i, size_t j, double *c)
{
    double value[2][4], slope[2][4], line[4];
    for (size_t b = 0; b < 2; b++) {
        const double *along = (b ? s->behind : s->ahead) + i * s->turns + j;
        slope_hermite(value_at(s, i, j + b), value_at(s, i + 1, j + b), along_u(s, i, 0, j + b),
                      along_u(s, i, 1, j + b), value[b]);
        slope_hermite(along[0], along[s->turns], mixed(s, i, 0, j + b), mixed(s, i, 1, j + b),
                      slope[b]);
    }
    for (size_t m = 0; m < 4; m++) {
        slope_hermite(value[0][m], value[1][m], slope[0][m], slope[1][m], line);
        for (size_t k = 0; k < 4; k++) c[4 * k + m] = line[k];
    }
}

facet_status facet_slope_sheet(const double *y, size_t n, size_t turns, size_t parts,
                               const double *first, double *c)
{
    size_t cells = (n - 1) * parts, patches = cells * turns, knots = (cells + 1) * turns,
           column = turns + 1 + 2 * WRAP;
    size_t spline = 2 * (n > column ? n : column);
    double *room = malloc((4 * patches + 2 * knots + 5 * column + spline) * sizeof *room);
    if (!room) return FACET_NO_MEMORY;
    struct sheet s = {.n = n, .turns = turns, .parts = parts, .cells = cells, .y = y, .row = room};
    s.ahead = room + 4 * patches;
    s.behind = s.ahead + knots;
    s.column = s.behind + knots;
    s.cubics = s.column + column;
    s.work = s.cubics + 4 * column;
    for (size_t j = 0; j < turns; j++)
        facet_slope_spline(y + j * n, n, parts, &first[j], s.row + 4 * j * cells, s.work);
    turn_columns(&s);
    for (size_t j = 0; j < turns; j++)
        for (size_t i = 0; i < cells; i++) fill_patch(&s, i, j, c + 16 * (j * cells + i));
    free(room);
    return FACET_OK;
}
