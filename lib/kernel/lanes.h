/*
 * lanes.h - vectors of numbers: LANES elements worked on at once, and the
 * operations on them that C does not write as operators.
 *
 * real is a vector of float in draft and fast, of double in exact32 and
 * precise, in the widest registers of the instruction set the file is compiled
 * for.  Written out rather than left to the compiler: auto-vectorisation fails
 * silently and knows no reciprocal estimates.
 */
/* One operation, one line. */
/* clang-format off */
#ifndef FACET_LANES_H
#define FACET_LANES_H

#include <float.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))
/* For what is long and called from many loops: their calls cost less than compiling it into each. */
#define APART static __attribute__((noinline, unused))

#if defined(FACET_TIER_draft) || defined(FACET_TIER_fast)
#define REAL_IS_FLOAT 1
typedef float lane;
typedef int32_t lane_bits;
#define REAL_MIN FLT_MIN
#define REAL_MAX FLT_MAX
#else
#define REAL_IS_FLOAT 0
typedef double lane;
typedef int64_t lane_bits;
#define REAL_MIN DBL_MIN
#define REAL_MAX DBL_MAX
#endif

/* A constant or parameter in the precision of the tier. */
#define R(x) ((lane)(x))

#if defined(__AVX512F__)
#define REGISTER_BYTES 64
#elif defined(__AVX__)
#define REGISTER_BYTES 32
#else
#define REGISTER_BYTES 16
#endif
#define LANES ((size_t)(REGISTER_BYTES / sizeof(lane)))

typedef lane real __attribute__((vector_size(REGISTER_BYTES)));
typedef lane_bits bits __attribute__((vector_size(REGISTER_BYTES)));

#if defined(__SSE2__)

#include <immintrin.h>

#define PASTE_(a, b, c) a##b##c
#define PASTE(a, b, c) PASTE_(a, b, c)
#if REGISTER_BYTES == 64
#define PREFIX _mm512_
#elif REGISTER_BYTES == 32
#define PREFIX _mm256_
#else
#define PREFIX _mm_
#endif
#if REAL_IS_FLOAT
#define VECTOR(operation) PASTE(PREFIX, operation, _ps)
#else
#define VECTOR(operation) PASTE(PREFIX, operation, _pd)
#endif

#if REGISTER_BYTES == 64 && REAL_IS_FLOAT
typedef __mmask16 mask;
#elif REGISTER_BYTES == 64
typedef __mmask8 mask;
#else
typedef bits mask;
#endif

INLINE real splat(lane x) { return VECTOR(set1)(x); }
INLINE real real_sqrt(real x) { return VECTOR(sqrt)(x); }
/* b where one is not a number, as a < b ? a : b. */
INLINE real real_min(real a, real b) { return VECTOR(min)(a, b); }
INLINE real real_max(real a, real b) { return VECTOR(max)(a, b); }

#if REGISTER_BYTES == 64
INLINE mask less(real a, real b) { return PASTE(VECTOR(cmp), _mask, )(a, b, _CMP_LT_OQ); }
/* Not less: true also of what is not a number. */
INLINE mask not_less(real a, real b) { return PASTE(VECTOR(cmp), _mask, )(a, b, _CMP_NLT_UQ); }
INLINE bool any(mask m) { return m != 0; }
INLINE unsigned mask_bits(mask m) { return m; }
/* a where m, else b. */
INLINE real select(mask m, real a, real b) { return VECTOR(mask_blend)(m, b, a); }
#else
INLINE mask less(real a, real b) { return (mask)(a < b); }
INLINE mask not_less(real a, real b) { return ~less(a, b); }
INLINE unsigned mask_bits(mask m) { return (unsigned)VECTOR(movemask)((real)m); }
INLINE bool any(mask m) { return mask_bits(m) != 0; }
#if REGISTER_BYTES == 32
INLINE real select(mask m, real a, real b) { return VECTOR(blendv)(b, a, (real)m); }
#else
INLINE real select(mask m, real a, real b) { return (real)(((bits)a & m) | ((bits)b & ~m)); }
#endif
#endif

