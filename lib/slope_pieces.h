/*
 * slope_pieces.h - quadrature over a radial slope distribution.
 *
 * The half line of slopes is cut into pieces on which log_q (kernels.h) is one cubic of
 * small variation, so that a short Gauss rule is exact to rounding on each.
 */
#ifndef FACET_SLOPE_PIECES_H
#define FACET_SLOPE_PIECES_H

#include "facet.h"
#include "kernel/kernels.h"

enum { PIECE_POINTS = 8, PIECE_MOMENTS = 24 };

struct slope_piece {
    double u0, u1;
    size_t cell;                 /* of log_q */
    double r[PIECE_POINTS];      /* slopes of the nodes */
    double weight[PIECE_POINTS]; /* 2 pi r P(r) dr: probability of the node's ring */
    /* Sums over this piece and all that follow: of the weights, and of weight r (r/scale)^(-2k). */
    double mass, moment[PIECE_MOMENTS];
    double below; /* the weights of all that precede */
};

struct slope_pieces {
    double scale;
    struct kernel_cubic log_q;
    struct slope_piece *piece;
    size_t count;
    double node[PIECE_POINTS], gauss[PIECE_POINTS]; /* the rule on [0, 1] */
};

facet_status facet_slope_pieces_create(double scale, struct kernel_cubic log_q,
                                       struct slope_pieces *pieces);
void facet_slope_pieces_clear(struct slope_pieces *pieces);

/*
 * psi(v) = E[max(x - v, 0)] of one slope component x, and its derivative
 * -Prob(x > v), for v >= 0: sigma(s, 0, c) = max(c, 0) + s psi(|c|/s).  Even in
 * |c| because sigma(-k) = sigma(k) - c.
 */
double facet_slope_pieces_psi(const struct slope_pieces *pieces, double v, double *derivative);

/* What the pieces from p on (of count or more: nothing) add to psi(v), where all their rings have r >= 2 v. */
double facet_slope_pieces_far(const struct slope_pieces *pieces, size_t p, double v);

#endif
