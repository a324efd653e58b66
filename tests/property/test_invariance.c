/* What must not matter: the frame's azimuth, how a batch is cut, what else is asked for, the
 * colours. */
#include "check.h"
#include "draw.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { N = 45 };

struct batch {
    double i[3][N], o[3][N], y[FACET_QUANTITY_COUNT][3][N];
};

static const bool coloured[] = {
#define QUANTITY(id, name, coloured, doc) coloured,
#include "quantities.def"
#undef QUANTITY
};

static facet_material any_material(struct rng *rng)
{
    facet_material m = {.ndf = rng_uniform(rng) < 0.5 ? FACET_GGX : FACET_BECKMANN};
    m.masking = (facet_masking)(int)(rng_uniform(rng) * FACET_MASKING_COUNT);
    draw_roughness(rng, &draw_ordinary, &m.roughness);
    draw_fresnel(rng, (facet_fresnel_kind)(int)(rng_uniform(rng) * FACET_FRESNEL_COUNT),
                 &m.fresnel);
    return m;
}

static void draw_batch(struct rng *rng, const struct draw_domain *domain, const facet_material *m,
                       struct batch *b)
{
    memset(b, 0, sizeof *b);
    for (size_t k = 0; k < N; k++) {
        double wi[3], wo[3];
        draw_pair(rng, domain, m, wi, wo);
        for (int j = 0; j < 3; j++) {
            b->i[j][k] = wi[j];
            b->o[j][k] = wo[j];
        }
    }
}

/* Evaluates pairs from .. from + n; quantity < 0: all. */
static void run(const facet_material *m, facet_tier tier, struct batch *b, size_t from, size_t n,
                int quantity)
{
    facet_brdf *brdf = NULL;
    CHECK_INT(facet_brdf_create(m, &brdf), FACET_OK);
    if (!brdf) return;
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (size_t c = 0; c < (coloured[q] ? m->fresnel.channels : 1); c++)
            if (quantity < 0 || quantity == q) outputs.of[q][c] = b->y[q][c] + from;
    facet_vec3_in wi = {b->i[0] + from, b->i[1] + from, b->i[2] + from};
    facet_vec3_in wo = {b->o[0] + from, b->o[1] + from, b->o[2] + from};
    CHECK_INT(facet_eval(brdf, tier, wi, wo, n, &outputs), FACET_OK);
    facet_brdf_destroy(brdf);
}

static void same(const struct batch *a, const struct batch *b, const facet_material *m,
                 const char *what)
{
    if (!memcmp(a->y, b->y, sizeof a->y)) return;
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (int c = 0; c < 3; c++)
            for (size_t k = 0; k < N; k++)
                if (memcmp(&a->y[q][c][k], &b->y[q][c][k], sizeof(double)))
                    check_fail(__FILE__, __LINE__, "%s: quantity %d, pair %zu: %.17g, %.17g: %s",
                               what, q, k, a->y[q][c][k], b->y[q][c][k], draw_text(m));
}

TEST(cutting_a_batch_changes_no_bit)
{
    struct rng rng;
    rng_seed(&rng, 41);
    static struct batch whole, cut, single;
    for (size_t round = draw_count(300); round--;) {
        facet_material m = any_material(&rng);
        facet_tier tier = (facet_tier)(round % FACET_TIER_COUNT);
        draw_batch(&rng, &draw_everywhere, &m, &whole);
        cut = single = whole;
        run(&m, tier, &whole, 0, N, -1);
        for (size_t from = 0, n; from < N; from += n) {
            n = 1 + (size_t)(rng_uniform(&rng) * 9);
            if (n > N - from) n = N - from;
            run(&m, tier, &cut, from, n, -1);
        }
        same(&whole, &cut, &m, "cut");
        for (int q = 0; q < FACET_QUANTITY_COUNT; q++) run(&m, tier, &single, 0, N, q);
        same(&whole, &single, &m, "one quantity at a time");
    }
}

/* Channel c of a coloured material is the achromatic material of that channel. */
TEST(channels_are_independent)
{
    struct rng rng;
    rng_seed(&rng, 42);
    static struct batch three, one;
    for (size_t round = draw_count(300); round--;) {
        facet_material m = any_material(&rng);
        facet_tier tier = (facet_tier)(round % FACET_TIER_COUNT);
        m.fresnel.channels = 3;
        draw_batch(&rng, &draw_everywhere, &m, &three);
        one = three;
        run(&m, tier, &three, 0, N, -1);
        for (int c = 0; c < 3; c++) {
            facet_material single = m;
            single.fresnel.channels = 1;
            single.fresnel.f0[0] = m.fresnel.f0[c];
            single.fresnel.eta[0] = m.fresnel.eta[c];
            single.fresnel.k[0] = m.fresnel.k[c];
            single.fresnel.values[0] = m.fresnel.values[c];
            run(&single, tier, &one, 0, N, -1);
            for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
                if (coloured[q] && memcmp(three.y[q][c], one.y[q][0], sizeof one.y[q][0]))
                    check_fail(__FILE__, __LINE__, "quantity %d channel %d: %s", q, c,
                               draw_text(&m));
        }
    }
}

