/* facet_sample against a sampler in quadruple precision, on every instruction set. */
#include "check.h"
#include "draw.h"
#include "reference_samplers.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { N_MAX = 29 };

struct batch {
    facet_sampler sampler;
    size_t n;
    double o[3][N_MAX], u1[N_MAX], u2[N_MAX];
    double wi[3][N_MAX], h[3][N_MAX], weight[3][N_MAX], pdf[N_MAX];
};

static const struct {
    facet_masking masking;
    facet_shear shear;
} models[] = {
    {FACET_SMITH, FACET_ENERGY_SAFE},   {FACET_SMITH_UNCORRELATED, FACET_ENERGY_SAFE},
    {FACET_SMITH, FACET_THESIS},        {FACET_SMITH_UNCORRELATED, FACET_THESIS},
    {FACET_VGROOVE, FACET_ENERGY_SAFE}, {FACET_NONE, FACET_ENERGY_SAFE},
};
enum { MODELS = sizeof models / sizeof *models };

/* The reference of a sampler; false: visible normals, reference_sample. */
static bool method_of(facet_sampler sampler, facet_ndf ndf, enum reference_method *method)
{
    switch (sampler) {
    case FACET_SAMPLER_SLOPE: *method = REFERENCE_SLOPE_GGX; return ndf == FACET_GGX;
    case FACET_SAMPLER_BOUNDED: *method = REFERENCE_BOUNDED; return true;
    case FACET_SAMPLER_NDF: *method = REFERENCE_NDF; return true;
    case FACET_SAMPLER_COSINE: *method = REFERENCE_COSINE; return true;
    case FACET_SAMPLER_VCAVITY: *method = REFERENCE_VCAVITY; return true;
    default: return false;
    }
}

static void exact_sample(facet_sampler sampler, const facet_material *m, const double wo[3],
                         double u1, double u2, struct reference_sample *x)
{
    enum reference_method method;
    if (method_of(sampler, m->ndf, &method))
        reference_sample_by(method, m, wo, u1, u2, x);
    else
        reference_sample(m, wo, u1, u2, x);
}

static quad exact_pdf(facet_sampler sampler, const facet_material *m, const quad wi[3],
                      const double wo[3], const quad H[3])
{
    enum reference_method method;
    struct reference all;
    if (method_of(sampler, m->ndf, &method)) return reference_pdf_by(method, m, wi, wo, H);
    reference_eval_exact(m, wi, wo, H, &all);
    return all.of[FACET_PDF][0];
}

static void draw_batch(struct rng *rng, const struct draw_domain *domain, const facet_material *m,
                       struct batch *b)
{
    b->n = 1 + (size_t)(rng_uniform(rng) * N_MAX);
    for (size_t k = 0; k < b->n; k++) {
        double wi[3], wo[3];
        draw_pair(rng, domain, m, wi, wo);
        for (int j = 0; j < 3; j++) b->o[j][k] = wo[j];
        double u[2];
        for (int j = 0; j < 2; j++) {
            double r = rng_uniform(rng), v = rng_uniform(rng);
            u[j] = r < 0.7 ? v : r < 0.85 ? rng_log(rng, 0x1p-53, 1) : 1 - rng_log(rng, 0x1p-53, 1);
            u[j] = fmin(fmax(u[j], 0x1p-53), 1 - 0x1p-53);
        }
        b->u1[k] = u[0];
        b->u2[k] = u[1];
    }
}

static void run(const facet_brdf *brdf, facet_tier tier, size_t channels, struct batch *b)
{
    facet_samples s = {{b->wi[0], b->wi[1], b->wi[2]}, {b->h[0], b->h[1], b->h[2]}, {0}, b->pdf};
    for (size_t c = 0; c < channels; c++) s.weight[c] = b->weight[c];
    facet_vec3_in wo = {b->o[0], b->o[1], b->o[2]};
    CHECK_INT(facet_sample(brdf, tier, b->sampler, wo, b->u1, b->u2, b->n, &s), FACET_OK);
}

/*
 * How far the weight moves if wi moves by step along one axis.  Toward the horizon, and around the
 * critical angle, a weight hangs on the last bits of wi: no sampler that rounds wi can do better.
 */
