/* media.h - Content-Type, Accept and Accept-Encoding (RFC 9110 sections 8.3, 12.5.1 and 12.5.3). */
#ifndef API_MEDIA_H
#define API_MEDIA_H

#include <stdbool.h>

/* Whether a Content-Type, parameters aside, names this type. */
bool api_media_is(const char *content_type, const char *type);
/* Quality 0 .. 1 the client gives a type, or a coding; 1 for everything without the header. */
double api_media_quality(const char *accept, const char *type);

#endif