#ifdef __FMA__
#define HAS_FMA 1
INLINE real madd(real a, real b, real c) { return VECTOR(fmadd)(a, b, c); }
INLINE real nmadd(real a, real b, real c) { return VECTOR(fnmadd)(a, b, c); }
#else
#define HAS_FMA 0
INLINE real madd(real a, real b, real c) { return a * b + c; }
INLINE real nmadd(real a, real b, real c) { return c - a * b; }
#endif

/* Estimates of 1/x and 1/sqrt(x), x > 0: to 2^-14 (AVX-512) or 1.5 2^-12 (float only). */
#if REGISTER_BYTES == 64
#define HAS_ESTIMATES 14
INLINE real recip_estimate(real x) { return VECTOR(rcp14)(x); }
INLINE real rsqrt_estimate(real x) { return VECTOR(rsqrt14)(x); }
#elif REAL_IS_FLOAT
#define HAS_ESTIMATES 12
INLINE real recip_estimate(real x) { return VECTOR(rcp)(x); }
INLINE real rsqrt_estimate(real x) { return VECTOR(rsqrt)(x); }
#else
#define HAS_ESTIMATES 0
#endif

#else /* any other processor: the compiler's own vectors */

typedef bits mask;
#define HAS_FMA 0
#define HAS_ESTIMATES 0

INLINE real splat(lane x)
{
    real v;
    for (size_t k = 0; k < LANES; k++) v[k] = x;
    return v;
}

INLINE real real_sqrt(real x)
{
    for (size_t k = 0; k < LANES; k++) x[k] = REAL_IS_FLOAT ? (lane)__builtin_sqrtf((float)x[k]) : (lane)__builtin_sqrt(x[k]);
    return x;
}

INLINE mask less(real a, real b) { return (mask)(a < b); }
INLINE mask not_less(real a, real b) { return ~less(a, b); }
INLINE real select(mask m, real a, real b) { return (real)(((bits)a & m) | ((bits)b & ~m)); }
INLINE real real_min(real a, real b) { return select(less(a, b), a, b); }
INLINE real real_max(real a, real b) { return select(less(b, a), a, b); }
INLINE real madd(real a, real b, real c) { return a * b + c; }
INLINE real nmadd(real a, real b, real c) { return c - a * b; }

INLINE bool any(mask m)
{
    lane_bits all = 0;
    for (size_t k = 0; k < LANES; k++) all |= m[k];
    return all != 0;
}

INLINE unsigned mask_bits(mask m)
{
    unsigned bits_ = 0;
    for (size_t k = 0; k < LANES; k++) bits_ |= (unsigned)(m[k] != 0) << k;
    return bits_;
}

#endif

/* x 2^n, n a whole number. */
#if REGISTER_BYTES == 64 && defined(__SSE2__)
#define HAS_SCALE 1
INLINE real scaled_by(real x, real n) { return VECTOR(scalef)(x, n); }
INLINE real nearest(real x) { return VECTOR(roundscale)(x, _MM_FROUND_TO_NEAREST_INT); }
#else
#define HAS_SCALE 0
#endif

INLINE real real_abs(real x)
{
    const lane_bits sign = REAL_IS_FLOAT ? INT32_MAX : (lane_bits)INT64_MAX;
    return (real)((bits)x & sign);
}

#if REAL_IS_FLOAT
/* A vector of floats as doubles, and back; and a - b c in them. */
typedef double half_lanes __attribute__((vector_size(REGISTER_BYTES)));
struct doubles {
    half_lanes half[2];
};