static double weight_moves(facet_sampler sampler, const facet_material *m, const double wo[3],
                           const struct reference_sample *x, size_t channel, double step)
{
    double most = 0;
    for (int axis = 0; axis < 6; axis++) {
        quad wi[3], H[3];
        for (int j = 0; j < 3; j++) wi[j] = x->wi[j];
        wi[axis / 2] += (axis & 1 ? -1 : 1) * (quad)step;
        for (int j = 0; j < 3; j++) H[j] = wi[j] + wo[j];
        struct reference r;
        reference_eval_exact(m, wi, wo, H, &r);
        quad seen = r.of[FACET_FR_COS][channel], pdf = exact_pdf(sampler, m, wi, wo, H);
        double moved = (double)(seen == 0 ? 0 : seen / pdf) - (double)x->weight[channel];
        most = fmax(most, fabs(moved));
    }
    return most;
}

/* The largest errors of wi, h and pdf. */
struct miss {
    double wi, h, pdf;
};

static void widen(struct miss *most, struct miss m)
{
    most->wi = fmax(most->wi, m.wi);
    most->h = fmax(most->h, m.h);
    most->pdf = fmax(most->pdf, m.pdf);
}

static struct miss miss_of(const struct batch *b, size_t k, const struct reference_sample *x)
{
    struct miss m = {0, 0, x->pdf > DBL_MAX ? 0 : reference_error(b->pdf[k], x->pdf, FACET_FLOOR)};
    for (int j = 0; j < 3; j++) {
        m.wi = check_worse(m.wi, reference_error(b->wi[j][k], x->wi[j], 1));
        m.h = check_worse(m.h, reference_error(b->h[j][k], x->h[j], 1));
    }
    return m;
}

static struct miss distance(const struct reference_sample *a, const struct reference_sample *b)
{
    double pdf = (double)((a->pdf - b->pdf) / b->pdf);
    struct miss m = {0, 0, fabs(pdf)};
    for (int j = 0; j < 3; j++) {
        m.wi = fmax(m.wi, fabs((double)(a->wi[j] - b->wi[j])));
        m.h = fmax(m.h, fabs((double)(a->h[j] - b->h[j])));
    }
    return m;
}

/*
 * How far the exact sample moves if u or wo move by step, relative to what they are (u also to
 * 1 - u; an azimuth by step turns).  Where GGX's normals crowd together, at the rim of
 * the cap opposite wo, they hang on the last bits of both: no arithmetic that rounds does better.
 */
static struct miss sample_moves(facet_sampler sampler, const facet_material *m, const double wo[3],
                                double u1, double u2, const struct reference_sample *x, double step)
{
    struct miss most = {0, 0, 0};
    bool around = sampler == FACET_SAMPLER_NDF || sampler == FACET_SAMPLER_COSINE;
    bool caps = m->ndf == FACET_GGX && sampler != FACET_SAMPLER_SLOPE &&
                sampler != FACET_SAMPLER_VCAVITY;
    int turns = around ? 2 : caps ? 1 : 0; /* which u is an azimuth */
    for (int axis = 0; axis < 10; axis++) {
        double o[3] = {wo[0], wo[1], wo[2]}, by = axis & 1 ? -step : step, v1 = u1, v2 = u2;
        if (axis < 6)
            o[axis / 2] *= 1 + by;
        else if (axis < 8)
            v1 += by * (turns == 1 ? 1 : fmin(v1, 1 - v1));
        else
            v2 += by * (turns == 2 ? 1 : fmin(v2, 1 - v2));
        struct reference_sample moved;
        exact_sample(sampler, m, o, v1, v2, &moved);
        widen(&most, distance(&moved, x));
    }
    return most;
}

static bool within(struct miss miss, struct miss most, double bound)
{
    return miss.wi <= bound + 2 * most.wi && miss.h <= bound + 2 * most.h &&
           miss.pdf <= bound + 2 * most.pdf;
}

static bool weights_within(const facet_material *m, const double wo[3], const struct batch *b,
                           size_t k, const struct reference_sample *x, double step, double bound)
{
    for (size_t c = 0; c < m->fresnel.channels; c++) {
        double w = (double)x->weight[c], error = fabs(b->weight[c][k] - w);
        double allowed = bound * fmax(w, FACET_FLOOR);
        if (error <= allowed) continue;
        if (!(error <= allowed + 2 * weight_moves(b->sampler, m, wo, x, c, step))) return false;
    }
    return true;
}

/*
 * GGX stretched by more than 1e4: near the rim (u2 -> 1) 1 - |k'_x| and 1 - cos(2 pi u1) are below
 * the rounding of k'_x and cos, which are what the caps are made of.
 */
