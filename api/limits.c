#include "limits.h"

static const struct api_limit own[] = {
#define LIMIT(id, name, value, doc) {name, value, doc},
#include "limits.def"
#undef LIMIT
};

static struct {
    const struct api_limit *list;
    size_t count;
} announced;

void api_announce_limits(const struct api_limit *limits, size_t count)
{
    announced.list = limits;
    announced.count = count;
}

size_t api_limits(struct api_limit limits[LIMITS_MAX])
{
    size_t n = 0;
    for (size_t i = 0; i < sizeof own / sizeof *own; i++) limits[n++] = own[i];
    for (size_t i = 0; i < announced.count && n < LIMITS_MAX; i++) limits[n++] = announced.list[i];
    return n;
}
