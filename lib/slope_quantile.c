#include "slope_quantile.h"

#include "slope_ring.h"

#include <math.h>

/* ---- Integrals of visible rings ------------------------------------------------------- */

/* Mean projected area over the ring at u. */
static double area_at(const struct slope_view *view, double u)
{
    double b = view->pieces->scale, r = ring_slope(b, u);
    if (!(u > view->uv)) return view->front;
    double rest = b * (u - view->uv) / ((1 - u) * view->rest_v * r);
    return view->front + view->s * ring_seen(r, fmin(rest, 1)).value;
}

static double density_at(const struct slope_view *view, size_t p, double u)
{
    const struct slope_pieces *pieces = view->pieces;
    if (!(u < 1)) return 0;
    double q = ring_density(pieces->scale, ring_log_q(pieces->log_q, pieces->piece[p].cell, u), u);
    return q * area_at(view, u);
}

static double mass_between(const struct slope_pieces *pieces, size_t p, double a, double e)
{
    double sum = 0;
    for (size_t i = 0; i < PIECE_POINTS; i++) {
        double u = a + (e - a) * pieces->node[i];
        double log_q = ring_log_q(pieces->log_q, pieces->piece[p].cell, u);
        sum += pieces->gauss[i] * ring_density(pieces->scale, log_q, u);
    }
    return sum * (e - a);
}

/*
 * From u = a >= uv to e within piece p, stretch by stretch (slope_ring.h); beyond FAR v the area is
 * linear in r to rounding.
 */
#define FAR 0x1p25

static double area_between(const struct slope_view *view, size_t p, double a, double e)
{
    const struct slope_pieces *pieces = view->pieces;
    double b = pieces->scale, sum = 0;
    while (a < e) {
        double end = ring_stretch(b, view->uv, pieces->piece[p].u1, a, e);
        if (!(end > a) || ring_slope(b, a) >= FAR * view->v) end = e;
        double y0 = sqrt(a - view->uv), y1 = sqrt(end - view->uv), part = 0;
        for (size_t i = 0; i < PIECE_POINTS; i++) {
            double y = y0 + (y1 - y0) * pieces->node[i];
            part += pieces->gauss[i] * 2 * y * density_at(view, p, view->uv + y * y);
        }
        sum += part * (y1 - y0);
        a = end;
    }
    return sum;
}

/* All of piece p that lies above v. */
static double area_of_piece(const struct slope_view *view, size_t p)
{
    const struct slope_pieces *pieces = view->pieces;
    const struct slope_piece *piece = &pieces->piece[p];
    double r0 = ring_slope(pieces->scale, piece->u0), r1 = ring_slope(pieces->scale, piece->u1),
           sum = 0;
    if (r0 - view->v < r1 - r0) return area_between(view, p, fmax(piece->u0, view->uv), piece->u1);
    for (size_t i = 0; i < PIECE_POINTS; i++) {
        double r = piece->r[i];
        sum += piece->weight[i] * (view->front + view->s * ring_seen(r, (r - view->v) / r).value);
    }
    return sum;
}

/* Pieces from p >= view->far on. */
static double area_beyond(const struct slope_view *view, size_t p)
{
    const struct slope_pieces *pieces = view->pieces;
    if (p >= pieces->count) return 0;
    return view->front * pieces->piece[p].mass +
           view->s * facet_slope_pieces_far(pieces, p, view->v);
}

/* ---- Inversion ------------------------------------------------------------------------- */

/* A piece, or what of it is asked about, and the way into it. */
struct stretch {
    const struct slope_view *view; /* NULL: masses, seen or not */
    size_t piece;
    double low, high;
    bool from_above;
};

static double amount(const struct slope_pieces *pieces, const struct stretch *at, double step)
{
    double a = at->from_above ? at->high - step : at->low,
           e = at->from_above ? at->high : at->low + step;
    return at->view ? area_between(at->view, at->piece, a, e)
                    : mass_between(pieces, at->piece, a, e);
}

