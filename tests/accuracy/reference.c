#include "reference.h"

#include <quadmath.h>

/* value = factor exp(exponent) */
struct scaled {
    quad factor, exponent;
};

static quad larger(quad a, quad b)
{
    return a > b ? a : b;
}

static quad smaller(quad a, quad b)
{
    return a < b ? a : b;
}

static quad value(struct scaled x)
{
    return x.factor == 0 ? 0 : x.factor * expq(x.exponent);
}

/* 1/sqrt(pi) - w erfcx(w), w >= 0: what is left of Beckmann's projected area behind the horizon. */
static quad beckmann_psi(quad w)
{
    const quad from_series = 12;
    if (w < from_series) return 1 / sqrtq(M_PIq) - w * expq(w * w) * erfcq(w);
    /* Asymptotic series of erfcx; its smallest term here is below exp(-w^2) < 1e-62. */
    quad term = 1 / (2 * w * w), sum = 0;
    for (int n = 1; n < 100; n++) {
        sum += term;
        quad next = -term * (2 * n + 1) / (2 * w * w);
        if (fabsq(next) >= fabsq(term) || fabsq(next) < sum * FLT128_EPSILON) break;
        term = next;
    }
    return sum / sqrtq(M_PIq);
}

struct reference_roughness reference_roughness(const facet_roughness *r)
{
    quad rho = (quad)r->rho + r->low.rho;
    return (struct reference_roughness){(quad)r->alpha_x + r->low.alpha_x,
                                        (quad)r->alpha_y + r->low.alpha_y, rho,
                                        sqrtq(1 - rho * rho)};
}

struct reference_view reference_project(const facet_roughness *m, const quad k[3])
{
    struct reference_view v;
    struct reference_roughness r = reference_roughness(m);
    quad x = k[0], y = k[1], z = k[2];
    v.a = r.alpha_x * x + r.rho * r.alpha_y * y;
    v.b = r.alpha_y * r.kappa * y;
    v.c = z - x * m->slope_x - y * m->slope_y;
    v.s = sqrtq(v.a * v.a + v.b * v.b);
    return v;
}

/*
 * sigma = integral of max(0, c - s x) p(x) dx = s integral_{-inf}^{v} CDF(x) dx, v = c/s, where p
 * is the marginal of the standard slope density: GGX CDF = (1 + x/sqrt(1+x^2))/2, Beckmann
 * CDF = erfc(-x)/2.  Both integrate in closed form; behind the horizon the difference is
 * rationalised.
 */
static struct scaled projected_area(facet_ndf ndf, struct reference_view k)
{
    struct scaled area = {larger(k.c, 0), 0};
    if (k.s == 0) return area;
    quad v = k.c / k.s;
    if (ndf == FACET_GGX) {
        quad root = sqrtq(k.s * k.s + k.c * k.c);
        area.factor = k.c >= 0 ? (k.c + root) / 2 : k.s * k.s / (2 * (root - k.c));
    } else if (k.c >= 0) {
        area.factor = (k.c * erfcq(-v) + k.s * expq(-v * v) / sqrtq(M_PIq)) / 2;
    } else {
        area.factor = k.s * beckmann_psi(-v) / 2;
        area.exponent = -v * v;
    }
    return area;
}

quad reference_sigma(const facet_material *m, const double k[3])
{
    const quad exact[3] = {k[0], k[1], k[2]};
    return value(projected_area(m->ndf, reference_project(&m->roughness, exact)));
}

/* D = P(slopes of H) sec^4 theta_h (thesis eqs. 2.11, 2.26 and 3.2). */
static struct scaled normal_density(const facet_material *m, const quad H[3])
{
    struct scaled d = {0, 0};
    if (!(H[2] > 0)) return d;
    struct reference_roughness r = reference_roughness(&m->roughness);
    quad x = (-H[0] / H[2] - m->roughness.slope_x) / r.alpha_x;
    quad y = ((-H[1] / H[2] - m->roughness.slope_y) / r.alpha_y - r.rho * x) / r.kappa;
    quad radius2 = x * x + y * y;
    quad sec2 = (H[0] * H[0] + H[1] * H[1] + H[2] * H[2]) / (H[2] * H[2]);
    d.factor = sec2 * sec2 / (M_PIq * r.alpha_x * r.alpha_y * r.kappa);
    if (m->ndf == FACET_GGX)
        d.factor /= (1 + radius2) * (1 + radius2);
    else
        d.exponent = -radius2;
    return d;
}

quad reference_ndf(const facet_material *m, const quad H[3])
{
    return value(normal_density(m, H));
}

/* ---- Fresnel ----------------------------------------------------------------------- */

struct complex_quad {
    quad re, im;
};

