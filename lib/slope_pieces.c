#include "slope_pieces.h"

#include "gauss.h"
#include "slope_ring.h"

#include <math.h>
#include <stdlib.h>

/*
 * Where log_q lies this far below its peak, nothing is left that a double holds.  What is seen from
 * far behind is the tail alone: to the sum of all of it nothing is added from 150 on.
 */
#define NEGLIGIBLE 745.0
/* And where all that is left is this much of what there is, rounding is more. */
#define ROUNDED 1e-18
/* Variation of log_q on one piece: 8 Gauss points integrate exp over it to 2e-15. */
#define VARIATION_MAX 3.0
/* And its length in u: with few nodes log_q bends within a cell (3e-10 of the whole at 4 nodes). */
#define LENGTH_MAX (1.0 / 32)

/* (scale/r)^46 of rings nearer to 0 than this times scale could overflow; no v > 0 is asked for
 * there. */
#define NEAR_ZERO 1e-6

struct cutter {
    struct slope_pieces *to;
    double peak;
    size_t room;
};

static double cubic(const double *c, double t)
{
    return c[0] + t * (c[1] + t * (c[2] + t * c[3]));
}

static bool add_piece(struct cutter *cutter, size_t cell, double u0, double u1)
{
    struct slope_pieces *to = cutter->to;
    if (to->count == cutter->room) {
        size_t room = cutter->room + cutter->room / 2 + 64;
        struct slope_piece *grown = realloc(to->piece, room * sizeof *grown);
        if (!grown) return false;
        to->piece = grown;
        cutter->room = room;
    }
    struct slope_piece *piece = &to->piece[to->count++];
    *piece = (struct slope_piece){.u0 = u0, .u1 = u1, .cell = cell};
    for (size_t i = 0; i < PIECE_POINTS; i++) {
        double u = u0 + (u1 - u0) * to->node[i];
        piece->r[i] = ring_slope(to->scale, u);
        piece->weight[i] = (u1 - u0) * to->gauss[i] *
                           ring_density(to->scale, ring_log_q(to->log_q, cell, u), u);
    }
    return true;
}

/* Short enough for the Gauss rule? */
static bool is_short(const struct cutter *cutter, size_t cell, double u0, double u1)
{
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i <= 4; i++) {
        double y = ring_log_q(cutter->to->log_q, cell, u0 + (u1 - u0) * i / 4);
        low = fmin(low, y);
        high = fmax(high, y);
    }
    return high < cutter->peak - NEGLIGIBLE ||
           (high - low <= VARIATION_MAX && u1 - u0 <= LENGTH_MAX);
}

static bool cut_cell(struct cutter *cutter, size_t cell)
{
    struct kernel_cubic log_q = cutter->to->log_q;
    double cells = (double)log_q.cells, end = ((double)cell + 1) / cells;
    for (double a = (double)cell / cells; a < end;) {
        double b = end, middle;
        while (!is_short(cutter, cell, a, b) && (middle = a + (b - a) / 2) > a && middle < b)
            b = middle;
        double high = fmax(ring_log_q(log_q, cell, a), ring_log_q(log_q, cell, b));
        if (high >= cutter->peak - NEGLIGIBLE && !add_piece(cutter, cell, a, b)) return false;
        a = b;
    }
    return true;
}

static void accumulate_moments(struct slope_pieces *pieces)
{
    double mass = 0, moment[PIECE_MOMENTS] = {0};
    for (size_t p = pieces->count; p-- > 0;) {
        struct slope_piece *piece = &pieces->piece[p];
        for (size_t i = 0; i < PIECE_POINTS; i++) {
            double x = pieces->scale / piece->r[i], m = piece->weight[i] * piece->r[i];
            size_t count = x * NEAR_ZERO < 1 ? PIECE_MOMENTS : 1;
            mass += piece->weight[i];
            for (size_t k = 0; k < count; k++, m *= x * x) moment[k] += m;
        }
        piece->mass = mass;
        for (size_t k = 0; k < PIECE_MOMENTS; k++) piece->moment[k] = moment[k];
    }
    double below = 0; /* summed from 0, where it is small */
    for (size_t p = 0; p < pieces->count; p++) {
        pieces->piece[p].below = below;
        for (size_t i = 0; i < PIECE_POINTS; i++) below += pieces->piece[p].weight[i];
    }
}

