#include "reference_samplers.h"

#include <quadmath.h>

static quad dot(const quad a[3], const quad b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static bool is_central(const facet_roughness *r)
{
    return r->slope_x == 0 && r->slope_y == 0;
}

/* ---- m and h ------------------------------------------------------------------------- */

/* h, of length 1, of the standard micronormal m, and back (m of any length). */
static void to_surface(const facet_roughness *r, const quad m[3], quad h[3])
{
    struct reference_roughness a = reference_roughness(r);
    h[0] = a.alpha_x * m[0] - r->slope_x * m[2];
    h[1] = a.alpha_y * (a.rho * m[0] + a.kappa * m[1]) - r->slope_y * m[2];
    h[2] = m[2];
    quad length = sqrtq(dot(h, h));
    for (int j = 0; j < 3; j++) h[j] /= length;
}

static void to_standard(const facet_roughness *r, const quad h[3], quad m[3])
{
    struct reference_roughness a = reference_roughness(r);
    m[0] = (h[0] + r->slope_x * h[2]) / a.alpha_x;
    m[1] = ((h[1] + r->slope_y * h[2]) / a.alpha_y - a.rho * m[0]) / a.kappa;
    m[2] = h[2];
    quad length = sqrtq(dot(m, m));
    for (int j = 0; j < 3; j++) m[j] /= length;
}

/* ---- bounded --------------------------------------------------------------------------- */

/* The axes of the ellipse: eigenvalues of the matrix of squared slopes. */
static void axes(const facet_roughness *r, quad *alpha_1, quad *alpha_2)
{
    struct reference_roughness a = reference_roughness(r);
    quad xx = a.alpha_x * a.alpha_x, yy = a.alpha_y * a.alpha_y, xy = a.rho * a.alpha_x * a.alpha_y;
    quad root = sqrtq((xx - yy) * (xx - yy) + 4 * xy * xy);
    *alpha_1 = sqrtq((xx + yy + root) / 2);
    *alpha_2 = sqrtq(xx * yy - xy * xy) / *alpha_1;
}

quad reference_bounded_share(const facet_material *material, const double wo[3])
{
    const facet_roughness *r = &material->roughness;
    if (!is_central(r) || !(wo[2] > 0) || material->ndf != FACET_GGX) return 1;
    quad alpha_1, alpha_2, x = wo[0], y = wo[1], side = sqrtq(x * x + y * y), sign = 1;
    axes(r, &alpha_1, &alpha_2);
    quad a = alpha_1 < alpha_2 ? alpha_1 : alpha_2;
    bool isotropic = r->alpha_x == r->alpha_y && r->rho == 0;
    if (a > 1 && isotropic) /* the tighter form: 1 - sin with alpha as it is */
        sign = -1;
    else if (a > 1)
        a = 1;
    quad q = 1 + sign * side, p = 1 - sign * side; /* z^2 = p q of a unit vector */
    return (1 - a * a) * q / (q + a * a * p);
}

/* C uniform on the directions with C_z > -K k'_z; m = C + k'. */
static void bounded(const facet_material *material, const double wo[3], quad u1, quad u2, quad m[3])
{
    const quad o[3] = {wo[0], wo[1], wo[2]};
    struct reference_view k = reference_project(&material->roughness, o);
    quad r = sqrtq(k.s * k.s + k.c * k.c), share = reference_bounded_share(material, wo);
    quad height = k.c >= 0 ? 1 + share * k.c / r : k.s * k.s / (r * (r - k.c));
    quad w = u2 * height, t = height * (1 - u2) - share * k.c / r,
         radius = sqrtq((1 - t) * (1 + t));
    if (share == 1) radius = sqrtq(w * (2 - w)), t = 1 - w;
    m[0] = radius * cosq(2 * M_PIq * u1) + k.a / r;
    m[1] = radius * sinq(2 * M_PIq * u1) + k.b / r;
    m[2] = share == 1 ? height - w : t + k.c / r;
}

static quad bounded_pdf(const facet_material *material, const double wo[3], const quad H[3])
{
    if (!(H[2] > 0)) return 0;
    const quad o[3] = {wo[0], wo[1], wo[2]};
    struct reference_view k = reference_project(&material->roughness, o);
    quad r = sqrtq(k.s * k.s + k.c * k.c), share = reference_bounded_share(material, wo), m[3];
    to_standard(&material->roughness, H, m);
    quad C = 2 * (k.a * m[0] + k.b * m[1] + k.c * m[2]) / r * m[2] - k.c / r; /* k' mirrored at m */
    /* Of a wo of length 1 nothing above the horizon is below the cap; of others it is not cut. */
    if (C < -share * k.c / r && H[2] <= wo[2]) return 0;
    quad d = reference_ndf(material, H);
    if (k.c < 0) return d * (r - k.c) / (2 * k.s * k.s); /* K = 1; r + c without the difference */
    return d / (2 * (share * k.c + r));
}

/* ---- ndf, slope, cosine -------------------------------------------------------------------- */

static void all_normals(facet_ndf ndf, quad u1, quad u2, quad m[3])
{
    quad radius = ndf == FACET_GGX ? sqrtq(u1 / (1 - u1)) : sqrtq(-log1pq(-u1));
    m[0] = radius * cosq(2 * M_PIq * u2);
    m[1] = radius * sinq(2 * M_PIq * u2);
    m[2] = 1;
}

/* D h_z/(4 |wo.h|) with h turned up; |wo.h| = |H|/2. */
static quad all_normals_pdf(const facet_material *material, const quad H[3])
{
    quad sign = H[2] < 0 ? -1 : 1, up[3] = {sign * H[0], sign * H[1], sign * H[2]}, h2 = dot(H, H);
    return H[2] == 0 ? 0 : reference_ndf(material, up) * up[2] / (2 * h2);
}

/* z with CDF 1/2 + (t + sin t cos t)/pi, t = atan z, by bisection on t; sine and cosine of t. */
static void across(quad u, quad *sine, quad *cosine)
{
    quad low = -M_PI_2q, high = M_PI_2q;
    for (int i = 0; i < 113; i++) {
        quad t = (low + high) / 2;
        if (t + sinq(t) * cosq(t) < M_PIq * (u - 0.5Q))
            low = t;
        else
            high = t;
    }
    *sine = sinq((low + high) / 2);
    *cosine = cosq((low + high) / 2);
}

/* tan of beta = asin(u1 (1 + c) - c) - theta along wo; sec(beta) z across. */
static void slope_ggx(const facet_material *material, const double wo[3], quad u1, quad u2,
                      quad m[3])
{
    const quad o[3] = {wo[0], wo[1], wo[2]};
    struct reference_view k = reference_project(&material->roughness, o);
    quad r = sqrtq(k.s * k.s + k.c * k.c), c = k.c / r, theta = atan2q(k.s, k.c);
    quad height = k.c >= 0 ? 1 + c : k.s * k.s / (r * (r - k.c)), sine, cosine;
    quad beta = asinq(u1 * height - c) - theta;
    across(u2, &sine, &cosine);
    quad x = sinq(beta) * cosine, y = sine, z = cosq(beta) * cosine; /* slopes times z */
    quad a = k.s > 0 ? k.a / k.s : 1, b = k.s > 0 ? k.b / k.s : 0;
    m[0] = -(x * a - y * b);
    m[1] = -(x * b + y * a);
    m[2] = z;
}

/* ---- V-cavities ------------------------------------------------------------------------------ */

struct reference_twins reference_vcavity(const facet_material *material, const double wo[3],
                                         double u1, double u2)
{
    const quad o[3] = {wo[0], wo[1], wo[2]};
    const facet_roughness *r = &material->roughness;
    struct reference_twins t;
    quad m[3], seen[2];
    all_normals(material->ndf, u1, u2, m);
    for (int i = 0; i < 2; i++) {
        to_surface(r, m, t.h[i]);
        quad cosine = dot(o, t.h[i]) / t.h[i][2];
        seen[i] = cosine > 0 ? cosine : 0;
        m[0] = -m[0], m[1] = -m[1]; /* the opposite slope, about the mean one */
    }
    t.chance = seen[0] + seen[1] > 0 ? seen[1] / (seen[0] + seen[1]) : 0;
    return t;
}

/*
 * The share of standard normals of radius r whose azimuth is less than psi from wo's (twice the
 * CDF at psi, less 1): the integral over [0, psi] of (1 - the chance of the twin) 2/pi, piece by piece.
 */
static quad azimuths_within(const struct reference_view *k, quad r, quad psi)
{
    quad e = k->s * r, edge = e > fabsq(k->c) ? acosq(fabsq(k->c) / e) : 0, other = M_PIq - edge;
    quad first = psi < edge ? psi : edge, middle = psi < edge ? edge : psi < other ? psi : other;
    quad sum = 2 * first + (middle - edge);
    if (k->c > 0) sum += e / k->c * (sinq(middle) - sinq(edge));
    return sum / M_PIq;
}

/* Radius by u1 as NDF, azimuth about wo's by u2 over (-pi, pi), by bisection. */
static void vcavity(const facet_material *material, const double wo[3], quad u1, quad u2, quad m[3])
{
    const quad o[3] = {wo[0], wo[1], wo[2]};
    struct reference_view k = reference_project(&material->roughness, o);
    quad radius = material->ndf == FACET_GGX ? sqrtq(u1 / (1 - u1)) : sqrtq(-log1pq(-u1));
    quad low = 0, high = M_PIq, target = fabsq(2 * u2 - 1), a = k.s > 0 ? k.a / k.s : 1,
         b = k.s > 0 ? k.b / k.s : 0;
    for (int i = 0; i < 113; i++) {
        quad psi = (low + high) / 2;
        *(azimuths_within(&k, radius, psi) < target ? &low : &high) = psi;
    }
    quad x = radius * cosq((low + high) / 2),
         y = radius * sinq((low + high) / 2) * (u2 < 0.5Q ? -1 : 1);
    m[0] = x * a - y * b;
    m[1] = x * b + y * a;
    m[2] = 1;
}

/* D h_z, twice that where the twin is not seen, times its share where both are, over 4 |wo.h|. */
quad reference_vcavity_pdf(const facet_material *material, const double wo[3], const quad H[3])
{
    const quad o[3] = {wo[0], wo[1], wo[2]};
    quad h2 = dot(H, H), sign = H[2] < 0 ? -1 : 1, up[3] = {sign * H[0], sign * H[1], sign * H[2]};
    if (H[2] == 0) return 0;
    quad own = sign * h2 / 2 / up[2]; /* wo.h/h_z */
    quad twin = 2 * reference_project(&material->roughness, o).c - own;
    quad share = own > 0 ? (twin > 0 ? 2 * own / (own + twin) : 2) : twin > 0 ? 0 : 1;
    return share * reference_ndf(material, up) * up[2] / (2 * h2);
}

quad reference_pdf_by(enum reference_method method, const facet_material *material,
                      const quad wi[3], const double wo[3], const quad H[3])
{
    struct reference all;
    switch (method) {
    case REFERENCE_BOUNDED: return bounded_pdf(material, wo, H);
    case REFERENCE_NDF: return all_normals_pdf(material, H);
    case REFERENCE_VCAVITY: return reference_vcavity_pdf(material, wo, H);
    case REFERENCE_SLOPE_GGX:
        reference_eval_exact(material, wi, wo, H, &all);
        return all.of[FACET_PDF][0];
    default: return wi[2] > 0 ? wi[2] / M_PIq : 0;
    }
}

/* wi and H = 2 (wo.h) h */
static void reflect(const double wo[3], const quad h[3], quad wi[3], quad H[3])
{
    const quad o[3] = {wo[0], wo[1], wo[2]};
    quad twice = 2 * dot(o, h);
    for (int j = 0; j < 3; j++) {
        H[j] = twice * h[j];
        wi[j] = H[j] - o[j];
    }
}

void reference_sample_by(enum reference_method method, const facet_material *material,
                         const double wo[3], double u1, double u2, struct reference_sample *result)
{
    quad m[3], H[3];
    if (method == REFERENCE_COSINE) {
        quad radius = sqrtq(u1), angle = 2 * M_PIq * u2, length = 0;
        result->wi[0] = radius * cosq(angle);
        result->wi[1] = radius * sinq(angle);
        result->wi[2] = sqrtq(1 - (quad)u1);
        for (int j = 0; j < 3; j++) H[j] = result->wi[j] + wo[j];
        length = sqrtq(dot(H, H));
        for (int j = 0; j < 3; j++) result->h[j] = H[j] / length;
    } else {
        if (method == REFERENCE_BOUNDED) bounded(material, wo, u1, u2, m);
        if (method == REFERENCE_NDF) all_normals(material->ndf, u1, u2, m);
        if (method == REFERENCE_VCAVITY) vcavity(material, wo, u1, u2, m);
        if (method == REFERENCE_SLOPE_GGX) slope_ggx(material, wo, u1, u2, m);
        to_surface(&material->roughness, m, result->h);
        reflect(wo, result->h, result->wi, H);
    }
    struct reference all;
    reference_eval_exact(material, result->wi, wo, H, &all);
    result->pdf = reference_pdf_by(method, material, result->wi, wo, H);
    for (int j = 0; j < 3; j++)
        result->weight[j] = all.of[FACET_FR_COS][j] == 0 ? 0
                                                         : all.of[FACET_FR_COS][j] / result->pdf;
}

/* ---- back to the random numbers ---------------------------------------------------------------- */

/* Of an angle, over one turn, in [0, 1). */
static quad turn_of(quad y, quad x)
{
    quad t = atan2q(y, x) / (2 * M_PIq);
    return t < 0 ? t + 1 : t;
}

/* Of the cap: C is k' mirrored at m. */
static void cap_uniforms(struct reference_view k, quad share, const quad m[3], quad u[2])
{
    quad r = sqrtq(k.s * k.s + k.c * k.c), c = k.c / r,
         along = 2 * (k.a * m[0] + k.b * m[1] + k.c * m[2]) / r;
    u[0] = turn_of(along * m[1] - k.b / r, along * m[0] - k.a / r);
    u[1] = 1 - (along * m[2] - c + share * c) / (1 + share * c);
}

/* CDF of the slope along wo, and given that across it. */
static void slope_uniforms(facet_ndf ndf, struct reference_view k, const quad m[3], quad u[2])
{
    quad r = sqrtq(k.s * k.s + k.c * k.c), a = k.s > 0 ? k.a / k.s : 1, b = k.s > 0 ? k.b / k.s : 0;
    quad x = -(m[0] * a + m[1] * b) / m[2], y = (m[0] * b - m[1] * a) / m[2];
    if (ndf == FACET_GGX) {
        quad t = atanq(y / sqrtq(1 + x * x)), c = k.c / r;
        u[0] = (sinq(atanq(x) + atan2q(k.s, k.c)) + c) / (1 + c);
        u[1] = 0.5Q + (t + sinq(t) * cosq(t)) / M_PIq;
    } else {
        quad v = k.s > 0 ? k.c / k.s : 99, e = k.s / sqrtq(M_PIq);
        u[0] = (k.c * erfcq(-x) + e * expq(-x * x)) / (k.c * erfcq(-v) + e * expq(-v * v));
        u[1] = erfcq(-y) / 2;
    }
}

void reference_uniforms(facet_sampler sampler, const facet_material *material, const double wo[3],
                        const quad wi[3], const quad h[3], quad u[2])
{
    const quad o[3] = {wo[0], wo[1], wo[2]};
    struct reference_view k = reference_project(&material->roughness, o);
    quad m[3], r2, a = k.s > 0 ? k.a / k.s : 1, b = k.s > 0 ? k.b / k.s : 0;
    if (sampler == FACET_SAMPLER_COSINE) {
        u[0] = wi[0] * wi[0] + wi[1] * wi[1];
        u[1] = turn_of(wi[1], wi[0]);
        return;
    }
    to_standard(&material->roughness, h, m);
    if (sampler == FACET_SAMPLER_SLOPE) return slope_uniforms(material->ndf, k, m, u);
    if (sampler == FACET_SAMPLER_CAPS) return cap_uniforms(k, 1, m, u);
    if (sampler == FACET_SAMPLER_BOUNDED)
        return cap_uniforms(k, reference_bounded_share(material, wo), m, u);
    r2 = (m[0] * m[0] + m[1] * m[1]) / (m[2] * m[2]);
    u[0] = material->ndf == FACET_GGX ? r2 / (1 + r2) : -expm1q(-r2);
    u[1] = turn_of(m[1], m[0]);
    if (sampler != FACET_SAMPLER_VCAVITY) return;
    quad psi = atan2q(m[1] * a - m[0] * b, m[0] * a + m[1] * b),
         share = azimuths_within(&k, sqrtq(r2), fabsq(psi));
    u[1] = 0.5Q + (psi < 0 ? -share : share) / 2;
}

/* ---- Glass -------------------------------------------------------------------------------------- */

/* From below everything is seen from the other end of each direction, with 1/eta. */
static quad relative_eta(const facet_material *material, const double wo[3], size_t channel)
{
    quad eta = material->fresnel.eta[channel];
    return wo[2] < 0 ? 1 / eta : eta;
}

static quad fresnel(quad eta, quad c)
{
    quad g2 = eta * eta - 1 + c * c, g = g2 > 0 ? sqrtq(g2) : 0;
    quad s = (c - g) / (c + g), p = (eta * eta * c - g) / (eta * eta * c + g);
    return g2 <= 0 ? 1 : (s * s + p * p) / 2;
}

bool reference_refracted(const facet_material *material, const double wo[3], const quad h[3],
                         size_t channel, quad wi[3])
{
    quad sign = wo[2] < 0 ? -1 : 1, eta = relative_eta(material, wo, channel);
    const quad o[3] = {sign * wo[0], sign * wo[1], sign * wo[2]};
    quad c = dot(o, h), g2 = eta * eta - 1 + c * c;
    if (!(c > 0) || !(g2 > 0)) return false;
    for (int j = 0; j < 3; j++) wi[j] = sign * ((c - sqrtq(g2)) * h[j] - o[j]) / eta;
    return true;
}

void reference_refract(const facet_material *material, const quad wi[3], const double wo[3],
                       size_t channel, struct reference_refraction *result)
{
    quad sign = wo[2] < 0 ? -1 : 1, eta = relative_eta(material, wo, channel), H[3];
    const quad i[3] = {sign * wi[0], sign * wi[1], sign * wi[2]};
    const double o[3] = {(double)sign * wo[0], (double)sign * wo[1], (double)sign * wo[2]};
    const quad oq[3] = {o[0], o[1], o[2]};
    *result = (struct reference_refraction){.fresnel = 1};
    for (int j = 0; j < 3; j++) H[j] = -(o[j] + eta * i[j]);
    quad length = sqrtq(dot(H, H)), turn = H[2] < 0 ? -1 : 1;
    if (length == 0) return;
    for (int j = 0; j < 3; j++) H[j] *= turn / length;
    quad oh = dot(oq, H), ih = dot(i, H);
    if (!(o[2] > 0 && i[2] < 0 && oh > 0 && ih < 0)) return;
    quad f = fresnel(eta, oh), d = reference_ndf(material, H), below[3] = {-i[0], -i[1], -i[2]};
    /* Masking of wo and of -wi, as if they were a pair of reflection. */
    double down[3] = {(double)below[0], (double)below[1], (double)below[2]};
    quad so = reference_sigma(material, o), si = reference_sigma(material, down);
    quad gi = below[2] / si, go = o[2] / so;
    quad g = material->masking == FACET_SMITH ? gi * go / (gi + go - gi * go) : gi * go;
    quad bottom = oh + eta * ih;
    result->jacobian = eta * eta * -ih / (bottom * bottom);
    result->fresnel = f;
    result->f = oh * result->jacobian * (1 - f) * d * g / (o[2] * below[2]);
    result->pdf = (1 - f) * oh * d / so * result->jacobian;
    for (int j = 0; j < 3; j++) result->h[j] = H[j];
}
