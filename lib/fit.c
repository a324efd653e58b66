#include "facet_fit.h"

#include "fit_backscatter.h"
#include "fit_pairs.h"
#include "minimize.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

/* Gauss nodes of the backscatter equation: at least so many, they cost nothing in the result. */
enum { QUADRATURE_MIN = 90 };
/* u = 1/2 of the slope table lies at this many median slopes: both tails are then resolved. */
#define SCALE_PER_MEDIAN 1.5

/*
 * Directions the fit looks at.  theta_d at every degree: these become the nodes
 * of the Fresnel table; theta_h half spread over the slope distribution, half
 * over the hemisphere.
 */
enum { DIFFERENCES = 90, HALVES = 24, AZIMUTHS = 4 };
/* Masking only is believed where its residual is smaller by this factor, and more than rounding. */
#define CLEARLY 0.98
#define RESIDUAL_MIN 1e-6

/*
 * Directions its error is stated over, in the measure of a MERL file: sqrt(theta_h), theta_d,
 * phi_d.  40 parts of theta_d, because the middles of 45 would be nodes of the Fresnel table.
 */
enum { ERROR_HALVES = 45, ERROR_DIFFERENCES = 40, ERROR_AZIMUTHS = 12 };
enum { BACKSCATTERS = 600 };

/* A Fresnel table ends at the horizon, where nothing can be asked: one node more. */
enum { FRESNEL_NODES = DIFFERENCES + 1 };

/* What a facet_fit owns: Fresnel tables of GGX, Beckmann and tabulated, in the order of
 * cos_theta_d. */
struct owned {
    facet_slope_table *table;
    double cos_theta_d[FRESNEL_NODES], fresnel[FACET_NDF_COUNT][3][FRESNEL_NODES];
    double log_d[];
};

struct work {
    const facet_fit_source *source;
    facet_masking masking;
    const facet_watch *watch;
    facet_fit *fit;
    struct owned *owned;
    struct fit_pairs pairs, errors, backscatter;
    struct fit_density density[FACET_FIT_CONVENTION_COUNT];
    double values[3][DIFFERENCES], *value[3];
    facet_ndf ndf; /* whose alpha is sought */
    facet_status status;
};

static bool cancelled(struct work *work)
{
    const facet_watch *watch = work->watch;
    if (work->status == FACET_OK && watch && watch->cancelled && watch->cancelled(watch->user))
        work->status = FACET_CANCELLED;
    return work->status != FACET_OK;
}

/* theta_h at the middle of equal parts of its square root, as MERL spaces it. */
static double half_angle(size_t i, size_t n)
{
    double t = ((double)i + 0.5) / (double)n;
    return PI / 2 * t * t;
}

static facet_status ask_source(struct work *work, double scale)
{
    double theta_h[ERROR_HALVES], theta_d[DIFFERENCES], r[BACKSCATTERS];
    struct fit_grid grid = {theta_h, theta_d, HALVES, DIFFERENCES, AZIMUTHS};
    for (size_t i = 0; i < HALVES / 2; i++) {
        double u = (2 * (double)i + 1) / HALVES;
        theta_h[2 * i] = atan(scale * u / (1 - u));
        theta_h[2 * i + 1] = half_angle(i, HALVES / 2);
    }
    for (size_t d = 0; d < DIFFERENCES; d++) theta_d[d] = PI / 2 * (double)d / DIFFERENCES;
    facet_status status = facet_fit_pairs_create(work->source, &grid, &work->pairs);
    if (status != FACET_OK || cancelled(work)) return status;
    grid = (struct fit_grid){theta_h, theta_d, ERROR_HALVES, ERROR_DIFFERENCES, ERROR_AZIMUTHS};
    for (size_t i = 0; i < ERROR_HALVES; i++) theta_h[i] = half_angle(i, ERROR_HALVES);
    for (size_t d = 0; d < ERROR_DIFFERENCES; d++)
        theta_d[d] = PI / 2 * ((double)d + 0.5) / ERROR_DIFFERENCES;
    status = facet_fit_pairs_create(work->source, &grid, &work->errors);
    if (status != FACET_OK || cancelled(work)) return status;
    for (size_t i = 0; i < BACKSCATTERS; i++) {
        double u = ((double)i + 0.5) / BACKSCATTERS;
        r[i] = scale * u / (1 - u);
    }
    return facet_fit_pairs_backscatter(work->source, r, BACKSCATTERS, &work->backscatter);
}

/* ---- Slope distribution -------------------------------------------------------------- */

static facet_material tabulated(const struct work *work, const facet_slope_table *table)
{
    return (facet_material){.ndf = FACET_TABULATED,
                            .roughness = {1, 1, 0, 0, 0},
                            .masking = work->masking,
                            .fresnel = {.kind = FACET_FRESNEL_IDEAL, .channels = 1},
                            .table = table};
}

