/* transmission.c - rough dielectrics: the surface from both sides, and batches of pairs. */
#include "transmission.h"

#include "batch.h"
#include "double_double.h"
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
    if (!shaped || !smith || m->shear != FACET_ENERGY_SAFE ||
        (unsigned)transport >= FACET_TRANSPORT_COUNT ||
        m->fresnel.kind != FACET_FRESNEL_DIELECTRIC || m->fresnel.channels != 1)
        return FACET_UNSUPPORTED;
    facet_status status = facet_roughness_check(r);
    if (status) return status;
    double lean = hypot(r->slope_x, r->slope_y), least = facet_roughness_to_ellipse(r).alpha_2;
    if (m->ndf == FACET_BECKMANN && lean > FACET_TRANSMISSION_LEAN_MAX * least)
        return FACET_UNSUPPORTED;
    return m->fresnel.eta[0] == 1 ? FACET_BAD_FRESNEL : FACET_OK;
}

/* From below, n is 1/eta, which is no double: its Fresnel term gets n^2 - 1 in twice the digits. */
static facet_status open_sides(const facet_material *material, facet_transport transport,
                               facet_bsdf *b)
{
    facet_material m = *material;
    const struct pair eta = {m.fresnel.eta[0], 0};
    const double index[SIDES] = {eta.hi, 1 / eta.hi};
    facet_status status = facet_brdf_create(&m, &b->brdf[ABOVE]);
    m.fresnel.eta[0] = fmin(fmax(index[BELOW], FACET_ETA_MIN), FACET_ETA_MAX);
    if (!status) status = facet_brdf_create(&m, &b->brdf[BELOW]);
    m.fresnel.kind = FACET_FRESNEL_IDEAL;
    if (!status) status = facet_brdf_create(&m, &b->ideal);
    if (status) return status;
    const struct kernel_fresnel *above = &b->brdf[ABOVE]->fresnel[0];
    struct kernel_fresnel *below = &b->brdf[BELOW]->fresnel[0];
    struct pair excess = {-above->excess, -above->excess_low};
    excess = pair_quotient(excess, pair_product(eta, eta));
    below->excess = excess.hi;
    below->excess_low = excess.lo;
    for (int i = 0; i < SIDES; i++) {
        const struct kernel_fresnel *f = &b->brdf[i]->fresnel[0];
        double scale = transport == FACET_RADIANCE ? 1 / (index[i] * index[i]) : 1;
        b->side[i] = (struct kernel_side){index[i], f->excess, f->excess_low, scale};
    }
    return FACET_OK;
}

/* Where M is no shorter than the float tiers take it, and powers of the index leave them room. */
static bool floats_hold(const facet_bsdf *b)
{
    const double eta = b->side[ABOVE].index, nearest = 0x1p-6;
    return b->ideal->floats_hold && eta >= 0.125 && eta <= 8 && fabs(eta - 1) >= nearest;
}

facet_status facet_bsdf_create(const facet_material *material, facet_transport transport,
                               facet_bsdf **bsdf)
{
    *bsdf = NULL;
    facet_status status = check(material, transport);
    if (status) return status;
    facet_bsdf *b = calloc(1, sizeof *b);
    if (!b) return FACET_NO_MEMORY;
    b->ndf = material->ndf;
    b->is_correlated = material->masking == FACET_SMITH;
    status = open_sides(material, transport, b);
    if (status) {
        facet_bsdf_destroy(b);
        return status;
    }
    b->floats_hold = floats_hold(b);
    *bsdf = b;
    return FACET_OK;
}

void facet_bsdf_destroy(facet_bsdf *b)
{
    if (!b) return;
    for (int i = 0; i < SIDES; i++) facet_brdf_destroy(b->brdf[i]);
    facet_brdf_destroy(b->ideal);
    free(b);
}

/* ---- Kernels ---------------------------------------------------------------------------- */

