/*
 * slope_table.h - inside of facet_slope_table, for facet_brdf_create and the fit.
 */
#ifndef FACET_SLOPE_TABLE_H
#define FACET_SLOPE_TABLE_H

#include "facet_table.h"
#include "slope_pieces.h"

#include <stdatomic.h>

/*
 * Of logarithms where they count: what rounding of them and of u costs.  Their largest size, their largest value, and
 * the largest derivative by log u or log(1 - u), whichever is nearer its 0, and by the azimuth in units of pi, the
 * same by log u alone, which is what double tiers have;
 * of log_q also that of log P by a slope: what an absolute error of standard slopes costs.
 */
struct slope_reach {
    double size, most, gain, rise, steep;
};

/* Far enough above what doubles hold that D is told wherever a density beside it passes FACET_FLOOR. */
#define SLOPE_FAINT 1e-250
enum { SLOPE_DEPTHS = 64 };

/*
 * The model is D as view.log_q tabulates it: exact up to rounding.  sigma is
 * the integral of that D, tabulated in turn, so it carries an error of its own,
 * measured halfway between the nodes of log_psi, and all over its ends, when the table is made.
 */
struct facet_slope_table {
    struct kernel_table view;   /* first: what a kernel holds is the table */
    struct slope_pieces pieces; /* of log_q; sampling inverts their sums */
    double sigma_error;         /* of sigma(k), relative, c >= 0 */
    double psi_error;           /* of sigma(k), relative, c < 0 and |c|/s <= near */
    double far_error;           /* the same, |c|/s <= reach */
    double near, reach;         /* as far as sigma >= FACET_FLOOR and SLOPE_FAINT of scale s */
    double end;                 /* from |c|/s >= end nothing is seen */
    /*
     * Over the azimuth, where near is 0 and reach as far as FACET_FLOOR: of |c|/s up to
     * v = scale u/(1 - u), u = (k + 1)/SLOPE_DEPTHS, and sigma >= FACET_FLOOR of scale s.
     */
    double psi_error_to[SLOPE_DEPTHS];
    double gain; /* largest derivative of log D by log tan theta or the azimuth, where D counts */
    struct slope_reach q, psi; /* psi beside c > 0 */
    struct slope_reach behind,
        far_behind;       /* psi as all there is of sigma: what floats hold, and all */
    double quantile_gain; /* slope_quantile.h */
    /* Of a table that is not radial, whose pieces are empty: */
    _Atomic(struct slope_rays *) rays; /* for sampling; NULL until it is asked for */
    double coefficients[];             /* of log_q, then of log_psi */
};

static inline bool facet_slope_table_is_turned(const struct kernel_table *view)
{
    return view->turned_q.turns > 0;
}

/* Of one over the azimuth: what of psi_error_to holds as far as this. */
double facet_slope_turned_psi_error(const facet_slope_table *table, double depth);

/* What sampling needs of a table that is not radial; NULL: out of memory. */
const struct slope_rays *facet_slope_table_rays(const facet_slope_table *table);

/* Fills in q, psi, behind, far_behind, view.behind_most, and gain where it is radial, of a table that is otherwise made. */
void facet_slope_table_measure(facet_slope_table *table);

bool facet_slope_nodes_valid(double scale, const double *log_d, size_t n);

/* log_q at rows of n nodes relative to the peak, so that no exp overflows before the table is normalised. */
void facet_slope_start_nodes(double scale, const double *log_d, size_t n, size_t rows, double *y);

/* False where there is no norm. */
bool facet_slope_normalise(double norm, double *y, size_t n);

/* log D at slope r = tan theta, as the kernels evaluate it. */
double facet_slope_table_log_d(const facet_slope_table *table, double r);
/* Of one over the azimuth, in units of pi, in [0, 1]. */
double facet_slope_table_log_d_along(const facet_slope_table *table, double r, double azimuth);

#endif
