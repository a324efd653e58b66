/* limits.h - the limits of limits.def, as constants LIMIT_<id> and as a table. */
#ifndef API_LIMITS_H
#define API_LIMITS_H

#include "api.h"

enum {
#define LIMIT(id, name, value, doc) LIMIT_##id = (value),
#include "limits.def"
#undef LIMIT
};

/* The API's and its caller's. */
size_t api_limit_count(void);
void api_limits(struct api_limit *limits);

#endif
