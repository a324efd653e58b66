#include "gauss.h"

#include "facet.h"

#include <math.h>

/* Legendre polynomial of degree n at x by its three-term recurrence, and its derivative. */
static double legendre(size_t n, double x, double *derivative)
{
    double p = 1, q = 0;
    for (size_t k = 0; k < n; k++) {
        double next = ((2.0 * (double)k + 1) * x * p - (double)k * q) / ((double)k + 1);
        q = p;
        p = next;
    }
    *derivative = (double)n * (x * p - q) / (x * x - 1);
    return p;
}

void facet_gauss_legendre(size_t n, double *node, double *weight)
{
    enum { STEPS = 8 }; /* Newton converges quadratically from Tricomi's guess: 4 do */
    static const double small = 1e-15;
    for (size_t i = 0; i < (n + 1) / 2; i++) {
        double x = cos(FACET_PI * ((double)i + 0.75) / ((double)n + 0.5)), slope;
        for (int k = 0; k < STEPS; k++) {
            double p = legendre(n, x, &slope);
            x -= p / slope;
            if (fabs(p / slope) < small) break;
        }
        legendre(n, x, &slope);
        node[n - 1 - i] = (1 + x) / 2;
        node[i] = (1 - x) / 2;
        weight[i] = weight[n - 1 - i] = 1 / ((1 - x * x) * slope * slope);
    }
}
