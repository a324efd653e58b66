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

enum { OWN = sizeof own / sizeof *own };

size_t api_limit_count(void)
{
    return OWN + announced.count;
}

void api_limits(struct api_limit *limits)
{
    for (size_t i = 0; i < OWN; i++) limits[i] = own[i];
    for (size_t i = 0; i < announced.count; i++) limits[OWN + i] = announced.list[i];
}
