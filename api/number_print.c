/* number_print.c - double to decimal text (number.h says how). */
#include "number.h"

#include "power_of_ten.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static bool is_digit(char c)
{
    return (unsigned char)(c - '0') < 10;
}

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
