#include "sequence.h"

#include "random.h"

#include <stddef.h>

const char *const api_sequence_names[] = {"random", "sobol", "r2", NULL};

/* 53 bits, the first worth 1/2. */
enum { BITS = 53 };

static double fraction(uint64_t bits)
{
    return (double)bits * 0x1p-53;
}

/* Murmur3's finaliser, a bijection in which every bit of the input moves every bit of the output. */
static uint64_t mix(uint64_t x)
{
    x = (x ^ (x >> 33)) * UINT64_C(0xff51afd7ed558ccd);
    x = (x ^ (x >> 33)) * UINT64_C(0xc4ceb9fe1a85ec53);
    return x ^ (x >> 33);
}

/* Radical inverse in base 2: bit b of the index is worth 2^-(b + 1). */
static uint64_t sobol_first(uint64_t index)
{
    uint64_t x = 0;
    for (int b = 0; b < BITS && index >> b; b++) x |= (index >> b & 1) << (BITS - 1 - b);
    return x;
}

/* The second dimension's direction numbers are the rows of Pascal's triangle mod 2: v' = v ^ v/2. */
static uint64_t sobol_second(uint64_t index)
{
    uint64_t x = 0, v = UINT64_C(1) << (BITS - 1);
    for (; index; index >>= 1, v ^= v >> 1)
        if (index & 1) x ^= v;
    return x;
}

/*
 * Owen's nested scrambling: whether a bit flips is drawn anew for every value of the bits above it,
 * so that a dyadic interval is carried to a dyadic interval.  A leading 1 tells prefixes of
 * different lengths apart.
 */
static uint64_t owen(uint64_t x, uint64_t key)
{
    uint64_t flips = 0;
    for (int b = 0; b < BITS; b++) {
        uint64_t prefix = UINT64_C(1) << b | x >> (BITS - b);
        flips |= (mix(key ^ mix(prefix)) & 1) << (BITS - 1 - b);
    }
    return x ^ flips;
}

/* 2^64/g and 2^64/g^2, g = 1.3247179572447460 the root of g^3 = g + 1. */
#define R2_FIRST UINT64_C(0xc13fa9a902a6328f)
#define R2_SECOND UINT64_C(0x91e10da5c79e7b1c)

void api_sequence(enum sequence sequence, uint64_t seed, uint64_t set, uint64_t index, uint64_t n,
                  double u[2])
{
    uint64_t k = set * n + index;
    if (sequence == SEQUENCE_RANDOM) {
        u[0] = api_random(seed, 2 * k);
        u[1] = api_random(seed, 2 * k + 1);
        return;
    }
    uint64_t key = mix(mix(seed) + set), first = mix(key + 1), second = mix(key + 2);
    if (sequence == SEQUENCE_SOBOL) {
        u[0] = fraction(owen(sobol_first(index), first));
        u[1] = fraction(owen(sobol_second(index), second));
    } else {
        u[0] = fraction((first + (index + 1) * R2_FIRST) >> 11);
        u[1] = fraction((second + (index + 1) * R2_SECOND) >> 11);
    }
}
