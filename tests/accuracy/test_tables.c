/*
 * Tabulated materials: what the tiers promise against precise, which sees the same table, and D of precise
 * against the table itself in long double.
 */
#include "check.h"
#include "draw.h"
#include "slope_table.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* As many as a table's material has pairs; no whole number of vectors. */
enum { PAIRS = 37, NODES = 91, TURNS = 12 };

/* log D at tan theta = r and an azimuth, at alpha = 1: each is hard in its own way. */
static double flat(double r, double turn)
{
    (void)r, (void)turn;
    return 0;
}
static double steep(double r, double turn)
{
    (void)turn;
    return fmax(2 * log1p(r * r) - r * r, -1e4);
}
static double ends(double r, double turn) /* from much to nothing within a cell */
{
    (void)turn;
    return r < 2 ? -r : -1e4;
}
static double waves(double r, double turn)
{
    (void)turn;
    return -4 * log1p(r) + sin(9 * atan(r)) + (r < 1e300 ? 0.3 * cos(77 * r / (1 + r)) : 0);
}
static double ellipse(double r, double turn)
{
    double x = cos(acos(-1) * turn), e = 1 + 3 * x * x;
    return r < 1e300 ? fmax(2 * log1p(r * r) - 2 * log1p(e * r * r), -60) : -2 * log(e);
}

static double falling(double r, double turn) /* seen from behind, the less the further */
{
    double x = cos(acos(-1) * turn), e = 1 + 3 * x * x;
    return r < 1e300 ? fmax(2 * log1p(r * r) - e * r * r, -1e4) : -1e4;
}

static const struct source {
    const char *name;
    double (*log_d)(double r, double turn);
    double scale;
    size_t turns; /* 0: radial */
} sources[] = {
    {"flat", flat, 1, 0},           {"steep", steep, 1, 0},    {"ends", ends, 1, 0},
    {"waves", waves, .7, 0},        {"narrow", flat, 0.01, 0}, {"wide", steep, 30, 0},
    {"tiny", flat, 1e-8, 0},        {"widest", steep, 1e4, 0}, {"ellipse", ellipse, 1, TURNS},
    {"falling", falling, 1, TURNS},
};
enum { SOURCES = sizeof sources / sizeof *sources };

static facet_slope_table *table_of(const struct source *s)
{
    static double log_d[TURNS * NODES];
    facet_slope_table *table = NULL;
    for (size_t k = 0; k < (s->turns ? s->turns : 1) * NODES; k++) {
        double u = (double)(k % NODES) / (NODES - 1), r = u < 1 ? s->scale * u / (1 - u) : INFINITY;
        log_d[k] = s->log_d(r, s->turns ? (double)(k / NODES) / (double)s->turns : 0);
    }
    facet_status status = s->turns ? facet_slope_table_create_turned(s->scale, log_d, NODES,
                                                                     s->turns, NULL, &table)
                                   : facet_slope_table_create(s->scale, log_d, NODES, &table);
    CHECK_INT(status, FACET_OK);
    return table;
}

struct pairs {
    double v[6][PAIRS];
};

static facet_vec3_in in(const struct pairs *p, int first)
{
    return (facet_vec3_in){p->v[first], p->v[first + 1], p->v[first + 2]};
}

static facet_brdf *draw_surface(struct rng *rng, const facet_slope_table *table, bool ordinary,
                                struct pairs *p, facet_material *m)
{
    struct draw_domain domain = ordinary ? draw_ordinary : draw_everywhere;
    *m = (facet_material){.ndf = FACET_TABULATED, .table = table};
    draw_roughness(rng, &domain, &m->roughness);
    draw_fresnel(rng, (facet_fresnel_kind)(rng_uniform(rng) * FACET_FRESNEL_COUNT), &m->fresnel);
    m->masking = (facet_masking)(rng_uniform(rng) * FACET_MASKING_COUNT);
    if (m->masking <= FACET_SMITH_UNCORRELATED && rng_uniform(rng) < 0.2) m->shear = FACET_THESIS;
    for (int k = 0; k < PAIRS; k++) {
        double wi[3], wo[3];
        draw_pair(rng, &domain, m, wi, wo);
        for (int j = 0; j < 3; j++) p->v[j][k] = wi[j], p->v[3 + j][k] = wo[j];
    }
    facet_brdf *brdf = NULL;
    CHECK_INT(facet_brdf_create(m, &brdf), FACET_OK);
    return brdf;
}

