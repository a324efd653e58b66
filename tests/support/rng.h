/* rng.h - the tests' and the bench's random numbers. */
#ifndef RNG_H
#define RNG_H

/* Deterministic random numbers: xoshiro256**, uniform in [0, 1). */
struct rng {
    unsigned long long s[4];
};
void rng_seed(struct rng *rng, unsigned long long seed);
double rng_uniform(struct rng *rng);
/* Log-uniform in [low, high]. */
double rng_log(struct rng *rng, double low, double high);

#endif
