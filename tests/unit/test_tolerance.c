#include "check.h"
#include "tolerance.h"

#include <math.h>

static bool bounds(const void *asked, facet_tier tier, double *bound)
{
    const double *fast_precise = asked;
    *bound = tier == FACET_FAST ? fast_precise[0] : tier == FACET_PRECISE ? fast_precise[1] : 0;
    return *bound > 0; /* draft and exact32 promise nothing */
}

static struct promise promise_of(double fast, double precise, double tolerance, int tier,
                                 int *status)
{
    const double asked[] = {fast, precise};
    const struct tolerance_request request = {tolerance, tier};
    struct problem problem = {0};
    struct promise promise = {.digits = -1};
    api_promise(&request, bounds, asked, "it is a test", &problem, &promise);
    *status = problem.status;
    return promise;
}

TEST(the_cheapest_tier_that_meets_the_tolerance)
{
    int status;
    CHECK_INT(promise_of(8e-7, 4e-15, 1e-6, -1, &status).tier, FACET_FAST);
    CHECK_INT(promise_of(8e-7, 4e-15, 7e-7, -1, &status).tier, FACET_PRECISE);
    CHECK_INT(promise_of(8e-7, 4e-15, NAN, -1, &status).tier, FACET_FAST); /* default 1e-6 */
    CHECK_INT(promise_of(2e-6, 4e-15, NAN, -1, &status).tier, FACET_PRECISE);
    CHECK_INT(promise_of(0, 4e-15, 0.1, -1, &status).tier,
              FACET_PRECISE); /* fast promises nothing */
    CHECK_INT(promise_of(8e-2, 4e-15, NAN, FACET_FAST, &status).tier, FACET_FAST); /* forced */
    CHECK_INT(status, 0);
    promise_of(8e-7, 4e-15, 1e-9, FACET_FAST, &status);
    CHECK_INT(status, 422);
    promise_of(8e-7, 4e-15, 4e-15, -1, &status); /* printing does not fit any more */
    CHECK_INT(status, 422);
    promise_of(0, 0, 0.1, -1, &status);
    CHECK_INT(status, 422);
}

TEST(digits_are_those_the_bound_supports)
{
    struct rng rng;
    rng_seed(&rng, 3);
    for (int i = 0; i < 2000; i++) {
        int status;
        double bound = rng_log(&rng, 2e-15, 0.05), tolerance = bound * (1 + rng_uniform(&rng));
        struct promise p = promise_of(bound, 0, tolerance, FACET_FAST, &status);
        if (status) continue; /* no digits can fit between bound and tolerance */
        double printing = 5 * pow(10, -p.digits);
        CHECK(p.bound <= tolerance && p.bound >= bound + printing);
        CHECK(printing <= bound / 10 || p.digits == 17);
        /* One digit less would print more than a tenth of the bound, or miss the tolerance. */
        CHECK(10 * printing > bound / 10 || bound + 10 * printing * (1 + bound) > tolerance);
    }
}

TEST(no_digit_more_than_the_tolerance_needs)
{
    const struct tolerance_request request = {1e-6, -1};
    struct promise p = {.arithmetic = 4e-15, .bound = 4.2e-15, .digits = 16};
    api_promise_fewer_digits(&request, &p);
    CHECK_INT(p.digits, 7);
    CHECK(p.bound >= 4e-15 + 5e-7 && p.bound <= 1e-6);
    p = (struct promise){.arithmetic = 9.9e-7, .bound = 9.95e-7, .digits = 9};
    api_promise_fewer_digits(&request, &p);
    CHECK_INT(p.digits, 9); /* 8 digits would miss */
    const struct tolerance_request forced = {NAN, FACET_PRECISE};
    p = (struct promise){.arithmetic = 4e-15, .bound = 4.2e-15, .digits = 16};
    api_promise_fewer_digits(&forced, &p);
    CHECK_INT(p.digits, 16);
}