static double amount_slope(const struct slope_pieces *pieces, const struct stretch *at, double step)
{
    double u = at->from_above ? at->high - step : at->low + step;
    if (at->view) return density_at(at->view, at->piece, u);
    return ring_density(pieces->scale, ring_log_q(pieces->log_q, pieces->piece[at->piece].cell, u),
                        u);
}

/*
 * The step into the stretch over which `wanted` lies: Newton, bisection where that leaves the
 * bracket.  A Newton step this short leaves an error of the order of its square.
 */
#define STEP_ENOUGH 1e-9

static double step_to(const struct slope_pieces *pieces, const struct stretch *at, double wanted)
{
    enum { STEPS = 200 };
    double low = 0, high = at->high - at->low, all = amount(pieces, at, high);
    if (!(wanted > 0) || !(high > 0)) return 0;
    if (!(wanted < all)) return high;
    double step = high * (wanted / all);
    for (int i = 0; i < STEPS && high > low; i++) {
        double error = amount(pieces, at, step) - wanted, slope = amount_slope(pieces, at, step);
        if (error > 0)
            high = step;
        else
            low = step;
        double next = step - error / slope;
        if (fabs(next - step) <= STEP_ENOUGH * step) return fmax(low, fmin(high, next));
        if (!(next > low && next < high)) next = low + (high - low) / 2;
        if (next == low || next == high) return next;
        step = next;
    }
    return step;
}

static struct slope_place place_in(const struct slope_pieces *pieces, const struct stretch *at,
                                   double wanted)
{
    double step = step_to(pieces, at, wanted);
    struct slope_place place;
    place.u = at->from_above ? at->high - step : at->low + step;
    place.rest = at->from_above ? (1 - at->high) + step : (1 - at->low) - step;
    place.log_q = ring_log_q(pieces->log_q, pieces->piece[at->piece].cell, place.u);
    return place;
}

/* `wanted` of the rings lies above. */
static struct slope_place any_from_above(const struct slope_pieces *pieces, double wanted)
{
    size_t low = 0, high = pieces->count; /* the last piece with that mass from it on */
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        if (pieces->piece[middle].mass >= wanted)
            low = middle;
        else
            high = middle;
    }
    const struct slope_piece *piece = &pieces->piece[low];
    struct stretch at = {NULL, low, piece->u0, piece->u1, true};
    return place_in(pieces, &at, wanted - (low + 1 < pieces->count ? piece[1].mass : 0));
}

static struct slope_place any_from_below(const struct slope_pieces *pieces, double wanted)
{
    size_t low = 0, high = pieces->count; /* the last piece with less than that below it */
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        if (pieces->piece[middle].below <= wanted)
            low = middle;
        else
            high = middle;
    }
    const struct slope_piece *piece = &pieces->piece[low];
    struct stretch at = {NULL, low, piece->u0, piece->u1, false};
    return place_in(pieces, &at, wanted - piece->below);
}

struct slope_place facet_slope_any_ring(const struct slope_pieces *pieces, struct slope_share share)
{
    /* The pieces' own mass is 1 to rounding. */
    double mass = pieces->piece[0].mass;
    return share.u < 0.5 ? any_from_below(pieces, share.u * mass)
                         : any_from_above(pieces, share.rest * mass);
}

double facet_slope_quantile_gain(const struct slope_pieces *pieces)
{
    const double b = pieces->scale, least = 1e-12 / (double)pieces->count;
    double worst = 0, below = 0;
    for (size_t p = 0; p < pieces->count; p++) {
        const struct slope_piece *piece = &pieces->piece[p];
        double above = piece->mass, width = piece->u1 - piece->u0, inside = 0;
        for (size_t i = 0; i < PIECE_POINTS; i++) inside += piece->weight[i];
        for (size_t i = 0; i < PIECE_POINTS && inside > least; i++) {
            double u = piece->u0 + width * pieces->node[i],
                   turn = b / ((1 - u) * (1 - u) + b * u * (b * u));
            worst = fmax(worst, fmin(below + inside, above) * turn * width * pieces->gauss[i] /
                                    piece->weight[i]);
        }
        below += inside;
    }
    return worst;
}

