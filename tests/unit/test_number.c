/*
 * The number codec against the C library: strtod and printf are correctly rounded in glibc.
 * FACET_NUMBERS=n draws n random numbers per test instead of 2e5 (make check-numbers: 1e8).
 */
#include "check.h"
#include "number.h"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static long draws(void)
{
    const char *wanted = getenv("FACET_NUMBERS"), *scale = getenv("FACET_TEST_SCALE");
    return wanted ? (long)atof(wanted) : (long)(2e5 * (scale ? atof(scale) : 1));
}

static uint64_t random_bits(struct rng *rng)
{
    return (uint64_t)(rng_uniform(rng) * 0x1p32) << 32 | (uint64_t)(rng_uniform(rng) * 0x1p32);
}

static uint64_t bits_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, 8);
    return bits;
}

static double any_double(struct rng *rng)
{
    double x;
    do {
        uint64_t bits = random_bits(rng);
        memcpy(&x, &bits, 8);
    } while (!isfinite(x));
    return x;
}

/* In the middle of an array: more bytes behind it may be read. */
static void check_followed(const char *text, size_t size, double expected)
{
    static const char *const tails[] = {",0.123456789,-0.98765432109876543",
                                        "]  1234567890123456789012345678",
                                        " \xff\xb0\x3a////////////////////////////"};
    char long_text[400];
    double parsed = -7;
    const char *tail = tails[size % 3];
    if (size > 300) return;
    memcpy(long_text, text, size);
    strcpy(long_text + size, tail);
    const char *end = api_number_parse(long_text, long_text + size + strlen(tail), &parsed);
    if (end != long_text + size || bits_of(parsed) != bits_of(expected))
        check_fail(__FILE__, __LINE__, "%.60s (%zu bytes) and more is %.17g, not %.17g", text, size,
                   parsed, expected);
}

/* Parsed from a buffer of exactly its size, so that asan sees a byte too many. */
static void check_parse(const char *text, size_t size)
{
    double parsed = -7, expected = strtod(text, NULL);
    const char *end = api_number_parse(text, text + size, &parsed);
    check_followed(text, size, expected);
    if (end != text + size || bits_of(parsed) != bits_of(expected))
        check_fail(__FILE__, __LINE__, "%.60s (%zu bytes) is %.17g, not %.17g", text, size, parsed,
                   expected);
}

static size_t put_digits(struct rng *rng, char *out, int count)
{
    for (int i = 0; i < count; i++) out[i] = (char)('0' + (int)(10 * rng_uniform(rng)));
    return (size_t)count;
}

/* Digits, a point, digits, an exponent: each part sometimes. */
static size_t random_decimal(struct rng *rng, char *out)
{
    size_t n = 0;
    if (rng_uniform(rng) < 0.3) out[n++] = '-';
    if (rng_uniform(rng) < 0.6) {
        out[n++] = '0';
    } else {
        n += put_digits(rng, out + n, 1 + (int)(22 * rng_uniform(rng) * rng_uniform(rng)));
        size_t first = out[0] == '-';
        if (out[first] == '0') out[first] = '7';
    }
    if (rng_uniform(rng) < 0.8) {
        out[n++] = '.';
        if (rng_uniform(rng) < 0.1) {
            memset(out + n, '0', 12);
            n += (size_t)(12 * rng_uniform(rng));
        }
        n += put_digits(rng, out + n, 1 + (int)(21 * rng_uniform(rng)));
    }
    if (rng_uniform(rng) < 0.4) {
        int range = rng_uniform(rng) < 0.2 ? 700 : 60;
        n += (size_t)sprintf(out + n, rng_uniform(rng) < 0.5 ? "e%d" : "E%+d",
                             (int)(range * (rng_uniform(rng) - 0.5)));
    }
    out[n] = 0;
    return n;
}

TEST(random_decimals_parse_as_strtod_does)
{
    struct rng rng;
    rng_seed(&rng, 11);
    for (long i = draws(); i > 0; i--) {
        char text[128];
        check_parse(text, random_decimal(&rng, text));
    }
}

