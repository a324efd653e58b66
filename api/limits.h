/* limits.h - the limits of limits.def as constants LIMIT_<id>. */
#ifndef API_LIMITS_H
#define API_LIMITS_H

enum {
#define LIMIT(id, name, value, doc) LIMIT_##id = (value),
#include "limits.def"
#undef LIMIT
};

#endif
