/* nearest.h - the names that a wrong one may have meant. */
#ifndef API_NEAREST_H
#define API_NEAREST_H

#include <stddef.h>

enum { NEAREST_MAX = 64 }; /* names that are looked at; no table of ours has as many */

/* "b, a, c": the nearest to `name` first (in their order where equally near), "..." where the room
 * ends. */
void api_join_nearest(const char *name, const char *const *names, size_t count, char *out,
                      size_t room);

#endif
