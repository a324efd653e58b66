#include "fit_model.h"

#include "fit_arrow.h"
#include "watch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Slopes this flat or steep are no roughness of a fit. */
#define LOG_ALPHA_MIN (-13.8)
#define LOG_ALPHA_MAX 2.3
#define ATANH_RHO_MAX 4.5 /* rho .99975 */
/* Step of the difference quotients of the shape: their error, 1e-6, costs nothing but a step. */
#define SHAPE_STEP 1e-6
/* Residuals beyond so many times their mean count linearly (Huber 1964). */
#define HUBER 3.0
#define KD_MAX 0.999

/* A source at an end of the range must not leave it by the rounding of its logarithm. */
static double alpha_of(double log_alpha)
{
    return fmax(FACET_ALPHA_MIN, fmin(FACET_ALPHA_MAX, exp(log_alpha)));
}

double facet_fit_model_alpha(const struct fit_model *model)
{
    return alpha_of(model->anisotropic ? (model->shape[0] + model->shape[1]) / 2 : model->shape[0]);
}

facet_material facet_fit_model_material(const struct fit_model *model)
{
    double ax = alpha_of(model->shape[0]), ay = model->anisotropic ? alpha_of(model->shape[1]) : ax;
    double rho = model->anisotropic ? tanh(model->shape[2]) : 0;
    if (model->ndf == FACET_TABULATED && !model->anisotropic) ax = ay = 1;
    return (facet_material){.ndf = model->ndf,
                            .roughness = {.alpha_x = ax, .alpha_y = ay, .rho = rho},
                            .masking = model->masking,
                            .fresnel = {.kind = FACET_FRESNEL_IDEAL, .channels = 1},
                            .table = model->table};
}

/* ---- Parameters in a row ------------------------------------------------------------------ */

struct layout {
    size_t shapes, f0, kd, count; /* number of shapes; first index of F0 and of kd */
};

static struct layout layout_of(const struct fit_model *model, size_t channels)
{
    struct layout l = {.shapes = model->anisotropic ? 3 : 1};
    if (model->fixed_shape || (model->ndf == FACET_TABULATED && !model->anisotropic)) l.shapes = 0;
    l.f0 = l.shapes;
    l.kd = l.f0 + (model->has_table ? 0 : channels);
    l.count = l.kd + (model->has_diffuse ? channels : 0);
    return l;
}

static double within(double x, double low, double high)
{
    return fmax(low, fmin(high, x));
}

/* at the end of its range, and pushed outward */
static bool stuck(double x, double low, double high, double push)
{
    return (x <= low && push < 0) || (x >= high && push > 0);
}

static void freeze(const struct fit_model *model, struct layout l, size_t channels,
                   struct fit_arrow *arrow)
{
    for (size_t k = 0; k < l.shapes; k++) {
        double end = k == 2 ? ATANH_RHO_MAX : LOG_ALPHA_MAX, low = k == 2 ? -end : LOG_ALPHA_MIN;
        arrow->frozen[k] = stuck(model->shape[k], low, end, arrow->right[k]);
    }
    for (size_t c = 0; c < channels; c++) {
        if (!model->has_table)
            arrow->frozen[l.f0 + c] = stuck(model->f0[c], 0, 1, arrow->right[l.f0 + c]);
        if (model->has_diffuse)
            arrow->frozen[l.kd + c] = stuck(model->kd[c], 0, KD_MAX, arrow->right[l.kd + c]);
    }
}

/* Move by a step; the largest relative move. */
static double move(struct fit_model *model, struct layout l, size_t channels, size_t groups,
                   const double *step, const double *own_step)
{
    double most = 0;
    for (size_t k = 0; k < l.shapes; k++) {
        double end = k == 2 ? ATANH_RHO_MAX : LOG_ALPHA_MAX, low = k == 2 ? -end : LOG_ALPHA_MIN;
        double s = within(step[k], -0.7, 0.7);
        most = fmax(most, fabs(s));
        model->shape[k] = within(model->shape[k] + s, low, end);
    }
    for (size_t c = 0; c < channels; c++) {
        if (!model->has_table) {
            double s = within(step[l.f0 + c], -0.75 * model->f0[c] - 1e-3, 0.3);
            most = fmax(most, fabs(s));
            model->f0[c] = within(model->f0[c] + s, 0, 1);
        }
        if (model->has_diffuse) {
            double s = within(step[l.kd + c], -0.75 * model->kd[c] - 1e-4, 0.3);
            most = fmax(most, fabs(s));
            model->kd[c] = within(model->kd[c] + s, 0, KD_MAX);
        }
        for (size_t g = 0; model->has_table && g < groups; g++) {
            double s = within(own_step[c * groups + g], -1, 1);
            most = fmax(most, fabs(s));
            model->value[c][g] = within(model->value[c][g] * exp(s), 1e-9, 1e6);
        }
    }
    return most;
}

