/*
 * fit_model.h - the parameters of one candidate, and their least squares.
 *
 * Own solver instead of a package: lib needs libm alone, the rows are the kernels'
 * batches, and the arrow shape of the equations (fit_arrow.h) is worth a factor of a
 * hundred over a general dense solver.
 */
#ifndef FACET_FIT_MODEL_H
#define FACET_FIT_MODEL_H

#include "fit_pairs.h"

struct fit_model {
    facet_ndf ndf;
    facet_masking masking;
    const facet_slope_table *table; /* TABULATED */
    bool anisotropic, has_diffuse, has_table, fixed_shape,
        is_turned;                /* is_turned: the table's azimuths differ */
    double shape[FIT_SHAPES_MAX]; /* log alpha_x[, log alpha_y, atanh rho] */
    double f0[3], kd[3];
    double *value[3]; /* with has_table: F of each group of the pairs; room of the caller */
};

double facet_fit_model_alpha(const struct fit_model *model); /* geometric mean */

/* As a material with F = 1. */
facet_material facet_fit_model_material(const struct fit_model *model);

/*
 * Levenberg-Marquardt on the logarithms of facet_fit_error, Huber's loss in the
 * end.  cost: the loss per residual that is left.  Leaves pairs->model undefined.
 */
facet_status facet_fit_model_solve(struct fit_model *model, struct fit_pairs *pairs, int steps,
                                   const facet_watch *watch, double *cost);

#endif