struct kernel_refraction facet_refraction_of(const facet_bsdf *b)
{
    return (struct kernel_refraction){.eta = b->side[ABOVE].index,
                                      .side = {b->side[ABOVE], b->side[BELOW]},
                                      .is_correlated = b->is_correlated};
}

static bool run(const facet_bsdf *b, facet_tier tier, const struct kernel_refraction *job, size_t n)
{
    return facet_refractions_for(tier)->eval[b->ndf](&b->ideal->surface, job, n);
}

/* Pairs without a number, gathered, in precise, and back. */
static void redo_strays(const facet_bsdf *b, const struct kernel_refraction *job, size_t n)
{
    double in[6][TRANSMISSION_BLOCK], out[REFRACTION_OUTPUT_COUNT][TRANSMISSION_BLOCK];
    size_t at[TRANSMISSION_BLOCK], count = 0;
    struct kernel_refraction again = facet_refraction_of(b);
    for (int j = 0; j < 3; j++) again.wi[j] = in[j], again.wo[j] = in[3 + j];
    for (int q = 0; q < REFRACTION_OUTPUT_COUNT; q++) again.out[q] = job->out[q] ? out[q] : NULL;
    for (size_t i = 0; i < n; i++) {
        bool stray = false;
        for (int q = 0; q < REFRACTION_OUTPUT_COUNT; q++)
            stray = stray || (job->out[q] && isnan(job->out[q][i]));
        if (!stray) continue;
        for (int j = 0; j < 3; j++) in[j][count] = job->wi[j][i], in[3 + j][count] = job->wo[j][i];
        at[count++] = i;
    }
    for (size_t i = count; i < facet_padded(count); i++)
        for (int j = 0; j < 6; j++) in[j][i] = j % 3 == 2;
    run(b, FACET_PRECISE, &again, facet_padded(count));
    for (int q = 0; q < REFRACTION_OUTPUT_COUNT; q++)
        for (size_t i = 0; job->out[q] && i < count; i++) job->out[q][at[i]] = out[q][i];
}

facet_tier facet_bsdf_tier(const facet_bsdf *b, facet_tier tier)
{
    return tier < FACET_EXACT32 && !b->floats_hold ? FACET_EXACT32 : tier;
}

void facet_refract(const facet_bsdf *b, facet_tier tier, const struct kernel_refraction *job,
                   size_t n)
{
    if (run(b, facet_bsdf_tier(b, tier), job, n)) redo_strays(b, job, n);
}

void facet_transmittance(double index, const double *c, const double *g, size_t n, double *to)
{
    double in[2][TRANSMISSION_BLOCK], out[TRANSMISSION_BLOCK];
    facet_stage(facet_doubles(c), KERNEL_DOUBLE, n, 1, in[0]);
    facet_stage(facet_doubles(g), KERNEL_DOUBLE, n, 1, in[1]);
    facet_refractions_for(FACET_PRECISE)->transmittance(index, in[0], in[1], out, facet_padded(n));
    for (size_t i = 0; i < n; i++) to[i] = out[i];
}

void facet_opposite(const double *a, const double *b, size_t n, double *to)
{
    double in[2][TRANSMISSION_BLOCK], out[TRANSMISSION_BLOCK];
    for (size_t start = 0, size; start < n; start += size) {
        size = n - start < TRANSMISSION_BLOCK ? n - start : TRANSMISSION_BLOCK;
        facet_stage(facet_doubles(a + start), KERNEL_DOUBLE, size, 1, in[0]);
        facet_stage(facet_doubles(b + start), KERNEL_DOUBLE, size, 1, in[1]);
        facet_refractions_for(FACET_PRECISE)->opposite(in[0], in[1], out, facet_padded(size));
        for (size_t i = 0; i < size; i++) to[start + i] = out[i];
    }
}

