/*
 * slope_ring.h - one ring of slopes, |slope| = r, of a radial distribution: its density and
 * its projected area (internal; slope_pieces.c integrates it, slope_quantile.c inverts it).
 */
#ifndef FACET_SLOPE_RING_H
#define FACET_SLOPE_RING_H

#include "kernel/kernels.h"

#include <math.h>

static inline double ring_log_q(struct kernel_cubic log_q, size_t cell, double u)
{
    const double *c = log_q.c + 4 * cell;
    double t = u * (double)log_q.cells - (double)cell;
    return c[0] + t * (c[1] + t * (c[2] + t * c[3]));
}

static inline double ring_slope(double scale, double u)
{
    return scale * u / (1 - u);
}

/* Density of rings per u: 2 pi r P(r) dr/du with P = exp(log_q) (1 - u)^4. */
static inline double ring_density(double scale, double log_q, double u)
{
    return 2 * FACET_PI * scale * scale * u * (1 - u) * exp(log_q);
}

/*
 * The mean of max(r cos phi - v, 0) over a ring is r (sin t - t cos t)/pi, cos t = v/r,
 * and -t/pi is its derivative by v.  rest = (r - v)/r is handed over because it cancels;
 * the bracket does too, hence its series for small t.
 */
struct ring {
    double value, derivative;
};

static inline struct ring ring_seen(double r, double rest)
{
    double t = 2 * asin(sqrt(rest / 2)), t2 = t * t, bracket;
    if (t < 0.3)
        bracket = t * t2 *
                  (1. / 3 - t2 * (1. / 30 - t2 * (1. / 840 - t2 * (1. / 45360 - t2 / 3991680))));
    else
        bracket = sqrt(rest * (2 - rest)) - t * (1 - rest);
    return (struct ring){r * bracket / FACET_PI, -t / FACET_PI};
}

/*
 * Next to r = v, at u = uv, the rings of a piece that ends at u1 are analytic in y = sqrt(u - uv) on
 * stretches over which r at most doubles: where that from a on ends, no later than `last`.  A piece
 * that goes on to infinity is smooth from the second on.
 */
static inline double ring_stretch(double scale, double uv, double u1, double a, double last)
{
    double r = ring_slope(scale, a);
    return u1 == 1 && a > uv ? last : fmin(2 * r / (scale + 2 * r), last);
}

#endif
