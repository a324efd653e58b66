/* moments.c - slope moments and the Beckmann roughness they describe. */
#include "facet_forms.h"
#include "roughness.h"

#include <float.h>
#include <math.h>

facet_moments facet_moments_from_roughness(const facet_roughness *r)
{
    const facet_moments m = {
        .e1 = r->slope_x,
        .e2 = r->slope_y,
        .e3 = r->alpha_x * r->alpha_x / 2 + r->slope_x * r->slope_x,
        .e4 = r->alpha_y * r->alpha_y / 2 + r->slope_y * r->slope_y,
        .e5 = r->rho * r->alpha_x * r->alpha_y / 2 + r->slope_x * r->slope_y,
    };
    return m;
}

/* The symmetric matrix [xx xy; xy yy] = 2 Cov[x~, y~]; its eigenvalues are alpha_1^2, alpha_2^2. */
struct shape {
    double xx, yy, xy;
};

/* The thinnest ellipse kept: at worst (45 degrees) 1 - rho^2 = 4 thin^2, within FACET_RHO_MAX. */
#define THIN 1e-6

static struct shape shape_of(const facet_moments *m)
{
    const facet_covariance c = facet_covariance_from_moments(m);
    return (struct shape){2 * c.xx, 2 * c.yy, 2 * c.xy};
}

/* Raise the eigenvalues to at least floor and to THIN^2 of the larger one; true if that changed
 * any. */
static bool shape_raise(struct shape *s, double floor)
{
    const double half = (s->xx - s->yy) / 2, root = hypot(half, s->xy);
    const double high = (s->xx + s->yy) / 2 + root;
    if (!(high > floor)) {
        const bool same = s->xx == floor && s->yy == floor && s->xy == 0;
        *s = (struct shape){floor, floor, 0};
        return !same;
    }
    const double least = fmax(floor, THIN * THIN * high);
    const double low = (s->xx * s->yy - s->xy * s->xy) / high;
    if (low >= least || root == 0) return false;
    /* Adding (least - low) v v^T, v the unit eigenvector of low. */
    const double add = least - low, cos2 = half / root, sin2 = s->xy / root;
    s->xx += add * (1 - cos2) / 2;
    s->yy += add * (1 + cos2) / 2;
    s->xy -= add * sin2 / 2;
    return true;
}

facet_status facet_moments_to_roughness(const facet_moments *m, double alpha_floor,
                                        facet_roughness *roughness, bool *floored)
{
    struct shape s = shape_of(m);
    if (floored) *floored = false;
    if (!(isfinite(s.xx) && isfinite(s.yy) && isfinite(s.xy))) return FACET_BAD_ALPHA;
    if (alpha_floor > 0) {
        const bool raised = shape_raise(&s, alpha_floor * alpha_floor);
        if (floored) *floored = raised;
    }
    if (!(s.xx > 0 && s.yy > 0)) return FACET_BAD_ALPHA;
    const facet_roughness r = {
        .alpha_x = sqrt(s.xx),
        .alpha_y = sqrt(s.yy),
        .rho = s.xy / sqrt(s.xx) / sqrt(s.yy),
        .slope_x = m->e1,
        .slope_y = m->e2,
    };
    const facet_status status = facet_roughness_check(&r);
    if (status == FACET_OK) *roughness = r;
    return status;
}

facet_moments facet_moments_add(const facet_moments *a, const facet_moments *b)
{
    const facet_moments m = {
        .e1 = a->e1 + b->e1,
        .e2 = a->e2 + b->e2,
        .e3 = a->e3 + b->e3 + 2 * a->e1 * b->e1,
        .e4 = a->e4 + b->e4 + 2 * a->e2 * b->e2,
        .e5 = a->e5 + b->e5 + a->e1 * b->e2 + a->e2 * b->e1,
    };
    return m;
}

facet_moments facet_moments_scale(const facet_moments *m, double beta)
{
    const double b2 = beta * beta;
    return (facet_moments){beta * m->e1, beta * m->e2, b2 * m->e3, b2 * m->e4, b2 * m->e5};
}

facet_moments facet_moments_transform(const facet_moments *m, const double j[4])
{
    const double ux = j[0], uy = j[1], vx = j[2], vy = j[3];
    const facet_moments t = {
        .e1 = ux * m->e1 + vx * m->e2,
        .e2 = uy * m->e1 + vy * m->e2,
        .e3 = ux * ux * m->e3 + 2 * ux * vx * m->e5 + vx * vx * m->e4,
        .e4 = uy * uy * m->e3 + 2 * uy * vy * m->e5 + vy * vy * m->e4,
        .e5 = ux * uy * m->e3 + (ux * vy + uy * vx) * m->e5 + vx * vy * m->e4,
    };
    return t;
}

facet_covariance facet_covariance_from_moments(const facet_moments *m)
{
    return (facet_covariance){fma(-m->e1, m->e1, m->e3), fma(-m->e2, m->e2, m->e4),
                              fma(-m->e1, m->e2, m->e5)};
}

facet_covariance facet_covariance_from_roughness(const facet_roughness *r)
{
    return (facet_covariance){r->alpha_x * r->alpha_x / 2, r->alpha_y * r->alpha_y / 2,
                              r->rho * r->alpha_x * r->alpha_y / 2};
}

double facet_covariance_largest(const facet_covariance *c)
{
    return (c->xx + c->yy) / 2 + hypot((c->xx - c->yy) / 2, c->xy);
}

/* (au, av) C (bu, bv)^T. */
static double form(const facet_covariance *c, double au, double av, double bu, double bv)
{
    return au * bu * c->xx + (au * bv + av * bu) * c->xy + av * bv * c->yy;
}

facet_covariance facet_covariance_transform(const facet_covariance *c, double beta,
                                            const double j[4], facet_covariance *magnitude)
{
    const double ux = beta * j[0], uy = beta * j[1], vx = beta * j[2], vy = beta * j[3];
    if (magnitude) {
        const facet_covariance a = {c->xx, c->yy, fabs(c->xy)};
        const double x[2] = {fabs(ux), fabs(vx)}, y[2] = {fabs(uy), fabs(vy)};
        *magnitude = (facet_covariance){form(&a, x[0], x[1], x[0], x[1]),
                                        form(&a, y[0], y[1], y[0], y[1]),
                                        form(&a, x[0], x[1], y[0], y[1])};
    }
    return (facet_covariance){form(c, ux, vx, ux, vx), form(c, uy, vy, uy, vy),
                              form(c, ux, vx, uy, vy)};
}

bool facet_moments_readable(const facet_roughness *r, facet_moments *m, double *difference)
{
    facet_roughness inside = *r, back;
    for (double by = DBL_EPSILON; by < FORM_NEAR; by *= 2) {
        *m = facet_moments_from_roughness(&inside);
        const facet_covariance c = facet_covariance_from_moments(m);
        if (!facet_roughness_from_covariance(&c, m->e1, m->e2, &back)) {
            *difference = facet_roughness_difference(r, &back);
            return *difference <= FORM_NEAR;
        }
        inside = facet_roughness_inside(r, by);
    }
    return false;
}
