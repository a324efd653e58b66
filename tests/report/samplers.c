#include "samplers.h"

#include <math.h>
#include <quadmath.h>
#include <stdbool.h>

#define PI 3.14159265358979323846

/* ---- The surface --------------------------------------------------------------------- */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Not hypot: nothing here comes near the ends of the range, and it would be the slowest part. */
static double length_of(double x, double y)
{
    return sqrt(x * x + y * y);
}

static double tangent(const struct surface *s, const double k[3])
{
    return length_of(s->alpha_x * k[0], s->alpha_y * k[1]);
}

/* Projected area of the visible facets. */
static double area(const struct surface *s, const double k[3])
{
    double t = tangent(s, k), c = k[2];
    if (s->ndf == GGX)
        return c >= 0 ? (c + length_of(t, c)) / 2 : t * t / (2 * (length_of(t, c) - c));
    if (t == 0) return fmax(c, 0);
    double v = c / t;
    return c * erfc(-v) / 2 + t * exp(-v * v) / (2 * sqrt(PI));
}

static double normals(const struct surface *s, const double h[3])
{
    if (h[2] <= 0) return 0;
    double x = h[0] / (h[2] * s->alpha_x), y = h[1] / (h[2] * s->alpha_y), r2 = x * x + y * y;
    double p = s->ndf == GGX ? 1 / ((1 + r2) * (1 + r2)) : exp(-r2);
    return p / (PI * s->alpha_x * s->alpha_y * pow(h[2], 4));
}

/* fr cos theta_i / D: what sampling leaves as the weight. */
static double fr_cos_over_d(const struct surface *s, const double i[3], const double o[3],
                            const double h[3])
{
    if (i[2] <= 0 || o[2] <= 0) return 0;
    if (s->masking == V_CAVITY) {
        double oh = dot(o, h);
        return fmin(1, fmin(2 * h[2] * i[2] / oh, 2 * h[2] * o[2] / oh)) / (4 * o[2]);
    }
    double si = area(s, i), so = area(s, o);
    return i[2] / (4 * (so * i[2] + o[2] * (si - i[2])));
}

double surface_fr_cos(const struct surface *s, const double i[3], const double o[3])
{
    double h[3] = {i[0] + o[0], i[1] + o[1], i[2] + o[2]}, length = sqrt(dot(h, h));
    for (int k = 0; k < 3; k++) h[k] /= length;
    return fr_cos_over_d(s, i, o, h) * normals(s, h);
}

/* ---- Normals to samples ---------------------------------------------------------------- */

/* Reflects; density is that of wi over D. */
static void finish(const struct surface *s, const double o[3], const double normal[3],
                   double density_over_d, struct sample *out)
{
    double length = sqrt(dot(normal, normal));
    for (int k = 0; k < 3; k++) out->h[k] = normal[k] / length;
    double twice = 2 * dot(o, out->h);
    for (int k = 0; k < 3; k++) out->wi[k] = twice * out->h[k] - o[k];
    out->pdf_over_d = density_over_d;
    out->weight = twice > 0 ? fr_cos_over_d(s, out->wi, o, out->h) / density_over_d : 0;
}

static void draw_normal(const struct surface *s, double u1, double u2, double h[3])
{
    double r = s->ndf == GGX ? sqrt(u1 / (1 - u1)) : sqrt(-log1p(-u1)), phi = 2 * PI * u2;
    double x = s->alpha_x * r * cos(phi), y = s->alpha_y * r * sin(phi),
           length = sqrt(1 + x * x + y * y);
    h[0] = -x / length;
    h[1] = -y / length;
    h[2] = 1 / length;
}

double sample_pdf(const struct surface *s, const struct sample *sample)
{
    return sample->pdf_over_d * normals(s, sample->h);
}

