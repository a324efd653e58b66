/* How many different things samples say, and what is fitted to few. */
#include "check.h"
#include "facet_fit.h"

#include <math.h>

enum { MANY = 400 };

/* Samples of a GGX metal at pairs of polar angles and an azimuth between them, each at so many turns. */
struct goniometer {
    size_t n;
    double wi[3][MANY], wo[3][MANY], fr[3][MANY];
};

struct position {
    double theta_i, theta_o, phi;
};

static double rounded(double x, double digits)
{
    return digits > 0 ? round(x * digits) / digits : x;
}

static void set_direction(double *const k[3], size_t i, double theta, double phi, double digits)
{
    k[0][i] = rounded(sin(theta) * cos(phi), digits);
    k[1][i] = rounded(sin(theta) * sin(phi), digits);
    k[2][i] = rounded(cos(theta), digits);
}

static void measure(struct goniometer *g, const struct position *p, size_t n, size_t turns,
                    double digits)
{
    double *wi[3] = {g->wi[0], g->wi[1], g->wi[2]}, *wo[3] = {g->wo[0], g->wo[1], g->wo[2]};
    g->n = n * turns;
    for (size_t i = 0; i < g->n; i++) {
        double turn = 2.4 * (double)(i / n);
        set_direction(wi, i, p[i % n].theta_i, turn, digits);
        set_direction(wo, i, p[i % n].theta_o, turn + p[i % n].phi, digits);
    }
}

static facet_fit_samples samples_of(const struct goniometer *g)
{
    return (facet_fit_samples){g->n,
                               {g->wi[0], g->wi[1], g->wi[2]},
                               {g->wo[0], g->wo[1], g->wo[2]},
                               {g->fr[0], g->fr[1], g->fr[2]}};
}

/* Noise of so many parts in logarithms. */
static void paint(struct goniometer *g, double alpha_x, double alpha_y, double noise)
{
    facet_material material = {
        .ndf = FACET_GGX,
        .roughness = {.alpha_x = alpha_x, .alpha_y = alpha_y},
        .fresnel = {.kind = FACET_FRESNEL_SCHLICK, .channels = 1, .f0 = {.9}}};
    facet_fit_samples s = samples_of(g);
    facet_outputs out = {.of[FACET_FR] = {g->fr[0]}};
    facet_brdf *brdf;
    struct rng rng;
    rng_seed(&rng, 5);
    CHECK_INT(facet_brdf_create(&material, &brdf), FACET_OK);
    CHECK_INT(facet_eval(brdf, FACET_PRECISE, s.wi, s.wo, g->n, &out), FACET_OK);
    facet_brdf_destroy(brdf);
    for (size_t i = 0; i < g->n; i++) {
        g->fr[0][i] *= exp(noise * (rng_uniform(&rng) - .5));
        g->fr[1][i] = g->fr[2][i] = g->fr[0][i];
    }
}

static const struct position scan[] = {{.3, .3, 0},    {.7, .5, FACET_PI}, {.1, .9, FACET_PI},
                                       {1.1, .4, 2.0}, {.8, .9, 1.2},      {.2, .6, 2.5}};

static facet_fit_spread spread_of(size_t positions, size_t turns, double digits)
{
    static struct goniometer g;
    facet_fit_spread spread;
    measure(&g, scan, positions, turns, digits);
    facet_fit_samples s = samples_of(&g);
    facet_fit_spread_of(&s, &spread);
    CHECK_INT(spread.used, g.n);
    return spread;
}

TEST(turned_pairs_are_one_to_an_isotropic_surface)
{
    static const double digits[] = {0, 1e6, 1e5}; /* as they are, and as they are written */
    for (int k = 0; k < 3; k++) {
        facet_fit_spread spread = spread_of(5, 6, digits[k]);
        CHECK_INT(spread.round, 5);
        CHECK_INT(spread.turned, 30);
    }
    CHECK_INT(spread_of(6, 60, 0).turned, FACET_FIT_SPREAD_MAX);
    CHECK_INT(spread_of(6, 60, 0).round, 6);
}