static struct complex_quad complex_square_root(struct complex_quad z)
{
    quad size = sqrtq(z.re * z.re + z.im * z.im);
    struct complex_quad root;
    if (z.re >= 0) { /* the larger part first, the other from 2 re im = im z: no cancellation */
        root.re = sqrtq((size + z.re) / 2);
        root.im = root.re == 0 ? 0 : z.im / (2 * root.re);
    } else {
        root.im = sqrtq((size - z.re) / 2);
        root.re = z.im / (2 * root.im);
    }
    return root;
}

/* |(p - q) / (p + q)|^2 */
static quad amplitude(struct complex_quad p, struct complex_quad q)
{
    quad minus = (p.re - q.re) * (p.re - q.re) + (p.im - q.im) * (p.im - q.im);
    quad plus = (p.re + q.re) * (p.re + q.re) + (p.im + q.im) * (p.im + q.im);
    return plus == 0 ? 1 : minus / plus;
}

/* Fresnel's amplitudes for the index n = eta + i k: t = sqrt(n^2 - sin^2), r_s and r_p. */
static quad fresnel_amplitudes(quad eta, quad k, quad c)
{
    struct complex_quad n2 = {eta * eta - k * k, 2 * eta * k};
    struct complex_quad t = complex_square_root((struct complex_quad){n2.re - (1 - c * c), n2.im});
    struct complex_quad cosine = {c, 0}, n2c = {n2.re * c, n2.im * c};
    return (amplitude(cosine, t) + amplitude(n2c, t)) / 2;
}

quad reference_fresnel_table_2_1(quad eta, quad c)
{
    quad g2 = eta * eta + c * c - 1;
    if (g2 < 0) return 1;
    quad g = sqrtq(g2), ratio = (g - c) / (g + c);
    quad p = (c * (g + c) - 1) / (c * (g - c) + 1);
    return ratio * ratio * (1 + p * p) / 2;
}

static quad fresnel_nodes(const facet_fresnel *f, quad c, size_t channel)
{
    const double *x = f->cos_theta_d, *y = f->values[channel];
    if (c <= x[0]) return y[0];
    for (size_t i = 1; i < f->count; i++)
        if (c <= x[i]) {
            quad step = (quad)x[i] - x[i - 1];
            return (y[i - 1] * (x[i] - c) + y[i] * (c - x[i - 1])) / step;
        }
    return y[f->count - 1];
}

quad reference_fresnel(const facet_fresnel *f, quad c, size_t channel)
{
    quad f0 = f->f0[channel];
    switch (f->kind) {
    case FACET_FRESNEL_SCHLICK: return f0 + (1 - f0) * powq(larger(0, 1 - c), 5);
    case FACET_FRESNEL_DIELECTRIC: return fresnel_amplitudes(f->eta[channel], 0, c);
    case FACET_FRESNEL_CONDUCTOR: return fresnel_amplitudes(f->eta[channel], f->k[channel], c);
    case FACET_FRESNEL_TABLE: return fresnel_nodes(f, c, channel);
    default: return 1;
    }
}

/* ---- Masking ----------------------------------------------------------------------- */

/* What every masking needs of a pair; H2 = |H|^2, <k, h> = |H|/2. */
struct pair {
    facet_shear shear;
    quad zi, zo, Hz, H2;
    struct reference_view i, o;
    struct scaled sigma_i, sigma_o, d;
};

static struct scaled times(struct scaled a, quad factor)
{
    return (struct scaled){a.factor * factor, a.exponent};
}

static struct scaled over(struct scaled a, struct scaled b)
{
    if (a.factor == 0) return a;
    return (struct scaled){a.factor / b.factor, a.exponent - b.exponent};
}

/* V-cavity in the frame of the mean facet: m_k = min(1, 2 <k, n> <h, n> / <k, h>). */
static quad cavity(const struct pair *p, struct reference_view k)
{
    if (k.c <= 0 || p->Hz <= 0) return 0;
    return smaller(1, 4 * p->Hz * k.c / p->H2);
}

static quad thesis_condition(const struct pair *p)
{
    quad so = value(p->sigma_o), si = value(p->sigma_i);
    quad bottom = so * p->zi + p->zo * si - p->zo * p->zi;
    return (so * p->zi + p->zo * si + p->zo * p->zi) / fabsq(bottom);
}

static struct scaled smith_correlated(const struct pair *p)
{
    const struct scaled none = {0, 0};
    quad si = value(p->sigma_i), so = value(p->sigma_o);
    if (p->shear == FACET_THESIS) {
        quad bottom = so * p->zi + p->zo * (si - p->zi);
        return bottom > 0 ? (struct scaled){p->zi / bottom, 0} : none;
    }
    quad ci = p->i.c, co = p->o.c;
    if (ci <= 0) return none;
    if (co <= 0) return over((struct scaled){1, 0}, p->sigma_o);
    return (struct scaled){ci / (so * ci + (si - ci) * co), 0};
}

