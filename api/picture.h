/* picture.h - source against fit, as SVG. */
#ifndef API_PICTURE_H
#define API_PICTURE_H

#include "endpoint.h"
#include "facet_fit.h"

#define PICTURE_TYPE "image/svg+xml"

/* The answer: fr cos theta_i in the plane of incidence for three wo; candidate NULL: source alone. */
bool api_picture(struct call *call, const facet_fit_source *source, const facet_fit *fit,
                 const facet_fit_candidate *candidate);

#endif
