#include "closed.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#define PI 3.14159265358979323846

double closed_slope_density(const struct closed *s, double r)
{
    double x = r / s->alpha, a = 1 + x * x;
    return (s->ndf == FACET_GGX ? 1 / (a * a) : exp(-x * x)) / (PI * s->alpha * s->alpha);
}

/* Smith's Lambda: sigma = cos (1 + Lambda) */
static double lambda(const struct closed *s, double c)
{
    double v = c / sqrt((1 - c) * (1 + c)) / s->alpha;
    if (c >= 1) return 0;
    if (s->ndf == FACET_GGX) return (sqrt(1 + 1 / (v * v)) - 1) / 2;
    return (exp(-v * v) / (v * sqrt(PI)) - erfc(v)) / 2;
}

double closed_fr(const struct closed *s, const double i[3], const double o[3], double f0)
{
    double h[3] = {i[0] + o[0], i[1] + o[1], i[2] + o[2]};
    double length = sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]), cd = length / 2;
    double ch = h[2] / length, r = hypot(h[0], h[1]) / h[2];
    double d = closed_slope_density(s, r) / (ch * ch * ch * ch);
    double li = lambda(s, i[2]), lo = lambda(s, o[2]);
    double g = 1 / (1 + li + lo);
    if (s->masking == CLOSED_SMALLER) g = 1 / (1 + fmax(li, lo));
    if (s->masking == CLOSED_HOT_SPOT) {
        double phi = atan2(i[1], i[0]) - atan2(o[1], o[0]);
        phi = remainder(phi, 2 * PI);
        double t = exp(-phi * phi * 16);
        g = t / (1 + fmax(li, lo)) + (1 - t) * g;
    }
    double q = 1 - cd, f = f0 + (1 - f0) * q * q * q * q * q;
    return f * d * g / (4 * i[2] * o[2]);
}

/* A normal number that belongs to a pair, as measurement noise does: asked twice it is the same. */
static double gauss(const struct closed *s, const double i[3], const double o[3], int c)
{
    uint64_t x = s->seed * 0x9e3779b97f4a7c15u + (uint64_t)c, bits;
    for (int k = 0; k < 6; k++) {
        memcpy(&bits, k < 3 ? &i[k] : &o[k - 3], 8);
        x = (x ^ bits) * 0xbf58476d1ce4e5b9u;
        x ^= x >> 29;
    }
    double u[2];
    for (int k = 0; k < 2; k++) {
        x = (x ^ (x >> 31)) * 0x94d049bb133111ebu + 1;
        x ^= x >> 30;
        u[k] = ((double)(x >> 11) + 0.5) / 9007199254740992.;
    }
    return sqrt(-2 * log(u[0])) * cos(2 * PI * u[1]);
}

static facet_status evaluate_closed(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                                    double *const fr[3], bool *valid)
{
    const struct closed *s = user;
    for (size_t k = 0; k < n; k++) {
        double i[3] = {wi.x[k], wi.y[k], wi.z[k]}, o[3] = {wo.x[k], wo.y[k], wo.z[k]};
        for (int c = 0; c < 3; c++) {
            fr[c][k] = closed_fr(s, i, o, s->f0[c]);
            if (s->noise > 0) {
                static const double up[3] = {0, 0, 1};
                double peak = closed_fr(s, up, up, s->f0[c]);
                fr[c][k] += s->noise * fr[c][k] * gauss(s, i, o, c) +
                            s->noise_floor * peak * gauss(s, i, o, c + 3);
            }
            if (s->outliers > 0 && erfc(fabs(gauss(s, i, o, 6)) / sqrt(2)) < s->outliers)
                fr[c][k] *= 100;
        }
        valid[k] = true;
    }
    return FACET_OK;
}

facet_fit_source closed_source(const struct closed *closed)
{
    return (facet_fit_source){evaluate_closed, closed, INFINITY, false, NULL};
}
