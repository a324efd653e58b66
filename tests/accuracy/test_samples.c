/* facet_sample against a sampler in quadruple precision, on every instruction set. */
#include "check.h"
#include "draw.h"
#include "reference.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { N_MAX = 29 };

struct batch {
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
    CHECK_INT(facet_sample(brdf, tier, wo, b->u1, b->u2, b->n, &s), FACET_OK);
}

/*
 * How far the weight moves if wi moves by step along one axis.  Toward the horizon, and around the
 * critical angle, a weight hangs on the last bits of wi: no sampler that rounds wi can do better.
 */
static double weight_moves(const facet_material *m, const double wo[3],
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
        quad seen = r.of[FACET_FR_COS][channel], pdf = r.of[FACET_PDF][0];
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
        m.wi = fmax(m.wi, reference_error(b->wi[j][k], x->wi[j], 1));
        m.h = fmax(m.h, reference_error(b->h[j][k], x->h[j], 1));
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
 * 1 - u; the azimuth u1 of GGX by step turns).  Where GGX's normals crowd together, at the rim of
 * the cap opposite wo, they hang on the last bits of both: no arithmetic that rounds does better.
 */
static struct miss sample_moves(const facet_material *m, const double wo[3], double u1, double u2,
                                const struct reference_sample *x, double step)
{
    struct miss most = {0, 0, 0};
    for (int axis = 0; axis < 10; axis++) {
        double o[3] = {wo[0], wo[1], wo[2]}, by = axis & 1 ? -step : step, v1 = u1, v2 = u2;
        if (axis < 6)
            o[axis / 2] *= 1 + by;
        else if (axis < 8)
            v1 += by * (m->ndf == FACET_GGX ? 1 : fmin(v1, 1 - v1));
        else
            v2 += by * fmin(v2, 1 - v2);
        struct reference_sample moved;
        reference_sample(m, o, v1, v2, &moved);
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
        if (!(error <= allowed + 2 * weight_moves(m, wo, x, c, step))) return false;
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

static void check_sample(const facet_material *m, facet_tier tier, const struct batch *b, size_t k,
                         double bound)
{
    const struct miss none = {0, 0, 0};
    const double wo[3] = {b->o[0][k], b->o[1][k], b->o[2][k]};
    struct reference_sample x;
    if (beyond_caps(m, b->u2[k])) return;
    reference_sample(m, wo, b->u1[k], b->u2[k], &x);
    struct miss miss = miss_of(b, k, &x);
    bool plain = within(miss, none, bound), fair = plain;
    if (!plain) fair = within(miss, sample_moves(m, wo, b->u1[k], b->u2[k], &x, bound), bound);
    bool weights = weights_within(m, wo, b, k, &x, fmax(bound, fair ? miss.wi : 0), bound);
    char name[48];
    snprintf(name, sizeof name, "%s/%s", m->ndf == FACET_GGX ? "ggx" : "beckmann",
             facet_tier_name(tier));
    if (plain) check_note(name, fmax(fmax(miss.wi, miss.h), miss.pdf) / bound);
    snprintf(name, sizeof name, "%s/%s: crowded", m->ndf == FACET_GGX ? "ggx" : "beckmann",
             facet_tier_name(tier));
    if (fair && !plain) check_note(name, fmax(miss.wi, miss.h));
    if (fair && weights) return;
    check_fail(__FILE__, __LINE__,
               "%s: wi off %.3g, h off %.3g, pdf off %.3g (bound %.3g)\n    %s\n    wo {%.17g, "
               "%.17g, %.17g} u %.17g %.17g: wi {%.9g, %.9g, %.9g} not {%.9g, %.9g, %.9g}, pdf "
               "%.9g not %.9g, weight %.9g not %.9g",
               facet_tier_name(tier), miss.wi, miss.h, miss.pdf, bound, draw_text(m), wo[0], wo[1],
               wo[2], b->u1[k], b->u2[k], b->wi[0][k], b->wi[1][k], b->wi[2][k], (double)x.wi[0],
               (double)x.wi[1], (double)x.wi[2], b->pdf[k], (double)x.pdf, b->weight[0][k],
               (double)x.weight[0]);
}

/* Returns the number of samples checked. */
static size_t walk(const struct draw_domain *domain, size_t materials, facet_tier tier,
                   facet_ndf ndf, struct rng *rng)
{
    static struct batch b;
    size_t checked = 0;
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
        if (facet_sample_bound(brdf, tier, 0, &bound) && bound < 0.5)
            for (size_t j = 0; j < b.n; j++, checked++) check_sample(&m, tier, &b, j, bound);
        facet_brdf_destroy(brdf);
    }
    return checked;
}

static void walk_all(const struct draw_domain *domain, unsigned long long seed)
{
    struct rng rng;
    rng_seed(&rng, seed);
    for (int tier = 0; tier < FACET_TIER_COUNT; tier++)
        for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++) {
            size_t n = draw_count(ndf == FACET_GGX ? 60 : 10);
            size_t checked = walk(domain, n, (facet_tier)tier, (facet_ndf)ndf, &rng);
            if (checked < 10 * n)
                check_fail(__FILE__, __LINE__, "tier %d ndf %d: %zu samples", tier, ndf, checked);
        }
}

TEST(samples_of_ordinary_materials)
{
    walk_all(&draw_ordinary, 51);
}

TEST(samples_everywhere)
{
    walk_all(&draw_everywhere, 52);
}
