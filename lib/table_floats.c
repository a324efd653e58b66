/*
 * table_floats.c - a slope table for the float tiers: its coefficients in floats, and what floats lose of it.
 */
#include "slope_table.h"

#include <math.h>
#include <stdlib.h>

#define LOG2_E 1.44269504088896340736

/*
 * Down to here log_q counts: where sigma is 1e-10 of s, and no less is asked of floats (LOG_PSI_BEHIND), D
 * of FACET_FLOOR times that still makes a pdf of FACET_FLOOR.
 */
#define LOG_Q_FAINT (log(FACET_FLOOR) - 23)
#define LOG_PSI_BEHIND (-23.0)
/* Of behind_most: its square times that of any alpha is a float. */
#define BEHIND_ALL 1e14

/* ---- What floats lose ----------------------------------------------------------------------- */

/* A logarithm at u of a table of that scale, its derivatives by u and by the azimuth, and the size of
 * what is rounded for it. */
struct look {
    double scale, u, y, per_u, per_turn, size;
};

/* share: what part of the result it is of. */
static void reach_to(struct slope_reach *reach, struct look l, double share)
{
    double u = l.u, rest = 1 - u;
    reach->size = fmax(reach->size, share * l.size);
    reach->gain = fmax(reach->gain, share * (fabs(l.per_u) * fmin(u, rest) + fabs(l.per_turn)));
    reach->rise = fmax(reach->rise, share * (fabs(l.per_u) * u + fabs(l.per_turn)));
    reach->most = fmax(reach->most, l.y);
    /* Of log P, P = exp(log_q) (1 - u)^4: du = (1 - u)^2 dr/scale, and along the azimuth r dturn. */
    double across = u > 0 ? fabs(l.per_turn) / FACET_PI * rest / u : 0;
    reach->steep = fmax(reach->steep, (fabs(l.per_u * rest - 4) * rest + across) / l.scale);
}

/* Of sigma = |c| + S w exp(log_psi), w = S/(S + |c|). */
static double excess_share(double w, double y)
{
    double excess = w * w * exp(fmin(y, 300));
    return excess / (1 - w + excess);
}

/* Of a cell; more of one that falls to nothing. */
enum { STEPS = 4, STEPS_FALLING = 64 };

/* Cubics of a table, and what is looked for: down to `least`, as its part of sigma or by itself. */
struct walk {
    struct kernel_cubic f;
    double scale, least;
    bool is_shared;
    struct slope_reach *reach;
};

/* How many places are above `least`. */
static int walk_steps(const struct walk *w, size_t i, int steps)
{
    const double *c = w->f.c + 4 * i, cells = (double)w->f.cells;
    int above = 0;
    for (int k = 0; k <= steps; k++) {
        double t = (double)k / steps;
        double y = c[0] + t * (c[1] + t * (c[2] + t * c[3]));
        struct look l = {w->scale, ((double)i + t) / cells,
                         y,        (c[1] + t * (2 * c[2] + t * 3 * c[3])) * cells,
                         0,        fabs(y)};
        if (l.y < w->least) continue;
        reach_to(w->reach, l, w->is_shared ? excess_share(l.u, l.y) : 1);
        above++;
    }
    return above;
}

/* Whether it is all above. */
static bool walk_cell(const struct walk *w, size_t i)
{
    int above = walk_steps(w, i, STEPS);
    bool whole = above == STEPS + 1;
    if (above && !whole) walk_steps(w, i, STEPS_FALLING);
    return whole;
}

static void walk_all(const struct walk *w)
{
    for (size_t i = 0; i < w->f.cells; i++) walk_cell(w, i);
}

static void measure_radial(facet_slope_table *table)
{
    double b = table->view.psi_scale;
    struct kernel_cubic psi = table->view.log_psi;
    walk_all(
        &(struct walk){table->view.log_q, table->view.slope_scale, LOG_Q_FAINT, false, &table->q});
    walk_all(&(struct walk){psi, b, KERNEL_LOG_ZERO, true, &table->psi});
    /* D = P (1 + r^2)^2, P = exp(log_q) (1 - u)^4, and d u/d log r = u (1 - u). */
    table->gain = 4 + table->q.gain;
    walk_all(&(struct walk){psi, b, log(FACET_FLOOR), false, &table->far_behind});
    const struct walk behind = {psi, b, LOG_PSI_BEHIND, false, &table->behind};
    size_t first = psi.cells;
    while (first > 0 && walk_cell(&behind, first - 1)) first--;
    double w = (double)first / (double)psi.cells;
    table->view.behind_most = w > 0 ? fmin(b * (1 - w) / w, BEHIND_ALL) : BEHIND_ALL;
}

/* At the corner of a patch: sheets are smooth. */
static struct look look_at_patch(const struct kernel_sheet *f, size_t k, double scale)
{
    const double *c = f->c + 16 * k;
    return (struct look){scale,
                         (double)(k % f->cells) / (double)f->cells,
                         c[0],
                         c[1] * (double)f->cells,
                         c[4] * (double)f->turns,
                         fabs(c[0])};
}

