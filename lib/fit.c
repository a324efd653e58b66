#include "facet_fit.h"

#include "fit_backscatter.h"
#include "fit_model.h"
#include "fit_pairs.h"
#include "fit_polish.h"
#include "fit_turn.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

/* Gauss nodes of the backscatter equation: at least so many, they cost nothing in the result. */
enum { QUADRATURE_MIN = 90, TURN_RADII = 45, TURN_AZIMUTHS = 90 };
/* u = 1/2 of the slope table lies at this many median slopes: both tails are then resolved. */
#define SCALE_PER_MEDIAN 1.5

/*
 * Directions the fit looks at.  theta_d at every degree: these become the nodes
 * of the Fresnel table; theta_h half spread over the slope distribution, half
 * over the hemisphere, as the error is.
 */
enum { DIFFERENCES = 90, HALVES = 24, AZIMUTHS = 4 };
enum { TURNED_DIFFERENCES = 18, TURNED_HALVES = 12, TURNED_AZIMUTHS = 6, TURNS = 9 };
enum { SAMPLE_GROUPS = 45 };
/* Masking only is believed where its residual is smaller by this factor, and more than rounding. */
#define CLEARLY 0.98
#define RESIDUAL_MIN 1e-6
/*
 * rms of log P about a model below which a slope distribution is that model's; the
 * other convention must miss it by so much more.
 */
#define PURE 1e-3
#define PURER 30
/* Loss per residual of a model that leaves rounding. */
#define EXACT 1e-18

/*
 * Directions its error is stated over, in the measure of a MERL file: sqrt(theta_h), theta_d,
 * phi_d.  40 parts of theta_d, because the middles of 45 would be nodes of the Fresnel table.
 */
enum { ERROR_HALVES = 45, ERROR_DIFFERENCES = 40, ERROR_AZIMUTHS = 12 };
enum { TURNED_ERROR_HALVES = 15, TURNED_ERROR_DIFFERENCES = 20, TURNED_ERROR_AZIMUTHS = 8,
       TURNED_ERROR_TURNS = 8 };
enum { BACKSCATTERS = 600, TURNED_BACKSCATTERS = 60, BACKSCATTER_TURNS = 10 };

/* A Fresnel table ends at the horizon, where nothing can be asked: one node more. */
enum { FRESNEL_NODES = DIFFERENCES + 1 };

/* Fresnel tables: of each ndf, without and with a diffuse part, isotropic and not. */
enum { FRESNEL_TABLES = 4 * FACET_NDF_COUNT };

struct owned {
    facet_slope_table *table[2];
    double cos_theta_d[FRESNEL_NODES], fresnel[FRESNEL_TABLES][3][FRESNEL_NODES];
    double log_d[];
};

struct work {
    const facet_fit_source *source;
    const facet_fit_options *options;
    const facet_watch *watch;
    facet_fit *fit;
    struct owned *owned;
    struct fit_pairs pairs, thin, errors, backscatter;
    struct fit_density density[FACET_FIT_CONVENTION_COUNT];
    double pure[FACET_FIT_CONVENTION_COUNT][2]; /* rms of log P about GGX, Beckmann */
    struct fit_turn turn;
    bool anisotropic, has_turn;
    facet_roughness roughness; /* anisotropic: of the best model so far */
    double best_cost;          /* and what it leaves */
    double values[3][DIFFERENCES], *value[3];
    struct fit_model diffuse; /* the best model with a diffuse part */
    double diffuse_cost, plain_cost; /* with a Fresnel table, with and without a diffuse part */
    facet_status status;
};

static bool cancelled(struct work *work)
{
    const facet_watch *watch = work->watch;
    if (work->status == FACET_OK && watch && watch->cancelled && watch->cancelled(watch->user))
        work->status = FACET_CANCELLED;
    return work->status != FACET_OK;
}

/* ---- Pairs ---------------------------------------------------------------------------- */

