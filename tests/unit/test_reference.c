/* The reference itself against definitions and textbook forms it does not use. */
#include "../accuracy/reference.h"
#include "check.h"

#include <math.h>

static facet_material material(facet_ndf ndf, facet_roughness roughness)
{
    facet_material m = {.ndf = ndf, .roughness = roughness};
    m.fresnel.kind = FACET_FRESNEL_IDEAL;
    m.fresnel.channels = 1;
    return m;
}

/* sigma(k) is the integral of <k, h> D over the normals seen from k. */
TEST(projected_area_is_its_integral)
{
    static const facet_roughness roughness[] = {
        {.alpha_x = 0.05, .alpha_y = 2, .rho = -0.9},
        {.alpha_x = 1.5, .alpha_y = 0.4, .rho = 0.6, .slope_x = 0.8, .slope_y = -1.3},
    };
    static const double k[][3] = {{0.6, 0, 0.8}, {-0.48, 0.876, 0.048}, {0.3, 0.4, -0.2}};
    for (int ndf = FACET_GGX; ndf <= FACET_BECKMANN; ndf++)
        for (int i = 0; i < 2; i++)
            for (int j = 0; j < 3; j++) {
                facet_material m = material((facet_ndf)ndf, roughness[i]);
                quad closed = reference_sigma(&m, k[j]);
                quad integral = reference_sigma_integral(&m, k[j]);
                double error = (double)((integral - closed) / closed);
                check_note("error", fabs(error));
                if (!(fabs(error) < 1e-11))
                    check_fail(__FILE__, __LINE__, "ndf %d roughness %d k %d: %.17g, not %.17g",
                               ndf, i, j, (double)closed, (double)integral);
            }
}

/* The number of the issue, and the whole f_r of the thesis: F D G / (4 z_i z_o), eqs. 2.1 and 2.13. */
TEST(brdf_of_the_thesis)
{
    facet_material m = material(FACET_GGX, (facet_roughness){.alpha_x = 0.3, .alpha_y = 0.3});
    const double wi[3] = {0.6, 0, 0.8}, wo[3] = {-0.6, 0, 0.8};
    struct reference r;
    reference_eval(&m, wi, wo, &r);
    CHECK_REL((double)r.of[FACET_FR][0], 1.34785690, 3e-9, 0); /* the digits it prints, cut off */

    m = material(FACET_BECKMANN, (facet_roughness){.alpha_x = 0.4, .alpha_y = 0.7, .rho = 0.3});
    const double wi2[3] = {0.36, 0.48, 0.8}, wo2[3] = {-0.64, 0.48, 0.6};
    reference_eval(&m, wi2, wo2, &r);
    double gi = (double)r.of[FACET_G1_I][0], go = (double)r.of[FACET_G1_O][0];
    double g = gi * go / (gi + go - gi * go);
    CHECK_REL((double)r.of[FACET_G][0], g, 1e-15, 0);
    CHECK_REL((double)r.of[FACET_FR][0], (double)r.of[FACET_D][0] * g / (4 * 0.8 * 0.6), 1e-15, 0);
    m.masking = FACET_SMITH_UNCORRELATED;
    reference_eval(&m, wi2, wo2, &r);
    CHECK_REL((double)r.of[FACET_G][0], gi * go, 1e-15, 0);
    /* Beckmann's G1 as thesis table 2.III prints it, isotropic. */
    m = material(FACET_BECKMANN, (facet_roughness){.alpha_x = 0.4, .alpha_y = 0.4});
    reference_eval(&m, wi, wo, &r);
    double v = 0.8 / (0.4 * 0.6), printed = 1 + erf(v) + exp(-v * v) / (v * sqrt(acos(-1)));
    CHECK_REL((double)r.of[FACET_G1_O][0], 2 / printed, 5e-16, 0);
}

/* V-groove and normal map on a central surface as thesis table 2.IV prints them. */
TEST(other_maskings_of_the_thesis)
{
    facet_material m = material(FACET_GGX,
                                (facet_roughness){.alpha_x = 0.4, .alpha_y = 0.7, .rho = 0.3});
    const double wi[3] = {0.936, 0.28, sqrt(1 - 0.936 * 0.936 - 0.28 * 0.28)},
                 wo[3] = {-0.64, 0.48, 0.6};
    double H[3], size = 0;
    for (int j = 0; j < 3; j++) {
        H[j] = wi[j] + wo[j];
        size += H[j] * H[j];
    }
    size = sqrt(size);
    double kh = size / 2, zh = H[2] / size;
    struct reference r;
    m.masking = FACET_VGROOVE;
    reference_eval(&m, wi, wo, &r);
    double gi = fmin(1, 2 * zh * wi[2] / kh), go = fmin(1, 2 * zh * wo[2] / kh);
    CHECK(gi < 1);
    CHECK_REL((double)r.of[FACET_G1_I][0], gi, 1e-15, 0);
    CHECK_REL((double)r.of[FACET_G1_O][0], go, 1e-15, 0);
    CHECK_REL((double)r.of[FACET_G][0], fmin(gi, go), 1e-15, 0);
    m.masking = FACET_NONE;
    reference_eval(&m, wi, wo, &r);
    CHECK_REL((double)r.of[FACET_G][0], wo[2] * zh / kh, 1e-15, 0);
}

