/*
 * slope_quantile.h - visible slopes of a radial distribution by inverting its CDF
 * exactly: a ring by one number, a place on it by the other (internal).
 *
 * The mean of max(c + s r cos phi, 0) over the ring r is closed (slope_ring.h), so that
 * the CDF of rings is a sum over slope_pieces; along the ring the CDF of phi is closed.
 */
#ifndef FACET_SLOPE_QUANTILE_H
#define FACET_SLOPE_QUANTILE_H

#include "slope_pieces.h"

enum { VIEW_SPANS = 64 };

/* A direction (s, 0, c) of the standard surface, s >= 0, any sign of c; s = 0 needs c > 0. */
struct slope_view {
    const struct slope_pieces *pieces;
    double c, s;
    double front; /* max(c, 0) */
    double v,
        uv; /* |c|/s, where rings begin to be seen in part, and its u; INFINITY and 1 for s = 0 */
    double rest_v;    /* 1 - uv */
    double lit;       /* front times the mass of the rings r < v */
    double sigma;     /* of the whole: that of the pieces, no table */
    size_t near, far; /* the piece that holds v, or the first above it; the first with r >= 2 v */
    /* The pieces between them in spans of `stride`: visible area before each, and of it and what follows. */
    size_t stride, spans;
    double before[VIEW_SPANS + 1], after[VIEW_SPANS + 1];
};

void facet_slope_view(const struct slope_pieces *pieces, double c, double s,
                      struct slope_view *view);

/* A number u in [0, 1) and 1 - u, of which neither is a difference with few digits left. */
struct slope_share {
    double u, rest;
};

/* The ring with a share u of the visible slopes inside: r = scale u/rest. */
struct slope_place {
    double u, rest;
    double log_q;
};
struct slope_place facet_slope_ring(const struct slope_view *view, struct slope_share share);

/* All rings, seen or not. */
struct slope_place facet_slope_any_ring(const struct slope_pieces *pieces,
                                        struct slope_share share);

/*
 * What an error of a share, relative to it and to 1 - it, makes of the angle of a ring: the
 * largest min(F, 1 - F)/(dF/dtheta), but for rings of 1e-12 in all.  A gap in a table makes it large.
 */
double facet_slope_quantile_gain(const struct slope_pieces *pieces);

/*
 * Density c + s cos phi on [-phi_m, phi_m], where it is not negative; from -phi_m at u = 0
 * up.  s >= 0; c + s > 0.
 */
struct slope_turn {
    double cos, sin;
};
struct slope_turn facet_slope_along_ring(double c, double s, struct slope_share share);

#endif
