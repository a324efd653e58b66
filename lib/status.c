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
    static const char *const names[FACET_TIER_COUNT] = {[FACET_DRAFT] = "draft",
                                                        [FACET_FAST] = "fast",
                                                        [FACET_EXACT32] = "exact32",
                                                        [FACET_PRECISE] = "precise"};
    return (unsigned)tier < FACET_TIER_COUNT ? names[tier] : NULL;
}

const char *facet_tier_domain(facet_tier tier)
{
    static const char floats[] =
        "minor alpha >= 1e-4, major alpha <= 1e3 (tabulated: times slopes.scale, too), |mean slope| <= 1e2; on sheared surfaces not G, G1_i, G1_o; "
        "not shear thesis; transmission: fr, fr_cos, pdf, eta in [1/8, 8] and 1/64 or more from 1; bounds grow with alpha_1/alpha_2, correlation and mean slope over alpha_2";
    static const char *const domains[FACET_TIER_COUNT] = {
        [FACET_DRAFT] = floats,
        [FACET_FAST] = floats,
        [FACET_EXACT32] =
            "all; transmission: fr, fr_cos, pdf; bounds grow with alpha_1/alpha_2, correlation and mean slope over alpha_2",
        [FACET_PRECISE] = "all",
    };
    return (unsigned)tier < FACET_TIER_COUNT ? domains[tier] : NULL;
}
