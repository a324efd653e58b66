/* What lib promises of rough dielectrics (facet_bsdf_bound) against the reference. */
#include "check.h"
#include "draw.h"
#include "reference_transmission.h"

#include "opposite.h"

#include <float.h>
#include <math.h>

static const char *const names[] = {
#define QUANTITY(id, name, coloured, doc) name,
#include "quantities.def"
#undef QUANTITY
};

/* An index of [1e-3, 1e3], half of them within 1e-12 .. 1 of 1. */
static double draw_index(struct rng *rng)
{
    double away = pow(10, -12 + 12 * rng_uniform(rng));
    if (rng_uniform(rng) < 0.5) return pow(10, -3 + 6 * rng_uniform(rng));
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
    double lean = hypot(m.roughness.slope_x, m.roughness.slope_y), most = 0.9 * FACET_TRANSMISSION_LEAN_MAX * least;
    if (m.ndf == FACET_BECKMANN && lean > most) {
        m.roughness.slope_x *= most / lean;
        m.roughness.slope_y *= most / lean;
    }
    return m;
}

/* wi the refraction of wo at a normal of slopes a few alpha from the mean one; else anywhere. */
static void draw_across(struct rng *rng, const facet_material *m, double wi[3], double wo[3])
{
    double h[3], c = 0, n = m->fresnel.eta[0];
    const facet_roughness *r = &m->roughness;
    draw_direction(rng, rng_uniform(rng) < 0.3 ? 0 : 1e-3, wo);
    double x = r->alpha_x * tan(1.5 * (2 * rng_uniform(rng) - 1)) + r->slope_x;
    double y = r->alpha_y * tan(1.5 * (2 * rng_uniform(rng) - 1)) + r->slope_y, length = sqrt(1 + x * x + y * y);
    h[0] = -x / length, h[1] = -y / length, h[2] = 1 / length;
    for (int j = 0; j < 3; j++) c += wo[j] * h[j];
    bool below = rng_uniform(rng) < 0.5;
    if (below) n = 1 / n;
    double g2 = n * n - 1 + c * c;
    if (c > 0 && g2 > 0) {
        double bend = (n * n - 1) / (c + sqrt(g2)), size = 0;
        for (int j = 0; j < 3; j++) size += pow(wi[j] = -(wo[j] + bend * h[j]) / n, 2);
        for (int j = 0; j < 3; j++) wi[j] /= sqrt(size);
    } else {
        draw_direction(rng, 0, wi);
        for (int j = 0; j < 3 && rng_uniform(rng) < 0.5; j++) wi[j] = -wi[j];
    }
    for (int j = 0; j < 3 && below; j++) wi[j] = -wi[j], wo[j] = -wo[j];
}

/* Returns how many quantities it compared. */
static size_t check_pair(const facet_bsdf *bsdf, const facet_material *m, const double wi[3], const double wo[3])
{
    double y[FACET_QUANTITY_COUNT], bound;
    size_t checked = 0;
    struct reference_bsdf x;
    facet_outputs outputs = {0};
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) outputs.of[q][0] = &y[q];
    facet_vec3_in i = {&wi[0], &wi[1], &wi[2]}, o = {&wo[0], &wo[1], &wo[2]};
    CHECK_INT(facet_bsdf_eval(bsdf, i, o, 1, &outputs), FACET_OK);
    reference_bsdf(m, FACET_IMPORTANCE, wi, wo, &x);
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
        CHECK(isfinite(y[q]) && y[q] >= 0);
        if (wi[2] * wo[2] >= 0 && q != FACET_PDF) continue; /* test_bounds has reflection */
        if (!facet_bsdf_bound(bsdf, (facet_quantity)q, 0, &bound) || x.of[q] > DBL_MAX) continue;
        double error = reference_error(y[q], x.of[q], FACET_FLOOR);
        checked++;
        check_note(names[q], error / bound);
        if (!(error <= bound))
            check_fail(__FILE__, __LINE__, "%s is %.17g, not %.17g: error %.3g, bound %.3g; eta %.17g\n    %s\n    wi "
                       "{%.17g, %.17g, %.17g} wo {%.17g, %.17g, %.17g}", names[q], y[q], (double)x.of[q], error, bound,
                       m->fresnel.eta[0], draw_text(m), wi[0], wi[1], wi[2], wo[0], wo[1], wo[2]);
    }
    return checked;
}

