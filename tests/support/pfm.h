/* pfm.h - portable float maps, the format of the measured microsurfaces in shared data. */
#ifndef PFM_H
#define PFM_H

#include <stddef.h>

/* Rows from the top, to be freed; NULL if the file is absent or not a little-endian grey PFM. */
float *pfm_read(const char *path, size_t *width, size_t *height);

/* The microsurfaces whose rms slope (forward differences over (n-1)^2) another project published. */
struct microsurface {
    const char *path; /* for check_data */
    double texel;     /* metres */
    double rms_slope;
};
extern const struct microsurface microsurfaces[3];

#endif
