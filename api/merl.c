#include "merl.h"

#include "little.h"

#include <math.h>

enum { HEADER = 12, HALVES = 90, DIFFERENCES = 90, AZIMUTHS = 180 };
enum { PLANE = HALVES * DIFFERENCES * AZIMUTHS };

/* Units of the stored numbers, per steradian: the scale factors of the MERL reader. */
static const double units[3] = {1.0 / 1500, 1.15 / 1500, 1.66 / 1500};

static bool has_dimensions(const unsigned char *bytes)
{
    return api_little_u32(bytes) == HALVES && api_little_u32(bytes + 4) == DIFFERENCES &&
           api_little_u32(bytes + 8) == AZIMUTHS;
}

bool api_merl_matches(const unsigned char *bytes, size_t size)
{
    return size == MERL_SIZE || (size >= HEADER && has_dimensions(bytes));
}

static double datum(const unsigned char *bytes, size_t plane, size_t index)
{
    return api_little_double(bytes + HEADER + 8 * (plane * PLANE + index));
}

bool api_merl_open(const void *bytes, size_t size, struct merl *merl, struct data_counts *counts,
                   struct problem *problem)
{
    const unsigned char *b = bytes;
    if (size != MERL_SIZE)
        return api_problem(problem, 422, "a MERL file has %d bytes, this one has %zu", MERL_SIZE,
                           size);
    if (!has_dimensions(b))
        return api_problem(problem, 422,
                           "a MERL file starts with the dimensions 90, 90, 180 as little-endian "
                           "int32, this one with %ld, %ld, %ld",
                           (long)(int32_t)api_little_u32(b), (long)(int32_t)api_little_u32(b + 4),
                           (long)(int32_t)api_little_u32(b + 8));
    size_t data = 0;
    counts->values = PLANE;
    for (size_t i = 0; i < PLANE; i++) {
        bool missing = false;
        for (size_t plane = 0; plane < 3; plane++) {
            double value = datum(b, plane, i);
            if (!isfinite(value))
                return api_problem(problem, 422,
                                   "colour plane %zu, theta_h %zu, theta_d %zu, phi_d %zu is not "
                                   "a finite number",
                                   plane, i / (DIFFERENCES * AZIMUTHS), i / AZIMUTHS % DIFFERENCES,
                                   i % AZIMUTHS);
            missing = missing || value < 0;
            data += value > 0;
        }
        counts->missing += missing;
    }
    merl->bytes = b;
    return data || api_problem(problem, 422, "the file holds no data: no number is positive");
}

double api_merl_slope_max(void)
{
    double t = (HALVES - 1.0) / HALVES;
    return tan(FACET_PI / 2 * t * t);
}

/* Where a coordinate falls among count samples at 0, 1, ...: the cell's ends and the weight of the
 * second. */
struct span {
    size_t at[2];
    double weight[2];
};

static struct span locate(double x, size_t count, bool periodic)
{
    struct span span;
    double whole = floor(x), last = (double)(count - 1);
    if (!periodic && x >= last) return (struct span){{count - 1, count - 1}, {1, 0}};
    span.at[0] = (size_t)whole % count;
    span.at[1] = (span.at[0] + 1) % count;
    span.weight[1] = x - whole;
    span.weight[0] = 1 - span.weight[1];
    return span;
}

/* Rusinkiewicz angles of a pair, in samples. */
static void coordinates(const double wi[3], const double wo[3], double *theta_h, double *theta_d,
                        double *phi_d)
{
    double h[3], d[3];
    for (int k = 0; k < 3; k++) {
        h[k] = wi[k] + wo[k];
        d[k] = wi[k] - wo[k];
    }
    double length = sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]), across = hypot(h[0], h[1]);
    double cos_phi = across > 0 ? h[0] / across : 1, sin_phi = across > 0 ? h[1] / across : 0;
    /* half the difference vector lies in the plane across h: along h's meridian, and beside it */
    double along = (h[2] * (cos_phi * d[0] + sin_phi * d[1]) - across * d[2]) / length;
    double beside = cos_phi * d[1] - sin_phi * d[0];
    double phi = atan2(beside, along);
    *theta_h = sqrt(atan2(across, h[2]) / (FACET_PI / 2)) * HALVES;
    *theta_d = atan2(hypot(along, beside), length) / (FACET_PI / 2) * DIFFERENCES;
    *phi_d = (phi < 0 ? phi + FACET_PI : phi) / FACET_PI *
             AZIMUTHS; /* reciprocity: phi_d and phi_d + pi */
}

/* Half way between cells with and without data there are data, whatever the last bit says. */
#define ROUNDING 1e-6

/* Weighted mean of the cells that hold data; false where they are less than half. */
static bool interpolate(const unsigned char *bytes, struct span h, struct span d, struct span p,
                        double rgb[3])
{
    double total = 0, sum[3] = {0, 0, 0};
    for (int corner = 0; corner < 8; corner++) {
        int a = corner >> 2, b = corner >> 1 & 1, c = corner & 1;
        double weight = h.weight[a] * d.weight[b] * p.weight[c], value[3];
        size_t index = p.at[c] + AZIMUTHS * (d.at[b] + DIFFERENCES * h.at[a]);
        if (weight == 0) continue;
        for (size_t k = 0; k < 3; k++) value[k] = datum(bytes, k, index);
        if (value[0] < 0 || value[1] < 0 || value[2] < 0) continue;
        for (size_t k = 0; k < 3; k++) sum[k] += weight * value[k] * units[k];
        total += weight;
    }
    if (total < 0.5 - ROUNDING) return false;
    for (size_t k = 0; k < 3; k++) rgb[k] = sum[k] / total;
    return true;
}

facet_status api_merl_evaluate(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                               double *const fr[3], bool *valid)
{
    const struct merl *merl = user;
    for (size_t i = 0; i < n; i++) {
        double theta_h, theta_d, phi_d, rgb[3] = {0, 0, 0};
        coordinates((double[3]){wi.x[i], wi.y[i], wi.z[i]}, (double[3]){wo.x[i], wo.y[i], wo.z[i]},
                    &theta_h, &theta_d, &phi_d);
        valid[i] = interpolate(merl->bytes, locate(theta_h, HALVES, false),
                               locate(theta_d, DIFFERENCES, false), locate(phi_d, AZIMUTHS, true),
                               rgb);
        for (size_t k = 0; k < 3; k++) fr[k][i] = rgb[k];
    }
    return FACET_OK;
}