/* theta_h at the middle of equal parts of its square root, as MERL spaces it. */
static double half_angle(size_t i, size_t n)
{
    double t = ((double)i + 0.5) / (double)n;
    return PI / 2 * t * t;
}

static void difference_angles(double *theta_d, size_t n, double first)
{
    for (size_t d = 0; d < n; d++) theta_d[d] = PI / 2 * ((double)d + first) / (double)n;
}

static facet_status ask_backscatter(struct work *work, double scale)
{
    size_t n = work->anisotropic ? TURNED_BACKSCATTERS : BACKSCATTERS;
    double r[BACKSCATTERS];
    for (size_t i = 0; i < n; i++) {
        double u = ((double)i + 0.5) / (double)n;
        r[i] = scale * u / (1 - u);
    }
    return facet_fit_pairs_backscatter(work->source, r, n,
                                       work->anisotropic ? BACKSCATTER_TURNS : 1,
                                       &work->backscatter);
}

static facet_status ask_isotropic(struct work *work, double scale)
{
    double theta_h[ERROR_HALVES], theta_d[DIFFERENCES];
    struct fit_grid grid = {theta_h, theta_d, HALVES, DIFFERENCES, AZIMUTHS, 1, NULL, NULL};
    for (size_t i = 0; i < HALVES / 2; i++) {
        double u = (2 * (double)i + 1) / HALVES;
        theta_h[2 * i] = atan(scale * u / (1 - u));
        theta_h[2 * i + 1] = half_angle(i, HALVES / 2);
    }
    difference_angles(theta_d, DIFFERENCES, 0);
    facet_status status = facet_fit_pairs_create(work->source, &grid, &work->pairs);
    if (status != FACET_OK || cancelled(work)) return status;
    grid.theta_h_count = ERROR_HALVES;
    grid.theta_d_count = ERROR_DIFFERENCES;
    grid.azimuths = ERROR_AZIMUTHS;
    for (size_t i = 0; i < ERROR_HALVES; i++) theta_h[i] = half_angle(i, ERROR_HALVES);
    difference_angles(theta_d, ERROR_DIFFERENCES, 0.5);
    return facet_fit_pairs_create(work->source, &grid, &work->errors);
}

/* Half of the theta_h where the slopes of this ellipse are, along phi_h. */
struct ellipse_halves {
    facet_roughness roughness;
};

static double turned_half(const void *user, size_t index, double phi)
{
    const facet_roughness *a = &((const struct ellipse_halves *)user)->roughness;
    if (index % 2) return half_angle(index / 2, TURNED_HALVES / 2);
    /* 1/alpha(phi)^2 along phi is the inverse quadratic form */
    double kappa = sqrt((1 - a->rho) * (1 + a->rho));
    double x = cos(phi) / a->alpha_x, y = (sin(phi) / a->alpha_y - a->rho * x) / kappa;
    double u = ((double)(index / 2) + 0.5) / (TURNED_HALVES / 2);
    return atan(u / (1 - u) / sqrt(x * x + y * y));
}

static facet_status ask_turned(struct work *work)
{
    double theta_h[TURNED_ERROR_HALVES], theta_d[TURNED_ERROR_DIFFERENCES];
    struct ellipse_halves ellipse = {work->roughness};
    struct fit_grid grid = {NULL,           theta_d, TURNED_HALVES, TURNED_DIFFERENCES,
                            TURNED_AZIMUTHS, TURNS,   turned_half,   &ellipse};
    difference_angles(theta_d, TURNED_DIFFERENCES, 0);
    facet_status status = facet_fit_pairs_create(work->source, &grid, &work->pairs);
    if (status != FACET_OK || cancelled(work)) return status;
    for (size_t i = 0; i < TURNED_ERROR_HALVES; i++)
        theta_h[i] = half_angle(i, TURNED_ERROR_HALVES);
    difference_angles(theta_d, TURNED_ERROR_DIFFERENCES, 0.5);
    grid = (struct fit_grid){theta_h,
                             theta_d,
                             TURNED_ERROR_HALVES,
                             TURNED_ERROR_DIFFERENCES,
                             TURNED_ERROR_AZIMUTHS,
                             TURNED_ERROR_TURNS,
                             NULL,
                             NULL};
    return facet_fit_pairs_create(work->source, &grid, &work->errors);
}