TEST(printed_doubles_parse_as_strtod_does)
{
    struct rng rng;
    rng_seed(&rng, 12);
    for (long i = draws() / 2; i > 0; i--) {
        char text[64];
        int digits = 1 + (int)(20 * rng_uniform(&rng));
        int n = snprintf(text, sizeof text, "%.*e", digits, any_double(&rng));
        check_parse(text, (size_t)n);
    }
}

/* The exact middle between two doubles, a little more and a little less: all its digits count. */
TEST(halves_parse_as_strtod_does)
{
    static char text[1300];
    struct rng rng;
    rng_seed(&rng, 13);
    for (long i = draws() / 100; i > 0; i--) {
        double x = fabs(any_double(&rng));
        if (rng_uniform(&rng) < 0.5) x = rng_log(&rng, 1e-20, 1e20);
        if (rng_uniform(&rng) < 0.1) x = floor(random_bits(&rng) * 0x1p-11) * 0x1p-1074;
        /* x + half an ulp, exactly: long double has the bits, but not the range of subnormals */
        long double middle = ((long double)x + (long double)nextafter(x, INFINITY)) / 2;
        if (sizeof middle < 16 || !isfinite(nextafter(x, INFINITY))) continue;
        int n = snprintf(text, sizeof text, "%.1100Le", middle);
        check_parse(text, (size_t)n);
        char *e = strchr(text, 'e'), *last = e - 1;
        while (*last == '0') last--;
        char kept = *last;
        *last = (char)(kept - 1); /* never a 0 */
        check_parse(text, (size_t)n);
        *last = kept;
        e[-1] = '1';
        check_parse(text, (size_t)n);
    }
}

TEST(powers_of_ten_and_corners)
{
    static const char *const corners[] = {
        "0",
        "-0",
        "0.0",
        "0e5",
        "-0.000e-400",
        "1",
        "5e-324",
        "2.4703282292062327e-324",
        "2.4703282292062328e-324",
        "4.9406564584124654e-324",
        "2.2250738585072011e-308",
        "2.2250738585072014e-308",
        "2.2250738585072012e-308",
        "1.7976931348623157e308",
        "1.7976931348623158e308",
        "1.7976931348623159e308",
        "1.8e308",
        "1e309",
        "1e999",
        "-1e999",
        "1e-999",
        "1e99999999999999999999",
        "1e-99999999999999999999",
        "0e99999999999999999999",
        "9007199254740993",
        "9007199254740992",
        "9007199254740995",
        "18446744073709551615",
        "18446744073709551616",
        "9999999999999999999",
        "99999999999999999999",
        "0.5",
        "0.1",
        "0.3",
        "1.00000000000000011102230246251565404236316680908203125",
        "1.00000000000000011102230246251565404236316680908203124",
        "1.00000000000000011102230246251565404236316680908203126",
        "0.00000000000000000000000000000000000000000000000000000000000000000000000000012345678901234567",
        "100000000000000000000000000000000000000000000000000000000000000000e-60",
        "89255.0e-22",
        "104110013277974872254e-225",
        "12345678",
        "123456789",
        "1234567812345678",
        "0.12345678",
        "0.123456781",
        "123456781234567812345678.12345678",
    };
    for (size_t i = 0; i < sizeof corners / sizeof *corners; i++)
        check_parse(corners[i], strlen(corners[i]));
    for (int q = -345; q <= 310; q++)
        for (int w = 1; w < 1000; w = w * 3 + 1) {
            char text[32];
            check_parse(text, (size_t)snprintf(text, sizeof text, "%de%d", w, q));
        }
    /* A million zeros before and after the digits that count. */
    enum { ZEROS = 1000000 };
    char *text = malloc(ZEROS + 40);
    memset(text, '0', ZEROS + 2);
    text[1] = '.';
    int n = sprintf(text + ZEROS + 2, "7e%d", ZEROS);
    check_parse(text, ZEROS + 2 + (size_t)n);
    *text = '3';
    memset(text + 1, '0', ZEROS);
    n = sprintf(text + 1 + ZEROS, "e-%d", ZEROS - 5);
    check_parse(text, 1 + ZEROS + (size_t)n);
    free(text);
}

