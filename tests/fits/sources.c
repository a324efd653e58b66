#include "sources.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

size_t formulas_read(const char *path, bool is_sgd, struct formula *out, size_t room)
{
    FILE *file = path ? fopen(path, "r") : NULL;
    char line[2000];
    size_t n = 0, skip = is_sgd ? 2 : 1, want = is_sgd ? SGD_NUMBERS : ABC_NUMBERS;
    if (!file || !fgets(line, sizeof line, file)) return 0;
    while (n < room && fgets(line, sizeof line, file)) {
        struct formula *f = &out[n];
        char *at = line;
        size_t k = 0;
        *f = (struct formula){.is_sgd = is_sgd};
        sscanf(line, "%63[^,]", f->name);
        for (size_t c = 0; at && c < skip; c++) at = strchr(at + (c > 0), ',');
        while (at && *at == ',' && k < want) f->p[k++] = strtod(at + 1, &at);
        n += k == want;
    }
    fclose(file);
    return n;
}

/* Bagher et al. 2012, eqs. 8-12; p: rhoD, rhoS, alpha, p, F0, F1, kappa, lambda, c, k, theta0. */
static double sgd_masking(const double *p, int ch, double z)
{
    double theta = acos(fmin(z, 1)), past = fmax(0, theta - p[30 + ch]);
    double g = 1 + p[21 + ch] * (1 - exp(p[24 + ch] * pow(past, p[27 + ch])));
    return fmax(0, fmin(1, g));
}

static double sgd(const double *p, int ch, double ci, double co, double ch_, double cd)
{
    double alpha = p[6 + ch], t2 = (1 - ch_ * ch_) / (ch_ * ch_), a = alpha + t2 / alpha;
    double d = p[18 + ch] * exp(-a) / (PI * pow(a, p[9 + ch]) * pow(ch_, 4));
    double f0 = p[12 + ch], f = f0 - cd * p[15 + ch] + pow(1 - cd, 5) * (1 - f0);
    double g = sgd_masking(p, ch, ci) * sgd_masking(p, ch, co);
    return (p[ch] + p[3 + ch] * f * d * g / (ci * co)) / PI;
}

static double dielectric(double eta, double c)
{
    double g2 = eta * eta - 1 + c * c;
    if (g2 <= 0) return 1;
    double g = sqrt(g2), r = (g - c) / (g + c), q = (c * (g + c) - 1) / (c * (g - c) + 1);
    return r * r * (1 + q * q) / 2;
}

/* Low et al. 2012, eqs. 15 and 20; p: kD, A, B, C, ior. */
static double abc(const double *p, int ch, double ci, double co, double ch_, double cd)
{
    double s = p[3 + ch] / pow(1 + p[6] * (1 - ch_), p[7]);
    double g = fmin(1, fmin(2 * ch_ * ci / cd, 2 * ch_ * co / cd));
    return p[ch] / PI + dielectric(p[8], cd) * g * s / (PI * ci * co);
}

double formula_fr(const struct formula *f, const double i[3], const double o[3], int channel)
{
    double h[3] = {i[0] + o[0], i[1] + o[1], i[2] + o[2]};
    double length = sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
    double ch = fmin(h[2] / length, 1), cd = fmin(length / 2, 1);
    return (f->is_sgd ? sgd : abc)(f->p, channel, i[2], o[2], ch, cd);
}

static facet_status evaluate(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                             double *const fr[3], bool *valid)
{
    for (size_t k = 0; k < n; k++) {
        double i[3] = {wi.x[k], wi.y[k], wi.z[k]}, o[3] = {wo.x[k], wo.y[k], wo.z[k]};
        valid[k] = true;
        for (int c = 0; c < 3; c++) {
            fr[c][k] = formula_fr(user, i, o, c);
            valid[k] = valid[k] && isfinite(fr[c][k]);
        }
    }
    return FACET_OK;
}

facet_fit_source formula_source(const struct formula *formula)
{
    return (facet_fit_source){evaluate, formula, INFINITY, false, NULL};
}
