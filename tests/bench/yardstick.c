#include "yardstick.h"

#include <math.h>

static const double pi = 3.14159265358979323846;

struct vec {
    double x, y, z;
};

static double dot(struct vec a, struct vec b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static struct vec normalize(struct vec v)
{
    double inverse = 1 / sqrt(dot(v, v));
    return (struct vec){v.x * inverse, v.y * inverse, v.z * inverse};
}

struct yardstick yardstick_of(const facet_material *m)
{
    const facet_roughness *r = &m->roughness;
    return (struct yardstick){
        m->ndf,     r->alpha_x, r->alpha_y,      r->rho,           sqrt(1 - r->rho * r->rho),
        r->slope_x, r->slope_y, m->fresnel.kind, m->fresnel.f0[0], m->fresnel.eta[0]};
}

/* Table 2.II. */
static double p22_radial(const struct yardstick *m, double r_sqr)
{
    if (m->ndf == FACET_BECKMANN) return exp(-r_sqr) / pi;
    double t = 1 + r_sqr;
    return 1 / (pi * t * t);
}

/* Table 2.IV. */
static double g1_radial(const struct yardstick *m, double cot_theta_k)
{
    double v = cot_theta_k;
    if (m->ndf == FACET_BECKMANN) return 2 / (1 + erf(v) + exp(-v * v) / (v * sqrt(pi)));
    return 2 / (1 + sqrt(1 + 1 / (v * v)));
}

/* Listing 3.1, and 2.7 with its kappa. */
static double ndf(const struct yardstick *m, struct vec h)
{
    if (!(h.z > 0)) return 0;
    double cos_theta_h_sqr = h.z * h.z;
    double x = -h.x / h.z - m->tx_n, y = -h.y / h.z - m->ty_n;
    double nrm = m->ax * m->ay * m->sqrt_one_minus_rho_sqr;
    double x_ = x / m->ax, y_ = (m->ax * y - m->rho * m->ay * x) / nrm;
    return p22_radial(m, x_ * x_ + y_ * y_) / nrm / (cos_theta_h_sqr * cos_theta_h_sqr);
}

/* Listing 3.2 with 2.12; without its epsilons, which are wrong by as much. */
static double g1(const struct yardstick *m, struct vec k)
{
    double a = k.x * m->ax + k.y * m->ay * m->rho;
    double b = k.y * m->ay * m->sqrt_one_minus_rho_sqr;
    double c = k.z - k.x * m->tx_n - k.y * m->ty_n;
    if (!(k.z > 0 && c > 0)) return 0;
    struct vec kprime = normalize((struct vec){a, b, c});
    if (kprime.z >= 1) return k.z / c;
    double cot_theta_k = kprime.z / sqrt(1 - kprime.z * kprime.z);
    return g1_radial(m, cot_theta_k) * (k.z / c);
}

/* Table 2.I. */
static double fresnel(const struct yardstick *m, double zd)
{
    if (m->fresnel == FACET_FRESNEL_SCHLICK) {
        double c1 = 1 - zd, c2 = c1 * c1;
        return m->f0 + (1 - m->f0) * (c2 * c2 * c1);
    }
    if (m->fresnel == FACET_FRESNEL_DIELECTRIC) {
        double g2 = m->eta * m->eta + zd * zd - 1;
        if (g2 < 0) return 1;
        double g = sqrt(g2), r = (g - zd) / (g + zd);
        double p = (zd * (g + zd) - 1) / (zd * (g - zd) + 1);
        return 0.5 * r * r * (1 + p * p);
    }
    return 1;
}

/* Listing 2.5. */
static double gaf(const struct yardstick *m, struct vec i, struct vec o)
{
    double g1_o = g1(m, o), g1_i = g1(m, i), tmp = g1_i * g1_o;
    return tmp > 0 ? tmp / (g1_i + g1_o - tmp) : 0;
}

/* Listing 2.2. */
static double evalp(const struct yardstick *m, struct vec i, struct vec o)
{
    struct vec h = normalize((struct vec){i.x + o.x, i.y + o.y, i.z + o.z});
    double g = gaf(m, i, o);
    if (!(g > 0)) return 0;
    return fresnel(m, dot(o, h)) * ndf(m, h) * g / (4 * o.z);
}

double yardstick_eval(const struct yardstick *m, facet_quantity quantity, const double wi[3],
                      const double wo[3])
{
    struct vec i = {wi[0], wi[1], wi[2]}, o = {wo[0], wo[1], wo[2]};
    struct vec h = normalize((struct vec){i.x + o.x, i.y + o.y, i.z + o.z});
    switch (quantity) {
    case FACET_FR: return evalp(m, i, o) / i.z;
    case FACET_FR_COS: return evalp(m, i, o);
    case FACET_PDF: return g1(m, o) / o.z * dot(o, h) * ndf(m, h) / (4 * dot(o, h));
    case FACET_D: return ndf(m, h);
    case FACET_D_VIS: return g1(m, o) / o.z * dot(o, h) * ndf(m, h);
    case FACET_G: return gaf(m, i, o);
    case FACET_G1_I: return g1(m, i);
    case FACET_G1_O: return g1(m, o);
    case FACET_F: return fresnel(m, dot(o, h));
    default: return o.z / g1(m, o);
    }
}
