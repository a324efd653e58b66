/* fit_candidates.c - the models that are fitted, from the smallest to the tabulated. */
#include "fit_work.h"

#include "fit_polish.h"
#include "slope_table.h"

#include <math.h>
#include <string.h>

/* What a slope table takes as log 0, and JSON can carry. */
#define LOG_D_LEAST (-1000.0)

/* A roughness of its own is worth it where it leaves so little of the loss. */
#define FREE_GAIN 1e-3
/* Loss per residual of a model that leaves rounding. */
#define EXACT 1e-18
/* Of the isotropic model's loss (squares): the anisotropic one leaves less where the ellipse is seen. */
#define SEEN 0.25

/* ---- Candidates --------------------------------------------------------------------------- */

/* From the groups, theta_d rising, to a table, cos theta_d rising, with a node at the horizon. */
static void store_fresnel(const struct fit_work *work, size_t which, double *const value[3],
                          facet_fresnel *fresnel)
{
    struct fit_owned *owned = work->owned;
    size_t groups = work->pairs.groups;
    *fresnel = (facet_fresnel){.kind = FACET_FRESNEL_TABLE,
                               .channels = work->pairs.channels,
                               .count = groups + 1,
                               .cos_theta_d = owned->cos_theta_d};
    for (size_t g = 0; g < groups; g++) owned->cos_theta_d[groups - g] = work->pairs.cos_theta_d[g];
    owned->cos_theta_d[0] = 0;
    for (size_t c = 0; c < work->pairs.channels; c++) {
        double *to = owned->fresnel[which][c];
        for (size_t g = 0; g < groups; g++) to[groups - g] = fmin(value[c][g], 1e6);
        double slope = (to[2] - to[1]) / (owned->cos_theta_d[2] - owned->cos_theta_d[1]);
        to[0] = fmax(0, fmin(1e6, to[1] - slope * owned->cos_theta_d[1]));
        fresnel->values[c] = to;
    }
}

static size_t numbers_of(const facet_fit_candidate *candidate)
{
    const facet_material *m = &candidate->material;
    size_t channels = m->fresnel.channels, numbers = channels;
    if (m->fresnel.kind == FACET_FRESNEL_TABLE) numbers = m->fresnel.count * (1 + channels);
    if (candidate->has_diffuse) numbers += channels;
    if (m->ndf == FACET_TABULATED)
        numbers += candidate->log_d_rows * candidate->log_d_nodes + 1; /* and its scale */
    if (m->ndf != FACET_TABULATED || candidate->anisotropic)
        numbers += candidate->anisotropic ? 3 : 1;
    return numbers;
}

static void finish_candidate(struct fit_work *work, facet_fit_candidate *candidate)
{
    candidate->bytes = numbers_of(candidate) * sizeof(double);
    work->status = facet_fit_error_of(&work->errors, &work->backscatter, candidate);
    if (work->status == FACET_OK) work->fit->count++;
}

/* Every sixth node of a Fresnel table, both ends among them. */
static void thin_fresnel(struct fit_work *work, size_t which, facet_fresnel *fresnel)
{
    enum { STRIDE = 6 };
    struct fit_owned *owned = work->owned;
    size_t n = 0, last = fresnel->count - 1;
    for (size_t i = 0; i <= last; i = i < last && i + STRIDE > last ? last : i + STRIDE) {
        owned->compact_cos[n] = fresnel->cos_theta_d[i];
        for (size_t c = 0; c < fresnel->channels; c++)
            owned->compact_fresnel[which][c][n] = fresnel->values[c][i];
        n++;
    }
    fresnel->count = n;
    fresnel->cos_theta_d = owned->compact_cos;
    for (size_t c = 0; c < fresnel->channels; c++)
        fresnel->values[c] = owned->compact_fresnel[which][c];
}

