#include "fit_turn.h"

#include "fit_backscatter.h"
#include "gauss.h"
#include "watch.h"

#include <math.h>
#include <stdlib.h>

#define LOG_ZERO (-1000.0)
#define SLOPE_HORIZON 1e6
/* The nodes of the azimuth leave more than this anyway. */
#define CHANGE_MIN 1e-7

/* ---- Backscatter ------------------------------------------------------------------------ */

/*
 * f_r(o,o) at slopes (x, y) of the normal, o along it; where there are no data
 * the nearest known slope on the same ray, f_r cos theta kept (D constant).
 */
static facet_status backscatter(const facet_fit_source *source, const double *x, const double *y,
                                size_t n, double *fr)
{
    double *at = malloc(n * (6 * sizeof *at + sizeof(bool)));
    if (!at) return FACET_NO_MEMORY;
    double *out[3] = {at + 3 * n, at + 4 * n, at + 5 * n};
    bool *valid = (bool *)(at + 6 * n);
    double known = fmin(source->slope_max, SLOPE_HORIZON);
    for (size_t i = 0; i < n; i++) {
        double r = hypot(x[i], y[i]), shrink = r > known ? known / r : 1;
        double z = 1 / sqrt(1 + r * shrink * r * shrink);
        at[i] = x[i] * shrink * z, at[n + i] = y[i] * shrink * z, at[2 * n + i] = z;
    }
    facet_vec3_in o = {at, at + n, at + 2 * n};
    facet_status status = source->evaluate(source->user, o, o, n, out, valid);
    for (size_t i = 0; status == FACET_OK && i < n; i++) {
        double r = hypot(x[i], y[i]), sum = 0;
        for (size_t c = 0; c < 3; c++) sum += fmax(out[c][i], 0) / 3;
        fr[i] = valid[i] ? sum * sqrt((1 + r * r) * at[2 * n + i] * at[2 * n + i]) : 0;
        if (!isfinite(fr[i])) status = FACET_BAD_DATA;
    }
    free(at);
    return status;
}

/* 1/(F0 P) of the rest of the equation, by azimuth difference: as ring_cosine, not yet summed. */
static double facing(facet_fit_convention convention, double t)
{
    double facing = fmax(0, 1 + t);
    return convention == FACET_FIT_CORRELATED ? 2 * facing - 1 : facing;
}

static double plain_sum(facet_masking masking, double r)
{
    double s = 1 + r * r;
    return masking == FACET_VGROOVE ? fmax(1, s / 2) : s;
}

/* ---- Iteration ---------------------------------------------------------------------------- */

struct room {
    double *gain;   /* [radius][turn] */
    double *kernel; /* [radius][radius][difference of turns] */
    double *twice;  /* weight p, each radius twice over: no wrap within the sums */
    double *next;
};

static void fill_kernel(const struct fit_turn *t, facet_fit_convention convention, double *kernel)
{
    for (size_t i = 0; i < t->radii; i++)
        for (size_t k = 0; k < t->radii; k++)
            for (size_t d = 0; d < t->turns; d++)
                *kernel++ = facing(convention,
                                   t->r[i] * t->r[k] *
                                       cos(2 * FACET_PI * (double)d / (double)t->turns));
}

/* next = gain (K weight p) */
static void apply(const struct fit_turn *t, const struct room *room)
{
    size_t n = t->turns;
    for (size_t k = 0; k < t->radii; k++)
        for (size_t j = 0; j < 2 * n; j++)
            room->twice[2 * n * k + j] = t->weight[k] * t->p[n * k + j % n];
    for (size_t i = 0; i < t->radii; i++) {
        double *next = room->next + n * i;
        for (size_t j = 0; j < n; j++) next[j] = 0;
        for (size_t k = 0; k < t->radii; k++) {
            const double *row = room->kernel + n * (t->radii * i + k);
            for (size_t d = 0; d < n; d++) {
                const double *q = room->twice + 2 * n * k + d, factor = row[d];
                for (size_t j = 0; j < n; j++) next[j] += factor * q[j];
            }
        }
        for (size_t j = 0; j < n; j++) next[j] *= room->gain[n * i + j];
    }
}

