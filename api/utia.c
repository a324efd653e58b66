#include "utia.h"

#include "little.h"

#include <math.h>

bool api_utia_matches(const unsigned char *bytes, size_t size)
{
    (void)bytes;
    return size == UTIA_SIZE;
}

/* f_r from a stored number, as the database's own reader decodes it. */
static double decode(double v)
{
    v /= 140;
    return 100 * (v > 0.0375 ? pow((v + 0.055) / 1.055, 2.4) : v / 12.92);
}

/* Every SKIP-th pair of nodes: 9,680 of 58,081, more than roughness and colour need. */
enum { SKIP = 6, NODES = 1 + (UTIA_THETAS - 1) * UTIA_PHIS };
enum { PAIRS = (NODES * NODES + SKIP - 1) / SKIP };

/* The k-th of the NODES directions: the pole once, then theta by theta; its place in the data. */
static size_t node_direction(size_t k, double v[3])
{
    size_t theta = k ? 1 + (k - 1) / UTIA_PHIS : 0, phi = k ? (k - 1) % UTIA_PHIS : 0;
    double t = (double)theta * FACET_PI / 12, p = (double)phi * FACET_PI / 24;
    v[0] = sin(t) * cos(p), v[1] = sin(t) * sin(p), v[2] = cos(t);
    return theta * UTIA_PHIS + phi;
}

static facet_fit_samples *node_samples(const double *fr, struct arena *arena)
{
    facet_fit_samples *samples = api_arena_array(arena, 1, sizeof *samples);
    double *column[9], v[6];
    for (int k = 0; k < 9; k++)
        if (!(column[k] = api_arena_doubles(arena, PAIRS)) || !samples) return NULL;
    size_t n = 0;
    for (size_t i = 0; i < NODES; i++) {
        for (size_t o = i % SKIP; o < NODES && n < PAIRS; o += SKIP) {
            size_t at = node_direction(i, v) * UTIA_THETAS * UTIA_PHIS + node_direction(o, v + 3);
            for (int k = 0; k < 6; k++) column[k][n] = v[k];
            for (size_t c = 0; c < 3; c++) column[6 + c][n] = fr[c * UTIA_PLANE + at];
            n++;
        }
    }
    *samples = (facet_fit_samples){.count = n,
                                   .wi = {column[0], column[1], column[2]},
                                   .wo = {column[3], column[4], column[5]},
                                   .fr = {column[6], column[7], column[8]}};
    return samples;
}

bool api_utia_open(const void *bytes, size_t size, struct arena *arena, struct problem *problem,
                   struct measurement *m)
{
    if (size != UTIA_SIZE)
        return api_problem(problem, 422, "a UTIA file has %d bytes, this one has %zu", UTIA_SIZE,
                           size);
    double *fr = api_arena_doubles(arena, 3 * UTIA_PLANE);
    if (!fr) return api_problem_memory(problem);
    const unsigned char *b = bytes;
    bool data = false;
    m->counts.values = UTIA_PLANE;
    for (size_t i = 0; i < UTIA_PLANE; i++) {
        bool negative = false;
        for (size_t c = 0; c < 3; c++) {
            size_t at = c * UTIA_PLANE + i;
            double v = api_little_double(b + 8 * at);
            if (!isfinite(v) || v > 1e6)
                return api_problem(problem, 422,
                                   "number %zu (colour plane %zu) is %g: not a UTIA number", at, c,
                                   v);
            negative = negative || v < 0;
            fr[at] = v > 0 ? decode(v) : 0;
            data = data || v > 0;
        }
        m->counts.negative += negative;
    }
    m->source = (facet_fit_source){api_utia_evaluate, fr, tan(75 * FACET_PI / 180), true,
                                   node_samples(fr, arena)};
    if (!m->source.samples) return api_problem_memory(problem);
    return data || api_problem(problem, 422, "the file holds no data: no number is positive");
}

/* A direction among the nodes: the cell's corner, and the weights of its far sides. */
struct cell {
    size_t theta, phi;
    double t, p;
};

static bool locate(double x, double y, double z, struct cell *cell)
{
    double theta = atan2(hypot(x, y), z) / (FACET_PI / 12), phi = atan2(y, x) / (FACET_PI / 24);
    if (!(z > 0) || theta > UTIA_THETAS - 1 + 1e-6) return false;
    if (phi < 0) phi += UTIA_PHIS;
    cell->theta = theta < UTIA_THETAS - 2 ? (size_t)theta : UTIA_THETAS - 2;
    cell->phi = (size_t)phi % UTIA_PHIS;
    cell->t = fmin(theta - (double)cell->theta, 1);
    cell->p = phi - floor(phi);
    return true;
}

static size_t node(const struct cell *cell, int corner)
{
    return (cell->theta + (size_t)(corner >> 1)) * UTIA_PHIS +
           (cell->phi + (size_t)(corner & 1)) % UTIA_PHIS;
}

static double weight(const struct cell *cell, int corner)
{
    return (corner >> 1 ? cell->t : 1 - cell->t) * (corner & 1 ? cell->p : 1 - cell->p);
}

facet_status api_utia_evaluate(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                               double *const fr[3], bool *valid)
{
    const double *data = user;
    for (size_t k = 0; k < n; k++) {
        struct cell i, o;
        for (size_t c = 0; c < 3; c++) fr[c][k] = 0;
        valid[k] = locate(wi.x[k], wi.y[k], wi.z[k], &i) && locate(wo.x[k], wo.y[k], wo.z[k], &o);
        for (int a = 0; valid[k] && a < 16; a++) {
            double w = weight(&i, a >> 2) * weight(&o, a & 3);
            size_t at = node(&i, a >> 2) * UTIA_THETAS * UTIA_PHIS + node(&o, a & 3);
            for (size_t c = 0; c < 3; c++) fr[c][k] += w * data[c * UTIA_PLANE + at];
        }
    }
    return FACET_OK;
}