/* ---- Slope distribution -------------------------------------------------------------- */

static facet_material tabulated(const struct work *work, const facet_slope_table *table)
{
    facet_material material = {.ndf = FACET_TABULATED,
                               .roughness = {1, 1, 0, 0, 0},
                               .masking = work->options->masking,
                               .fresnel = {.kind = FACET_FRESNEL_IDEAL, .channels = 1},
                               .table = table};
    if (work->anisotropic) material.roughness = work->roughness;
    return material;
}

static size_t quadrature(const facet_fit *fit)
{
    size_t n = fit->table_nodes - 1;
    return n > QUADRATURE_MIN ? n : QUADRATURE_MIN;
}

/* Solve under one convention; residual: what is left of the BRDF after the best Fresnel table. */
static facet_status solve(struct work *work, facet_fit_convention convention, double *log_d,
                          facet_slope_table **table, double *residual)
{
    static const double none[3] = {0, 0, 0};
    facet_fit *fit = work->fit;
    facet_masking masking = work->options->masking;
    struct fit_density *density = &work->density[convention];
    facet_status status = facet_fit_density_create(work->source, masking, convention,
                                                   fit->table_scale, quadrature(fit), density);
    if (status != FACET_OK) return status;
    for (int ndf = 0; ndf < 2; ndf++)
        facet_fit_alpha(density, (facet_ndf)ndf, &work->pure[convention][ndf]);
    status = facet_fit_density_table(work->source, masking, convention, density, fit->table_nodes,
                                     log_d);
    if (status != FACET_OK) return status;
    status = facet_slope_table_create(fit->table_scale, log_d, fit->table_nodes, table);
    if (status != FACET_OK) return status == FACET_BAD_TABLE ? FACET_BAD_DATA : status;
    facet_material material = tabulated(work, *table);
    status = facet_fit_pairs_model(&work->pairs, &material, work->pairs.model);
    if (status != FACET_OK) return status;
    if (!facet_fit_fresnel_table(&work->pairs, none, work->value)) return FACET_BAD_DATA;
    *residual = facet_fit_residual(&work->pairs, none, work->value);
    return FACET_OK;
}

/*
 * A slope distribution that is a model's own under one convention alone settles
 * it; else what explains the whole BRDF better; where they cannot be told apart,
 * correlated, which the fitted material itself obeys.
 */
static facet_fit_convention decide(const struct work *work, const double residual[2])
{
    double masking = fmin(work->pure[FACET_FIT_MASKING_ONLY][0],
                          work->pure[FACET_FIT_MASKING_ONLY][1]),
           correlated =
               fmin(work->pure[FACET_FIT_CORRELATED][0], work->pure[FACET_FIT_CORRELATED][1]);
    if (correlated < PURE && correlated * PURER < masking) return FACET_FIT_CORRELATED;
    if (masking < PURE && masking * PURER < correlated) return FACET_FIT_MASKING_ONLY;
    return residual[FACET_FIT_MASKING_ONLY] < CLEARLY * residual[FACET_FIT_CORRELATED] &&
                   residual[FACET_FIT_CORRELATED] > RESIDUAL_MIN
               ? FACET_FIT_MASKING_ONLY
               : FACET_FIT_CORRELATED;
}