/* p = next normalised; the largest relative change. */
static double take(struct fit_turn *t, const double *next)
{
    double norm = 0, peak = 0, worst = 0;
    for (size_t i = 0; i < t->radii; i++)
        for (size_t j = 0; j < t->turns; j++) norm += t->weight[i] * next[t->turns * i + j];
    for (size_t m = 0; m < t->radii * t->turns; m++) peak = fmax(peak, next[m] / norm);
    for (size_t m = 0; m < t->radii * t->turns; m++) {
        double p = next[m] / norm;
        if (p > 1e-6 * peak) worst = fmax(worst, fabs(t->p[m] / p - 1));
        t->p[m] = p;
    }
    t->f0 = norm;
    return worst;
}

static facet_status iterate(struct fit_turn *t, const struct room *room, const facet_watch *watch)
{
    enum { STEPS = 60 };
    for (int step = 0; step < STEPS; step++) {
        if (facet_is_cancelled(watch)) return FACET_CANCELLED;
        apply(t, room);
        double change = take(t, room->next);
        if (!isfinite(t->f0) || t->f0 <= 0) return FACET_BAD_DATA;
        if (change < CHANGE_MIN) return FACET_OK;
    }
    return FACET_OK; /* slow for rough GGX: what is left is below the error of the nodes */
}

static facet_status ask(const facet_fit_source *source, struct fit_turn *t, double *gain)
{
    size_t n = t->radii * t->turns;
    double *x = calloc(2 * n, sizeof *x), *y = x + n;
    if (!x) return FACET_NO_MEMORY;
    for (size_t m = 0; m < n; m++) {
        double phi = 2 * FACET_PI * (double)(m % t->turns) / (double)t->turns,
               r = t->r[m / t->turns];
        x[m] = r * cos(phi), y[m] = r * sin(phi);
    }
    facet_status status = backscatter(source, x, y, n, gain);
    for (size_t m = 0; m < n; m++) gain[m] = facet_fit_gain(t->r[m / t->turns], gain[m]);
    free(x);
    return status;
}

static facet_status solve(const facet_fit_source *source, facet_masking masking,
                          facet_fit_convention convention, const facet_watch *watch,
                          struct fit_turn *t, struct room *room)
{
    size_t n = t->radii * t->turns;
    facet_status status = ask(source, t, room->gain);
    if (status != FACET_OK) return status;
    if (masking != FACET_SMITH) {
        for (size_t m = 0; m < n; m++)
            room->next[m] = room->gain[m] * plain_sum(masking, t->r[m / t->turns]);
        take(t, room->next);
        return isfinite(t->f0) && t->f0 > 0 ? FACET_OK : FACET_BAD_DATA;
    }
    fill_kernel(t, convention, room->kernel);
    for (size_t m = 0; m < n; m++) t->p[m] = 1;
    return iterate(t, room, watch);
}

facet_status facet_fit_turn_create(const facet_fit_source *source, facet_masking masking,
                                   facet_fit_convention convention, double scale, size_t radii,
                                   size_t turns, const facet_watch *watch, struct fit_turn *turn)
{
    size_t n = radii * turns;
    *turn = (struct fit_turn){.scale = scale, .radii = radii, .turns = turns};
    double *own = calloc(2 * radii + n, sizeof *own);
    double *work = malloc((radii * n + 4 * n) * sizeof *work);
    facet_status status = own && work ? FACET_OK : FACET_NO_MEMORY;
    turn->owned = own;
    if (status == FACET_OK) {
        turn->r = own, turn->weight = own + radii, turn->p = own + 2 * radii;
        facet_gauss_legendre(radii, turn->r, turn->weight);
        for (size_t j = 0; j < radii; j++) { /* r dr = b^2 u/(1-u)^3 du */
            double u = turn->r[j], q = 1 - u;
            turn->r[j] = scale * u / q;
            turn->weight[j] *= 2 * FACET_PI / (double)turns * scale * scale * u / (q * q * q);
        }
        struct room room = {work, work + n, work + n + radii * n, work + 3 * n + radii * n};
        status = solve(source, masking, convention, watch, turn, &room);
    }
    free(work);
    if (status != FACET_OK) facet_fit_turn_clear(turn);
    return status;
}

void facet_fit_turn_clear(struct fit_turn *turn)
{
    free(turn->owned);
    *turn = (struct fit_turn){0};
}

/* ---- Roughness ------------------------------------------------------------------------------ */

/* E|x~ cos a + y~ sin a| */
static double mean_along(const struct fit_turn *t, double a)
{
    double sum = 0;
    for (size_t i = 0; i < t->radii; i++)
        for (size_t j = 0; j < t->turns; j++)
            sum += t->weight[i] * t->p[t->turns * i + j] * t->r[i] *
                   fabs(cos(2 * FACET_PI * (double)j / (double)t->turns - a));
    return sum;
}

