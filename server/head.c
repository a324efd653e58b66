#include "head.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

/*
 * libmicrohttpd 0.9.75 parses in place: it overwrites each CR LF by two NULs and the colon by one,
 * and all strings it hands out point into one buffer.  So the head must lie there without a gap:
 *
 *     method 0 target 0 version 0 0  name 0 blanks value 0 0  name 0 ... value 0 0  0 0
 *
 * A folded line is moved elsewhere, a NUL in the text ends a string early, a bare LF leaves one
 * NUL: each is a gap.  Newer versions lay heads out differently but can be told to be strict.
 */
#define HEAD_LIES_IN_ONE_PIECE (MHD_VERSION < 0x00097600)

struct walk {
    struct head head;
    const char *at; /* the byte after the last line's CR LF */
    unsigned hosts, lengths, encodings;
    bool is_1_1;
};

/* Letters, digits, - . and the others; at least one. (strspn would build a table for each name.) */
static bool is_made_of(const char *others, const char *text, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        const char c = text[i], small = (char)(c | 0x20);
        if ((small >= 'a' && small <= 'z') || (c >= '-' && c <= '9' && c != '/')) continue;
        if (!c || !strchr(others, c)) return false;
    }
    return size > 0;
}

/* RFC 9110 section 5.6.2 */
static bool is_token(const char *text, size_t size)
{
    return is_made_of("_!#$%&'*+^`|~", text, size);
}

/* RFC 3986: reg-name, IPv4 or [IPv6], and a port */
static bool is_host(const char *text, size_t size)
{
    return is_made_of(":[]_~%!$&'()*+,;=", text, size);
}

/* RFC 9110 section 5.5: a value holds no control but HTAB. */
static bool has_controls(const char *text, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        unsigned char c = (unsigned char)text[i];
        if ((c < 0x20 && c != '\t') || c == 0x7f) return true;
    }
    return false;
}

static enum head_field field_of(const char *name, size_t size)
{
#define NAME(field, text) [field] = { text, sizeof text - 1 }
    static const struct {
        const char *name;
        size_t size;
    } known[HEAD_FIELDS] = {
        NAME(HEAD_HOST, "Host"),
        NAME(HEAD_EXPECT, "Expect"),
        NAME(HEAD_CONTENT_LENGTH, "Content-Length"),
        NAME(HEAD_TRANSFER_ENCODING, "Transfer-Encoding"),
        NAME(HEAD_CONTENT_TYPE, "Content-Type"),
        NAME(HEAD_CONTENT_ENCODING, "Content-Encoding"),
        NAME(HEAD_ACCEPT, "Accept"),
        NAME(HEAD_ACCEPT_ENCODING, "Accept-Encoding"),
        NAME(HEAD_AUTHORIZATION, "Authorization"),
        NAME(HEAD_ORIGIN, "Origin"),
        NAME(HEAD_REQUEST_ID, "X-Request-Id"),
        NAME(HEAD_TRACEPARENT, "traceparent"),
        NAME(HEAD_IF_NONE_MATCH, "If-None-Match"),
    };
#undef NAME
    unsigned field = 0;
    while (field < HEAD_FIELDS &&
           (known[field].size != size || strcasecmp(name, known[field].name)))
        field++;
    return (enum head_field)field;
}

static void note_framing(struct walk *walk, enum head_field field, const char *value, size_t size)
{
    struct head *head = &walk->head;
    switch (field) {
    case HEAD_HOST:
        if (walk->hosts++) head->fault = "more than one Host";
        if (!is_host(value, size)) head->fault = "the Host is not a host";
        break;
    case HEAD_EXPECT: head->expects_continue = !strcasecmp(value, "100-continue"); break;
    case HEAD_CONTENT_LENGTH:
        if (walk->lengths++) head->fault = "more than one Content-Length";
        head->length = strtoull(value, NULL, 10); /* libmicrohttpd has refused non-digits */
        break;
    case HEAD_TRANSFER_ENCODING:
        if (walk->encodings++) head->fault = "more than one Transfer-Encoding";
        if (strcasecmp(value, "chunked"))
            head->fault = "the only Transfer-Encoding here is chunked";
        if (!walk->is_1_1) head->fault = "Transfer-Encoding needs HTTP/1.1";
        head->chunked = true;
        break;
    default: break;
    }
}

