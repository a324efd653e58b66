#include "fit_pairs.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

/* Nearer to the horizon than this nothing is measured and f_r cos theta says little. */
#define COS_MIN 1e-3

enum { DOUBLES = 14 }; /* per pair: wi, wo, fr_cos, log_fr, model, cos_theta_d of its group */

static bool allocate(struct fit_pairs *pairs, size_t n)
{
    *pairs = (struct fit_pairs){0};
    double *at = calloc(n, DOUBLES * sizeof *at + sizeof *pairs->group);
    if (!at) return false;
    pairs->owned = at;
    double **to[] = {&pairs->wi[0],     &pairs->wi[1],      &pairs->wi[2],     &pairs->wo[0],
                     &pairs->wo[1],     &pairs->wo[2],      &pairs->fr_cos[0], &pairs->fr_cos[1],
                     &pairs->fr_cos[2], &pairs->log_fr[0],  &pairs->log_fr[1], &pairs->log_fr[2],
                     &pairs->model,     &pairs->cos_theta_d};
    for (size_t i = 0; i < DOUBLES; i++) *to[i] = at + i * n;
    pairs->group = (size_t *)(at + DOUBLES * n);
    return true;
}

void facet_fit_pairs_clear(struct fit_pairs *pairs)
{
    free(pairs->owned);
    *pairs = (struct fit_pairs){0};
}

/* Rusinkiewicz angles to directions; false at or below the horizon. */
static bool add_pair(struct fit_pairs *pairs, double theta_h, double theta_d, double phi_d)
{
    double sh = sin(theta_h), ch = cos(theta_h), cd = cos(theta_d);
    double dx = sin(theta_d) * cos(phi_d), dy = sin(theta_d) * sin(phi_d);
    double wi[3] = {ch * dx + sh * cd, dy, ch * cd - sh * dx};
    double wo[3] = {2 * cd * sh - wi[0], -dy, 2 * cd * ch - wi[2]};
    if (wi[2] < COS_MIN || wo[2] < COS_MIN) return false;
    for (size_t k = 0; k < 3; k++) {
        pairs->wi[k][pairs->count] = wi[k];
        pairs->wo[k][pairs->count] = wo[k];
    }
    pairs->count++;
    return true;
}

static facet_vec3_in view(double *const v[3])
{
    return (facet_vec3_in){v[0], v[1], v[2]};
}

/* Ask the source; keep the pairs with data, in order. */
static facet_status ask(const facet_fit_source *source, struct fit_pairs *pairs, bool with_cos)
{
    bool *valid = calloc(pairs->count + 1, sizeof *valid);
    if (!valid) return FACET_NO_MEMORY;
    facet_status status = source->evaluate(source->user, view(pairs->wi), view(pairs->wo),
                                           pairs->count, pairs->fr_cos, valid);
    size_t kept = 0;
    bool coloured = false;
    for (size_t i = 0; status == FACET_OK && i < pairs->count; i++) {
        double *const *fr = pairs->fr_cos, cos_i = with_cos ? pairs->wi[2][i] : 1;
        if (!valid[i] || !isfinite(fr[0][i] + fr[1][i] + fr[2][i])) continue;
        coloured = coloured || fr[0][i] != fr[1][i] || fr[1][i] != fr[2][i];
        for (size_t c = 0; c < 3; c++) {
            pairs->wi[c][kept] = pairs->wi[c][i];
            pairs->wo[c][kept] = pairs->wo[c][i];
            fr[c][kept] = fmax(fr[c][i], 0) * cos_i;
            pairs->log_fr[c][kept] = log(FACET_FIT_EPSILON + fr[c][kept]);
        }
        pairs->group[kept++] = pairs->group[i];
    }
    pairs->count = kept;
    pairs->channels = coloured ? 3 : 1;
    free(valid);
    if (status == FACET_OK && kept == 0) status = FACET_BAD_DATA;
    return status;
}

facet_status facet_fit_pairs_create(const facet_fit_source *source, const struct fit_grid *grid,
                                    struct fit_pairs *pairs)
{
    if (!allocate(pairs, grid->theta_h_count * grid->theta_d_count * grid->azimuths))
        return FACET_NO_MEMORY;
    pairs->groups = grid->theta_d_count;
    for (size_t d = 0; d < grid->theta_d_count; d++) {
        pairs->cos_theta_d[d] = cos(grid->theta_d[d]);
        for (size_t h = 0; h < grid->theta_h_count; h++) {
            for (size_t k = 0; k < grid->azimuths; k++) {
                double phi_d = PI * ((double)k + 0.5) / (double)grid->azimuths;
                if (add_pair(pairs, grid->theta_h[h], grid->theta_d[d], phi_d))
                    pairs->group[pairs->count - 1] = d;
            }
        }
    }
    facet_status status = ask(source, pairs, true);
    if (status != FACET_OK) facet_fit_pairs_clear(pairs);
    return status;
}

