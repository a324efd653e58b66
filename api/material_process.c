/*
 * material_process.c - Beckmann surfaces made of others: moments of a map, stretched,
 * sheared and scaled (Dupuy section 3.4), on a rough surface below (section 5.1).
 *
 * All of it in means and covariances, so that no variance is a difference of large
 * numbers but where the moments sent are.
 */
#include "material.h"

#include "facet_forms.h"

#include <float.h>
#include <math.h>

#define M(member) MEMBER(struct material, member)
#define ALPHA .min = FACET_ALPHA_MIN, .max = FACET_ALPHA_MAX
#define AXIS .min = FACET_AXIS_MIN, .max = FACET_AXIS_MAX

/* The first of api_ndf_names: no other has a Beckmann roughness near it. */
static const char *const base_ndf_names[] = {"ggx", "beckmann", NULL};

const struct field api_base_fields[] = {
    {M(ndf), FIELD_ENUM, FIELD_DEFAULT, .names = base_ndf_names, .initial = FACET_BECKMANN,
     .doc =
         "beckmann, or ggx, which enters by the Beckmann roughness nearest to it, 1.113287 times "
         "as rough"},
    {M(alpha), FIELD_NUMBER, ALPHA, .doc = "isotropic roughness"},
    {M(alpha_x), FIELD_NUMBER, ALPHA, .doc = "roughness along x, with alpha_y"},
    {M(alpha_y), FIELD_NUMBER, ALPHA, .doc = "roughness along y, with alpha_x"},
    {M(rho), FIELD_NUMBER, .min = -FACET_RHO_MAX, .max = FACET_RHO_MAX,
     .doc = "correlation of the slopes, with alpha_x and alpha_y; 0 by default"},
    {M(alpha_1), FIELD_NUMBER, AXIS, .doc = "roughness along the first axis, with alpha_2"},
    {M(alpha_2), FIELD_NUMBER, AXIS, .doc = "roughness along the second axis, with alpha_1"},
    {M(phi), FIELD_NUMBER, .min = -FACET_PHI_MAX, .max = FACET_PHI_MAX, .unit = "rad",
     .doc = "the first axis lies at -phi, with alpha_1 and alpha_2; 0 by default"},
    {M(mean_slope), FIELD_NUMBERS, .min = -FACET_MEAN_SLOPE_MAX, .max = FACET_MEAN_SLOPE_MAX,
     .min_items = 2, .max_items = 2, .doc = "mean slope along x and y; [0,0] by default"},
    {0},
};

/* Its table refuses other distributions. */
bool api_base_check(void *object, const struct place *place, struct decoder *decoder)
{
    return api_roughness_check(object, place, decoder);
}

bool api_process_check(const struct material *m, const struct place *place, struct decoder *decoder)
{
    const struct place scale = {place, "height_scale", 0}, jacobian = {place, "jacobian", 0},
                       base = {place, "base", 0};
    if (!isnan(m->height_scale) && !m->moments.values)
        return api_problem_at(decoder->problem, &scale, "needs moments");
    if (m->jacobian.values && !m->moments.values)
        return api_problem_at(decoder->problem, &jacobian, "needs moments");
    if (m->base && m->ndf != FACET_BECKMANN)
        return api_problem_at(decoder->problem, &base,
                              "needs ndf \"beckmann\": other slopes have no variance to add to");
    return true;
}

/* Mean and covariance with the sums of their terms' absolute values. */
struct process {
    double x, y, terms_x, terms_y;
    facet_covariance c, terms;
};

static facet_covariance sum_of(const facet_covariance *a, const facet_covariance *b)
{
    return (facet_covariance){a->xx + b->xx, a->yy + b->yy, a->xy + b->xy};
}

static facet_covariance absolute(const facet_covariance *c)
{
    return (facet_covariance){c->xx, c->yy, fabs(c->xy)};
}

static void from_moments(const struct material *m, struct process *p)
{
    static const double identity[4] = {1, 0, 0, 1};
    const double *e = m->moments.values;
    const double *j = m->jacobian.values ? m->jacobian.values : identity;
    const double beta = isnan(m->height_scale) ? 1 : m->height_scale;
    const facet_moments moments = {e[0], e[1], e[2], e[3], e[4]};
    const facet_covariance c = facet_covariance_from_moments(&moments);
    *p = (struct process){.x = beta * (j[0] * e[0] + j[2] * e[1]),
                          .y = beta * (j[1] * e[0] + j[3] * e[1]),
                          .terms_x = fabs(beta) * (fabs(j[0] * e[0]) + fabs(j[2] * e[1])),
                          .terms_y = fabs(beta) * (fabs(j[1] * e[0]) + fabs(j[3] * e[1]))};
    p->c = facet_covariance_transform(&c, beta, j, &p->terms);
}