static bool beyond_caps(const facet_material *m, double u2)
{
    facet_ellipse e = facet_roughness_to_ellipse(&m->roughness);
    return m->ndf == FACET_GGX && e.alpha_1 > 1e4 * e.alpha_2 && u2 > 1 - 1e-5;
}

/*
 * The pdf of NDF has a pole where wo.h is 0, that of VCAVITY behind the mean facet, and so does its
 * error: there it is wo.h that has to be right, absolutely.
 */
static bool near_the_pole(const struct batch *b, size_t k, const double wo[3],
                          const struct reference_sample *x, struct miss miss, double bound)
{
    double seen = fabs((double)(wo[0] * x->h[0] + wo[1] * x->h[1] + wo[2] * x->h[2]));
    bool pole = b->sampler == FACET_SAMPLER_NDF || b->sampler == FACET_SAMPLER_VCAVITY;
    if (!pole || !(miss.wi <= bound && miss.h <= bound)) return false;
    return fabs((double)x->pdf / b->pdf[k] - 1) * seen <= bound * (1 + seen);
}

/* How many were compared, and how many of them were taken although they missed the bound. */
struct tally {
    size_t checked, forgiven;
};

static void check_sample(const facet_material *m, facet_tier tier, const struct batch *b, size_t k,
                         double bound, struct tally *tally)
{
    const struct miss none = {0, 0, 0};
    const double wo[3] = {b->o[0][k], b->o[1][k], b->o[2][k]};
    struct reference_sample x;
    if (beyond_caps(m, b->u2[k])) return;
    exact_sample(b->sampler, m, wo, b->u1[k], b->u2[k], &x);
    struct miss miss = miss_of(b, k, &x);
    tally->checked++;
    bool plain = within(miss, none, bound), fair = plain;
    if (!plain)
        fair = within(miss, sample_moves(b->sampler, m, wo, b->u1[k], b->u2[k], &x, bound), bound);
    if (!fair) fair = near_the_pole(b, k, wo, &x, miss, bound);
    tally->forgiven += fair && !plain;
    bool weights = weights_within(m, wo, b, k, &x, fmax(bound, fair ? miss.wi : 0), bound);
    char name[48];
    snprintf(name, sizeof name, "%s/%s/%s", m->ndf == FACET_GGX ? "ggx" : "beckmann",
             facet_sampler_name(b->sampler), facet_tier_name(tier));
    if (plain) check_note(name, fmax(fmax(miss.wi, miss.h), miss.pdf) / bound);
    snprintf(name, sizeof name, "%s/%s/%s: crowded", m->ndf == FACET_GGX ? "ggx" : "beckmann",
             facet_sampler_name(b->sampler), facet_tier_name(tier));
    if (fair && !plain) check_note(name, fmax(miss.wi, miss.h));
    if (fair && weights) return;
    check_fail(__FILE__, __LINE__,
               "%s %s: wi off %.3g, h off %.3g, pdf off %.3g (bound %.3g)\n    %s\n    wo {%.17g, "
               "%.17g, %.17g} u %.17g %.17g: wi {%.9g, %.9g, %.9g} not {%.9g, %.9g, %.9g}, pdf "
               "%.9g not %.9g, weight %.9g not %.9g",
               facet_sampler_name(b->sampler), facet_tier_name(tier), miss.wi, miss.h, miss.pdf,
               bound, draw_text(m), wo[0], wo[1], wo[2], b->u1[k], b->u2[k], b->wi[0][k],
               b->wi[1][k], b->wi[2][k], (double)x.wi[0], (double)x.wi[1], (double)x.wi[2],
               b->pdf[k], (double)x.pdf, b->weight[0][k], (double)x.weight[0]);
}

static struct tally walk(const struct draw_domain *domain, size_t materials, facet_tier tier,
                         facet_sampler sampler, facet_ndf ndf, struct rng *rng)
{
    static struct batch b;
    b.sampler = sampler;
    struct tally tally = {0, 0};
    for (size_t k = 0; k < materials * MODELS; k++) {
        facet_material m = {
            .ndf = ndf, .masking = models[k % MODELS].masking, .shear = models[k % MODELS].shear};
        draw_roughness(rng, domain, &m.roughness);
        draw_fresnel(rng, (facet_fresnel_kind)(k / MODELS % FACET_FRESNEL_COUNT), &m.fresnel);
        facet_brdf *brdf = NULL;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (!brdf) continue;
        double bound;
        draw_batch(rng, domain, &m, &b);
        run(brdf, tier, m.fresnel.channels, &b);
        if (facet_sample_bound(brdf, tier, sampler, 0, &bound) && bound < 0.5)
            for (size_t j = 0; j < b.n; j++) check_sample(&m, tier, &b, j, bound, &tally);
        facet_brdf_destroy(brdf);
    }
    return tally;
}