/* ---- Rows ----------------------------------------------------------------------------------- */

struct rows {
    struct fit_pairs *pairs;
    size_t channels;
    struct layout layout;
    double limit; /* residuals beyond count linearly */
    double mean;  /* of |residual| */
    size_t count;
    bool evaluated;
};

/* pairs->model and ->slope for this shape. */
static facet_status evaluate(const struct fit_model *model, struct rows *rows)
{
    struct fit_pairs *pairs = rows->pairs;
    if (rows->evaluated && rows->layout.shapes == 0) return FACET_OK; /* nothing moved */
    rows->evaluated = true;
    facet_material material = facet_fit_model_material(model);
    facet_status status = facet_fit_pairs_model(pairs, &material, pairs->model);
    for (size_t k = 0; status == FACET_OK && k < rows->layout.shapes; k++) {
        struct fit_model near = *model;
        near.shape[k] += SHAPE_STEP;
        material = facet_fit_model_material(&near);
        status = facet_fit_pairs_model(pairs, &material, pairs->slope[k]);
        for (size_t i = 0; i < pairs->count; i++)
            pairs->slope[k][i] = (pairs->slope[k][i] - pairs->model[i]) / SHAPE_STEP;
    }
    return status;
}

static void add_row(struct fit_arrow *arrow, const size_t *at, const double *jacobian, size_t n,
                    size_t own, double own_jacobian, double residual, double weight)
{
    for (size_t a = 0; a < n; a++) {
        double j = weight * jacobian[a];
        arrow->right[at[a]] += j * residual;
        for (size_t b = 0; b <= a; b++) arrow->square[at[a]][at[b]] += j * jacobian[b];
        if (own != ARROW_NONE) arrow->cross[own][at[a]] += j * own_jacobian;
    }
    if (own == ARROW_NONE) return;
    arrow->own_square[own] += weight * own_jacobian * own_jacobian;
    arrow->own_right[own] += weight * own_jacobian * residual;
}

static void add_channel(const struct fit_model *model, struct rows *rows, size_t c,
                        struct fit_arrow *arrow)
{
    const struct fit_pairs *p = rows->pairs;
    struct layout l = rows->layout;
    size_t at[ARROW_SHARED_MAX], n = l.shapes;
    for (size_t k = 0; k < l.shapes; k++) at[k] = k;
    if (!model->has_table) at[n++] = l.f0 + c;
    if (model->has_diffuse) at[n++] = l.kd + c;
    double kd = model->has_diffuse ? model->kd[c] : 0, jacobian[ARROW_SHARED_MAX];
    for (size_t i = 0; i < p->count; i++) {
        double s = p->schlick[i], m = p->model[i], lambert = p->wi[2][i] / FACET_PI;
        double f = model->has_table ? model->value[c][p->group[i]]
                                    : model->f0[c] + (1 - model->f0[c]) * s;
        double fit = (1 - kd) * f * m + kd * lambert, y = FACET_FIT_EPSILON + fit;
        double residual = p->log_fr[c][i] - log(y), size = fabs(residual);
        double weight = size > rows->limit ? rows->limit / size : 1, per = 1 / y;
        for (size_t k = 0; k < l.shapes; k++) jacobian[k] = (1 - kd) * f * p->slope[k][i] * per;
        size_t next = l.shapes;
        if (!model->has_table) jacobian[next++] = (1 - kd) * (1 - s) * m * per;
        if (model->has_diffuse) jacobian[next++] = (lambert - f * m) * per;
        add_row(arrow, at, jacobian, n, model->has_table ? c * p->groups + p->group[i] : ARROW_NONE,
                (1 - kd) * f * m * per, residual, weight);
        arrow->cost += size > rows->limit ? rows->limit * (2 * size - rows->limit) : size * size;
        rows->mean += size;
        rows->count++;
    }
}

