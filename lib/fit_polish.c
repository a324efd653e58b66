#include "fit_polish.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ROUNDS = 8, KNOTS_MAX = 64, SOLVER_STEPS = 4 };
#define GAIN_MIN 0.01
#define SAME_U 1e-9  /* pairs of one theta_h differ by rounding */
#define STEP_MAX 1.5 /* of log D in one round */

/* Where the pairs look at the distribution: u of their theta_h, in order. */
struct knots {
    size_t count;
    double u[KNOTS_MAX], step[KNOTS_MAX];
    unsigned char *of; /* knot of each pair */
};

static double u_of(const struct fit_pairs *p, size_t i, double scale)
{
    double r = hypot(p->wi[0][i] + p->wo[0][i], p->wi[1][i] + p->wo[1][i]) /
               (p->wi[2][i] + p->wo[2][i]);
    return r / (scale + r);
}

static bool find_knots(const struct fit_pairs *p, double scale, struct knots *knots)
{
    knots->of = calloc(p->count, sizeof *knots->of);
    if (!knots->of) return false;
    for (size_t i = 0; i < p->count; i++) {
        double u = u_of(p, i, scale);
        size_t k = 0;
        while (k < knots->count && knots->u[k] < u - SAME_U) k++;
        if ((k < knots->count && knots->u[k] <= u + SAME_U) || knots->count == KNOTS_MAX) continue;
        memmove(knots->u + k + 1, knots->u + k, (knots->count - k) * sizeof *knots->u);
        knots->u[k] = u;
        knots->count++;
    }
    for (size_t i = 0; i < p->count; i++) {
        double u = u_of(p, i, scale);
        size_t k = 0;
        while (k + 1 < knots->count && knots->u[k] < u - SAME_U) k++;
        knots->of[i] = (unsigned char)k;
    }
    return true;
}

/* One Gauss-Newton step of log D per knot: the rows see it as they see log F. */
static void find_steps(const struct fit_pairs *p, const struct fit_model *model,
                       struct knots *knots)
{
    double above[KNOTS_MAX] = {0}, below[KNOTS_MAX] = {0};
    for (size_t c = 0; c < p->channels; c++) {
        double kd = model->has_diffuse ? model->kd[c] : 0;
        for (size_t i = 0; i < p->count; i++) {
            double part = (1 - kd) * model->value[c][p->group[i]] * p->model[i];
            double fit = FACET_FIT_EPSILON + part + kd / FACET_PI * p->wi[2][i], j = part / fit;
            above[knots->of[i]] += j * (p->log_fr[c][i] - log(fit));
            below[knots->of[i]] += j * j;
        }
    }
    double most = 0;
    for (size_t k = 0; k < knots->count; k++) most = fmax(most, below[k]);
    for (size_t k = 0; k < knots->count; k++) { /* what is hardly seen moves little */
        double step = above[k] / (below[k] + 1e-3 * most);
        knots->step[k] = fmax(-STEP_MAX, fmin(STEP_MAX, step));
    }
}

static double step_at(const struct knots *knots, double u)
{
    size_t k = 0;
    if (u <= knots->u[0]) return knots->step[0];
    while (k + 1 < knots->count && knots->u[k + 1] < u) k++;
    if (k + 1 == knots->count) return knots->step[k];
    double t = (u - knots->u[k]) / (knots->u[k + 1] - knots->u[k]);
    return (1 - t) * knots->step[k] + t * knots->step[k + 1];
}

struct state {
    struct fit_model model;
    double *log_d, *value; /* of n nodes, of 3 groups */
    facet_slope_table *table;
    double cost;
};

/* F and kd that go with the table of model; pairs->model is left as it is for them. */
static facet_status settle(struct fit_pairs *p, struct fit_model *model, const facet_watch *watch,
                           double *cost)
{
    facet_material material = facet_fit_model_material(model);
    double unused;
    facet_status status = facet_fit_pairs_model(p, &material, p->model);
    if (status != FACET_OK) return status;
    if (!facet_fit_fresnel_table(p, model->kd, model->value)) return FACET_BAD_DATA;
    if (model->has_diffuse) {
        status = facet_fit_model_solve(model, p, SOLVER_STEPS, watch, &unused);
        if (status == FACET_OK) status = facet_fit_pairs_model(p, &material, p->model);
    }
    *cost = facet_fit_residual(p, model->kd, model->value);
    return status;
}

/* The next table into trial; BAD_TABLE where there is none. */
static facet_status step_on(struct fit_pairs *p, const struct state *now, double scale, size_t n,
                            struct knots *knots, const facet_watch *watch, struct state *trial)
{
    find_steps(p, &now->model, knots);
    for (size_t i = 0; i < n; i++) {
        double step = step_at(knots, (double)i / (double)(n - 1));
        trial->log_d[i] = now->log_d[i] <= -700 ? now->log_d[i] : now->log_d[i] + step;
    }
    facet_status status = facet_slope_table_create(scale, trial->log_d, n, &trial->table);
    if (status != FACET_OK) return status;
    trial->model = now->model;
    trial->model.table = trial->table;
    for (size_t c = 0; c < p->channels; c++) {
        trial->model.value[c] = trial->value + c * p->groups;
        memcpy(trial->model.value[c], now->model.value[c], p->groups * sizeof(double));
    }
    return settle(p, &trial->model, watch, &trial->cost);
}

/* What trial gained is the model's. */
static void keep(const struct fit_pairs *p, struct state *trial, size_t n, struct state *now)
{
    facet_slope_table_destroy(now->table);
    now->table = trial->table;
    trial->table = NULL;
    memcpy(now->log_d, trial->log_d, n * sizeof(double));
    now->model.table = now->table;
    memcpy(now->model.kd, trial->model.kd, sizeof now->model.kd);
    for (size_t c = 0; c < p->channels; c++)
        memcpy(now->model.value[c], trial->model.value[c], p->groups * sizeof(double));
    now->cost = trial->cost;
}

facet_status facet_fit_polish(struct fit_pairs *pairs, struct fit_model *model, double scale,
                              double *log_d, size_t n, facet_slope_table **table,
                              const facet_watch *watch)
{
    struct knots knots = {0};
    double *room = calloc(n + 3 * pairs->groups, sizeof *room);
    struct state now = {*model, log_d, NULL, *table, HUGE_VAL}, trial = {.log_d = room};
    facet_status status = FACET_NO_MEMORY;
    if (room && find_knots(pairs, scale, &knots)) {
        trial.value = room + n;
        status = settle(pairs, &now.model, watch, &now.cost);
    }
    for (int k = 0; status == FACET_OK && k < ROUNDS; k++) {
        status = step_on(pairs, &now, scale, n, &knots, watch, &trial);
        bool worth = status == FACET_OK && trial.cost < (1 - GAIN_MIN) * now.cost;
        if (worth) keep(pairs, &trial, n, &now);
        facet_slope_table_destroy(trial.table);
        trial.table = NULL;
        if (status == FACET_BAD_TABLE || status == FACET_BAD_DATA) status = FACET_OK, worth = false;
        if (!worth) break;
    }
    *model = now.model;
    *table = now.table;
    free(knots.of);
    free(room);
    return status;
}
