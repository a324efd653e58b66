#include "tolerance.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { DIGITS_MAX = 17 };

/* In the order of facet_tier; tests/unit/test_contract.c compares with facet_tier_name. */
const char *const api_tier_names[] = {"draft", "fast", "exact32", "precise", NULL};

_Static_assert(FACET_TIER_COUNT == sizeof api_tier_names / sizeof *api_tier_names - 1,
               "every tier has a name on the wire");

const struct field api_accuracy_fields[] = {
    {MEMBER(struct accuracy, tier), FIELD_TEXT, FIELD_MUST, .doc = "the tier that computed it"},
    {MEMBER(struct accuracy, bound), FIELD_NUMBER, FIELD_MUST, .min = 0, .max = 1},
    {MEMBER(struct accuracy, floor), FIELD_NUMBER, FIELD_MUST, .min = 0, .max = 1},
    {MEMBER(struct accuracy, direction_floor), FIELD_NUMBER, .min = 0, .max = 1,
     .doc = "the floor that holds for the components of directions (wi, h) in this answer"},
    {MEMBER(struct accuracy, ceiling), FIELD_NUMBER,
     .doc =
         "an exact x above it, the largest double, is answered as it: G and G1 of a surface with a mean slope, "
         "seen from so far behind that next to nothing of it is left"},
    {0},
};

/* Relative error of a number printed with so many significant digits. */
static double printing_error(int digits)
{
    return 5 * pow(10, -digits);
}

double api_bound_up(double bound)
{
    if (!(bound > 0)) return bound;
    char text[NUMBER_ROOM];
    double unit = pow(10, floor(log10(bound)) - 2);
    snprintf(text, sizeof text, "%.2e", ceil(bound / unit) * unit);
    return strtod(text, NULL);
}

/* The total bound at so many digits, rounded up but not past a tolerance that it meets. */
static double printed_at(double bound, double tolerance, int digits)
{
    double total = bound + printing_error(digits) * (1 + bound), shown = api_bound_up(total);
    return total <= tolerance && shown > tolerance ? tolerance : shown;
}

static bool meets(double bound, double tolerance, int digits)
{
    return bound + printing_error(digits) * (1 + bound) <= tolerance;
}

/* Digits so that printing adds a tenth, and less where the tolerance leaves less. */
static void print_to_bound(struct promise *promise, double tolerance)
{
    int d = 1;
    while (d < DIGITS_MAX && printing_error(d) > promise->arithmetic / 10) d++;
    while (d < DIGITS_MAX && !meets(promise->arithmetic, tolerance, d)) d++;
    promise->digits = d;
    promise->bound = printed_at(promise->arithmetic, tolerance, d);
}

/* Without a tolerance a forced tier's own bound is what the user wants. */
static double tolerance_of(const struct tolerance_request *request)
{
    if (!isnan(request->tolerance)) return request->tolerance;
    return request->tier >= 0 ? INFINITY : TOLERANCE_DEFAULT;
}

void api_promise_fewer_digits(const struct tolerance_request *request, struct promise *promise)
{
    double tolerance = tolerance_of(request);
    if (!(tolerance < 1)) return;
    while (promise->digits > 1 && meets(promise->arithmetic, tolerance, promise->digits - 1))
        promise->digits--;
    promise->bound = printed_at(promise->arithmetic, tolerance, promise->digits);
}

static bool refuse(struct problem *problem, const struct place *at,
                   const struct tolerance_request *request, double best)
{
    char asked[NUMBER_ROOM], there[NUMBER_ROOM];
    api_number_print(asked, tolerance_of(request));
    api_number_print(there, best);
    if (request->tier < 0)
        return api_problem_at(problem, at,
                              "%s cannot be promised for this request; the best bound is %s", asked,
                              there);
    return api_problem_at(
        problem, at, "\"%s\" cannot promise the tolerance %s for this request; its bound is %s",
        api_tier_names[request->tier], asked, there);
}

/* By any tier. */
static bool is_promised(bound_fn *bound_of, const void *asked)
{
    double bound;
    for (int tier = 0; tier < FACET_TIER_COUNT; tier++)
        if (bound_of(asked, (facet_tier)tier, &bound) && bound < 1) return true;
    return false;
}

bool api_promise(const struct tolerance_request *request, bound_fn *bound_of, const void *asked,
                 const char *obstacle, struct problem *problem, struct promise *promise)
{
    bool forced = request->tier >= 0;
    double tolerance = tolerance_of(request);
    struct place at = {NULL, forced ? "tier" : "tolerance", 0};
    double best = INFINITY;
    int first = forced ? request->tier : 0, last = forced ? first : FACET_TIER_COUNT - 1;
    for (int tier = first; tier <= last; tier++) {
        double bound;
        if (!bound_of(asked, (facet_tier)tier, &bound) || !(bound < 1)) continue;
        *promise = (struct promise){.tier = (facet_tier)tier, .arithmetic = bound};
        print_to_bound(promise, tolerance);
        if (promise->bound <= tolerance) return true;
        if (promise->bound < best) best = promise->bound;
    }
    if (best < 1) return refuse(problem, &at, request, best);
    if (!forced || !is_promised(bound_of, asked))
        return api_problem_at(problem, &at, "no bound can be promised for this request: %s",
                              obstacle);
    return api_problem_at(
        problem, &at,
        "\"%s\" promises nothing for this material and these outputs; without \"tier\" one "
        "that does is taken (/v1/capabilities: where each holds)",
        api_tier_names[request->tier]);
}
