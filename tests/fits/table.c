/*
 * table.c - fits every measured material of shared data and prints a Markdown table:
 * what auto chooses at tolerance 0.1, against GGX alone and the thesis's tabulated fit.
 */
#include "bsdf.h"
#include "check.h"
#include "facet_fit.h"
#include "fit_backscatter.h"
#include "fit_pairs.h"
#include "measured.h"
#include "measurement.h"
#include "sources.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define PI 3.14159265358979323846
#define TOLERANCE 0.1

static double ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/* ---- The thesis's fit: Dupuy 2015, algorithms 1 and 2, its iteration converged ---------------- */

enum { DIFFERENCES = 90, HALVES = 24, AZIMUTHS = 4 };

static bool error_pairs(const facet_fit_source *source, struct fit_pairs *pairs)
{
    double theta_h[45], theta_d[40];
    struct fit_grid grid = {theta_h, theta_d, 45, 40, 12, 1, NULL, NULL};
    for (int i = 0; i < 45; i++) theta_h[i] = PI / 2 * pow((i + .5) / 45, 2);
    for (int i = 0; i < 40; i++) theta_d[i] = PI / 2 * (i + .5) / 40;
    return facet_fit_pairs_create(source, &grid, pairs) == FACET_OK;
}

/* F(theta_d): the mean of f_r over the surface with F = 1, where that is not tiny. */
static void mean_fresnel(const struct fit_pairs *p, double values[3][DIFFERENCES + 1])
{
    for (size_t c = 0; c < 3; c++) {
        for (size_t g = 0; g < DIFFERENCES; g++) {
            double sum = 0, count = 0, peak = 0;
            for (size_t i = 0; i < p->count; i++)
                if (p->group[i] == g) peak = fmax(peak, p->model[i]);
            for (size_t i = 0; i < p->count; i++) {
                if (p->group[i] != g || !(p->model[i] > 1e-4 * peak)) continue;
                sum += p->fr_cos[c][i] / p->model[i];
                count++;
            }
            values[c][DIFFERENCES - g] = count > 0 ? fmin(sum / count, 1e6) : 0;
        }
        values[c][0] = values[c][1];
    }
}

static double thesis_rms(const facet_fit_source *source)
{
    struct fit_density density = {0};
    struct fit_pairs pairs = {0}, errors = {0}, none = {0};
    double median, log_d[91], theta_h[HALVES], theta_d[DIFFERENCES], cosine[DIFFERENCES + 1];
    double values[3][DIFFERENCES + 1], rms = NAN;
    facet_slope_table *table = NULL;
    if (facet_fit_median_slope(source, &median) != FACET_OK) return NAN;
    double scale = 1.5 * median;
    for (int i = 0; i < HALVES; i++) theta_h[i] = PI / 2 * pow((i + .5) / HALVES, 2);
    for (int i = 0; i < DIFFERENCES; i++) theta_d[i] = PI / 2 * i / DIFFERENCES;
    struct fit_grid grid = {theta_h, theta_d, HALVES, DIFFERENCES, AZIMUTHS, 1, NULL, NULL};
    if (facet_fit_density_create(source, FACET_SMITH, FACET_FIT_MASKING_ONLY, scale, 90,
                                 &density) == FACET_OK &&
        facet_fit_density_table(source, FACET_SMITH, FACET_FIT_MASKING_ONLY, &density, 91, log_d) ==
            FACET_OK &&
        facet_slope_table_create(scale, log_d, 91, &table) == FACET_OK &&
        facet_fit_pairs_create(source, &grid, &pairs) == FACET_OK && error_pairs(source, &errors)) {
        facet_fit_candidate c = {
            .material = {.ndf = FACET_TABULATED,
                         .roughness = {.alpha_x = 1, .alpha_y = 1},
                         .table = table,
                         .fresnel = {.kind = FACET_FRESNEL_IDEAL, .channels = 1}}};
        facet_fit_pairs_model(&pairs, &c.material, pairs.model);
        mean_fresnel(&pairs, values);
        for (int g = 0; g <= DIFFERENCES; g++)
            cosine[g] = cos(PI / 2 * (DIFFERENCES - g) / DIFFERENCES);
        cosine[0] = 0;
        c.material.fresnel = (facet_fresnel){.kind = FACET_FRESNEL_TABLE,
                                             .channels = 3,
                                             .count = DIFFERENCES + 1,
                                             .cos_theta_d = cosine,
                                             .values = {values[0], values[1], values[2]}};
        if (facet_fit_error_of(&errors, &none, &c) == FACET_OK) rms = c.error.rms_log;
    }
    facet_slope_table_destroy(table);
    facet_fit_density_clear(&density);
    facet_fit_pairs_clear(&pairs);
    facet_fit_pairs_clear(&errors);
    return rms;
}