/* Room for all that may be asked: every quantity, then the pdf of two samplers. */
enum { NDF_PDF = FACET_QUANTITY_COUNT, COSINE_PDF, ANSWERS };
static const facet_sampler samplers[] = {FACET_SAMPLER_NDF, FACET_SAMPLER_COSINE};

static void answer(const facet_brdf *brdf, facet_tier tier, const struct pairs *p,
                   double y[ANSWERS][PAIRS])
{
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) outputs.of[q][0] = y[q];
    CHECK_INT(facet_eval(brdf, tier, in(p, 0), in(p, 3), PAIRS, &outputs), FACET_OK);
    for (int s = 0; s < 2; s++)
        CHECK_INT(facet_pdf(brdf, tier, samplers[s], in(p, 0), in(p, 3), PAIRS, y[NDF_PDF + s]),
                  FACET_OK);
}

/* The same in arrays of floats. */
static void answer_floats(const facet_brdf *brdf, facet_tier tier, const struct pairs *p,
                          double y[ANSWERS][PAIRS])
{
    static float f[6][PAIRS], out[ANSWERS][PAIRS];
    facet_vec3_in_float wi = {f[0], f[1], f[2]}, wo = {f[3], f[4], f[5]};
    facet_outputs_float outputs;
    memset(&outputs, 0, sizeof outputs);
    for (int j = 0; j < 6; j++)
        for (int k = 0; k < PAIRS; k++) f[j][k] = (float)p->v[j][k];
    for (int q = 0; q < FACET_QUANTITY_COUNT; q++) outputs.of[q][0] = out[q];
    CHECK_INT(facet_eval_float(brdf, tier, wi, wo, PAIRS, &outputs), FACET_OK);
    for (int s = 0; s < 2; s++)
        CHECK_INT(facet_pdf_float(brdf, tier, samplers[s], wi, wo, PAIRS, out[NDF_PDF + s]),
                  FACET_OK);
    for (int q = 0; q < ANSWERS; q++)
        for (int k = 0; k < PAIRS; k++) y[q][k] = out[q][k];
}

static bool bound_of(const facet_brdf *brdf, facet_tier tier, bool floats, int q, double *bound)
{
    if (floats)
        return q < FACET_QUANTITY_COUNT
                   ? facet_bound_float(brdf, tier, (facet_quantity)q, 0, bound)
                   : facet_pdf_bound_float(brdf, tier, samplers[q - NDF_PDF], 0, bound);
    return q < FACET_QUANTITY_COUNT ? facet_bound(brdf, tier, (facet_quantity)q, 0, bound)
                                    : facet_pdf_bound(brdf, tier, samplers[q - NDF_PDF], 0, bound);
}

/* What the view of a pair adds to the bounds of both tiers. */
static double depth_error(const facet_brdf *brdf, facet_tier tier, int q, const struct pairs *p,
                          int k)
{
    facet_vec3_in wi = {&p->v[0][k], &p->v[1][k], &p->v[2][k]},
                  wo = {&p->v[3][k], &p->v[4][k], &p->v[5][k]};
    facet_quantity quantity = q < FACET_QUANTITY_COUNT ? (facet_quantity)q : FACET_PDF;
    facet_sampler sampler = q < NDF_PDF ? FACET_SAMPLER_AUTO : samplers[q - NDF_PDF];
    facet_depth depth = {0, 0, 0};
    facet_depth_survey(brdf, sampler, wi, wo, 1, &depth);
    return facet_depth_error(brdf, tier, quantity, sampler, &depth) +
           facet_depth_error(brdf, FACET_PRECISE, quantity, sampler, &depth);
}

