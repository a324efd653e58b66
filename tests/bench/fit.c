/*
 * bench/fit: milliseconds of processor time of the parts of a fit, the best of several runs:
 * extraction of a slope distribution at 90 and 360 nodes, isotropic; of an anisotropic one on
 * grids of 45 x 90 and 90 x 90; whole anisotropic fits; a slope table.  `make bench-fit`.
 */
#include "facet_fit.h"
#include "facet_table.h"
#include "fit_backscatter.h"
#include "fit_turn.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static facet_status evaluate(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                             double *const fr[3], bool *valid)
{
    facet_outputs outputs = {0};
    for (size_t c = 0; c < 3; c++) outputs.of[FACET_FR][c] = fr[c];
    for (size_t i = 0; i < n; i++) valid[i] = true;
    return facet_eval(user, FACET_PRECISE, wi, wo, n, &outputs);
}

struct job {
    facet_fit_source source;
    size_t radii, turns;
    facet_slope_table *table;
};

static facet_status extract(struct job *job)
{
    struct fit_density density;
    double median, *log_d = malloc((job->radii + 1) * sizeof *log_d);
    facet_status status = facet_fit_median_slope(&job->source, &median);
    if (!status)
        status = facet_fit_density_create(&job->source, FACET_SMITH, FACET_FIT_CORRELATED,
                                          1.5 * median, job->radii, &density);
    if (!status && log_d)
        status = facet_fit_density_table(&job->source, FACET_SMITH, FACET_FIT_CORRELATED, &density,
                                         job->radii + 1, log_d);
    if (!status && job->turns)
        status = facet_slope_table_create(1.5 * median, log_d, job->radii + 1, &job->table);
    facet_fit_density_clear(&density);
    free(log_d);
    return status;
}

static facet_status turn(struct job *job)
{
    struct fit_turn found;
    double median;
    facet_status status = facet_fit_median_slope(&job->source, &median);
    if (!status)
        status = facet_fit_turn_create(&job->source, FACET_SMITH, FACET_FIT_CORRELATED,
                                       1.5 * median, job->radii, job->turns, NULL, &found);
    if (!status) facet_fit_turn_clear(&found);
    return status;
}

static facet_status whole(struct job *job)
{
    facet_fit fit;
    facet_fit_options options = {FACET_SMITH, 90, FACET_FIT_ALL, true, true, true};
    facet_status status = facet_fit_create(&job->source, &options, NULL, &fit);
    if (!status) facet_fit_clear(&fit);
    return status;
}

static void time_of(const char *name, facet_status (*run)(struct job *), struct job *job,
                    double wanted)
{
    enum { RUNS = 5 };
    double best = INFINITY;
    facet_status status = FACET_OK;
    for (int i = 0; i < RUNS && !status; i++) {
        double start = ms();
        status = run(job);
        best = fmin(best, ms() - start);
        facet_slope_table_destroy(job->table);
        job->table = NULL;
    }
    if (status)
        printf("%-52s %s\n", name, facet_status_text(status));
    else if (wanted > 0)
        printf("%-52s %8.2f ms, asked %g\n", name, best, wanted);
    else
        printf("%-52s %8.2f ms\n", name, best);
}

int main(void)
{
    facet_material m = {
        .ndf = FACET_GGX,
        .roughness = {.alpha_x = .2, .alpha_y = .2},
        .fresnel = {.kind = FACET_FRESNEL_SCHLICK, .channels = 3, .f0 = {.9, .6, .1}}};
    facet_brdf *round = NULL, *flat = NULL;
    if (facet_brdf_create(&m, &round)) return 1;
    m.roughness = (facet_roughness){.alpha_x = .05, .alpha_y = .5, .rho = .3};
    if (facet_brdf_create(&m, &flat)) return 1;
    struct job iso = {.source = {evaluate, round, INFINITY, false, NULL}, .radii = 90};
    time_of("extraction, 90 nodes", extract, &iso, 2);
    iso.radii = 360;
    time_of("extraction, 360 nodes", extract, &iso, 10);
    iso.turns = 1; /* and the table made of it */
    time_of("extraction and its table, 360 nodes", extract, &iso, 0);
    struct job aniso = {.source = {evaluate, flat, INFINITY, true, NULL}, .radii = 45, .turns = 90};
    time_of("anisotropic extraction, 45 x 90", turn, &aniso, 500);
    aniso.radii = 90;
    time_of("anisotropic extraction, 90 x 90", turn, &aniso, 1500);
    time_of("every candidate of an anisotropic source", whole, &aniso, 0);
    facet_brdf_destroy(round);
    facet_brdf_destroy(flat);
    return 0;
}
