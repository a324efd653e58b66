/*
 * pairs.h - pairs of directions: wi and wo, or h and d (Rusinkiewicz).
 *
 * One direction pairs with all of the other list, equal lengths one to one; with
 * "pairing":"outer" pair k has first k / n and second k mod n, n the number of
 * second directions (every wo for the first wi, then for the second).
 */
#ifndef API_PAIRS_H
#define API_PAIRS_H

#include "directions.h"

struct pair_request {
    struct directions wi, wo, h, d;
    int pairing;
};

extern const char *const api_pairing_names[];

/* Rows of an endpoint's table whose struct has a member `pair_request pairs`. */
#define PAIR_FIELD(type_, member_, doc_)                                                           \
    {                                                                                              \
        .name = #member_, .offset = offsetof(type_, pairs.member_), .type = FIELD_UNION,           \
        .fields = api_direction_forms, .doc = doc_                                                 \
    }
#define PAIR_FIELDS(type_)                                                                         \
    PAIR_FIELD(type_, wi, "towards the light"), PAIR_FIELD(type_, wo, "towards the viewer"),       \
        PAIR_FIELD(type_, h, "half vectors, with d instead of wi and wo"),                         \
        PAIR_FIELD(type_, d, "wi in the frame where h is the pole (Rusinkiewicz 1998)"),           \
        PAIRING_FIELD(type_, pairs.pairing)
#define PAIRING_FIELD(type_, member_)                                                              \
    {                                                                                              \
        .name = "pairing", .offset = offsetof(type_, member_), .type = FIELD_ENUM,                 \
        .presence = FIELD_DEFAULT, .names = api_pairing_names,                                     \
        .doc = "each: one to one, or one to all; outer: every pair"                                \
    }

/* How the k-th of a batch finds its two partners. */
struct pairing {
    size_t first, second, count;
    bool outer;
};

/* names: of the two members, for the error. */
bool api_pairing(size_t first, size_t second, int pairing, const char *const names[2],
                 struct problem *problem, struct pairing *out);

struct pairs {
    struct plan first, second;
    struct pairing pairing;
    bool is_half; /* first is h, second is d */
    double input_error;
};

bool api_pairs(const struct pair_request *request, struct decoder *decoder, struct pairs *pairs);
/*
 * wi (x, y, z) and wo (x, y, z) of pairs start .. start + n - 1.  again: out holds what it did after
 * a call for as many pairs or more; what all pairs share is left as it is.
 */
void api_pairs_fill(const struct pairs *pairs, size_t start, size_t n, bool again,
                    double *const out[6]);

/* Whether float32 holds all directions as they were sent; then also as floats. */
bool api_pairs_are_floats(const struct pairs *pairs);
void api_pairs_fill_floats(const struct pairs *pairs, size_t start, size_t n, bool again,
                           float *const out[6]);

/* The plan's directions for batch elements start .. start + n - 1; is_first: which partner it is. */
void api_pairing_fill(const struct pairing *pairing, bool is_first, const struct plan *plan,
                      size_t start, size_t n, double *const out[3]);

#endif
