#include "tolerance.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { DIGITS_MAX = 17 };

/* In the order of facet_tier; tests/unit/test_api.c compares with facet_tier_name. */
const char *const api_tier_names[] = {"fast", "precise", NULL};

_Static_assert(FACET_TIER_COUNT == sizeof api_tier_names / sizeof *api_tier_names - 1,
               "every tier has a name on the wire");

const struct field api_accuracy_fields[] = {
    {MEMBER(struct accuracy, tier), FIELD_TEXT, FIELD_MUST, .doc = "the tier that computed it"},
    {MEMBER(struct accuracy, bound), FIELD_NUMBER, FIELD_MUST, .min = 0, .max = 1},
    {MEMBER(struct accuracy, floor), FIELD_NUMBER, FIELD_MUST, .min = 0, .max = 1},
    {0},
};

/* Relative error of a number printed with so many significant digits. */
static double printing_error(int digits)
{
    return 5 * pow(10, -digits);
}

/* Three significant digits, upwards; through text, so that it prints as short as it is. */
static double rounded_up(double bound)
{
    char text[NUMBER_ROOM];
    double unit = pow(10, floor(log10(bound)) - 2);
    snprintf(text, sizeof text, "%.2e", ceil(bound / unit) * unit);
    return strtod(text, NULL);
}

/* Digits so that printing adds a tenth, and less where the tolerance leaves less; the total bound.
 */
static double printed(double bound, double tolerance, int *digits)
{
    int d = 1;
    while (d < DIGITS_MAX && printing_error(d) > bound / 10) d++;
    while (d < DIGITS_MAX && bound + printing_error(d) * (1 + bound) > tolerance) d++;
    *digits = d;
    double total = bound + printing_error(d) * (1 + bound), shown = rounded_up(total);
    return total <= tolerance && shown > tolerance ? tolerance : shown;
}

bool api_promise(const struct tolerance_request *request, bound_fn *bound_of, const void *asked,
                 struct problem *problem, struct promise *promise)
{
    bool forced = request->tier >= 0;
    double tolerance = !isnan(request->tolerance) ? request->tolerance
                       : forced                   ? INFINITY
                                                  : TOLERANCE_DEFAULT;
    struct place at = {NULL, forced ? "tier" : "tolerance", 0};
    double best = INFINITY;
    int first = forced ? request->tier : 0, last = forced ? first : FACET_TIER_COUNT - 1;
    for (int tier = first; tier <= last; tier++) {
        double bound;
        if (!bound_of(asked, (facet_tier)tier, &bound) || !(bound < 1)) continue;
        *promise = (struct promise){.tier = (facet_tier)tier};
        promise->bound = printed(bound, tolerance, &promise->digits);
        if (promise->bound <= tolerance) return true;
        if (promise->bound < best) best = promise->bound;
    }
    if (best < 1)
        return api_problem_at(problem, &at,
                              "%.3g cannot be promised for this request; the best bound is %.3g",
                              tolerance, best);
    return api_problem_at(problem, &at, "no bound can be promised for this request");
}
