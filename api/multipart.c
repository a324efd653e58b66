#include "multipart.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

enum { BOUNDARY_MAX = 70, HEADERS_MAX = 8192 }; /* bytes; the former by RFC 2046 section 5.1.1 */

/* "\r\n--boundary": what ends a part. */
struct delimiter {
    char text[4 + BOUNDARY_MAX];
    size_t size;
};

static const char *skip_space(const char *p, const char *end)
{
    while (p < end && (*p == ' ' || *p == '\t')) p++;
    return p;
}

/* ASCII: what follows may stand in messages. */
static bool is_printable(const char *text, size_t size)
{
    for (size_t i = 0; i < size; i++)
        if (text[i] < 0x20 || text[i] > 0x7e) return false;
    return true;
}

/*
 * The value of a parameter `name` among "; name=value; other=\"quoted\"" into out; its length, or
 * -1 where it is absent, malformed, not printable ASCII or does not fit.
 */
static int parameter(const char *p, const char *end, const char *name, char *out, size_t room)
{
    size_t name_size = strlen(name);
    while ((p = memchr(p, ';', (size_t)(end - p)))) {
        p = skip_space(p + 1, end);
        bool wanted = (size_t)(end - p) > name_size && !strncasecmp(p, name, name_size) &&
                      p[name_size] == '=';
        while (p < end && *p != '=' && *p != ';') p++;
        if (p == end || *p == ';') continue;
        size_t n = 0;
        bool quoted = ++p < end && *p == '"';
        for (p += quoted; p < end && (quoted ? *p != '"' : *p != ';' && *p != ' '); p++) {
            if (quoted && *p == '\\' && p + 1 < end) p++;
            if (n + 1 < room) out[n] = *p;
            n++;
        }
        if (quoted && p == end) return -1;
        if (!wanted) continue;
        if (n + 1 > room) return -1;
        out[n] = 0;
        return is_printable(out, n) ? (int)n : -1;
    }
    return -1;
}

static bool find_boundary(const char *content_type, struct delimiter *delimiter)
{
    char boundary[BOUNDARY_MAX + 1];
    int n = parameter(content_type, content_type + strlen(content_type), "boundary", boundary,
                      sizeof boundary);
    if (n < 1) return false;
    memcpy(delimiter->text, "\r\n--", 4);
    memcpy(delimiter->text + 4, boundary, (size_t)n);
    delimiter->size = 4 + (size_t)n;
    return true;
}

/* The next delimiter at or after p; NULL: none. */
static const char *find_delimiter(const char *p, const char *end, const struct delimiter *delimiter)
{
    while ((size_t)(end - p) >= delimiter->size && (p = memchr(p, '\r', (size_t)(end - p)))) {
        if ((size_t)(end - p) < delimiter->size) return NULL;
        if (p[1] == '\n' && !memcmp(p, delimiter->text, delimiter->size)) return p;
        p++;
    }
    return NULL;
}

/* Behind a delimiter: 1 a part begins at *p, 0 the last one ended, -1 neither. */
static int after_delimiter(const char **p, const char *end)
{
    if (end - *p >= 2 && (*p)[0] == '-' && (*p)[1] == '-') return 0;
    *p = skip_space(*p, end);
    if (end - *p < 2 || (*p)[0] != '\r' || (*p)[1] != '\n') return -1;
    *p += 2;
    return 1;
}

static bool is_header(const char *line, const char *end, const char *name, const char **value)
{
    size_t n = strlen(name);
    if ((size_t)(end - line) <= n || strncasecmp(line, name, n) || line[n] != ':') return false;
    *value = skip_space(line + n + 1, end);
    return true;
}

static bool is_plain_encoding(const char *value, const char *end)
{
    static const char *const plain[] = {"binary", "8bit", "7bit"};
    for (size_t i = 0; i < sizeof plain / sizeof *plain; i++)
        if ((size_t)(end - value) >= strlen(plain[i]) &&
            !strncasecmp(value, plain[i], strlen(plain[i])))
            return true;
    return false;
}

/* The headers at *p to the empty line; *p then stands at the content. */
static bool read_headers(const char **p, const char *end, struct part *part,
                         struct problem *problem)
{
    const char *limit = end - *p > HEADERS_MAX ? *p + HEADERS_MAX : end;
    *part->name = 0;
    for (;;) {
        const char *line = *p, *stop = memchr(line, '\r', (size_t)(limit - line)), *value;
        if (!stop || limit - stop < 2 || stop[1] != '\n')
            return api_problem(problem, 400, "the headers of a part do not end");
        *p = stop + 2;
        if (stop == line) break;
        if (is_header(line, stop, "Content-Disposition", &value) &&
            parameter(value, stop, "name", part->name, sizeof part->name) < 1)
            return api_problem(problem, 422,
                               "a part has no name of less than %d printable characters",
                               PART_NAME_ROOM);
        if (is_header(line, stop, "Content-Transfer-Encoding", &value) &&
            !is_plain_encoding(value, stop))
            return api_problem(
                problem, 422,
                "a part has a Content-Transfer-Encoding; parts are taken as they are");
    }
    return *part->name ||
           api_problem(problem, 400, "a part has no Content-Disposition with a name");
}

static bool add_part(struct part *parts, size_t *count, const struct part *part,
                     struct problem *problem)
{
    struct place at = {NULL, part->name, 0};
    for (size_t i = 0; i < *count; i++)
        if (!strcmp(parts[i].name, part->name))
            return api_problem_at(problem, &at, "is given twice");
    if (*count == PARTS_MAX)
        return api_problem(problem, 422, "more than %d parts are not taken", PARTS_MAX);
    parts[(*count)++] = *part;
    return true;
}

bool api_multipart(const char *content_type, const char *body, size_t size,
                   struct part parts[PARTS_MAX], size_t *count, struct problem *problem)
{
    struct delimiter delimiter;
    struct part part;
    const char *end = body + size, *p = body;
    *count = 0;
    if (!find_boundary(content_type, &delimiter))
        return api_problem(problem, 400, "multipart/form-data needs a boundary of 1 to %d bytes",
                           BOUNDARY_MAX);
    /* The first delimiter may lack its line break; a preamble means nothing. */
    size_t dashes = delimiter.size - 2;
    bool at_once = size >= dashes && !memcmp(p, delimiter.text + 2, dashes);
    p = at_once ? p + dashes : find_delimiter(p, end, &delimiter);
    if (p && !at_once) p += delimiter.size;
    int what;
    while (p && (what = after_delimiter(&p, end)) >= 0) {
        if (!what) return true;
        if (!read_headers(&p, end, &part, problem)) return false;
        /* A part without content: the empty line's break is the delimiter's. */
        part.bytes = p;
        p = find_delimiter(p - 2, end, &delimiter);
        if (!p) break;
        part.size = p < part.bytes ? 0 : (size_t)(p - part.bytes);
        if (!add_part(parts, count, &part, problem)) return false;
        p += delimiter.size;
    }
    return api_problem(problem, 400, "the multipart body does not end with its boundary");
}
