/* Points of /v1/sample: what makes each sequence worth its name. */
#include "ask.h"
#include "check.h"
#include "random.h"
#include "sequence.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { LEVEL_MAX = 10 };

/* Is there exactly one of the 2^m points in every box of 2^-a by 2^(a-m)? */
static bool one_in_each(int m, int a, uint64_t seed, uint64_t set, uint64_t block)
{
    bool seen[1 << LEVEL_MAX] = {false};
    for (uint64_t i = 0; i < UINT64_C(1) << m; i++) {
        double u[2];
        api_sequence(SEQUENCE_SOBOL, seed, set, (block << m) + i, 1 << 20, u);
        size_t column = (size_t)ldexp(u[0], a), row = (size_t)ldexp(u[1], m - a);
        if (column >= (size_t)1 << a || row >= (size_t)1 << (m - a)) return false;
        if (seen[column << (m - a) | row]) return false;
        seen[column << (m - a) | row] = true;
    }
    return true;
}

TEST(sobol_has_one_point_in_every_dyadic_box)
{
    for (int m = 0; m <= LEVEL_MAX; m++)
        for (int a = 0; a <= m; a++)
            for (uint64_t seed = 0; seed < 3; seed++) {
                CHECK(one_in_each(m, a, seed, seed % 2, 0));
                CHECK(one_in_each(m, a, seed, 0, 5)); /* and so in every later block of 2^m */
            }
}

/* Root mean square error over seeds of the mean of a smooth function of n points. */
static double rms(enum sequence sequence, uint64_t n)
{
    const double exact = (exp(1) - 1) * sin(1);
    enum { SEEDS = 64 };
    double sum = 0;
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        double mean = 0;
        for (uint64_t i = 0; i < n; i++) {
            double u[2];
            api_sequence(sequence, seed, 3, i, n, u);
            mean += exp(u[0]) * cos(u[1]) / (double)n;
        }
        sum += (mean - exact) * (mean - exact) / SEEDS;
    }
    return sqrt(sum);
}

TEST(low_discrepancy_converges_faster)
{
    double random = rms(SEQUENCE_RANDOM, 1024), sobol = rms(SEQUENCE_SOBOL, 1024),
           r2 = rms(SEQUENCE_R2, 1024);
    check_note("rms of 1024 random points", random);
    check_note("rms of 1024 sobol points", sobol);
    check_note("rms of 1024 r2 points", r2);
    CHECK(sobol < random / 200);                 /* 1/n^1.5 against 1/n^.5 */
    CHECK(r2 < random / 10);                     /* about 1/n */
    CHECK(rms(SEQUENCE_SOBOL, 64) / sobol > 40); /* 64 by n^-1.5 */
}

/* Scrambled or shifted, each single point is uniform over the seeds, in pairs too. */
TEST(points_are_uniform_over_seeds)
{
    enum { SEEDS = 4000, CELLS = 8 };
    for (int s = SEQUENCE_SOBOL; s <= SEQUENCE_R2; s++)
        for (uint64_t index = 0; index < 1000; index += 333) {
            int count[CELLS][CELLS] = {{0}};
            double chi2 = 0, expected = (double)SEEDS / (CELLS * CELLS);
            for (uint64_t seed = 0; seed < SEEDS; seed++) {
                double u[2];
                api_sequence((enum sequence)s, seed, index % 2, index, 1000, u);
                count[(int)(u[0] * CELLS)][(int)(u[1] * CELLS)]++;
            }
            for (int i = 0; i < CELLS * CELLS; i++)
                chi2 += pow(count[i / CELLS][i % CELLS] - expected, 2) / expected;
            CHECK(chi2 < 63 + 5 * sqrt(2 * 63)); /* 63 degrees of freedom, five deviations */
        }
}

/* Owen: two points that share their first bits share the flips of those bits and of the next. */
TEST(sets_and_seeds_differ_and_repeat)
{
    double a[2], b[2], c[2], d[2];
    for (int s = SEQUENCE_SOBOL; s <= SEQUENCE_R2; s++) {
        api_sequence((enum sequence)s, 1, 0, 7, 16, a);
        api_sequence((enum sequence)s, 1, 0, 7, 999, b);
        api_sequence((enum sequence)s, 2, 0, 7, 16, c);
        api_sequence((enum sequence)s, 1, 1, 7, 16, d);
        CHECK(a[0] == b[0] &&
              a[1] == b[1]); /* of an endless sequence, however many are asked for */
        CHECK(a[0] != c[0] && a[1] != c[1]);
        CHECK(a[0] != d[0] && a[1] != d[1]);
    }
}

#define GGX "\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3}"

TEST(sample_takes_a_sequence_by_name)
{
    for (int s = SEQUENCE_SOBOL; s <= SEQUENCE_R2; s++) {
        char body[800];
        snprintf(body, sizeof body,
                 "{" GGX ",\"wo\":[[-0.6,0,0.8],[0,0,1]],\"n\":2,\"seed\":42,\"sequence\":\"%s\"}",
                 api_sequence_names[s]);
        struct answer by_name = ask_post("/v1/sample", body);
        CHECK_INT(by_name.response.status, 200);
        double u[4][2];
        for (unsigned k = 0; k < 4; k++) api_sequence((enum sequence)s, 42, k / 2, k % 2, 2, u[k]);
        snprintf(body, sizeof body,
                 "{" GGX ",\"wo\":[[-0.6,0,0.8],[-0.6,0,0.8],[0,0,1],[0,0,1]],"
                 "\"u\":[[%.17g,%.17g],[%.17g,%.17g],[%.17g,%.17g],[%.17g,%.17g]]}",
                 u[0][0], u[0][1], u[1][0], u[1][1], u[2][0], u[2][1], u[3][0], u[3][1]);
        struct answer by_list = ask_post("/v1/sample", body);
        CHECK_INT(by_list.response.status, 200);
        CHECK(json_equal(json_object_get(by_name.json, "wi"), json_object_get(by_list.json, "wi")));
        answer_clear(&by_name);
        answer_clear(&by_list);
    }
    static const char *const bad[] = {"{" GGX
                                      ",\"wo\":[[0,0,1]],\"u\":[[0,0]],\"sequence\":\"sobol\"}",
                                      "{" GGX ",\"wo\":[[0,0,1]],\"n\":2,\"sequence\":\"halton\"}"};
    for (int i = 0; i < 2; i++) {
        struct answer a = ask_post("/v1/sample", bad[i]);
        CHECK_INT(a.response.status, 422);
        CHECK_STR(answer_error(&a, "pointer"), "/sequence");
        answer_clear(&a);
    }
}
