/* number_print.c - double to decimal text (number.h says how). */
#include "number.h"

#include "power_of_ten.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static bool is_digit(char c)
{
    return (unsigned char)(c - '0') < 10;
}

/* "000 001 .. 999 ": four bytes each, so that one move takes three digits. */
#define TEN(p) p "0 " p "1 " p "2 " p "3 " p "4 " p "5 " p "6 " p "7 " p "8 " p "9 "
#define HUNDRED(p)                                                                                 \
    TEN(p "0")                                                                                     \
    TEN(p "1")                                                                                     \
    TEN(p "2") TEN(p "3") TEN(p "4") TEN(p "5") TEN(p "6") TEN(p "7") TEN(p "8") TEN(p "9")
static const char triples[] = HUNDRED("0") HUNDRED("1") HUNDRED("2") HUNDRED("3") HUNDRED("4")
    HUNDRED("5") HUNDRED("6") HUNDRED("7") HUNDRED("8") HUNDRED("9");

/*
 * 2^54 / 10^(count - 3) rounded up: times a number of `count` digits it puts the point behind the third.
 * Rounding adds less than 10^9 10^6 / 2^54 = .06 to the last triple.
 */
static const uint64_t points[] = {0,
                                  1801439850948198400,
                                  180143985094819840,
                                  18014398509481984,
                                  1801439850948199,
                                  180143985094820,
                                  18014398509482,
                                  1801439850949,
                                  180143985095,
                                  18014398510};

/*
 * The `count` digits of n and zeros, nine together; a tenth byte is written.  The whole part of n * point
 * is the first triple, each multiplication by 1000 brings another, and none waits for the one before.
 */
static inline void write_nine(char *out, uint64_t n, int count)
{
    const uint64_t fraction = ((uint64_t)1 << 54) - 1;
    uint64_t y = n * points[count];
    memcpy(out, triples + 4 * (y >> 54), 4);
    memcpy(out + 3, triples + 4 * ((y & fraction) * 1000 >> 54), 4);
    memcpy(out + 6, triples + 4 * ((y * 1000 & fraction) * 1000 >> 54), 4);
}

/*
 * The digits of n, which has `count` <= 17 and begins with no zero, padded with zeros to 9 or 18 of them.
 * Returns how many there are without the zeros at the end.
 */
__attribute__((always_inline)) static inline int write_digits(char *out, uint64_t n, int count)
{
    if (count <= 9) {
        write_nine(out, n, count);
    } else {
        uint64_t all = n * tens[18 - count], high = all / 1000000000;
        write_nine(out, high, 9);
        write_nine(out + 9, all - 1000000000 * high, 9);
    }
    while (out[count - 1] == '0') count--;
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

/* 0.00ddd, for exponents -4 to -1: the digits fall into their place. */
__attribute__((always_inline)) static inline int write_fraction(char *out, uint64_t n, int count,
                                                                int exponent)
{
    memcpy(out, "0.000000", 8);
    return 1 - exponent + write_digits(out + 1 - exponent, n, count);
}

/* n of `count` digits stands for d.ddd 10^exponent; returns the length. */
static inline int write_decimal(char *out, uint64_t n, int count, int exponent)
{
    if (exponent >= -4 && exponent < 0) return write_fraction(out, n, count, exponent);
    char digits[24];
    count = write_digits(digits, n, count);
    if (exponent < 0 || exponent >= count) return write_far(out, digits, count, exponent);
    memcpy(out, digits, 17); /* ddd.ddd */
    if (exponent == count - 1) return count;
    out[exponent + 1] = '.';
    memcpy(out + exponent + 2, digits + exponent + 1, (size_t)(count - exponent - 1));
    return count + 1;
}

/* What is no number, and zero: their length; -1 for the others. */
static int write_special(char *out, double value)
{
    if (value != 0 && fabs(value) < INFINITY) return -1;
    const char *text = value != 0 ? "null" : signbit(value) ? "-0" : "0";
    strcpy(out, text);
    return (int)strlen(text);
}

/* By the C library: where rounding is too close to call. */
__attribute__((noinline, cold)) static uint64_t round_by_library(double value, int digits,
                                                                 int *exponent)
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
__attribute__((always_inline)) static inline uint64_t round_to_few(uint64_t bits, int digits,
                                                                   int *exponent)
{
    uint64_t w = bits << 11 | (uint64_t)1 << 63, binade = api_binades[bits >> 52];
    int e = (int)(bits >> 52) - 1023, k = (int)(binade & 2047) - LOG10_BIAS + (w > binade);
    int q = digits - 1 - k, shift = 62 - e - log2_of_power(q);
    uint64_t high = (uint64_t)((wide)w * (uint64_t)(power(q) >> 64) >> 64);
    uint64_t above = high + ((uint64_t)1 << shift >> 1) + 2, n = above >> shift;
    *exponent = k;
    bool is_certain = (above - 3) >> shift == n && n < tens[digits];
    return is_certain ? n : 0;
}

/* The number with its sign, and the NUL. */
__attribute__((noinline)) static int print_decimal(char *out, bool is_negative, uint64_t n,
                                                   int count, int exponent)
{
    char *p = out;
    *p = '-';
    p += is_negative;
    p += write_decimal(p, n, count, exponent);
    *p = 0;
    return (int)(p - out);
}

__attribute__((noinline)) static int print_any_digits(char *out, double value, int digits)
{
    int exponent, length = write_special(out, value);
    if (length >= 0) return length;
    uint64_t n = round_to_digits(fabs(value), digits, &exponent);
    /* Next to the largest double, rounding up leaves the doubles, and a reader would see infinity. */
    const uint64_t largest = 17976931348623157; /* the digits of DBL_MAX */
    if (exponent >= DBL_MAX_10_EXP &&
        (exponent > DBL_MAX_10_EXP || n > largest / tens[17 - digits]))
        return api_number_print(out, value);
    return print_decimal(out, value < 0, n, digits, exponent);
}

/* What is most frequent by far, a fraction of few digits, here and in registers; the rest by others. */
int api_number_print_digits(char *out, double value, int digits)
{
    uint64_t bits = to_bits(value) << 1 >> 1, is_negative = to_bits(value) >> 63;
    int exponent;
    if (digits > 9 || (bits >> 52) - 1 >= 2045) return print_any_digits(out, value, digits);
    uint64_t n = round_to_few(bits, digits, &exponent);
    if (!n) return print_any_digits(out, value, digits);
    if (exponent < -4 || exponent >= 0) return print_decimal(out, is_negative, n, digits, exponent);
    char *p = out;
    *p = '-';
    p += is_negative;
    p += write_fraction(p, n, digits, exponent);
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
    int k = 0, length = write_special(out, value);
    if (length >= 0) return length;
    double size = fabs(value);
    bool is_whole = size < 0x1p53 && size == (double)(uint64_t)size;
    uint64_t n = is_whole ? (uint64_t)size : shortest(size, &k);
    int count = count_digits(n);
    return print_decimal(out, value < 0, n, count, k + count - 1);
}
