/* brdf.c - from a material to prepared constants: checks, and what the kernels need once. */
#include "brdf.h"

#include "roughness.h"
#include "slope_table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* exp of it times 2^64 is a float. */
#define LOG_Q_MOST 40

static bool within(double x, double low, double high)
{
    return x >= low && x <= high; /* false for NaN */
}

static bool good_fresnel_table(const facet_fresnel *f)
{
    if (f->count < 2 || f->count > FACET_FRESNEL_NODES_MAX) return false;
    for (size_t i = 0; i < f->count; i++) {
        if (!within(f->cos_theta_d[i], 0, 1)) return false;
        if (i && !(f->cos_theta_d[i] > f->cos_theta_d[i - 1])) return false;
        for (size_t c = 0; c < f->channels; c++)
            if (!within(f->values[c][i], 0, 1e6)) return false;
    }
    return true;
}

static bool good_fresnel(const facet_fresnel *f)
{
    if (f->channels != 1 && f->channels != 3) return false;
    if (f->kind == FACET_FRESNEL_TABLE) return good_fresnel_table(f);
    for (size_t c = 0; c < f->channels; c++) {
        bool eta = within(f->eta[c], FACET_ETA_MIN, FACET_ETA_MAX);
        if (f->kind == FACET_FRESNEL_SCHLICK && !within(f->f0[c], 0, 1)) return false;
        if (f->kind == FACET_FRESNEL_DIELECTRIC && !eta) return false;
        if (f->kind == FACET_FRESNEL_CONDUCTOR && !(eta && within(f->k[c], 0, FACET_K_MAX)))
            return false;
    }
    return (unsigned)f->kind < FACET_FRESNEL_COUNT;
}

static facet_status check(const facet_material *m)
{
    facet_status status = facet_roughness_check(&m->roughness);
    if (status) return status;
    if (!good_fresnel(&m->fresnel)) return FACET_BAD_FRESNEL;
    if ((unsigned)m->ndf >= FACET_NDF_COUNT || (unsigned)m->masking >= FACET_MASKING_COUNT ||
        (unsigned)m->shear >= FACET_SHEAR_COUNT)
        return FACET_UNSUPPORTED;
    if (m->ndf == FACET_TABULATED && !m->table) return FACET_BAD_TABLE;
    bool smith = m->masking == FACET_SMITH || m->masking == FACET_SMITH_UNCORRELATED;
    return m->shear == FACET_THESIS && !smith ? FACET_UNSUPPORTED : FACET_OK;
}

static enum kernel_shape shape_of(const facet_roughness *r)
{
    if (r->slope_x != 0 || r->slope_y != 0) return KERNEL_SHEARED;
    return r->alpha_x == r->alpha_y && r->rho == 0 ? KERNEL_ISO : KERNEL_CENTRAL;
}

/* Of bounded caps: A is the minor radius, at most 1 unless the surface is isotropic. */
static void set_caps(struct kernel_surface *s, const facet_roughness *r)
{
    facet_ellipse e = facet_roughness_to_ellipse(r);
    double a = shape_of(r) == KERNEL_ISO ? r->alpha_x : fmin(e.alpha_2, 1);
    s->cap_rise = fabs((1 - a) * (1 + a));
    s->cap_a2 = a * a;
    s->cap_whole = 1 + a * a;
}

static struct kernel_surface prepare(const facet_material *m)
{
    const facet_roughness *r = &m->roughness;
    const long double pi = 3.14159265358979323846264338327950288L;
    const struct roughness_form form = facet_roughness_form(r);
    struct pair correlated = form.correlated, conditional = form.conditional;
    struct pair det = pair_product((struct pair){form.alpha_x, 0}, conditional);
    /* Rounded once each. */
    long double whole = (long double)det.hi + det.lo,
                scaled_y = (long double)conditional.hi + conditional.lo;
    double tilt = (double)(r->rho * (r->alpha_y / scaled_y) / r->alpha_x),
           inverse_y = (double)(1 / scaled_y);
    return (struct kernel_surface){
        .alpha_x = form.alpha_x,
        .rho_alpha_y = correlated.hi,
        .rho_alpha_y_low = correlated.lo,
        .kappa_alpha_y = conditional.hi,
        .kappa_alpha_y_low = conditional.lo,
        .det = det.hi,
        .det_low = det.lo,
        .root_det = (double)sqrtl(whole),
        .peak = (double)(1 / (pi * whole)),
        .inverse_x = 1 / r->alpha_x,
        .inverse_y = inverse_y,
        .tilt = tilt,
        .inverse_alpha2 = (double)(1 / ((long double)r->alpha_x * r->alpha_x)),
        .slope_x = r->slope_x,
        .slope_y = r->slope_y,
        .mean = fabs(r->slope_x) * (1 / r->alpha_x + fabs(tilt)) + fabs(r->slope_y) * inverse_y,
        .table = m->ndf == FACET_TABULATED ? &m->table->view : NULL,
    };
}

