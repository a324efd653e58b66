/*
 * wider.h - a step wider than the tier: doubles for float, pairs of doubles for double.  For what
 * is formed by differences of what the caller gave, in doubles whatever the tier.
 */
#ifndef FACET_WIDER_H
#define FACET_WIDER_H

#include "real.h"

#if REAL_IS_FLOAT

typedef struct doubles wider;
typedef int64_t half_bits __attribute__((vector_size(REGISTER_BYTES)));

INLINE wider wider_at(const double *array, size_t k)
{
    return load_doubles(array + k);
}
INLINE wider wider_sum(wider a, wider b)
{
    return (wider){{a.half[0] + b.half[0], a.half[1] + b.half[1]}};
}
INLINE wider wider_product(wider a, wider b)
{
    return (wider){{a.half[0] * b.half[0], a.half[1] * b.half[1]}};
}

/* The one number where sign < 0, else the other; each with what its double lacks. */
INLINE wider wider_choice(wider sign, double a, double a_low, double b, double b_low)
{
    (void)a_low, (void)b_low;
    wider to;
    for (int j = 0; j < 2; j++) {
        half_bits is_less = (half_bits)(sign.half[j] < 0);
        const half_lanes zero = {0}, first = zero + a, second = zero + b;
        to.half[j] = (half_lanes)(((half_bits)first & is_less) | ((half_bits)second & ~is_less));
    }
    return to;
}

INLINE pair wider_pair(wider a)
{
    return (pair){narrow(a), splat(0)};
}

#else

typedef pair wider;

INLINE wider wider_at(const double *array, size_t k)
{
    return (pair){load(array + k), splat(0)};
}
INLINE wider wider_sum(wider a, wider b)
{
    return pair_add(a, b);
}
INLINE wider wider_product(wider a, wider b)
{
    return pair_multiply(a, b);
}

INLINE wider wider_choice(wider sign, double a, double a_low, double b, double b_low)
{
    mask is_less = less(sign.hi, splat(0));
    return (pair){select(is_less, splat(a), splat(b)), select(is_less, splat(a_low), splat(b_low))};
}

INLINE pair wider_pair(wider a)
{
    return pair_normalise(a);
}

#endif

#endif