static size_t compare(const facet_brdf *brdf, const struct source *source, const facet_material *m,
                      facet_tier tier, const struct pairs *p, bool floats)
{
    static double y[ANSWERS][PAIRS], x[ANSWERS][PAIRS];
    size_t checked = 0;
    double condition;
    floats ? answer_floats(brdf, tier, p, y) : answer(brdf, tier, p, y);
    answer(brdf, FACET_PRECISE, p, x);
    CHECK_INT(facet_condition(brdf, in(p, 0), in(p, 3), PAIRS, &condition), FACET_OK);
    for (int q = 0; q < ANSWERS; q++) {
        double own, least;
        for (int k = 0; k < PAIRS; k++) CHECK(y[q][k] >= 0 && y[q][k] <= DBL_MAX);
        if (!bound_of(brdf, tier, floats, q, &own) ||
            !bound_of(brdf, FACET_PRECISE, false, q, &least))
            continue;
        double all = (own + least) *
                     (q == FACET_FR || q == FACET_FR_COS || q == FACET_G ? condition : 1);
        for (int k = 0; k < PAIRS; k++) {
            double bound = all + depth_error(brdf, tier, q, p, k);
            if (!(bound < 0.5)) continue;
            if (x[q][k] > (tier < FACET_EXACT32 || floats ? FLT_MAX : DBL_MAX) / 2)
                continue; /* saturates */
            double error = fabs(y[q][k] - x[q][k]) / fmax(fabs(x[q][k]), FACET_FLOOR);
            char name[48];
            snprintf(name, sizeof name, "%s/%s", source->name, facet_tier_name(tier));
            if (bound > 0) check_note(name, error / bound);
            checked++;
            if (!(error <= bound))
                check_fail(
                    __FILE__, __LINE__,
                    "%s %s answer %d is %.17g, not %.17g: error %.3g, bound %.3g\n    %s\n    "
                    "wi {%.17g, %.17g, %.17g} wo {%.17g, %.17g, %.17g}",
                    source->name, facet_tier_name(tier), q, y[q][k], x[q][k], error, bound,
                    draw_text(m), p->v[0][k], p->v[1][k], p->v[2][k], p->v[3][k], p->v[4][k],
                    p->v[5][k]);
        }
    }
    return checked;
}

TEST(bounds_of_tables_hold_in_every_tier)
{
    struct rng rng;
    rng_seed(&rng, 71);
    for (int s = 0; s < SOURCES; s++) {
        facet_slope_table *table = table_of(&sources[s]);
        size_t rounds = draw_count(150), checked[FACET_TIER_COUNT] = {0};
        for (size_t n = 0; n < rounds && table; n++) {
            struct pairs p;
            facet_material m;
            facet_brdf *brdf = draw_surface(&rng, table, n % 3, &p, &m);
            bool floats = n & 1;
            for (int j = 0; j < 6 && floats; j++)
                for (int k = 0; k < PAIRS; k++) p.v[j][k] = (float)p.v[j][k];
            for (int t = FACET_DRAFT; t < FACET_PRECISE && brdf; t++)
                checked[t] += compare(brdf, &sources[s], &m, (facet_tier)t, &p, floats);
            facet_brdf_destroy(brdf);
        }
        for (int t = FACET_DRAFT; t < FACET_PRECISE; t++)
            if (checked[t] < 60 * rounds && (t == FACET_EXACT32 || fabs(log(sources[s].scale)) < 4))
                check_fail(__FILE__, __LINE__, "%s: %zu numbers in %zu rounds", sources[s].name,
                           checked[t], rounds);
        facet_slope_table_destroy(table);
    }
}