static facet_status assemble(const struct fit_model *model, struct rows *rows,
                             struct fit_arrow *arrow)
{
    facet_status status = evaluate(model, rows);
    if (status != FACET_OK) return status;
    facet_fit_arrow_reset(arrow);
    rows->mean = 0;
    rows->count = 0;
    for (size_t c = 0; c < rows->channels; c++) add_channel(model, rows, c, arrow);
    for (size_t i = 0; i < arrow->shared; i++) /* Cholesky reads the lower half, the rest mirrors */
        for (size_t j = 0; j < i; j++) {
            double sum = arrow->square[i][j] + arrow->square[j][i];
            arrow->square[i][j] = arrow->square[j][i] = sum;
        }
    rows->mean /= (double)rows->count;
    freeze(model, rows->layout, rows->channels, arrow);
    return isfinite(arrow->cost) ? FACET_OK : FACET_BAD_DATA;
}

/* ---- Steps ------------------------------------------------------------------------------------ */

#define DAMPING_FIRST 1e-3
#define DAMPING_MAX 1e8
#define MOVE_MIN 1e-10
#define GAIN_MIN 1e-6 /* of the cost: less is not worth a step */

struct solver {
    struct fit_model trial;
    struct fit_arrow arrow, next;
    double *own_step, *value;
    double damping;
};

static bool solver_create(struct solver *s, const struct fit_model *model, const struct rows *rows)
{
    size_t groups = rows->pairs->groups, own = model->has_table ? rows->channels * groups : 0;
    *s = (struct solver){.damping = DAMPING_FIRST};
    s->own_step = calloc(2 * own + 1, sizeof *s->own_step);
    s->value = s->own_step ? s->own_step + own : NULL;
    return facet_fit_arrow_create(&s->arrow, rows->layout.count, own) &&
           facet_fit_arrow_create(&s->next, rows->layout.count, own) && s->own_step;
}

static void solver_clear(struct solver *s)
{
    facet_fit_arrow_clear(&s->arrow);
    facet_fit_arrow_clear(&s->next);
    free(s->own_step);
}

/* One accepted step, or none; true while it is worth going on. */
static bool advance(struct solver *s, struct fit_model *model, struct rows *rows,
                    facet_status *status)
{
    size_t groups = rows->pairs->groups;
    double step[ARROW_SHARED_MAX];
    for (; s->damping < DAMPING_MAX; s->damping *= 8) {
        if (!facet_fit_arrow_solve(&s->arrow, s->damping, step, s->own_step)) continue;
        s->trial = *model;
        for (size_t c = 0; model->has_table && c < rows->channels; c++) {
            s->trial.value[c] = s->value + c * groups;
            memcpy(s->trial.value[c], model->value[c], groups * sizeof(double));
        }
        double most = move(&s->trial, rows->layout, rows->channels, groups, step, s->own_step);
        *status = assemble(&s->trial, rows, &s->next);
        if (*status != FACET_OK) return false;
        if (!(s->next.cost <= s->arrow.cost)) {
            if (most < MOVE_MIN) return false;
            continue;
        }
        double gain = s->arrow.cost - s->next.cost;
        bool worth = gain > GAIN_MIN * s->arrow.cost && most > MOVE_MIN;
        struct fit_arrow done = s->arrow;
        s->arrow = s->next;
        s->next = done;
        for (size_t c = 0; model->has_table && c < rows->channels; c++) {
            memcpy(model->value[c], s->trial.value[c], groups * sizeof(double));
            s->trial.value[c] = model->value[c];
        }
        *model = s->trial;
        s->damping = fmax(s->damping / 8, 1e-12);
        return worth;
    }
    return false;
}

/* Least squares first; its mean residual then says what an outlier is. */
facet_status facet_fit_model_solve(struct fit_model *model, struct fit_pairs *pairs, int steps,
                                   const facet_watch *watch, double *cost)
{
    struct rows rows = {pairs, pairs->channels, layout_of(model, pairs->channels), INFINITY, 0, 0,
                        false};
    struct solver s;
    facet_status status = solver_create(&s, model, &rows) ? FACET_OK : FACET_NO_MEMORY;
    for (int robust = 0; status == FACET_OK && robust < 2; robust++) {
        if (robust) rows.limit = HUBER * fmax(rows.mean, 1e-12);
        s.damping = robust ? 1e-6 : DAMPING_FIRST;
        status = assemble(model, &rows, &s.arrow);
        if (rows.layout.count + s.arrow.own == 0) break;
        for (int k = 0; status == FACET_OK && k < steps; k++) {
            if (facet_is_cancelled(watch))
                status = FACET_CANCELLED;
            else if (!advance(&s, model, &rows, &status))
                break;
        }
    }
    *cost = status == FACET_OK ? s.arrow.cost / (double)rows.count : HUGE_VAL;
    solver_clear(&s);
    return status;
}
