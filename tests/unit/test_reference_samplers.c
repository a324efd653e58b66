/* The quad references of the samplers: each pdf is the Jacobian of its own sampler. */
#include "../accuracy/reference_samplers.h"
#include "check.h"

#include <math.h>

static const facet_roughness surfaces[] = {
    {.alpha_x = 0.4, .alpha_y = 0.4},
    {.alpha_x = 0.3, .alpha_y = 0.9, .rho = 0.7},
    {.alpha_x = 1.6, .alpha_y = 1.6},
    {.alpha_x = 1.6, .alpha_y = 1.3, .rho = -0.2},
    {.alpha_x = 0.3, .alpha_y = 0.5, .rho = 0.2, .slope_x = 0.4, .slope_y = -0.2},
};
static const double views[][3] = {{0, 0, 1}, {0.48, -0.36, 0.8}, {-0.6, 0.795989949685296, 0.08}};

static facet_material material(int ndf, int surface)
{
    return (facet_material){
        .ndf = (facet_ndf)ndf,
        .roughness = surfaces[surface],
        .fresnel = {.kind = FACET_FRESNEL_DIELECTRIC, .channels = 1, .eta = {1.5}}};
}

static quad triple(const quad a[3], const quad b[3], const quad c[3])
{
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) +
           a[2] * (b[0] * c[1] - b[1] * c[0]);
}

static double size_of(quad x)
{
    return (double)(x < 0 ? -x : x);
}

/* pdf |d wi / d(u1, u2)| = 1, by central differences. */
static double jacobian_error(enum reference_method method, const facet_material *m,
                             const double wo[3], double u1, double u2)
{
    const double step = 0x1p-20;
    struct reference_sample at, left, right, low, high;
    quad d1[3], d2[3];
    reference_sample_by(method, m, wo, u1, u2, &at);
    reference_sample_by(method, m, wo, u1 - step, u2, &left);
    reference_sample_by(method, m, wo, u1 + step, u2, &right);
    reference_sample_by(method, m, wo, u1, u2 - step, &low);
    reference_sample_by(method, m, wo, u1, u2 + step, &high);
    for (int j = 0; j < 3; j++) {
        d1[j] = (right.wi[j] - left.wi[j]) / (2 * step);
        d2[j] = (high.wi[j] - low.wi[j]) / (2 * step);
    }
    return fabs(size_of(triple(at.wi, d1, d2) * at.pdf) - 1);
}

TEST(every_pdf_is_the_density_of_its_sampler)
{
    for (int method = 0; method < REFERENCE_METHOD_COUNT; method++)
        for (int ndf = 0; ndf < 2; ndf++)
            for (int s = 0; s < 5; s++)
                for (int v = 0; v < 3; v++)
                    for (int k = 0; k < 4; k++) {
                        bool ggx_only = method == REFERENCE_BOUNDED ||
                                        method == REFERENCE_SLOPE_GGX;
                        if (ggx_only && ndf != FACET_GGX) continue;
                        facet_material m = material(ndf, s);
                        double u1 = 0.15 + 0.22 * k, u2 = 0.9 - 0.17 * k;
                        double error = jacobian_error((enum reference_method)method, &m, views[v],
                                                      u1, u2);
                        check_note("error", error);
                        if (!(error < 1e-8))
                            check_fail(__FILE__, __LINE__,
                                       "method %d ndf %d surface %d view %d: %g", method, ndf, s, v,
                                       error);
                    }
}

/* Nothing is wasted from above, and the pdf is 0 beyond the cap. */
TEST(bounded_wastes_nothing_from_above)
{
    for (int s = 0; s < 3; s += 2) {
        facet_material m = material(FACET_GGX, s);
        for (double u1 = 0; u1 < 1; u1 += 0.125) {
            struct reference_sample at;
            reference_sample_by(REFERENCE_BOUNDED, &m, views[0], u1, 1 - 0x1p-50, &at);
            CHECK(at.wi[2] >= 0 && at.wi[2] < 1e-12);
        }
    }
    facet_material m = material(FACET_GGX, 0);
    const quad below[3] = {0.8, 0, -0.6}, H[3] = {0.8, 0, 0.4};
    CHECK(reference_pdf_by(REFERENCE_BOUNDED, &m, below, views[0], H) == 0);
    CHECK(reference_pdf_by(REFERENCE_SLOPE_GGX, &m, below, views[0], H) > 0);
    CHECK(reference_bounded_share(&m, views[1]) < 1);
    m.roughness = surfaces[4];
    CHECK(reference_bounded_share(&m, views[1]) == 1);
}

