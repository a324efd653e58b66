/* What lib promises of rough dielectrics (facet_bsdf_bound) against the reference. */
#include "check.h"
#include "draw.h"
#include "reference_transmission.h"

#include "opposite.h"

#include <float.h>
#include <math.h>
#include <stdio.h>

static const char *const names[] = {
#define QUANTITY(id, name, coloured, doc) name,
#include "quantities.def"
#undef QUANTITY
};

/* An index of [1e-3, 1e3], a third within 1e-12 .. 1 of 1, a third among those that floats hold. */
static double draw_index(struct rng *rng)
{
    double away = pow(10, -12 + 12 * rng_uniform(rng)), kind = rng_uniform(rng);
    if (kind < 1. / 3) return pow(2, -3 + 6 * rng_uniform(rng));
    if (kind < 2. / 3) return pow(10, -3 + 6 * rng_uniform(rng));
    return rng_uniform(rng) < 0.5 ? 1 + away : 1 - away * (1 - 1e-3);
}

static facet_material draw_glass(struct rng *rng)
{
    facet_material m = {.ndf = rng_uniform(rng) < 0.5 ? FACET_GGX : FACET_BECKMANN,
                        .masking = rng_uniform(rng) < 0.5 ? FACET_SMITH : FACET_SMITH_UNCORRELATED,
                        .fresnel = {.kind = FACET_FRESNEL_DIELECTRIC, .channels = 1}};
    m.fresnel.eta[0] = draw_index(rng);
    draw_roughness(rng, &draw_everywhere, &m.roughness);
    double least = facet_roughness_to_ellipse(&m.roughness).alpha_2;
    double lean = hypot(m.roughness.slope_x, m.roughness.slope_y),
           most = 0.9 * FACET_TRANSMISSION_LEAN_MAX * least;
    if (m.ndf == FACET_BECKMANN && lean > most) {
        m.roughness.slope_x *= most / lean;
        m.roughness.slope_y *= most / lean;
    }
    return m;
}

/* Unit wi of wo refracted at h, both above; false where it is not. */
static bool refract(const double h[3], const double wo[3], double n, double wi[3])
{
    double c = 0, size = 0;
    for (int j = 0; j < 3; j++) c += wo[j] * h[j];
    double g2 = n * n - 1 + c * c;
    if (!(c > 0 && g2 > 0)) return false;
    double bend = (n * n - 1) / (c + sqrt(g2));
    for (int j = 0; j < 3; j++) size += pow(wi[j] = -(wo[j] + bend * h[j]) / n, 2);
    for (int j = 0; j < 3; j++) wi[j] /= sqrt(size);
    return true;
}

/* wi the refraction of wo at a normal of slopes a few alpha from the mean one; else anywhere. */
static void draw_across(struct rng *rng, const facet_material *m, double wi[3], double wo[3])
{
    double h[3], n = m->fresnel.eta[0];
    const facet_roughness *r = &m->roughness;
    draw_direction(rng, rng_uniform(rng) < 0.3 ? 0 : 1e-3, wo);
    double x = r->alpha_x * tan(1.5 * (2 * rng_uniform(rng) - 1)) + r->slope_x;
    double y = r->alpha_y * tan(1.5 * (2 * rng_uniform(rng) - 1)) + r->slope_y,
           length = sqrt(1 + x * x + y * y);
    h[0] = -x / length, h[1] = -y / length, h[2] = 1 / length;
    bool below = rng_uniform(rng) < 0.5;
    if (!refract(h, wo, below ? 1 / n : n, wi)) {
        draw_direction(rng, 0, wi);
        for (int j = 0; j < 3 && rng_uniform(rng) < 0.5; j++) wi[j] = -wi[j];
    }
    for (int j = 0; j < 3 && below; j++) wi[j] = -wi[j], wo[j] = -wo[j];
}

static bool is_rendered(int q)
{
    return q == FACET_FR || q == FACET_FR_COS || q == FACET_PDF;
}

/* wi and wo on one side. */
static void draw_same(struct rng *rng, const facet_material *m, double wi[3], double wo[3])
{
    double turn = rng_uniform(rng) < 0.5 ? -1 : 1;
    draw_pair(rng, &draw_everywhere, m, wi, wo);
    for (int j = 0; j < 3; j++) wi[j] *= turn, wo[j] *= turn;
}

enum { PAIRS = 21 }; /* more than a vector, and no whole number of them */
struct pairs {
    size_t n;
    double i[3][PAIRS], o[3][PAIRS], y[FACET_QUANTITY_COUNT][PAIRS];
    struct reference_bsdf x[PAIRS];
};

