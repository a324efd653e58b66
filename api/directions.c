#include "directions.h"

#include "limits.h"
#include "random.h"
#include "triples.h"

#include <float.h>
#include <math.h>
#include <string.h>

/*
 * Absolute errors of computed components.  Normalised: length, quotient.  Angles
 * as given: sine and cosine within 0.55 ulp, product, 3.2 roundings.  Cell centres: the angle
 * itself is off by half an ulp of up to 2 pi (4.4e-16) besides.  Random: the same with sqrt.
 */
static const double normalised_error = 3 * DBL_EPSILON;
static const double angles_error = 2 * DBL_EPSILON;
static const double grid_error = 8 * DBL_EPSILON;
static const double random_error = 8 * DBL_EPSILON;

static const double exact_within = 1e-6, unit_within = 1e-3; /* of length 1 */

static const char *const uniform_names[] = {"angle", "cosine", NULL};
enum { UNIFORM_ANGLE, UNIFORM_COSINE };

/* ---- Tables ----------------------------------------------------------------------------- */

static bool check_described(void *object, const struct place *place, struct decoder *decoder)
{
    const struct directions *d = object;
    bool angles = d->theta.values || d->phi.values;
    struct place theta = {place, "theta", 0}, phi = {place, "phi", 0};
    if (angles + !!d->grid + !!d->random != 1)
        return api_problem_at(decoder->problem, place,
                              "must have either theta and phi, or grid, or random");
    if (angles && !d->theta.values)
        return api_problem_at(decoder->problem, &theta, "is required with phi");
    if (angles && !d->phi.values)
        return api_problem_at(decoder->problem, &phi, "is required with theta");
    if (angles && d->theta.count != d->phi.count && d->theta.count > 1 && d->phi.count > 1)
        return api_problem_at(decoder->problem, &phi, "has %zu angles, theta has %zu", d->phi.count,
                              d->theta.count);
    return true;
}

static bool check_grid(void *object, const struct place *place, struct decoder *decoder)
{
    const struct grid *grid = object;
    if (grid->theta <= LIMIT_EVALUATIONS / grid->phi) return true;
    return api_problem_at(decoder->problem, place, "%lld directions are outside [1, %d]",
                          (long long)grid->theta * grid->phi, LIMIT_EVALUATIONS);
}

static const struct field grid_fields[] = {
    {MEMBER(struct grid, theta), FIELD_INTEGER, FIELD_MUST, .min = 1, .max = LIMIT_GRID_AXIS,
     .doc = "cells along theta, 0 to pi/2"},
    {MEMBER(struct grid, phi), FIELD_INTEGER, FIELD_MUST, .min = 1, .max = LIMIT_GRID_AXIS,
     .doc = "cells along phi, 0 to 2 pi"},
    {MEMBER(struct grid, uniform), FIELD_ENUM, FIELD_DEFAULT, .names = uniform_names,
     .doc = "cells of equal angle, or of equal cosine"},
    {0},
};

static const struct field random_fields[] = {
    {MEMBER(struct random, n), FIELD_INTEGER, FIELD_MUST, .min = 1, .max = LIMIT_EVALUATIONS,
     .doc = "how many, uniform on the upper hemisphere"},
    {MEMBER(struct random, seed), FIELD_INTEGER, FIELD_DEFAULT, .min = 0, .max = 0x1p53,
     .doc = "start of the SplitMix64 stream"},
    {0},
};

#define D(member) MEMBER(struct directions, member)

static const struct field described_fields[] = {
    {D(theta), FIELD_NUMBERS, .min = 0, .max = FACET_PI, .min_items = 1,
     .max_items = LIMIT_EVALUATIONS, .unit = "rad", .doc = "angles from the normal"},
    {D(phi), FIELD_NUMBERS, .min = -1e3, .max = 1e3, .min_items = 1, .max_items = LIMIT_EVALUATIONS,
     .unit = "rad", .doc = "angles from x; as many as theta, or one of both single"},
    {D(grid), FIELD_OPTION, .fields = grid_fields, .size = sizeof(struct grid), .check = check_grid,
     .doc = "cell centres of the upper hemisphere, theta by theta"},
    {D(random), FIELD_OPTION, .fields = random_fields, .size = sizeof(struct random),
     .doc = "reproducible random directions"},
    {0},
};

const struct field api_direction_forms[] = {
    [DIRECTIONS_LIST] = {D(list), FIELD_VECTORS, .width = 3, .min_items = 1,
                         .max_items = LIMIT_EVALUATIONS, .as_sent = true,
                         .doc = "unit vectors, nested or flat"},
    [DIRECTIONS_DESCRIBED] = {.name = "described",
                              .type = FIELD_OBJECT,
                              .fields = described_fields,
                              .check = check_described},
    {0},
};

/* ---- Plans -------------------------------------------------------------------------------- */

/* Sines and cosines of one axis, into fresh arrays; false: out of memory. */
static bool axis(const double *angles, size_t n, const double **cosines, const double **sines,
                 struct decoder *decoder)
{
    double *c = api_arena_doubles(decoder->arena, n), *s = api_arena_doubles(decoder->arena, n);
    if (!c || !s) return api_problem_memory(decoder->problem);
    for (size_t i = 0; i < n; i++) {
        c[i] = cos(angles[i]);
        s[i] = sin(angles[i]);
    }
    *cosines = c;
    *sines = s;
    return true;
}

