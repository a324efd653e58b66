/* chi_squared.h - how likely a histogram is. */
#ifndef CHI_SQUARED_H
#define CHI_SQUARED_H

/* The share of chi^2 distributed numbers of so many degrees of freedom that are larger than x. */
double chi_squared_tail(double x, double freedom);

#endif