/* Solve under one convention; residual: what is left of the BRDF after the best Fresnel table. */
static facet_status solve(struct work *work, facet_fit_convention convention, double *log_d,
                          facet_slope_table **table, double *residual)
{
    facet_fit *fit = work->fit;
    struct fit_density *density = &work->density[convention];
    size_t nodes = fit->table_nodes - 1 > QUADRATURE_MIN ? fit->table_nodes - 1 : QUADRATURE_MIN;
    facet_status status =
        facet_fit_density_create(work->source, convention, fit->table_scale, nodes, density);
    if (status != FACET_OK) return status;
    status = facet_fit_density_table(work->source, convention, density, fit->table_nodes, log_d);
    if (status != FACET_OK) return status;
    status = facet_slope_table_create(fit->table_scale, log_d, fit->table_nodes, table);
    if (status != FACET_OK) return status == FACET_BAD_TABLE ? FACET_BAD_DATA : status;
    facet_material material = tabulated(work, *table);
    status = facet_fit_pairs_model(&work->pairs, &material);
    if (status != FACET_OK) return status;
    if (!facet_fit_fresnel_table(&work->pairs, work->value)) return FACET_BAD_DATA;
    *residual = facet_fit_residual(&work->pairs, work->value);
    return FACET_OK;
}

/* Both conventions; the better one's table goes to owned. */
static facet_status choose_convention(struct work *work)
{
    facet_fit *fit = work->fit;
    size_t n = fit->table_nodes;
    double *log_d = work->owned->log_d, residual[FACET_FIT_CONVENTION_COUNT];
    facet_slope_table *table[FACET_FIT_CONVENTION_COUNT] = {NULL, NULL};
    facet_status status = FACET_OK;
    for (size_t k = 0; status == FACET_OK && k < FACET_FIT_CONVENTION_COUNT; k++)
        status = solve(work, (facet_fit_convention)k, log_d + k * n, &table[k], &residual[k]);
    if (status == FACET_OK) {
        /* where they cannot be told apart, the one that the fitted material itself obeys */
        fit->convention =
            residual[FACET_FIT_MASKING_ONLY] < CLEARLY * residual[FACET_FIT_CORRELATED] &&
                    residual[FACET_FIT_CORRELATED] > RESIDUAL_MIN
                ? FACET_FIT_MASKING_ONLY
                : FACET_FIT_CORRELATED;
        fit->table_log_d = log_d + fit->convention * n;
        work->owned->table = table[fit->convention];
        table[fit->convention] = NULL;
    }
    for (size_t k = 0; k < FACET_FIT_CONVENTION_COUNT; k++) facet_slope_table_destroy(table[k]);
    return status;
}

/* ---- Roughness -------------------------------------------------------------------------- */

static facet_material parametric(const struct work *work, double alpha)
{
    alpha = fmax(FACET_ALPHA_MIN, fmin(FACET_ALPHA_MAX, alpha));
    return (facet_material){.ndf = work->ndf,
                            .roughness = {alpha, alpha, 0, 0, 0},
                            .masking = work->masking,
                            .fresnel = {.kind = FACET_FRESNEL_IDEAL, .channels = 1}};
}

/* The best Fresnel table for this material into work->values; the residual that is left. */
static double match(struct work *work, const facet_material *material)
{
    facet_status status = facet_fit_pairs_model(&work->pairs, material);
    if (status == FACET_OK && !facet_fit_fresnel_table(&work->pairs, work->value))
        return HUGE_VAL; /* so rough or smooth that nothing is seen: not this alpha */
    if (work->status == FACET_OK) work->status = status;
    return status == FACET_OK ? facet_fit_residual(&work->pairs, work->value) : HUGE_VAL;
}

static double residual_of_alpha(double log_alpha, void *user)
{
    struct work *work = user;
    if (cancelled(work)) return HUGE_VAL;
    facet_material material = parametric(work, exp(log_alpha));
    return match(work, &material);
}

/* Least squares on log D, then on the whole BRDF. */
static double find_alpha(struct work *work)
{
    double start = log(facet_fit_alpha(&work->density[work->fit->convention], work->ndf));
    double alpha = exp(facet_minimize(residual_of_alpha, work, start - 0.9, start + 0.8, 1e-8, 40));
    return fmax(FACET_ALPHA_MIN, fmin(FACET_ALPHA_MAX, alpha));
}

/* ---- Candidates --------------------------------------------------------------------------- */

