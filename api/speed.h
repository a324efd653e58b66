/* speed.h - what an evaluation costs on this machine, now. */
#ifndef API_SPEED_H
#define API_SPEED_H

#include "facet_transmission.h"

enum { SPEED_PAIRS = 2048, SPEED_ROOM = 7 * SPEED_PAIRS };

/*
 * Nanoseconds per number of a quantity, one channel, the best of a few short batches; with a bsdf (else
 * NULL) of that, every other wi below.  room: SPEED_ROOM doubles to work in.  False: out of memory.
 */
bool api_measure_eval(const facet_brdf *brdf, const facet_bsdf *bsdf, facet_tier tier,
                      facet_quantity quantity, double *room, double *ns);

#endif