static void from_roughness(const facet_roughness *r, struct process *p)
{
    *p = (struct process){r->slope_x,
                          r->slope_y,
                          fabs(r->slope_x),
                          fabs(r->slope_y),
                          facet_covariance_from_roughness(r),
                          {0, 0, 0}};
    p->terms = absolute(&p->c);
}

/* Covariances are doubles: where a roughness has lows, its three parameters count as rounded. */
static double lost_by(const facet_roughness *r)
{
    return r->low.alpha_x != 0 || r->low.alpha_y != 0 || r->low.rho != 0 ? 2 : 0;
}

/*
 * Beckmann: alpha^2 = 2 variance (Dupuy 5.1), with what rounding did: an element of the
 * covariance is off by less than `rounds` DBL_EPSILON of its terms, which moves the slopes that
 * count by the same over the smaller eigenvalue, so by (S_xx C_yy + S_yy C_xx + 2 S_xy |C_xy|)/det.
 */
static bool set_roughness(const struct process *p, double rounds, const struct place *at,
                          struct decoder *decoder, struct surface *surface)
{
    const facet_covariance *c = &p->c, *s = &p->terms;
    const double det = fma(c->xx, c->yy, -c->xy * c->xy), gain = api_slope_gain(FACET_BECKMANN);
    if (!(c->xx > 0 && c->yy > 0 && det > 0))
        return api_problem_at(
            decoder->problem, at,
            "the covariance [[%.6g, %.6g], [%.6g, %.6g]] is not positive definite", c->xx, c->xy,
            c->xy, c->yy);
    facet_status status = facet_roughness_from_covariance(c, p->x, p->y, &surface->facet.roughness);
    if (status == FACET_BAD_MEAN_SLOPE)
        return api_problem_at(decoder->problem, at, "the mean slope is [%.6g, %.6g]: %s", p->x,
                              p->y, facet_status_text(status));
    if (status) return api_roughness_refuse(&surface->facet.roughness, status, at, decoder);
    surface->parameter_error += api_rounding_error(FACET_BECKMANN);
    if (rounds == 0) return true;
    const double spread = (s->xx * c->yy + s->yy * c->xx + 2 * s->xy * fabs(c->xy)) / det;
    const double minor = sqrt(2 * det / (c->xx + c->yy)); /* below the smaller alpha */
    surface->parameter_error += gain * rounds * DBL_EPSILON *
                                (spread + (p->terms_x + p->terms_y) / minor);
    return true;
}

bool api_process_open(const struct material *m, const facet_roughness *base,
                      const struct place *place, struct decoder *decoder, struct surface *surface)
{
    const struct place moments = {place, "moments", 0}, below = {place, "base", 0};
    struct process p;
    double rounds = 0;
    if (m->moments.values) {
        const double *mean = m->moments.values;
        from_moments(m, &p);
        if (mean[0] != 0 || mean[1] != 0) rounds += 1; /* E3 - E1^2 and so on, rounded */
        if (m->jacobian.values || !isnan(m->height_scale)) rounds += 4;
    } else {
        from_roughness(&surface->facet.roughness, &p);
        rounds += lost_by(&surface->facet.roughness);
    }
    if (m->base) {
        struct process b;
        facet_roughness r = *base;
        if (m->base->ndf == FACET_GGX) {
            r.alpha_x *= FACET_BECKMANN_OF_GGX;
            r.alpha_y *= FACET_BECKMANN_OF_GGX;
            surface->note = "the GGX base enters as the Beckmann roughness nearest to it";
        }
        from_roughness(&r, &b);
        rounds += lost_by(&r);
        p.c = sum_of(&p.c, &b.c);
        p.terms = sum_of(&p.terms, &b.terms);
        p.x += b.x;
        p.y += b.y;
        p.terms_x += b.terms_x;
        p.terms_y += b.terms_y;
        rounds += 4; /* a product of four factors, 2 roundings in a sum of two */
    }
    return set_roughness(&p, rounds, m->moments.values ? &moments : &below, decoder, surface);
}
