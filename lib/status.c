#include "facet.h"

const char *facet_status_text(facet_status status)
{
    static const char *const texts[] = {
#define FACET_STATUS_TEXT(name, text) [FACET_##name] = text,
        FACET_STATUS_MAP(FACET_STATUS_TEXT)
#undef FACET_STATUS_TEXT
    };
    return (unsigned)status < FACET_STATUS_COUNT ? texts[status] : "unknown status";
}

const char *facet_tier_name(facet_tier tier)
{
    static const char *const names[FACET_TIER_COUNT] = { [FACET_DRAFT] = "draft", [FACET_FAST] = "fast", [FACET_EXACT32] = "exact32", [FACET_PRECISE] = "precise" };
    return (unsigned)tier < FACET_TIER_COUNT ? names[tier] : NULL;
}
