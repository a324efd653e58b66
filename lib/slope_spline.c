#include "slope_spline.h"

#include <math.h>
#include <string.h>

/* ---- Cubic spline ------------------------------------------------------------------------ */

/*
 * Derivatives m of the cubic spline through y[0 .. n-1], unit spacing, with the
 * derivative *start at its start; where start is NULL and at its end it is
 * not-a-knot (de Boor 1978, ch. IV).  work holds n.
 */
static void spline_slopes(const double *y, size_t n, const double *start, double *m, double *work)
{
    if (n < 3 || (n == 3 && !start)) {
        for (size_t i = 0; i < n; i++) { /* the polynomial through all of them */
            double back = i > 0 ? y[i] - y[i - 1] : 0, ahead = i + 1 < n ? y[i + 1] - y[i] : 0;
            double bend = n == 3 ? y[2] - 2 * y[1] + y[0] : 0;
            m[i] = i == 0 ? ahead - bend / 2 : back + bend / 2;
        }
        if (start) m[0] = *start;
        return;
    }
    /* m[i-1] + 4 m[i] + m[i+1] = 3 (y[i+1] - y[i-1]), forward elimination into work and m */
    work[0] = start ? 0 : 2;
    m[0] = start ? *start : (y[2] + 4 * y[1] - 5 * y[0]) / 2;
    for (size_t i = 1; i + 1 < n; i++) {
        double pivot = 4 - work[i - 1];
        work[i] = 1 / pivot;
        m[i] = (3 * (y[i + 1] - y[i - 1]) - m[i - 1]) / pivot;
    }
    size_t e = n - 1;
    m[e] = ((5 * y[e] - 4 * y[e - 1] - y[e - 2]) / 2 - 2 * m[e - 1]) / (1 - 2 * work[e - 1]);
    for (size_t i = e; i-- > 0;) m[i] -= work[i] * m[i + 1];
}

/*
 * Where log_q moves by more than 1 from node to node, a spline may swing by e
 * and more: keep its slopes within the range in which a cubic stays between its
 * ends (Fritsch & Carlson 1980).  Smooth tables are not touched.
 */
static void limit_slopes(const double *y, size_t n, double *m)
{
    for (size_t i = 0; i < n; i++) {
        double back = i > 0 ? y[i] - y[i - 1] : y[1] - y[0];
        double ahead = i + 1 < n ? y[i + 1] - y[i] : back;
        if (fmax(fabs(m[i]), fmax(fabs(back), fabs(ahead))) <= 1) continue;
        double limit = 3 * fmin(fabs(back), fabs(ahead));
        if (back * ahead > 0 && m[i] * back < 0) limit = 0;
        m[i] = fmax(-limit, fmin(limit, m[i]));
    }
}

/* A step this high, and so many times that of a cell beside it, is an edge and not a slope. */
#define CLIFF_STEP 20.0
#define CLIFF_RATIO 16.0

/* Does the cell from node i to i + 1 break the spline?  At nodes with D = 0 and at cliffs. */
static bool breaks(const double *y, size_t n, size_t i)
{
    if (slope_log_is_zero(y[i]) || slope_log_is_zero(y[i + 1])) return true;
    double step = fabs(y[i + 1] - y[i]), beside = INFINITY;
    if (i > 0 && !slope_log_is_zero(y[i - 1])) beside = fmin(beside, fabs(y[i] - y[i - 1]));
    if (i + 2 < n && !slope_log_is_zero(y[i + 2])) beside = fmin(beside, fabs(y[i + 2] - y[i + 1]));
    return step > CLIFF_STEP && beside < INFINITY && step > CLIFF_RATIO * beside;
}

/* ---- Smooth stretches -------------------------------------------------------------------- */

/*
 * Nodes whose sixth differences are no larger lie on a smooth curve: the polynomials of degree 5
 * and 7 then agree to 1e-4 between the middle nodes.  Noise of 3e-4 of D already exceeds it.
 */
#define SMOOTH 1e-2
enum { POINTS = 8, DEGREE = POINTS - 1, BEFORE = POINTS / 2 - 1 };

/* Newton's form through y[0 .. 7] at unit spacing; false where they are not smooth. */
static bool newton(const double *y, double c[POINTS])
{
    double difference[POINTS], factorial = 1;
    memcpy(difference, y, sizeof difference);
    c[0] = y[0];
    for (int k = 1; k < POINTS; k++) {
        for (int i = 0; i < POINTS - k; i++) difference[i] = difference[i + 1] - difference[i];
        for (int i = 0; k == 6 && i < 2; i++)
            if (!(fabs(difference[i]) <= SMOOTH)) return false;
        factorial *= k;
        c[k] = difference[0] / factorial;
    }
    return true;
}

