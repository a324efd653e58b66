/* number_parse.c - decimal text to double (number.h says how). */
#include "number.h"

#include "power_of_ten.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "eight digits are read as one word");

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
static const double exact_tens[] = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                    1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};

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
    uint64_t w = value_of_eight((uint64_t)digits) * 100000000 +
                 value_of_eight((uint64_t)(digits >> 64));
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
    if (end - p > PLAIN_ROOM && (plain = parse_plain(p + (*p == '-'), *p == '-', value)))
        return plain;
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
