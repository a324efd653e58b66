/* kernels_report.h - the part of the report that is about the service's own kernels. */
#ifndef REPORT_KERNELS_H
#define REPORT_KERNELS_H

#include <stdio.h>

/* Degrees of wo. */
enum { REPORT_THETAS = 4 };
extern const double report_theta[REPORT_THETAS];

double report_now_ns(void);
void report_kernels(FILE *md);

#endif
