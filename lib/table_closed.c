#include "table_closed.h"

#include "slope_table.h"

#include <float.h>
#include <math.h>
#include <stdatomic.h>

/*
 * So many nodes of slopes r = scale u/(1 - u) keep the density within facet_table_density_error and the CDF within 1e-8
 * (tests/property/test_table_sample.c): Beckmann's out to where a double holds next to nothing of it.
 */
enum { NODES = 1025 };
static const double scales[] = {[FACET_GGX] = 1, [FACET_BECKMANN] = 8};

static facet_slope_table *make(facet_ndf ndf)
{
    double log_d[NODES];
    facet_slope_table *table = NULL;
    for (int k = 0; k < NODES; k++) {
        double u = (double)k / (NODES - 1), r = scales[ndf] * u / (1 - u);
        /* D = P (1 + r^2)^2, up to a factor: GGX is uniform */
        log_d[k] = ndf == FACET_GGX ? 0 : k == NODES - 1 ? -INFINITY : 2 * log1p(r * r) - r * r;
    }
    facet_slope_table_create(scales[ndf], log_d, NODES, &table);
    return table;
}

const facet_slope_table *facet_table_of(facet_ndf ndf)
{
    static _Atomic(facet_slope_table *) kept[FACET_TABULATED];
    facet_slope_table *table = atomic_load(&kept[ndf]), *none = NULL;
    if (table) return table;
    table = make(ndf);
    if (!table || atomic_compare_exchange_strong(&kept[ndf], &none, table)) return table;
    facet_slope_table_destroy(table); /* another thread was first */
    return none;
}

double facet_table_density_error(facet_ndf ndf, bool far)
{
    return ndf == FACET_GGX ? 0 : far ? 1e-7 : 1e-8; /* GGX's is rounding */
}

const facet_slope_table *facet_table_behind(const facet_brdf *b, facet_sampler sampler)
{
    if (b->material.ndf == FACET_TABULATED) return b->material.table;
    return sampler == FACET_SAMPLER_TABLE ? facet_table_of(b->material.ndf) : NULL;
}

facet_status facet_sampler_prepare(facet_sampler sampler, facet_ndf ndf)
{
    bool closed = (unsigned)ndf < FACET_TABULATED;
    return sampler != FACET_SAMPLER_TABLE || !closed || facet_table_of(ndf) ? FACET_OK
                                                                            : FACET_NO_MEMORY;
}

bool facet_table_twin(const facet_brdf *brdf, facet_brdf *twin)
{
    const facet_slope_table *table = facet_table_of(brdf->material.ndf);
    *twin = *brdf;
    if (!table) return false;
    twin->material.ndf = FACET_TABULATED;
    twin->material.table = table;
    twin->surface.table = &table->view;
    return true;
}

static void weigh_block(const struct batch *batch, const facet_brdf *twin, size_t start, size_t n)
{
    double pdf[BLOCK], fr_cos[3][BLOCK];
    /* In double whatever the tier, so that floats are converted and not written where doubles are read. */
    struct batch density = {.brdf = twin, .tier = FACET_PRECISE},
                 surface = {.brdf = batch->brdf, .tier = FACET_PRECISE};
    for (int j = 0; j < 3; j++) {
        density.wi[j] = surface.wi[j] = facet_array_at(batch->wi[j], start);
        density.wo[j] = surface.wo[j] = facet_array_at(batch->wo[j], start);
        if (batch->out[KERNEL_WEIGHT][j].data)
            surface.out[KERNEL_FR_COS][j] = facet_doubles(fr_cos[j]);
    }
    density.out[KERNEL_PDF][0] = facet_doubles(pdf);
    facet_batch_run(&density, n);
    for (size_t k = 0; batch->out[KERNEL_PDF][0].data && k < n; k++)
        facet_array_put(batch->out[KERNEL_PDF][0], start + k, pdf[k]);
    if (!batch->out[KERNEL_WEIGHT][0].data) return;
    facet_batch_run(&surface, n);
    for (int c = 0; c < 3 && batch->out[KERNEL_WEIGHT][c].data; c++)
        for (size_t k = 0; k < n; k++)
            facet_array_put(batch->out[KERNEL_WEIGHT][c], start + k,
                            pdf[k] > 0 ? fmin(fr_cos[c][k] / pdf[k], DBL_MAX) : 0);
}

void facet_table_weigh(const struct batch *batch, size_t n)
{
    facet_brdf twin;
    if (!facet_table_twin(batch->brdf, &twin))
        return; /* it was there when the samples were drawn */
    for (size_t start = 0; start < n; start += BLOCK)
        weigh_block(batch, &twin, start, n - start < BLOCK ? n - start : BLOCK);
}
