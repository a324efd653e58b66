#include "chi_squared.h"

#include <math.h>

/* Upper tail of the incomplete gamma function, Q(a, x): series below a + 1, else Lentz's fraction. */
static double gamma_tail(double a, double x)
{
    double front = exp(-x + a * log(x) - lgamma(a));
    if (x <= 0) return 1;
    if (x < a + 1) {
        double term = 1 / a, sum = term;
        for (int n = 1; n < 2000 && term > sum * 1e-16; n++) sum += term *= x / (a + n);
        return 1 - front * sum;
    }
    double b = x + 1 - a, c = 1e300, d = 1 / b, h = d;
    for (int n = 1; n < 2000; n++) {
        double an = -n * (n - a);
        b += 2;
        d = 1 / (an * d + b);
        c = b + an / c;
        h *= c * d;
        if (fabs(c * d - 1) < 1e-15) break;
    }
    return front * h;
}

double chi_squared_tail(double x, double freedom)
{
    return gamma_tail(freedom / 2, x / 2);
}