static bool plan_angles(const struct directions *d, struct decoder *decoder, struct plan *plan)
{
    plan->kind = PLAN_ANGLES;
    plan->thetas = d->theta.count;
    plan->phis = d->phi.count;
    plan->count = plan->thetas > plan->phis ? plan->thetas : plan->phis;
    plan->input_error = angles_error;
    return axis(d->theta.values, plan->thetas, &plan->cos_theta, &plan->sin_theta, decoder) &&
           axis(d->phi.values, plan->phis, &plan->cos_phi, &plan->sin_phi, decoder);
}

/* cos theta = 1 - (i + 1/2)/n, sin theta = sqrt((1 - cos)(1 + cos)). */
static bool cosine_axis(size_t n, struct decoder *decoder, struct plan *plan)
{
    double *c = api_arena_doubles(decoder->arena, n), *s = api_arena_doubles(decoder->arena, n);
    if (!c || !s) return api_problem_memory(decoder->problem);
    for (size_t i = 0; i < n; i++) {
        double down = ((double)i + 0.5) / (double)n;
        c[i] = 1 - down;
        s[i] = sqrt(down * (2 - down));
    }
    plan->cos_theta = c;
    plan->sin_theta = s;
    return true;
}

static bool plan_grid(const struct grid *grid, struct decoder *decoder, struct plan *plan)
{
    size_t n = (size_t)grid->theta, m = (size_t)grid->phi;
    *plan = (struct plan){
        .kind = PLAN_GRID, .count = n * m, .input_error = grid_error, .thetas = n, .phis = m};
    double *theta = api_arena_doubles(decoder->arena, n),
           *phi = api_arena_doubles(decoder->arena, m);
    if (!theta || !phi) return api_problem_memory(decoder->problem);
    for (size_t i = 0; i < n; i++) theta[i] = ((double)i + 0.5) * (FACET_PI / 2) / (double)n;
    for (size_t j = 0; j < m; j++) phi[j] = ((double)j + 0.5) * (2 * FACET_PI) / (double)m;
    return axis(phi, m, &plan->cos_phi, &plan->sin_phi, decoder) &&
           (grid->uniform == UNIFORM_COSINE
                ? cosine_axis(n, decoder, plan)
                : axis(theta, n, &plan->cos_theta, &plan->sin_theta, decoder));
}

/* The i-th vector of a list as it was sent. */
static void vector_of(const struct plan *plan, size_t i, double v[3])
{
    float f[3];
    if (plan->values) {
        memcpy(v, plan->values + 3 * i, 3 * sizeof *v);
        return;
    }
    memcpy(f, (const char *)plan->floats + i * sizeof f, sizeof f);
    for (int k = 0; k < 3; k++) v[k] = f[k];
}

/* |v|^2 within 1.9e-6 of 1, so |v| within 1e-6: without a branch for each. */
static bool are_exact(const struct plan *plan, size_t start, size_t end)
{
    bool good = true;
    for (size_t i = start; i < end; i++) {
        double v[3];
        vector_of(plan, i, v);
        good &= fabs(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - 1) <= 1.9 * exact_within;
    }
    return good;
}

/* Whether n * 4 vectors are so, by float32: |v|^2 is right to 3e-7 in it, so that all pass the test above. */
static bool are_exact_floats(const struct plan *plan, size_t start, size_t n)
{
    const float most = (float)(1.5 * exact_within);
    int4 good = {-1, -1, -1, -1};
    for (size_t i = 0; i < n; i++) {
        struct columns4 v = triples_at(plan->floats, start + 4 * i);
        float4 off = v.x * v.x + v.y * v.y + v.z * v.z - 1;
        good &= (off <= most) & (off >= -most);
    }
    return good[0] & good[1] & good[2] & good[3];
}

/* How many of the first, at least: by the dozen. */
static size_t count_exact_floats(const struct plan *plan)
{
    enum { GROUPS = 32 };
    size_t n = 0;
    while (n + 4 * GROUPS <= plan->count && are_exact_floats(plan, n, GROUPS)) n += 4 * GROUPS;
    return n;
}

static bool all_exact(const struct plan *plan)
{
    return are_exact(plan, plan->values ? 0 : count_exact_floats(plan), plan->count);
}

/* A list some of whose lengths are not 1 within 1e-6: a copy with those normalised. */
static bool normalise(const struct place *place, struct decoder *decoder, struct plan *plan)
{
    double *copy = api_arena_doubles(decoder->arena, 3 * plan->count);
    if (!copy) return api_problem_memory(decoder->problem);
    for (size_t i = 0; i < plan->count; i++) {
        double *v = copy + 3 * i;
        struct place at = {place, NULL, i};
        vector_of(plan, i, v);
        double length = hypot(hypot(v[0], v[1]), v[2]); /* which neither overflows nor vanishes */
        if (fabs(length - 1) <= exact_within) continue;
        if (!(fabs(length - 1) <= unit_within))
            return api_problem_at(decoder->problem, &at,
                                  "has length %.9g, must have length 1 within %g", length,
                                  unit_within);
        for (int k = 0; k < 3; k++) v[k] /= length;
        plan->input_error = normalised_error;
    }
    plan->values = copy;
    return true;
}