facet_status facet_fit_pairs_backscatter(const facet_fit_source *source, const double *r, size_t n,
                                         struct fit_pairs *pairs)
{
    if (!allocate(pairs, n)) return FACET_NO_MEMORY;
    pairs->groups = 1;
    pairs->cos_theta_d[0] = 1;
    for (size_t i = 0; i < n; i++)
        if (r[i] <= source->slope_max) add_pair(pairs, atan(r[i]), 0, 0);
    facet_status status = ask(source, pairs, false);
    if (status != FACET_OK) facet_fit_pairs_clear(pairs);
    return status;
}

facet_status facet_fit_pairs_model(struct fit_pairs *pairs, const facet_material *material)
{
    facet_material plain = *material;
    facet_outputs outputs = {0};
    facet_brdf *brdf;
    plain.fresnel = (facet_fresnel){.kind = FACET_FRESNEL_IDEAL, .channels = 1};
    outputs.of[FACET_FR_COS][0] = pairs->model;
    facet_status status = facet_brdf_create(&plain, &brdf);
    if (status != FACET_OK) return status;
    status =
        facet_eval(brdf, FACET_PRECISE, view(pairs->wi), view(pairs->wo), pairs->count, &outputs);
    facet_brdf_destroy(brdf);
    return status;
}

/* ---- Fresnel ------------------------------------------------------------------------ */

/* Newton's steps on a Fresnel value, and the step that ends them. */
enum { FRESNEL_STEPS = 12 };
#define FRESNEL_STEP_MIN 1e-10
#define FRESNEL_LEAST 1e-4 /* of the largest value of a channel */

/*
 * One value F for the pairs first .. end - 1: the mean ratio of source and model
 * where the model is not tiny, then Gauss-Newton on log F.  NaN: nothing to see.
 */
static double fresnel_value(const struct fit_pairs *pairs, size_t channel, size_t first, size_t end)
{
    const double *source = pairs->fr_cos[channel], *log_source = pairs->log_fr[channel];
    double above = 0, below = 0;
    for (size_t i = first; i < end; i++) {
        double weight = 1 / (pairs->model[i] + FACET_FIT_EPSILON);
        above += source[i] * weight;
        below += pairs->model[i] * weight;
    }
    if (!(below > FACET_FIT_EPSILON)) return NAN;
    double value = above / below;
    for (int step = 0; step < FRESNEL_STEPS && value > 0; step++) {
        double slope = 0, square = 0;
        for (size_t i = first; i < end; i++) {
            double fit = value * pairs->model[i], j = fit / (FACET_FIT_EPSILON + fit);
            slope += j * (log_source[i] - log(FACET_FIT_EPSILON + fit));
            square += j * j;
        }
        if (!(square > 0)) break;
        double change = fmax(-1, fmin(1, slope / square));
        value *= exp(change);
        if (fabs(change) < FRESNEL_STEP_MIN) break;
    }
    return value;
}

/* Groups without data: from their neighbours, linear in the index; false if there are none. */
static bool fill_gaps(double *value, size_t n)
{
    size_t last = n;
    for (size_t i = 0; i < n; i++) {
        if (isnan(value[i])) continue;
        for (size_t k = last == n ? 0 : last + 1; k < i; k++) {
            double t = last == n ? 1 : (double)(k - last) / (double)(i - last);
            value[k] = last == n ? value[i] : (1 - t) * value[last] + t * value[i];
        }
        last = i;
    }
    if (last == n) return false;
    for (size_t k = last + 1; k < n; k++) value[k] = value[last];
    return true;
}

/*
 * Data that fade to 0 (a channel without light, grazing angles) say "dark", not
 * "black": next to a node of 0 no relative error could be promised for F.
 */
static void keep_above_zero(double *value, size_t n)
{
    double largest = 0;
    for (size_t i = 0; i < n; i++) largest = fmax(largest, value[i]);
    for (size_t i = 0; i < n; i++) value[i] = fmax(value[i], FRESNEL_LEAST * largest);
}

bool facet_fit_fresnel_table(const struct fit_pairs *pairs, double *const values[3])
{
    for (size_t c = 0; c < pairs->channels; c++) {
        size_t first = 0;
        for (size_t g = 0; g < pairs->groups; g++) {
            size_t end = first;
            while (end < pairs->count && pairs->group[end] == g) end++;
            values[c][g] = fresnel_value(pairs, c, first, end);
            first = end;
        }
        if (!fill_gaps(values[c], pairs->groups)) return false;
        keep_above_zero(values[c], pairs->groups);
    }
    return true;
}