/* Without the edges of draw_pair, where rounding a turn shows. */
static void draw_directions(struct rng *rng, double cosine_min, struct batch *b)
{
    memset(b, 0, sizeof *b);
    for (size_t k = 0; k < N; k++) {
        double wi[3], wo[3];
        draw_direction(rng, cosine_min, wi);
        draw_direction(rng, cosine_min, wo);
        for (int j = 0; j < 3; j++) {
            b->i[j][k] = wi[j];
            b->o[j][k] = wo[j];
        }
    }
}

static void turn(double angle, double *x, double *y, size_t n)
{
    double c = cos(angle), s = sin(angle);
    for (size_t k = 0; k < n; k++) {
        double was = x[k];
        x[k] = c * was - s * y[k];
        y[k] = s * was + c * y[k];
    }
}

static void compare_turned(const struct batch *a, const struct batch *b, const facet_material *m,
                           double tolerance)
{
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++)
        for (size_t c = 0; c < (coloured[q] ? m->fresnel.channels : 1); c++)
            for (size_t k = 0; k < N; k++) {
                if (check_within(a->y[q][c][k], b->y[q][c][k], tolerance, 1e-3)) continue;
                check_fail(__FILE__, __LINE__, "quantity %d: %.17g turned %.17g: %s", q,
                           a->y[q][c][k], b->y[q][c][k], draw_text(m));
            }
}

/* The ellipse's major axis lies at -phi: turning the surface by t takes phi to phi - t. */
TEST(turning_surface_and_directions_changes_nothing)
{
    struct rng rng;
    rng_seed(&rng, 43);
    static struct batch a, b;
    for (size_t round = draw_count(300); round--;) {
        facet_material m = any_material(&rng), turned;
        /* the others are ill-conditioned near total reflection */
        if (m.fresnel.kind != FACET_FRESNEL_TABLE) m.fresnel.kind = FACET_FRESNEL_SCHLICK;
        turned = m;
        double major = rng_log(&rng, 0.05, 2), minor = major * (0.1 + 0.9 * rng_uniform(&rng));
        double phi = 3 * rng_uniform(&rng), t = 6 * rng_uniform(&rng);
        double sx = rng_uniform(&rng) - 0.5, sy = rng_uniform(&rng) - 0.5;
        facet_ellipse e = {major, minor, phi}, f = {major, minor, phi - t};
        CHECK_INT(facet_roughness_from_ellipse(&e, sx, sy, &m.roughness), FACET_OK);
        turn(t, &sx, &sy, 1);
        CHECK_INT(facet_roughness_from_ellipse(&f, sx, sy, &turned.roughness), FACET_OK);
        draw_directions(&rng, 0.05, &a);
        b = a;
        turn(t, b.i[0], b.i[1], N);
        turn(t, b.o[0], b.o[1], N);
        run(&m, FACET_PRECISE, &a, 0, N, -1);
        run(&turned, FACET_PRECISE, &b, 0, N, -1);
        compare_turned(&a, &b, &m, 1e-8); /* the turn rounds c_i, which cancels */
    }
}

/* A quarter turn is exact: x' = -y, y' = x swaps the alphas and the sign of rho. */
TEST(a_quarter_turn_changes_nothing)
{
    struct rng rng;
    rng_seed(&rng, 44);
    static struct batch a, b;
    for (size_t round = draw_count(300); round--;) {
        facet_material m = any_material(&rng), turned = m;
        const facet_roughness *r = &m.roughness;
        turned.roughness = (facet_roughness){.alpha_x = r->alpha_y,
                                             .alpha_y = r->alpha_x,
                                             .rho = -r->rho,
                                             .slope_x = -r->slope_y,
                                             .slope_y = r->slope_x};
        draw_batch(&rng, &draw_ordinary, &m, &a);
        b = a;
        for (size_t k = 0; k < N; k++) {
            b.i[0][k] = -a.i[1][k], b.i[1][k] = a.i[0][k];
            b.o[0][k] = -a.o[1][k], b.o[1][k] = a.o[0][k];
        }
        run(&m, FACET_PRECISE, &a, 0, N, -1);
        run(&turned, FACET_PRECISE, &b, 0, N, -1);
        compare_turned(&a, &b, &m, 1e-10);
    }
}

/* Ellipse and back: the same surface, also round (0/0 for the angle) and thin (cancelling radius). */
TEST(ellipse_and_back)
{
    struct rng rng;
    rng_seed(&rng, 45);
    for (size_t round = draw_count(10000); round--;) {
        facet_roughness r, back;
        draw_roughness(&rng, &draw_ordinary, &r);
        facet_ellipse e = facet_roughness_to_ellipse(&r);
        CHECK(e.alpha_1 * (1 + 1e-15) >= e.alpha_2 && e.alpha_2 > 0);
        CHECK_INT(facet_roughness_from_ellipse(&e, r.slope_x, r.slope_y, &back), FACET_OK);
        double ratio = e.alpha_1 / e.alpha_2; /* the thin side hangs on the angle by this */
        double kappa2 = (1 - r.rho) * (1 + r.rho);
        CHECK_REL(e.alpha_1 * e.alpha_2, r.alpha_x * r.alpha_y * sqrt(kappa2), 1e-14, 0);
        CHECK_REL(back.alpha_x, r.alpha_x, 1e-14 * ratio, 0);
        CHECK_REL(back.alpha_y, r.alpha_y, 1e-14 * ratio, 0);
        CHECK(fabs(back.rho - r.rho) <= 1e-14 * ratio);
    }
}
