/*
 * fit_arrow.h - normal equations of least squares in which each row depends on a few
 * shared parameters and on at most one of many private ones: an arrow, not a full matrix.
 */
#ifndef FACET_FIT_ARROW_H
#define FACET_FIT_ARROW_H

#include <stdbool.h>
#include <stddef.h>

enum { ARROW_SHARED_MAX = 9 }; /* three of a shape, F0 and kd of three channels */
#define ARROW_NONE ((size_t)-1)

struct fit_arrow {
    size_t shared, own;
    double square[ARROW_SHARED_MAX][ARROW_SHARED_MAX], right[ARROW_SHARED_MAX];
    bool frozen[ARROW_SHARED_MAX]; /* at the end of its range: not moved */
    /* of each private parameter: its square, its right side, its products with the shared ones */
    double *own_square, *own_right, (*cross)[ARROW_SHARED_MAX];
    double cost;
};

/* All sums 0.  own numbers of room each; false: out of memory. */
bool facet_fit_arrow_create(struct fit_arrow *arrow, size_t shared, size_t own);
void facet_fit_arrow_reset(struct fit_arrow *arrow);
void facet_fit_arrow_clear(struct fit_arrow *arrow);

/* The step of Levenberg and Marquardt with this damping; false where there is none. */
bool facet_fit_arrow_solve(const struct fit_arrow *arrow, double damping,
                           double step[ARROW_SHARED_MAX], double *own_step);

#endif