#if REGISTER_BYTES == 64 && defined(__SSE2__)
INLINE struct doubles widen(real x)
{
    return (struct doubles){ { _mm512_cvtps_pd(_mm512_castps512_ps256(x)), _mm512_cvtps_pd(_mm512_extractf32x8_ps(x, 1)) } };
}
INLINE real narrow(struct doubles x)
{
    return _mm512_insertf32x8(_mm512_castps256_ps512(_mm512_cvtpd_ps(x.half[0])), _mm512_cvtpd_ps(x.half[1]), 1);
}
INLINE half_lanes half_nmadd(half_lanes b, double c, half_lanes a) { return _mm512_fnmadd_pd(b, _mm512_set1_pd(c), a); }
#elif REGISTER_BYTES == 32 && defined(__SSE2__)
INLINE struct doubles widen(real x)
{
    return (struct doubles){ { _mm256_cvtps_pd(_mm256_castps256_ps128(x)), _mm256_cvtps_pd(_mm256_extractf128_ps(x, 1)) } };
}
INLINE real narrow(struct doubles x)
{
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm256_cvtpd_ps(x.half[0])), _mm256_cvtpd_ps(x.half[1]), 1);
}
#ifdef __FMA__
INLINE half_lanes half_nmadd(half_lanes b, double c, half_lanes a) { return _mm256_fnmadd_pd(b, _mm256_set1_pd(c), a); }
#else
INLINE half_lanes half_nmadd(half_lanes b, double c, half_lanes a) { return a - b * c; }
#endif
#elif defined(__SSE2__)
INLINE struct doubles widen(real x)
{
    return (struct doubles){ { _mm_cvtps_pd(x), _mm_cvtps_pd(_mm_movehl_ps(x, x)) } };
}
INLINE real narrow(struct doubles x)
{
    return _mm_movelh_ps(_mm_cvtpd_ps(x.half[0]), _mm_cvtpd_ps(x.half[1]));
}
INLINE half_lanes half_nmadd(half_lanes b, double c, half_lanes a) { return a - b * c; }
#else
INLINE struct doubles widen(real x)
{
    struct doubles y;
    for (size_t k = 0; k < LANES; k++) y.half[2 * k / LANES][k % (LANES / 2)] = x[k];
    return y;
}
INLINE real narrow(struct doubles x)
{
    real y;
    for (size_t k = 0; k < LANES; k++) y[k] = (float)x.half[2 * k / LANES][k % (LANES / 2)];
    return y;
}
INLINE half_lanes half_nmadd(half_lanes b, double c, half_lanes a) { return a - b * c; }
#endif
#endif

/* ---- looking up ------------------------------------------------------------------ */

/* A place in memory for every lane: no more than 2^31. */
typedef int32_t lane_index __attribute__((vector_size(LANES * sizeof(int32_t))));

/* Of 0 <= x < 2^31. */
INLINE lane_index whole_part(real x) { return __builtin_convertvector(x, lane_index); }
INLINE real real_of(lane_index i) { return __builtin_convertvector(i, real); }

#if REAL_IS_FLOAT
INLINE lane_index select_index(mask m, lane_index a, lane_index b) { return (lane_index)select(m, (real)a, (real)b); }
#endif

/* Extracting lanes from a register takes several times as long as reading them back, which compilers do not know. */
INLINE void put_in_memory(lane_index i, int32_t at[LANES])
{
    memcpy(at, &i, sizeof i);
    __asm__("" : "+m"(*(int32_t(*)[LANES])at));
}

/* Four neighbours in memory of every lane: c[at + j] in of[j].  Whole loads and a transposition: with gathers fr takes 8.1 ns for 4.6 (Zen 4). */
struct fours {
    real of[4];
};