/* The slopes at FACET_FIT_COMPACT + 1 nodes of the same scale; false where that is no thinning. */
static bool thin_slopes(struct fit_work *work, facet_fit_candidate *candidate)
{
    struct fit_owned *owned = work->owned;
    bool k = candidate->has_diffuse;
    double *log_d = owned->compact_log_d[k], scale = work->fit->table_scale;
    if (work->nodes <= FACET_FIT_COMPACT + 1) return false;
    for (size_t i = 0; i <= FACET_FIT_COMPACT; i++) {
        double u = (double)i / FACET_FIT_COMPACT, r = fmin(scale * u / (1 - u), 1e12);
        log_d[i] = i == FACET_FIT_COMPACT
                       ? candidate->log_d[candidate->log_d_nodes - 1]
                       : fmax(facet_slope_table_log_d(owned->table[k], r), LOG_D_LEAST);
    }
    work->status = facet_slope_table_create(scale, log_d, FACET_FIT_COMPACT + 1,
                                            &owned->compact_table[k]);
    if (work->status == FACET_BAD_TABLE) {
        work->status = FACET_OK;
        return false;
    }
    candidate->log_d = log_d;
    candidate->log_d_nodes = FACET_FIT_COMPACT + 1;
    candidate->material.table = owned->compact_table[k];
    return work->status == FACET_OK;
}

/* The same of rows, half as many. */
static bool thin_rows(struct fit_work *work, facet_fit_candidate *candidate)
{
    enum { ROWS = FACET_FIT_ROWS / 2 };
    struct fit_owned *owned = work->owned;
    bool k = candidate->has_diffuse;
    double scale = work->fit->table_scale;
    if (work->nodes <= FACET_FIT_COMPACT + 1) return false;
    for (size_t j = 0; j < ROWS; j++) {
        double *row = owned->compact_turned_log_d[k][j];
        for (size_t i = 0; i <= FACET_FIT_COMPACT; i++) {
            double u = (double)i / FACET_FIT_COMPACT, r = fmin(scale * u / (1 - u), 1e12);
            row[i] = i == FACET_FIT_COMPACT
                         ? candidate->log_d[(2 * j + 1) * candidate->log_d_nodes - 1]
                         : fmax(facet_slope_table_log_d_along(owned->turned_table[k], r,
                                                              (double)j / ROWS),
                                LOG_D_LEAST);
        }
        row[0] = owned->compact_turned_log_d[k][0][0];
    }
    const double *log_d = owned->compact_turned_log_d[k][0];
    work->status = facet_slope_table_create_turned(scale, log_d, FACET_FIT_COMPACT + 1, ROWS,
                                                   work->watch, &owned->compact_turned[k]);
    if (work->status == FACET_BAD_TABLE) {
        work->status = FACET_OK;
        return false;
    }
    candidate->log_d = log_d;
    candidate->log_d_nodes = FACET_FIT_COMPACT + 1;
    candidate->log_d_rows = ROWS;
    candidate->material.table = owned->compact_turned[k];
    return work->status == FACET_OK;
}

/* The same candidate with fewer nodes in its tables. */
static void add_compact(struct fit_work *work, const facet_fit_candidate *full, size_t which)
{
    facet_fit_candidate *candidate = &work->fit->candidate[work->fit->count];
    *candidate = *full;
    thin_fresnel(work, which, &candidate->material.fresnel);
    bool has_slopes = full->material.ndf == FACET_TABULATED;
    if (has_slopes && !(full->log_d_rows > 1 ? thin_rows : thin_slopes)(work, candidate)) return;
    finish_candidate(work, candidate);
}