/* Components handed over with an absolute error, as test_bounds.c has it. */
TEST(bounds_of_tables_hold_for_computed_directions)
{
    static double y[ANSWERS][PAIRS], x[ANSWERS][PAIRS];
    struct rng rng;
    size_t checked = 0, rounds = draw_count(40);
    rng_seed(&rng, 74);
    for (int s = 0; s < SOURCES; s++) {
        facet_slope_table *table = table_of(&sources[s]);
        for (size_t n = 0; n < rounds && table; n++) {
            struct pairs p, rounded;
            facet_material m;
            facet_brdf *brdf = draw_surface(&rng, table, true, &p, &m);
            facet_tier tier = (facet_tier)(n % FACET_TIER_COUNT);
            double error = rng_log(&rng, 1e-16, 1e-6);
            for (int k = 0; k < 6 * PAIRS; k++)
                rounded.v[k / PAIRS][k % PAIRS] = p.v[k / PAIRS][k % PAIRS] +
                                                  error * (2 * rng_uniform(&rng) - 1);
            answer(brdf, FACET_PRECISE, &p, x);
            answer(brdf, tier, &rounded, y);
            for (int k = 0; k < PAIRS && m.shear != FACET_THESIS; k++) {
                const double(*v)[PAIRS] = (const double(*)[PAIRS])rounded.v;
                double close = facet_closeness(brdf, (facet_vec3_in){&v[0][k], &v[1][k], &v[2][k]},
                                               (facet_vec3_in){&v[3][k], &v[4][k], &v[5][k]}, 1,
                                               false);
                for (int q = 0; q < FACET_QUANTITY_COUNT; q++) {
                    double bound, off = fabs(y[q][k] - x[q][k]) / fmax(x[q][k], FACET_FLOOR);
                    if (!facet_bound(brdf, tier, (facet_quantity)q, error * close, &bound))
                        continue;
                    bound += depth_error(brdf, tier, q, &p, k);
                    if (bound > 0.1 || x[q][k] > FLT_MAX / 2) continue;
                    checked++;
                    if (bound > 0) check_note(sources[s].name, off / bound);
                    if (!(off <= 2 * bound)) /* precise has its own */
                        check_fail(__FILE__, __LINE__, "%s %s %d: %.17g, not %.17g, bound %.3g: %s",
                                   sources[s].name, facet_tier_name(tier), q, y[q][k], x[q][k],
                                   bound, draw_text(&m));
                }
            }
            facet_brdf_destroy(brdf);
        }
        facet_slope_table_destroy(table);
    }
    CHECK(checked > 50 * rounds * SOURCES);
}

/* Weight times pdf is fr cos of the direction handed out, which is rounded to doubles. */
static void check_samples(const facet_brdf *brdf, const char *name, facet_tier tier,
                          facet_sampler sampler, const struct pairs *p, const double u[2][PAIRS])
{
    static double wi[3][PAIRS], pdf[PAIRS], weight[PAIRS], x[PAIRS];
    facet_samples out = {.wi = {wi[0], wi[1], wi[2]}, .pdf = pdf, .weight = {weight}};
    facet_outputs outputs = {.of = {[FACET_FR_COS] = {x}}};
    CHECK_INT(facet_sample(brdf, tier, sampler, in(p, 3), u[0], u[1], PAIRS, &out), FACET_OK);
    CHECK_INT(facet_eval(brdf, FACET_PRECISE, (facet_vec3_in){wi[0], wi[1], wi[2]}, in(p, 3), PAIRS,
                         &outputs),
              FACET_OK);
    for (int k = 0; k < PAIRS; k++) {
        double y = weight[k] * pdf[k], error = fabs(y - x[k]) / fmax(x[k], FACET_FLOOR), bound;
        facet_vec3_in i = {&wi[0][k], &wi[1][k], &wi[2][k]},
                      o = {&p->v[3][k], &p->v[4][k], &p->v[5][k]};
        facet_depth depth = {0, 0, 0};
        double close = facet_closeness(brdf, i, o, 1, false);
        if (!facet_sample_bound(brdf, tier, sampler, close * 0x1p-52, &bound)) continue;
        facet_depth_survey(brdf, sampler, o, o, 1, &depth);
        bound += facet_sample_depth_error(brdf, tier, sampler, &depth);
        if (!(bound < 0.5) || x[k] > FLT_MAX / 2 || !(pdf[k] > 1e-30)) continue;
        check_note(facet_tier_name(tier), error / bound);
        if (!(error <= 2 * bound))
            check_fail(__FILE__, __LINE__, "%s %s %s: %.17g, not %.17g, bound %.3g", name,
                       facet_tier_name(tier), facet_sampler_name(sampler), y, x[k], bound);
    }
}