/* Both conventions; the better one's table goes to owned. */
static facet_status choose_convention(struct work *work)
{
    facet_fit *fit = work->fit;
    size_t n = fit->table_nodes;
    double residual[FACET_FIT_CONVENTION_COUNT];
    double *log_d[2] = {work->owned->log_d, work->owned->log_d + n};
    facet_slope_table *table[FACET_FIT_CONVENTION_COUNT] = {NULL, NULL};
    facet_status status = FACET_OK;
    fit->convention = FACET_FIT_CORRELATED;
    fit->has_convention = work->options->masking == FACET_SMITH;
    for (size_t k = 0; status == FACET_OK && k < FACET_FIT_CONVENTION_COUNT; k++)
        if (k == FACET_FIT_CORRELATED || fit->has_convention)
            status = solve(work, (facet_fit_convention)k, log_d[k], &table[k], &residual[k]);
    if (status == FACET_OK) {
        if (fit->has_convention) fit->convention = decide(work, residual);
        if (fit->convention == 1) memcpy(log_d[0], log_d[1], n * sizeof *log_d[0]);
        fit->table_log_d[0] = log_d[0];
        work->owned->table[0] = table[fit->convention];
        table[fit->convention] = NULL;
    }
    for (size_t k = 0; k < FACET_FIT_CONVENTION_COUNT; k++) facet_slope_table_destroy(table[k]);
    return status;
}

/*
 * The source less a diffuse part.  Where that leaves little, the noise of the data
 * would be the slope distribution's: there the model stands in.
 */
struct less_diffuse {
    const facet_fit_source *source;
    const double *kd;
    facet_material model;
    const double *scale; /* its F at normal incidence */
};
#define NOISE_PART 0.1 /* of the diffuse part */

static facet_status evaluate_less(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                                  double *const fr[3], bool *valid)
{
    const struct less_diffuse *less = user;
    facet_status status = less->source->evaluate(less->source->user, wi, wo, n, fr, valid);
    double *model = calloc(n, sizeof *model);
    facet_outputs outputs = {0};
    facet_brdf *brdf = NULL;
    outputs.of[FACET_FR][0] = model;
    if (status == FACET_OK && !model) status = FACET_NO_MEMORY;
    if (status == FACET_OK) status = facet_brdf_create(&less->model, &brdf);
    if (status == FACET_OK) status = facet_eval(brdf, FACET_PRECISE, wi, wo, n, &outputs);
    for (size_t c = 0; status == FACET_OK && c < 3; c++) {
        for (size_t i = 0; i < n; i++) {
            double rest = fmax(fr[c][i] - less->kd[c] / PI, 0);
            double trust = rest / (rest + NOISE_PART * less->kd[c] / PI);
            if (!(rest > 0)) trust = less->kd[c] > 0 ? 0 : 1;
            fr[c][i] = trust * rest + (1 - trust) * less->scale[c] * model[i];
        }
    }
    facet_brdf_destroy(brdf);
    free(model);
    return status;
}

/* The table that goes with a diffuse part: [1] of owned. */
static facet_status extract_diffuse(struct work *work)
{
    facet_fit *fit = work->fit;
    const struct fit_model *d = &work->diffuse;
    double scale[3], *log_d = work->owned->log_d + fit->table_nodes;
    struct less_diffuse less = {work->source, d->kd, facet_fit_model_material(d), scale};
    for (size_t c = 0; c < 3; c++) scale[c] = (1 - d->kd[c]) * d->f0[c];
    facet_fit_source source = *work->source;
    source.evaluate = evaluate_less;
    source.user = &less;
    struct fit_density density;
    facet_masking masking = work->options->masking;
    double median;
    facet_status status = facet_fit_median_slope(&source, &median);
    if (status != FACET_OK) return status;
    status = facet_fit_density_create(&source, masking, fit->convention, fit->table_scale,
                                      quadrature(fit), &density);
    if (status != FACET_OK) return status;
    status = facet_fit_density_table(&source, masking, fit->convention, &density, fit->table_nodes,
                                     log_d);
    facet_fit_density_clear(&density);
    if (status == FACET_OK)
        status = facet_slope_table_create(fit->table_scale, log_d, fit->table_nodes,
                                          &work->owned->table[1]);
    fit->table_log_d[1] = log_d;
    return status;
}

/* ---- Candidates --------------------------------------------------------------------------- */