/* The same of log_psi (kernels.h). */
static struct look look_at_psi(const struct kernel_table *view, size_t k)
{
    struct look l = look_at_patch(&view->turned_psi, k, view->slope_scale);
    double f = fmax(l.y, KERNEL_PSI_LEAST), below = KERNEL_PSI_UNIT / f;
    l.y = view->psi_top - below;
    l.per_u *= below / f;
    l.per_turn *= below / f;
    l.size = below;
    return l;
}

static void measure_turned(facet_slope_table *table)
{
    struct kernel_table *view = &table->view;
    const struct kernel_sheet *q = &view->turned_q, *psi = &view->turned_psi;
    size_t lost = psi->cells; /* the first of cells that floats lose somewhere */
    for (size_t k = 0; k < q->cells * q->turns; k++) {
        struct look l = look_at_patch(q, k, view->slope_scale);
        if (l.y >= LOG_Q_FAINT) reach_to(&table->q, l, 1);
    }
    for (size_t k = 0; k < psi->cells * psi->turns; k++) {
        struct look l = look_at_psi(view, k);
        if (l.y >= KERNEL_LOG_ZERO) reach_to(&table->psi, l, excess_share(1 - l.u, l.y));
        if (l.y >= log(FACET_FLOOR)) reach_to(&table->far_behind, l, 1);
        if (l.y >= LOG_PSI_BEHIND)
            reach_to(&table->behind, l, 1);
        else if (k % psi->cells < lost)
            lost = k % psi->cells;
    }
    double u = lost > 0 ? (double)(lost - 1) / (double)psi->cells : 0;
    view->behind_most = fmin(view->slope_scale * u / (1 - u), BEHIND_ALL);
}

void facet_slope_table_measure(facet_slope_table *table)
{
    if (facet_slope_table_is_turned(&table->view))
        measure_turned(table);
    else
        measure_radial(table);
}

/* ---- In floats ------------------------------------------------------------------------------ */

/* Cubics in t times a unit, those from the other end in 1 - t. */
static void put_cubics(const double *c, size_t count, double unit, bool back, float *to)
{
    for (size_t i = 0; i < 4 * count; i += 4) {
        double d[4] = {c[i], c[i + 1], c[i + 2], c[i + 3]};
        if (back) {
            d[0] = c[i] + c[i + 1] + c[i + 2] + c[i + 3];
            d[1] = -(c[i + 1] + 2 * c[i + 2] + 3 * c[i + 3]);
            d[2] = c[i + 2] + 3 * c[i + 3];
            d[3] = -c[i + 3];
        }
        for (int j = 0; j < 4; j++) to[i + (size_t)j] = (float)(unit * d[j]);
    }
}

/* rows of cells of `count` cubics each; turned_over: over 1 - u. */
static void put_halves(const double *c, size_t count, double unit, bool turned_over, float *to,
                       struct kernel_halves *halves)
{
    size_t rows = halves->turns ? halves->turns : 1;
    for (size_t side = 0; side < 2; side++)
        for (size_t j = 0; j < rows; j++)
            for (size_t i = 0; i < halves->half; i++) {
                bool back = (side == 1) != turned_over;
                size_t cell = back ? halves->cells - 1 - i : i;
                put_cubics(c + 4 * count * (halves->cells * j + cell), count, unit, back,
                           to + 4 * count * ((rows * side + j) * halves->half + i));
            }
    halves->c = to;
}

static struct kernel_halves halves_of(const struct kernel_cubic *cubic,
                                      const struct kernel_sheet *sheet)
{
    size_t cells = sheet->turns ? sheet->cells : cubic->cells;
    return (struct kernel_halves){NULL, cells, (cells + 1) / 2, sheet->turns};
}

static size_t numbers_of(const struct kernel_halves *halves)
{
    return 2 * halves->half * (halves->turns ? 16 * halves->turns : 4);
}

static struct kernel_floats *make_floats(const struct kernel_table *view)
{
    struct kernel_halves q = halves_of(&view->log_q, &view->turned_q),
                         psi = halves_of(&view->log_psi, &view->turned_psi);
    struct kernel_floats *floats = malloc(sizeof *floats +
                                          (numbers_of(&q) + numbers_of(&psi)) * sizeof(float));
    if (!floats) return NULL;
    bool turned = q.turns > 0;
    put_halves(turned ? view->turned_q.c : view->log_q.c, turned ? 4 : 1, LOG2_E, false, floats->c,
               &q);
    put_halves(turned ? view->turned_psi.c : view->log_psi.c, turned ? 4 : 1,
               turned ? 1 / (LOG2_E * KERNEL_PSI_UNIT) : LOG2_E, turned, floats->c + numbers_of(&q),
               &psi);
    floats->q = q;
    floats->psi = psi;
    return floats;
}

bool facet_slope_table_has_floats(const facet_slope_table *table)
{
    /* It is a cache: the table that callers see does not change. */
    _Atomic(struct kernel_floats *) *kept = (_Atomic(struct kernel_floats *) *)&table->view.floats;
    struct kernel_floats *none = NULL;
    if (atomic_load_explicit(kept, memory_order_acquire)) return true;
    struct kernel_floats *made = make_floats(&table->view);
    if (made && !atomic_compare_exchange_strong(kept, &none, made))
        free(made); /* another thread was first */
    return made;
}
