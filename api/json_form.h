/*
 * json_form.h - a multipart/form-data request as one document: the part `request` is its JSON, every
 * other part an array of numbers under the part's name, as .npy or as raw little-endian numbers.
 */
#ifndef API_JSON_FORM_H
#define API_JSON_FORM_H

#include "json.h"

/*
 * As api_json_read.  Raw numbers are float32, or float64 where the JSON says "dtype":"float64".
 * The arrays refer to the body.
 */
bool api_json_form(const char *content_type, const void *body, size_t size, struct arena *arena,
                   struct problem *problem, struct document *document);

#endif