/* On a central surface both shear forms are the same, and the energy-safe one is the stable one. */
static enum kernel_masking masking_of(const facet_material *m, enum kernel_shape shape)
{
    bool thesis = m->shear == FACET_THESIS && shape == KERNEL_SHEARED;
    switch (m->masking) {
    case FACET_SMITH: return thesis ? KERNEL_SMITH_THESIS : KERNEL_SMITH;
    case FACET_SMITH_UNCORRELATED: return thesis ? KERNEL_UNCORRELATED_THESIS : KERNEL_UNCORRELATED;
    case FACET_VGROOVE: return KERNEL_VGROOVE;
    default: return KERNEL_NONE;
    }
}

double facet_mean_cosine(const struct kernel_surface *s, double x, double y, double z)
{
    struct pair lean_x = pair_product((struct pair){x, 0}, (struct pair){-s->slope_x, 0});
    struct pair lean_y = pair_product((struct pair){y, 0}, (struct pair){-s->slope_y, 0});
    return pair_add((struct pair){z, 0}, pair_add(lean_x, lean_y)).hi;
}

/* The thesis's forms: their sigmas underflow, and no float tier has loops for them. */
static bool divides_by_sigmas(enum kernel_masking masking)
{
    return masking == KERNEL_SMITH_THESIS || masking == KERNEL_UNCORRELATED_THESIS;
}

/* Powers of a table's scales are formed, and its density without them. */
static bool table_floats_hold(const facet_slope_table *table, facet_ellipse e)
{
    double b = table->view.slope_scale; /* which psi_scale never exceeds */
    return fmin(table->view.psi_scale, 1) * e.alpha_2 >= 1e-4 && fmax(b, 1) * e.alpha_1 <= 1e3 &&
           table->q.most <= LOG_Q_MOST && table->psi.most <= LOG_Q_MOST;
}

static bool floats_hold(const facet_material *m)
{
    const facet_roughness *r = &m->roughness;
    facet_ellipse e = facet_roughness_to_ellipse(r);
    if (m->ndf == FACET_TABULATED && !table_floats_hold(m->table, e)) return false;
    return e.alpha_2 >= 1e-4 && e.alpha_1 <= 1e3 && fmax(fabs(r->slope_x), fabs(r->slope_y)) <= 1e2;
}

/* eta^2 - k^2 - 1 as an unevaluated sum: it cancels near vacuum. */
static void set_excess(struct kernel_fresnel *f)
{
    struct pair eta = {f->eta, 0}, k = {f->k, 0}, ee = pair_product(eta, eta),
                kk = pair_product(k, k);
    struct pair excess = pair_add(pair_add(ee, pair_negative(kk)), (struct pair){-1, 0});
    f->excess = excess.hi;
    f->excess_low = excess.lo;
}

/* At normal incidence, or the smallest node. */
static double least_fresnel(const struct kernel_fresnel *f, facet_fresnel_kind kind)
{
    double below = f->eta - 1, above = f->eta + 1, least = 1;
    switch (kind) {
    case FACET_FRESNEL_SCHLICK: return f->f0;
    case FACET_FRESNEL_DIELECTRIC:
    case FACET_FRESNEL_CONDUCTOR:
        return (below * below + f->k * f->k) / (above * above + f->k * f->k);
    default:
        for (size_t i = 0; i < f->count; i++) least = fmin(least, f->values[i]);
        return least;
    }
}

static void copy_fresnel(facet_brdf *b, const facet_fresnel *f)
{
    size_t n = f->kind == FACET_FRESNEL_TABLE ? f->count : 0;
    if (n) memcpy(b->tables, f->cos_theta_d, n * sizeof *b->tables);
    for (size_t c = 0; c < f->channels; c++) {
        double *values = b->tables + (c + 1) * n;
        if (n) memcpy(values, f->values[c], n * sizeof *values);
        bool conductor = f->kind == FACET_FRESNEL_CONDUCTOR;
        b->fresnel[c] = (struct kernel_fresnel){.f0 = f->f0[c],
                                                .eta = f->eta[c],
                                                .k = conductor ? f->k[c] : 0,
                                                .count = n,
                                                .cos_theta_d = b->tables,
                                                .values = values};
        set_excess(&b->fresnel[c]);
        b->fresnel[c].least = least_fresnel(&b->fresnel[c], f->kind);
    }
}

facet_status facet_brdf_create(const facet_material *m, facet_brdf **brdf)
{
    *brdf = NULL;
    facet_status status = check(m);
    if (status) return status;
    size_t n = m->fresnel.kind == FACET_FRESNEL_TABLE ? m->fresnel.count * (m->fresnel.channels + 1)
                                                      : 0;
    facet_brdf *b = malloc(sizeof *b + n * sizeof *b->tables);
    if (!b) return FACET_NO_MEMORY;
    b->material = *m;
    b->surface = prepare(m);
    set_caps(&b->surface, &m->roughness);
    b->shape = shape_of(&m->roughness);
    b->masking = masking_of(m, b->shape);
    b->automatic = facet_sampler_auto(m);
    b->channels = m->fresnel.channels;
    b->floats_hold = floats_hold(m) && !divides_by_sigmas(b->masking);
    copy_fresnel(b, &m->fresnel);
    *brdf = b;
    return FACET_OK;
}

void facet_brdf_destroy(facet_brdf *brdf)
{
    free(brdf);
}