static void add_candidate(struct fit_work *work, const struct fit_model *model)
{
    facet_fit_candidate *candidate = &work->fit->candidate[work->fit->count];
    /* Over the azimuth: the place of the isotropic table, which an anisotropic source does not have. */
    size_t which = 4 * (size_t)model->ndf + 2 * (model->anisotropic && !model->is_turned) +
                   model->has_diffuse;
    candidate->material = facet_fit_model_material(model);
    candidate->has_diffuse = model->has_diffuse;
    candidate->anisotropic = model->anisotropic;
    facet_fresnel *fresnel = &candidate->material.fresnel;
    if (model->has_table) {
        store_fresnel(work, which, model->value, fresnel);
    } else {
        fresnel->kind = FACET_FRESNEL_SCHLICK;
        fresnel->channels = work->pairs.channels;
        memcpy(fresnel->f0, model->f0, sizeof fresnel->f0);
    }
    for (size_t c = 0; c < 3; c++)
        candidate->diffuse[c] = model->has_diffuse ? model->kd[c < work->pairs.channels ? c : 0]
                                                   : 0;
    if (model->ndf == FACET_TABULATED) {
        candidate->log_d = model->is_turned ? work->owned->turned_log_d[model->has_diffuse]
                                            : work->owned->log_d + model->has_diffuse * work->nodes;
        candidate->log_d_nodes = work->nodes;
        candidate->log_d_rows = model->is_turned ? FACET_FIT_ROWS : 1;
    }
    finish_candidate(work, candidate);
    if (work->status == FACET_OK && model->has_table && work->options->compact)
        add_compact(work, candidate, which);
}

/* ---- Parametric models ---------------------------------------------------------------------- */

/* A first F0 and kd for this shape: ratios of sums, and the dark part of the data. */
static void guess(struct fit_model *model, const struct fit_pairs *pairs)
{
    for (size_t c = 0; c < 3; c++) {
        size_t from = c < pairs->channels ? c : 0;
        double above = 0, below = 0, dark = 0;
        for (size_t i = 0; i < pairs->count; i++) {
            double w = 1 / (pairs->model[i] + FACET_FIT_EPSILON);
            above += pairs->fr_cos[from][i] * w;
            below += pairs->model[i] * w;
            dark += 1 / (pairs->fr_cos[from][i] / pairs->wi[2][i] + 1e-4);
        }
        model->f0[c] = fmax(0.02, fmin(0.95, below > 0 ? above / below : 0.5));
        double kd = FACET_PI * ((double)pairs->count / dark - 1e-4);
        model->kd[c] = model->has_diffuse ? fmax(1e-3, fmin(0.9, kd)) : 0;
    }
}

/* Short solutions from several roughnesses on few pairs; the best is where to go on. */
static void start(struct fit_work *work, const double *log_alpha, size_t n, struct fit_model *model)
{
    enum { STEPS = 5 };
    double best = HUGE_VAL;
    struct fit_model seed = *model;
    for (size_t k = 0; k < n && !facet_fit_cancelled(work); k++) {
        struct fit_model trial = seed;
        double cost;
        trial.shape[0] = log_alpha[k];
        if (k && trial.anisotropic) {
            trial.shape[1] = log_alpha[k];
            trial.shape[2] = 0;
        }
        facet_material material = facet_fit_model_material(&trial);
        work->status = facet_fit_pairs_model(&work->thin, &material, work->thin.model);
        if (work->status != FACET_OK) return;
        guess(&trial, &work->thin);
        work->status = facet_fit_model_solve(&trial, &work->thin, STEPS, work->watch, &cost);
        if (work->status != FACET_OK) return;
        if (cost < best) {
            best = cost;
            *model = trial;
        }
    }
}

static double first_log_alpha(const struct fit_work *work, facet_ndf ndf)
{
    double rms;
    const struct fit_density *density = &work->density[work->fit->convention];
    return density->count ? log(facet_fit_alpha(density, ndf, &rms)) : log(0.2);
}

static void set_start(struct fit_work *work, struct fit_model *model, double *log_alpha, size_t *n)
{
    static const double alphas[] = {.012, .05, .15, .4};
    if (model->anisotropic && work->has_turn) {
        facet_roughness r = facet_fit_turn_roughness(&work->turn, model->ndf);
        model->shape[0] = log_alpha[0] = log(r.alpha_x);
        model->shape[1] = log(r.alpha_y);
        model->shape[2] = atanh(r.rho);
    } else {
        log_alpha[0] = model->shape[0] = model->shape[1] = first_log_alpha(work, model->ndf);
    }
    *n = 1;
    for (size_t k = 0; k < sizeof alphas / sizeof *alphas; k++) log_alpha[(*n)++] = log(alphas[k]);
}

