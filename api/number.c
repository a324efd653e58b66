/* Reading and printing share the powers of ten: one file, if a long one. */
#include "number.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef unsigned __int128 wide;

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "eight digits are read as one word");

/* ---- Powers of ten ------------------------------------------------------------------------- */

enum {
    POWER_MIN = -342, /* w 1e-343 rounds to 0 for every w < 2^64 */
    POWER_MAX = 341,  /* 17 digits of the least double */
    EXACT_MAX = 55,   /* 5^55 < 2^128 */
    LIMBS = 18
};

/* 10^q = (power(q) + less than 1) 2^(log2_of_power(q) - 127), 2^127 <= power(q). */
static wide powers[POWER_MAX - POWER_MIN + 1];

static wide power(int q)
{
    return powers[q - POWER_MIN];
}

/* floor(q log2 10): exact for |q| < 400, as the test of every power shows. */
static int log2_of_power(int q)
{
    return (q * 217706) >> 16;
}

/* The 128 leading bits of a long number, least limb first. */
static wide leading_bits(const uint64_t limbs[LIMBS])
{
    int top = LIMBS - 1;
    while (!limbs[top]) top--;
    int shift = __builtin_clzll(limbs[top]);
    wide high = (wide)limbs[top] << 64 | limbs[top - 1];
    return shift ? high << shift | limbs[top - 2] >> (64 - shift) : high;
}

/* Before main, so that no thread can come too early; a few hundred microseconds. */
__attribute__((constructor)) static void fill_powers(void)
{
    uint64_t up[LIMBS] = {0, 0, 1}, down[LIMBS] = {0};
    down[LIMBS - 1] = 1; /* 2^1088: after 342 divisions by 5 more than 128 bits are left */
    for (int q = 0; q <= POWER_MAX; q++) {
        powers[q - POWER_MIN] = leading_bits(up);
        wide carry = 0;
        for (int i = 0; i < LIMBS; i++, carry >>= 64) {
            carry += (wide)up[i] * 5;
            up[i] = (uint64_t)carry;
        }
    }
    for (int q = -1; q >= POWER_MIN; q--) {
        wide rest = 0;
        for (int i = LIMBS - 1; i >= 0; i--, rest %= 5) {
            rest = rest << 64 | down[i];
            down[i] = (uint64_t)(rest / 5);
        }
        powers[q - POWER_MIN] = leading_bits(down);
    }
}

/* floor(w power / 2^64); the product with the exact power lies less than 2 above. */
static wide product(uint64_t w, wide p)
{
    return (wide)w * (uint64_t)(p >> 64) + ((wide)w * (uint64_t)p >> 64);
}

