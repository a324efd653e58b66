/* measured.h - measurements written by the tools in shared data. */
#ifndef MEASURED_H
#define MEASURED_H

#include <stddef.h>

/*
 * The MERL file of a material, by ../shared/tools/make_merl.c (compiled once per
 * program); to be freed.  NULL where tool, data or compiler are absent.
 */
unsigned char *measured_merl(const char *material, size_t *size);

#endif
