#include "fit_pairs.h"

#include <math.h>
#include <stdlib.h>

/* Nearer to the horizon than this nothing is measured and f_r cos theta says little. */
#define COS_MIN 1e-3

/* per pair: wi, wo, fr_cos, log_fr, model, slopes, schlick, cos_theta_d of its group */
enum { DOUBLES = 15 + FIT_SHAPES_MAX };

static bool allocate(struct fit_pairs *pairs, size_t n)
{
    *pairs = (struct fit_pairs){0};
    double *at = calloc(n, DOUBLES * sizeof *at + sizeof *pairs->group);
    if (!at) return false;
    pairs->owned = at;
    double **to[] = {&pairs->wi[0],     &pairs->wi[1],      &pairs->wi[2],     &pairs->wo[0],
                     &pairs->wo[1],     &pairs->wo[2],      &pairs->fr_cos[0], &pairs->fr_cos[1],
                     &pairs->fr_cos[2], &pairs->log_fr[0],  &pairs->log_fr[1], &pairs->log_fr[2],
                     &pairs->model,     &pairs->slope[0],   &pairs->slope[1],  &pairs->slope[2],
                     &pairs->schlick,   &pairs->cos_theta_d};
    for (size_t i = 0; i < DOUBLES; i++) *to[i] = at + i * n;
    pairs->group = (size_t *)(at + DOUBLES * n);
    return true;
}

void facet_fit_pairs_clear(struct fit_pairs *pairs)
{
    free(pairs->owned);
    *pairs = (struct fit_pairs){0};
}

static bool is_above(double cos_i, double cos_o)
{
    return cos_i >= COS_MIN && cos_o >= COS_MIN;
}

static bool add(struct fit_pairs *pairs, const double wi[3], const double wo[3])
{
    if (!is_above(wi[2], wo[2])) return false;
    for (size_t k = 0; k < 3; k++) {
        pairs->wi[k][pairs->count] = wi[k];
        pairs->wo[k][pairs->count] = wo[k];
    }
    pairs->count++;
    return true;
}

/* Rusinkiewicz angles to directions; false at or below the horizon. */
static bool add_pair(struct fit_pairs *pairs, double theta_h, double phi_h, double theta_d,
                     double phi_d)
{
    double sh = sin(theta_h), ch = cos(theta_h), cd = cos(theta_d);
    double dx = sin(theta_d) * cos(phi_d), dy = sin(theta_d) * sin(phi_d);
    double wi[3] = {ch * dx + sh * cd, dy, ch * cd - sh * dx};
    double wo[3] = {2 * cd * sh - wi[0], -dy, 2 * cd * ch - wi[2]};
    if (phi_h != 0) {
        double c = cos(phi_h), s = sin(phi_h), x = wi[0], y = wi[1];
        wi[0] = c * x - s * y, wi[1] = s * x + c * y;
        x = wo[0], y = wo[1];
        wo[0] = c * x - s * y, wo[1] = s * x + c * y;
    }
    return add(pairs, wi, wo);
}

static facet_vec3_in view(double *const v[3])
{
    return (facet_vec3_in){v[0], v[1], v[2]};
}

/* Keep the pairs with data, in order; what else is known of each. */
static facet_status keep(struct fit_pairs *pairs, const bool *valid, bool with_cos)
{
    size_t kept = 0;
    bool coloured = false;
    for (size_t i = 0; i < pairs->count; i++) {
        double *const *fr = pairs->fr_cos, cos_i = with_cos ? pairs->wi[2][i] : 1, length = 0;
        if (!valid[i] || !isfinite(fr[0][i] + fr[1][i] + fr[2][i])) continue;
        coloured = coloured || fr[0][i] != fr[1][i] || fr[1][i] != fr[2][i];
        for (size_t c = 0; c < 3; c++) {
            pairs->wi[c][kept] = pairs->wi[c][i];
            pairs->wo[c][kept] = pairs->wo[c][i];
            double h = pairs->wi[c][kept] + pairs->wo[c][kept];
            length += h * h;
            fr[c][kept] = fmax(fr[c][i], 0) * cos_i;
            pairs->log_fr[c][kept] = log(FACET_FIT_EPSILON + fr[c][kept]);
        }
        pairs->schlick[kept] = pow(1 - fmin(sqrt(length) / 2, 1), 5);
        pairs->group[kept++] = pairs->group[i];
    }
    pairs->count = kept;
    pairs->channels = coloured ? 3 : 1;
    return kept ? FACET_OK : FACET_BAD_DATA;
}

