/* speed.h - what an evaluation costs on this machine, now. */
#ifndef API_SPEED_H
#define API_SPEED_H

#include "arena.h"
#include "facet_transmission.h"

/*
 * Nanoseconds per number of a quantity, one channel, the best of a few short batches; with a bsdf (else
 * NULL) of that, every other wi below.  False: out of memory.
 */
bool api_measure_eval(const facet_brdf *brdf, const facet_bsdf *bsdf, facet_tier tier,
                      facet_quantity quantity, struct arena *arena, double *ns);

#endif
