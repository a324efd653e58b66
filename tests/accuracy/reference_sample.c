#include "reference.h"

#include <quadmath.h>

/* Spherical caps (Dupuy & Benyoub 2023): m ~ C + k', C uniform on the cap z > -k'_z. */
static void caps(struct reference_view k, quad u1, quad u2, quad m[3])
{
    quad r = sqrtq(k.s * k.s + k.c * k.c), z = k.c / r;
    quad height = k.c >= 0 ? 1 + z : k.s * k.s / (r * (r - k.c)); /* 1 + k'_z */
    quad w = u2 * height, radius = sqrtq(w * (2 - w)), angle = 2 * M_PIq * u1;
    m[0] = radius * cosq(angle) + k.a / r;
    m[1] = radius * sinq(angle) + k.b / r;
    m[2] = height - w; /* (1 - w) + k'_z */
}

/*
 * Distribution of visible slopes x <= v = c/s toward a direction:
 * F(x) sigma = integral_{-inf}^{x} (c - s t) exp(-t^2)/sqrt(pi) dt = (c erfc(-x) + s
 * exp(-x^2)/sqrt(pi))/2. Returned as log F(x), and its derivative.
 */
struct slope_law {
    quad c, s, v, log_norm;
};

static quad erfcx(quad w)
{
    if (w < 12) return expq(w * w) * erfcq(w);
    quad sum = 1, term = 1;
    for (int n = 1; n < 100; n++) {
        quad next = -term * (2 * n - 1) / (2 * w * w);
        if (fabsq(next) >= fabsq(term) || fabsq(next) < FLT128_EPSILON) break;
        sum += term = next;
    }
    return sum / (w * sqrtq(M_PIq));
}

/* log(2 sigma F(x)) */
static quad log_weight(const struct slope_law *l, quad x)
{
    if (x > -3) {
        quad sum = l->c * erfcq(-x) + l->s * expq(-x * x) / sqrtq(M_PIq);
        return sum > 0 ? logq(sum) : -HUGE_VALQ;
    }
    /* erfcx(w) = 1/(sqrt(pi) w) (1 - 1/(2 w^2) + ...): for c < 0 the two terms cancel 2 w^2 fold.
     */
    quad sum = l->c * erfcx(-x) + l->s / sqrtq(M_PIq);
    return sum > 0 ? logq(sum) - x * x : -HUGE_VALQ;
}

/* Bisect on log F, to the last bits: slow and safe. */
static quad quantile(const struct slope_law *l, quad u)
{
    quad high = l->v, low = l->v < 0 ? -sqrtq(l->v * l->v + 60) - 1 : -9, target = logq(u);
    if (high > 9) high = 9; /* u <= 1 - 2^-53: erfc(9) ~ 4e-37 */
    for (int i = 0; i < 112; i++) {
        quad middle = (low + high) / 2;
        if (middle <= low || middle >= high) break;
        if (log_weight(l, middle) - l->log_norm < target)
            low = middle;
        else
            high = middle;
    }
    return (low + high) / 2;
}

/* Visible slope along k by inversion, across k an independent normal variate (Heitz & d'Eon 2014). */
static void beckmann(struct reference_view k, quad u1, quad u2, quad m[3])
{
    struct slope_law along = {k.c, k.s, k.s > 0 ? k.c / k.s : 9, 0}, across = {1, 0, 9, 0};
    along.log_norm = log_weight(&along, along.v);
    across.log_norm = logq(2);
    quad x = quantile(&along, u1), y = quantile(&across, u2);
    quad cosine = k.s > 0 ? k.a / k.s : 1, sine = k.s > 0 ? k.b / k.s : 0;
    m[0] = -(x * cosine - y * sine);
    m[1] = -(x * sine + y * cosine);
    m[2] = 1;
}

void reference_sample(const facet_material *material, const double wo[3], double u1, double u2,
                      struct reference_sample *result)
{
    const facet_roughness *r = &material->roughness;
    const quad o[3] = {wo[0], wo[1], wo[2]};
    struct reference_view k = reference_project(r, o);
    struct reference_roughness a = reference_roughness(r);
    quad m[3], h[3], H[3];
    if (material->ndf == FACET_GGX)
        caps(k, u1, u2, m);
    else
        beckmann(k, u1, u2, m);
    h[0] = a.alpha_x * m[0] - r->slope_x * m[2];
    h[1] = a.alpha_y * (a.rho * m[0] + a.kappa * m[1]) - r->slope_y * m[2];
    h[2] = m[2];
    quad length = sqrtq(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
    quad oh = (o[0] * h[0] + o[1] * h[1] + o[2] * h[2]) / length;
    for (int j = 0; j < 3; j++) {
        result->h[j] = h[j] / length;
        H[j] = 2 * oh * result->h[j];
        result->wi[j] = H[j] - o[j];
    }
    struct reference all;
    reference_eval_exact(material, result->wi, wo, H, &all);
    result->pdf = all.of[FACET_PDF][0];
    for (int j = 0; j < 3; j++)
        result->weight[j] = all.of[FACET_FR_COS][j] == 0 ? 0
                                                         : all.of[FACET_FR_COS][j] / result->pdf;
}