static void draw_pairs(struct rng *rng, const facet_material *m, struct pairs *p)
{
    p->n = 1 + (size_t)(rng_uniform(rng) * PAIRS);
    for (size_t k = 0; k < p->n; k++) {
        double wi[3], wo[3];
        if (rng_uniform(rng) < 0.7)
            draw_across(rng, m, wi, wo);
        else
            draw_same(rng, m, wi, wo);
        for (int j = 0; j < 3; j++) p->i[j][k] = wi[j], p->o[j][k] = wo[j];
        reference_bsdf(m, FACET_IMPORTANCE, wi, wo, &p->x[k]);
    }
}

/* Compares one quantity with what a tier promises of it and returns in how many pairs. */
static size_t check_quantity(const facet_bsdf *bsdf, const facet_material *m, facet_tier tier,
                             int q, const struct pairs *p)
{
    double bound;
    char name[64];
    size_t checked = 0;
    if (!facet_bsdf_bound(bsdf, tier, (facet_quantity)q, 0, &bound)) return 0;
    snprintf(name, sizeof name, "%s/%s", facet_tier_name(tier), names[q]);
    for (size_t k = 0; k < p->n; k++) {
        quad x = p->x[k].of[q];
        double error = reference_error(p->y[q][k], x, FACET_FLOOR);
        bool same = p->i[2][k] * p->o[2][k] >= 0;
        if (x > DBL_MAX || (same && !is_rendered(q))) continue; /* test_bounds has reflection */
        checked++;
        check_note(name, error / bound);
        if (!(error <= bound))
            check_fail(__FILE__, __LINE__,
                       "%s is %.17g, not %.17g: error %.3g, bound %.3g; eta %.17g\n    %s\n    wi "
                       "{%.17g, %.17g, %.17g} wo {%.17g, %.17g, %.17g}",
                       name, p->y[q][k], (double)x, error, bound, m->fresnel.eta[0], draw_text(m),
                       p->i[0][k], p->i[1][k], p->i[2][k], p->o[0][k], p->o[1][k], p->o[2][k]);
    }
    return checked;
}

static size_t check_pairs(const facet_bsdf *bsdf, const facet_material *m, facet_tier tier,
                          struct pairs *p)
{
    size_t checked = 0;
    facet_outputs outputs = {0};
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) outputs.of[q][0] = p->y[q];
    facet_vec3_in i = {p->i[0], p->i[1], p->i[2]}, o = {p->o[0], p->o[1], p->o[2]};
    CHECK_INT(facet_bsdf_eval(bsdf, tier, i, o, p->n, &outputs), FACET_OK);
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        for (size_t k = 0; k < p->n; k++) CHECK(isfinite(p->y[q][k]) && p->y[q][k] >= 0);
        checked += check_quantity(bsdf, m, tier, q, p);
    }
    return checked;
}

TEST(quantities_of_both_lobes)
{
    struct rng rng;
    struct pairs pairs;
    size_t checked[FACET_TIER_COUNT] = {0}, n = draw_count(2500);
    rng_seed(&rng, 9);
    for (size_t k = 0; k < n; k++) {
        facet_material m = draw_glass(&rng);
        facet_bsdf *bsdf = NULL;
        facet_status status = facet_bsdf_create(&m, FACET_IMPORTANCE, &bsdf);
        CHECK_INT(status, FACET_OK);
        if (status) continue;
        draw_pairs(&rng, &m, &pairs);
        for (int t = 0; t < FACET_TIER_COUNT; t++)
            checked[t] += check_pairs(bsdf, &m, (facet_tier)t, &pairs);
        facet_bsdf_destroy(bsdf);
    }
    for (int t = 0; t < FACET_TIER_COUNT; t++) {
        check_note(facet_tier_name((facet_tier)t), (double)checked[t] / (double)n);
        CHECK(checked[t] >= (t < FACET_EXACT32 ? 5 : 20) * n);
    }
}

/* Where a tier's wi of u is against the exact one; how many components that was. */
static size_t check_sample(const facet_bsdf *bsdf, const facet_material *m, facet_tier tier,
                           const double wo[3], const double u[3], const quad exact[3])
{
    double wi[3], bound, turn = wo[2] < 0 ? -1 : 1;
    char name[64];
    facet_vec3_in o = {&wo[0], &wo[1], &wo[2]};
    facet_samples samples = {.wi = {&wi[0], &wi[1], &wi[2]}};
    CHECK_INT(
        facet_bsdf_sample(bsdf, tier, FACET_SAMPLER_AUTO, o, &u[0], &u[1], &u[2], 1, &samples),
        FACET_OK);
    if (!facet_bsdf_sample_bound(bsdf, tier, FACET_SAMPLER_AUTO,
                                 (turn > 0) == (m->fresnel.eta[0] < 1), 0, &bound))
        return 0;
    for (int j = 0; j < 3; j++) {
        double error = fabs((double)(wi[j] - exact[j]));
        snprintf(name, sizeof name, "%s/wi", facet_tier_name(tier));
        check_note(name, error / bound);
        if (!(error <= bound))
            check_fail(
                __FILE__, __LINE__,
                "%s: wi[%d] is off by %.3g, bound %.3g; eta %.17g wo %.17g %.17g %.17g u %g %g %g\n %s",
                facet_tier_name(tier), j, error, bound, m->fresnel.eta[0], wo[0], wo[1], wo[2],
                u[0], u[1], u[2], draw_text(m));
    }
    return 3;
}

