/* Ellipses and moments as doubles: what is written is read again, and differs by what is said. */
#include "check.h"
#include "draw.h"
#include "facet_forms.h"

#include <math.h>

typedef __float128 quad;

/* 2 Cov of a roughness. */
struct shape {
    quad xx, yy, xy;
};

static struct shape shape_of(const facet_roughness *r)
{
    const quad x = (quad)r->alpha_x + r->low.alpha_x, y = (quad)r->alpha_y + r->low.alpha_y,
               rho = (quad)r->rho + r->low.rho;
    return (struct shape){x * x, y * y, rho * x * y};
}

/* The square of the width along (c, s) after the map that makes a's a unit circle: a = L L^T. */
static double stretched(const struct shape *a, const struct shape *b, double c, double s)
{
    /* n = L^-T m; what the roots lack scales both widths alike */
    const quad lxx = a->xx, cross = a->xy / a->xx, rest = a->yy - a->xy * cross;
    const quad root_x = sqrtl((long double)lxx), root_y = sqrtl((long double)rest);
    const quad ny = s / root_y, nx = c / root_x - cross * ny;
    const quad wide_a = nx * nx * a->xx + 2 * nx * ny * a->xy + ny * ny * a->yy;
    const quad wide_b = nx * nx * b->xx + 2 * nx * ny * b->xy + ny * ny * b->yy;
    return (double)(wide_b / wide_a - 1);
}

static double widest_difference(const facet_roughness *a, const facet_roughness *b)
{
    enum { DIRECTIONS = 720 };
    const struct shape of_a = shape_of(a), of_b = shape_of(b);
    double most = 0;
    for (int i = 0; i < DIRECTIONS; i++) {
        const double angle = FACET_PI * i / DIRECTIONS;
        const double more = stretched(&of_a, &of_b, cos(angle), sin(angle));
        most = fmax(most, fabs(more / (1 + sqrt(1 + more))));
    }
    return most;
}

static double draw_alpha(struct rng *rng)
{
    const double u = rng_uniform(rng);
    return u < .2 ? FACET_ALPHA_MIN : u < .4 ? FACET_ALPHA_MAX : rng_log(rng, 1e-8, 1e4);
}

static facet_roughness draw(struct rng *rng)
{
    const double u = rng_uniform(rng), sign = rng_uniform(rng) < .5 ? -1 : 1;
    const double rho = u < .25 ? FACET_RHO_MAX : u < .75 ? 1 - rng_log(rng, 1e-12, 1) : 0;
    const double slope = rng_uniform(rng) < .5 ? 0 : rng_log(rng, 1e-9, 1e6);
    return (facet_roughness){.alpha_x = draw_alpha(rng),
                             .alpha_y = draw_alpha(rng),
                             .rho = sign * fmin(rho, FACET_RHO_MAX),
                             .slope_x = slope,
                             .slope_y = -slope * rng_uniform(rng)};
}

TEST(an_ellipse_that_is_written_is_read)
{
    struct rng rng;
    rng_seed(&rng, 41);
    for (size_t i = draw_count(4000); i--;) {
        const facet_roughness r = draw(&rng);
        const facet_ellipse exact = facet_roughness_to_ellipse(&r);
        facet_ellipse e;
        facet_roughness back;
        double difference = -1;
        const bool is_held = facet_ellipse_readable(&r, &e, &difference);
        /* An angle is told within 1.2e-16, which moves the minor axis by the ratio of the two. */
        CHECK(is_held || exact.alpha_1 > 2e14 * exact.alpha_2);
        if (!is_held) continue;
        CHECK_INT(facet_roughness_from_ellipse(&e, r.slope_x, r.slope_y, &back), FACET_OK);
        CHECK(e.alpha_1 >= FACET_AXIS_MIN && e.alpha_2 >= FACET_AXIS_MIN);
        CHECK(e.alpha_1 <= FACET_AXIS_MAX && e.alpha_2 <= FACET_AXIS_MAX);
        CHECK_REL(difference, widest_difference(&r, &back), 1e-3, 1e-20);
        CHECK(difference <= 1e-15 + 4e-16 * exact.alpha_1 / exact.alpha_2);
    }
}

TEST(moments_that_are_written_are_read)
{
    struct rng rng;
    rng_seed(&rng, 42);
    for (size_t i = draw_count(4000); i--;) {
        const facet_roughness r = draw(&rng);
        facet_moments m;
        facet_roughness back;
        double difference = -1;
        const bool is_held = facet_moments_readable(&r, &m, &difference);
        const facet_ellipse e = facet_roughness_to_ellipse(&r);
        const double least = fmin(e.alpha_2, fmin(r.alpha_x, r.alpha_y) * sqrt(1 - r.rho * r.rho));
        /* Between opposite ends a thin one cannot move inside. */
        const bool is_stuck = fmin(r.alpha_x, r.alpha_y) == FACET_ALPHA_MIN &&
                              fmax(r.alpha_x, r.alpha_y) == FACET_ALPHA_MAX;
        CHECK(is_held || fabs(r.slope_x) > 1e6 * least || is_stuck);
        if (!is_held) continue;
        const facet_covariance c = facet_covariance_from_moments(&m);
        CHECK_INT(facet_roughness_from_covariance(&c, m.e1, m.e2, &back), FACET_OK);
        CHECK_REL(difference, widest_difference(&r, &back), 1e-3, 1e-20);
    }
}

TEST(a_difference_is_that_of_the_widest)
{
    const facet_roughness a = {.alpha_x = .5, .alpha_y = .25},
                          wider = {.alpha_x = 1, .alpha_y = .25},
                          narrower = {.alpha_x = .5, .alpha_y = .0625};
    CHECK_REL(facet_roughness_difference(&a, &wider), 1, 1e-15, 0);
    CHECK_REL(facet_roughness_difference(&wider, &a), .5, 1e-15, 0);
    CHECK_REL(facet_roughness_difference(&a, &narrower), .75, 1e-15, 0);
    CHECK(facet_roughness_difference(&a, &a) == 0);
}
