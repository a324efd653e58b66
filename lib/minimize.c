#include "minimize.h"

#include <math.h>

#define GOLDEN 0.38196601125010515 /* (3 - sqrt 5)/2 */

struct point {
    double x, y;
};

/* Where the parabola through three points is level, as a step from a; NaN if it is not convex. */
static double parabola(struct point a, struct point b, struct point c)
{
    double s = (a.x - b.x) * (a.y - c.y), t = (a.x - c.x) * (a.y - b.y);
    double down = 2 * (s - t);
    return -((a.x - b.x) * s - (a.x - c.x) * t) / down;
}

double facet_minimize(double (*f)(double x, void *user), void *user, double low, double high,
                      double tolerance, int steps)
{
    struct point best, second, third, now;
    double last = 0, step = 0; /* the step before the last, and the last */
    best.x = low + GOLDEN * (high - low);
    best.y = f(best.x, user);
    second = third = best;
    while (--steps > 0) {
        double middle = (low + high) / 2, before = last;
        if (fabs(best.x - middle) <= 2 * tolerance - (high - low) / 2) break;
        last = step;
        step = parabola(best, second, third);
        /* golden section where the parabola leaves the bracket or does not shrink fast enough */
        if (!(fabs(step) < fabs(before) / 2 && best.x + step > low && best.x + step < high)) {
            last = best.x < middle ? high - best.x : low - best.x;
            step = GOLDEN * last;
        }
        if (fabs(step) < tolerance) step = best.x < middle ? tolerance : -tolerance;
        now.x = best.x + step;
        now.y = f(now.x, user);
        if (now.y <= best.y) {
            if (now.x < best.x)
                high = best.x;
            else
                low = best.x;
            third = second;
            second = best;
            best = now;
        } else {
            if (now.x < best.x)
                low = now.x;
            else
                high = now.x;
            if (now.y <= second.y || second.x == best.x) {
                third = second;
                second = now;
            } else if (now.y <= third.y || third.x == best.x || third.x == second.x) {
                third = now;
            }
        }
    }
    return best.x;
}
