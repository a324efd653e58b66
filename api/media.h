/* media.h - Content-Type and Accept (RFC 9110 sections 8.3 and 12.5.1). */
#ifndef API_MEDIA_H
#define API_MEDIA_H

#include <stdbool.h>

/* Whether a Content-Type, parameters aside, names this type. */
bool api_media_is(const char *content_type, const char *type);
/* Quality 0 .. 1 the client gives a type; 1 for everything without an Accept header. */
double api_media_quality(const char *accept, const char *type);

#endif