/* AUTO: each distribution's own sampler of visible normals. */
static void walk_all(const struct draw_domain *domain, facet_sampler sampler, size_t materials,
                     unsigned long long seed)
{
    struct rng rng;
    rng_seed(&rng, seed);
    for (int tier = 0; tier < FACET_TIER_COUNT; tier++)
        for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
            if (!facet_sampler_serves(sampler, (facet_ndf)ndf)) continue;
            size_t n = draw_count(
                ndf == FACET_GGX || sampler != FACET_SAMPLER_AUTO ? materials : materials / 6);
            facet_sampler named = sampler == FACET_SAMPLER_AUTO
                                      ? facet_sampler_visible((facet_ndf)ndf)
                                      : sampler;
            struct tally tally = walk(domain, n, (facet_tier)tier, named, (facet_ndf)ndf, &rng);
            check_note("crowded share", (double)tally.forgiven / (double)tally.checked);
            /* A scaled-down run of the named ones is too few to be sure of that. */
            bool sure = sampler == FACET_SAMPLER_AUTO || n >= 5;
            if (tally.checked < (sure ? 10 * n : 1) ||
                (double)tally.forgiven > 0.05 * (double)tally.checked + 3)
                check_fail(__FILE__, __LINE__, "tier %d ndf %d: %zu samples, %zu crowded", tier,
                           ndf, tally.checked, tally.forgiven);
        }
}

TEST(samples_of_ordinary_materials)
{
    walk_all(&draw_ordinary, FACET_SAMPLER_AUTO, 60, 51);
}

TEST(samples_everywhere)
{
    walk_all(&draw_everywhere, FACET_SAMPLER_AUTO, 60, 52);
}

TEST(samples_by_name)
{
    static const facet_sampler samplers[] = {FACET_SAMPLER_BOUNDED, FACET_SAMPLER_SLOPE,
                                             FACET_SAMPLER_NDF, FACET_SAMPLER_COSINE,
                                             FACET_SAMPLER_VCAVITY};
    for (int k = 0; k < 5; k++) {
        size_t materials = samplers[k] == FACET_SAMPLER_BOUNDED ? 12 : 6; /* what auto mostly is */
        walk_all(&draw_ordinary, samplers[k], materials, 53);
        walk_all(&draw_everywhere, samplers[k], materials, 54);
    }
}

/*
 * A density on the edge of what BOUNDED makes, or VCAVITY from behind: does it change between 0 and
 * more if wi moves by step?
 */
static bool on_the_edge(facet_sampler sampler, const facet_material *m, const double wi[3],
                        const double wo[3], double step)
{
    int zeros = 0;
    for (int axis = 0; axis < 7; axis++) {
        quad i[3] = {wi[0], wi[1], wi[2]}, H[3];
        if (axis < 6) i[axis / 2] += (axis & 1 ? -1 : 1) * (quad)step;
        for (int j = 0; j < 3; j++) H[j] = i[j] + wo[j];
        zeros += exact_pdf(sampler, m, i, wo, H) == 0;
    }
    return zeros > 0 && zeros < 7;
}

