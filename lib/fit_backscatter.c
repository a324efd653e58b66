#include "fit_backscatter.h"

#include "gauss.h"
#include "minimize.h"

#include <math.h>
#include <stdlib.h>

/* What a slope table takes as log 0, and JSON can carry. */
#define LOG_ZERO (-1000.0)

/* tan theta that stands for the horizon where the source is known everywhere */
#define SLOPE_HORIZON 1e6

/* Room for n pairs with wi = wo, and the source's answer. */
struct pairs {
    double *x, *y, *z, *fr[3];
    bool *valid;
};

static bool pairs_create(struct pairs *pairs, size_t n)
{
    double *numbers = calloc(n, 6 * sizeof *numbers + sizeof(bool));
    if (!numbers) return false;
    *pairs = (struct pairs){numbers, numbers + n, numbers + 2 * n, {0}, (bool *)(numbers + 6 * n)};
    for (size_t c = 0; c < 3; c++) pairs->fr[c] = numbers + (3 + c) * n;
    return true;
}

/* From slope `from` with value fr to slope r, where there are no data: D is constant at the
 * horizon. */
static double extend(double fr, double from, double r)
{
    return fr * sqrt((1 + r * r) / (1 + from * from));
}

facet_status facet_fit_backscatter(const facet_fit_source *source, const double *r, size_t n,
                                   double *fr)
{
    struct pairs pairs;
    if (!pairs_create(&pairs, n)) return FACET_NO_MEMORY;
    double known = fmin(source->slope_max, SLOPE_HORIZON);
    for (size_t i = 0; i < n; i++) {
        double slope = fmin(r[i], known);
        pairs.z[i] = 1 / sqrt(1 + slope * slope);
        pairs.x[i] = slope * pairs.z[i];
    }
    facet_vec3_in o = {pairs.x, pairs.y, pairs.z};
    facet_status status = source->evaluate(source->user, o, o, n, pairs.fr, pairs.valid);
    size_t last = n;
    for (size_t i = 0; status == FACET_OK && i < n; i++) {
        double sum = 0;
        for (size_t c = 0; c < 3; c++) sum += fmax(pairs.fr[c][i], 0);
        fr[i] = sum / 3;
        if (pairs.valid[i] && r[i] > known) fr[i] = extend(fr[i], known, r[i]);
        if (pairs.valid[i]) {
            for (size_t k = 0; last == n && k < i; k++) fr[k] = fr[i]; /* a hole at the start */
            last = i;
        } else if (last < n) {
            fr[i] = extend(fr[last], r[last], r[i]);
        }
        if (pairs.valid[i] && !isfinite(fr[i])) status = FACET_BAD_DATA;
    }
    if (status == FACET_OK && last == n) status = FACET_BAD_DATA;
    free(pairs.x);
    return status;
}

facet_status facet_fit_median_slope(const facet_fit_source *source, double *median)
{
    enum { STEPS = 400 };
    double r[STEPS], mass[STEPS], low = 1e-7, high = 1e3, total = 0, half = 0;
    for (size_t i = 0; i < STEPS; i++) r[i] = low * pow(high / low, (double)i / (STEPS - 1));
    facet_status status = facet_fit_backscatter(source, r, STEPS, mass);
    if (status != FACET_OK) return status;
    for (size_t i = 0; i < STEPS; i++) { /* rings r^2 P dlog r; without masking P = f_r/(1+r^2)^3 */
        double s = 1 + r[i] * r[i];
        mass[i] *= r[i] * r[i] / (s * s * s);
        total += mass[i];
    }
    if (!(total > 0)) return FACET_BAD_DATA;
    for (size_t i = 0; i < STEPS; i++) {
        half += mass[i];
        if (half < total / 2) continue;
        *median = r[i];
        break;
    }
    return FACET_OK;
}

/*
 * The azimuth integral of max(0, 1 + t cos phi), t = tan theta_o tan theta_h:
 * <o,h> over a ring of normals, per cos theta_o cos theta_h.
 */
static double ring_cosine(double t)
{
    return t <= 1 ? 2 * FACET_PI : 2 * (sqrt((t - 1) * (t + 1)) + FACET_PI - acos(1 / t));
}

/*
 * sum of weight_j k(r r_j) p_j = the part of 4 cos^2 theta_o / (F0 P) due to
 * masking: sigma for masking only, 2 sigma - cos theta for a correlated source.
 */
