#include "opposite.h"

#include <math.h>

/* Arguments are shifted up by this before Stirling's series, whose last term is then 1e-16. */
enum { SHIFT = 8 };

/* log Gamma(z) - ((z - 1/2) log z - z + log(2 pi)/2), z > SHIFT. */
static double stirling(double z)
{
    static const double terms[] = { -3617.0 / 122400, 1.0 / 156, -691.0 / 360360, 1.0 / 1188,
                                    -1.0 / 1680,      1.0 / 1260, -1.0 / 360,     1.0 / 12 };
    double inverse = 1 / z, square = inverse * inverse, sum = terms[0];
    for (int k = 1; k < 8; k++) sum = sum * square + terms[k];
    return sum * inverse;
}

/*
 * With t the smaller of a and b, l the larger, and r, m, s = t, l, a + b + 1 + SHIFT:
 *   Gamma(r) Gamma(m) / Gamma(s) = sqrt(2 pi) e^-(1 + SHIFT) (1 - t/s)^(m - 1/2) (r/s)^t r^(SHIFT + 1/2)
 * times what the series leave: no two large logarithms are subtracted.
 */
double facet_opposite(double a, double b)
{
    const double root_two_pi = 2.50662827463100050242;
    double t = fmin(a, b), l = fmax(a, b);
    if (!(t > 0)) return 1;
    if (isinf(l)) return 0;
    double r = t + (1 + SHIFT), m = l + (1 + SHIFT), s = l + r, product = 1;
    for (int k = 1; k <= SHIFT; k++) product *= (l + t + k) / (l + k) / (t + k);
    double power = exp((m - 0.5) * log1p(-t / s)) * pow(r / s, t);
    if (power == 0) return 0; /* what it would be multiplied by may be infinite */
    double scale = root_two_pi * exp(stirling(r) + stirling(m) - stirling(s) - (1 + SHIFT));
    return fmin(scale * pow(r, SHIFT + 0.5) * product * power, 1);
}