static facet_status ask(const facet_fit_source *source, struct fit_pairs *pairs, bool with_cos)
{
    bool *valid = calloc(pairs->count + 1, sizeof *valid);
    if (!valid) return FACET_NO_MEMORY;
    facet_status status = source->evaluate(source->user, view(pairs->wi), view(pairs->wo),
                                           pairs->count, pairs->fr_cos, valid);
    if (status == FACET_OK) status = keep(pairs, valid, with_cos);
    free(valid);
    return status;
}

facet_status facet_fit_pairs_create(const facet_fit_source *source, const struct fit_grid *grid,
                                    struct fit_pairs *pairs)
{
    size_t n = grid->theta_h_count * grid->theta_d_count * grid->azimuths * grid->turns;
    double circle = grid->turns > 1 ? 2 * FACET_PI : FACET_PI;
    if (!allocate(pairs, n)) return FACET_NO_MEMORY;
    pairs->groups = grid->theta_d_count;
    for (size_t d = 0; d < grid->theta_d_count; d++) {
        pairs->cos_theta_d[d] = cos(grid->theta_d[d]);
        for (size_t h = 0; h < grid->theta_h_count; h++) {
            for (size_t k = 0; k < grid->azimuths * grid->turns; k++) {
                size_t turn = k / grid->azimuths;
                double phi_d = circle * ((double)(k % grid->azimuths) + 0.5) /
                               (double)grid->azimuths;
                /* turned by a part of the step from one theta_h to the next: no axis is missed */
                double phi_h = grid->turns > 1
                                   ? 2 * FACET_PI * ((double)turn + (double)(h % 3) / 3) /
                                         (double)grid->turns
                                   : 0;
                double theta_h = grid->theta_h_of ? grid->theta_h_of(grid->user, h, phi_h)
                                                  : grid->theta_h[h];
                if (add_pair(pairs, theta_h, phi_h, grid->theta_d[d], phi_d))
                    pairs->group[pairs->count - 1] = d;
            }
        }
    }
    facet_status status = ask(source, pairs, true);
    if (status != FACET_OK) facet_fit_pairs_clear(pairs);
    return status;
}

bool facet_fit_sample_is_used(const facet_fit_samples *s, size_t i)
{
    return is_above(s->wi.z[i], s->wo.z[i]) && isfinite(s->fr[0][i] + s->fr[1][i] + s->fr[2][i]);
}

/* theta_d of a pair: |wi + wo| = 2 cos theta_d. */
static double difference_angle(const facet_fit_samples *s, size_t i)
{
    double x = s->wi.x[i] + s->wo.x[i], y = s->wi.y[i] + s->wo.y[i], z = s->wi.z[i] + s->wo.z[i];
    return acos(fmin(sqrt(x * x + y * y + z * z) / 2, 1));
}

facet_status facet_fit_pairs_samples(const facet_fit_samples *samples, size_t groups,
                                     struct fit_pairs *pairs)
{
    size_t n = samples->count;
    if (n == 0) return FACET_BAD_DATA;
    if (!allocate(pairs, n > groups ? n : groups)) return FACET_NO_MEMORY;
    bool *valid = calloc(n, sizeof *valid + 1);
    unsigned char *own = valid ? (unsigned char *)(valid + n) : NULL; /* group of each sample */
    pairs->groups = groups;
    for (size_t g = 0; g < groups; g++)
        pairs->cos_theta_d[g] = cos(FACET_PI / 2 * ((double)g + 0.5) / (double)groups);
    for (size_t i = 0; valid && i < n; i++) {
        size_t g = (size_t)(difference_angle(samples, i) / (FACET_PI / 2) * (double)groups);
        own[i] = (unsigned char)(g < groups ? g : groups - 1);
    }
    for (size_t g = 0; valid && g < groups; g++) { /* group after group, as the others are */
        for (size_t i = 0; i < n; i++) {
            if (own[i] != g) continue;
            double wi[3] = {samples->wi.x[i], samples->wi.y[i], samples->wi.z[i]},
                   wo[3] = {samples->wo.x[i], samples->wo.y[i], samples->wo.z[i]};
            if (!facet_fit_sample_is_used(samples, i)) continue;
            add(pairs, wi, wo);
            for (size_t c = 0; c < 3; c++) pairs->fr_cos[c][pairs->count - 1] = samples->fr[c][i];
            valid[pairs->count - 1] = true;
            pairs->group[pairs->count - 1] = g;
        }
    }
    facet_status status = valid ? keep(pairs, valid, true) : FACET_NO_MEMORY;
    free(valid);
    if (status != FACET_OK) facet_fit_pairs_clear(pairs);
    return status;
}