/* From the groups, theta_d rising, to a table, cos theta_d rising, with a node at the horizon. */
static void store_fresnel(const struct work *work, size_t which, double *const value[3],
                          facet_fresnel *fresnel)
{
    struct owned *owned = work->owned;
    size_t groups = work->pairs.groups;
    *fresnel = (facet_fresnel){.kind = FACET_FRESNEL_TABLE,
                               .channels = work->pairs.channels,
                               .count = groups + 1,
                               .cos_theta_d = owned->cos_theta_d};
    for (size_t g = 0; g < groups; g++)
        owned->cos_theta_d[groups - g] = work->pairs.cos_theta_d[g];
    owned->cos_theta_d[0] = 0;
    for (size_t c = 0; c < work->pairs.channels; c++) {
        double *to = owned->fresnel[which][c];
        for (size_t g = 0; g < groups; g++) to[groups - g] = fmin(value[c][g], 1e6);
        double slope = (to[2] - to[1]) / (owned->cos_theta_d[2] - owned->cos_theta_d[1]);
        to[0] = fmax(0, fmin(1e6, to[1] - slope * owned->cos_theta_d[1]));
        fresnel->values[c] = to;
    }
}

static size_t numbers_of(const struct work *work, const facet_fit_candidate *candidate)
{
    const facet_material *m = &candidate->material;
    size_t channels = m->fresnel.channels, numbers = channels;
    if (m->fresnel.kind == FACET_FRESNEL_TABLE) numbers = m->fresnel.count * (1 + channels);
    if (candidate->has_diffuse) numbers += channels;
    if (m->ndf == FACET_TABULATED) numbers += work->fit->table_nodes + 1; /* and its scale */
    if (m->ndf != FACET_TABULATED || candidate->anisotropic)
        numbers += candidate->anisotropic ? 3 : 1;
    return numbers;
}

static void add_candidate(struct work *work, const struct fit_model *model)
{
    facet_fit_candidate *candidate = &work->fit->candidate[work->fit->count];
    candidate->material = facet_fit_model_material(model);
    candidate->has_diffuse = model->has_diffuse;
    candidate->anisotropic = model->anisotropic;
    facet_fresnel *fresnel = &candidate->material.fresnel;
    if (model->has_table) {
        size_t which = 4 * (size_t)model->ndf + 2 * model->anisotropic + model->has_diffuse;
        store_fresnel(work, which, model->value, fresnel);
    } else {
        fresnel->kind = FACET_FRESNEL_SCHLICK;
        fresnel->channels = work->pairs.channels;
        memcpy(fresnel->f0, model->f0, sizeof fresnel->f0);
    }
    for (size_t c = 0; c < 3; c++)
        candidate->diffuse[c] = model->has_diffuse ? model->kd[c < work->pairs.channels ? c : 0] : 0;
    candidate->bytes = numbers_of(work, candidate) * sizeof(double);
    work->status = facet_fit_error_of(&work->errors, &work->backscatter, candidate);
    if (work->status == FACET_OK) work->fit->count++;
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
        double kd = PI * ((double)pairs->count / dark - 1e-4);
        model->kd[c] = model->has_diffuse ? fmax(1e-3, fmin(0.9, kd)) : 0;
    }
}

/* Short solutions from several roughnesses on few pairs; the best is where to go on. */
static void start(struct work *work, const double *log_alpha, size_t n, struct fit_model *model)
{
    enum { STEPS = 5 };
    double best = HUGE_VAL;
    struct fit_model seed = *model;
    for (size_t k = 0; k < n && !cancelled(work); k++) {
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
        work->status =
            facet_fit_model_solve(&trial, &work->thin, STEPS, work->watch, &cost);
        if (work->status != FACET_OK) return;
        if (cost < best) {
            best = cost;
            *model = trial;
        }
    }
}

static double first_log_alpha(const struct work *work, facet_ndf ndf)
{
    double rms;
    const struct fit_density *density = &work->density[work->fit->convention];
    return density->count ? log(facet_fit_alpha(density, ndf, &rms)) : log(0.2);
}