/* One density against the reference; false where it only fell on the other side of the edge. */
static bool check_pdf(const facet_material *m, facet_tier tier, facet_sampler sampler,
                      const double wi[3], const double wo[3], double got, double bound)
{
    const quad i[3] = {wi[0], wi[1], wi[2]}, H[3] = {i[0] + wo[0], i[1] + wo[1], i[2] + wo[2]};
    quad x = exact_pdf(sampler, m, i, wo, H);
    double error = x > DBL_MAX ? 0 : reference_error(got, x, FACET_FLOOR);
    static const double edge[FACET_TIER_COUNT] = {1e-2, 1e-4, 1e-8, 1e-11};
    /* Above the horizon lib never cuts; the formula may, where wo is a rounded float whose length is not 1. */
    double step = wi[2] > 0 ? fmax(edge[tier], 1e-6) : edge[tier];
    bool edged = sampler == FACET_SAMPLER_BOUNDED || sampler == FACET_SAMPLER_VCAVITY;
    if (!(error <= bound) && edged && on_the_edge(sampler, m, wi, wo, step)) return false;
    char name[64];
    snprintf(name, sizeof name, "pdf %s/%s/%s", m->ndf == FACET_GGX ? "ggx" : "beckmann",
             facet_sampler_name(sampler), facet_tier_name(tier));
    check_note(name, error / bound);
    if (!(error <= bound))
        check_fail(
            __FILE__, __LINE__,
            "%s %s: pdf %.17g not %.17g, off %.3g (bound %.3g)\n    %s\n    wi {%.17g, %.17g, %.17g} wo "
            "{%.17g, %.17g, %.17g}",
            facet_sampler_name(sampler), facet_tier_name(tier), got, (double)x, error, bound,
            draw_text(m), wi[0], wi[1], wi[2], wo[0], wo[1], wo[2]);
    return true;
}

enum { PAIRS = 37 };

static void walk_pdfs(const struct draw_domain *domain, facet_tier tier, facet_sampler sampler,
                      facet_ndf ndf, struct rng *rng, struct tally *tally)
{
    facet_material m = {.ndf = ndf, .fresnel = {.channels = 1}};
    double i[3][PAIRS], o[3][PAIRS], pdf[PAIRS], bound;
    draw_roughness(rng, domain, &m.roughness);
    if (sampler == FACET_SAMPLER_BOUNDED && rng_uniform(rng) < 0.7)
        m.roughness.slope_x = m.roughness.slope_y = 0;
    facet_brdf *brdf = NULL;
    CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
    if (!brdf) return;
    for (size_t k = 0; k < PAIRS; k++) {
        double wi[3], wo[3];
        draw_pair(rng, domain, &m, wi, wo);
        for (int j = 0; j < 3; j++) i[j][k] = wi[j], o[j][k] = wo[j];
    }
    facet_vec3_in wi = {i[0], i[1], i[2]}, wo = {o[0], o[1], o[2]};
    bool promised = facet_pdf_bound(brdf, tier, sampler, 0, &bound) && bound < 0.5;
    CHECK_INT(facet_pdf(brdf, tier, sampler, wi, wo, PAIRS, pdf), FACET_OK);
    for (size_t k = 0; promised && k < PAIRS; k++, tally->checked++)
        tally->forgiven += !check_pdf(&m, tier, sampler, (double[3]){i[0][k], i[1][k], i[2][k]},
                                      (double[3]){o[0][k], o[1][k], o[2][k]}, pdf[k], bound);
    facet_brdf_destroy(brdf);
}

/* All tiers and distributions of one sampler. */
static void densities_of(facet_sampler sampler, struct rng *rng)
{
    struct draw_domain sphere = draw_ordinary;
    sphere.below = true;
    for (int tier = 0; tier < FACET_TIER_COUNT; tier++) {
        struct tally tally = {0, 0};
        size_t rounds = draw_count(400), kinds = 0;
        for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
            if (!facet_sampler_serves(sampler, (facet_ndf)ndf)) continue;
            kinds++;
            for (size_t k = 0; k < rounds; k++)
                walk_pdfs(k & 1 ? &sphere : &draw_everywhere, (facet_tier)tier, sampler,
                          (facet_ndf)ndf, rng, &tally);
        }
        char name[48];
        snprintf(name, sizeof name, "%s/%s: forgiven", facet_sampler_name(sampler),
                 facet_tier_name((facet_tier)tier));
        check_note(name, (double)tally.forgiven / (double)tally.checked);
        if (!(tally.checked >= rounds * kinds * PAIRS / 2 &&
              tally.forgiven <= 2e-3 * (double)tally.checked))
            check_fail(__FILE__, __LINE__, "%s %s: %zu checked, %zu forgiven",
                       facet_sampler_name(sampler), facet_tier_name((facet_tier)tier),
                       tally.checked, tally.forgiven);
    }
}

TEST(densities_by_name)
{
    struct rng rng;
    rng_seed(&rng, 55);
    for (int s = FACET_SAMPLER_BOUNDED; s < FACET_SAMPLER_COUNT; s++)
        if (s != FACET_SAMPLER_SLOPE && s != FACET_SAMPLER_TABLE)
            densities_of((facet_sampler)s, &rng);
}
