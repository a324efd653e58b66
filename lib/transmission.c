/* transmission.c - rough dielectrics: the surface from both sides, and both lobes of a pair. */
#include "transmission.h"

#include "batch.h"
#include "opposite.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

/* ---- From a material ------------------------------------------------------------------ */

static facet_status check(const facet_material *m, facet_transport transport)
{
    bool smith = m->masking == FACET_SMITH || m->masking == FACET_SMITH_UNCORRELATED;
    bool shaped = m->ndf == FACET_GGX || m->ndf == FACET_BECKMANN;
    const facet_roughness *r = &m->roughness;
    if (!shaped || !smith || m->shear != FACET_ENERGY_SAFE || (unsigned)transport >= FACET_TRANSPORT_COUNT ||
        m->fresnel.kind != FACET_FRESNEL_DIELECTRIC || m->fresnel.channels != 1)
        return FACET_UNSUPPORTED;
    facet_status status = facet_roughness_check(r);
    if (status) return status;
    double lean = hypot(r->slope_x, r->slope_y), least = facet_roughness_to_ellipse(r).alpha_2;
    if (m->ndf == FACET_BECKMANN && lean > FACET_TRANSMISSION_LEAN_MAX * least) return FACET_UNSUPPORTED;
    return m->fresnel.eta[0] == 1 ? FACET_BAD_FRESNEL : FACET_OK;
}

/* From below, n is 1/eta, which is no double: its Fresnel term gets n^2 - 1 in twice the digits. */
static facet_status open_sides(const facet_material *material, facet_bsdf *b)
{
    facet_material m = *material;
    const struct pair one = { 1, 0 }, eta = { m.fresnel.eta[0], 0 };
    facet_status status = facet_brdf_create(&m, &b->side[ABOVE].brdf);
    b->side[ABOVE] = (struct side){ .index = eta.hi, .outer = one, .inner = eta, .brdf = b->side[ABOVE].brdf };
    b->side[BELOW] = (struct side){ .index = 1 / eta.hi, .outer = eta, .inner = one };
    m.fresnel.eta[0] = fmin(fmax(b->side[BELOW].index, FACET_ETA_MIN), FACET_ETA_MAX);
    if (!status) status = facet_brdf_create(&m, &b->side[BELOW].brdf);
    m.fresnel.kind = FACET_FRESNEL_IDEAL;
    if (!status) status = facet_brdf_create(&m, &b->ideal);
    if (status) return status;
    const struct kernel_fresnel *above = &b->side[ABOVE].brdf->fresnel[0];
    struct kernel_fresnel *below = &b->side[BELOW].brdf->fresnel[0];
    struct pair excess = { -above->excess, -above->excess_low };
    excess = pair_quotient(excess, pair_product(eta, eta));
    below->excess = excess.hi;
    below->excess_low = excess.lo;
    for (int i = 0; i < SIDES; i++) b->side[i].excess = b->side[i].brdf->fresnel[0].excess;
    return FACET_OK;
}

facet_status facet_bsdf_create(const facet_material *material, facet_transport transport, facet_bsdf **bsdf)
{
    *bsdf = NULL;
    facet_status status = check(material, transport);
    if (status) return status;
    facet_bsdf *b = calloc(1, sizeof *b);
    if (!b) return FACET_NO_MEMORY;
    b->ndf = material->ndf;
    b->is_correlated = material->masking == FACET_SMITH;
    b->transport = transport;
    status = open_sides(material, b);
    if (status)
        facet_bsdf_destroy(b);
    else
        *bsdf = b;
    return status;
}

void facet_bsdf_destroy(facet_bsdf *b)
{
    if (!b) return;
    for (int i = 0; i < SIDES; i++) facet_brdf_destroy(b->side[i].brdf);
    facet_brdf_destroy(b->ideal);
    free(b);
}

/* ---- One pair -------------------------------------------------------------------------- */

double facet_transmittance(double n, double c, double g)
{
    double s = c + g, p = n * n * c + g;
    return 2 * c * g * (1 / (s * s) + n * n / (p * p));
}

double facet_transport_scale(const facet_bsdf *b, int side)
{
    double n = b->side[side].index;
    return b->transport == FACET_RADIANCE ? 1 / (n * n) : 1;
}

double facet_transmission_masking(const facet_bsdf *b, double sigma_o, double cosine_o, double sigma_i,
                                  double cosine_i)
{
    if (!(cosine_i > 0)) return 0;
    if (!b->is_correlated) return fmin(cosine_i / sigma_i, 1);
    if (!(cosine_o > 0)) return 0; /* the limit: only the highest facets are seen */
    return facet_opposite(sigma_o / cosine_o, fmax(sigma_i - cosine_i, 0) / cosine_i);
}

