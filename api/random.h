/*
 * random.h - the numbers behind `seed`: value k of the SplitMix64 stream (Steele,
 * Lea & Flood 2014) that starts at the seed, its upper 53 bits over 2^53, in
 * [0, 1).  Any value can be had without those before it.
 */
#ifndef API_RANDOM_H
#define API_RANDOM_H

#include <stdint.h>

static inline double api_random(uint64_t seed, uint64_t k)
{
    uint64_t z = seed + (k + 1) * UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

#endif
