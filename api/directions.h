/*
 * directions.h - directions as requests describe them, and as kernels want them.
 *
 * A description becomes a plan, which fills any part of the batch on demand: a
 * grid of a million directions stores only its two axes.
 *
 *   list    [[x,y,z],..]: length within 1e-6 of 1: exactly as given; within 1e-3:
 *           normalised in double; else refused
 *   angles  {"theta":[..],"phi":[..]}: equal lengths, or one of them a single angle
 *   grid    {"grid":{"theta":n,"phi":m}}: cell centres theta = (i + 1/2) (pi/2)/n, or with
 *           "uniform":"cosine" cos theta = 1 - (i + 1/2)/n; phi = (j + 1/2) 2 pi/m;
 *           direction i m + j
 *   random  {"random":{"n":n,"seed":s}}: uniform on the upper hemisphere: direction i has
 *           cos theta = 1 - r(2i), phi = 2 pi r(2i+1), r of random.h
 */
#ifndef API_DIRECTIONS_H
#define API_DIRECTIONS_H

#include "field.h"

struct grid {
    int64_t theta, phi;
    int uniform;
};

struct random {
    int64_t n, seed;
};

enum { DIRECTIONS_LIST, DIRECTIONS_DESCRIBED };

struct directions {
    int form;
    struct sent_numbers list;
    struct numbers theta, phi; /* DESCRIBED: angles, or one of the two below */
    struct grid *grid;
    struct random *random;
};

extern const struct field api_direction_forms[];

/* A member `directions` or a list of any width-3 vectors; .doc says which. */
#define DIRECTIONS_FIELD(type_, member_, presence_, doc_)                                          \
    {                                                                                              \
        MEMBER(type_, member_), FIELD_UNION, presence_, .fields = api_direction_forms, .doc = doc_ \
    }

struct plan {
    enum { PLAN_LIST, PLAN_ANGLES, PLAN_GRID, PLAN_RANDOM } kind;
    size_t count;
    double input_error;   /* absolute error of the components it fills in */
    const double *values; /* LIST: x, y, z; NULL: floats */
    const void *floats;   /* LIST: little-endian float32, not aligned */
    size_t thetas, phis;  /* ANGLES, GRID */
    const double *cos_theta, *sin_theta, *cos_phi, *sin_phi;
    uint64_t seed;
};

bool api_plan(const struct directions *directions, const struct place *place,
              struct decoder *decoder, struct plan *plan);
/* Directions start .. start + n - 1 of the plan. */
void api_plan_fill(const struct plan *plan, size_t start, size_t n, double *x, double *y,
                   double *z);

/* Whether float32 holds all of its directions as they were sent; then also as floats. */
bool api_plan_is_float(const struct plan *plan);
void api_plan_fill_floats(const struct plan *plan, size_t start, size_t n, float *x, float *y,
                          float *z);

#endif