void sample_ndf(const struct surface *s, const double o[3], double u1, double u2,
                struct sample *out)
{
    double h[3];
    draw_normal(s, u1, u2, h);
    finish(s, o, h, h[2] / (4 * fabs(dot(o, h))), out);
}

void sample_vcavity(const struct surface *s, const double o[3], double u1, double u2,
                    struct sample *out)
{
    double h[3];
    draw_normal(s, u1, u2, h);
    double twin[3] = {-h[0], -h[1], h[2]}, a = fmax(dot(o, h), 0), b = fmax(dot(o, twin), 0);
    double chance = b / (a + b); /* a + b >= 2 o_z h_z > 0 */
    /* A third number from the low bits of the first, which the radius hardly feels (2^-20). */
    double u3 = u1 * 0x1p20 - floor(u1 * 0x1p20);
    if (u3 < chance)
        for (int k = 0; k < 3; k++) h[k] = twin[k];
    double g1 = fmin(1, 2 * h[2] * o[2] / dot(o, h));
    finish(s, o, h, g1 / (4 * o[2]), out);
}

/* m of the standard surface, seen from k = (a, b, c)/r, back to the surface. */
static void unstretch(const struct surface *s, const double m[3], double h[3])
{
    h[0] = s->alpha_x * m[0];
    h[1] = s->alpha_y * m[1];
    h[2] = fmax(m[2], 1e-300);
}

/* A point of the spherical cap of directions whose cosine exceeds -least, plus k. */
static void draw_cap(const struct surface *s, const double o[3], double u1, double u2, double share,
                     double h[3])
{
    double k[3] = {s->alpha_x * o[0], s->alpha_y * o[1], o[2]}, r = sqrt(dot(k, k));
    for (int j = 0; j < 3; j++) k[j] /= r;
    double least = share * k[2], above = (1 - u2) * (1 + least), z = above - least;
    /* 1 - z and 1 + z apart: neither is a difference of near numbers */
    double sine = sqrt(u2 * (1 + least) * (1 - least + above)), phi = 2 * PI * u1;
    double m[3] = {sine * cos(phi) + k[0], sine * sin(phi) + k[1], z + k[2]};
    unstretch(s, m, h);
}

void sample_caps(const struct surface *s, const double o[3], double u1, double u2,
                 struct sample *out)
{
    double h[3];
    draw_cap(s, o, u1, u2, 1, h);
    finish(s, o, h, 1 / (4 * area(s, o)), out);
}

/* Isotropic alpha > 1 by the sign form, which bounds more tightly. */
static double cap_share(const struct surface *s, const double o[3])
{
    double side = length_of(o[0], o[1]), a = fmin(fmin(s->alpha_x, s->alpha_y), 1), sign = 1;
    if (s->alpha_x == s->alpha_y && s->alpha_x > 1) {
        a = s->alpha_x;
        sign = -1;
    }
    double q = 1 + sign * side;
    return (1 - a * a) * q * q / (q * q + a * a * o[2] * o[2]);
}

void sample_bounded(const struct surface *s, const double o[3], double u1, double u2,
                    struct sample *out)
{
    double h[3], share = cap_share(s, o);
    draw_cap(s, o, u1, u2, share, h);
    finish(s, o, h, 1 / (2 * (share * o[2] + length_of(tangent(s, o), o[2]))), out);
}

/* ---- Slopes ------------------------------------------------------------------------------ */

/* Slope x along wo's tangent and y across, of the standard surface. */
static void from_slopes(const struct surface *s, const double o[3], double x, double y,
                        struct sample *out)
{
    double t = tangent(s, o), c = t > 0 ? s->alpha_x * o[0] / t : 1,
           d = t > 0 ? s->alpha_y * o[1] / t : 0;
    double h[3] = {-s->alpha_x * (x * c - y * d), -s->alpha_y * (x * d + y * c), 1};
    finish(s, o, h, 1 / (4 * area(s, o)), out);
}

