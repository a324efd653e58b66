/*
 * slope_table.h - inside of facet_slope_table, for facet_brdf_create and the fit.
 */
#ifndef FACET_SLOPE_TABLE_H
#define FACET_SLOPE_TABLE_H

#include "facet_table.h"
#include "slope_pieces.h"

/*
 * The model is D as view.log_q tabulates it: exact up to rounding.  sigma is
 * the integral of that D, tabulated in turn, so it carries an error of its own,
 * measured halfway between the nodes of log_psi when the table is made.
 */
struct facet_slope_table {
    struct kernel_table view; /* first: what a kernel holds is the table */
    struct slope_pieces pieces; /* of log_q; sampling inverts their sums */
    double sigma_error;    /* of sigma(k), relative, c >= 0 */
    double psi_error;      /* of sigma(k), relative, c < 0 and sigma >= 1e-30 s */
    double log_q_max;      /* largest |log_q| where it matters, that is, above log(FACET_FLOOR) */
    double log_q_slope;    /* largest |d log_q / du| there: what rounding of u costs */
    double quantile_gain;  /* slope_quantile.h */
    double coefficients[]; /* of log_q, then of log_psi */
};

/* log D at slope r = tan theta, as the kernels evaluate it. */
double facet_slope_table_log_d(const facet_slope_table *table, double r);

#endif