static void set_start(struct work *work, struct fit_model *model, double *log_alpha, size_t *n)
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

/* GGX or Beckmann with Schlick, then with a table. */
static void add_parametric(struct work *work, facet_ndf ndf, bool anisotropic, bool diffuse,
                           double *cost)
{
    enum { STEPS = 40, TABLE_STEPS = 12 };
    const facet_fit *fit = work->fit;
    struct fit_model model = {.ndf = ndf,
                              .masking = work->options->masking,
                              .anisotropic = anisotropic,
                              .has_diffuse = diffuse};
    double log_alpha[8], without = *cost;
    size_t n;
    set_start(work, &model, log_alpha, &n);
    /* what backscatter says exactly, the rest, which obeys another masking, does not improve */
    if (fit->has_convention && fit->convention == FACET_FIT_MASKING_ONLY && !work->anisotropic &&
        work->pure[fit->convention][ndf] < PURE) {
        model.fixed_shape = true;
        n = 1;
    }
    start(work, log_alpha, n, &model);
    if (cancelled(work)) return;
    work->status = facet_fit_model_solve(&model, &work->pairs, STEPS, work->watch, cost);
    if (cancelled(work)) return;
    if (diffuse && !(*cost < 0.999 * without && without > EXACT)) return; /* nothing to speak of */
    add_candidate(work, &model);
    if (work->status == FACET_OK && anisotropic && *cost < work->best_cost) {
        work->best_cost = *cost;
        work->roughness = facet_fit_model_material(&model).roughness;
    }
    if (cancelled(work)) return;
    if (work->anisotropic && !anisotropic && !work->source->samples) return;
    facet_material material = facet_fit_model_material(&model);
    struct fit_model table = model;
    double table_cost;
    table.has_table = true;
    for (size_t c = 0; c < 3; c++) table.value[c] = work->value[c];
    work->status = facet_fit_pairs_model(&work->pairs, &material, work->pairs.model);
    if (work->status != FACET_OK) return;
    if (!facet_fit_fresnel_table(&work->pairs, model.kd, work->value)) return;
    work->status =
        facet_fit_model_solve(&table, &work->pairs, TABLE_STEPS, work->watch, &table_cost);
    if (cancelled(work)) return;
    add_candidate(work, &table);
    if (!diffuse) work->plain_cost = fmin(work->plain_cost, table_cost);
    if (diffuse && table_cost < work->diffuse_cost) {
        work->diffuse_cost = table_cost;
        work->diffuse = model;
        memcpy(work->diffuse.kd, table.kd, sizeof table.kd);
        memcpy(work->diffuse.shape, table.shape, sizeof table.shape);
    }
}

static void add_tabulated(struct work *work, bool diffuse)
{
    facet_fit *fit = work->fit;
    struct fit_model model = {.ndf = FACET_TABULATED,
                              .masking = work->options->masking,
                              .table = work->owned->table[diffuse],
                              .anisotropic = work->anisotropic,
                              .fixed_shape = true,
                              .has_diffuse = diffuse,
                              .has_table = true};
    facet_roughness r = work->roughness;
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
                                        work->owned->log_d + diffuse * fit->table_nodes,
                                        fit->table_nodes, &work->owned->table[diffuse], work->watch);
    if (!cancelled(work)) add_candidate(work, &model);
}

/* ---- All of it -------------------------------------------------------------------------------- */

static void open_samples(struct work *work)
{
    const facet_fit_samples *samples = work->source->samples;
    size_t n = work->options->anisotropic ? TURNED_DIFFERENCES : SAMPLE_GROUPS;
    if (samples->count < FACET_FIT_SAMPLES_MIN) {
        work->status = FACET_BAD_DATA;
        return;
    }
    work->status = facet_fit_pairs_samples(samples, n, &work->pairs);
    if (work->status == FACET_OK) work->status = facet_fit_pairs_thin(&work->pairs, 1, &work->errors);
    if (work->status == FACET_OK && work->pairs.count < FACET_FIT_SAMPLES_MIN)
        work->status = FACET_BAD_DATA;
    if (work->status == FACET_OK) work->status = facet_fit_pairs_near(samples, &work->backscatter);
}

