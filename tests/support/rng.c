#include "rng.h"

#include <math.h>

static unsigned long long rotate(unsigned long long x, int k)
{
    return (x << k) | (x >> (64 - k));
}

void rng_seed(struct rng *rng, unsigned long long seed)
{
    for (int i = 0; i < 4; i++) { /* splitmix64 */
        unsigned long long z = (seed += 0x9e3779b97f4a7c15ULL);
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
        rng->s[i] = z ^ (z >> 31);
    }
}

double rng_uniform(struct rng *rng)
{
    unsigned long long *s = rng->s, result = rotate(s[1] * 5, 7) * 9, t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rotate(s[3], 45);
    return (double)(result >> 11) * 0x1p-53;
}

double rng_log(struct rng *rng, double low, double high)
{
    return exp(log(low) + rng_uniform(rng) * (log(high) - log(low)));
}
