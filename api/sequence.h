/*
 * sequence.h - the points (u1, u2) behind n and seed.
 *
 *   random  values 2k and 2k + 1 of random.h's stream, k = set n + index: the sets follow each other
 *   sobol   the (0,2)-sequence of Sobol (1967): dimension 1 van der Corput, dimension 2 Pascal's
 *           triangle mod 2; Owen (1995) scrambled: each bit is flipped by a hash of seed, set,
 *           dimension and the bits above it.  2^m points put one in every dyadic box of area 2^-m
 *   r2      Roberts (2018): index + 1 times (1/g, 1/g^2), g^3 = g + 1, modulo 1, shifted at random
 *
 * The low-discrepancy sequences start anew for each set (each wo), with bits or a shift of its own.
 * Every point can be had without those before it.
 */
#ifndef API_SEQUENCE_H
#define API_SEQUENCE_H

#include <stdint.h>

enum sequence { SEQUENCE_RANDOM, SEQUENCE_SOBOL, SEQUENCE_R2 };
extern const char *const api_sequence_names[];

#define SEQUENCE_FIELD(type_)                                                                      \
    {                                                                                              \
        MEMBER(type_, sequence), FIELD_ENUM, FIELD_DEFAULT,                                        \
            .names = api_sequence_names,                                                           \
            .doc =                                                                                 \
                "with n: independent numbers, Owen-scrambled Sobol points (best with n a power "   \
                "of two), or the R2 lattice with a random shift; the last two cover the square "   \
                "evenly, anew for each wo"                                                         \
    }

/* Point index < 2^32 of n in the set-th set: u[0] and u[1] in [0, 1). */
void api_sequence(enum sequence sequence, uint64_t seed, uint64_t set, uint64_t index, uint64_t n,
                  double u[2]);

#endif
