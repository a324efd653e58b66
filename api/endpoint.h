/*
 * endpoint.h - what an endpoint is: one file endpoint_<name>.c with one constant
 * `api_endpoint_<name>`, and one row in endpoints.def.
 *
 * The router decodes the request by its table, calls handle, and prints the
 * response by its table.  An endpoint that also takes a raw body (a measurement,
 * a map) lists its media in `bodies`: then `in` is decoded from the query alone,
 * by the same table.  An endpoint that can answer in raw bytes lists the media
 * types in `answers` and calls api_answer_raw.
 */
#ifndef API_ENDPOINT_H
#define API_ENDPOINT_H

#include "field.h"

/* A raw body told by content type, or by content where the type says nothing. */
struct medium {
    const char *type;
    bool (*matches)(const unsigned char *bytes, size_t size);
};

/* Of an answer. */
struct piece {
    const char *bytes;
    size_t size;
};

/* One after the other; theirs is who produced them. */
struct pieces {
    const struct piece *list;
    size_t count;
    bool ended; /* these are the last */
};

struct call {
    const struct endpoint *endpoint;
    const struct api_request *request;
    const void *in;              /* by endpoint->request; NULL without a table */
    void *out;                   /* by endpoint->response; cleared: every member absent */
    const struct medium *medium; /* of the raw body in request->body; NULL: JSON, already in `in` */
    struct arena *arena;
    struct problem *problem;
    struct api_response *response;
    /*
     * Set by a handler that answers block by block (stream.h), which it may where
     * request->can_stream: the next pieces, which stay until it is called again; false: failed.
     */
    bool (*produce)(struct call *call, struct pieces *pieces);
    void *producer; /* what it goes on with; in the arena */
};

struct endpoint {
    const char *method, *path, *summary;
    const char *doc;
    const struct field *request;
    size_t request_size;
    const struct field *response;
    size_t response_size;
    const struct medium *bodies; /* besides JSON; ended by a NULL type; may be NULL */
    const char *const *answers;  /* media types besides JSON; NULL-terminated; may be NULL */
    bool is_long;
    bool grows_by_words; /* a small body is short work unless it says one of router.c's words */
    bool is_probe;       /* whatever its query, which may be a probe's own, it answers */
    const char *example; /* a request body that works */
    /* True: done (out filled, or api_answer_raw called).  False: call->problem is set. */
    bool (*handle)(struct call *call);
};

/* Whether the client still wants the answer; false sets the problem. */
bool api_still_wanted(struct call *call);
/* The same question in lib's words. */
facet_watch api_watch(const struct call *call);

static inline struct decoder api_decoder(const struct call *call)
{
    return (struct decoder){call->arena, call->problem, api_watch(call)};
}

/*
 * The media type to answer with, by the client's Accept: "application/json" or
 * one of endpoint->answers; `preferred` where the client has no preference.
 */
const char *api_answer_type(const struct call *call, const char *preferred);
/* Answer these malloc'd bytes, which the response now owns.  type: static storage.  Returns true. */
bool api_answer_raw(struct call *call, const char *type, void *bytes, size_t size);
/* A header of the answer; no-op when there are API_HEADERS_MAX already. */
__attribute__((format(printf, 3, 4))) void
api_answer_header(struct api_response *response, const char *name, const char *format, ...);

/* Microseconds on the monotonic clock. */
double api_clock(void);

/* The endpoints of endpoints.def; NULL past the last. */
const struct endpoint *api_endpoint(size_t index);

#endif
