#include "slope_turned.h"

#include "gauss.h"
#include "slope_sheet.h"
#include "watch.h"

#include <math.h>

enum { POINTS_U = 8, POINTS_TURN = 6, PARTS_U_MAX = 64, PARTS_TURN_MAX = 32 };
/*
 * Variation of log_q on one part.  Over one that is straight 8 points integrate exp to rounding; they are
 * as many for what bends within a cell, where nodes are few.  Of equal rows at 25 nodes the sum is
 * that of the radial table to 3e-12; 4 points left 1e-6 at 4 nodes.  Of ellipses, 1e-12.
 */
#define VARIATION_U 1.0
#define VARIATION_TURN 2.5
/* So far below the peak there is nothing to add. */
#define NEGLIGIBLE 50.0
enum { LOOKS = 3 };

struct plane {
    const struct kernel_table *table;
    double node_u[POINTS_U], weight_u[POINTS_U], node_turn[POINTS_TURN], weight_turn[POINTS_TURN];
    double peak;
    struct slope_sums sums;
};

/* Values of a patch at LOOKS x LOOKS places, rows along u. */
struct patch {
    double y[LOOKS][LOOKS], peak;
    size_t parts_u, parts_turn;
};

/* As many as keep the variation of one below the limit, `step` being that over one of LOOKS - 1. */
static size_t parts_of(double step, double limit, double most)
{
    return (size_t)fmin(most, fmax(1, ceil((LOOKS - 1) * step / limit)));
}

static struct patch look_at(const struct plane *p, size_t i, size_t j)
{
    struct kernel_sheet sheet = p->table->turned_q;
    struct patch patch = {.peak = -INFINITY};
    double most_u = 0, most_turn = 0;
    for (int k = 0; k < LOOKS; k++) {
        for (int m = 0; m < LOOKS; m++) {
            double y = slope_patch_at(sheet.c + 16 * (sheet.cells * j + i), m / (LOOKS - 1.),
                                      k / (LOOKS - 1.));
            patch.y[k][m] = y;
            patch.peak = fmax(patch.peak, y);
            if (m) most_u = fmax(most_u, fabs(y - patch.y[k][m - 1]));
            if (k) most_turn = fmax(most_turn, fabs(y - patch.y[k - 1][m]));
        }
    }
    patch.parts_u = parts_of(most_u, VARIATION_U, PARTS_U_MAX);
    patch.parts_turn = parts_of(most_turn, VARIATION_TURN, PARTS_TURN_MAX);
    return patch;
}

/* The steepest that log D is in a patch: D = P (1 + r^2)^2, with P = exp(log_q) (1 - u)^4 and d u/d
 * log r = u (1 - u). */
static void measure_gain(struct plane *p, const struct patch *patch, size_t i)
{
    struct kernel_sheet sheet = p->table->turned_q;
    double per_u = (LOOKS - 1) * (double)sheet.cells,
           per_turn = (LOOKS - 1) * (double)sheet.turns / FACET_PI;
    for (int k = 0; k < LOOKS; k++) {
        for (int m = 0; m < LOOKS; m++) {
            double u = ((double)i + m / (LOOKS - 1.)) / (double)sheet.cells, y = patch->y[k][m];
            if (y < p->peak + log(FACET_FLOOR)) continue;
            if (m)
                p->sums.gain = fmax(p->sums.gain,
                                    4 + u * (1 - u) * per_u * fabs(y - patch->y[k][m - 1]));
            if (k) p->sums.gain = fmax(p->sums.gain, per_turn * fabs(y - patch->y[k - 1][m]));
        }
    }
}

/*
 * The integrals along cell i at one azimuth, cut into parts: P r dr = b^2 u (1 - u) exp(log_q) du.  In a cell that
 * falls by hundreds of powers of e nearly all parts are nothing, and no exp is spent on them.
 */
static void add_line(struct plane *p, size_t i, size_t parts, double azimuth, double weight)
{
    double b = p->table->slope_scale, cells = (double)p->table->turned_q.cells,
           dt = 1 / (double)parts, mass = 0, mean = 0, line[4];
    slope_sheet_line(p->table->turned_q, i, azimuth, line);
    double before = line[0], least = p->peak - NEGLIGIBLE;
    for (size_t m = 0; m < parts; m++) {
        double t0 = (double)m * dt, after = slope_cubic_at(line, t0 + dt);
        bool counts = fmax(before, after) >= least;
        before = after;
        for (size_t k = 0; k < POINTS_U && counts; k++) {
            double t = t0 + dt * p->node_u[k], u = ((double)i + t) / cells;
            double ring = u * p->weight_u[k] * exp(slope_cubic_at(line, t));
            mass += ring * (1 - u);
            mean += ring * u;
        }
    }
    p->sums.mass += weight * dt / cells * b * b * mass;
    p->sums.mean += weight * dt / cells * b * b * b * mean;
}

static void add_patch(struct plane *p, size_t i, size_t j)
{
    struct kernel_sheet sheet = p->table->turned_q;
    struct patch patch = look_at(p, i, j);
    measure_gain(p, &patch, i);
    if (patch.peak < p->peak - NEGLIGIBLE) return;
    double da = 1 / ((double)sheet.turns * (double)patch.parts_turn);
    for (size_t k = 0; k < patch.parts_turn * POINTS_TURN; k++) {
        double azimuth = (double)j / (double)sheet.turns +
                         da * ((double)(k / POINTS_TURN) + p->node_turn[k % POINTS_TURN]);
        add_line(p, i, patch.parts_u, azimuth, 2 * FACET_PI * da * p->weight_turn[k % POINTS_TURN]);
    }
}

facet_status facet_slope_sums(const struct kernel_table *table, const facet_watch *watch,
                              struct slope_sums *sums)
{
    enum { ASKED = 16 }; /* patches between two looks at the watch: 30 ms at most */
    struct kernel_sheet sheet = table->turned_q;
    struct plane p = {.table = table, .peak = -INFINITY};
    facet_gauss_legendre(POINTS_U, p.node_u, p.weight_u);
    facet_gauss_legendre(POINTS_TURN, p.node_turn, p.weight_turn);
    for (size_t k = 0; k < sheet.cells * sheet.turns; k++) p.peak = fmax(p.peak, sheet.c[16 * k]);
    for (size_t j = 0; j < sheet.turns; j++)
        for (size_t i = 0; i < sheet.cells; i++) {
            if (i % ASKED == 0 && facet_is_cancelled(watch)) return FACET_CANCELLED;
            add_patch(&p, i, j);
        }
    *sums = p.sums;
    return FACET_OK;
}