/* ---- Rows ------------------------------------------------------------------------------------------ */

struct tally {
    int rows, beat_both, met, refused, bad;
    double slowest;
};

static const char *name_of(const facet_fit_candidate *c)
{
    static char text[64];
    static const char *const ndf[] = {"ggx", "beckmann", "tabulated"};
    snprintf(text, sizeof text, "%s%s%s", ndf[c->material.ndf],
             c->material.fresnel.kind == FACET_FRESNEL_TABLE ? " + F table" : "",
             c->has_diffuse ? " + diffuse" : "");
    return text;
}

static void row(const char *name, const facet_fit_source *source, struct tally *tally)
{
    facet_fit_options options = {FACET_SMITH, 90, FACET_FIT_ALL, false, true, true};
    facet_fit fit;
    double start = ms(), ggx = INFINITY;
    facet_status status = facet_fit_create(source, &options, NULL, &fit);
    tally->slowest = fmax(tally->slowest, ms() - start);
    tally->rows++;
    if (status != FACET_OK) {
        printf("| %s | %s | | | | | |\n", name, facet_status_text(status));
        tally->bad++;
        return;
    }
    const facet_fit_candidate *chosen = NULL, *best = &fit.candidate[0];
    for (size_t i = 0; i < fit.count; i++) {
        const facet_fit_candidate *c = &fit.candidate[i];
        if (!chosen && c->error.rms_log <= TOLERANCE) chosen = c;
        if (c->error.rms_log < best->error.rms_log) best = c;
        if (c->material.ndf == FACET_GGX && c->material.fresnel.kind == FACET_FRESNEL_SCHLICK &&
            !c->has_diffuse)
            ggx = c->error.rms_log;
        if (!isfinite(c->error.rms_log) || !isfinite(c->error.backscatter_max)) tally->bad++;
    }
    tally->met += chosen != NULL;
    if (!chosen) chosen = best;
    double thesis = thesis_rms(source), rms = chosen->error.rms_log;
    tally->beat_both += rms < ggx && !(rms >= thesis);
    bool fits = rms <= FACET_FIT_RMS_MAX && !(fit.hot_spot > FACET_FIT_HOT_SPOT_MAX);
    tally->refused += !fits;
    printf("| %s | %s%s | %zu | %.3f | %.2f | %.3f | %.3f |\n", name,
           fits ? "" : "does not fit; closest: ", name_of(chosen), chosen->bytes, rms,
           chosen->error.backscatter_max, ggx, thesis);
    fflush(stdout);
    facet_fit_clear(&fit);
}

static void head(const char *title)
{
    printf(
        "\n## %s\n\n| material | chosen at 0.1 | bytes | rms_log | backscatter max | GGX alone | thesis's table |\n"
        "|---|---|---|---|---|---|---|\n",
        title);
}

static void foot(const struct tally *t)
{
    printf(
        "\n%d materials: auto at tolerance %g beats both GGX alone and the thesis's table on %d, meets the "
        "tolerance on %d and says \"fits\":false of %d; %d failed or gave no finite error.\n",
        t->rows, TOLERANCE, t->beat_both, t->met, t->refused, t->bad);
    fprintf(stderr, "slowest fit: %.0f ms\n", t->slowest);
}

/* ---- Sources ------------------------------------------------------------------------------------------ */

static void table_of_merl(void)
{
    struct tally tally = {0};
    const char *csv = check_data("brdf/nbrdf/merl_nbrdf.csv");
    FILE *file = csv ? fopen(csv, "r") : NULL;
    static char line[1 << 16];
    if (!file) return;
    head("MERL (networks of merl_nbrdf.csv as full .binary files)");
    while (fgets(line, sizeof line, file)) {
        char *comma = strchr(line, ',');
        size_t size;
        if (!comma) continue;
        *comma = 0;
        unsigned char *bytes = measured_merl(line, &size);
        struct arena arena;
        struct problem problem = {0};
        struct measurement m;
        api_arena_open(&arena, (size_t)1 << 28);
        if (bytes && api_measurement_open(bytes, size, -1, &arena, &problem, &m))
            row(line, &m.source, &tally);
        api_arena_close(&arena);
        free(bytes);
    }
    fclose(file);
    foot(&tally);
}