/*
 * Least squares from several starts.  Where backscatter has this model's
 * distribution exactly, the rest, which may obey another masking, does not improve
 * alpha; unless the model explains that exactly too.
 */
static void solve_parametric(struct fit_work *work, struct fit_model *model, double *cost)
{
    enum { STEPS = 20 };
    const facet_fit *fit = work->fit;
    double log_alpha[8], free_cost;
    size_t n;
    set_start(work, model, log_alpha, &n);
    bool pure = fit->has_convention && !model->anisotropic &&
                work->pure[fit->convention][model->ndf] < FIT_PURE;
    struct fit_model pinned = *model;
    start(work, log_alpha, pure ? 1 : n, model);
    if (facet_fit_cancelled(work)) return;
    work->status = facet_fit_model_solve(model, &work->pairs, STEPS, work->watch, cost);
    if (!pure || facet_fit_cancelled(work)) return;
    free_cost = *cost;
    pinned.fixed_shape = true;
    start(work, log_alpha, 1, &pinned);
    if (facet_fit_cancelled(work)) return;
    work->status = facet_fit_model_solve(&pinned, &work->pairs, STEPS, work->watch, cost);
    if (free_cost < FREE_GAIN * *cost)
        *cost = free_cost;
    else
        *model = pinned;
}

/* The isotropic model has a roughness, a Fresnel term of so many nodes, and perhaps a diffuse part. */
static bool is_told(const struct fit_work *work, const struct fit_model *model, size_t nodes)
{
    return facet_fit_is_told(&work->spread, 1 + nodes + model->has_diffuse, model->anisotropic,
                             work->elongated);
}

/* The same roughness, to start with, under a Fresnel table. */
static void add_with_table(struct fit_work *work, const struct fit_model *model)
{
    enum { STEPS = 12 };
    facet_material material = facet_fit_model_material(model);
    struct fit_model table = *model;
    double cost;
    if (!is_told(work, model, work->nodes_told)) return;
    table.has_table = true;
    for (size_t c = 0; c < 3; c++) table.value[c] = work->value[c];
    work->status = facet_fit_pairs_model(&work->pairs, &material, work->pairs.model);
    if (work->status != FACET_OK) return;
    if (!facet_fit_fresnel_table(&work->pairs, model->kd, work->value)) return;
    work->status = facet_fit_model_solve(&table, &work->pairs, STEPS, work->watch, &cost);
    if (facet_fit_cancelled(work)) return;
    add_candidate(work, &table);
    if (!model->has_diffuse) work->plain_cost = fmin(work->plain_cost, cost);
    if (!model->has_diffuse || !(cost < work->diffuse_cost)) return;
    work->diffuse_cost = cost;
    work->diffuse = *model;
    memcpy(work->diffuse.kd, table.kd, sizeof table.kd);
    memcpy(work->diffuse.shape, table.shape, sizeof table.shape);
}

/* GGX or Beckmann with Schlick, then with a table.  cost: of the model without diffuse. */
static void add_parametric(struct fit_work *work, facet_ndf ndf, bool anisotropic, bool diffuse,
                           double *cost)
{
    struct fit_model model = {.ndf = ndf,
                              .masking = work->options->masking,
                              .anisotropic = anisotropic,
                              .has_diffuse = diffuse};
    double without = *cost;
    solve_parametric(work, &model, cost);
    if (facet_fit_cancelled(work)) return;
    double *round = &work->round_cost[diffuse];
    if (!anisotropic) *round = *cost;
    work->elongated = anisotropic && *round > EXACT && *cost < SEEN * *round;
    if (diffuse && !(*cost < 0.999 * without && without > EXACT)) return; /* nothing to speak of */
    if (!is_told(work, &model, 1)) return;
    add_candidate(work, &model);
    if (work->status == FACET_OK && anisotropic && *cost < work->best_cost) {
        work->best_cost = *cost;
        work->roughness = facet_fit_model_material(&model).roughness;
    }
    bool schlick_alone = work->anisotropic && !anisotropic && !work->source->samples;
    if (!facet_fit_cancelled(work) && !schlick_alone) add_with_table(work, &model);
}