static enum MHD_Result note_header(void *user, enum MHD_ValueKind kind, const char *name,
                                   size_t name_size, const char *value, size_t value_size)
{
    struct walk *walk = user;
    (void)kind;
    if (!value) value = "";
    if (!is_token(name, name_size)) walk->head.fault = "a header's name is not a token";
    if (has_controls(value, value_size)) walk->head.fault = "a control character in a header";
    const enum head_field field = field_of(name, name_size);
    if (field < HEAD_FIELDS && !walk->head.value[field]) walk->head.value[field] = value;
    note_framing(walk, field, value, value_size);
#if HEAD_LIES_IN_ONE_PIECE
    const char *blanks = name + name_size + 1;
    if (name != walk->at || value < blanks || strspn(blanks, " \t") < (size_t)(value - blanks))
        walk->head.fault = "a folded line, a NUL or a line that does not end with CR LF";
    walk->at = value + value_size + 2;
#endif
    return MHD_YES;
}

void head_note_target(struct head_line *line, const char *target)
{
    line->target = target;
    line->target_length = strlen(target);
    line->target_fault = strstr(target, "%00") ? "%00 in the target" : NULL;
    for (const char *at = target; *at; at++)
        if (*at <= ' ' || *at > '~') line->target_fault = "the target is not visible ASCII";
}

static const char *line_fault(const struct head_line *line)
{
    if (!is_token(line->method, strlen(line->method))) return "the method is not a token";
#if HEAD_LIES_IN_ONE_PIECE
    if (line->target != line->method + strlen(line->method) + 1 ||
        line->version != line->target + line->target_length + 1 ||
        strlen(line->version) != strlen("HTTP/1.1"))
        return "the request line is not METHOD TARGET VERSION with one space between them";
#endif
    return line->target_fault;
}

/* Small heads are no matter: they count as nothing. */
static size_t memory_of(struct MHD_Connection *connection, size_t size)
{
    enum { SMALL = 512, ENTRY = 64 /* libmicrohttpd's note of a header, a cookie, a parameter */ };
    if (size <= SMALL) return 0;
    const int kinds = MHD_HEADER_KIND | MHD_COOKIE_KIND | MHD_GET_ARGUMENT_KIND,
              entries = MHD_get_connection_values(connection, (enum MHD_ValueKind)kinds, NULL,
                                                  NULL);
    const char *cookie = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "Cookie");
    return size + ENTRY * (size_t)entries + (cookie ? strlen(cookie) + 1 : 0); /* a copy */
}

struct head head_read(struct MHD_Connection *connection, const struct head_line *line)
{
    struct walk walk = {.at = line->version + strlen("HTTP/1.1") + 2,
                        .is_1_1 = !strcmp(line->version, "HTTP/1.1")};
    if ((walk.head.fault = line_fault(line))) {
        walk.head.chunked = true; /* nobody knows how long the body is */
        return walk.head;
    }
    MHD_get_connection_values_n(connection, MHD_HEADER_KIND, note_header, &walk);
    const union MHD_ConnectionInfo *size = MHD_get_connection_info(
        connection, MHD_CONNECTION_INFO_REQUEST_HEADER_SIZE);
    if (size) walk.head.memory = memory_of(connection, size->header_size);
#if HEAD_LIES_IN_ONE_PIECE
    if (!walk.head.fault && (!size || walk.at + 2 != line->method + size->header_size))
        walk.head.fault = "a NUL, or a line that does not end with CR LF";
#endif
    if (walk.lengths && walk.encodings)
        walk.head.fault = "both Content-Length and Transfer-Encoding";
    if (!walk.hosts && walk.is_1_1) walk.head.fault = "HTTP/1.1 asks for a Host";
    return walk.head;
}
