#include "media.h"

#include <stddef.h>
#include <string.h>
#include <strings.h>

static size_t type_length(const char *text)
{
    size_t n = strcspn(text, ";,");
    while (n && (text[n - 1] == ' ' || text[n - 1] == '\t')) n--;
    return n;
}

bool api_media_is(const char *content_type, const char *type)
{
    if (!content_type) return false;
    content_type += strspn(content_type, " \t");
    size_t n = type_length(content_type);
    return n == strlen(type) && !strncasecmp(content_type, type, n);
}

/* "q=0.5" among the parameters up to the next comma; 1 if absent, 0 if malformed. */
static double quality_of(const char *range)
{
    const char *end = range + strcspn(range, ","), *p = range;
    while ((p = memchr(p, ';', (size_t)(end - p)))) {
        p += 1 + strspn(p + 1, " \t");
        if (end - p < 3 || (*p != 'q' && *p != 'Q') || p[1] != '=') continue;
        if (p[2] != '0' && p[2] != '1') return 0;
        int thousandths = 1000 * (p[2] - '0'), unit = 100;
        if (p[3] == '.')
            for (p += 4; *p >= '0' && *p <= '9'; p++, unit /= 10) thousandths += unit * (*p - '0');
        return thousandths > 1000 ? 1 : thousandths / 1000.0;
    }
    return 1;
}

/* How exactly a range names the type or coding: 0 not, 1 any, 2 its first half, 3 whole. */
static int precision(const char *range, size_t n, const char *type)
{
    size_t first = strcspn(type, "/") + 1;
    if (n == strlen(type) && !strncasecmp(range, type, n)) return 3;
    if (!strchr(type, '/')) return n == 1 && *range == '*'; /* a coding has no halves */
    if (n == first + 1 && range[first] == '*' && !strncasecmp(range, type, first)) return 2;
    return n == 3 && !strncmp(range, "*/*", 3);
}

double api_media_quality(const char *accept, const char *type)
{
    if (!accept || !accept[strspn(accept, " \t")]) return 1;
    double quality = 0;
    int best = 0;
    for (const char *range = accept; *range; range += *range == ',') {
        range += strspn(range, " \t");
        int how = precision(range, type_length(range), type);
        if (how > best) {
            best = how;
            quality = quality_of(range);
        }
        range += strcspn(range, ",");
    }
    return quality;
}
