/* fit_extract.c - slope distributions of a source, and which convention it obeys. */
#include "fit_work.h"

#include "fit_pure.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Gauss nodes of the backscatter equation: at least so many, they cost nothing in the result. */
enum { QUADRATURE_MIN = 90, TURN_RADII = 45, TURN_AZIMUTHS = 90 };
/* Masking only is believed where its residual is smaller by this factor, and more than rounding. */
#define CLEARLY 0.98
#define RESIDUAL_MIN 1e-6
/* The other convention must miss it by so much more. */
#define PURER 30

/* ---- Slope distribution -------------------------------------------------------------- */

static facet_material tabulated(const struct fit_work *work, const facet_slope_table *table)
{
    facet_material material = {.ndf = FACET_TABULATED,
                               .roughness = {.alpha_x = 1, .alpha_y = 1},
                               .masking = work->options->masking,
                               .fresnel = {.kind = FACET_FRESNEL_IDEAL, .channels = 1},
                               .table = table};
    if (work->anisotropic) material.roughness = work->roughness;
    return material;
}

static size_t quadrature(const struct fit_work *work)
{
    size_t n = work->nodes - 1;
    return n > QUADRATURE_MIN ? n : QUADRATURE_MIN;
}

/* Solve under one convention; residual: what is left of the BRDF after the best Fresnel table. */
static facet_status solve(struct fit_work *work, facet_fit_convention convention, double *log_d,
                          facet_slope_table **table, double *residual)
{
    static const double none[3] = {0, 0, 0};
    facet_fit *fit = work->fit;
    facet_masking masking = work->options->masking;
    struct fit_density *density = &work->density[convention];
    facet_status status = facet_fit_density_create(work->source, masking, convention,
                                                   fit->table_scale, quadrature(work), density);
    if (status != FACET_OK) return status;
    for (int ndf = 0; ndf < 2; ndf++)
        facet_fit_alpha(density, (facet_ndf)ndf, &work->pure[convention][ndf]);
    status = facet_fit_density_table(work->source, masking, convention, density, work->nodes,
                                     log_d);
    if (status != FACET_OK) return status;
    status = facet_slope_table_create(fit->table_scale, log_d, work->nodes, table);
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
static facet_fit_convention decide(const struct fit_work *work, const double residual[2])
{
    double masking = fmin(work->pure[FACET_FIT_MASKING_ONLY][0],
                          work->pure[FACET_FIT_MASKING_ONLY][1]),
           correlated = fmin(work->pure[FACET_FIT_CORRELATED][0],
                             work->pure[FACET_FIT_CORRELATED][1]);
    if (correlated < FIT_PURE && correlated * PURER < masking) return FACET_FIT_CORRELATED;
    if (masking < FIT_PURE && masking * PURER < correlated) return FACET_FIT_MASKING_ONLY;
    return residual[FACET_FIT_MASKING_ONLY] < CLEARLY * residual[FACET_FIT_CORRELATED] &&
                   residual[FACET_FIT_CORRELATED] > RESIDUAL_MIN
               ? FACET_FIT_MASKING_ONLY
               : FACET_FIT_CORRELATED;
}

/* Both conventions; the better one's table goes to owned. */
facet_status facet_fit_choose_convention(struct fit_work *work)
{
    facet_fit *fit = work->fit;
    size_t n = work->nodes;
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
    double scale[3]; /* its F at normal incidence */
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
            double rest = fmax(fr[c][i] - less->kd[c] / FACET_PI, 0);
            double trust = rest / (rest + NOISE_PART * less->kd[c] / FACET_PI);
            if (!(rest > 0)) trust = less->kd[c] > 0 ? 0 : 1;
            fr[c][i] = trust * rest + (1 - trust) * less->scale[c] * model[i];
        }
    }
    facet_brdf_destroy(brdf);
    free(model);
    return status;
}

static facet_fit_source without_diffuse(const struct fit_work *work, struct less_diffuse *less)
{
    const struct fit_model *d = &work->diffuse;
    facet_fit_source source = *work->source;
    *less = (struct less_diffuse){
        .source = work->source, .kd = d->kd, .model = facet_fit_model_material(d)};
    for (size_t c = 0; c < 3; c++) less->scale[c] = (1 - d->kd[c]) * d->f0[c];
    source.evaluate = evaluate_less;
    source.user = less;
    return source;
}

/* The table that goes with a diffuse part: [1] of owned. */
facet_status facet_fit_extract_diffuse(struct fit_work *work)
{
    facet_fit *fit = work->fit;
    double *log_d = work->owned->log_d + work->nodes;
    struct less_diffuse less;
    facet_fit_source source = without_diffuse(work, &less);
    struct fit_density density;
    facet_masking masking = work->options->masking;
    double median;
    facet_status status = facet_fit_median_slope(&source, &median);
    if (status != FACET_OK) return status;
    status = facet_fit_density_create(&source, masking, fit->convention, fit->table_scale,
                                      quadrature(work), &density);
    if (status != FACET_OK) return status;
    status = facet_fit_density_table(&source, masking, fit->convention, &density, work->nodes,
                                     log_d);
    facet_fit_density_clear(&density);
    if (status == FACET_OK)
        status = facet_slope_table_create(fit->table_scale, log_d, work->nodes,
                                          &work->owned->table[1]);
    return status;
}

