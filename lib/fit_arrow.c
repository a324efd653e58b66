#include "fit_arrow.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

bool facet_fit_arrow_create(struct fit_arrow *arrow, size_t shared, size_t own)
{
    *arrow = (struct fit_arrow){.shared = shared, .own = own};
    arrow->own_square = calloc(own + 1, (2 + ARROW_SHARED_MAX) * sizeof(double));
    if (!arrow->own_square) return false;
    arrow->own_right = arrow->own_square + own;
    arrow->cross = (double(*)[ARROW_SHARED_MAX])(void *)(arrow->own_right + own);
    return true;
}

void facet_fit_arrow_reset(struct fit_arrow *arrow)
{
    memset(arrow->square, 0, sizeof arrow->square);
    memset(arrow->right, 0, sizeof arrow->right);
    memset(arrow->own_square, 0, arrow->own * (2 + ARROW_SHARED_MAX) * sizeof(double));
    arrow->cost = 0;
}

void facet_fit_arrow_clear(struct fit_arrow *arrow)
{
    free(arrow->own_square);
    *arrow = (struct fit_arrow){0};
}

/* A private parameter that the rows hardly see stays where it is. */
#define UNSEEN 1e-12

/* Cholesky in place, then both substitutions; false where a is not positive definite. */
static bool solve_dense(double a[ARROW_SHARED_MAX][ARROW_SHARED_MAX], double *x, size_t n)
{
    for (size_t j = 0; j < n; j++) {
        for (size_t i = j; i < n; i++) {
            double sum = a[i][j];
            for (size_t k = 0; k < j; k++) sum -= a[i][k] * a[j][k];
            if (i == j && !(sum > 0)) return false;
            a[i][j] = i == j ? sqrt(sum) : sum / a[j][j];
        }
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < i; k++) x[i] -= a[i][k] * x[k];
        x[i] /= a[i][i];
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++) x[i] -= a[k][i] * x[k];
        x[i] /= a[i][i];
    }
    return true;
}

bool facet_fit_arrow_solve(const struct fit_arrow *arrow, double damping,
                           double step[ARROW_SHARED_MAX], double *own_step)
{
    size_t n = arrow->shared;
    double a[ARROW_SHARED_MAX][ARROW_SHARED_MAX];
    memcpy(a, arrow->square, sizeof a);
    memcpy(step, arrow->right, n * sizeof *step);
    for (size_t i = 0; i < n; i++) a[i][i] = a[i][i] * (1 + damping);
    for (size_t g = 0; g < arrow->own; g++) { /* Schur complement of the diagonal block */
        double own = arrow->own_square[g] * (1 + damping);
        if (!(own > UNSEEN)) continue;
        for (size_t i = 0; i < n; i++) {
            double factor = arrow->cross[g][i] / own;
            if (factor == 0) continue;
            step[i] -= factor * arrow->own_right[g];
            for (size_t j = 0; j <= i; j++) a[i][j] -= factor * arrow->cross[g][j];
        }
    }
    for (size_t i = 0; i < n; i++) {
        bool still = arrow->frozen[i] || !(arrow->square[i][i] > UNSEEN);
        for (size_t j = 0; still && j < n; j++) a[i][j] = a[j][i] = 0;
        if (still) step[i] = 0;
        if (still) a[i][i] = 1;
    }
    if (!solve_dense(a, step, n)) return false;
    for (size_t g = 0; g < arrow->own; g++) {
        double own = arrow->own_square[g] * (1 + damping), right = arrow->own_right[g];
        for (size_t i = 0; i < n; i++) right -= arrow->cross[g][i] * step[i];
        own_step[g] = own > UNSEEN ? right / own : 0;
    }
    return true;
}