/* The shape of an anisotropic source, and the convention that gives the purer one. */
static void open_turned(struct work *work)
{
    facet_fit *fit = work->fit;
    fit->convention = FACET_FIT_CORRELATED;
    fit->has_convention = false; /* a table of one profile cannot tell */
    work->status =
        facet_fit_turn_create(work->source, work->options->masking, fit->convention,
                              fit->table_scale, TURN_RADII, TURN_AZIMUTHS, work->watch, &work->turn);
    if (cancelled(work)) return;
    work->has_turn = true;
    work->roughness = facet_fit_turn_roughness(&work->turn, FACET_GGX);
    work->status = ask_turned(work);
}

static void tabulate_turned(struct work *work)
{
    facet_fit *fit = work->fit;
    double *log_d = work->owned->log_d;
    fit->table_scale = SCALE_PER_MEDIAN; /* slopes are now in units of alpha */
    work->status = facet_fit_turn_table(work->source, work->options->masking, fit->convention,
                                        &work->turn, &work->roughness, fit->table_scale,
                                        fit->table_nodes, log_d);
    if (cancelled(work)) return;
    work->status = facet_slope_table_create(fit->table_scale, log_d, fit->table_nodes,
                                            &work->owned->table[0]);
    if (work->status == FACET_BAD_TABLE) work->status = FACET_BAD_DATA;
    fit->table_log_d[0] = log_d;
}

static void open_source(struct work *work)
{
    double median;
    work->status = facet_fit_median_slope(work->source, &median);
    if (cancelled(work)) return;
    double scale = fmax(1e-8, fmin(1e4, SCALE_PER_MEDIAN * median));
    work->fit->table_scale = scale;
    if (work->anisotropic)
        open_turned(work);
    else
        work->status = ask_isotropic(work, scale);
    if (cancelled(work)) return;
    work->status = ask_backscatter(work, scale);
    if (cancelled(work) || work->anisotropic) return;
    work->status = choose_convention(work);
}

static void fit_models(struct work *work)
{
    unsigned models = work->options->models;
    bool tabulated = models & FACET_FIT_TABULATED && !work->source->samples;
    /* the table needs a parametric model for its ellipse and for its diffuse part */
    bool helped = tabulated && (work->anisotropic || work->options->diffuse);
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN && !cancelled(work); ndf++) {
        bool asked = models & 1u << ndf;
        if (!asked && !(helped && ndf == FACET_GGX && !(models & FACET_FIT_BECKMANN))) continue;
        size_t before = work->fit->count;
        for (int turned = 0; turned <= work->anisotropic; turned++) {
            double cost = HUGE_VAL;
            for (int diffuse = 0; diffuse <= work->options->diffuse && !cancelled(work); diffuse++)
                add_parametric(work, (facet_ndf)ndf, turned, diffuse, &cost);
        }
        if (!asked) work->fit->count = before;
    }
    if (cancelled(work) || !tabulated) return;
    if (work->anisotropic) tabulate_turned(work);
    if (!cancelled(work)) add_tabulated(work, false);
    if (cancelled(work) || !(work->diffuse_cost < work->plain_cost) || work->anisotropic) return;
    facet_status status = extract_diffuse(work);
    if (status == FACET_NO_MEMORY || status == FACET_CANCELLED) work->status = status;
    if (status == FACET_OK) add_tabulated(work, true);
}

