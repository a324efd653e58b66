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
typedef double double2 __attribute__((vector_size(16)));
typedef double double4 __attribute__((vector_size(32)));
typedef int32_t int4 __attribute__((vector_size(16)));

struct columns4 {
    float4 x, y, z;
};

static inline struct columns4 columns_of_triples(float4 a, float4 b, float4 c)
{
    float4 xa = __builtin_shufflevector(b, c, 2, 2, 5, 5),
           yb = __builtin_shufflevector(a, b, 1, 1, 4, 4);
    float4 yc = __builtin_shufflevector(b, c, 3, 3, 6, 6),
           za = __builtin_shufflevector(a, b, 2, 2, 5, 5);
    return (struct columns4){__builtin_shufflevector(a, xa, 0, 3, 4, 6),
                             __builtin_shufflevector(yb, yc, 0, 2, 4, 6),
                             __builtin_shufflevector(za, c, 0, 2, 4, 7)};
}

/* One by one: an array of them would go through memory. */
static inline float4 floats_at(const char *bytes)
{
    float4 v;
    memcpy(&v, bytes, sizeof v);
    return v;
}

/* Vectors i .. i + 3 of those that begin at floats. */
static inline struct columns4 triples_at(const void *floats, size_t i)
{
    const char *p = (const char *)floats + i * 3 * sizeof(float);
    return columns_of_triples(floats_at(p), floats_at(p + sizeof(float4)),
                              floats_at(p + 2 * sizeof(float4)));
}

/* Stored by halves: a register of four doubles is not to be had everywhere. */
static inline void put_widened(double *out, float4 v)
{
    double4 wide = __builtin_convertvector(v, double4);
    double2 low = __builtin_shufflevector(wide, wide, 0, 1),
            high = __builtin_shufflevector(wide, wide, 2, 3);
    memcpy(out, &low, sizeof low);
    memcpy(out + 2, &high, sizeof high);
}

/* The first of n numbers as floats, by the four; how many. */
static inline size_t put_narrowed(char *out, const double *from, size_t n)
{
    size_t i = 0;
    for (; i + 4 <= n; i += 4) {
        double4 wide;
        memcpy(&wide, from + i, sizeof wide);
        float4 v = __builtin_convertvector(wide, float4);
        memcpy(out + i * sizeof(float), &v, sizeof v);
    }
    return i;
}

#endif