TEST(what_is_no_number)
{
    static const struct {
        const char *text;
        int length; /* of the number it begins with; 0: none */
    } texts[] = {{"", 0},     {"-", 0},        {"+1", 0},    {".5", 0},          {"1.", 0},
                 {"1.e5", 0}, {"1e", 0},       {"1e+", 0},   {"-.1", 0},         {"e5", 0},
                 {"01", 1},   {"-01", 2},      {"1.5.2", 3}, {"12a", 2},         {"1e5.0", 3},
                 {"nan", 0},  {"Infinity", 0}, {"0x10", 1},  {"1,2", 1},         {"1 ", 1},
                 {"- 1", 0},  {"--1", 0},      {"1e5e5", 3}, {"\xef\xbc\x91", 0}};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        double value;
        const char *text = texts[i].text,
                   *end = api_number_parse(text, text + strlen(text), &value);
        if (end != (texts[i].length ? text + texts[i].length : NULL))
            check_fail(__FILE__, __LINE__, "\"%s\" ends at %td", text, end ? end - text : -1);
    }
}

/* Digits and exponent of a printed number, zeros at both ends dropped: what it says. */
static void normal_form(const char *text, char *out)
{
    char digits[64];
    int n = 0, point = -1, exponent = 0, first;
    const char *p = text + (*text == '-');
    for (; *p && *p != 'e'; p++) {
        if (*p == '.')
            point = n;
        else
            digits[n++] = *p;
    }
    if (point < 0) point = n;
    if (*p == 'e') exponent = atoi(p + 1);
    for (first = 0; first < n && digits[first] == '0'; first++) continue;
    while (n > first && digits[n - 1] == '0') n--;
    sprintf(out, "%s%.*se%d", *text == '-' ? "-" : "", n - first, digits + first,
            n > first ? exponent + point - first : 0);
}

static void check_digits(double x, int digits)
{
    char printed[NUMBER_ROOM], expected[64], a[96], b[96];
    memset(printed, '#', sizeof printed);
    int n = api_number_print_digits(printed, x, digits);
    snprintf(expected, sizeof expected, "%.*e", digits - 1, x);
    if (isfinite(x) && isinf(strtod(expected, NULL))) api_number_print(expected, x);
    normal_form(printed, a);
    normal_form(expected, b);
    if (n < 1 || n >= NUMBER_ROOM || printed[n] || strcmp(a, b))
        check_fail(__FILE__, __LINE__, "%.17g with %d digits is %s, not %s", x, digits, printed,
                   expected);
    if (strlen(printed) > strlen(expected) + 1)
        check_fail(__FILE__, __LINE__, "%s is longer than %s", printed, expected);
}

TEST(digits_print_as_printf_does)
{
    struct rng rng;
    rng_seed(&rng, 14);
    for (long i = draws(); i > 0; i--) {
        double x = i % 2 ? any_double(&rng) : rng_log(&rng, 1e-7, 1e4);
        /* few bits: exact halves */
        if (i % 5 == 0)
            x = floor(1 + 4096 * rng_uniform(&rng)) * ldexp(1, (int)(24 * rng_uniform(&rng)) - 12);
        check_digits(x, 1 + (int)(17 * rng_uniform(&rng)));
    }
    for (int q = -323; q <= 308; q++)
        for (int d = 1; d <= 17; d++) {
            char text[16];
            snprintf(text, sizeof text, "1e%d", q);
            double x = strtod(text, NULL);
            check_digits(x, d);
            check_digits(nextafter(x, 0), d);
            check_digits(-nextafter(x, INFINITY), d);
        }
    for (double x = DBL_MAX; x > 1.4e308; x -= ldexp(DBL_MAX, -9))
        for (int d = 1; d <= 17; d++) check_digits(x, d);
}

