/*
 * request.h - one HTTP request between its first byte and its log line: the collected body, the
 * call into the API, the answer.  Knows nothing of libmicrohttpd.
 */
#ifndef REQUEST_H
#define REQUEST_H

#include "api.h"
#include "pool.h"
#include "site.h"

#include <stdatomic.h>
#include <stdint.h>

enum {
#define REQUEST_LIMIT(id, name, value, doc) REQUEST_##id = (value),
#include "request_limits.def"
#undef REQUEST_LIMIT
    REQUEST_ID_MAX = 64,
    REQUEST_BLOCK = 131072,  /* bytes of a streamed answer that wait to be sent */
    REQUEST_TRACE_SIZE = 56, /* a traceparent of version 00 and its NUL */
    REQUEST_ETAG_SIZE = 20,
    REQUEST_HEADERS_MAX = API_HEADERS_MAX + 14
};

/* REQUEST_TARGET_MAX and its like, for api_announce_limits. */
enum {
    REQUEST_LIMITS = 0
#define REQUEST_LIMIT(id, name, value, doc) +1
#include "request_limits.def"
#undef REQUEST_LIMIT
};
extern const struct api_limit request_limits[REQUEST_LIMITS];

struct request {
    struct pool_job job; /* first: the pool hands it back */
    void *owner;         /* the caller's */
    struct pool *crew;   /* whose idle workers may help; NULL where the network thread answers */
    char method[16];
    char id[REQUEST_ID_MAX + 1];
    char trace[REQUEST_TRACE_SIZE]; /* the client's traceparent; empty if none or malformed */
    char etag[REQUEST_ETAG_SIZE];   /* of the answer; empty if it has none */
    enum site site;
    char *target; /* owned, or short_target; path and query point into it */
    char short_target[64];
    const char *path, *query;
    /* The connection's, valid until the request completes. */
    const char *content_type, *accept, *accept_encoding, *if_none_match;
    struct api_route route;
    char *body;
    size_t body_size, body_capacity;
    size_t body_held;     /* of the budget */
    size_t body_expected; /* Content-Length; 0 if unknown */
    /* Of a response.stream: bytes taken .. size of the block are still to be sent. */
    char *block;
    size_t block_size, block_taken, streamed;
    bool block_last, block_failed; /* no more follow; the connection is to be cut */
    const char *cors;              /* value of Access-Control-Allow-Origin; NULL: none */
    bool varies_by_origin;         /* with another Origin there is one, or none */
    bool close;                    /* the connection ends after this answer */
    bool overdue;                  /* the deadline passed and the work was told */
    bool was_queued;               /* it went to a worker */
    atomic_bool gone;              /* the client left: nobody wants the answer */
    int64_t deadline_us;
    int64_t started_us, received_us, began_us, done_us;
    struct api_response response; /* last, as its headers are */
};

/* Bytes of all bodies together: a request that would pass `max` is refused. */
struct body_budget {
    size_t used, max;
};

/* Copies the request line's target; false: out of memory. */
bool request_start(struct request *request, const char *target, int64_t now_us);

/* Gives the body's memory back early; body_size stays, for the log. */
void request_drop_body(struct request *request, struct body_budget *budget);

/* Frees everything and zeroes. */
void request_clear(struct request *request, struct body_budget *budget);

/* Takes the client's id if it is harmless, else makes one. */
void request_set_id(struct request *request, const char *wanted, uint64_t *random_state);

/* Takes the client's traceparent (W3C Trace Context, version 00) if it is one. */
void request_set_trace(struct request *request, const char *traceparent);

enum request_body { BODY_OK, BODY_TOO_LARGE, BODY_NO_MEMORY };

enum request_body request_add_body(struct request *request, const void *data, size_t size,
                                   struct body_budget *budget);

/* Whether the network thread may answer it, with the body complete. */
bool request_is_short(struct request *request);

/* Calls the API and fills the response; on any thread. */
void request_run(struct request *request);

/* Readies the request for blocks: its job computes the next one.  False: out of memory. */
bool request_start_stream(struct request *request);
void request_next_block(struct request *request);

/* Replaces the response by a problem document; with Retry-After for 429 and 503. */
void request_refuse(struct request *request, int status, const char *detail);

/*
 * Gives the answer to a GET an entity tag made of its bytes, and turns it into 304 if the client has
 * it already.  For /v1 and the page alone; what POSTs answer costs more to keep than to compute, and
 * probes are never the same.
 */
void request_tag(struct request *request);

struct request_header {
    const char *name, *value;
};

/* The response's headers but Content-Length and Date; at most REQUEST_HEADERS_MAX. */
size_t request_headers(const struct request *request, struct request_header *headers);

/*
 * Writes the whole answer to the socket and shuts the sending side: for answers that are due when
 * libmicrohttpd takes none (in the middle of an upload, before a request is parsed).  What the
 * socket's buffer does not take is lost.
 */
void request_send_raw(const struct request *request, int fd);
/* The same, of no request: a problem document, and the connection's end. */
void request_send_refusal(int fd, int status, const char *detail);

/* Bytes of the answer's body: of a streamed one those taken so far. */
size_t request_answer_size(const struct request *request);

/* One line; `end` says how the request ended. */
void request_log(const struct request *request, const char *end);

#endif
