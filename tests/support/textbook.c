#include "textbook.h"

#include "normals.h"

#include <math.h>

#define PI 3.14159265358979323846

/* ---- The model ------------------------------------------------------------------------ */

struct textbook_stretched textbook_stretch(const facet_roughness *r, const double k[3])
{
    double a = r->alpha_x * k[0] + r->rho * r->alpha_y * k[1];
    double b = r->alpha_y * sqrt(1 - r->rho * r->rho) * k[1];
    return (struct textbook_stretched){k[2] - k[0] * r->slope_x - k[1] * r->slope_y,
                                       sqrt(a * a + b * b)};
}

double textbook_area(facet_ndf ndf, struct textbook_stretched k)
{
    double root = sqrt(k.s * k.s + k.c * k.c), v = k.c / k.s;
    if (ndf == FACET_GGX) return k.c > 0 ? (k.c + root) / 2 : k.s * k.s / (2 * (root - k.c));
    if (k.s == 0) return fmax(k.c, 0);
    return k.c * erfc(-v) / 2 + k.s * exp(-v * v) / (2 * sqrt(PI));
}

double textbook_density(facet_ndf ndf, const facet_roughness *r, const double H[3])
{
    double kappa = sqrt(1 - r->rho * r->rho);
    double x = (-H[0] / H[2] - r->slope_x) / r->alpha_x;
    double y = ((-H[1] / H[2] - r->slope_y) / r->alpha_y - r->rho * x) / kappa, q = x * x + y * y;
    double p = ndf == FACET_GGX ? 1 / ((1 + q) * (1 + q)) : exp(-q);
    double sec2 = (H[0] * H[0] + H[1] * H[1] + H[2] * H[2]) / (H[2] * H[2]);
    return p * sec2 * sec2 / (PI * r->alpha_x * r->alpha_y * kappa);
}

static double fresnel(const facet_fresnel *f, double c)
{
    if (f->kind == FACET_FRESNEL_SCHLICK) return f->f0[0] + (1 - f->f0[0]) * pow(1 - c, 5);
    if (f->kind == FACET_FRESNEL_TABLE) {
        for (size_t i = 1; i < f->count; i++) {
            double x0 = f->cos_theta_d[i - 1], x1 = f->cos_theta_d[i], t = (c - x0) / (x1 - x0);
            if (c <= x1)
                return c <= x0 ? f->values[0][i - 1]
                               : f->values[0][i - 1] * (1 - t) + f->values[0][i] * t;
        }
        return f->values[0][f->count - 1];
    }
    if (f->kind != FACET_FRESNEL_DIELECTRIC) return 1;
    double eta = f->eta[0], g2 = eta * eta - 1 + c * c, g = sqrt(fmax(g2, 0));
    if (g2 <= 0) return 1;
    double s = (c - g) / (c + g), p = (eta * eta * c - g) / (eta * eta * c + g);
    return (s * s + p * p) / 2;
}

/* fr cos theta_i; energy-safe shear. */
static double fr_cos(const facet_material *m, const double i[3], const double o[3])
{
    double H[3] = {i[0] + o[0], i[1] + o[1], i[2] + o[2]};
    struct textbook_stretched ki = textbook_stretch(&m->roughness, i),
                              ko = textbook_stretch(&m->roughness, o);
    if (i[2] <= 0 || H[2] <= 0) return 0;
    double length = sqrt(H[0] * H[0] + H[1] * H[1] + H[2] * H[2]), cd = length / 2,
           hz = H[2] / length;
    double fd = fresnel(&m->fresnel, cd) * textbook_density(m->ndf, &m->roughness, H);
    if (m->masking == FACET_NONE) return fd * hz / (4 * cd);
    if (ki.c <= 0) return 0;
    double si = textbook_area(m->ndf, ki), so = textbook_area(m->ndf, ko);
    if (m->masking == FACET_SMITH_UNCORRELATED) return fd * ki.c / (4 * si * so);
    if (m->masking == FACET_SMITH)
        return fd * ki.c / (4 * (so * ki.c + (si - ki.c) * fmax(ko.c, 0)));
    if (ko.c <= 0) return 0;
    return fd * fmin(1, fmin(2 * hz * ki.c / cd, 2 * hz * ko.c / cd)) / (4 * ko.c);
}

/* ---- The quadrature --------------------------------------------------------------------- */

double textbook_piece(textbook_function *f, void *user, double a, double b)
{
    static double x[GAUSS_NODES], w[GAUSS_NODES];
    double sum = 0;
    if (w[0] == 0) normals_gauss(x, w);
    for (int i = 0; i < GAUSS_NODES; i++) sum += w[i] * f(user, a + (b - a) * x[i]);
    return sum * (b - a);
}

static double recurse(textbook_function *f, void *user, double a, double b, double whole,
                      double error, int depth)
{
    double middle = a + (b - a) / 2;
    double left = textbook_piece(f, user, a, middle), right = textbook_piece(f, user, middle, b);
    if (depth == 0 || fabs(left + right - whole) <= error) return left + right;
    return recurse(f, user, a, middle, left, error / 1.5, depth - 1) +
           recurse(f, user, middle, b, right, error / 1.5, depth - 1);
}

double textbook_integral(textbook_function *f, void *user, double a, double b, double error)
{
    if (!(b > a)) return 0;
    return recurse(f, user, a, b, textbook_piece(f, user, a, b), error, 40);
}

struct reference {
    const facet_material *m;
    double o[3], side[3], up[3]; /* up: across wo, towards the pole */
    double angle, error, from, to;
};