static double newton_at(const double c[POINTS], double x, double *derivative)
{
    double value = c[DEGREE];
    *derivative = 0;
    for (int k = DEGREE; k-- > 0;) {
        *derivative = *derivative * (x - k) + value;
        value = value * (x - k) + c[k];
    }
    return value;
}

/* The cell in the middle, with the values `ends`, as cubics with the polynomial's values and derivatives. */
static void cut_polynomial(const double newton_form[POINTS], const double ends[2], size_t parts,
                           double *c)
{
    double h = 1 / (double)parts, y0 = ends[0], y1, m0, m1;
    newton_at(newton_form, BEFORE, &m0);
    for (size_t k = 1; k <= parts; k++, y0 = y1, m0 = m1, c += 4) {
        y1 = newton_at(newton_form, BEFORE + (double)k * h, &m1);
        if (k == parts) y1 = ends[1];
        slope_hermite(y0, y1, m0 * h, m1 * h, c);
    }
}

/* The same cubic, in parts. */
static void cut_cubic(const double cubic[4], size_t parts, double *c)
{
    double h = 1 / (double)parts;
    for (size_t k = 0; k < parts; k++, c += 4) {
        double t = (double)k * h;
        c[0] = cubic[0] + t * (cubic[1] + t * (cubic[2] + t * cubic[3]));
        c[1] = h * (cubic[1] + t * (2 * cubic[2] + t * 3 * cubic[3]));
        c[2] = h * h * (cubic[2] + t * 3 * cubic[3]);
        c[3] = h * h * h * cubic[3];
    }
}

/* ---- The whole ------------------------------------------------------------------------------ */

/* A cubic misses a cell by its fourth difference / 384, and this much of D is let go. */
#define CUBIC_ERROR 2e-7
/* Of the peak of log P: what lies deeper, below 5e-5 of it, may be told less well. */
#define DEPTH 10.0
/* Tables finer than this gain nothing. */
#define CELLS_MAX 4096

/* Up to what they all share; log_q is that of P (1 - u)^-4. */
static double log_p(const double *y, size_t n, size_t i)
{
    return y[i] + 4 * log1p(-(double)i / (double)(n - 1));
}

size_t facet_slope_parts(const double *y, size_t n)
{
    double peak = -INFINITY, worst = 0, c[POINTS];
    for (size_t i = 0; i + 1 < n; i++) peak = fmax(peak, log_p(y, n, i));
    for (size_t i = 0; i + POINTS <= n; i++) {
        const double *at = y + i + BEFORE; /* the cell's start */
        if (log_p(y, n, i + BEFORE) > peak - DEPTH && newton(y + i, c))
            worst = fmax(worst, fabs(at[-2] - 4 * at[-1] + 6 * at[0] - 4 * at[1] + at[2]));
    }
    size_t parts = 1;
    while (parts < SLOPE_PARTS_MAX && (parts + 1) * (n - 1) <= CELLS_MAX &&
           worst > CUBIC_ERROR * 384 * (double)(parts * parts * parts * parts))
        parts++;
    return parts;
}

/* Nodes without a break between them. */
static void tabulate_stretch(const double *y, size_t n, const double *first, size_t parts,
                             double *c, double *work)
{
    double *m = work, *rest = work + n, cubic[4], polynomial[POINTS];
    spline_slopes(y, n, first, m, rest);
    limit_slopes(y, n, m);
    for (size_t i = 0; i + 1 < n; i++) {
        /* At the ends a polynomial would look to one side, and make more of noise there. */
        bool central = i >= BEFORE && i + POINTS - BEFORE <= n;
        if (central && newton(y + i - BEFORE, polynomial)) {
            cut_polynomial(polynomial, y + i, parts, c + 4 * parts * i);
        } else {
            slope_hermite(y[i], y[i + 1], m[i], m[i + 1], cubic);
            cut_cubic(cubic, parts, c + 4 * parts * i);
        }
    }
}

/* Between the breaks; ramps across them: a spline across would ring far into both sides. */
void facet_slope_spline(const double *y, size_t n, size_t parts, const double *first, double *c,
                        double *work)
{
    double ramp[4];
    for (size_t start = 0, end; start < n; start = end + 1) {
        for (end = start; end + 1 < n && !breaks(y, n, end); end++) continue;
        if (end > start)
            tabulate_stretch(y + start, end - start + 1, start == 0 ? first : NULL, parts,
                             c + 4 * parts * start, work);
        if (end + 1 == n) continue;
        slope_ramp(y[end], y[end + 1], ramp);
        cut_cubic(ramp, parts, c + 4 * parts * end);
    }
}
