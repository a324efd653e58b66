/*
 * slope_sheet.h - bicubic sheets through the nodes of a table over (u, azimuth) (internal).
 */
#ifndef FACET_SLOPE_SHEET_H
#define FACET_SLOPE_SHEET_H

#include "facet.h"
#include "kernel/kernels.h"

/*
 * Rows in between: fine holds turns parts rows of n, of which every parts-th is one of y, the
 * others interpolated along the azimuth (slope_spline.h), whose unit they share.
 */
facet_status facet_slope_refine(const double *y, size_t n, size_t turns, size_t parts,
                                double *fine);

/*
 * A sheet of (n - 1) parts cells by turns, continuous with its derivatives where nothing breaks
 * (slope_spline.h, both ways): y holds turns rows of n logarithms, first[j] the derivative, per
 * cell, at the start of row j.  c holds 16 numbers of each patch.
 */
facet_status facet_slope_sheet(const double *y, size_t n, size_t turns, size_t parts,
                               const double *first, double *c);

static inline double slope_patch_at(const double c[16], double t, double s)
{
    double sum = 0;
    for (size_t m = 16; m > 0; m -= 4)
        sum = sum * s + (((c[m - 1] * t + c[m - 2]) * t + c[m - 3]) * t + c[m - 4]);
    return sum;
}

/* As the kernels evaluate it; azimuth in units of pi, in [0, 1]. */
static inline double slope_sheet_at(struct kernel_sheet f, double u, double azimuth)
{
    double x = u * (double)f.cells, y = azimuth * (double)f.turns;
    size_t i = x < (double)f.cells ? (size_t)x : f.cells - 1,
           j = y < (double)f.turns ? (size_t)y : f.turns - 1;
    return slope_patch_at(f.c + 16 * (f.cells * j + i), x - (double)i, y - (double)j);
}

/* Cell i along one azimuth: a cubic in t. */
static inline void slope_sheet_line(struct kernel_sheet f, size_t i, double azimuth, double line[4])
{
    double y = azimuth * (double)f.turns;
    size_t j = y < (double)f.turns ? (size_t)y : f.turns - 1;
    const double *c = f.c + 16 * (f.cells * j + i);
    double s = y - (double)j;
    for (size_t m = 0; m < 4; m++) line[m] = c[m] + s * (c[4 + m] + s * (c[8 + m] + s * c[12 + m]));
}

static inline double slope_cubic_at(const double c[4], double t)
{
    return c[0] + t * (c[1] + t * (c[2] + t * c[3]));
}

/* log_psi, as the kernels evaluate it. */
static inline double slope_log_psi_at(const struct kernel_table *table, double u, double azimuth)
{
    double f = slope_sheet_at(table->turned_psi, u, azimuth);
    return table->psi_top - KERNEL_PSI_UNIT / (f > KERNEL_PSI_LEAST ? f : KERNEL_PSI_LEAST);
}

#endif