static void table_of_formulas(const char *path, bool is_sgd, const char *title)
{
    static struct formula formulas[128];
    struct tally tally = {0};
    size_t n = formulas_read(check_data(path), is_sgd, formulas, 128);
    head(title);
    for (size_t i = 0; i < n; i++) {
        facet_fit_source source = formula_source(&formulas[i]);
        row(formulas[i].name, &source, &tally);
    }
    foot(&tally);
}

static int is_bsdf(const struct dirent *entry)
{
    return strstr(entry->d_name, ".bsdf") != NULL;
}

static void table_of_rgl(void)
{
    struct tally tally = {0};
    const char *folder = check_data("brdf/rgl");
    struct dirent **list;
    char kept[2000];
    snprintf(kept, sizeof kept, "%s", folder ? folder : "");
    int n = folder ? scandir(kept, &list, is_bsdf, alphasort) : 0;
    head("RGL");
    for (int i = 0; i < n; i++) {
        char path[2400];
        size_t size;
        struct arena arena;
        struct problem problem = {0};
        struct measurement m;
        snprintf(path, sizeof path, "%s/%s", kept, list[i]->d_name);
        unsigned char *bytes = check_read_file(path, &size);
        api_arena_open(&arena, (size_t)1 << 28);
        if (bytes && api_measurement_open(bytes, size, -1, &arena, &problem, &m))
            row(list[i]->d_name, &m.source, &tally);
        api_arena_close(&arena);
        free(bytes);
        free(list[i]);
    }
    foot(&tally);
}

TEST(table)
{
    printf(
        "# Fits of measured materials\n\nMade by `make fit-table` of the measurements in shared data; rms_log as "
        "`/v1/fit` defines it.  \"GGX alone\": isotropic, Schlick, no diffuse part.  \"Thesis's table\": Dupuy 2015, "
        "algorithms 1 and 2 (masking only, its power iteration converged, 90 nodes, no diffuse part).\n");
    table_of_merl();
    table_of_formulas("brdf_params/sgd_params.csv", true, "SGD (Bagher et al. 2012)");
    table_of_formulas("brdf_params/abc_params.csv", false, "ABC (Low et al. 2012)");
    table_of_rgl();
}

/* The formulas against dj_brdf's numbers for them (reference/djbrdf_sgd_abc_golden.csv). */
TEST(formulas_as_djbrdf_has_them)
{
    static struct formula sgd[128], abc[128];
    size_t sgds = formulas_read(check_data("brdf_params/sgd_params.csv"), true, sgd, 128);
    size_t abcs = formulas_read(check_data("brdf_params/abc_params.csv"), false, abc, 128),
           rows = 0;
    const char *csv = check_data("reference/djbrdf_sgd_abc_golden.csv");
    FILE *file = csv ? fopen(csv, "r") : NULL;
    char line[300], model[8], name[64];
    double ti, to, po, rgb[3], worst = 0;
    if (!file) {
        check_skip("no shared data");
        return;
    }
    while (fgets(line, sizeof line, file)) {
        if (sscanf(line, "%7[^,],%63[^,],%lf,%lf,%lf,%lf,%lf,%lf", model, name, &ti, &to, &po, rgb,
                   rgb + 1, rgb + 2) != 8)
            continue;
        bool is_sgd = !strcmp(model, "sgd");
        const struct formula *f = is_sgd ? sgd : abc;
        size_t n = is_sgd ? sgds : abcs, k = 0;
        while (k < n && strcmp(f[k].name, name)) k++;
        if (k == n) continue;
        ti *= PI / 180, to *= PI / 180, po *= PI / 180;
        double i[3] = {sin(ti), 0, cos(ti)}, o[3] = {sin(to) * cos(po), sin(to) * sin(po), cos(to)};
        for (int c = 0; c < 3; c++)
            worst = fmax(worst,
                         fabs(formula_fr(&f[k], i, o, c) - rgb[c]) / fmax(fabs(rgb[c]), 1e-3));
        rows++;
    }
    fclose(file);
    CHECK(rows > 30000);
    CHECK(worst < 1e-3);
    check_note("rows", (double)rows);
    check_note("error", worst);
}