/* z with CDF 1/2 + (t + sin t cos t)/pi, t = atan z: the slope across, over sqrt(1 + x^2). */
static double ggx_across(double u)
{
    double t = PI * (u - 0.5) * 0.5, target = PI * (u - 0.5), low = -PI / 2, high = PI / 2;
    for (int step = 0; step < 100; step++) {
        double f = t + sin(t) * cos(t) - target;
        *(f > 0 ? &high : &low) = t;
        double next = t - f / (2 * cos(t) * cos(t));
        if (!(next > low && next < high)) next = 0.5 * (low + high);
        bool done = fabs(next - t) <= 1e-9;
        t = next;
        if (done) break;
    }
    return tan(t);
}

/* tan of asin(u (1 + c) - c) - theta: the singularity at A^2 = 1 of the printed root is gone. */
void sample_slope_ggx(const struct surface *s, const double o[3], double u1, double u2,
                      struct sample *out)
{
    double t = tangent(s, o), r = length_of(t, o[2]), c = o[2] / r;
    double x = tan(asin(fmin(fmax(u1 * (1 + c) - c, -1), 1)) - acos(fmin(c, 1)));
    x = fmax(x, -1e8);
    from_slopes(s, o, x, ggx_across(u2) * sqrt(1 + x * x), out);
}

/* F(x) = u by Newton's method in a bracket; v = cot theta of the stretched wo, INFINITY from the pole. */
static double invert_gauss(double v, double u)
{
    double low = -6.5, high = fmin(v, 6.5), x = fmin(0, high);
    double g = isinf(v) ? 1 : 2 / (1 + erf(v) + exp(-v * v) / (v * sqrt(PI)));
    for (int step = 0; step < 100; step++) {
        double e = exp(-x * x), tail = isinf(v) ? 0 : e / (2 * sqrt(PI) * v);
        double f = g * (erfc(-x) / 2 + tail) - u,
               slope = g * (isinf(v) ? 1 : 1 - x / v) * e / sqrt(PI);
        *(f > 0 ? &high : &low) = x;
        double next = x - f / slope;
        if (!(next > low && next < high)) next = 0.5 * (low + high);
        bool done = fabs(next - x) <= 1e-9; /* quadratic: the next step would be 1e-17 */
        x = next;
        if (done) break;
    }
    return x;
}

void sample_slope_beckmann(const struct surface *s, const double o[3], double u1, double u2,
                           struct sample *out)
{
    double t = tangent(s, o), v = t > 0 ? o[2] / t : INFINITY;
    from_slopes(s, o, invert_gauss(v, u1), invert_gauss(INFINITY, u2), out);
}

const struct method methods[METHOD_COUNT] = {
    {"ndf", sample_ndf, -1, -1},
    {"caps", sample_caps, GGX, SMITH},
    {"bounded", sample_bounded, GGX, SMITH},
    {"slope", sample_slope_ggx, GGX, SMITH},
    {"slope (Beckmann)", sample_slope_beckmann, BECKMANN, SMITH},
    {"vcavity", sample_vcavity, -1, V_CAVITY},
};

/* ---- Quad ---------------------------------------------------------------------------------- */

double caps_cosine_quad(double alpha, double cos_theta_o, double sin_theta_o, double u1, double u2)
{
    typedef __float128 quad;
    quad a = alpha, x = a * sin_theta_o, z = cos_theta_o, r = sqrtq(x * x + z * z),
         turn = 2 * M_PIq * (quad)u1;
    quad kx = x / r, kz = z / r, t = (1 - (quad)u2) * (1 + kz) - kz,
         sine = sqrtq((1 - t) * (1 + t));
    quad hx = a * (sine * cosq(turn) + kx), hy = a * sine * sinq(turn), hz = t + kz;
    quad along = (hx * sin_theta_o + hz * z) / (hx * hx + hy * hy + hz * hz);
    quad cosine = 2 * along * hz - z;
    return (double)cosine;
}