/* ndf density times the chance of h, plus that of its twin, is the density of the cavity's normals. */
TEST(vcavity_pdf_is_that_of_the_twins)
{
    for (int ndf = 0; ndf < 2; ndf++)
        for (int s = 0; s < 5; s++)
            for (int v = 0; v < 3; v++) {
                facet_material m = material(ndf, s);
                struct reference_twins t = reference_vcavity(&m, views[v], 0.3, 0.7);
                quad oh = 0, H[3];
                for (int j = 0; j < 3; j++) oh += views[v][j] * t.h[0][j];
                if (!(oh > 0)) continue;
                for (int j = 0; j < 3; j++) H[j] = 2 * oh * t.h[0][j];
                /* h itself kept, or drawn as the twin of its own twin: both with chance 1 - chance. */
                quad density = 2 * reference_ndf(&m, H) * t.h[0][2] * (1 - t.chance) / (4 * oh);
                CHECK_REL((double)density, (double)reference_vcavity_pdf(&m, views[v], H), 1e-14,
                          0);
            }
}

static void move(const quad h[3], const quad along[3], quad step, quad out[3])
{
    quad length = 0;
    for (int j = 0; j < 3; j++) out[j] = h[j] + step * along[j];
    for (int j = 0; j < 3; j++) length += out[j] * out[j];
    for (int j = 0; j < 3; j++)
        out[j] *= (3 - length) / 2; /* Newton's step to length 1: error step^4 */
}

/* Snell's law, the way back to h, d omega_h / d omega_i, and f cos / pdf = G / G1. */
TEST(refraction)
{
    static const double etas[] = {1.5, 0.7, 1.0001};
    for (int e = 0; e < 3; e++)
        for (int side = -1; side <= 1; side += 2) {
            facet_material m = material(FACET_GGX, 1);
            m.fresnel.eta[0] = etas[e];
            const double wo[3] = {side * 0.48, side * -0.36, side * 0.8};
            const quad h[3] = {0.6 * 0.28, 0.8 * 0.28, 0.96}, x[3] = {0.8, -0.6, 0},
                       y[3] = {-0.6 * 0.96, -0.8 * 0.96, 0.28};
            quad wi[3], left[3], right[3], low[3], high[3], d1[3], d2[3], moved[3];
            const quad step = 0x1p-24;
            bool ok = reference_refracted(&m, wo, h, 0, wi);
            CHECK(ok);
            if (!ok) continue;
            struct reference_refraction r;
            reference_refract(&m, wi, wo, 0, &r);
            for (int j = 0; j < 3; j++) CHECK(size_of(r.h[j] - h[j]) < 1e-15);
            move(h, x, -step, moved), reference_refracted(&m, wo, moved, 0, left);
            move(h, x, step, moved), reference_refracted(&m, wo, moved, 0, right);
            move(h, y, -step, moved), reference_refracted(&m, wo, moved, 0, low);
            move(h, y, step, moved), reference_refracted(&m, wo, moved, 0, high);
            for (int j = 0; j < 3; j++) {
                d1[j] = (right[j] - left[j]) / (2 * step);
                d2[j] = (high[j] - low[j]) / (2 * step);
            }
            CHECK_REL(size_of(triple(wi, d1, d2) * r.jacobian), 1, 1e-10, 0);
            /* tangents along the facet scale by 1/eta */
            quad eta = side < 0 ? 1 / (quad)etas[e] : (quad)etas[e], along_o = 0, along_i = 0;
            for (int j = 0; j < 3; j++) along_o += wo[j] * x[j], along_i += wi[j] * x[j];
            CHECK(size_of(along_o + eta * along_i) < 1e-15);
            double up[3] = {0.48, -0.36, 0.8},
                   down[3] = {-side * (double)wi[0], -side * (double)wi[1], -side * (double)wi[2]};
            double go = 0.8 / (double)reference_sigma(&m, up),
                   gi = down[2] / (double)reference_sigma(&m, down);
            double weight = (double)(r.f * down[2] / r.pdf);
            CHECK_REL(weight, gi / (gi + go - gi * go), 1e-14, 0);
        }
    facet_material m = material(FACET_GGX, 0);
    struct reference_refraction r;
    const quad above[3] = {0.6, 0, 0.8};
    reference_refract(&m, above, views[1], 0, &r);
    CHECK(r.f == 0 && r.pdf == 0 && r.fresnel == 1);
}
