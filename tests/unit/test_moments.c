/* Moments against roughness, against Monte Carlo free identities, and where they are no surface. */
#include "check.h"
#include "facet_leadr.h"

#include <math.h>

static facet_roughness random_roughness(struct rng *rng)
{
    const facet_roughness r = {
        .alpha_x = rng_log(rng, 1e-3, 10),
        .alpha_y = rng_log(rng, 1e-3, 10),
        .rho = 1.96 * rng_uniform(rng) - 0.98,
        .slope_x = 0.02 * rng_uniform(rng) - 0.01,
        .slope_y = 0.02 * rng_uniform(rng) - 0.01,
    };
    return r;
}

static void check_moments(const facet_moments *a, const facet_moments *b, double bound)
{
    const double scale = fmax(b->e3, b->e4);
    CHECK_REL(a->e1, b->e1, bound, sqrt(scale));
    CHECK_REL(a->e2, b->e2, bound, sqrt(scale));
    CHECK_REL(a->e3, b->e3, bound, scale);
    CHECK_REL(a->e4, b->e4, bound, scale);
    CHECK_REL(a->e5, b->e5, bound, scale);
}

TEST(known_values)
{
    const facet_roughness r = {
        .alpha_x = 0.5, .alpha_y = 0.25, .rho = 0.5, .slope_x = 0.125, .slope_y = -0.25};
    const facet_moments m = facet_moments_from_roughness(&r);
    CHECK(m.e1 == 0.125 && m.e2 == -0.25);
    CHECK(m.e3 == 0.125 + 0.015625);
    CHECK(m.e4 == 0.03125 + 0.0625);
    CHECK(m.e5 == 0.03125 - 0.03125);
}

TEST(there_and_back)
{
    struct rng rng;
    rng_seed(&rng, 1);
    for (int i = 0; i < 1000; i++) {
        const facet_roughness r = random_roughness(&rng);
        const facet_moments m = facet_moments_from_roughness(&r);
        facet_roughness back;
        bool floored = true;
        CHECK_INT(facet_moments_to_roughness(&m, i % 2 ? 1e-6 : 0, &back, &floored), FACET_OK);
        CHECK(!floored);
        /* The square of the mean slope is up to 200 times the variance here. */
        CHECK_REL(back.alpha_x, r.alpha_x, 1e-13, 0);
        CHECK_REL(back.alpha_y, r.alpha_y, 1e-13, 0);
        CHECK_REL(back.rho, r.rho, 1e-12, 1);
        CHECK(back.slope_x == r.slope_x && back.slope_y == r.slope_y);
    }
}

/* A mean slope much larger than the roughness: all that is lost is what E3 itself lost. */
TEST(cancellation)
{
    const facet_moments m = {4, 4, 16 + 0x1p-20, 16 + 0x1p-22, 16 + 0x1p-23};
    facet_roughness r;
    CHECK_INT(facet_moments_to_roughness(&m, 0, &r, NULL), FACET_OK);
    CHECK(r.alpha_x == sqrt(0x1p-19) && r.alpha_y == sqrt(0x1p-21));
    CHECK_REL(r.rho, 0.25, 1e-15, 0);
    /* e1 e1 is not a double: without fma the variance would come out as a rounding error. */
    const double s = 0.1;
    const facet_moments n = {s, 0, s * s, 1, 0};
    CHECK_INT(facet_moments_to_roughness(&n, 0, &r, NULL),
              fma(-s, s, s * s) > 5e-17 ? FACET_OK : FACET_BAD_ALPHA);
}

TEST(refusals)
{
    facet_roughness r = {.alpha_x = 7, .alpha_y = 7, .slope_x = 7, .slope_y = 7};
    const facet_moments flat = {0, 0, 0, 0, 0}, negative = {1, 0, 0.5, 1, 0};
    const facet_moments line = {0, 0, 1, 1, 1}, beyond = {0, 0, 1, 1, 1.5};
    const facet_moments nan_ = {0, 0, NAN, 1, 0}, inf_ = {INFINITY, 0, 1, 1, 0};
    CHECK_INT(facet_moments_to_roughness(&flat, 0, &r, NULL), FACET_BAD_ALPHA);
    CHECK_INT(facet_moments_to_roughness(&negative, 0, &r, NULL), FACET_BAD_ALPHA);
    CHECK_INT(facet_moments_to_roughness(&line, 0, &r, NULL), FACET_BAD_RHO);
    CHECK_INT(facet_moments_to_roughness(&beyond, 0, &r, NULL), FACET_BAD_RHO);
    CHECK_INT(facet_moments_to_roughness(&nan_, 1e-3, &r, NULL), FACET_BAD_ALPHA);
    CHECK_INT(facet_moments_to_roughness(&inf_, 1e-3, &r, NULL), FACET_BAD_ALPHA);
    CHECK(r.alpha_x == 7 && r.slope_y == 7);
}

