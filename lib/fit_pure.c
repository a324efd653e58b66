#include "fit_pure.h"

#include <math.h>

#define PEAK_PART 1e-4

enum { TERMS = 4 }; /* 1, x^2, xy, y^2; a mean slope is not fitted */

struct normal_equations {
    double a[TERMS][TERMS], b[TERMS];
};

/* Gauss, pivots on the diagonal: the matrix is positive definite or of no use. */
static bool solve(struct normal_equations *e, double x[TERMS])
{
    for (int k = 0; k < TERMS; k++) {
        if (!(e->a[k][k] > 0)) return false;
        for (int i = k + 1; i < TERMS; i++) {
            double part = e->a[i][k] / e->a[k][k];
            for (int j = k; j < TERMS; j++) e->a[i][j] -= part * e->a[k][j];
            e->b[i] -= part * e->b[k];
        }
    }
    for (int k = TERMS; k-- > 0;) {
        x[k] = e->b[k];
        for (int j = k + 1; j < TERMS; j++) x[k] -= e->a[k][j] * x[j];
        x[k] /= e->a[k][k];
    }
    return true;
}

/* What a node says: its terms and what they should sum to, GGX's relative to it. */
static double node(const struct fit_turn *t, facet_ndf ndf, size_t m, double term[TERMS])
{
    double phi = 2 * FACET_PI * (double)(m % t->turns) / (double)t->turns,
           r = t->r[m / t->turns] / t->scale;
    double x = r * cos(phi), y = r * sin(phi), size = ndf == FACET_GGX ? sqrt(t->p[m]) : 1;
    const double plain[TERMS] = {1, x * x, x * y, y * y};
    for (int k = 0; k < TERMS; k++) term[k] = size * plain[k];
    return ndf == FACET_GGX ? 1 : log(t->p[m]);
}

double facet_fit_turn_purity(const struct fit_turn *t, facet_ndf ndf)
{
    struct normal_equations e = {0};
    double peak = 0, term[TERMS], x[TERMS], square = 0, count = 0;
    size_t n = t->radii * t->turns;
    for (size_t m = 0; m < n; m++) peak = fmax(peak, t->p[m]);
    for (size_t m = 0; m < n; m++) {
        if (!(t->p[m] >= PEAK_PART * peak)) continue;
        double value = node(t, ndf, m, term);
        for (int i = 0; i < TERMS; i++) {
            e.b[i] += term[i] * value;
            for (int j = 0; j < TERMS; j++) e.a[i][j] += term[i] * term[j];
        }
    }
    if (!solve(&e, x)) return INFINITY;
    for (size_t m = 0; m < n; m++) {
        if (!(t->p[m] >= PEAK_PART * peak)) continue;
        double rest = -node(t, ndf, m, term);
        for (int i = 0; i < TERMS; i++) rest += x[i] * term[i];
        square += rest * rest;
        count++;
    }
    return (ndf == FACET_GGX ? 2 : 1) * sqrt(square / count);
}