static struct pair dot(double *const v[3], const struct pair m[3], int i)
{
    struct pair sum = pair_product(m[0], (struct pair){ v[0][i], 0 });
    for (int j = 1; j < 3; j++) sum = pair_add(sum, pair_product(m[j], (struct pair){ v[j][i], 0 }));
    return sum;
}

/*
 * eta_o wo + eta_i wi = eta_o M turned up, as high and low parts (products of doubles, so that
 * nothing is lost where they cancel), and what follows from it but D.
 */
static void find_normal(const facet_bsdf *b, struct lobes *l, int i, double *const high[3], double *const low[3])
{
    const struct side *side = &b->side[l->side[i]];
    double *const wi[3] = { l->wi[0], l->wi[1], l->wi[2] }, *const wo[3] = { l->wo[0], l->wo[1], l->wo[2] };
    struct pair m[3];
    for (int j = 0; j < 3; j++)
        m[j] = pair_add(pair_product(side->outer, (struct pair){ wo[j][i], 0 }), pair_product(side->inner, (struct pair){ wi[j][i], 0 }));
    bool is_down = m[2].hi < 0;
    double length2 = 0;
    for (int j = 0; j < 3; j++) {
        if (is_down) m[j] = pair_negative(m[j]);
        high[j][i] = m[j].hi;
        low[j][i] = m[j].lo;
        length2 += m[j].hi * m[j].hi;
    }
    double n = side->index, length = sqrt(length2), to_o = dot(wo, m, i).hi, to_i = -dot(wi, m, i).hi;
    l->cosine[i] = l->F[i] = l->jacobian[i] = l->transmitted.pdf[i] = 0;
    if (!(to_o > 0 && to_i > 0)) return;
    double c = to_o / length, g = n * (to_i / length), shrunk = length / side->outer.hi;
    double c_less_g = is_down ? -shrunk : shrunk;
    double s = c_less_g / (c + g), p = (side->excess * c + c_less_g) / (n * n * c + g);
    l->cosine[i] = c;
    l->F[i] = 0.5 * (s * s + p * p);
    l->jacobian[i] = n * g / (shrunk * shrunk);
    l->transmitted.pdf[i] = facet_transmittance(n, c, g); /* the rest of it when D is there */
}

void facet_lobes_turn(struct lobes *l, facet_vec3_in wi, facet_vec3_in wo, size_t start, size_t n)
{
    const double *const from[6] = { wi.x, wi.y, wi.z, wo.x, wo.y, wo.z };
    for (size_t i = 0; i < n; i++) {
        l->side[i] = facet_side(wo.z[start + i]);
        double sign = l->side[i] == BELOW ? -1 : 1;
        for (int j = 0; j < 3; j++) {
            l->wi[j][i] = sign * from[j][start + i];
            l->wo[j][i] = sign * from[3 + j][start + i];
        }
    }
}

facet_status facet_lobes_fresnel(const facet_bsdf *b, struct lobes *l, size_t n)
{
    double value[TRANSMISSION_BLOCK];
    facet_vec3_in wi = { l->wi[0], l->wi[1], l->wi[2] }, wo = { l->wo[0], l->wo[1], l->wo[2] };
    const facet_outputs outputs = { .of = { [FACET_F] = { value } } };
    for (int side = 0; side < SIDES; side++) {
        bool any = false;
        for (size_t i = 0; i < n; i++) any = any || l->side[i] == side;
        if (!any) continue;
        facet_status status = facet_eval(b->side[side].brdf, FACET_PRECISE, wi, wo, n, &outputs);
        if (status) return status;
        for (size_t i = 0; i < n; i++)
            if (l->side[i] == side) l->fresnel[i] = value[i];
    }
    return FACET_OK;
}

/* pdf and weight of the ideal reflection, and both projected areas. */
static facet_status reflect(const facet_bsdf *b, struct lobes *l, size_t n)
{
    double minus_wi[3][TRANSMISSION_BLOCK];
    struct batch batch = { .brdf = b->ideal, .tier = FACET_PRECISE }, below = batch;
    for (int j = 0; j < 3; j++) {
        for (size_t i = 0; i < n; i++) minus_wi[j][i] = -l->wi[j][i];
        batch.wi[j] = facet_doubles(l->wi[j]);
        batch.wo[j] = facet_doubles(l->wo[j]);
        below.wi[j] = below.wo[j] = facet_doubles(minus_wi[j]);
    }
    batch.out[KERNEL_PDF][0] = facet_doubles(l->reflected.pdf);
    batch.out[KERNEL_WEIGHT][0] = facet_doubles(l->reflected.weight);
    batch.out[KERNEL_SIGMA_O][0] = facet_doubles(l->sigma_o);
    below.out[KERNEL_SIGMA_O][0] = facet_doubles(l->sigma_i);
    facet_batch_run(&batch, n);
    facet_batch_run(&below, n);
    facet_status status = facet_lobes_fresnel(b, l, n);
    for (size_t i = 0; i < n; i++) l->reflected.pdf[i] *= l->fresnel[i];
    return status;
}

