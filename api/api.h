/*
 * api.h - bytes in, bytes out: the one door into facetd's typed API.
 *
 * Knows nothing of sockets, so that unit tests, fuzzers and the server enter by
 * the same door.  api_handle is thread-safe and may run for seconds (a fit): the
 * server calls it on a worker for every endpoint that api_lookup calls long.
 */
#ifndef API_H
#define API_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct api_request {
    const char *method;          /* "GET", "POST", ... */
    const char *path;            /* "/v1/eval", without the query */
    const char *query;           /* raw, still percent-encoded; NULL or "" if none */
    const char *content_type;    /* NULL if the client sent none */
    const char *accept;          /* NULL if the client sent none */
    const char *accept_encoding; /* NULL if the client sent none */
    const void *body;
    size_t body_size;
    /* The caller takes a response.stream; what this request points to then lives as long as it. */
    bool can_stream;
    /* Asked now and then by long work; true ends it.  NULL: never. */
    bool (*cancelled)(void *user);
    void *user;
    /*
     * Runs task(arg, 0) .. task(arg, count - 1), on other threads too, and returns when all have
     * ended.  NULL: there are no others.
     */
    void (*share)(void *crew, size_t count, void (*task)(void *arg, size_t index), void *arg);
    void *crew;
};

/* Where the time went and what was computed, for the server's log; 0 or NULL where unknown. */
struct api_trace {
    /* Summed over threads; of a stream what came before its first block. */
    double decode_us, compute_us, encode_us;
    size_t evaluations;
    const char *tier;
};

#define API_HEADERS_MAX 6
#define API_SIZE_UNKNOWN ((size_t)-1)

struct api_header {
    const char *name;
    char value[512];
};

struct api_response {
    int status;                /* HTTP status */
    const char *content_type;  /* static storage */
    void *body;                /* owned; api_response_clear frees it */
    size_t body_size;          /* with a stream: of all its bytes, or API_SIZE_UNKNOWN */
    struct api_stream *stream; /* instead of a body: api_stream_next; api_response_clear frees it */
    struct api_trace trace;
    size_t header_count;
    struct api_header
        headers[API_HEADERS_MAX]; /* last and large: only header_count of them count */
};

/* What the server must know before the body arrives. */
struct api_route {
    bool found;      /* false: api_handle will answer 404 or 405, whatever the body */
    bool is_long;    /* run on a worker, not on the network thread, unless api_is_short */
    size_t body_max; /* larger bodies: api_refuse with 413 */
    const char
        *path; /* the endpoint's, static storage, for the server's counts; NULL if not found */
};

/* Once per process, before the first request / after the last.  False: out of memory. */
bool api_open(void);
void api_close(void);

/*
 * Before the first request: the instruction set of the kernels (base, avx2, avx512), "" for the best
 * there is.  False: no such set, or this processor does not run it.
 */
bool api_select_isa(const char *name);

/* What a path takes, "POST, OPTIONS"; false: nothing is served there. */
enum { API_METHODS_SIZE = 64 };
bool api_methods(const char *path, char methods[API_METHODS_SIZE]);

struct api_limit {
    const char *name;
    int64_t value;
    const char *doc;
};

/*
 * Before the first request: what the caller refuses beyond, for /v1/capabilities to tell with the
 * API's own.  The array must live as long as requests are handled.
 */
void api_announce_limits(const struct api_limit *limits, size_t count);

struct api_route api_lookup(const char *method, const char *path, const char *content_type);

/*
 * Of a long route, with the body: whether this request is so small that it takes less than about a
 * millisecond and may be answered at once.  Costs one pass over a few KiB; in doubt false.
 */
bool api_is_short(const struct api_request *request);

/* Always fills the response; out of memory gives a 503 with a static-sized body. */
void api_handle(const struct api_request *request, struct api_response *response);

/*
 * The next bytes of a streamed answer, at most `room`; 0 at its end, -1 when it cannot go on (cut the
 * connection: the status has gone out).  It computes about a megabyte ahead, in buffers of some four, which
 * takes some milliseconds: on a worker, unless it is ready.  Between two calls it holds no more memory than
 * that and the request.
 */
long api_stream_next(struct api_stream *stream, char *out, size_t room);
/* The next call computes nothing. */
bool api_stream_is_ready(const struct api_stream *stream);

/* Whether an Accept-Encoding (NULL: none was sent) takes gzip, by its name or by "*" (RFC 9110 section 12.5.3). */
bool api_takes_gzip(const char *accept_encoding);

/* A problem+json response for what the server refuses by itself (408, 413, 429, 431, 503 ...). */
void api_refuse(int status, const char *detail, struct api_response *response);

void api_response_clear(struct api_response *response);

#endif