static double from_bits(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint64_t to_bits(double value)
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

/* ---- Parsing --------------------------------------------------------------------------------- */

/* A number as it stands: digits first .. last (a point among them), times 10^exponent. */
struct decimal {
    const char *first, *last;
    int64_t exponent; /* of the last digit */
};

/* w 10^q for w != 0; false where rounding is too close to call, or the result subnormal. */
static inline bool scale(uint64_t w, int64_t q, double *value)
{
    if (q < POWER_MIN) return *value = 0, true;
    if (q > 308) return *value = INFINITY, true;
    int zeros = __builtin_clzll(w);
    wide p = product(w << zeros, power((int)q));
    uint64_t high = (uint64_t)(p >> 64), low = (uint64_t)p;
    int top = (int)(high >> 63), shift = 10 + top;
    int exponent = 63 + top + log2_of_power((int)q) - zeros;
    uint64_t half = (uint64_t)1 << (shift - 1), rest = high & (2 * half - 1);
    /* The exact rest lies less than 2 above; rest:low = half:0 and the one below cannot tell. */
    if ((rest == half && !low) || (rest == half - 1 && !~low) || exponent < -1022) return false;
    /* The leading bit of the significand, and a carry out of it, add to the exponent. */
    uint64_t bits = ((uint64_t)(exponent + 1022) << 52) + (high >> shift) + (rest >= half);
    *value = exponent > 1023 || bits >> 52 >= 2047 ? INFINITY : from_bits(bits);
    return true;
}

/*
 * By the C library, whose text holds no point: the locale does not matter.  A double, and the
 * middle between two, has at most 767 digits: whatever follows more of them is as good as a 1.
 */
__attribute__((noinline, cold)) static double by_library(struct decimal d)
{
    enum { KEPT = 800 };
    char text[KEPT + 40];
    int kept = 0;
    int64_t dropped = 0;
    bool more = false;
    for (const char *p = d.first; p < d.last; p++) {
        if (*p == '.' || (*p == '0' && !kept)) continue;
        if (kept < KEPT)
            text[kept++] = *p;
        else {
            dropped++;
            more |= *p != '0';
        }
    }
    if (!kept) return 0;
    if (more) {
        text[kept++] = '1';
        dropped--;
    }
    int64_t exponent = d.exponent + dropped;
    if (exponent < -5000) exponent = -5000;
    if (exponent > 5000) exponent = 5000;
    snprintf(text + kept, sizeof text - (size_t)kept, "e%d", (int)exponent);
    return strtod(text, NULL);
}

/* More than 19 digits, leading zeros perhaps among them: from the first 19 that count. */
__attribute__((noinline, cold)) static double from_many(struct decimal d)
{
    uint64_t w = 0;
    int taken = 0;
    int64_t dropped = 0;
    for (const char *p = d.first; p < d.last; p++) {
        if (*p == '.') continue;
        if (taken < 19) {
            w = 10 * w + (uint64_t)(*p - '0');
            taken += w > 0;
        } else {
            dropped++;
        }
    }
    double low, high;
    if (!w) return 0;
    if (!dropped) return scale(w, d.exponent, &low) ? low : by_library(d);
    if (scale(w, d.exponent + dropped, &low) && scale(w + 1, d.exponent + dropped, &high) &&
        low == high)
        return low;
    return by_library(d);
}

static bool is_digit(char c)
{
    return (unsigned char)(c - '0') < 10;
}

/* The digits 0 .. 9 in the bytes of a word, the first in the lowest byte. */
static inline uint64_t value_of_eight(uint64_t c)
{
    c = c * 10 + (c >> 8); /* pairs, then fours, then all */
    c = (c & 0x00ff00ff00ff00ffu) * 100 + (c >> 16 & 0x00ff00ff00ff00ffu);
    return (c & 0xffff) * 10000 + (c >> 32 & 0xffff);
}

/* All digits at p appended to *w, eight at a time; their end. */
static inline const char *digits_of(const char *p, const char *end, uint64_t *w)
{
    while (end - p >= 8) {
        uint64_t c, other;
        memcpy(&c, p, 8);
        c ^= 0x3030303030303030u;
        other = ((c + 0x7676767676767676u) | c) & 0x8080808080808080u; /* lowest: no digit */
        if (other) {
            int count = __builtin_ctzll(other) >> 3;
            /* Shifted up, the digits follow zeros; twice, since 64 is too far for one shift. */
            *w = *w * tens[count] + value_of_eight(c << 4 * (8 - count) << 4 * (8 - count));
            return p + count;
        }
        *w = *w * 100000000 + value_of_eight(c);
        p += 8;
    }
    for (; p < end && is_digit(*p); p++) *w = 10 * *w + (uint64_t)(*p - '0');
    return p;
}

/* The e of an exponent stands at p; NULL where no digit follows. */
static const char *exponent_of(const char *p, const char *end, int64_t *exponent)
{
    bool negative = ++p < end && *p == '-';
    if (p < end && (*p == '-' || *p == '+')) p++;
    if (p == end || !is_digit(*p)) return NULL;
    int64_t e = 0;
    for (; p < end && is_digit(*p); p++)
        if (e < INT32_MAX) e = 10 * e + (*p - '0'); /* no body has as many digits */
    *exponent += negative ? -e : e;
    return p;
}

/* Powers of ten that doubles hold. */
static const double exact_tens[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                    1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15};

static inline uint64_t digits_at(const char *p)
{
    uint64_t c;
    memcpy(&c, p, sizeof c);
    return c ^ 0x3030303030303030u;
}

/* How many of the eight bytes are digits, up to the first that is none. */
static inline unsigned count_of_digits(uint64_t c)
{
    uint64_t other = ((c + 0x7676767676767676u) | c) & 0x8080808080808080u; /* lowest: no digit */
    return other ? (unsigned)__builtin_ctzll(other) >> 3 : 8;
}

/*
 * What components of directions look like: a digit, a point, at most 19 digits and no exponent.
 * Without a branch for each digit: the sixteen bytes behind the point are shifted up, so that zeros
 * come before the digits and what follows them is gone.  Reads PLAIN_ROOM bytes.  NULL: another.
 */
enum { PLAIN_ROOM = 27 };
static inline const char *parse_plain(const char *p, bool negative, double *value)
{
    uint64_t whole = (uint64_t)(*p - '0'), a = digits_at(p + 2), b = digits_at(p + 10);
    if (whole > 9 || p[1] != '.') return NULL;
    unsigned n = count_of_digits(a), more = 0;
    n += n == 8 ? count_of_digits(b) : 0;
    if (!n) return NULL;
    wide digits = ((wide)b << 64 | a) << 8 * (16 - n);
    uint64_t w = value_of_eight((uint64_t)digits) * 100000000 + value_of_eight((uint64_t)(digits >> 64));
    if (n == 16) {
        uint64_t c = digits_at(p + 18);
        more = count_of_digits(c);
        if (more > 3 || (whole && more > 2)) return NULL;
        w = w * tens[more] + value_of_eight(c << 4 * (8 - more) << 4 * (8 - more));
    }
    n += more;
    const char *end = p + 2 + n;
    if ((*end | 0x20) == 'e') return NULL;
    if (whole) w += whole * tens[n];
    double magnitude = 0;
    if (w < (uint64_t)1 << 53 && n <= 15) /* both are exact, so that the quotient is rounded once */
        magnitude = (double)w / exact_tens[n];
    else if (w && !scale(w, -(int64_t)n, &magnitude))
        return NULL;
    *value = from_bits(to_bits(magnitude) | (uint64_t)negative << 63);
    return end;
}

static inline const char *parse(const char *at, const char *end, double *value)
{
    const char *p = at, *plain;
    if (end - p > PLAIN_ROOM && (plain = parse_plain(p + (*p == '-'), *p == '-', value))) return plain;
    bool negative = p < end && *p == '-';
    p += negative;
    if (p == end || !is_digit(*p)) return NULL;
    const char *first = p;
    uint64_t w = 0;
    int64_t exponent = 0, count;
    p = *p == '0' ? p + 1 : digits_of(p, end, &w);
    count = p - first;
    if (p < end && *p == '.') {
        const char *fraction = ++p;
        p = digits_of(p, end, &w);
        if (p == fraction) return NULL;
        exponent = fraction - p;
        count -= exponent;
    }
    const char *last = p;
    if (p < end && (*p | 0x20) == 'e' && !(p = exponent_of(p, end, &exponent))) return NULL;
    double magnitude;
    if (count > 19)
        magnitude = from_many((struct decimal){first, last, exponent});
    else if (!w)
        magnitude = 0;
    else if (!scale(w, exponent, &magnitude))
        magnitude = by_library((struct decimal){first, last, exponent});
    *value = from_bits(to_bits(magnitude) | (uint64_t)negative << 63);
    return p;
}

const char *api_number_parse(const char *at, const char *end, double *value)
{
    return parse(at, end, value);
}

static inline const char *skip_space(const char *p, const char *end)
{
    while (p < end && (*p == ' ' || *p == '\n' || *p == '\t' || *p == '\r')) p++;
    return p;
}

size_t api_number_run(const char **at, const char *end, double *out, size_t room, bool *expecting)
{
    const char *p = *at, *next;
    size_t n = 0;
    *expecting = true;
    while (n < room) {
        p = skip_space(p, end);
        if (!(next = parse(p, end, &out[n])) || !(fabs(out[n]) <= DBL_MAX)) break;
        n++;
        p = skip_space(next, end);
        if (p == end || *p != ',') {
            *expecting = false;
            break;
        }
        p++;
    }
    *at = p;
    return n;
}

size_t api_number_rows(const char **at, const char *end, double *out, size_t room, size_t columns)
{
    const char *p = *at;
    size_t rows = 0;
    for (; room - rows * columns >= columns; rows++) {
        p = skip_space(p, end);
        if (p == end || *p != ',') break;
        p = skip_space(p + 1, end);
        if (p == end || *p != '[') break;
        size_t k = 0;
        for (; k < columns; k++, out++) {
            p = skip_space(p + 1, end);
            if (!(p = parse(p, end, out)) || !(fabs(*out) <= DBL_MAX)) break;
            p = skip_space(p, end);
            if (p == end || *p != (k + 1 < columns ? ',' : ']')) break;
        }
        if (k < columns) break;
        *at = ++p;
    }
    return rows;
}

/* ---- Printing ---------------------------------------------------------------------------------- */

static const char pairs[] = "00010203040506070809101112131415161718192021222324252627282930313233"
                            "34353637383940414243444546474849505152535455565758596061626364656667"
                            "6869707172737475767778798081828384858687888990919293949596979899";

/*
 * n / 10^8 for n < 10^9 as a number with 57 bits behind the point: its whole part is the first
 * digit, and each multiplication by 100 brings two more.  Rounding the reciprocal up adds less than
 * 10^9 10^8 / 2^57 = .7 to the last pair.
 */
static inline uint64_t point_before_eight(uint64_t n)
{
    return n * 1441151881;
}

static inline void write_eight(char *out, uint64_t y)
{
    const uint64_t fraction = ((uint64_t)1 << 57) - 1;
    for (int i = 0; i < 8; i += 2) {
        y = (y & fraction) * 100;
        memcpy(out + i, pairs + 2 * (y >> 57), 2);
    }
}

/*
 * The digits of n != 0, which has `count` <= 17, padded with zeros to 9 or 17 of them.  Returns how
 * many there are without the zeros at the end.
 */
__attribute__((always_inline)) static inline int write_digits(char *out, uint64_t n, int count)
{
    uint64_t y, high = n;
    if (count <= 9) {
        high *= tens[9 - count];
    } else {
        uint64_t all = n * tens[17 - count];
        high = all / 100000000;
        write_eight(out + 9, point_before_eight(all - 100000000 * high));
    }
    y = point_before_eight(high);
    *out = (char)('0' + (y >> 57));
    write_eight(out + 1, y);
    for (; n % 10 == 0; n /= 10) count--;
    return count;
}

static int write_exponent(char *out, int exponent)
{
    char *p = out;
    *p++ = 'e';
    if (exponent < 0) *p++ = '-';
    int e = exponent < 0 ? -exponent : exponent;
    if (e >= 100) *p++ = (char)('0' + e / 100);
    if (e >= 10) *p++ = (char)('0' + e / 10 % 10);
    *p++ = (char)('0' + e % 10);
    return (int)(p - out);
}

/* d.ddde-5, or ddd000 where that is not longer. */
static int write_far(char *out, const char *digits, int count, int exponent)
{
    *out = *digits;
    out[1] = '.';
    memcpy(out + 2, digits + 1, 16);
    int length = count > 1 ? count + 1 : 1, plain = exponent + 1;
    length += write_exponent(out + length, exponent);
    if (exponent < 0 || plain > length) return length;
    memcpy(out, digits, (size_t)count);
    memset(out + count, '0', (size_t)(plain - count));
    return plain;
}

/* n of `count` digits stands for d.ddd 10^exponent; returns the length. */
__attribute__((always_inline)) static inline int write_decimal(char *out, uint64_t n, int count, int exponent)
{
    if (exponent >= -4 && exponent < 0) { /* 0.00ddd: the digits fall into their place */
        memcpy(out, "0.0000", 6);
        return 1 - exponent + write_digits(out + 1 - exponent, n, count);
    }
    char digits[24];
    count = write_digits(digits, n, count);
    if (exponent < 0 || exponent >= count) return write_far(out, digits, count, exponent);
    memcpy(out, digits, 17); /* ddd.ddd */
    if (exponent == count - 1) return count;
    out[exponent + 1] = '.';
    memcpy(out + exponent + 2, digits + exponent + 1, (size_t)(count - exponent - 1));
    return count + 1;
}

/*
 * What is no number, and zero: their length.  -1 for the others, whose sign is written where
 * *out then stands behind it.
 */
static inline int write_special(char **out, double *value)
{
    uint64_t bits = to_bits(*value), negative = bits >> 63;
    **out = '-';
    *out += negative;
    *value = from_bits(bits << 1 >> 1);
    if (*value > 0 && *value < INFINITY) return -1;
    bool is_zero = *value == 0;
    if (!is_zero) *out -= negative;
    memcpy(*out, is_zero ? "0" : "null", is_zero ? 2 : 5);
    return is_zero ? (int)negative + 1 : 4;
}

/* floor(exponent log10 2), exact for |exponent| < 1700. */
static int log10_of_binary(int exponent)
{
    return (exponent * 315653) >> 20;
}

/* By the C library: where rounding is too close to call. */
__attribute__((noinline, cold)) static uint64_t round_by_library(double value, int digits, int *exponent)
{
    char text[NUMBER_ROOM];
    snprintf(text, sizeof text, "%.*e", digits - 1, value);
    *exponent = atoi(strchr(text, 'e') + 1);
    uint64_t n = 0;
    for (const char *p = text; *p != 'e'; p++)
        if (is_digit(*p)) n = 10 * n + (uint64_t)(*p - '0');
    return n;
}

/* value > 0 rounded to n of so many digits, times 10^(exponent + 1 - digits). */
static uint64_t round_to_digits(double value, int digits, int *exponent)
{
    uint64_t bits = to_bits(value), w = bits & (((uint64_t)1 << 52) - 1);
    int e = (int)(bits >> 52);
    w = e ? w | (uint64_t)1 << 52 : w;
    int zeros = __builtin_clzll(w), e2 = (e ? e : 1) - 1075 - zeros; /* value = (w << zeros) 2^e2 */
    w <<= zeros;
    int k = log10_of_binary(e2 + 63); /* of value, or one less */
    wide above = power(k + 1);
    if (log2_of_power(k + 1) == e2 + 63) k += (wide)w << 64 >= above;
    /* n 10^(k + 1 - digits) is what is above the bit `shift` of the product's high word */
    int q = digits - 1 - k, shift = -1 - e2 - log2_of_power(q);
    wide p = product(w, power(q));
    uint64_t high = (uint64_t)(p >> 64), low = (uint64_t)p, n = high >> shift;
    uint64_t half = (uint64_t)1 << shift >> 1, rest = high & (((uint64_t)1 << shift) - 1);
    *exponent = k;
    if ((rest == half && !low) || (rest == half - 1 && !~low) || n >= tens[digits])
        return round_by_library(value, digits, exponent);
    n += rest >= half;
    if (n < tens[digits]) return n;
    ++*exponent;
    return tens[digits - 1];
}

/*
 * The same of a normal number and at most 9 digits, from one product of leading words, which lies
 * less than 2 below the exact one; 0 where that cannot tell.
 */
__attribute__((always_inline)) static inline uint64_t round_to_few(uint64_t bits, int digits, int *exponent)
{
    uint64_t w = bits << 11 | (uint64_t)1 << 63;
    int e = (int)(bits >> 52) - 1023, k = log10_of_binary(e);
    uint64_t above = (uint64_t)(power(k + 1) >> 64);
    if (log2_of_power(k + 1) == e) k += w >= above;
    int q = digits - 1 - k, shift = 62 - e - log2_of_power(q);
    uint64_t high = (uint64_t)((wide)w * (uint64_t)(power(q) >> 64) >> 64), n = high >> shift;
    uint64_t half = (uint64_t)1 << shift >> 1, rest = high - (n << shift);
    n += rest >= half;
    *exponent = k;
    bool is_certain = rest - (half - 2) > 2 && n < tens[digits];
    return is_certain ? n : 0;
}

int api_number_print_digits(char *out, double value, int digits)
{
    char *p = out;
    uint64_t bits = to_bits(value) << 1 >> 1, n = 0;
    int exponent, length;
    if (digits <= 9 && (bits >> 52) - 1 < 2046) {
        *p = '-';
        p += to_bits(value) >> 63;
        n = round_to_few(bits, digits, &exponent);
        value = from_bits(bits);
    } else if ((length = write_special(&p, &value)) >= 0) {
        return length;
    }
    if (!n) n = round_to_digits(value, digits, &exponent);
    p += write_decimal(p, n, digits, exponent);
    *p = 0;
    return (int)(p - out);
}

/* floor(w g / 2^128) with its last bit set where that is not exact (Giulietti 2020, section 9.2). */
static uint64_t round_to_odd(uint64_t w, wide g)
{
    wide low = (wide)w * (uint64_t)g, high = (wide)w * (uint64_t)(g >> 64) + (low >> 64);
    return (uint64_t)(high >> 64) | ((uint64_t)high > 1);
}

/*
 * Schubfach: of the decimals that read back as value = c 2^q those with the fewest digits, of these
 * the nearest.  All in quarters of 10^k <= 2^q: an interval as wide as 2^q holds at least one
 * multiple of 10^k and at most one of 10^(k+1).
 */
static uint64_t shortest(double value, int *k)
{
    uint64_t bits = to_bits(value), fraction = bits & (((uint64_t)1 << 52) - 1);
    int e = (int)(bits >> 52), q = (e ? e : 1) - 1075;
    uint64_t c = e ? fraction | (uint64_t)1 << 52 : fraction;
    bool narrow = !fraction && e > 1; /* below a power of two the doubles are twice as dense */
    bool open = c & 1;                /* ties go to even: an odd one does not get them */
    /* floor(log10 2^q), or floor(log10 (3/4 2^q)) */
    *k = (q * 1262611 - (narrow ? 524031 : 0)) >> 22;
    int scale2 = q + log2_of_power(-*k) + 1;
    wide g = power(-*k);
    g += !(-*k >= 0 && -*k <= EXACT_MAX); /* rounded up instead of down */
    uint64_t low = round_to_odd((4 * c - 2 + narrow) << scale2, g) + open;
    uint64_t mid = round_to_odd(4 * c << scale2, g);
    uint64_t high = round_to_odd((4 * c + 2) << scale2, g) - open;
    uint64_t s = mid / 4, t = s / 10;
    bool down = low <= 40 * t, up = 40 * t + 40 <= high;
    if (s >= 10 && down != up) {
        ++*k;
        return t + up;
    }
    down = low <= 4 * s;
    up = 4 * s + 4 <= high;
    if (down != up) return s + up;
    return s + (mid > 4 * s + 2 || (mid == 4 * s + 2 && s & 1));
}

static int count_digits(uint64_t n)
{
    int guess = (64 - __builtin_clzll(n)) * 1233 >> 12;
    return guess + (n >= tens[guess]);
}

int api_number_print(char *out, double value)
{
    char *p = out;
    int k = 0, length = write_special(&p, &value);
    if (length >= 0) return length;
    bool is_whole = value < 0x1p53 && value == (double)(uint64_t)value;
    uint64_t n = is_whole ? (uint64_t)value : shortest(value, &k);
    int count = count_digits(n);
    p += write_decimal(p, n, count, k + count - 1);
    *p = 0;
    return (int)(p - out);
}
