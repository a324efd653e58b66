#include "relief.h"
#include "pfm.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- Heights ------------------------------------------------------------------------------ */

static double uniform(unsigned long long *state)
{
    *state = *state * 6364136223846793005ull + 1442695040888963407ull;
    return ((double)(*state >> 11) + 0.5) * 0x1p-53;
}

static double normal(unsigned long long *state)
{
    const double radius = sqrt(-2 * log(uniform(state)));
    return radius * cos(2 * acos(-1) * uniform(state));
}

/* Periodic convolution of one line with exp(-2 x^2 / length^2), whose autocorrelation falls to 1/e
 * at `length`. */
static void blur(double *line, size_t n, size_t stride, double length, double *copy)
{
    const long reach = (long)ceil(3 * length);
    for (size_t i = 0; i < n; i++) copy[i] = line[i * stride];
    for (size_t i = 0; i < n; i++) {
        double sum = 0;
        for (long d = -reach; d <= reach; d++) {
            const size_t at = (size_t)(((long)i + d + 8 * (long)n) % (long)n);
            sum += exp(-2 * (double)(d * d) / (length * length)) * copy[at];
        }
        line[i * stride] = sum;
    }
}

static void finish(struct relief *r)
{
    r->highest = r->z[0];
    for (size_t i = 0; i < r->side * r->side; i++) r->highest = fmax(r->highest, r->z[i]);
}

static double rms_forward(const double *z, size_t n, bool along_x)
{
    double sum = 0;
    for (size_t i = 0; i < n * n; i++) {
        const size_t p = i % n, q = i / n;
        const double d = z[along_x ? q * n + (p + 1) % n : (q + 1) % n * n + p] - z[i];
        sum += d * d;
    }
    return sqrt(sum / (double)(n * n));
}

bool relief_gaussian(struct relief *r, size_t side, double length_x, double length_y,
                     double rms_slope, unsigned long long seed)
{
    const size_t n = side * side;
    double *z = malloc(n * sizeof *z), *copy = malloc(side * sizeof *copy);
    *r = (struct relief){side, calloc(n, sizeof *r->z), 0};
    if (z && copy && r->z) {
        for (size_t i = 0; i < n; i++) z[i] = normal(&seed);
        for (size_t q = 0; q < side; q++) blur(z + q * side, side, 1, length_x, copy);
        for (size_t p = 0; p < side; p++) blur(z + p, side, side, length_y, copy);
        const double steeper = fmax(rms_forward(z, side, true), rms_forward(z, side, false));
        for (size_t i = 0; i < n; i++) r->z[i] = (float)(z[i] * rms_slope / steeper);
        finish(r);
    }
    const bool ok = z && copy && r->z;
    free(z);
    free(copy);
    return ok;
}

bool relief_measured(struct relief *r, const char *path, double texel, size_t side, double scale)
{
    size_t w = 0, h = 0;
    float *z = path ? pfm_read(path, &w, &h) : NULL;
    *r = (struct relief){side, NULL, 0};
    if (z && w >= side && h >= side) r->z = malloc(side * side * sizeof *r->z);
    for (size_t i = 0; r->z && i < side * side; i++)
        r->z[i] = (float)(scale * (z[i / side * w + i % side] - z[0]) / texel);
    if (r->z) finish(r);
    free(z);
    return r->z;
}

void relief_free(struct relief *r)
{
    free(r->z);
    r->z = NULL;
}

/* ---- The surface ---------------------------------------------------------------------------- */

struct point {
    double z, x_slope, y_slope;
};

/* Coordinates from 0; periodic. */
static struct point surface_at(const struct relief *r, double x, double y)
{
    const double n = (double)r->side;
    x -= n * floor(x / n);
    y -= n * floor(y / n);
    const size_t p = (size_t)x % r->side, q = (size_t)y % r->side;
    const size_t p1 = (p + 1) % r->side, q1 = (q + 1) % r->side;
    const double u = x - floor(x), v = y - floor(y);
    const double z00 = r->z[q * r->side + p], z10 = r->z[q * r->side + p1];
    const double z01 = r->z[q1 * r->side + p], z11 = r->z[q1 * r->side + p1];
    const double a0 = z10 - z00, a1 = z11 - z01, b0 = z01 - z00, b1 = z11 - z10;
    return (struct point){z00 + a0 * u + b0 * v + (a1 - a0) * u * v, a0 + (a1 - a0) * v,
                          b0 + (b1 - b0) * u};
}

