/*
 * double_double.h - unevaluated sums of two doubles (Dekker 1971), for what is prepared
 * or evaluated once and cancels.  Internal; the kernels have theirs on vectors.
 */
#ifndef FACET_DOUBLE_DOUBLE_H
#define FACET_DOUBLE_DOUBLE_H

#include <math.h>

struct pair {
    double hi, lo;
};

static inline struct pair pair_sum(double a, double b)
{
    double s = a + b, t = s - a;
    return (struct pair){s, (a - (s - t)) + (b - t)};
}

static inline struct pair pair_product(struct pair a, struct pair b)
{
    double p = a.hi * b.hi, rest = fma(a.hi, b.hi, -p) + (a.hi * b.lo + a.lo * b.hi);
    return pair_sum(p, rest);
}

static inline struct pair pair_add(struct pair a, struct pair b)
{
    struct pair s = pair_sum(a.hi, b.hi), t = pair_sum(a.lo, b.lo);
    s = pair_sum(s.hi, s.lo + t.hi);
    return pair_sum(s.hi, s.lo + t.lo);
}

static inline struct pair pair_negative(struct pair a)
{
    return (struct pair){-a.hi, -a.lo};
}

static inline struct pair pair_quotient(struct pair a, struct pair b)
{
    double q = a.hi / b.hi;
    struct pair rest = pair_add(a, pair_negative(pair_product((struct pair){q, 0}, b)));
    return pair_sum(q, (rest.hi + rest.lo) / b.hi);
}

static inline struct pair pair_square_root(struct pair a)
{
    double s = sqrt(a.hi);
    return pair_sum(s, (fma(-s, s, a.hi) + a.lo) / (2 * s));
}

#endif