static double schlick(double cos_theta_d)
{
    double q = 1 - cos_theta_d;
    return q * q * q * q * q;
}

void facet_fit_fresnel_schlick(const struct fit_pairs *pairs, double *const values[3], double f0[3])
{
    for (size_t c = 0; c < pairs->channels; c++) {
        double above = 0, below = 0; /* least squares on the table: F - s = f0 (1 - s) */
        for (size_t g = 0; g < pairs->groups; g++) {
            double s = schlick(pairs->cos_theta_d[g]);
            above += (values[c][g] - s) * (1 - s);
            below += (1 - s) * (1 - s);
        }
        f0[c] = fmax(0, fmin(1, above / below));
        for (int step = 0; step < FRESNEL_STEPS; step++) {
            double slope = 0, square = 0, before = f0[c];
            for (size_t i = 0; i < pairs->count; i++) {
                double s = schlick(pairs->cos_theta_d[pairs->group[i]]);
                double fit = FACET_FIT_EPSILON + (f0[c] + (1 - f0[c]) * s) * pairs->model[i];
                double j = (1 - s) * pairs->model[i] / fit;
                slope += j * (pairs->log_fr[c][i] - log(fit));
                square += j * j;
            }
            if (!(square > 0)) break;
            f0[c] = fmax(f0[c] / 4, fmin(1, f0[c] + slope / square));
            if (fabs(f0[c] - before) < FRESNEL_STEP_MIN) break;
        }
    }
}

double facet_fit_residual(const struct fit_pairs *pairs, double *const values[3])
{
    double sum = 0;
    for (size_t c = 0; c < pairs->channels; c++) {
        for (size_t i = 0; i < pairs->count; i++) {
            double fit = values[c][pairs->group[i]] * pairs->model[i];
            double d = pairs->log_fr[c][i] - log(FACET_FIT_EPSILON + fit);
            sum += d * d;
        }
    }
    return sum;
}

/* ---- Errors ---------------------------------------------------------------------------- */

/* The quantity of a material in as many channels as the pairs have; room must be freed by the
 * caller. */
static facet_status evaluate(const struct fit_pairs *pairs, const facet_material *material,
                             facet_quantity quantity, double *out[3], double **room)
{
    facet_outputs outputs = {0};
    facet_brdf *brdf = NULL;
    size_t channels = material->fresnel.channels;
    *room = calloc(pairs->count, channels * sizeof **room);
    if (!*room) return FACET_NO_MEMORY;
    for (size_t c = 0; c < 3; c++) {
        out[c] = *room + (c < channels ? c : 0) * pairs->count;
        if (c < channels) outputs.of[quantity][c] = out[c];
    }
    facet_status status = facet_brdf_create(material, &brdf);
    if (status == FACET_OK)
        status = facet_eval(brdf, FACET_PRECISE, view(pairs->wi), view(pairs->wo), pairs->count,
                            &outputs);
    facet_brdf_destroy(brdf);
    return status;
}

facet_status facet_fit_rms_log(const struct fit_pairs *pairs, const facet_material *material,
                               double *rms_log)
{
    double *fit[3], *room, sum = 0;
    facet_status status = evaluate(pairs, material, FACET_FR_COS, fit, &room);
    for (size_t c = 0; status == FACET_OK && c < 3; c++) {
        for (size_t i = 0; i < pairs->count; i++) {
            double d = pairs->log_fr[c][i] - log(FACET_FIT_EPSILON + fit[c][i]);
            sum += d * d;
        }
    }
    *rms_log = sqrt(sum / (3 * (double)pairs->count));
    free(room);
    return status;
}

facet_status facet_fit_backscatter_max(const struct fit_pairs *pairs,
                                       const facet_material *material, double *error)
{
    double *fit[3], *room;
    facet_status status = evaluate(pairs, material, FACET_FR, fit, &room);
    *error = 0;
    for (size_t c = 0; status == FACET_OK && c < 3; c++) {
        double peak = 0;
        for (size_t i = 0; i < pairs->count; i++) peak = fmax(peak, pairs->fr_cos[c][i]);
        for (size_t i = 0; i < pairs->count; i++)
            if (pairs->fr_cos[c][i] > 1e-4 * peak)
                *error = fmax(*error, fabs(fit[c][i] / pairs->fr_cos[c][i] - 1));
    }
    free(room);
    return status;
}