static void check_shortest(double x)
{
    char printed[NUMBER_ROOM], shorter[64], form[96];
    memset(printed, '#', sizeof printed);
    int n = api_number_print(printed, x);
    double back = n > 0 && n < NUMBER_ROOM && !printed[n] ? strtod(printed, NULL) : NAN;
    if (bits_of(back) != bits_of(x))
        check_fail(__FILE__, __LINE__, "%.17g is printed as %s", x, printed);
    normal_form(printed, form);
    int digits = (int)strcspn(form, "e") - (*form == '-');
    if (digits < 2) return;
    snprintf(shorter, sizeof shorter, "%.*e", digits - 2, x);
    if (strtod(shorter, NULL) == x)
        check_fail(__FILE__, __LINE__, "%s is longer than %s", printed, shorter);
    /* of those with as many digits, the nearest */
    char nearest[64], b[96];
    snprintf(nearest, sizeof nearest, "%.*e", digits - 1, x);
    normal_form(nearest, b);
    if (strtod(nearest, NULL) == x && strcmp(form, b))
        check_fail(__FILE__, __LINE__, "%s is not as near as %s", printed, nearest);
}

TEST(shortest_digits_read_back)
{
    struct rng rng;
    rng_seed(&rng, 15);
    for (long i = draws(); i > 0; i--) {
        double x = i % 4 ? any_double(&rng) : rng_log(&rng, 1e-7, 1e4);
        if (i % 8 == 0) x = floor(x * 1000) / 1000;
        check_shortest(x);
    }
    for (int e = -1074; e <= 1023; e++) {
        check_shortest(ldexp(1, e));
        check_shortest(nextafter(ldexp(1, e), 0));
        check_shortest(-nextafter(ldexp(1, e), INFINITY));
    }
    for (int q = -323; q <= 308; q++) {
        char text[16];
        snprintf(text, sizeof text, "1e%d", q);
        check_shortest(strtod(text, NULL));
    }
}

TEST(how_numbers_look)
{
    static const struct {
        double x;
        const char *text;
    } numbers[] = {{0, "0"},
                   {-0.0, "-0"},
                   {1, "1"},
                   {-1, "-1"},
                   {100, "100"},
                   {1000, "1e3"},
                   {10000, "1e4"},
                   {1234, "1234"},
                   {0.1, "0.1"},
                   {0.001, "0.001"},
                   {1e-4, "0.0001"},
                   {1e-5, "1e-5"},
                   {1.5e-8, "1.5e-8"},
                   {1e22, "1e22"},
                   {123456, "123456"},
                   {0.30000000000000004, "0.30000000000000004"},
                   {4194304, "4194304"},
                   {5e-324, "5e-324"},
                   {1.7976931348623157e308, "1.7976931348623157e308"},
                   {INFINITY, "null"},
                   {-INFINITY, "null"},
                   {NAN, "null"},
                   {2097152.5, "2097152.5"}};
    char text[NUMBER_ROOM];
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        CHECK_INT(api_number_print(text, numbers[i].x), strlen(numbers[i].text));
        CHECK_STR(text, numbers[i].text);
    }
    api_number_print_digits(text, 0.68270140, 8);
    CHECK_STR(text, "0.6827014");
    api_number_print_digits(text, 99999.9996, 8);
    CHECK_STR(text, "1e5");
    api_number_print_digits(text, 2.5, 1);
    CHECK_STR(text, "2");
}

static float float_of(uint32_t bits)
{
    float x;
    memcpy(&x, &bits, 4);
    return x;
}

/* Nine digits carry a float; FACET_NUMBERS=all: every float, a few minutes. */
TEST(floats_round_trip)
{
    const char *wanted = getenv("FACET_NUMBERS");
    uint32_t step = wanted && !strcmp(wanted, "all")
                        ? 1
                        : (uint32_t)(0x1p32 / ((double)draws() + 1)) | 1;
    uint64_t count = 0;
    for (uint64_t i = 0; i < UINT64_C(1) << 32; i += step) {
        char text[NUMBER_ROOM];
        double back = 0;
        float x = float_of((uint32_t)i);
        if (!isfinite(x)) continue;
        int n = api_number_print_digits(text, x, 9);
        const char *end = api_number_parse(text, text + n, &back);
        if (end != text + n || (float)back != x)
            check_fail(__FILE__, __LINE__, "%.9g gives %s", x, text);
        n = api_number_print(text, x);
        end = api_number_parse(text, text + n, &back);
        if (end != text + n || back != x) check_fail(__FILE__, __LINE__, "%.9g gives %s", x, text);
        count++;
    }
    check_note("floats", (double)count);
}
