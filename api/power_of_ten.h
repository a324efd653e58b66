/* power_of_ten.h - what reading and printing numbers share: 128 leading bits of every power of ten. */
#ifndef API_POWER_OF_TEN_H
#define API_POWER_OF_TEN_H

#include <stdint.h>
#include <string.h>

typedef unsigned __int128 wide;

enum {
    POWER_MIN = -342, /* w 1e-343 rounds to 0 for every w < 2^64 */
    POWER_MAX = 341,  /* 17 digits of the least double */
    EXACT_MAX = 55    /* 5^55 < 2^128 */
};

extern wide api_powers[POWER_MAX - POWER_MIN + 1];

/* 10^q = (power(q) + less than 1) 2^(log2_of_power(q) - 127), 2^127 <= power(q). */
static inline wide power(int q)
{
    return api_powers[q - POWER_MIN];
}

/*
 * By the 11 bits of a normal double's exponent, what tells its decimal one.  Low 11 bits: LOG10_BIAS +
 * floor(log10) of the least such double.  All 64: at or above the 53 bits, written from the top one on,
 * of the greatest double below the power of ten among them; where there is none, of the greatest.
 */
extern uint64_t api_binades[2047];
enum { LOG10_BIAS = 308 };

/* floor(exponent log10 2), exact for |exponent| < 1700. */
static inline int log10_of_binary(int exponent)
{
    return (exponent * 315653) >> 20;
}

/* floor(q log2 10): exact for |q| < 400, as the test of every power shows. */
static inline int log2_of_power(int q)
{
    return (q * 217706) >> 16;
}

/* floor(w power / 2^64); the product with the exact power lies less than 2 above. */
static inline wide product(uint64_t w, wide p)
{
    return (wide)w * (uint64_t)(p >> 64) + ((wide)w * (uint64_t)p >> 64);
}

static inline double from_bits(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline uint64_t to_bits(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* clang-format off */
static const uint64_t tens[] = {1,
                                10,
                                100,
                                1000,
                                10000,
                                100000,
                                1000000,
                                10000000,
                                100000000,
                                1000000000,
                                10000000000,
                                100000000000,
                                1000000000000,
                                10000000000000,
                                100000000000000,
                                1000000000000000,
                                10000000000000000,
                                100000000000000000,
                                1000000000000000000};
/* clang-format on */

#endif
