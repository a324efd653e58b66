/*
 * triples.h - vectors x y z x y z .. of float32, wherever they begin, four at a time: as columns.
 *
 * Written out with the compilers' own vectors: neither compiler finds these shuffles by itself.
 */
#ifndef API_TRIPLES_H
#define API_TRIPLES_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef float float4 __attribute__((vector_size(16)));
typedef double double4 __attribute__((vector_size(32)));
typedef int32_t int4 __attribute__((vector_size(16)));

struct columns4 {
    float4 x, y, z;
};

static inline struct columns4 columns_of_triples(float4 a, float4 b, float4 c)
{
    float4 xa = __builtin_shufflevector(b, c, 2, 2, 5, 5), yb = __builtin_shufflevector(a, b, 1, 1, 4, 4);
    float4 yc = __builtin_shufflevector(b, c, 3, 3, 6, 6), za = __builtin_shufflevector(a, b, 2, 2, 5, 5);
    return (struct columns4){__builtin_shufflevector(a, xa, 0, 3, 4, 6), __builtin_shufflevector(yb, yc, 0, 2, 4, 6),
                             __builtin_shufflevector(za, c, 0, 2, 4, 7)};
}

/* Vectors i .. i + 3 of those that begin at floats. */
static inline struct columns4 triples_at(const void *floats, size_t i)
{
    float4 v[3];
    memcpy(v, (const char *)floats + i * 3 * sizeof(float), sizeof v);
    return columns_of_triples(v[0], v[1], v[2]);
}

static inline void put_widened(double *out, float4 v)
{
    double4 wide = __builtin_convertvector(v, double4);
    memcpy(out, &wide, sizeof wide);
}

#endif