/* One pair: itself, exchanged, turned by 180 degrees, mirrored; and two that do not count. */
TEST(images_of_a_pair)
{
    static const double wi[][3] = {{.48, .36, .8},  {-.6, 0, .8},   {-.48, -.36, .8},
                                   {.48, -.36, .8}, {.48, .36, .8}, {1, 0, 9e-4}};
    static const double wo[][3] = {{-.6, 0, .8}, {.48, .36, .8}, {.6, 0, .8},
                                   {-.6, 0, .8}, {-.6, 0, .8},   {0, 0, 1}};
    static struct goniometer g;
    facet_fit_spread spread;
    g.n = 6;
    for (size_t i = 0; i < 6; i++) {
        for (int c = 0; c < 3; c++) g.wi[c][i] = wi[i][c], g.wo[c][i] = wo[i][c], g.fr[c][i] = 1;
    }
    g.fr[1][4] = NAN;
    facet_fit_samples s = samples_of(&g);
    facet_fit_spread_of(&s, &spread);
    CHECK_INT(spread.used, 4);
    CHECK_INT(spread.round, 1);
    CHECK_INT(spread.turned, 2); /* the mirror's is another to an ellipse between the axes */
}

/* The fit to n positions at so many turns; models and tables of its candidates in *seen. */
struct seen {
    bool round, turned, table;
    double alpha_x, alpha_y; /* of the best */
};

static facet_status fit_few(const struct position *p, size_t n, size_t turns, double alpha_x,
                            double noise, struct seen *seen)
{
    static struct goniometer g;
    facet_fit fit;
    measure(&g, p, n, turns, 0);
    paint(&g, alpha_x, .4, noise);
    facet_fit_samples samples = samples_of(&g);
    facet_fit_source source = {.slope_max = INFINITY, .anisotropic = true, .samples = &samples};
    facet_fit_options options = {.masking = FACET_SMITH,
                                 .resolution = FACET_FIT_RESOLUTION,
                                 .models = FACET_FIT_ALL,
                                 .anisotropic = true,
                                 .diffuse = true};
    facet_status status = facet_fit_create(&source, &options, NULL, &fit);
    *seen = (struct seen){0};
    double best = INFINITY;
    for (size_t i = 0; status == FACET_OK && i < fit.count; i++) {
        const facet_fit_candidate *c = &fit.candidate[i];
        *(c->anisotropic ? &seen->turned : &seen->round) = true;
        if (c->material.fresnel.kind == FACET_FRESNEL_TABLE) seen->table = true;
        if (!(c->error.rms_log < best)) continue;
        best = c->error.rms_log;
        seen->alpha_x = c->material.roughness.alpha_x;
        seen->alpha_y = c->material.roughness.alpha_y;
    }
    if (status == FACET_OK) facet_fit_clear(&fit);
    return status;
}

/* Two points of a lobe are met by every roughness with some F0: repeated or turned they are no more. */
TEST(two_positions_tell_no_lobe)
{
    struct seen seen;
    CHECK_INT(fit_few(scan, 1, 20, .4, 0, &seen), FACET_BAD_DATA);
    CHECK_INT(fit_few(scan, 2, 16, .4, 0, &seen), FACET_BAD_DATA);
    CHECK_INT(fit_few(scan, 2, 16, .4, .1, &seen), FACET_BAD_DATA);
    /* all around, at one distance from the normal, elongation is seen but not how rough it is */
    CHECK_INT(fit_few(scan, 1, 20, .1, 0, &seen), FACET_BAD_DATA);
}

TEST(few_positions_that_tell_one)
{
    struct seen seen;
    CHECK_INT(fit_few(scan, 3, 6, .4, .01, &seen), FACET_OK);
    CHECK(seen.round && seen.turned && !seen.table); /* as many nodes as positions */
    CHECK_REL(seen.alpha_x, .4, .01, 0);
    /* an ellipse turned under two positions is seen at many slopes in its own measure */
    CHECK_INT(fit_few(scan, 2, 16, .1, .01, &seen), FACET_OK);
    CHECK(!seen.round && seen.turned);
    CHECK_REL(seen.alpha_x, .1, .01, 0);
    CHECK_REL(seen.alpha_y, .4, .01, 0);
}

/* A line of backscatter has one theta_d; in a plane of incidence every sample has its own. */
TEST(lines_of_samples)
{
    struct position line[20], plane[20];
    struct seen seen;
    for (size_t i = 0; i < 20; i++) {
        line[i] = (struct position){.01 + .07 * (double)i, .01 + .07 * (double)i, 0};
        plane[i] = (struct position){.02 + .075 * (double)i, .8, FACET_PI};
    }
    CHECK_INT(fit_few(line, 20, 1, .4, .01, &seen), FACET_OK);
    CHECK(seen.round && seen.table);
    CHECK_REL(seen.alpha_x, .4, .02, 0);
    CHECK_INT(fit_few(plane, 20, 1, .4, .01, &seen), FACET_OK);
    CHECK(seen.round);
    CHECK_REL(seen.alpha_x, .4, .02, 0);
}