/* Does the ray from the surface at (x, y, z) get as far as `reach`?  Steps of a third of a texel. */
static bool sees(const struct relief *r, double x, double y, double z, const double k[3],
                 double reach)
{
    const double across = hypot(k[0], k[1]);
    if (across < 1e-9) return true;
    const double step = 0.31 / across;
    const double end = reach / across;
    for (double t = step / 2; t < end && z + t * k[2] < r->highest; t += step)
        if (surface_at(r, x + t * k[0], y + t * k[1]).z > z + t * k[2] + 1e-9) return false;
    return true;
}

/* ---- Shading
 * ------------------------------------------------------------------------------------- */

static double lambda_beckmann(double cosine, double alpha)
{
    const double sine = sqrt(fmax(0, 1 - cosine * cosine));
    if (sine <= 0) return 0;
    const double v = cosine / (alpha * sine);
    return (erf(v) - 1) / 2 + exp(-v * v) / (2 * v * sqrt(acos(-1)));
}

double base_beckmann(const void *data, const double wi[3], const double wo[3])
{
    const double alpha = *(const double *)data;
    double h[3], length = 0;
    for (int k = 0; k < 3; k++) h[k] = wi[k] + wo[k], length += h[k] * h[k];
    const double c = h[2] / sqrt(length), t2 = (1 - c * c) / (c * c);
    if (c <= 0) return 0;
    const double d = exp(-t2 / (alpha * alpha)) / (acos(-1) * alpha * alpha * c * c * c * c);
    const double g = 1 / (1 + lambda_beckmann(wi[2], alpha) + lambda_beckmann(wo[2], alpha));
    return d * g / (4 * wi[2] * wo[2]);
}

/* k in a frame whose z is n; any rotation about n will do, the bases here are isotropic. */
static void to_frame(const double n[3], const double k[3], double out[3])
{
    double t[3] = {n[2], 0, -n[0]};
    const double length = sqrt(t[0] * t[0] + t[2] * t[2]);
    t[0] /= length, t[2] /= length;
    const double b[3] = {n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2],
                         n[0] * t[1] - n[1] * t[0]};
    out[0] = k[0] * t[0] + k[1] * t[1] + k[2] * t[2];
    out[1] = k[0] * b[0] + k[1] * b[1] + k[2] * b[2];
    out[2] = k[0] * n[0] + k[1] * n[1] + k[2] * n[2];
}

void relief_radiance(const struct relief *r, const struct base *base, double x, double y,
                     double size, int points, const double directions[][3], size_t direction_count,
                     const struct view *views, size_t view_count, double *radiance)
{
    double area[RELIEF_DIRECTIONS] = {0};
    for (size_t v = 0; v < view_count; v++) radiance[v] = 0;
    for (int s = 0; s < points * points; s++) {
        const double px = x + size * (s % points + 0.5) / points;
        const double py = y + size * (s / points + 0.5) / points;
        const struct point at = surface_at(r, px, py);
        const double tall = sqrt(1 + at.x_slope * at.x_slope + at.y_slope * at.y_slope);
        const double n[3] = {-at.x_slope / tall, -at.y_slope / tall, 1 / tall};
        double local[RELIEF_DIRECTIONS][3];
        bool seen[RELIEF_DIRECTIONS];
        for (size_t d = 0; d < direction_count; d++) {
            to_frame(n, directions[d], local[d]);
            seen[d] = local[d][2] > 0 && sees(r, px, py, at.z, directions[d], size);
            if (seen[d]) area[d] += local[d][2] * tall;
        }
        for (size_t v = 0; v < view_count; v++) {
            const size_t i = views[v].i, o = views[v].o;
            if (!seen[i] || !seen[o]) continue;
            radiance[v] += base->f(base->data, local[i], local[o]) * local[i][2] * local[o][2] *
                           tall;
        }
    }
    for (size_t v = 0; v < view_count; v++) {
        const double seen = area[views[v].o];
        radiance[v] = seen > 0 ? radiance[v] / seen : NAN;
    }
}