static void add_tabulated(struct fit_work *work, bool diffuse, bool turned)
{
    facet_fit *fit = work->fit;
    struct fit_model model = {.ndf = FACET_TABULATED,
                              .masking = work->options->masking,
                              .table = turned ? work->owned->turned_table[diffuse]
                                              : work->owned->table[diffuse],
                              .is_turned = turned,
                              .anisotropic = work->anisotropic,
                              .fixed_shape = true,
                              .has_diffuse = diffuse,
                              .has_table = true};
    facet_roughness r = diffuse ? facet_fit_model_material(&work->diffuse).roughness
                                : work->roughness;
    if (work->anisotropic) {
        model.shape[0] = log(r.alpha_x), model.shape[1] = log(r.alpha_y);
        model.shape[2] = atanh(r.rho);
    }
    for (size_t c = 0; c < 3; c++) {
        model.value[c] = work->value[c];
        model.kd[c] = diffuse ? work->diffuse.kd[c] : 0;
    }
    facet_material material = facet_fit_model_material(&model);
    work->status = facet_fit_pairs_model(&work->pairs, &material, work->pairs.model);
    if (work->status != FACET_OK) return;
    if (!facet_fit_fresnel_table(&work->pairs, model.kd, work->value)) return;
    if (!work->anisotropic)
        work->status = facet_fit_polish(&work->pairs, &model, fit->table_scale,
                                        work->owned->log_d + diffuse * work->nodes, work->nodes,
                                        &work->owned->table[diffuse], work->watch);
    if (!facet_fit_cancelled(work)) add_candidate(work, &model);
}

/* A diffuse part that leaves no distribution has no table. */
static void add_radial(struct fit_work *work, bool diffuse)
{
    facet_status status = diffuse ? facet_fit_extract_diffuse(work) : FACET_OK;
    if (status == FACET_NO_MEMORY || status == FACET_CANCELLED) work->status = status;
    if (status == FACET_OK) add_tabulated(work, diffuse, false);
}

static void add_turned(struct fit_work *work, bool diffuse)
{
    /* What an ellipse explains needs no rows. */
    facet_fit_tabulate_turned(work, diffuse, work->best_cost > EXACT);
    if (!facet_fit_cancelled(work) && work->owned->table[diffuse])
        add_tabulated(work, diffuse, false);
    if (!facet_fit_cancelled(work) && work->owned->turned_table[diffuse])
        add_tabulated(work, diffuse, true);
}

void facet_fit_candidates(struct fit_work *work)
{
    unsigned models = work->options->models;
    bool tabulated = models & FACET_FIT_TABULATED && !work->source->samples;
    /* the table needs a parametric model for its ellipse and for its diffuse part */
    bool helped = tabulated && (work->anisotropic || work->options->diffuse);
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN && !facet_fit_cancelled(work); ndf++) {
        bool asked = models & 1u << ndf;
        if (!asked && !(helped && ndf == FACET_GGX && !(models & FACET_FIT_BECKMANN))) continue;
        size_t before = work->fit->count;
        for (int turned = 0; turned <= work->anisotropic; turned++) {
            double cost = HUGE_VAL;
            for (int diffuse = 0; diffuse <= work->options->diffuse && !facet_fit_cancelled(work);
                 diffuse++)
                add_parametric(work, (facet_ndf)ndf, turned, diffuse, &cost);
        }
        if (!asked) work->fit->count = before;
    }
    if (facet_fit_cancelled(work) || !tabulated) return;
    for (int diffuse = 0; diffuse <= (work->diffuse_cost < work->plain_cost); diffuse++) {
        if (work->anisotropic)
            add_turned(work, diffuse);
        else
            add_radial(work, diffuse);
        if (facet_fit_cancelled(work)) return;
    }
}