static struct stretch above_v(const struct slope_view *view, size_t p, bool from_above)
{
    const struct slope_piece *piece = &view->pieces->piece[p];
    double low = fmin(fmax(piece->u0, view->uv), piece->u1);
    return (struct stretch){view, p, low, piece->u1, from_above};
}

/* `wanted` of the visible rings lies above, all of it beyond 2 v. */
static struct slope_place far_from_above(const struct slope_view *view, double wanted)
{
    size_t low = view->far, high = view->pieces->count;
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        if (area_beyond(view, middle) >= wanted)
            low = middle;
        else
            high = middle;
    }
    struct stretch at = above_v(view, low, true);
    return place_in(view->pieces, &at, wanted - area_beyond(view, low + 1));
}

/* The last span with `area` <= wanted below it, or >= wanted from it on. */
static size_t span_of(const struct slope_view *view, double wanted, bool from_above)
{
    size_t low = 0, high = view->spans;
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        if (from_above ? view->after[middle] >= wanted : view->before[middle] <= wanted)
            low = middle;
        else
            high = middle;
    }
    return low;
}

static size_t span_start(const struct slope_view *view, size_t span)
{
    size_t p = view->near + span * view->stride;
    return p < view->far ? p : view->far;
}

static struct slope_place seen_from_above(const struct slope_view *view, double wanted)
{
    if (view->far < view->pieces->count && wanted <= view->after[view->spans])
        return far_from_above(view, wanted);
    size_t last = view->pieces->count - 1, p = last;
    double left = 0;
    if (view->spans) {
        size_t span = span_of(view, wanted, true), start = span_start(view, span);
        left = wanted - view->after[span + 1];
        for (p = span_start(view, span + 1) - 1; p > start; p--) {
            double here = area_of_piece(view, p);
            if (left <= here) break;
            left -= here;
        }
    }
    struct stretch at = above_v(view, p, true);
    return place_in(view->pieces, &at, left);
}

/* `wanted` of the visible rings from v on lies below, `otherwise` above. */
static struct slope_place seen_from_below(const struct slope_view *view, double wanted,
                                          double otherwise)
{
    if (!view->spans || wanted > view->before[view->spans]) return seen_from_above(view, otherwise);
    size_t span = span_of(view, wanted, false), p = span_start(view, span),
           end = span_start(view, span + 1);
    wanted -= view->before[span];
    for (; p + 1 < end; p++) {
        double here = area_of_piece(view, p);
        if (wanted <= here) break;
        wanted -= here;
    }
    struct stretch at = above_v(view, p, false);
    return place_in(view->pieces, &at, wanted);
}

struct slope_place facet_slope_ring(const struct slope_view *view, struct slope_share share)
{
    double below = share.u * view->sigma, above = share.rest * view->sigma;
    if (below < view->lit) {
        if (share.u < 0.5) return any_from_below(view->pieces, below / view->front);
        /* What is seen in full counts front; what of that lies above. */
        double mass = view->pieces->piece[0].mass * view->front,
               beyond = view->after[0] - (mass - view->lit);
        return any_from_above(view->pieces, fmax((above - beyond) / view->front, 0));
    }
    if (share.u < 0.5) return seen_from_below(view, below - view->lit, above);
    return seen_from_above(view, above);
}