facet_status facet_lobes_eval(const facet_bsdf *b, struct lobes *l, size_t n)
{
    double high[3][TRANSMISSION_BLOCK], low[3][TRANSMISSION_BLOCK];
    double *const to_high[3] = { high[0], high[1], high[2] }, *const to_low[3] = { low[0], low[1], low[2] };
    facet_status status = reflect(b, l, n);
    if (status) return status;
    for (size_t i = 0; i < n; i++) find_normal(b, l, (int)i, to_high, to_low);
    /* D sees H = wi + wo alone, which in precise it forms in twice the digits: M as it is. */
    facet_vec3_in first = { high[0], high[1], high[2] }, rest = { low[0], low[1], low[2] };
    const facet_outputs density = { .of = { [FACET_D] = { l->D } } };
    status = facet_eval(b->ideal, FACET_PRECISE, first, rest, n, &density);
    for (size_t i = 0; i < n; i++) {
        if (l->cosine[i] == 0) l->D[i] = 0;
        l->transmitted.pdf[i] *= l->cosine[i] * l->jacobian[i] * (l->D[i] / fmax(l->sigma_o[i], DBL_MIN));
        double x = -l->wi[0][i], y = -l->wi[1][i], z = -l->wi[2][i];
        l->transmitted.weight[i] = 0;
        if (!(z > 0 && l->wo[2][i] > 0)) continue;
        double cosine_o = facet_mean_cosine(&b->ideal->surface, l->wo[0][i], l->wo[1][i], l->wo[2][i]);
        l->transmitted.weight[i] = facet_transmission_masking(b, l->sigma_o[i], cosine_o, l->sigma_i[i],
                                                              facet_mean_cosine(&b->ideal->surface, x, y, z));
    }
    return status;
}

/* ---- Quantities --------------------------------------------------------------------------- */

/* x/y without infinity; 0 for 0/0. */
static double over(double x, double y)
{
    return x > 0 ? fmin(x / y, DBL_MAX) : 0;
}

/* Of a pair with wi on the other side. */
static double across(const facet_bsdf *b, const struct lobes *l, size_t i, int quantity)
{
    double zi = -l->wi[2][i], zo = l->wo[2][i], scale = facet_transport_scale(b, l->side[i]);
    double fr_cos = fmin(l->transmitted.pdf[i] * l->transmitted.weight[i] * scale, DBL_MAX);
    switch (quantity) {
    case FACET_FR: return over(fr_cos, zi);
    case FACET_FR_COS: return fr_cos;
    case FACET_D: return l->D[i];
    case FACET_D_VIS: return over(l->D[i] * l->cosine[i], l->sigma_o[i]);
    case FACET_G: return over(l->transmitted.weight[i] * zo, l->sigma_o[i]);
    case FACET_G1_I: return over(zi, l->sigma_i[i]);
    case FACET_G1_O: return over(zo, l->sigma_o[i]);
    case FACET_F: return l->F[i];
    default: return l->sigma_o[i];
    }
}

static facet_status eval_block(const facet_bsdf *b, struct lobes *l, size_t n, size_t start,
                               const facet_outputs *outputs)
{
    facet_vec3_in wi = { l->wi[0], l->wi[1], l->wi[2] }, wo = { l->wo[0], l->wo[1], l->wo[2] };
    facet_outputs same = { 0 };
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        if (outputs->of[q][0]) same.of[q][0] = outputs->of[q][0] + start;
    facet_status status = facet_lobes_eval(b, l, n);
    if (!status) status = facet_eval(b->ideal, FACET_PRECISE, wi, wo, n, &same);
    for (int q = 0; q < FACET_QUANTITY_COUNT && !status; q++) {
        double *to = same.of[q][0];
        for (size_t i = 0; to && i < n; i++) {
            if (q == FACET_PDF)
                to[i] = fmin(l->reflected.pdf[i] + l->transmitted.pdf[i], DBL_MAX);
            else if (l->wi[2][i] < 0)
                to[i] = across(b, l, i, q);
            else if (q == FACET_F || q == FACET_FR || q == FACET_FR_COS)
                to[i] *= l->fresnel[i]; /* of F = 1 */
        }
    }
    return status;
}

facet_status facet_bsdf_eval(const facet_bsdf *b, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                             const facet_outputs *outputs)
{
    struct lobes lobes;
    facet_status status = FACET_OK;
    for (size_t start = 0, size; start < n && !status; start += size) {
        size = n - start < TRANSMISSION_BLOCK ? n - start : TRANSMISSION_BLOCK;
        facet_lobes_turn(&lobes, wi, wo, start, size);
        status = eval_block(b, &lobes, size, start, outputs);
    }
    return status;
}