/* fr cos theta_i / (F D) * 4; the G of fr = F D G / (4 z_i z_o) is z_o times this. */
static struct scaled visibility(const struct pair *p, facet_masking masking)
{
    const struct scaled one = {1, 0}, none = {0, 0};
    if (p->zi <= 0 || p->zo <= 0) return none;
    quad c = p->shear == FACET_THESIS ? p->zi : p->i.c;
    switch (masking) {
    case FACET_SMITH: return smith_correlated(p);
    case FACET_SMITH_UNCORRELATED:
        return c <= 0 ? none : times(over(over(one, p->sigma_i), p->sigma_o), c);
    case FACET_VGROOVE:
        if (p->o.c <= 0) return none;
        return times(one, smaller(cavity(p, p->i), cavity(p, p->o)) / p->o.c);
    default: return times(one, 2 * p->Hz / p->H2);
    }
}

static quad monostatic(const struct pair *p, facet_masking masking, quad z, struct reference_view k,
                       struct scaled sigma)
{
    if (z <= 0) return 0;
    switch (masking) {
    case FACET_VGROOVE: return k.c <= 0 ? 0 : cavity(p, k) * z / k.c;
    case FACET_NONE: return p->Hz <= 0 ? 0 : 2 * z * p->Hz / p->H2;
    default: return value(over((struct scaled){z, 0}, sigma));
    }
}

static quad visible_density(const struct pair *p, facet_masking masking)
{
    if (p->d.factor == 0) return 0;
    quad kh = sqrtq(p->H2) / 2;
    switch (masking) {
    case FACET_VGROOVE: return p->o.c <= 0 ? 0 : cavity(p, p->o) * kh / p->o.c * value(p->d);
    case FACET_NONE: return value(p->d) * p->Hz / sqrtq(p->H2);
    default: return kh * value(over(p->d, p->sigma_o));
    }
}

void reference_eval_exact(const facet_material *m, const quad wi[3], const double wo[3],
                          const quad H[3], struct reference *result)
{
    const quad o[3] = {wo[0], wo[1], wo[2]};
    struct pair p = {.shear = m->shear, .zi = wi[2], .zo = wo[2], .Hz = H[2]};
    p.H2 = H[0] * H[0] + H[1] * H[1] + H[2] * H[2];
    p.i = reference_project(&m->roughness, wi);
    p.o = reference_project(&m->roughness, o);
    p.sigma_i = projected_area(m->ndf, p.i);
    p.sigma_o = projected_area(m->ndf, p.o);
    p.d = normal_density(m, H);

    struct scaled seen = visibility(&p, m->masking);
    struct scaled dv = {p.d.factor * seen.factor / 4, p.d.exponent + seen.exponent};
    quad specular = value(dv);
    for (size_t j = 0; j < (m->fresnel.channels == 3 ? 3 : 1); j++) {
        quad f = reference_fresnel(&m->fresnel, sqrtq(p.H2) / 2, j);
        result->of[FACET_F][j] = f;
        result->of[FACET_FR_COS][j] = f * specular;
        result->of[FACET_FR][j] = specular == 0 ? 0 : f * specular / p.zi;
    }
    result->of[FACET_D][0] = value(p.d);
    result->of[FACET_SIGMA_O][0] = value(p.sigma_o);
    result->of[FACET_PDF][0] = value(over(p.d, times(p.sigma_o, 4)));
    result->of[FACET_D_VIS][0] = visible_density(&p, m->masking);
    result->of[FACET_G][0] = value(times(seen, p.zo));
    result->of[FACET_G1_I][0] = monostatic(&p, m->masking, p.zi, p.i, p.sigma_i);
    result->of[FACET_G1_O][0] = monostatic(&p, m->masking, p.zo, p.o, p.sigma_o);
    result->condition = 1;
    if (m->shear == FACET_THESIS && m->masking == FACET_SMITH)
        result->condition = thesis_condition(&p);
}

void reference_eval(const facet_material *m, const double wi[3], const double wo[3],
                    struct reference *result)
{
    quad i[3], H[3];
    for (int j = 0; j < 3; j++) {
        i[j] = wi[j];
        H[j] = i[j] + wo[j];
    }
    reference_eval_exact(m, i, wo, H, result);
}

double reference_error(double y, quad x, double floor)
{
    if (!(y - y == 0)) return 1.0 / 0.0;
    return (double)(fabsq(y - x) / larger(fabsq(x), floor));
}
