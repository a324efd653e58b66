/* sources.h - measured-like BRDFs in closed form: Bagher's SGD and Low's ABC, of their parameters. */
#ifndef FITS_SOURCES_H
#define FITS_SOURCES_H

#include "facet_fit.h"

enum { SGD_NUMBERS = 33, ABC_NUMBERS = 9, PARAMETERS_MAX = 33 };

struct formula {
    char name[64];
    bool is_sgd;
    double p[PARAMETERS_MAX];
};

/* The rows of sgd_params.csv or abc_params.csv; how many there were. */
size_t formulas_read(const char *path, bool is_sgd, struct formula *out, size_t room);

double formula_fr(const struct formula *formula, const double i[3], const double o[3], int channel);
facet_fit_source formula_source(const struct formula *formula);

#endif