facet_status facet_fit_pairs_backscatter(const facet_fit_source *source, const double *r, size_t n,
                                         size_t turns, struct fit_pairs *pairs)
{
    if (!allocate(pairs, n * turns)) return FACET_NO_MEMORY;
    pairs->groups = 1;
    pairs->cos_theta_d[0] = 1;
    for (size_t t = 0; t < turns; t++)
        for (size_t i = 0; i < n; i++)
            if (r[i] <= source->slope_max)
                add_pair(pairs, atan(r[i]), 2 * FACET_PI * (double)t / (double)turns, 0, 0);
    facet_status status = ask(source, pairs, false);
    if (status != FACET_OK) facet_fit_pairs_clear(pairs);
    return status;
}

static bool are_near(const facet_fit_samples *s, size_t i)
{
    static const double near = 0.9945218953682733; /* cos 6 degrees */
    return s->wi.x[i] * s->wo.x[i] + s->wi.y[i] * s->wo.y[i] + s->wi.z[i] * s->wo.z[i] >= near;
}

facet_status facet_fit_pairs_near(const facet_fit_samples *samples, struct fit_pairs *pairs)
{
    size_t n = samples->count, count = 1;
    for (size_t i = 0; i < n; i++) count += are_near(samples, i);
    bool *valid = calloc(count, sizeof *valid);
    if (!valid || !allocate(pairs, count)) {
        free(valid);
        return FACET_NO_MEMORY;
    }
    pairs->groups = 1;
    pairs->cos_theta_d[0] = 1;
    for (size_t i = 0; i < n; i++) {
        double wi[3] = {samples->wi.x[i], samples->wi.y[i], samples->wi.z[i]},
               wo[3] = {samples->wo.x[i], samples->wo.y[i], samples->wo.z[i]};
        if (!are_near(samples, i) || !add(pairs, wi, wo)) continue;
        for (size_t c = 0; c < 3; c++) pairs->fr_cos[c][pairs->count - 1] = samples->fr[c][i];
        valid[pairs->count - 1] = true;
    }
    keep(pairs, valid, false);
    free(valid);
    return FACET_OK;
}

facet_status facet_fit_pairs_thin(const struct fit_pairs *from, size_t stride,
                                  struct fit_pairs *pairs)
{
    size_t n = (from->count + stride - 1) / stride;
    if (!allocate(pairs, n > from->groups ? n : from->groups)) return FACET_NO_MEMORY;
    pairs->groups = from->groups;
    pairs->channels = from->channels;
    for (size_t g = 0; g < from->groups; g++) pairs->cos_theta_d[g] = from->cos_theta_d[g];
    for (size_t i = 0; i < from->count; i += stride) {
        size_t to = pairs->count++;
        for (size_t c = 0; c < 3; c++) {
            pairs->wi[c][to] = from->wi[c][i];
            pairs->wo[c][to] = from->wo[c][i];
            pairs->fr_cos[c][to] = from->fr_cos[c][i];
            pairs->log_fr[c][to] = from->log_fr[c][i];
        }
        pairs->schlick[to] = from->schlick[i];
        pairs->group[to] = from->group[i];
    }
    return FACET_OK;
}