static bool plan_list(const struct sent_numbers *list, const struct place *place,
                      struct decoder *decoder, struct plan *plan)
{
    *plan = (struct plan){.kind = PLAN_LIST,
                          .count = list->numbers.count,
                          .values = list->numbers.values,
                          .floats = list->floats};
    return all_exact(plan) || normalise(place, decoder, plan);
}

bool api_plan(const struct directions *d, const struct place *place, struct decoder *decoder,
              struct plan *plan)
{
    *plan = (struct plan){0};
    if (d->form == DIRECTIONS_LIST) return plan_list(&d->list, place, decoder, plan);
    if (d->grid) return plan_grid(d->grid, decoder, plan);
    if (!d->random) return plan_angles(d, decoder, plan);
    *plan = (struct plan){.kind = PLAN_RANDOM,
                          .count = (size_t)d->random->n,
                          .input_error = random_error,
                          .seed = (uint64_t)d->random->seed};
    return true;
}

/* Floats as sent, or a single vector that floats hold. */
bool api_plan_is_float(const struct plan *plan)
{
    if (plan->kind != PLAN_LIST) return false;
    if (!plan->values) return true;
    bool held = plan->count == 1;
    for (int k = 0; k < 3 && held; k++) held = plan->values[k] == (float)plan->values[k];
    return held;
}

/* ---- Filling -------------------------------------------------------------------------------- */

static void fill_random(uint64_t seed, size_t start, size_t n, double *x, double *y, double *z)
{
    for (size_t i = 0; i < n; i++) {
        uint64_t k = 2 * (uint64_t)(start + i);
        double down = api_random(seed, k), phi = 2 * FACET_PI * api_random(seed, k + 1);
        double s = sqrt(down * (2 - down));
        x[i] = s * cos(phi);
        y[i] = s * sin(phi);
        z[i] = 1 - down;
    }
}

static void fill_grid(const struct plan *plan, size_t start, size_t n, double *x, double *y,
                      double *z)
{
    size_t t = start / plan->phis, p = start % plan->phis;
    for (size_t i = 0; i < n; t++, p = 0) {
        size_t run = plan->phis - p < n - i ? plan->phis - p : n - i;
        double s = plan->sin_theta[t], c = plan->cos_theta[t];
        for (size_t k = 0; k < run; k++) {
            x[i + k] = s * plan->cos_phi[p + k];
            y[i + k] = s * plan->sin_phi[p + k];
            z[i + k] = c;
        }
        i += run;
    }
}

static void fill_floats(const struct plan *plan, size_t start, size_t n, double *x, double *y,
                        double *z)
{
    size_t i = 0;
    for (; i + 4 <= n; i += 4) {
        struct columns4 v = triples_at(plan->floats, start + i);
        put_widened(x + i, v.x);
        put_widened(y + i, v.y);
        put_widened(z + i, v.z);
    }
    for (; i < n; i++) {
        double v[3];
        vector_of(plan, start + i, v);
        x[i] = v[0];
        y[i] = v[1];
        z[i] = v[2];
    }
}

void api_plan_fill(const struct plan *plan, size_t start, size_t n, double *x, double *y, double *z)
{
    if (plan->kind == PLAN_RANDOM) {
        fill_random(plan->seed, start, n, x, y, z);
    } else if (plan->kind == PLAN_GRID) {
        fill_grid(plan, start, n, x, y, z);
    } else if (plan->kind == PLAN_ANGLES) {
        for (size_t i = 0; i < n; i++) {
            size_t t = plan->thetas == 1 ? 0 : start + i, p = plan->phis == 1 ? 0 : start + i;
            x[i] = plan->sin_theta[t] * plan->cos_phi[p];
            y[i] = plan->sin_theta[t] * plan->sin_phi[p];
            z[i] = plan->cos_theta[t];
        }
    } else if (plan->values) {
        const double *v = plan->values + 3 * start;
        for (size_t i = 0; i < n; i++, v += 3) {
            x[i] = v[0];
            y[i] = v[1];
            z[i] = v[2];
        }
    } else {
        fill_floats(plan, start, n, x, y, z);
    }
}

void api_plan_fill_floats(const struct plan *plan, size_t start, size_t n, float *x, float *y,
                          float *z)
{
    size_t i = 0;
    for (; !plan->values && i + 4 <= n; i += 4) {
        struct columns4 v = triples_at(plan->floats, start + i);
        memcpy(x + i, &v.x, sizeof v.x);
        memcpy(y + i, &v.y, sizeof v.y);
        memcpy(z + i, &v.z, sizeof v.z);
    }
    for (; i < n; i++) {
        double v[3];
        vector_of(plan, start + i, v);
        x[i] = (float)v[0];
        y[i] = (float)v[1];
        z[i] = (float)v[2];
    }
}