/* wi at the polar angle about wo and this azimuth, counted from `up`. */
static void turn(const struct reference *r, double phi, double i[3])
{
    double s = sin(r->angle), c = cos(r->angle);
    for (int k = 0; k < 3; k++)
        i[k] = c * r->o[k] + s * (cos(phi) * r->up[k] + sin(phi) * r->side[k]);
}

static double at_azimuth(void *user, double phi)
{
    const struct reference *r = user;
    double i[3];
    turn(r, phi, i);
    return fr_cos(r->m, i, r->o);
}

/* fr bends where one of these changes its sign: the mean facet sets, a minimum of the V-cavities changes over. */
enum { BENDS = 4 };
static double bend(const struct reference *r, double phi, int which)
{
    double i[3];
    turn(r, phi, i);
    struct textbook_stretched ki = textbook_stretch(&r->m->roughness, i),
                              ko = textbook_stretch(&r->m->roughness, r->o);
    double half = 4 * (i[2] + r->o[2]), h2 = 2 + 2 * cos(r->angle);
    const double of[BENDS] = {ki.c, ki.c - ko.c, half * ki.c - h2, half * ko.c - h2};
    return of[which];
}

static double smooth_pieces(struct reference *r, double a, double b, double error)
{
    enum { SCAN = 48, ROOM = 64 };
    double cuts[ROOM], sum = 0;
    int n = 0, last = r->m->masking == FACET_VGROOVE ? BENDS : r->m->roughness.slope_x != 0 ? 1 : 0;
    cuts[n++] = a;
    for (int j = 0; j < SCAN; j++)
        for (int which = 0; which < last && n < ROOM - 2; which++) {
            double low = a + (b - a) * j / SCAN, high = a + (b - a) * (j + 1) / SCAN,
                   sign = bend(r, low, which);
            if (sign * bend(r, high, which) >= 0) continue;
            for (int step = 0; step < 50; step++) {
                double middle = 0.5 * (low + high);
                *(bend(r, middle, which) * sign > 0 ? &low : &high) = middle;
            }
            int at = n++;
            for (; at > 1 && cuts[at - 1] > low; at--) cuts[at] = cuts[at - 1];
            cuts[at] = low;
        }
    cuts[n++] = b;
    for (int j = 1; j < n; j++)
        sum += textbook_integral(at_azimuth, r, cuts[j - 1], cuts[j], error);
    return sum;
}

/* Cut where the mean facet's mirror direction lies and where wi sets. */
static double at_angle(void *user, double angle)
{
    struct reference *r = user;
    r->angle = angle;
    double sets = PI, ratio = cos(angle) * r->o[2] / (sin(angle) * fmax(r->up[2], 1e-300));
    if (ratio < 1) sets = ratio > -1 ? acos(-ratio) : 0;
    double mean[3] = {-r->m->roughness.slope_x, -r->m->roughness.slope_y, 1}, x = 0, y = 0;
    for (int k = 0; k < 3; k++) {
        x += mean[k] * r->up[k];
        y += mean[k] * r->side[k];
    }
    double peak = fmin(fmax(atan2(y, x), -sets), sets), e = r->error / 10;
    return sin(angle) * (smooth_pieces(r, -sets, peak, e) + smooth_pieces(r, peak, sets, e));
}

/* Over [0, 1], level at the ends: what leaves a cut like a square root is smooth. */
static double at_step(void *user, double t)
{
    struct reference *r = user;
    return at_angle(r, r->from + (r->to - r->from) * t * t * (3 - 2 * t)) * 6 * t * (1 - t) *
           (r->to - r->from);
}

double textbook_albedo(const facet_material *m, const double o[3], double error)
{
    struct reference r = {.m = m, .error = error, .o = {o[0], o[1], o[2]}};
    double sine = hypot(o[0], o[1]), ex = sine > 0 ? o[0] / sine : 1,
           ey = sine > 0 ? o[1] / sine : 0;
    double up[3] = {-ex * o[2], -ey * o[2], sine}, side[3] = {ey, -ex, 0};
    for (int k = 0; k < 3; k++) {
        r.up[k] = up[k];
        r.side[k] = side[k];
    }
    const facet_roughness *q = &m->roughness;
    double c = (o[2] - o[0] * q->slope_x - o[1] * q->slope_y) /
               sqrt(1 + q->slope_x * q->slope_x + q->slope_y * q->slope_y);
    double cuts[16] = {0,          2 * acos(c), acos(-o[2]), PI,       PI / 2,
                       acos(o[2]), PI - 0.3,    PI - 0.05,   PI - 0.01};
    size_t n = 9;
    for (size_t i = 0; m->fresnel.kind == FACET_FRESNEL_TABLE && i < m->fresnel.count; i++)
        cuts[n++] = 2 * acos(m->fresnel.cos_theta_d[i]);
    if (m->fresnel.kind == FACET_FRESNEL_DIELECTRIC && m->fresnel.eta[0] < 1)
        cuts[n++] = 2 * asin(m->fresnel.eta[0]);
    for (size_t i = 1; i < n; i++)
        for (size_t j = i; j > 0 && cuts[j] < cuts[j - 1]; j--) {
            double swap = cuts[j];
            cuts[j] = cuts[j - 1];
            cuts[j - 1] = swap;
        }
    double sum = 0;
    for (size_t i = 1; i < n; i++) {
        r.from = cuts[i - 1];
        r.to = cuts[i];
        if (r.to > r.from) sum += textbook_integral(at_step, &r, 0, 1, error);
    }
    return sum;
}