facet_roughness facet_fit_turn_roughness(const struct fit_turn *turn, facet_ndf ndf)
{
    /* E|x| of the standard distributions: 1 (GGX), 1/sqrt(pi) (Beckmann) */
    double unit = ndf == FACET_GGX ? 1 : 1 / sqrt(FACET_PI), square[4];
    for (int k = 0; k < 4; k++) {
        double mean = mean_along(turn, FACET_PI / 4 * k) / unit;
        square[k] = mean * mean; /* alpha^2 along that axis: a quadratic form */
    }
    /* its three coefficients from four axes, by least squares */
    double mean = (square[0] + square[1] + square[2] + square[3]) / 4;
    double xx = mean + (square[0] - square[2]) / 2, yy = mean - (square[0] - square[2]) / 2;
    double xy = (square[1] - square[3]) / 2;
    xx = fmax(xx, 1e-3 * mean), yy = fmax(yy, 1e-3 * mean);
    double ax = sqrt(xx), ay = sqrt(yy), rho = fmax(-0.99, fmin(0.99, xy / (ax * ay)));
    return (facet_roughness){.alpha_x = ax, .alpha_y = ay, .rho = rho};
}

/* ---- Table ---------------------------------------------------------------------------------- */

/* The sum of the equation at a slope (x, y) that need not be a node. */
static double masked_sum(const struct fit_turn *t, facet_fit_convention convention, double x,
                         double y)
{
    double sum = 0;
    for (size_t j = 0; j < t->turns; j++) {
        double phi = 2 * FACET_PI * (double)j / (double)t->turns,
               along = x * cos(phi) + y * sin(phi);
        for (size_t i = 0; i < t->radii; i++)
            sum += t->weight[i] * t->p[t->turns * i + j] * facing(convention, along * t->r[i]);
    }
    return sum;
}

/* Where a table is asked for. */
struct place {
    const facet_fit_source *source;
    facet_masking masking;
    facet_fit_convention convention;
    const struct fit_turn *turn;
    facet_roughness roughness;
};

enum { AZIMUTHS = 16 };

/* The mean of P over count <= AZIMUTHS azimuths, evenly spaced from `first` on, at standard slopes
 * s. */
static facet_status mean_density(const struct place *at, double s, double first, int count,
                                 double *p)
{
    double x[AZIMUTHS], y[AZIMUTHS], fr[AZIMUTHS];
    const facet_roughness *a = &at->roughness;
    double kappa = sqrt((1 - a->rho) * (1 + a->rho)), det = a->alpha_x * a->alpha_y * kappa;
    for (int k = 0; k < count; k++) {
        double phi = first + 2 * FACET_PI * k / count, sx = s * cos(phi), sy = s * sin(phi);
        x[k] = a->alpha_x * sx, y[k] = a->alpha_y * (a->rho * sx + kappa * sy);
    }
    facet_status status = backscatter(at->source, x, y, (size_t)count, fr);
    *p = 0;
    for (int k = 0; k < count && status == FACET_OK; k++) {
        double r = hypot(x[k], y[k]);
        double sum = at->masking == FACET_SMITH ? masked_sum(at->turn, at->convention, x[k], y[k])
                                                : plain_sum(at->masking, r);
        *p += facet_fit_gain(r, fr[k]) * sum * det / (at->turn->f0 * count);
    }
    return status;
}

facet_status facet_fit_turn_table(const facet_fit_source *source, facet_masking masking,
                                  facet_fit_convention convention, const struct fit_turn *turn,
                                  const facet_roughness *roughness, double scale, size_t n,
                                  size_t rows, double *log_d)
{
    const struct place at = {source, masking, convention, turn, *roughness};
    for (size_t k = 0; k < rows * n; k++) {
        size_t i = k % n, row = k / n;
        double u = (double)i / (double)(n - 1), s = fmin(scale * u / (1 - u), SLOPE_HORIZON), p;
        double first = rows > 1 ? FACET_PI * (double)row / (double)rows : FACET_PI / AZIMUTHS;
        facet_status status = mean_density(&at, s, first, rows > 1 ? 2 : AZIMUTHS, &p);
        if (status != FACET_OK) return status;
        log_d[k] = p > 0 ? fmax(log(p) + 2 * log1p(s * s), LOG_ZERO) : LOG_ZERO;
        if (i == 0) log_d[k] = log_d[0]; /* the normal has no azimuth */
    }
    return FACET_OK;
}
