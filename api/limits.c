#include "limits.h"

const struct limit api_limits[] = {
#define LIMIT(id, name, value, doc) {name, value, doc},
#include "limits.def"
#undef LIMIT
};

const int api_limit_count = sizeof api_limits / sizeof *api_limits;
