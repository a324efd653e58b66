/* limits.h - the limits of limits.def, as constants LIMIT_<id> and as a table. */
#ifndef API_LIMITS_H
#define API_LIMITS_H

#include <stdint.h>

enum {
#define LIMIT(id, name, value, doc) LIMIT_##id = (value),
#include "limits.def"
#undef LIMIT
};

struct limit {
    const char *name;
    int64_t value;
    const char *doc;
};

extern const struct limit api_limits[];
extern const int api_limit_count;

#endif
