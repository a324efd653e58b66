#include "facet_fit.h"

#include "fit_work.h"
#include "watch.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/*
 * Directions the fit looks at.  theta_d at every degree: these become the nodes
 * of the Fresnel table; theta_h half spread over the slope distribution, half
 * over the hemisphere, as the error is.
 */
enum { HALVES = 24, AZIMUTHS = 4 };
enum { TURNED_DIFFERENCES = 18, TURNED_HALVES = 12, TURNED_AZIMUTHS = 6, TURNS = 9 };
enum { SAMPLE_GROUPS = 45 };
/* The least squares look at no more samples than this, evenly chosen; the error counts all. */
enum { SAMPLES_USED = 20000 };
/*
 * Directions its error is stated over, in the measure of a MERL file: sqrt(theta_h), theta_d,
 * phi_d.  40 parts of theta_d, because the middles of 45 would be nodes of the Fresnel table.
 */
enum { ERROR_HALVES = 45, ERROR_DIFFERENCES = 40, ERROR_AZIMUTHS = 12 };
enum {
    TURNED_ERROR_HALVES = 15,
    TURNED_ERROR_DIFFERENCES = 20,
    TURNED_ERROR_AZIMUTHS = 8,
    TURNED_ERROR_TURNS = 8
};
enum { BACKSCATTERS = 600, TURNED_BACKSCATTERS = 60, BACKSCATTER_TURNS = 10 };

bool facet_fit_cancelled(struct fit_work *work)
{
    if (work->status == FACET_OK && facet_is_cancelled(work->watch)) work->status = FACET_CANCELLED;
    return work->status != FACET_OK;
}

/* ---- Pairs ---------------------------------------------------------------------------- */

/* theta_h at the middle of equal parts of its square root, as MERL spaces it. */
static double half_angle(size_t i, size_t n)
{
    double t = ((double)i + 0.5) / (double)n;
    return FACET_PI / 2 * t * t;
}

static void difference_angles(double *theta_d, size_t n, double first)
{
    for (size_t d = 0; d < n; d++) theta_d[d] = FACET_PI / 2 * ((double)d + first) / (double)n;
}

static facet_status ask_backscatter(struct fit_work *work, double scale)
{
    size_t n = work->anisotropic ? TURNED_BACKSCATTERS : BACKSCATTERS;
    double r[BACKSCATTERS];
    for (size_t i = 0; i < n; i++) {
        double u = ((double)i + 0.5) / (double)n;
        r[i] = scale * u / (1 - u);
    }
    return facet_fit_pairs_backscatter(
        work->source, r, n, work->anisotropic ? BACKSCATTER_TURNS : 1, &work->backscatter);
}

