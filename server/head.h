/*
 * head.h - whether a request's head means one thing only.
 *
 * libmicrohttpd 0.9.75 is generous: it joins folded lines (to the header's *name*), cuts values at a
 * NUL, ends lines at a bare LF, takes the last of two lengths.  What a proxy in front reads
 * differently becomes a smuggled request, so all of it is refused here, with 400.
 */
#ifndef HEAD_H
#define HEAD_H

#include <microhttpd.h>
#include <stdbool.h>
#include <stddef.h>

/* Where libmicrohttpd keeps the parts of the request line, as they lie in its buffer. */
struct head_line {
    const char *method, *target, *version;
    /* Before libmicrohttpd decoded the target in place: */
    size_t target_length;
    const char *target_fault;
};

/* To be called with the target as it came. */
void head_note_target(struct head_line *line, const char *target);

/* The headers that facetd reads: one walk finds them all. */
enum head_field {
    HEAD_HOST,
    HEAD_EXPECT,
    HEAD_CONTENT_LENGTH,
    HEAD_TRANSFER_ENCODING,
    HEAD_CONTENT_TYPE,
    HEAD_CONTENT_ENCODING,
    HEAD_ACCEPT,
    HEAD_ACCEPT_ENCODING,
    HEAD_AUTHORIZATION,
    HEAD_ORIGIN,
    HEAD_REQUEST_ID,
    HEAD_TRACEPARENT,
    HEAD_IF_NONE_MATCH,
    HEAD_FIELDS
};

struct head {
    const char *fault; /* NULL, or why the request cannot be told apart from its neighbours */
    bool chunked, expects_continue;
    size_t length; /* Content-Length; 0 if chunked or none */
    size_t memory; /* of the connection's: libmicrohttpd keeps the head and the answer's in one
                      piece */
    /* The first of each name, valid until the request completes; NULL if absent. */
    const char *value[HEAD_FIELDS];
};

struct head head_read(struct MHD_Connection *connection, const struct head_line *line);

#endif
