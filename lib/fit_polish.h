/*
 * fit_polish.h - a tabulated slope distribution brought closer to the whole BRDF.
 */
#ifndef FACET_FIT_POLISH_H
#define FACET_FIT_POLISH_H

#include "fit_model.h"

/*
 * Backscatter is one slice of a measurement, often its worst.  In turn: F (and kd)
 * by least squares, then log D at the theta_h of the pairs by one Gauss-Newton step
 * each, straight between them in the u of the table.  Stops where that gains less
 * than a hundredth of the squares.  log_d (n nodes) and *table are replaced where
 * it gained; model->value and ->kd go with them.
 */
facet_status facet_fit_polish(struct fit_pairs *pairs, struct fit_model *model, double scale,
                              double *log_d, size_t n, facet_slope_table **table,
                              const facet_watch *watch);

#endif