TEST(quantities_across_the_surface)
{
    struct rng rng;
    size_t checked = 0, n = draw_count(6000);
    rng_seed(&rng, 9);
    for (size_t k = 0; k < n; k++) {
        facet_material m = draw_glass(&rng);
        facet_bsdf *bsdf = NULL;
        facet_status status = facet_bsdf_create(&m, FACET_IMPORTANCE, &bsdf);
        CHECK_INT(status, FACET_OK);
        for (int j = 0; j < 4 && !status; j++) {
            double wi[3], wo[3];
            draw_across(&rng, &m, wi, wo);
            checked += check_pair(bsdf, &m, wi, wo);
        }
        facet_bsdf_destroy(bsdf);
    }
    check_note("of each material", (double)checked / (double)n);
    CHECK(checked >= 10 * n);
}

TEST(samples_where_they_belong)
{
    struct rng rng;
    size_t checked = 0, n = draw_count(1500);
    rng_seed(&rng, 12);
    for (size_t k = 0; k < n; k++) {
        facet_material m = draw_glass(&rng);
        facet_bsdf *bsdf = NULL;
        double wo[3], wi[3], bound, u[3];
        quad exact[3];
        CHECK_INT(facet_bsdf_create(&m, FACET_IMPORTANCE, &bsdf), FACET_OK);
        if (!bsdf) continue;
        draw_direction(&rng, 1e-3, wo);
        for (int j = 0; j < 3; j++) u[j] = 1e-3 + 0.998 * rng_uniform(&rng);
        double turn = rng_uniform(&rng) < 0.5 ? -1 : 1;
        for (int j = 0; j < 3; j++) wo[j] *= turn;
        facet_vec3_in o = {&wo[0], &wo[1], &wo[2]};
        facet_samples samples = {.wi = {&wi[0], &wi[1], &wi[2]}};
        bool promised = facet_bsdf_sample_bound(bsdf, FACET_SAMPLER_AUTO, (turn > 0) == (m.fresnel.eta[0] < 1), 0, &bound);
        CHECK_INT(facet_bsdf_sample(bsdf, FACET_SAMPLER_AUTO, o, &u[0], &u[1], &u[2], 1, &samples), FACET_OK);
        if (promised && reference_bsdf_sample(&m, wo, u, exact))
            for (int j = 0; j < 3; j++, checked++) {
                double error = fabs((double)(wi[j] - exact[j]));
                check_note("error over bound", error / bound);
                if (!(error <= bound))
                    check_fail(__FILE__, __LINE__, "wi[%d] is off by %.3g, bound %.3g; eta %.17g wo %.17g %.17g %.17g u %g %g %g\n %s", j, error, bound,
                               m.fresnel.eta[0], wo[0], wo[1], wo[2], u[0], u[1], u[2], draw_text(&m));
            }
        facet_bsdf_destroy(bsdf);
    }
    check_note("of all", (double)checked / (double)(3 * n));
    CHECK(2 * checked >= 3 * n);
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
        check_note("error over bound", reference_error(facet_opposite(a, b), x, 0) / bound);
        CHECK(reference_error(facet_opposite(a, b), x, 0) <= bound);
        CHECK(facet_opposite(a, b) == facet_opposite(b, a));
    }
    check_note("of all", (double)checked / (double)n);
    CHECK(2 * checked >= n);
    CHECK(facet_opposite(0, 1e300) == 1 && facet_opposite(INFINITY, 0) == 1);
    CHECK(facet_opposite(INFINITY, 1e-3) == 0 && facet_opposite(1e300, 1e300) == 0);
}