TEST(floor_keeps_mean_and_axes)
{
    facet_roughness r;
    bool floored = false;
    const facet_moments flat = {0.25, -0.5, 0.0625, 0.25, -0.125};
    CHECK_INT(facet_moments_to_roughness(&flat, 0.01, &r, &floored), FACET_OK);
    CHECK(floored && r.alpha_x == 0.01 && r.alpha_y == 0.01 && r.rho == 0);
    CHECK(r.slope_x == 0.25 && r.slope_y == -0.5);

    struct rng rng;
    rng_seed(&rng, 2);
    for (int i = 0; i < 1000; i++) {
        /* A principal alpha of 1 along an angle, an inadmissible or tiny one across it. */
        const double angle = 6.3 * rng_uniform(&rng), c = cos(angle), s = sin(angle);
        const double low = i % 2 ? -0.1 * rng_uniform(&rng) : 1e-4 * rng_uniform(&rng);
        const facet_moments m = {0, 0, (c * c + low * s * s) / 2, (s * s + low * c * c) / 2,
                                 c * s * (1 - low) / 2};
        CHECK_INT(facet_moments_to_roughness(&m, 0.1, &r, &floored), FACET_OK);
        CHECK(floored);
        const facet_moments back = facet_moments_from_roughness(&r);
        const facet_moments want = {0, 0, (c * c + 0.01 * s * s) / 2, (s * s + 0.01 * c * c) / 2,
                                    c * s * 0.99 / 2};
        check_moments(&back, &want, 1e-14);
    }
}

TEST(floor_fattens_what_is_too_thin)
{
    struct rng rng;
    rng_seed(&rng, 3);
    for (int i = 0; i < 1000; i++) {
        const double angle = 6.3 * rng_uniform(&rng), c = cos(angle), s = sin(angle);
        const double a1 = rng_log(&rng, 1e-2, 1e3);
        const facet_moments m = {0, 0, a1 * a1 * c * c / 2, a1 * a1 * s * s / 2,
                                 a1 * a1 * c * s / 2};
        facet_roughness r;
        bool floored = false;
        CHECK_INT(facet_moments_to_roughness(&m, 1e-8, &r, &floored), FACET_OK);
        CHECK(floored);
    }
}

/* Sum of processes: means and covariances add, whatever the means. */
TEST(add)
{
    struct rng rng;
    rng_seed(&rng, 4);
    for (int i = 0; i < 1000; i++) {
        const facet_roughness a = random_roughness(&rng), b = random_roughness(&rng);
        const facet_moments ma = facet_moments_from_roughness(&a);
        const facet_moments mb = facet_moments_from_roughness(&b);
        const facet_moments sum = facet_moments_add(&ma, &mb), other = facet_moments_add(&mb, &ma);
        const double xx = a.alpha_x * a.alpha_x + b.alpha_x * b.alpha_x;
        const double yy = a.alpha_y * a.alpha_y + b.alpha_y * b.alpha_y;
        const double xy = a.rho * a.alpha_x * a.alpha_y + b.rho * b.alpha_x * b.alpha_y;
        const facet_roughness r = {.alpha_x = sqrt(xx),
                                   .alpha_y = sqrt(yy),
                                   .rho = xy / sqrt(xx * yy),
                                   .slope_x = a.slope_x + b.slope_x,
                                   .slope_y = a.slope_y + b.slope_y};
        const facet_moments want = facet_moments_from_roughness(&r);
        check_moments(&sum, &want, 1e-14);
        check_moments(&sum, &other, 1e-15);
    }
}

/* Against moments of the transformed slopes themselves, four slopes at a time. */
TEST(scale_and_transform)
{
    struct rng rng;
    rng_seed(&rng, 5);
    for (int i = 0; i < 200; i++) {
        double j[4], x[4], y[4];
        for (int k = 0; k < 4; k++) {
            j[k] = 2 * rng_uniform(&rng) - 1;
            x[k] = 2 * rng_uniform(&rng) - 1;
            y[k] = 2 * rng_uniform(&rng) - 1;
        }
        facet_moments before = {0, 0, 0, 0, 0}, after = before, scaled = before;
        for (int k = 0; k < 4; k++) {
            const double tx = j[0] * x[k] + j[2] * y[k], ty = j[1] * x[k] + j[3] * y[k];
            const facet_moments p = {x[k], y[k], x[k] * x[k], y[k] * y[k], x[k] * y[k]};
            const facet_moments q = {tx, ty, tx * tx, ty * ty, tx * ty};
            before.e1 += p.e1 / 4, before.e2 += p.e2 / 4, before.e3 += p.e3 / 4;
            before.e4 += p.e4 / 4, before.e5 += p.e5 / 4;
            after.e1 += q.e1 / 4, after.e2 += q.e2 / 4, after.e3 += q.e3 / 4;
            after.e4 += q.e4 / 4, after.e5 += q.e5 / 4;
            scaled.e1 -= 3 * p.e1 / 4, scaled.e2 -= 3 * p.e2 / 4, scaled.e3 += 9 * p.e3 / 4;
            scaled.e4 += 9 * p.e4 / 4, scaled.e5 += 9 * p.e5 / 4;
        }
        const facet_moments t = facet_moments_transform(&before, j);
        const facet_moments b = facet_moments_scale(&before, -3);
        check_moments(&t, &after, 1e-14);
        check_moments(&b, &scaled, 1e-14);
    }
}