facet_status facet_fit_pairs_model(const struct fit_pairs *pairs, const facet_material *material,
                                   double *out)
{
    facet_material plain = *material;
    facet_outputs outputs = {0};
    facet_brdf *brdf;
    plain.fresnel = (facet_fresnel){.kind = FACET_FRESNEL_IDEAL, .channels = 1};
    outputs.of[FACET_FR_COS][0] = out;
    facet_status status = facet_brdf_create(&plain, &brdf);
    if (status != FACET_OK) return status;
    status = facet_eval(brdf, FACET_PRECISE, view(pairs->wi), view(pairs->wo), pairs->count,
                        &outputs);
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
static double fresnel_value(const struct fit_pairs *pairs, size_t channel, double kd, size_t first,
                            size_t end)
{
    const double *source = pairs->fr_cos[channel], *log_source = pairs->log_fr[channel];
    double above = 0, below = 0;
    for (size_t i = first; i < end; i++) {
        double model = (1 - kd) * pairs->model[i], weight = 1 / (model + FACET_FIT_EPSILON);
        above += (source[i] - kd / FACET_PI * pairs->wi[2][i]) * weight;
        below += model * weight;
    }
    if (!(below > FACET_FIT_EPSILON)) return NAN;
    double value = fmax(above / below, kd > 0 ? 1e-6 : 0);
    for (int step = 0; step < FRESNEL_STEPS && value > 0; step++) {
        double slope = 0, square = 0;
        for (size_t i = first; i < end; i++) {
            double fit = value * (1 - kd) * pairs->model[i];
            double total = FACET_FIT_EPSILON + fit + kd / FACET_PI * pairs->wi[2][i],
                   j = fit / total;
            slope += j * (log_source[i] - log(total));
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

bool facet_fit_fresnel_table(const struct fit_pairs *pairs, const double kd[3],
                             double *const values[3])
{
    for (size_t c = 0; c < pairs->channels; c++) {
        size_t first = 0;
        for (size_t g = 0; g < pairs->groups; g++) {
            size_t end = first;
            while (end < pairs->count && pairs->group[end] == g) end++;
            values[c][g] = fresnel_value(pairs, c, kd[c], first, end);
            first = end;
        }
        if (!fill_gaps(values[c], pairs->groups)) return false;
        keep_above_zero(values[c], pairs->groups);
    }
    return true;
}

double facet_fit_residual(const struct fit_pairs *pairs, const double kd[3],
                          double *const values[3])
{
    double sum = 0;
    for (size_t c = 0; c < pairs->channels; c++) {
        for (size_t i = 0; i < pairs->count; i++) {
            double fit = values[c][pairs->group[i]] * (1 - kd[c]) * pairs->model[i] +
                         kd[c] / FACET_PI * pairs->wi[2][i];
            double d = pairs->log_fr[c][i] - log(FACET_FIT_EPSILON + fit);
            sum += d * d;
        }
    }
    return sum;
}

/* ---- Errors ---------------------------------------------------------------------------- */

/* One channel: Gauss-Newton in kd, which is unimodal. */
static double flat_square(const struct fit_pairs *pairs, const double *log_fr, double *kd)
{
    enum { STEPS = 12 };
    double square = 0;
    *kd = 0.5;
    for (int step = 0; step <= STEPS; step++) {
        double slope = 0, bend = 0;
        square = 0;
        for (size_t i = 0; i < pairs->count; i++) {
            double g = pairs->wi[2][i] / FACET_PI, y = FACET_FIT_EPSILON + *kd * g;
            double d = log_fr[i] - log(y), j = g / y;
            square += d * d;
            slope += j * d;
            bend += j * j;
        }
        if (step == STEPS || !(bend > 0)) break;
        /* The residual is concave in kd: not down by more than 10 in a step. */
        *kd = fmin(fmax(*kd + slope / bend, 0.1 * *kd), 1);
    }
    return square;
}

double facet_fit_flat_rms(const struct fit_pairs *pairs, double kd[3])
{
    double sum = 0;
    for (size_t c = 0; c < 3; c++) sum += flat_square(pairs, pairs->log_fr[c], &kd[c]);
    return sqrt(sum / (3 * (double)pairs->count));
}

/*
 * f_r (with_cos: times cos theta_i) of a candidate at the pairs, in as many
 * channels as it has: out[c] of three; room must be freed by the caller.
 */
static facet_status evaluate(const struct fit_pairs *pairs, const facet_fit_candidate *candidate,
                             bool with_cos, double *out[3], double **room)
{
    facet_outputs outputs = {0};
    facet_brdf *brdf = NULL;
    size_t channels = candidate->material.fresnel.channels, n = pairs->count;
    *room = calloc(n + 1, 3 * sizeof **room);
    if (!*room) return FACET_NO_MEMORY;
    for (size_t c = 0; c < 3; c++) {
        out[c] = *room + c * n;
        if (c < channels) outputs.of[with_cos ? FACET_FR_COS : FACET_FR][c] = out[c];
    }
    facet_status status = facet_brdf_create(&candidate->material, &brdf);
    if (status == FACET_OK)
        status = facet_eval(brdf, FACET_PRECISE, view(pairs->wi), view(pairs->wo), n, &outputs);
    facet_brdf_destroy(brdf);
    for (size_t c = 3; status == FACET_OK && c-- > 0;) {
        double kd = candidate->has_diffuse ? candidate->diffuse[c] : 0;
        for (size_t i = 0; i < n; i++)
            out[c][i] = (1 - kd) * out[c < channels ? c : 0][i] +
                        kd / FACET_PI * (with_cos ? pairs->wi[2][i] : 1);
    }
    return status;
}

static void backscatter_max(const struct fit_pairs *pairs, double *const fit[3],
                            facet_fit_error *error)
{
    error->backscatter_max = 0;
    for (size_t c = 0; c < 3; c++) {
        double peak = 0;
        for (size_t i = 0; i < pairs->count; i++) peak = fmax(peak, pairs->fr_cos[c][i]);
        for (size_t i = 0; i < pairs->count; i++)
            if (pairs->fr_cos[c][i] > 1e-4 * peak)
                error->backscatter_max = fmax(error->backscatter_max,
                                              fabs(fit[c][i] / pairs->fr_cos[c][i] - 1));
    }
}

static void rms_log(const struct fit_pairs *pairs, double *const fit[3], facet_fit_error *error)
{
    double sum = 0, n = (double)pairs->count;
    for (size_t c = 0; c < 3; c++) {
        double own = 0;
        for (size_t i = 0; i < pairs->count; i++) {
            double d = pairs->log_fr[c][i] - log(FACET_FIT_EPSILON + fit[c][i]);
            own += d * d;
            if (!(fabs(d) > error->worst)) continue;
            error->worst = fabs(d);
            for (size_t k = 0; k < 3; k++) {
                error->worst_wi[k] = pairs->wi[k][i];
                error->worst_wo[k] = pairs->wo[k][i];
            }
        }
        error->channel[c] = sqrt(own / n);
        sum += own;
    }
    error->rms_log = sqrt(sum / (3 * n));
}

facet_status facet_fit_error_of(const struct fit_pairs *pairs, const struct fit_pairs *backscatter,
                                facet_fit_candidate *candidate)
{
    double *fit[3], *room;
    facet_fit_error *error = &candidate->error;
    *error = (facet_fit_error){.worst = -1, .backscatter_max = NAN};
    facet_status status = evaluate(pairs, candidate, true, fit, &room);
    if (status == FACET_OK) rms_log(pairs, fit, error);
    free(room);
    if (status != FACET_OK || backscatter->count == 0) return status;
    status = evaluate(backscatter, candidate, false, fit, &room);
    if (status == FACET_OK) backscatter_max(backscatter, fit, error);
    free(room);
    return status;
}

facet_status facet_fit_hot_spot(const struct fit_pairs *pairs, const facet_fit_candidate *candidate,
                                double *mean)
{
    static const double near = 0.342020143325669, far = 0.965925826289068; /* cos 70, cos 15 deg */
    double *fit[3], *room, sum = 0, count = 0;
    *mean = NAN;
    if (pairs->count == 0) return FACET_OK;
    facet_status status = evaluate(pairs, candidate, false, fit, &room);
    for (size_t c = 0; status == FACET_OK && c < 3; c++) {
        for (size_t i = 0; i < pairs->count; i++) {
            if (pairs->wi[2][i] < near || pairs->wi[2][i] > far) continue;
            sum += log((FACET_FIT_EPSILON + pairs->fr_cos[c][i]) / (FACET_FIT_EPSILON + fit[c][i]));
            count++;
        }
    }
    if (count > 0) *mean = sum / count;
    free(room);
    return status;
}