#if defined(__SSE2__)
#if REAL_IS_FLOAT
#define SLOT(p) _mm_loadu_ps(p)
#define SLOTS(a, b) _mm256_insertf128_ps(_mm256_castps128_ps256(SLOT(a)), SLOT(b), 1)
#else
#define SLOT(p) _mm_loadu_pd(p)
#define SLOTS(a, b) _mm256_insertf128_pd(_mm256_castpd128_pd256(SLOT(a)), SLOT(b), 1)
#endif
/* 16 bytes of every step-th lane. */
#if REGISTER_BYTES == 64 && REAL_IS_FLOAT
INLINE real slots(const lane *c, const int32_t *at, size_t step) { return _mm512_insertf32x8(_mm512_castps256_ps512(SLOTS(c + at[0], c + at[step])), SLOTS(c + at[2 * step], c + at[3 * step]), 1); }
#elif REGISTER_BYTES == 64
INLINE real slots(const lane *c, const int32_t *at, size_t step) { return _mm512_insertf64x4(_mm512_castpd256_pd512(SLOTS(c + at[0], c + at[step])), SLOTS(c + at[2 * step], c + at[3 * step]), 1); }
#elif REGISTER_BYTES == 32
INLINE real slots(const lane *c, const int32_t *at, size_t step) { return SLOTS(c + at[0], c + at[step]); }
#else
INLINE real slots(const lane *c, const int32_t *at, size_t step) { (void)step; return SLOT(c + at[0]); }
#endif
#if REAL_IS_FLOAT
INLINE struct fours fours_at(const lane *c, const int32_t at[LANES])
{
    real r0 = slots(c, at, 4), r1 = slots(c, at + 1, 4), r2 = slots(c, at + 2, 4), r3 = slots(c, at + 3, 4);
    real a = VECTOR(unpacklo)(r0, r1), b = VECTOR(unpacklo)(r2, r3), d = VECTOR(unpackhi)(r0, r1), e = VECTOR(unpackhi)(r2, r3);
    return (struct fours){ { VECTOR(shuffle)(a, b, 0x44), VECTOR(shuffle)(a, b, 0xee), VECTOR(shuffle)(d, e, 0x44), VECTOR(shuffle)(d, e, 0xee) } };
}
#else
INLINE struct fours fours_at(const lane *c, const int32_t at[LANES])
{
    real a = slots(c, at, 2), b = slots(c, at + 1, 2), d = slots(c + 2, at, 2), e = slots(c + 2, at + 1, 2);
    return (struct fours){ { VECTOR(unpacklo)(a, b), VECTOR(unpackhi)(a, b), VECTOR(unpacklo)(d, e), VECTOR(unpackhi)(d, e) } };
}
#endif
#else
INLINE struct fours fours_at(const lane *c, const int32_t at[LANES])
{
    struct fours y;
    for (size_t k = 0; k < LANES; k++)
        for (int j = 0; j < 4; j++) y.of[j][k] = c[at[k] + j];
    return y;
}
#endif

/* ---- to and from memory --------------------------------------------------------- */

#ifdef FACET_IO_float
typedef float io;
#else
typedef double io;
#endif

#if defined(FACET_IO_float) && !REAL_IS_FLOAT && defined(__SSE2__)
#if REGISTER_BYTES == 64
INLINE real load(const io *p) { return _mm512_cvtps_pd(_mm256_loadu_ps(p)); }
INLINE void store_rounded(io *p, real x) { _mm256_storeu_ps(p, _mm512_cvtpd_ps(x)); }
#elif REGISTER_BYTES == 32
INLINE real load(const io *p) { return _mm256_cvtps_pd(_mm_loadu_ps(p)); }
INLINE void store_rounded(io *p, real x) { _mm_storeu_ps(p, _mm256_cvtpd_ps(x)); }
#else
INLINE real load(const io *p) { return _mm_cvtps_pd(_mm_castsi128_ps(_mm_loadl_epi64((const __m128i *)(const void *)p))); }
INLINE void store_rounded(io *p, real x) { _mm_storel_epi64((__m128i *)(void *)p, _mm_castps_si128(_mm_cvtpd_ps(x))); }
#endif
/* What no float is near saturates; what is not a number stays so. */
INLINE void store(io *p, real x) { store_rounded(p, real_min(splat(FLT_MAX), x)); }
#elif defined(FACET_IO_double) && REAL_IS_FLOAT
/* Doubles for a float tier: what must be formed before they are rounded is formed in them. */
INLINE half_lanes load_half(const io *p)
{
    half_lanes x;
    memcpy(&x, p, sizeof x);
    return x;
}
INLINE struct doubles load_doubles(const io *p)
{
    return (struct doubles){ { load_half(p), load_half(p + LANES / 2) } };
}
INLINE real load(const io *p) { return narrow(load_doubles(p)); }
INLINE void store(io *p, real x)
{
    struct doubles y = widen(x);
    memcpy(p, &y.half[0], sizeof y.half[0]);
    memcpy(p + LANES / 2, &y.half[1], sizeof y.half[1]);
}
#elif defined(__SSE2__)
INLINE real load(const io *p) { return VECTOR(loadu)(p); }
INLINE void store(io *p, real x) { VECTOR(storeu)(p, x); }
#else
INLINE real load(const io *p)
{
    real v;
    for (size_t k = 0; k < LANES; k++) v[k] = (lane)p[k];
    return v;
}
INLINE void store(io *p, real x)
{
    const lane most = (io)REAL_MAX < REAL_MAX ? (lane)FLT_MAX : REAL_MAX;
    for (size_t k = 0; k < LANES; k++) p[k] = (io)(x[k] > most ? most : x[k]);
}
#endif

#endif