static facet_status ask_isotropic(struct fit_work *work, double scale)
{
    double theta_h[ERROR_HALVES], theta_d[FIT_DIFFERENCES];
    struct fit_grid grid = {theta_h, theta_d, HALVES, FIT_DIFFERENCES, AZIMUTHS, 1, NULL, NULL};
    for (size_t i = 0; i < HALVES / 2; i++) {
        double u = (2 * (double)i + 1) / HALVES;
        theta_h[2 * i] = atan(scale * u / (1 - u));
        theta_h[2 * i + 1] = half_angle(i, HALVES / 2);
    }
    difference_angles(theta_d, FIT_DIFFERENCES, 0);
    facet_status status = facet_fit_pairs_create(work->source, &grid, &work->pairs);
    if (status != FACET_OK || facet_fit_cancelled(work)) return status;
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

static facet_status ask_turned(struct fit_work *work)
{
    double theta_h[TURNED_ERROR_HALVES], theta_d[TURNED_ERROR_DIFFERENCES];
    struct ellipse_halves ellipse = {work->roughness};
    struct fit_grid grid = {NULL,  theta_d,     TURNED_HALVES, TURNED_DIFFERENCES, TURNED_AZIMUTHS,
                            TURNS, turned_half, &ellipse};
    difference_angles(theta_d, TURNED_DIFFERENCES, 0);
    facet_status status = facet_fit_pairs_create(work->source, &grid, &work->pairs);
    if (status != FACET_OK || facet_fit_cancelled(work)) return status;
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

/* ---- All of it -------------------------------------------------------------------------------- */

static size_t count_groups(const struct fit_pairs *pairs)
{
    size_t n = 0; /* the pairs are in the order of their groups */
    for (size_t i = 0; i < pairs->count; i++) n += i == 0 || pairs->group[i] != pairs->group[i - 1];
    return n;
}

static void open_samples(struct fit_work *work)
{
    const facet_fit_samples *samples = work->source->samples;
    size_t n = work->options->anisotropic ? TURNED_DIFFERENCES : SAMPLE_GROUPS;
    if (samples->count < FACET_FIT_SAMPLES_MIN) {
        work->status = FACET_BAD_DATA;
        return;
    }
    work->status = facet_fit_pairs_samples(samples, n, &work->errors);
    if (work->status == FACET_OK)
        work->status = facet_fit_pairs_thin(&work->errors, 1 + work->errors.count / SAMPLES_USED,
                                            &work->pairs);
    if (work->status == FACET_OK && work->pairs.count < FACET_FIT_SAMPLES_MIN)
        work->status = FACET_BAD_DATA;
    if (work->status == FACET_OK) work->status = facet_fit_pairs_near(samples, &work->backscatter);
    facet_fit_spread_of(samples, &work->spread);
    work->nodes_told = count_groups(&work->errors);
}

static void open_source(struct fit_work *work)
{
    double median;
    work->status = facet_fit_median_slope(work->source, &median);
    if (facet_fit_cancelled(work)) return;
    double scale = fmax(1e-8, fmin(1e4, FIT_SCALE_PER_MEDIAN * median));
    work->fit->table_scale = scale;
    if (work->anisotropic) facet_fit_open_turned(work);
    if (facet_fit_cancelled(work)) return;
    if (work->anisotropic)
        work->status = ask_turned(work);
    else
        work->status = ask_isotropic(work, scale);
    if (facet_fit_cancelled(work)) return;
    work->status = ask_backscatter(work, scale);
    if (facet_fit_cancelled(work) || work->anisotropic) return;
    work->status = facet_fit_choose_convention(work);
}

static void finish(struct fit_work *work)
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
    fit->flat_rms = facet_fit_flat_rms(&work->errors, fit->flat_kd);
    work->status = facet_fit_hot_spot(&work->backscatter, best, &fit->hot_spot);
    for (size_t i = 0; work->source->samples && i < fit->count; i++) /* near backscatter only */
        fit->candidate[i].error.backscatter_max = NAN;
}

static void run(struct fit_work *work)
{
    enum { THIN_PAIRS = 900 };
    if (work->source->samples)
        open_samples(work);
    else
        open_source(work);
    if (facet_fit_cancelled(work)) return;
    work->status = facet_fit_pairs_thin(&work->pairs, 1 + work->pairs.count / THIN_PAIRS,
                                        &work->thin);
    if (!facet_fit_cancelled(work)) facet_fit_candidates(work);
    if (!facet_fit_cancelled(work)) finish(work);
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
    *fit = (facet_fit){.hot_spot = NAN};
    if (options->resolution < FACET_FIT_RESOLUTION_MIN ||
        options->resolution > FACET_FIT_RESOLUTION_MAX)
        return FACET_BAD_SIZE;
    if (!options_are_valid(options, source)) return FACET_UNSUPPORTED;
    struct fit_work *work = calloc(1, sizeof *work);
    if (!work) return FACET_NO_MEMORY;
    *work = (struct fit_work){.source = source,
                              .options = options,
                              .watch = watch,
                              .fit = fit,
                              .nodes = options->resolution + 1,
                              .anisotropic = options->anisotropic,
                              .spread = {SIZE_MAX, SIZE_MAX, SIZE_MAX},
                              .best_cost = HUGE_VAL,
                              .diffuse_cost = HUGE_VAL,
                              .plain_cost = HUGE_VAL};
    for (size_t c = 0; c < 3; c++) work->value[c] = work->values[c];
    work->owned = calloc(1, sizeof *work->owned + 2 * work->nodes * sizeof(double));
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
    struct fit_owned *owned = fit->owned;
    if (owned) {
        for (int k = 0; k < 2; k++) {
            facet_slope_table_destroy(owned->table[k]);
            facet_slope_table_destroy(owned->compact_table[k]);
            facet_slope_table_destroy(owned->turned_table[k]);
            facet_slope_table_destroy(owned->compact_turned[k]);
            free(owned->turned_log_d[k]);
        }
    }
    free(owned);
    *fit = (facet_fit){0};
}