/* Next to the floor, where float tiers let Beckmann's tail end, and a Jacobian that lifts what is below it. */
TEST(tails_are_there)
{
    struct rng rng;
    struct pairs pairs = {.n = PAIRS};
    size_t checked = 0, n = draw_count(150);
    rng_seed(&rng, 21);
    for (size_t k = 0; k < n; k++) {
        double alpha = 0.03 + 0.2 * rng_uniform(&rng);
        facet_material m = {.ndf = FACET_BECKMANN,
                            .roughness = {.alpha_x = alpha, .alpha_y = alpha},
                            .fresnel = {.kind = FACET_FRESNEL_DIELECTRIC,
                                        .channels = 1,
                                        .eta = {1.03 + 0.1 * rng_uniform(&rng)}}};
        facet_bsdf *bsdf = NULL;
        CHECK_INT(facet_bsdf_create(&m, FACET_IMPORTANCE, &bsdf), FACET_OK);
        for (size_t i = 0; i < PAIRS; i++) {
            double r = alpha * sqrt(60 + 30 * rng_uniform(&rng)), size = sqrt(1 + r * r),
                   h[3] = {r / size, 0, 1 / size}, wo[3], wi[3];
            do draw_direction(&rng, 0.3, wo);
            while (!refract(h, wo, m.fresnel.eta[0], wi));
            for (int j = 0; j < 3; j++) pairs.i[j][i] = wi[j], pairs.o[j][i] = wo[j];
            reference_bsdf(&m, FACET_IMPORTANCE, wi, wo, &pairs.x[i]);
        }
        for (int t = 0; t < FACET_TIER_COUNT && bsdf; t++)
            checked += check_pairs(bsdf, &m, (facet_tier)t, &pairs);
        facet_bsdf_destroy(bsdf);
    }
    CHECK(checked >= 100 * n);
}

TEST(samples_where_they_belong)
{
    struct rng rng;
    size_t checked[FACET_TIER_COUNT] = {0}, n = draw_count(1500);
    rng_seed(&rng, 12);
    for (size_t k = 0; k < n; k++) {
        facet_material m = draw_glass(&rng);
        facet_bsdf *bsdf = NULL;
        double wo[3], u[3];
        quad exact[3];
        CHECK_INT(facet_bsdf_create(&m, FACET_IMPORTANCE, &bsdf), FACET_OK);
        if (!bsdf) continue;
        draw_direction(&rng, 1e-3, wo);
        for (int j = 0; j < 3; j++) u[j] = 1e-3 + 0.998 * rng_uniform(&rng);
        double turn = rng_uniform(&rng) < 0.5 ? -1 : 1;
        for (int j = 0; j < 3; j++) wo[j] *= turn;
        bool is_sure = reference_bsdf_sample(&m, wo, u, exact);
        for (int t = 0; t < FACET_TIER_COUNT && is_sure; t++)
            checked[t] += check_sample(bsdf, &m, (facet_tier)t, wo, u, exact);
        facet_bsdf_destroy(bsdf);
    }
    for (int t = 0; t < FACET_TIER_COUNT; t++) {
        double share = (double)checked[t] / (double)(3 * n);
        check_note(facet_tier_name((facet_tier)t), share);
        CHECK(share >= (t < FACET_EXACT32 ? 0.05 : 0.5));
    }
}

static double opposite(double a, double b)
{
    double value;
    facet_opposite(&a, &b, 1, &value);
    return value;
}

TEST(masking_across_the_surface)
{
    struct rng rng;
    size_t checked = 0, n = draw_count(3000);
    rng_seed(&rng, 10);
    for (size_t k = 0; k < n; k++) {
        double a = pow(10, -18 + 32 * rng_uniform(&rng)), b = pow(10, -18 + 22 * rng_uniform(&rng));
        quad x = reference_opposite(a, b);
        double bound = OPPOSITE_ERROR(-log(fmax((double)x, 1e-300)));
        if (x < 1e-280Q) continue;
        checked++;
        check_note("error over bound", reference_error(opposite(a, b), x, 0) / bound);
        CHECK(reference_error(opposite(a, b), x, 0) <= bound);
        CHECK(opposite(a, b) == opposite(b, a));
    }
    check_note("of all", (double)checked / (double)n);
    CHECK(2 * checked >= n);
    CHECK(opposite(0, 1e300) == 1 && opposite(INFINITY, 0) == 1);
    CHECK(opposite(INFINITY, 1e-3) == 0 && opposite(1e300, 1e300) == 0);
}