static double masked_sum(const struct fit_density *density, facet_fit_convention convention,
                         double r)
{
    double sum = 0;
    for (size_t j = 0; j < density->count; j++) {
        double ring = ring_cosine(r * density->r[j]);
        if (convention == FACET_FIT_CORRELATED) ring = 2 * ring - 2 * FACET_PI;
        sum += density->weight[j] * ring * density->p[j];
    }
    return sum;
}

/* F0 P(r) = 4 f_r/(1 + r^2)^3 times the sum above: Dupuy 2015, alg. 1, in slopes. */
double facet_fit_gain(double r, double fr)
{
    double s = 1 + r * r;
    return 4 * fr / (s * s * s);
}

/*
 * The same sum where it needs no density: 1/G(o,o), with G = min(1, 2 cos^2 theta)
 * of V-grooves and cos^2 theta of a normal map (Dupuy table 2.IV at i = o = h).
 */
static double plain_sum(facet_masking masking, double r)
{
    double s = 1 + r * r;
    return masking == FACET_VGROOVE ? fmax(1, s / 2) : s;
}

static void normalize(struct fit_density *density, double *change)
{
    double norm = 0, worst = 0, peak = 0;
    for (size_t j = 0; j < density->count; j++)
        norm += 2 * FACET_PI * density->weight[j] * density->p[j];
    for (size_t j = 0; j < density->count; j++) {
        density->p[j] /= norm;
        peak = fmax(peak, density->p[j]);
        if (density->p[j] > 1e-12 * peak) worst = fmax(worst, fabs(density->p[j] / change[j] - 1));
        change[j] = density->p[j];
    }
    density->f0 = norm;
    change[density->count] = worst;
}

static facet_status read_off(struct fit_density *density, facet_masking masking, const double *fr)
{
    density->f0 = 0;
    for (size_t j = 0; j < density->count; j++) {
        double r = density->r[j];
        density->p[j] = facet_fit_gain(r, fr[j]) * plain_sum(masking, r);
        density->f0 += 2 * FACET_PI * density->weight[j] * density->p[j];
    }
    if (!isfinite(density->f0) || density->f0 <= 0) return FACET_BAD_DATA;
    for (size_t j = 0; j < density->count; j++) density->p[j] /= density->f0;
    return FACET_OK;
}

