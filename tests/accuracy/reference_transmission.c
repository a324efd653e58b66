#include "reference_transmission.h"

#include <quadmath.h>

quad reference_opposite(quad a, quad b)
{
    quad least = fminq(a, b), most = fmaxq(a, b);
    if (least <= 0) return 1;
    /* Gamma(most + 1)/Gamma(most + 1 + least) is most^-least there, to least^2/most. */
    if (most > 1e15Q) return isinfq(most) ? 0 : expq(lgammaq(1 + least) - least * logq(most));
    return expq(lgammaq(1 + a) + lgammaq(1 + b) - lgammaq(1 + a + b));
}

static quad dot(const quad a[3], const quad b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* sigma of k on its own side, exponent and all; cosine: with the mean facet. */
static quad area(const facet_material *m, const double k[3], double side, quad *cosine)
{
    const double turned[3] = {side * k[0], side * k[1], side * k[2]};
    const quad exact[3] = {turned[0], turned[1], turned[2]};
    *cosine = reference_project(&m->roughness, exact).c;
    return reference_sigma(m, turned);
}

/* F of the cosines c and g = n cos theta_t. */
static quad reflectance(quad n, quad c, quad g)
{
    quad s = (c - g) / (c + g), p = (n * n * c - g) / (n * n * c + g);
    return (s * s + p * p) / 2;
}

static quad masked(const facet_material *m, quad so, quad co, quad si, quad ci)
{
    if (ci <= 0) return 0;
    if (m->masking == FACET_SMITH_UNCORRELATED) return ci / si;
    return co > 0 ? reference_opposite(so / co, si / ci - 1) : 0;
}

/* fr on wo's side: of the point reflection, with F. */
static void reflect(const facet_material *m, const double wi[3], const double wo[3], double side,
                    quad F, struct reference_bsdf *r)
{
    const double i[3] = {side * wi[0], side * wi[1], side * wi[2]},
                 o[3] = {side * wo[0], side * wo[1], side * wo[2]};
    facet_material ideal = *m;
    struct reference plain;
    ideal.fresnel.kind = FACET_FRESNEL_IDEAL;
    reference_eval(&ideal, i, o, &plain);
    r->of[FACET_FR] = F * plain.of[FACET_FR][0];
    r->of[FACET_FR_COS] = F * plain.of[FACET_FR_COS][0];
}

void reference_bsdf(const facet_material *m, facet_transport transport, const double wi[3],
                    const double wo[3], struct reference_bsdf *r)
{
    double side = wo[2] < 0 ? -1 : 1;
    quad eta = m->fresnel.eta[0], n = side > 0 ? eta : 1 / eta, M[3], H[3], i[3], o[3], so, co, si,
         ci;
    for (int j = 0; j < 3; j++) {
        i[j] = wi[j], o[j] = wo[j];
        M[j] = -(o[j] + n * i[j]);
        H[j] = (quad)side * (i[j] + o[j]);
    }
    quad up = M[2] < 0 ? -1 : 1, length = sqrtq(dot(M, M));
    for (int j = 0; j < 3; j++) M[j] *= up;
    so = area(m, wo, side, &co);
    si = area(m, wi, -side, &ci);
    quad c = (quad)side * dot(o, M) / length, cosine_i = -(quad)side * dot(i, M) / length,
         zi = fabsq(i[2]), zo = fabsq(o[2]);
    bool there = c > 0 && cosine_i > 0;
    quad D = there ? reference_ndf(m, M) : 0, F = there ? reflectance(n, c, n * cosine_i) : 0;
    quad jacobian = there ? n * n * cosine_i / ((c - n * cosine_i) * (c - n * cosine_i)) : 0;
    quad Hr = sqrtq(dot(H, H)) / 2, g2 = n * n - 1 + Hr * Hr;
    quad Fr = g2 > 0 ? reflectance(n, Hr, sqrtq(g2)) : 1;
    r->transmitted = there ? (1 - F) * c * D / so * jacobian : 0;
    r->reflected = Fr * reference_ndf(m, H) / (4 * so);
    quad W = zo > 0 && zi > 0 ? masked(m, so, co, si, ci) : 0,
         scale = transport == FACET_RADIANCE ? 1 / (n * n) : 1;
    r->of[FACET_FR_COS] = r->transmitted * W * scale;
    r->of[FACET_FR] = zi > 0 ? r->of[FACET_FR_COS] / zi : 0;
    r->of[FACET_PDF] = r->reflected + r->transmitted;
    r->of[FACET_D] = D;
    r->of[FACET_D_VIS] = c > 0 ? D * c / so : 0;
    r->of[FACET_G] = W * zo / so;
    r->of[FACET_G1_I] = zi / si;
    r->of[FACET_G1_O] = zo / so;
    r->of[FACET_F] = F;
    r->of[FACET_SIGMA_O] = so;
    if (side * wi[2] > 0) reflect(m, wi, wo, side, Fr, r);
}

bool reference_bsdf_sample(const facet_material *m, const double wo_[3], const double u[3],
                           quad wi[3])
{
    double turn = wo_[2] < 0 ? -1 : 1;
    const double wo[3] = {turn * wo_[0], turn * wo_[1], turn * wo_[2]};
    facet_material ideal = *m;
    ideal.fresnel.kind = FACET_FRESNEL_IDEAL;
    struct reference_sample s;
    reference_sample(&ideal, wo, u[0], u[1], &s);
    quad eta = m->fresnel.eta[0], n = turn > 0 ? eta : 1 / eta, c = 0;
    for (int j = 0; j < 3; j++) c += s.h[j] * wo[j];
    quad g2 = n * n - 1 + c * c, g = g2 > 0 ? sqrtq(g2) : 0;
    quad rs = (c - g) / (c + g), rp = (n * n * c - g) / (n * n * c + g),
         F = g2 > 0 ? (rs * rs + rp * rp) / 2 : 1;
    if (fabsq(F - u[2]) < 1e-5Q) return false; /* rounding may choose the other lobe */
    for (int j = 0; j < 3; j++)
        wi[j] = turn * (u[2] < F ? s.wi[j] : -(wo[j] + (g - c) * s.h[j]) / n);
    return true;
}
