/* json.h - strict JSON in, within bounds of depth and memory. */
#ifndef API_JSON_H
#define API_JSON_H

#include "arena.h"
#include "array.h"
#include "problem.h"

/* Once, before anything of jansson is used. */
void api_json_open(void);

/*
 * False and a problem (400 with line and column, 413, 503) unless the bytes are one JSON value
 * without duplicate members, not deeper and not larger in memory than limits.def allows.  Arrays of
 * numbers become entries of document->arrays, which live in the arena; document starts zeroed.
 * Every other number becomes a JSON real.  The arena remembers the document.  Free document->root with json_decref.
 */
bool api_json_read(const void *bytes, size_t size, struct arena *arena, struct problem *problem,
                   struct document *document);

/*
 * Whether the system refused memory to jansson in this thread since the last
 * api_json_read or the last call of this.
 */
bool api_json_exhausted(void);

#endif