void facet_transmission_masking(const facet_bsdf *b, double sigma_o, double cosine_o,
                                const double *sigma_i, const double *cosine_i, size_t n, double *to)
{
    double one_more[TRANSMISSION_BLOCK] = {0}, lambda[TRANSMISSION_BLOCK] = {0};
    for (size_t i = 0; i < n; i++) {
        one_more[i] = sigma_o / cosine_o;
        lambda[i] = fmax(sigma_i[i] - cosine_i[i], 0) / cosine_i[i];
        to[i] = fmin(cosine_i[i] / sigma_i[i], 1);
    }
    if (b->is_correlated) facet_opposite(one_more, lambda, n, to);
    for (size_t i = 0; i < n; i++)
        if (!(cosine_i[i] > 0) || (b->is_correlated && !(cosine_o > 0))) to[i] = 0;
}

/* ---- fr, fr_cos, pdf -------------------------------------------------------------------- */

enum { RENDERED = 3 }; /* what the kernels have whole */
static const facet_quantity rendered[RENDERED] = {FACET_FR, FACET_FR_COS, FACET_PDF};
static const enum refraction_output rendered_as[RENDERED] = {REFRACTION_FR, REFRACTION_FR_COS,
                                                             REFRACTION_PDF};

/* Fewer pairs than a vector has, through arrays that are as long. */
static void eval_staged(const facet_bsdf *b, facet_tier tier, const double *const in[6],
                        double *const out[RENDERED], size_t n)
{
    double staged[6][KERNEL_LANES], results[RENDERED][KERNEL_LANES];
    struct kernel_refraction job = facet_refraction_of(b);
    for (int j = 0; j < 6; j++)
        facet_stage(facet_doubles(in[j]), KERNEL_DOUBLE, n, j % 3 == 2, staged[j]);
    for (int j = 0; j < 3; j++) job.wi[j] = staged[j], job.wo[j] = staged[3 + j];
    for (int q = 0; q < RENDERED; q++) job.out[rendered_as[q]] = out[q] ? results[q] : NULL;
    facet_refract(b, tier, &job, KERNEL_LANES);
    for (int q = 0; q < RENDERED; q++)
        facet_unstage(results[q], KERNEL_DOUBLE, n, facet_doubles(out[q]));
}

static void eval_rendered(const facet_bsdf *b, facet_tier tier, const double *const in[6],
                          double *const out[RENDERED], size_t n)
{
    const double *from[6];
    double *to[RENDERED];
    for (size_t start = 0, size; start < n; start += size) {
        size = n - start < TRANSMISSION_BLOCK ? n - start : TRANSMISSION_BLOCK;
        for (int j = 0; j < 6; j++) from[j] = in[j] + start;
        for (int q = 0; q < RENDERED; q++) to[q] = out[q] ? out[q] + start : NULL;
        if (size < KERNEL_LANES) {
            eval_staged(b, tier, from, to, size);
            continue;
        }
        size -= size % KERNEL_LANES;
        struct kernel_refraction job = facet_refraction_of(b);
        for (int j = 0; j < 3; j++) job.wi[j] = from[j], job.wo[j] = from[3 + j];
        for (int q = 0; q < RENDERED; q++) job.out[rendered_as[q]] = to[q];
        facet_refract(b, tier, &job, size);
    }
}

/* ---- The other quantities ----------------------------------------------------------------- */

/* A block of pairs as given and turned as wo is turned up, and what the kernels say of M. */
struct normals {
    double in[6][TRANSMISSION_BLOCK], turned[6][TRANSMISSION_BLOCK];
    double out[REFRACTION_OUTPUT_COUNT][TRANSMISSION_BLOCK];
};

/* x/y without infinity; 0 for 0/0. */
static double over(double x, double y)
{
    return x > 0 ? fmin(x / y, DBL_MAX) : 0;
}