facet_status facet_slope_pieces_create(double scale, struct kernel_cubic log_q,
                                       struct slope_pieces *pieces)
{
    struct cutter cutter = {.to = pieces, .peak = -INFINITY};
    *pieces = (struct slope_pieces){.scale = scale, .log_q = log_q};
    facet_gauss_legendre(PIECE_POINTS, pieces->node, pieces->gauss);
    for (size_t i = 0; i < log_q.cells; i++)
        cutter.peak = fmax(cutter.peak, fmax(cubic(log_q.c + 4 * i, 0), cubic(log_q.c + 4 * i, 1)));
    for (size_t i = 0; i < log_q.cells; i++) {
        if (!cut_cell(&cutter, i)) {
            facet_slope_pieces_clear(pieces);
            return FACET_NO_MEMORY;
        }
    }
    accumulate_moments(pieces);
    return FACET_OK;
}

void facet_slope_pieces_clear(struct slope_pieces *pieces)
{
    free(pieces->piece);
    *pieces = (struct slope_pieces){0};
}

/* ---- psi ---------------------------------------------------------------------- */

struct psi {
    double value, derivative;
};

/* Add a ring of slope r and probability weight. */
static void add_ring(struct psi *psi, double weight, double r, double rest)
{
    struct ring ring = ring_seen(r, rest);
    psi->value += weight * ring.value;
    psi->derivative += weight * ring.derivative;
}

/*
 * Every ring from piece p on has r >= 2 v: with x = v/r expand
 * sin t - t cos t = sum_k a_k x^2k - pi x/2, a_k = binomial(2k,k)/(4^k (2k-1)^2).
 */
static void add_far(struct psi *psi, const struct slope_pieces *pieces, size_t p, double v)
{
    const struct slope_piece *piece = &pieces->piece[p];
    double x2 = v / pieces->scale * (v / pieces->scale), power = 1, b = 1, sum = 0, slope = 0;
    for (size_t k = 0; k < PIECE_MOMENTS && power > 0; k++) {
        double odd = 2 * (double)k - 1, term = b / (odd * odd) * power * piece->moment[k];
        sum += term;
        slope += 2 * (double)k * term;
        power *= x2;
        b *= (2 * (double)k + 1) / (2 * (double)k + 2);
    }
    psi->value += sum / FACET_PI - v * piece->mass / 2;
    psi->derivative += (v > 0 ? slope / (v * FACET_PI) : 0) - piece->mass / 2;
}

double facet_slope_pieces_far(const struct slope_pieces *pieces, size_t p, double v)
{
    struct psi psi = {0, 0};
    if (p < pieces->count) add_far(&psi, pieces, p, v);
    return psi.value;
}

/* Rings of one piece near r = v, stretch by stretch (slope_ring.h). */
static void add_near(struct psi *psi, const struct slope_pieces *pieces, size_t p, double v)
{
    const struct slope_piece *piece = &pieces->piece[p];
    double b = pieces->scale, uv = v / (b + v), a = fmax(piece->u0, uv);
    while (a < piece->u1) {
        double end = ring_stretch(b, uv, piece->u1, a, piece->u1);
        if (!(end > a)) break;
        double y0 = sqrt(a - uv), y1 = sqrt(end - uv);
        for (size_t i = 0; i < PIECE_POINTS; i++) {
            double y = y0 + (y1 - y0) * pieces->node[i], u = uv + y * y, r = ring_slope(b, u);
            double rest = b * y * y / ((1 - u) * (1 - uv) * r);
            double density = ring_density(b, ring_log_q(pieces->log_q, piece->cell, u), u);
            add_ring(psi, density * 2 * y * (y1 - y0) * pieces->gauss[i], r, fmin(rest, 1));
        }
        a = end;
    }
}

double facet_slope_pieces_psi(const struct slope_pieces *pieces, double v, double *derivative)
{
    double b = pieces->scale, uv = v / (b + v);
    struct psi psi = {0, 0};
    size_t low = 0, high = pieces->count;
    while (low < high) { /* first piece that ends above v */
        size_t middle = low + (high - low) / 2;
        if (pieces->piece[middle].u1 > uv)
            high = middle;
        else
            low = middle + 1;
    }
    for (size_t p = low; p < pieces->count; p++) {
        const struct slope_piece *piece = &pieces->piece[p];
        double r0 = ring_slope(b, piece->u0), r1 = ring_slope(b, piece->u1);
        /* A ring shows r at most, and 1 of its derivative. */
        if (piece->moment[0] < ROUNDED * psi.value && piece->mass < -ROUNDED * psi.derivative)
            break;
        if (r0 >= 2 * v) {
            add_far(&psi, pieces, p, v);
            break;
        }
        if (r0 - v < r1 - r0) {
            add_near(&psi, pieces, p, v);
            continue;
        }
        for (size_t i = 0; i < PIECE_POINTS; i++)
            add_ring(&psi, piece->weight[i], piece->r[i], (piece->r[i] - v) / piece->r[i]);
    }
    *derivative = psi.derivative;
    return psi.value;
}
