#include "pairs.h"

#include "limits.h"

#include <float.h>
#include <math.h>
#include <string.h>

const char *const api_pairing_names[] = {"each", "outer", NULL};

/* Absolute error of wi and wo computed from h and d: h normalised, its frame, three products. */
static const double half_error = 16 * DBL_EPSILON;

bool api_pairing(size_t first, size_t second, int pairing, const char *const names[2],
                 struct problem *problem, struct pairing *out)
{
    bool outer = pairing == 1;
    struct place at = {NULL, outer ? "pairing" : names[0], 0};
    if (!outer && first != second && first != 1 && second != 1)
        return api_problem_at(problem, &at,
                              "has %zu elements and %s has %zu: give equal lengths, or one of them "
                              "once, or \"pairing\":\"outer\"",
                              first, names[1], second);
    size_t count = outer ? first * second : first > second ? first : second;
    if (outer && first > LIMIT_EVALUATIONS / second)
        return api_problem_at(problem, &at, "%zu x %zu pairs are outside [1, %d]", first, second,
                              LIMIT_EVALUATIONS);
    *out = (struct pairing){first, second, count, outer};
    return true;
}

/* Which of the two descriptions stands, and both its halves. */
static bool choose(const struct pair_request *r, struct problem *problem, bool *is_half)
{
    const struct {
        const char *name;
        int form;
    } m[4] = {{"wi", r->wi.form}, {"wo", r->wo.form}, {"h", r->h.form}, {"d", r->d.form}};
    *is_half = r->h.form >= 0 || r->d.form >= 0;
    for (int i = 0; i < 4; i++) {
        struct place at = {NULL, m[i].name, 0};
        bool wanted = *is_half == (i >= 2), there = m[i].form >= 0;
        if (wanted && !there)
            return api_problem_at(problem, &at,
                                  !*is_half ? "is required"
                                  : i == 2  ? "is required with d"
                                            : "is required with h");
        if (!wanted && there) return api_problem_at(problem, &at, "excludes h and d");
    }
    return true;
}

bool api_pairs(const struct pair_request *request, struct decoder *decoder, struct pairs *pairs)
{
    static const char *const names[2][2] = {{"wi", "wo"}, {"h", "d"}};
    *pairs = (struct pairs){0};
    if (!choose(request, decoder->problem, &pairs->is_half)) return false;
    const char *const *name = names[pairs->is_half];
    struct place first = {NULL, name[0], 0}, second = {NULL, name[1], 0};
    if (!api_plan(pairs->is_half ? &request->h : &request->wi, &first, decoder, &pairs->first) ||
        !api_plan(pairs->is_half ? &request->d : &request->wo, &second, decoder, &pairs->second))
        return false;
    double a = pairs->first.input_error, b = pairs->second.input_error;
    pairs->input_error = pairs->is_half ? half_error + 4 * a + b : a > b ? a : b;
    return api_pairing(pairs->first.count, pairs->second.count, request->pairing, name,
                       decoder->problem, &pairs->pairing);
}

/* n > 0 numbers of so many bytes equal to the first: twice as many each time, by the vector. */
static void repeat_first(void *numbers, size_t size, size_t n)
{
    for (size_t done = 1, some; done < n; done += some) {
        some = n - done < done ? n - done : done;
        memcpy((char *)numbers + done * size, numbers, some * size);
    }
}

static void repeat(const struct plan *plan, size_t index, size_t start, size_t n,
                   double *const out[3])
{
    api_plan_fill(plan, index, 1, out[0] + start, out[1] + start, out[2] + start);
    for (int k = 0; k < 3; k++) repeat_first(out[k] + start, sizeof *out[k], n);
}

void api_pairing_fill(const struct pairing *p, bool is_first, const struct plan *plan, size_t start,
                      size_t n, double *const out[3])
{
    size_t own = is_first ? p->first : p->second;
    if (!p->outer && own > 1) {
        api_plan_fill(plan, start, n, out[0], out[1], out[2]);
        return;
    }
    if (!p->outer) {
        repeat(plan, 0, 0, n, out);
        return;
    }
    for (size_t i = 0; i < n;) { /* run by run through the second directions */
        size_t from = (start + i) % p->second, left = p->second - from;
        size_t run = left < n - i ? left : n - i;
        if (is_first)
            repeat(plan, (start + i) / p->second, i, run, out);
        else
            api_plan_fill(plan, from, run, out[0] + i, out[1] + i, out[2] + i);
        i += run;
    }
}

/*
 * Rusinkiewicz 1998: rotate d so that the pole goes to h; wo is wi mirrored at h.
 * The frame of h is formed from its components, which keeps phi_h accurate near
 * the pole.  In: h, d.  Out: wi, wo.
 */
static void from_half(double *const out[6], size_t n)
{
    for (size_t i = 0; i < n; i++) {
        double hx = out[0][i], hy = out[1][i], hz = out[2][i];
        double dx = out[3][i], dy = out[4][i], dz = out[5][i];
        double h = sqrt(hx * hx + hy * hy + hz * hz), d = sqrt(dx * dx + dy * dy + dz * dz);
        hx /= h, hy /= h, hz /= h;
        dx /= d, dy /= d, dz /= d;
        double s = sqrt(hx * hx + hy * hy), c = s > 0 ? hx / s : 1, t = s > 0 ? hy / s : 0;
        double x = dx * hz * c - dy * t, y = dx * hz * t + dy * c, z = -dx * s;
        out[0][i] = x + dz * hx;
        out[1][i] = y + dz * hy;
        out[2][i] = z + dz * hz;
        out[3][i] = -x + dz * hx;
        out[4][i] = -y + dz * hy;
        out[5][i] = -z + dz * hz;
    }
}

/* Whether all pairs have the same first or second direction, as it was sent. */
static bool is_shared(const struct pairs *pairs, bool is_first)
{
    const struct pairing *p = &pairs->pairing;
    return !p->outer && !pairs->is_half && (is_first ? p->first : p->second) == 1;
}

void api_pairs_fill(const struct pairs *pairs, size_t start, size_t n, bool again,
                    double *const out[6])
{
    if (!again || !is_shared(pairs, true))
        api_pairing_fill(&pairs->pairing, true, &pairs->first, start, n, out);
    if (!again || !is_shared(pairs, false))
        api_pairing_fill(&pairs->pairing, false, &pairs->second, start, n, out + 3);
    if (pairs->is_half) from_half(out, n);
}

bool api_pairs_are_floats(const struct pairs *pairs)
{
    return !pairs->is_half && !pairs->pairing.outer && api_plan_is_float(&pairs->first) &&
           api_plan_is_float(&pairs->second);
}

void api_pairs_fill_floats(const struct pairs *pairs, size_t start, size_t n, bool again,
                           float *const out[6])
{
    for (int side = 0; side < 2; side++) {
        const struct plan *plan = side ? &pairs->second : &pairs->first;
        float *const *v = out + 3 * side;
        bool shared = is_shared(pairs, !side);
        if (again && shared) continue;
        api_plan_fill_floats(plan, shared ? 0 : start, shared ? 1 : n, v[0], v[1], v[2]);
        for (int k = 0; k < 3 && shared; k++) repeat_first(v[k], sizeof *v[k], n);
    }
}