/* First piece with r >= limit, or that holds it. */
static size_t first_above(const struct slope_pieces *pieces, double limit, bool whole)
{
    size_t low = 0, high = pieces->count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        const struct slope_piece *piece = &pieces->piece[middle];
        if (ring_slope(pieces->scale, whole ? piece->u0 : piece->u1) >= limit)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

static double mass_below_v(const struct slope_view *view)
{
    const struct slope_pieces *pieces = view->pieces;
    if (view->near >= pieces->count) return pieces->piece[0].mass;
    const struct slope_piece *piece = &pieces->piece[view->near];
    if (!(view->uv > piece->u0)) return piece->below;
    return piece->below + mass_between(pieces, view->near, piece->u0, view->uv);
}

static void sum_spans(struct slope_view *view)
{
    size_t pieces = view->far - view->near;
    view->stride = pieces / VIEW_SPANS + 1;
    view->spans = (pieces + view->stride - 1) / view->stride;
    for (size_t i = 0; i < view->spans; i++) {
        view->after[i] = 0;
        for (size_t p = span_start(view, i); p < span_start(view, i + 1); p++)
            view->after[i] += area_of_piece(view, p);
        view->before[i + 1] = view->before[i] + view->after[i];
    }
    view->after[view->spans] = area_beyond(view, view->far);
    for (size_t i = view->spans; i-- > 0;) view->after[i] += view->after[i + 1];
}

void facet_slope_view(const struct slope_pieces *pieces, double c, double s,
                      struct slope_view *view)
{
    double b = pieces->scale;
    *view = (struct slope_view){.pieces = pieces, .c = c, .s = s, .front = fmax(c, 0)};
    view->v = s > 0 ? fabs(c) / s : INFINITY;
    bool never = !(view->v < INFINITY);
    view->uv = never ? 1 : view->v / (b + view->v);
    view->rest_v = never ? 0 : b / (b + view->v);
    view->near = never ? pieces->count : first_above(pieces, view->v, false);
    view->far = never ? pieces->count : first_above(pieces, 2 * view->v, true);
    if (view->far < view->near) view->far = view->near;
    view->lit = view->front * mass_below_v(view);
    sum_spans(view);
    view->sigma = view->lit + view->after[0];
}

/* ---- Along a ring ---------------------------------------------------------------------- */

/* d - sin d, whose terms cancel. */
static double minus_sine(double d, double sine)
{
    double d2 = d * d;
    if (d2 > 0.25) return d - sine;
    return d * d2 *
           (1. / 6 -
            d2 * (1. / 120 -
                  d2 * (1. / 5040 - d2 * (1. / 362880 - d2 * (1. / 39916800 - d2 / 6227020800)))));
}

/*
 * With G(phi) = c phi + s sin phi and d = phi_m - phi, G(phi_m) - G(phi_m - d) = q G(phi_m)
 * for d: convex in d, so that Newton falls to it from phi_m q^(1/3), which is beyond it.
 */
struct slope_turn facet_slope_along_ring(double c, double s, struct slope_share share)
{
    enum { STEPS = 60 };
    double q = 2 * fmin(share.u, share.rest), cos_m = -1, sin_m = 0;
    if (s > fabs(c)) {
        cos_m = -c / s;
        sin_m = sqrt((s - c) * (s + c)) / s;
    }
    double end = s > fabs(c) ? atan2(sin_m, cos_m) : FACET_PI, all = c * end + s * sin_m;
    double plain = s > fabs(c) ? 0 : c - s, bent = s > fabs(c) ? -cos_m : 1;
    double d = end * cbrt(q), wanted = q * all;
    if (!(all > 0)) return (struct slope_turn){1, 0}; /* seen edge-on, by rounding */
    for (int i = 0; i < STEPS && d > 0; i++) {
        double half = sin(d / 2), sine = sin(d);
        double value = plain * d + s * (sin_m * 2 * half * half + bent * minus_sine(d, sine));
        double slope = plain + s * (sin_m * sine + bent * 2 * half * half);
        double step = (value - wanted) / slope;
        if (!(step > 1e-16 * d)) break;
        d -= step;
    }
    double cos_d = cos(d), sin_d = sin(d);
    double sine = fmax(sin_m * cos_d - cos_m * sin_d, 0);
    return (struct slope_turn){cos_m * cos_d + sin_m * sin_d, share.u < share.rest ? -sine : sine};
}