static void finish(struct work *work)
{
    facet_fit *fit = work->fit;
    if (fit->count == 0) {
        work->status = FACET_BAD_DATA;
        return;
    }
    for (size_t i = 1; i < fit->count; i++) { /* by size, then by error */
        facet_fit_candidate moved = fit->candidate[i];
        size_t k = i;
        for (; k > 0; k--) {
            const facet_fit_candidate *before = &fit->candidate[k - 1];
            bool after = before->bytes < moved.bytes ||
                         (before->bytes == moved.bytes &&
                          before->error.rms_log <= moved.error.rms_log);
            if (after) break;
            fit->candidate[k] = fit->candidate[k - 1];
        }
        fit->candidate[k] = moved;
    }
    const facet_fit_candidate *best = &fit->candidate[0];
    for (size_t i = 1; i < fit->count; i++)
        if (fit->candidate[i].error.rms_log < best->error.rms_log) best = &fit->candidate[i];
    fit->pairs = work->errors.count;
    fit->flat_rms = facet_fit_flat_rms(&work->errors);
    work->status = facet_fit_hot_spot(&work->backscatter, best, &fit->hot_spot);
    for (size_t i = 0; work->source->samples && i < fit->count; i++) /* near backscatter only */
        fit->candidate[i].error.backscatter_max = NAN;
}

static void run(struct work *work)
{
    enum { THIN_PAIRS = 900 };
    if (work->source->samples)
        open_samples(work);
    else
        open_source(work);
    if (cancelled(work)) return;
    work->status = facet_fit_pairs_thin(&work->pairs, 1 + work->pairs.count / THIN_PAIRS, &work->thin);
    if (!cancelled(work)) fit_models(work);
    if (!cancelled(work)) finish(work);
}

static bool options_are_valid(const facet_fit_options *o, const facet_fit_source *source)
{
    return (o->masking == FACET_SMITH || o->masking == FACET_VGROOVE || o->masking == FACET_NONE) &&
           o->models && !(o->models & ~(unsigned)FACET_FIT_ALL) &&
           !(o->models == FACET_FIT_TABULATED && source->samples) &&
           !(o->anisotropic && !source->anisotropic && !source->samples);
}

facet_status facet_fit_create(const facet_fit_source *source, const facet_fit_options *options,
                              const facet_watch *watch, facet_fit *fit)
{
    *fit = (facet_fit){.table_nodes = options->resolution + 1, .hot_spot = NAN};
    if (options->resolution < FACET_FIT_RESOLUTION_MIN ||
        options->resolution > FACET_FIT_RESOLUTION_MAX)
        return FACET_BAD_SIZE;
    if (!options_are_valid(options, source)) return FACET_UNSUPPORTED;
    struct work *work = calloc(1, sizeof *work);
    if (!work) return FACET_NO_MEMORY;
    *work = (struct work){.source = source,
                          .options = options,
                          .watch = watch,
                          .fit = fit,
                          .anisotropic = options->anisotropic,
                          .best_cost = HUGE_VAL,
                          .diffuse_cost = HUGE_VAL,
                          .plain_cost = HUGE_VAL};
    for (size_t c = 0; c < 3; c++) work->value[c] = work->values[c];
    work->owned = calloc(1, sizeof *work->owned + 2 * fit->table_nodes * sizeof(double));
    fit->owned = work->owned;
    work->status = fit->owned ? FACET_OK : FACET_NO_MEMORY;
    if (work->status == FACET_OK) run(work);
    facet_fit_pairs_clear(&work->pairs);
    facet_fit_pairs_clear(&work->thin);
    facet_fit_pairs_clear(&work->errors);
    facet_fit_pairs_clear(&work->backscatter);
    facet_fit_turn_clear(&work->turn);
    for (size_t k = 0; k < FACET_FIT_CONVENTION_COUNT; k++)
        facet_fit_density_clear(&work->density[k]);
    facet_status status = work->status;
    free(work);
    if (status != FACET_OK) facet_fit_clear(fit);
    return status;
}

void facet_fit_clear(facet_fit *fit)
{
    struct owned *owned = fit->owned;
    if (owned) {
        facet_slope_table_destroy(owned->table[0]);
        facet_slope_table_destroy(owned->table[1]);
    }
    free(owned);
    *fit = (facet_fit){0};
}