/* From the groups, theta_d rising, to a table, cos theta_d rising, with a node at the horizon. */
static void store_fresnel(const struct work *work, facet_ndf ndf, facet_fresnel *fresnel)
{
    struct owned *owned = work->owned;
    *fresnel = (facet_fresnel){.kind = FACET_FRESNEL_TABLE,
                               .channels = work->pairs.channels,
                               .count = FRESNEL_NODES,
                               .cos_theta_d = owned->cos_theta_d};
    for (size_t g = 0; g < DIFFERENCES; g++)
        owned->cos_theta_d[DIFFERENCES - g] = work->pairs.cos_theta_d[g];
    owned->cos_theta_d[0] = 0;
    for (size_t c = 0; c < work->pairs.channels; c++) {
        double *to = owned->fresnel[ndf][c];
        for (size_t g = 0; g < DIFFERENCES; g++) to[DIFFERENCES - g] = fmin(work->value[c][g], 1e6);
        double slope = (to[2] - to[1]) / (owned->cos_theta_d[2] - owned->cos_theta_d[1]);
        to[0] = fmax(0, fmin(1e6, to[1] - slope * owned->cos_theta_d[1]));
        fresnel->values[c] = to;
    }
}

static void add_candidate(struct work *work, size_t index, const facet_material *material)
{
    facet_fit_candidate *candidate = &work->fit->candidate[index];
    size_t channels = material->fresnel.channels, numbers = channels;
    candidate->material = *material;
    if (material->fresnel.kind == FACET_FRESNEL_TABLE) numbers = FRESNEL_NODES * (1 + channels);
    numbers += 1; /* alpha, or the scale of the slope table */
    if (material->ndf == FACET_TABULATED) numbers += work->fit->table_nodes;
    candidate->bytes = numbers * sizeof(double);
    facet_fit_error *error = &candidate->error;
    work->status = facet_fit_rms_log(&work->errors, material, &error->rms_log);
    if (work->status == FACET_OK)
        work->status =
            facet_fit_backscatter_max(&work->backscatter, material, &error->backscatter_max);
}

static void add_parametric(struct work *work, facet_ndf ndf)
{
    work->ndf = ndf;
    facet_material material = parametric(work, find_alpha(work));
    if (cancelled(work)) return;
    if (match(work, &material) == HUGE_VAL) {
        if (work->status == FACET_OK) work->status = FACET_BAD_DATA;
        return;
    }
    facet_material schlick = material;
    schlick.fresnel =
        (facet_fresnel){.kind = FACET_FRESNEL_SCHLICK, .channels = work->pairs.channels};
    facet_fit_fresnel_schlick(&work->pairs, work->value, schlick.fresnel.f0);
    store_fresnel(work, ndf, &material.fresnel);
    add_candidate(work, ndf, &schlick);
    if (!cancelled(work)) add_candidate(work, 2 + (size_t)ndf, &material);
}

static void add_tabulated(struct work *work)
{
    facet_material material = tabulated(work, work->owned->table);
    match(work, &material);
    store_fresnel(work, FACET_TABULATED, &material.fresnel);
    if (!cancelled(work)) add_candidate(work, 4, &material);
}

static void run(struct work *work)
{
    double median;
    work->status = facet_fit_median_slope(work->source, &median);
    if (cancelled(work)) return;
    work->fit->table_scale = fmax(1e-8, fmin(1e4, SCALE_PER_MEDIAN * median));
    facet_status status = ask_source(work, work->fit->table_scale);
    if (work->status == FACET_OK) work->status = status;
    if (cancelled(work)) return;
    work->fit->pairs = work->errors.count;
    work->status = choose_convention(work);
    if (!cancelled(work)) add_parametric(work, FACET_GGX);
    if (!cancelled(work)) add_parametric(work, FACET_BECKMANN);
    if (!cancelled(work)) add_tabulated(work);
}

facet_status facet_fit_isotropic(const facet_fit_source *source, facet_masking masking,
                                 size_t resolution, const facet_watch *watch, facet_fit *fit)
{
    *fit = (facet_fit){.table_nodes = resolution + 1};
    if (resolution < FACET_FIT_RESOLUTION_MIN || resolution > FACET_FIT_RESOLUTION_MAX)
        return FACET_BAD_SIZE;
    if (masking != FACET_SMITH) return FACET_UNSUPPORTED;
    struct work work = {.source = source, .masking = masking, .watch = watch, .fit = fit};
    for (size_t c = 0; c < 3; c++) work.value[c] = work.values[c];
    work.owned = calloc(1, sizeof *work.owned +
                               FACET_FIT_CONVENTION_COUNT * fit->table_nodes * sizeof(double));
    fit->owned = work.owned;
    work.status = fit->owned ? FACET_OK : FACET_NO_MEMORY;
    if (work.status == FACET_OK) run(&work);
    facet_fit_pairs_clear(&work.pairs);
    facet_fit_pairs_clear(&work.errors);
    facet_fit_pairs_clear(&work.backscatter);
    for (size_t k = 0; k < FACET_FIT_CONVENTION_COUNT; k++)
        facet_fit_density_clear(&work.density[k]);
    if (work.status != FACET_OK) facet_fit_clear(fit);
    return work.status;
}

void facet_fit_clear(facet_fit *fit)
{
    struct owned *owned = fit->owned;
    if (owned) facet_slope_table_destroy(owned->table);
    free(owned);
    *fit = (facet_fit){0};
}
