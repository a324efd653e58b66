/*
 * minimize.h - the minimum of a function of one variable.
 */
#ifndef FACET_MINIMIZE_H
#define FACET_MINIMIZE_H

/*
 * Brent's method (Algorithms for Minimization without Derivatives, 1973, ch. 5)
 * in [low, high] to within tolerance, in at most steps evaluations.
 */
double facet_minimize(double (*f)(double x, void *user), void *user, double low, double high,
                      double tolerance, int steps);

#endif