/* Of a pair with wi on the other side. */
static double across(const struct normals *n, size_t i, int quantity)
{
    double zi = -n->turned[2][i], zo = n->turned[5][i], sigma_o = n->out[REFRACTION_SIGMA_O][i],
           D = n->out[REFRACTION_D][i];
    switch (quantity) {
    case FACET_D: return D;
    case FACET_D_VIS: return over(D * n->out[REFRACTION_COSINE][i], sigma_o);
    case FACET_G: return over(n->out[REFRACTION_MASKING][i] * zo, sigma_o);
    case FACET_G1_I: return over(zi, n->out[REFRACTION_SIGMA_I][i]);
    case FACET_G1_O: return over(zo, sigma_o);
    case FACET_F: return n->out[REFRACTION_F][i];
    default: return sigma_o;
    }
}

static void find_normals(const facet_bsdf *b, const double *const in[6], size_t n,
                         struct normals *to)
{
    struct kernel_refraction job = facet_refraction_of(b);
    for (int j = 0; j < 6; j++)
        facet_stage(facet_doubles(in[j]), KERNEL_DOUBLE, n, j % 3 == 2, to->in[j]);
    for (int j = 0; j < 3; j++) job.wi[j] = to->in[j], job.wo[j] = to->in[3 + j];
    for (int q = REFRACTION_MASKING; q < REFRACTION_OUTPUT_COUNT; q++) job.out[q] = to->out[q];
    facet_refract(b, FACET_PRECISE, &job, facet_padded(n));
    for (size_t i = 0; i < n; i++) {
        double sign = facet_side(to->in[5][i]) == BELOW ? -1 : 1;
        for (int j = 0; j < 6; j++) to->turned[j][i] = sign * to->in[j][i];
    }
}

/* In precise: renderers do not ask. */
static facet_status eval_block(const facet_bsdf *b, const double *const in[6], size_t n,
                               const facet_outputs *outputs)
{
    struct normals normals;
    double *const *t = (double *const[]){normals.turned[0], normals.turned[1], normals.turned[2],
                                         normals.turned[3], normals.turned[4], normals.turned[5]};
    find_normals(b, in, n, &normals);
    facet_status status = facet_eval(b->ideal, FACET_PRECISE, (facet_vec3_in){t[0], t[1], t[2]},
                                     (facet_vec3_in){t[3], t[4], t[5]}, n, outputs);
    for (int q = 0; q < FACET_QUANTITY_COUNT && !status; q++) {
        double *to = outputs->of[q][0];
        for (size_t i = 0; to && i < n; i++) {
            if (normals.turned[2][i] < 0)
                to[i] = across(&normals, i, q);
            else if (q == FACET_F)
                to[i] = normals.out[REFRACTION_FRESNEL][i];
        }
    }
    return status;
}

facet_status facet_bsdf_eval(const facet_bsdf *b, facet_tier tier, facet_vec3_in wi,
                             facet_vec3_in wo, size_t n, const facet_outputs *outputs)
{
    const double *const in[6] = {wi.x, wi.y, wi.z, wo.x, wo.y, wo.z};
    double *const out[RENDERED] = {outputs->of[FACET_FR][0], outputs->of[FACET_FR_COS][0],
                                   outputs->of[FACET_PDF][0]};
    facet_status status = FACET_OK;
    bool any = false;
    if ((unsigned)tier >= FACET_TIER_COUNT) return FACET_UNSUPPORTED;
    if (out[0] || out[1] || out[2]) eval_rendered(b, tier, in, out, n);
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        any = any || (outputs->of[q][0] && q != FACET_FR && q != FACET_FR_COS && q != FACET_PDF);
    for (size_t start = 0, size; any && start < n && !status; start += size) {
        facet_outputs rest = {0};
        const double *from[6];
        size = n - start < TRANSMISSION_BLOCK ? n - start : TRANSMISSION_BLOCK;
        for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
            if (outputs->of[q][0]) rest.of[q][0] = outputs->of[q][0] + start;
        for (int q = 0; q < RENDERED; q++) rest.of[rendered[q]][0] = NULL;
        for (int j = 0; j < 6; j++) from[j] = in[j] + start;
        status = eval_block(b, from, size, &rest);
    }
    return status;
}
