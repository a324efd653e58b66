/*
 * tolerance.h - from the error a user accepts to a tier and a number of digits.
 *
 * The reported bound covers the arithmetic and the printing: each number y in the
 * answer obeys |y - x| <= bound max(|x|, floor).
 */
#ifndef API_TOLERANCE_H
#define API_TOLERANCE_H

#include "facet.h"
#include "field.h"

#define TOLERANCE_DEFAULT 1e-6

struct tolerance_request {
    double tolerance;
    int tier;
};

extern const char *const api_tier_names[];

/* Rows of an endpoint's table whose struct has a member `tolerance_request accuracy`. */
#define TOLERANCE_FIELDS(type_)                                                                    \
    {.name = "tolerance",                                                                          \
     .offset = offsetof(type_, accuracy.tolerance),                                                \
     .type = FIELD_NUMBER,                                                                         \
     .min = 1e-15,                                                                                 \
     .max = 0.1,                                                                                   \
     .doc = "largest relative error accepted in each number; 1e-6 unless a tier is forced"},       \
    {                                                                                              \
        .name = "tier", .offset = offsetof(type_, accuracy.tier), .type = FIELD_ENUM,              \
        .names = api_tier_names, .doc = "force a tier"                                             \
    }

/* The answer's "accuracy". */
struct accuracy {
    const char *tier;
    double bound, floor;
    double direction_floor; /* of wi and h; NAN where the answer holds none */
    double ceiling;         /* NAN where nothing comes near */
};
extern const struct field api_accuracy_fields[];
#define ACCURACY_FIELD(type_)                                                                      \
    {                                                                                              \
        MEMBER(type_, accuracy), FIELD_OBJECT, FIELD_MUST,                                         \
            .fields = api_accuracy_fields,                                                         \
            .doc =                                                                                 \
                "what each number y promises about the exact x: |y - x| <= bound max(|x|, floor)"  \
    }

struct promise {
    facet_tier tier;
    double arithmetic; /* the bound of the numbers before they are printed */
    double bound;      /* of the numbers as printed */
    int digits;
};

/* The bound a tier promises for all that is asked; false: none. */
typedef bool bound_fn(const void *asked, facet_tier tier, double *bound);

/*
 * The cheapest tier that meets the request, or a 422 that names the best bound there is; where there is
 * none, `obstacle`: why, and what helps.
 */
bool api_promise(const struct tolerance_request *request, bound_fn *bound_of, const void *asked,
                 const char *obstacle, struct problem *problem, struct promise *promise);

/*
 * Only the digits that the tolerance needs, where it leaves room: for numbers
 * that are looked at.  Not for samples, which are fed back.
 */
void api_promise_fewer_digits(const struct tolerance_request *request, struct promise *promise);

/* Three significant digits, upwards; through text, so that it prints as short as it is. */
double api_bound_up(double bound);

#endif
