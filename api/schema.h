/* schema.h - field tables written as JSON Schema (2020-12), for the OpenAPI document. */
#ifndef API_SCHEMA_H
#define API_SCHEMA_H

#include "field.h"

/* The schema of an object with these members. */
void api_schema_object(struct text *text, const struct field *fields);
/* The schema of one member. */
void api_schema_field(struct text *text, const struct field *field);
/* The tables that many others contain, as members of #/components/schemas. */
void api_schema_shared(struct text *text);

#endif
