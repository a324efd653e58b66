/* Thin ellipses at any angle: what facet_roughness keeps of them, and that evaluation loses none of
 * it. */
#include "check.h"
#include "draw.h"
#include "reference.h"

#include <float.h>
#include <math.h>
#include <string.h>

static double uniform(struct rng *rng, double low, double high)
{
    return low + (high - low) * rng_uniform(rng);
}

/* Ratios to 1e12, as thin as FACET_RHO_MAX lets them lie at their angle. */
static bool draw_ellipse(struct rng *rng, int i, facet_ellipse *e, facet_roughness *r)
{
    static const double corners[] = {
        0, 1e-9, 0.78539816339744831, 1.5707963267948966, -3.1415926535897931, 99.9};
    *e = (facet_ellipse){pow(10, uniform(rng, -4, 4)), 0, uniform(rng, -100, 100)};
    e->alpha_2 = fmax(FACET_ALPHA_MIN, e->alpha_1 * pow(10, uniform(rng, i % 2 ? -6 : -12, 0)));
    if (i % 4 == 0) e->phi = corners[i / 4 % 6];
    return facet_roughness_from_ellipse(e, 0, 0, r) == FACET_OK;
}

TEST(a_roughness_keeps_its_ellipse)
{
    struct rng rng;
    double worst = 0;
    int kept = 0;
    rng_seed(&rng, 17);
    for (int i = 0; i < 20000; i++) {
        facet_ellipse e;
        facet_roughness r;
        if (!draw_ellipse(&rng, i, &e, &r)) continue;
        double error = reference_shape_error(&r, &e);
        kept++;
        worst = check_worse(worst, error);
        if (!(error <= 1e-18))
            check_fail(__FILE__, __LINE__, "(%.17g, %.17g, %.17g): %g", e.alpha_1, e.alpha_2, e.phi,
                       error);
    }
    CHECK(kept > 10000);
    check_note("error of the shape", worst);
}

/* What was sent comes back, but for turns and swapped axes. */
TEST(an_ellipse_comes_back_as_it_was)
{
    struct rng rng;
    int kept = 0;
    rng_seed(&rng, 18);
    for (int i = 0; i < 20000; i++) {
        facet_ellipse e;
        facet_roughness r;
        if (!draw_ellipse(&rng, i, &e, &r)) continue;
        facet_ellipse back = facet_roughness_to_ellipse(&r);
        kept++;
        CHECK_REL(back.alpha_1, e.alpha_1, 0, 0);
        CHECK_REL(back.alpha_2, e.alpha_2, 0, 0);
        if (fabs(e.phi) < 1.57 && e.alpha_1 > 1.001 * e.alpha_2) CHECK_REL(back.phi, e.phi, 0, 0);
    }
    CHECK(kept > 10000);
}

static void check_pair(const facet_brdf *brdf, const facet_material *m, const double wi[3],
                       const double wo[3], double *worst)
{
    static const facet_quantity asked[] = {FACET_FR, FACET_PDF, FACET_D, FACET_G, FACET_SIGMA_O};
    /* One rounding of all slopes together: 8 is GGX's gain, 2 x 150 + 4 Beckmann's. */
    const double added = (m->ndf == FACET_GGX ? 8 : 304) * DBL_EPSILON / 2;
    facet_outputs outputs;
    double y[5];
    memset(&outputs, 0, sizeof outputs);
    for (int q = 0; q < 5; q++) outputs.of[asked[q]][0] = y + q;
    facet_vec3_in i = {&wi[0], &wi[1], &wi[2]}, o = {&wo[0], &wo[1], &wo[2]};
    struct reference x;
    CHECK_INT(facet_eval(brdf, FACET_PRECISE, i, o, 1, &outputs), FACET_OK);
    reference_eval(m, wi, wo, &x);
    for (int q = 0; q < 5; q++) {
        double bound, error = reference_error(y[q], x.of[asked[q]][0], FACET_FLOOR);
        CHECK(facet_bound(brdf, FACET_PRECISE, asked[q], 0, &bound));
        *worst = check_worse(*worst, error / (bound + added));
        if (!(error <= bound + added))
            check_fail(__FILE__, __LINE__, "ndf %d quantity %d: %g, promised %g", m->ndf, asked[q],
                       error, bound + added);
    }
}

/* H along the thin axis, where an error in the shape shows most, and anywhere. */
TEST(evaluation_of_thin_ellipses_keeps_its_bound)
{
    struct rng rng;
    double worst = 0;
    int kept = 0;
    rng_seed(&rng, 19);
    for (int i = 0; i < 6000; i++) {
        facet_ellipse e;
        facet_material m = {.ndf = i % 3 ? FACET_GGX : FACET_BECKMANN, .fresnel = {.channels = 1}};
        if (i == 0) e = (facet_ellipse){1, 1e-4, 0.78539816339744831};
        if (i == 0 ? facet_roughness_from_ellipse(&e, 0, 0, &m.roughness)
                   : !draw_ellipse(&rng, i, &e, &m.roughness))
            continue;
        facet_brdf *brdf;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        double theta = atan(e.alpha_2 * uniform(&rng, 0, 4)),
               phi = (i & 1 ? 1.5707963267948966 : 0) - e.phi;
        double t = uniform(&rng, -0.5, 0.5), side[3] = {-sin(phi), cos(phi), 0};
        double h[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)}, wi[3], wo[3];
        for (int j = 0; j < 3; j++)
            wi[j] = h[j] * cos(t) + side[j] * sin(t), wo[j] = h[j] * cos(t) - side[j] * sin(t);
        check_pair(brdf, &m, wi, wo, &worst);
        facet_brdf_destroy(brdf);
        kept++;
    }
    CHECK(kept > 3000);
    check_note("error over promise", worst);
}
