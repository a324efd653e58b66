/* json.h - strict JSON in, within bounds of depth and memory. */
#ifndef API_JSON_H
#define API_JSON_H

#include "problem.h"

#include <jansson.h>

/* Once, before anything of jansson is used. */
void api_json_open(void);

/*
 * NULL and a problem (400 with line and column, 413, 503) unless the bytes are
 * one JSON value without duplicate members, not deeper and not larger in memory
 * than limits.def allows.  Every number becomes a JSON real.
 * Free with json_decref.
 */
json_t *api_json_parse(const void *bytes, size_t size, struct problem *problem);

/*
 * Whether the system refused memory to jansson in this thread since the last
 * api_json_parse or the last call of this.
 */
bool api_json_exhausted(void);

#endif