TEST(samples_of_every_tier_weigh_what_eval_answers)
{
    static const facet_sampler all[] = {FACET_SAMPLER_TABLE, FACET_SAMPLER_NDF,
                                        FACET_SAMPLER_COSINE};
    struct rng rng;
    rng_seed(&rng, 73);
    for (int s = 0; s < SOURCES; s++) {
        if (fabs(log(sources[s].scale)) > 4)
            continue; /* no table to sample: all in a cell or none */
        facet_slope_table *table = table_of(&sources[s]);
        for (size_t n = draw_count(12); n-- && table;) {
            struct pairs p;
            double u[2][PAIRS];
            facet_material m;
            facet_brdf *brdf = draw_surface(&rng, table, true, &p, &m);
            for (int k = 0; k < PAIRS; k++)
                u[0][k] = rng_uniform(&rng), u[1][k] = rng_uniform(&rng);
            for (int t = 0; t < FACET_TIER_COUNT && brdf && m.shear != FACET_THESIS; t++)
                for (int j = 0; j < 3; j++)
                    check_samples(brdf, sources[s].name, (facet_tier)t, all[j], &p, u);
            facet_brdf_destroy(brdf);
        }
        facet_slope_table_destroy(table);
    }
}

/* Of H as a radial table says it (kernels.h), on a central surface. */
static long double exact_d(const facet_slope_table *table, double alpha, const long double h[3])
{
    const struct kernel_cubic f = table->view.log_q;
    long double b = table->view.slope_scale, flat2 = h[0] * h[0] + h[1] * h[1];
    long double r = sqrtl(flat2) / alpha, hh = flat2 + h[2] * h[2],
                x = r / (b * h[2] + r) * f.cells;
    size_t i = x < f.cells ? (size_t)x : f.cells - 1;
    const double *c = f.c + 4 * i;
    long double t = x - i, near = b / (b * h[2] + r), n2 = near * near;
    return hh * hh * n2 * n2 * expl(((c[3] * t + c[2]) * t + c[1]) * t + c[0]) /
           ((long double)alpha * alpha);
}

TEST(precise_is_the_table)
{
    struct rng rng;
    rng_seed(&rng, 72);
    for (int s = 0; s < SOURCES && !sources[s].turns; s++) {
        facet_slope_table *table = table_of(&sources[s]);
        for (size_t n = draw_count(60); n-- && table;) {
            static double y[PAIRS];
            double bound;
            struct pairs p;
            facet_material m;
            facet_outputs outputs;
            facet_brdf *drawn = draw_surface(&rng, table, true, &p, &m), *brdf = NULL;
            facet_brdf_destroy(drawn);
            m.roughness = (facet_roughness){.alpha_x = m.roughness.alpha_x,
                                            .alpha_y = m.roughness.alpha_x};
            CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
            memset(&outputs, 0, sizeof outputs);
            outputs.of[FACET_D][0] = y;
            CHECK(facet_bound(brdf, FACET_PRECISE, FACET_D, 0, &bound));
            CHECK_INT(facet_eval(brdf, FACET_PRECISE, in(&p, 0), in(&p, 3), PAIRS, &outputs),
                      FACET_OK);
            for (int k = 0; k < PAIRS; k++) {
                long double h[3];
                for (int j = 0; j < 3; j++) h[j] = (long double)p.v[j][k] + p.v[3 + j][k];
                long double size = sqrtl(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
                if (!(size > 1e-6L)) continue;
                for (int j = 0; j < 3; j++) h[j] /= size;
                long double x = h[2] > 0 ? exact_d(table, m.roughness.alpha_x, h) : 0;
                double error = (double)(fabsl(y[k] - x) / fmaxl(x, FACET_FLOOR));
                check_note(sources[s].name, error / bound);
                if (!(error <= bound))
                    check_fail(__FILE__, __LINE__, "%s: D is %.17g, not %.17Lg, bound %.3g",
                               sources[s].name, y[k], x, bound);
            }
            facet_brdf_destroy(brdf);
        }
        facet_slope_table_destroy(table);
    }
}