/* Four sums side by side: one after the other, additions would wait for each other. */
static double product(const double *a, const double *b, size_t n)
{
    double sum[4] = {0, 0, 0, 0};
    size_t j = 0;
    for (; j + 4 <= n; j += 4)
        for (size_t k = 0; k < 4; k++) sum[k] += a[j + k] * b[j + k];
    for (; j < n; j++) sum[0] += a[j] * b[j];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

static facet_status iterate(struct fit_density *density, facet_fit_convention convention,
                            const double *fr, double *matrix)
{
    enum { STEPS = 500 };
    size_t n = density->count;
    double *next = matrix + n * n, *before = next + n; /* before holds n + 1 */
    for (size_t i = 0; i < n; i++) { /* the ring is symmetric, and the dearest part */
        before[i] = density->p[i] = 1;
        for (size_t j = 0; j <= i; j++) {
            double ring = ring_cosine(density->r[i] * density->r[j]);
            if (convention == FACET_FIT_CORRELATED) ring = 2 * ring - 2 * FACET_PI;
            matrix[n * i + j] = facet_fit_gain(density->r[i], fr[i]) * density->weight[j] * ring;
            matrix[n * j + i] = facet_fit_gain(density->r[j], fr[j]) * density->weight[i] * ring;
        }
    }
    for (int step = 0; step < STEPS; step++) {
        for (size_t i = 0; i < n; i++) next[i] = product(matrix + n * i, density->p, n);
        for (size_t i = 0; i < n; i++) density->p[i] = next[i];
        normalize(density, before);
        if (!isfinite(density->f0) || density->f0 <= 0) return FACET_BAD_DATA;
        if (before[n] < 1e-11) return FACET_OK;
    }
    return FACET_NO_CONVERGENCE;
}

facet_status facet_fit_density_create(const facet_fit_source *source, facet_masking masking,
                                      facet_fit_convention convention, double scale, size_t count,
                                      struct fit_density *density)
{
    double *work = malloc((count * count + 3 * count + 1) * sizeof *work);
    double *numbers = calloc(count, 3 * sizeof *numbers);
    *density = (struct fit_density){scale, count, numbers, numbers + count, numbers + 2 * count, 0};
    facet_status status = work && numbers ? FACET_OK : FACET_NO_MEMORY;
    if (status == FACET_OK) {
        facet_gauss_legendre(count, density->r, density->weight);
        for (size_t j = 0; j < count; j++) { /* r dr = b^2 u/(1-u)^3 du */
            double u = density->r[j], q = 1 - u;
            density->r[j] = scale * u / q;
            density->weight[j] *= scale * scale * u / (q * q * q);
        }
        double *fr = work + count * count + 2 * count + 1;
        status = facet_fit_backscatter(source, density->r, count, fr);
        if (status == FACET_OK)
            status = masking == FACET_SMITH ? iterate(density, convention, fr, work)
                                            : read_off(density, masking, fr);
    }
    free(work);
    if (status != FACET_OK) facet_fit_density_clear(density);
    return status;
}

void facet_fit_density_clear(struct fit_density *density)
{
    free(density->r);
    *density = (struct fit_density){0};
}

facet_status facet_fit_density_table(const facet_fit_source *source, facet_masking masking,
                                     facet_fit_convention convention,
                                     const struct fit_density *density, size_t n, double *log_d)
{
    double *r = calloc(2 * n, sizeof *r), *fr = r + n;
    if (!r) return FACET_NO_MEMORY;
    for (size_t i = 0; i < n; i++) {
        double u = (double)i / (double)(n - 1);
        r[i] = fmin(density->scale * u / (1 - u), SLOPE_HORIZON * fmax(1, density->scale));
    }
    facet_status status = facet_fit_backscatter(source, r, n, fr);
    for (size_t i = 0; status == FACET_OK && i < n; i++) {
        double s = 1 + r[i] * r[i];
        double sum = masking == FACET_SMITH ? masked_sum(density, convention, r[i])
                                            : plain_sum(masking, r[i]);
        double p = facet_fit_gain(r[i], fr[i]) * sum / density->f0;
        log_d[i] = p > 0 ? fmax(log(p) + 2 * log(s), LOG_ZERO) : LOG_ZERO;
    }
    free(r);
    return status;
}

/* ---- Roughness ----------------------------------------------------------------------- */

/* Least squares on log P counts nodes down to this part of the peak. */
#define PEAK_PART 1e-4

struct alpha_fit {
    const struct fit_density *density;
    facet_ndf ndf;
    double floor; /* of P */
};

/* Variance of log P - log P_alpha: a common factor does not count, the tail may hold it. */
static double log_variance(double log_alpha, void *user)
{
    const struct alpha_fit *fit = user;
    double mean = 0, variance = 0, count = 0;
    for (size_t i = 0; i < fit->density->count; i++) { /* updated: sums of squares would cancel */
        double x = fit->density->r[i] / exp(log_alpha), p = fit->density->p[i];
        if (!(p >= fit->floor)) continue;
        double d = log(p) + (fit->ndf == FACET_GGX ? 2 * log1p(x * x) : x * x) - mean;
        count++;
        mean += d / count;
        variance += d * d * (count - 1) / count;
    }
    return variance;
}

double facet_fit_alpha(const struct fit_density *density, facet_ndf ndf, double *rms)
{
    double moment = 0, peak = 0;
    for (size_t i = 0; i < density->count; i++) {
        /* GGX: alpha = (2/pi) E[r]; Beckmann: alpha^2 = E[r^2] (Dupuy 2015, sec. 4.2) */
        double power = ndf == FACET_GGX ? density->r[i] : density->r[i] * density->r[i];
        moment += density->weight[i] * density->p[i] * power;
        peak = fmax(peak, density->p[i]);
    }
    double alpha = ndf == FACET_GGX ? 4 * moment : sqrt(2 * FACET_PI * moment);
    if (!(alpha >= density->scale / 100 && alpha <= density->scale * 100)) alpha = density->scale;
    struct alpha_fit fit = {density, ndf, peak * PEAK_PART};
    double start = log(alpha);
    double found = facet_minimize(log_variance, &fit, start - 2, start + 2, 1e-9, 100), count = 0;
    for (size_t i = 0; i < density->count; i++) count += density->p[i] >= fit.floor;
    *rms = sqrt(log_variance(found, &fit) / fmax(count, 1));
    return exp(found);
}