/* Complex amplitudes against the real form of thesis table 2.I, both sides of total reflection. */
TEST(fresnel_forms_agree)
{
    static const double etas[] = {0.5, 0.75, 0.999, 1.001, 1.5, 2.4, 100};
    for (size_t e = 0; e < sizeof etas / sizeof *etas; e++)
        for (int i = 1; i <= 64; i++) {
            quad c = (quad)i / 64;
            facet_fresnel f = {.kind = FACET_FRESNEL_DIELECTRIC, .channels = 1, .eta = {etas[e]}};
            double real = (double)reference_fresnel_table_2_1(etas[e], c);
            CHECK_REL((double)reference_fresnel(&f, c, 0), real, 3e-16, 1e-30);
        }
    /* gold at 650 nm, normal incidence: |(n - 1)/(n + 1)|^2 */
    facet_fresnel gold = {
        .kind = FACET_FRESNEL_CONDUCTOR, .channels = 1, .eta = {0.15}, .k = {3.2}};
    double normal = (0.85 * 0.85 + 3.2 * 3.2) / (1.15 * 1.15 + 3.2 * 3.2);
    CHECK_REL((double)reference_fresnel(&gold, 1, 0), normal, 5e-16, 0);
}

/*
 * D / sigma where both underflow: the ratio must not.  Near the edge of what wo sees, h has
 * slopes just beyond v = c/s: pdf = P sec^4 / (4 sigma) -> |v|^2 / (2 sqrt(pi)...): compared
 * with the leading asymptotic term sigma ~ s exp(-v^2) / (4 sqrt(pi) v^2).
 */
TEST(ratio_of_underflows)
{
    const double a = 1e-3, z = -0.1, x = sqrt(1 - z * z);
    facet_material m = material(FACET_BECKMANN, (facet_roughness){.alpha_x = a, .alpha_y = a});
    const double wo[3] = {x, 0, z}, up = 1e-9; /* h turned from the edge toward wo by up */
    const double h[3] = {-z + up * x, 0, x + up * z}, oh = wo[0] * h[0] + wo[2] * h[2];
    const double wi[3] = {2 * oh * h[0] - wo[0], 0, 2 * oh * h[2] - wo[2]};
    struct reference r;
    reference_eval(&m, wi, wo, &r);
    CHECK((double)r.of[FACET_D][0] == 0 && (double)r.of[FACET_SIGMA_O][0] == 0);
    double hz = (wi[2] + wo[2]) / (2 * oh), hx = (wi[0] + wo[0]) / (2 * oh), v = z / (a * x);
    double away = (hx * hx / (hz * hz) - z * z / (x * x)) / (a * a); /* E - v^2 > 0 */
    double pdf = exp(-away) / (acos(-1) * a * a * pow(hz, 4)) * v * v / (a * x) * sqrt(acos(-1));
    CHECK(away > 0 && away < 1);
    CHECK_REL((double)r.of[FACET_PDF][0], pdf, 3e-4, 0);
}

/* The sampler lands where its own distribution says: h on the sphere, wi mirrored, known medians. */
TEST(sampler_by_hand)
{
    facet_material m = material(FACET_BECKMANN, (facet_roughness){.alpha_x = 0.5, .alpha_y = 0.5});
    const double up[3] = {0, 0, 1}, slanted[3] = {0.6, 0, 0.8};
    struct reference_sample s;
    reference_sample(&m, up, 0.5, 0.5, &s);
    CHECK(fabs((double)s.h[0]) < 1e-30 && fabs((double)s.wi[2] - 1) < 1e-30);
    reference_sample(&m, up, 0.5 * (1 + erf(0.7)), 0.5, &s); /* slope .7 alpha along x */
    CHECK_REL(-(double)(s.h[0] / s.h[2]), 0.35, 1e-14, 0);
    m.ndf = FACET_GGX;
    reference_sample(&m, up, 0, 0.25, &s); /* tan theta = alpha sqrt(u/(1-u)) */
    CHECK_REL((double)(s.h[0] / s.h[2]), 0.5 * sqrt(1.0 / 3), 1e-15, 0);
    for (int i = 1; i < 8; i++) {
        m.ndf = i & 1 ? FACET_GGX : FACET_BECKMANN;
        reference_sample(&m, slanted, i / 8.0, 1 - i / 9.0, &s);
        const double wi[3] = {(double)s.wi[0], (double)s.wi[1], (double)s.wi[2]};
        struct reference r;
        reference_eval(&m, wi, slanted, &r);
        CHECK_REL((double)(s.weight[0] * s.pdf), (double)r.of[FACET_FR_COS][0], 1e-14, 0);
    }
}