/* ---- Anisotropic ---------------------------------------------------------------------------- */

/* The other convention must miss a model by so much more: nodes are coarse. */
#define PURER_TURNED 3
/* Beyond this the distribution is no model's, whatever the convention. */
#define PURE_TURNED 0.05

static facet_status turn_by(struct fit_work *work, facet_fit_convention convention,
                            struct fit_turn *turn, double *purity)
{
    facet_status status = facet_fit_turn_create(work->source, work->options->masking, convention,
                                                work->fit->table_scale, TURN_RADII, TURN_AZIMUTHS,
                                                work->watch, turn);
    if (status == FACET_OK)
        *purity = fmin(facet_fit_turn_purity(turn, FACET_GGX),
                       facet_fit_turn_purity(turn, FACET_BECKMANN));
    return status;
}

/*
 * The shape of an anisotropic source, and the convention that gives the purer one; where neither
 * clearly does, correlated, and nothing is said.
 */
void facet_fit_open_turned(struct fit_work *work)
{
    facet_fit *fit = work->fit;
    struct fit_turn other = {0};
    double correlated, masking = INFINITY;
    fit->convention = FACET_FIT_CORRELATED;
    fit->has_convention = false;
    work->status = turn_by(work, FACET_FIT_CORRELATED, &work->turn, &correlated);
    if (facet_fit_cancelled(work)) return;
    work->has_turn = true;
    if (work->options->masking == FACET_SMITH) {
        facet_status status = turn_by(work, FACET_FIT_MASKING_ONLY, &other, &masking);
        bool better = status == FACET_OK && masking < PURE_TURNED &&
                      masking * PURER_TURNED < correlated;
        fit->has_convention = better ||
                              (correlated < PURE_TURNED && correlated * PURER_TURNED < masking);
        if (better) {
            struct fit_turn worse = work->turn;
            work->turn = other;
            other = worse;
            fit->convention = FACET_FIT_MASKING_ONLY;
        }
        facet_fit_turn_clear(&other);
        if (status != FACET_OK && status != FACET_BAD_DATA) work->status = status;
        if (facet_fit_cancelled(work)) return;
    }
    work->roughness = facet_fit_turn_roughness(&work->turn, FACET_GGX);
}

/* The tables of a source whose shape is known; BAD_TABLE: not even of all azimuths. */
static facet_status tabulate(struct fit_work *work, const facet_fit_source *source,
                             const struct fit_turn *turn, const facet_roughness *roughness,
                             bool diffuse, bool rows)
{
    const facet_fit *fit = work->fit;
    const facet_masking masking = work->options->masking;
    struct fit_owned *owned = work->owned;
    const size_t n = work->nodes;
    double *log_d = owned->log_d + diffuse * n;
    facet_status status = facet_fit_turn_table(source, masking, fit->convention, turn, roughness,
                                               fit->table_scale, n, 1, log_d);
    if (status == FACET_OK)
        status = facet_slope_table_create(fit->table_scale, log_d, n, &owned->table[diffuse]);
    if (status != FACET_OK || !rows || n > FACET_TURNED_NODES_MAX / FACET_FIT_ROWS) return status;
    log_d = owned->turned_log_d[diffuse] = calloc(FACET_FIT_ROWS * n, sizeof *log_d);
    if (!log_d) return FACET_NO_MEMORY;
    status = facet_fit_turn_table(source, masking, fit->convention, turn, roughness,
                                  fit->table_scale, n, FACET_FIT_ROWS, log_d);
    if (status == FACET_OK)
        status = facet_slope_table_create_turned(fit->table_scale, log_d, n, FACET_FIT_ROWS,
                                                 work->watch, &owned->turned_table[diffuse]);
    return status == FACET_BAD_TABLE ? FACET_OK : status; /* there is none */
}

static facet_status tabulate_rest(struct fit_work *work, bool rows)
{
    struct less_diffuse less;
    const facet_fit_source source = without_diffuse(work, &less);
    struct fit_turn turn = {0};
    double median;
    facet_status status = facet_fit_median_slope(&source, &median);
    if (status == FACET_OK)
        status = facet_fit_turn_create(&source, work->options->masking, work->fit->convention,
                                       FIT_SCALE_PER_MEDIAN * median, TURN_RADII, TURN_AZIMUTHS,
                                       work->watch, &turn);
    if (status == FACET_OK)
        status = tabulate(work, &source, &turn, &less.model.roughness, true, rows);
    facet_fit_turn_clear(&turn);
    /* A diffuse part that leaves no distribution has no table. */
    return status == FACET_NO_MEMORY || status == FACET_CANCELLED ? status : FACET_OK;
}

void facet_fit_tabulate_turned(struct fit_work *work, bool diffuse, bool rows)
{
    work->fit->table_scale = FIT_SCALE_PER_MEDIAN; /* slopes are now in units of alpha */
    work->status = diffuse
                       ? tabulate_rest(work, rows)
                       : tabulate(work, work->source, &work->turn, &work->roughness, false, rows);
    if (work->status == FACET_BAD_TABLE) work->status = FACET_BAD_DATA;
}
