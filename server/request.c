#include "request.h"

#include "clock.h"
#include "log.h"
#include "page.h"

#include <microhttpd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>

#define RETRY_AFTER_S "1"

const struct api_limit request_limits[REQUEST_LIMITS] = {
#define REQUEST_LIMIT(id, name, value, doc) {name, value, doc},
#include "request_limits.def"
#undef REQUEST_LIMIT
};

static void run_job(struct pool_job *job)
{
    request_run((struct request *)job); /* its first member */
}

void request_next_block(struct request *request)
{
    long n = api_stream_next(request->response.stream, request->block, REQUEST_BLOCK);
    request->block_taken = 0;
    request->block_size = n > 0 ? (size_t)n : 0;
    request->block_last = n <= 0;
    request->block_failed = n < 0;
}

static void run_block(struct pool_job *job)
{
    request_next_block((struct request *)job);
}

bool request_start_stream(struct request *request)
{
    request->job.run = run_block;
    request->block = malloc(REQUEST_BLOCK);
    return request->block;
}

bool request_start(struct request *request, const char *target, int64_t now_us)
{
    /* Absolute form (RFC 9112 section 3.2.2): servers must accept http://host/path. */
    if (!strncasecmp(target, "http://", 7)) {
        const char *path = strchr(target + 7, '/');
        target = path ? path : "/";
    }
    request->job.run = run_job;
    request->deadline_us = INT64_MAX; /* long requests get one */
    request->started_us = now_us;
    size_t size = strlen(target) + 1;
    request->target = size <= sizeof request->short_target ? request->short_target : malloc(size);
    if (!request->target) return false;
    memcpy(request->target, target, size);
    request->path = request->target;
    request->query = "";
    char *mark = strchr(request->target, '?');
    if (mark) {
        *mark = 0;
        request->query = mark + 1;
    }
    return true;
}

void request_drop_body(struct request *request, struct body_budget *budget)
{
    budget->used -= request->body_held;
    request->body_held = request->body_capacity = 0;
    free(request->body);
    request->body = NULL;
}

void request_clear(struct request *request, struct body_budget *budget)
{
    request_drop_body(request, budget);
    if (request->target != request->short_target) free(request->target);
    free(request->block);
    api_response_clear(&request->response);
    memset(request, 0, offsetof(struct request, response)); /* the rest is clear */
}

static bool is_harmless(const char *id)
{
    static const char allowed[] =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.";
    size_t n = strspn(id, allowed);
    return n > 0 && n <= REQUEST_ID_MAX && !id[n];
}

/* Steele, Lea, Flood 2014: SplitMix64; unique, since it permutes a counter. */
static uint64_t next_random(uint64_t *state)
{
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

void request_set_id(struct request *request, const char *wanted, uint64_t *random_state)
{
    enum { DIGITS = 16 };
    if (wanted && is_harmless(wanted)) {
        snprintf(request->id, sizeof request->id, "%s", wanted);
        return;
    }
    uint64_t bits = next_random(random_state);
    for (int i = DIGITS; i-- > 0; bits >>= 4) request->id[i] = "0123456789abcdef"[bits & 15];
    request->id[DIGITS] = 0;
}

static bool is_hex(const char *text, size_t size)
{
    return strspn(text, "0123456789abcdef") >= size && strspn(text, "0-") < size;
}

void request_set_trace(struct request *request, const char *traceparent)
{
    enum { TRACE_ID = 32, PARENT_ID = 16 };
    const char *t = traceparent;
    if (!t || strlen(t) != REQUEST_TRACE_SIZE - 1 || strncmp(t, "00-", 3)) return;
    if (!is_hex(t + 3, TRACE_ID) || t[35] != '-' || !is_hex(t + 36, PARENT_ID) || t[52] != '-' ||
        strspn(t + 53, "0123456789abcdef") != 2)
        return;
    memcpy(request->trace, t, REQUEST_TRACE_SIZE);
}

/* 64 bits of the bytes, eight at a time; who could choose them gains nothing by a collision. */
static uint64_t hash_bytes(const char *bytes, size_t size)
{
    uint64_t hash = size, piece;
    for (size_t i = 0; i < size; i += sizeof piece) {
        size_t n = size - i < sizeof piece ? size - i : sizeof piece;
        piece = 0;
        memcpy(&piece, bytes + i, n);
        hash = next_random(&(uint64_t){hash ^ piece});
    }
    return hash;
}

/* RFC 9110 section 13.1.2: a list of tags, compared weakly, or an asterisk. */
static bool lists_tag(const char *list, const char *tag)
{
    const size_t length = strlen(tag);
    for (const char *at = list; *at;) {
        at += strspn(at, " \t,");
        if (*at == '*') return true;
        if (!strncmp(at, "W/", 2)) at += 2;
        if (*at != '"') return false;
        const char *end = strchr(at + 1, '"');
        if (!end) return false;
        if ((size_t)(end + 1 - at) == length && !memcmp(at, tag, length)) return true;
        at = end + 1;
    }
    return false;
}

/* There is no content: this would describe the stored answer, which has its own. */
static void drop_content_encoding(struct api_response *response)
{
    size_t kept = 0;
    for (size_t i = 0; i < response->header_count; i++)
        if (strcasecmp(response->headers[i].name, "Content-Encoding"))
            response->headers[kept++] = response->headers[i];
    response->header_count = kept;
}

void request_tag(struct request *request)
{
    const char *wanted = request->if_none_match;
    struct api_response *response = &request->response;
    bool is_document = !strncmp(request->path, "/v1/", 4) || page_find(request->path);
    if (response->status != 200 || response->stream || !is_document) return;
    if (strcmp(request->method, "GET") && strcmp(request->method, "HEAD")) return;
    snprintf(request->etag, sizeof request->etag, "\"%016llx\"",
             (unsigned long long)hash_bytes(response->body, response->body_size));
    if (!wanted || !lists_tag(wanted, request->etag)) return;
    free(response->body);
    response->body = NULL;
    response->body_size = 0;
    response->content_type = NULL;
    response->status = 304;
    drop_content_encoding(response);
}

/*
 * At first little, since many a client announces and does not send; then all that was announced, for
 * it takes no memory before it is filled, and to grow in steps would copy what came.
 */
static size_t next_capacity(const struct request *request, size_t needed)
{
    enum { FIRST_MAX = 65536, GROWTH = 2 };
    size_t limit = request->body_expected ? request->body_expected : request->route.body_max;
    size_t capacity = FIRST_MAX;
    if (request->body_capacity)
        capacity = request->body_expected ? limit : GROWTH * request->body_capacity;
    if (capacity > limit) capacity = limit;
    return capacity < needed ? needed : capacity;
}

/*
 * Page by page: of more, glibc 2.36 makes one `rep movsb`, which costs AMD's Zen 3 and 4 many times as
 * much where the two addresses have about the same place in their pages (glibc bug 30994).
 */
static void copy_bytes(char *to, const char *from, size_t size)
{
    enum { PAGE = 4096 };
    for (size_t n; size; to += n, from += n, size -= n) {
        n = size < PAGE ? size : PAGE;
        memcpy(to, from, n);
    }
}

enum request_body request_add_body(struct request *request, const void *data, size_t size,
                                   struct body_budget *budget)
{
    size_t room = request->route.body_max - request->body_size;
    if (size > room) return BODY_TOO_LARGE;
    if (size > budget->max - budget->used) return BODY_NO_MEMORY;
    size_t needed = request->body_size + size;
    if (needed > request->body_capacity) {
        size_t capacity = next_capacity(request, needed);
        char *body = realloc(request->body, capacity);
        if (!body) return BODY_NO_MEMORY;
        request->body = body;
        request->body_capacity = capacity;
    }
    budget->used += size;
    request->body_held += size;
    copy_bytes(request->body + request->body_size, data, size);
    request->body_size = needed;
    return BODY_OK;
}

static bool is_cancelled(void *user)
{
    struct request *request = user;
    if (atomic_load_explicit(&request->gone, memory_order_relaxed)) return true;
    if (request->deadline_us == INT64_MAX || clock_us() < request->deadline_us) return false;
    request->overdue = true;
    return true;
}

static void share(void *crew, size_t count, void (*task)(void *arg, size_t index), void *arg)
{
    pool_share(crew, count, task, arg);
}

static struct api_request call_of(struct request *request)
{
    return (struct api_request){
        /* HEAD is GET whose body is not sent: RFC 9110 section 9.3.2 */
        .method = strcmp(request->method, "HEAD") ? request->method : "GET",
        .path = request->path,
        .query = request->query,
        .content_type = request->content_type,
        .accept = request->accept,
        .can_stream = true,
        .accept_encoding = request->accept_encoding,
        .body = request->body ? request->body : "",
        .body_size = request->body_size,
        .cancelled = is_cancelled,
        .user = request,
        .share = request->crew ? share : NULL,
        .crew = request->crew,
    };
}

bool request_is_short(struct request *request)
{
    enum { INLINE_BODY_MAX = 16384 }; /* more takes about a millisecond to decode */
    const struct api_request call = call_of(request);
    if (request->route.is_long) return api_is_short(&call);
    return request->body_size <= INLINE_BODY_MAX;
}

void request_run(struct request *request)
{
    const struct api_request call = call_of(request);
    request->began_us = request->was_queued ? clock_us() : request->received_us;
    if (!is_cancelled(request)) site_handle(request->site, &call, &request->response);
    if (request->overdue)
        request_refuse(request, 503, "the request took longer than the server allows");
}

void request_refuse(struct request *request, int status, const char *detail)
{
    struct api_response *response = &request->response;
    api_response_clear(response);
    memset(response, 0, sizeof *response);
    api_refuse(status, detail, response);
    if (status != 429 && status != 503) return;
    for (size_t i = 0; i < response->header_count; i++)
        if (!strcasecmp(response->headers[i].name, "Retry-After")) return;
    if (response->header_count == API_HEADERS_MAX) return;
    struct api_header *header = &response->headers[response->header_count++];
    header->name = "Retry-After";
    snprintf(header->value, sizeof header->value, RETRY_AFTER_S);
}

size_t request_headers(const struct request *request, struct request_header *headers)
{
    const struct api_response *response = &request->response;
    size_t n = 0;
    if (request->id[0]) headers[n++] = (struct request_header){"X-Request-Id", request->id};
    if (request->trace[0]) headers[n++] = (struct request_header){"traceparent", request->trace};
    if (request->etag[0]) {
        headers[n++] = (struct request_header){"ETag", request->etag};
        headers[n++] = (struct request_header){"Cache-Control", "no-cache"};
    }
    if (response->content_type)
        headers[n++] = (struct request_header){"Content-Type", response->content_type};
    for (size_t i = 0; i < response->header_count; i++)
        headers[n++] = (struct request_header){response->headers[i].name,
                                               response->headers[i].value};
    if (response->status == 401)
        headers[n++] = (struct request_header){"WWW-Authenticate", "Bearer realm=\"facetd\""};
    if (request->close) headers[n++] = (struct request_header){"Connection", "close"};
    /* Also where this Origin gets none: a cache would give that answer to the one that does. */
    if (request->varies_by_origin) headers[n++] = (struct request_header){"Vary", "Origin"};
    if (!request->cors) return n;
    headers[n++] = (struct request_header){"Access-Control-Allow-Origin", request->cors};
    headers[n++] = (struct request_header){"Access-Control-Expose-Headers", "*"};
    if (strcmp(request->method, "OPTIONS")) return n;
    headers[n++] = (struct request_header){"Access-Control-Allow-Methods", "GET, HEAD, POST"};
    headers[n++] = (struct request_header){
        "Access-Control-Allow-Headers",
        "Content-Type, Accept, Authorization, If-None-Match, X-Request-Id, traceparent"};
    headers[n++] = (struct request_header){"Access-Control-Max-Age", "86400"};
    return n;
}

void request_send_raw(const struct request *request, int fd)
{
    char head[2048];
    struct request_header headers[REQUEST_HEADERS_MAX];
    size_t count = request_headers(request, headers);
    const struct api_response *response = &request->response;
    size_t n = (size_t)snprintf(
        head, sizeof head, "HTTP/1.1 %d %s\r\nContent-Length: %zu\r\n", response->status,
        MHD_get_reason_phrase_for((unsigned)response->status), response->body_size);
    for (size_t i = 0; i < count && n < sizeof head; i++)
        n += (size_t)snprintf(head + n, sizeof head - n, "%s: %s\r\n", headers[i].name,
                              headers[i].value);
    if (n < sizeof head) n += (size_t)snprintf(head + n, sizeof head - n, "\r\n");
    /* Both go into an empty socket buffer; if the client is gone nobody misses them. */
    if (n < sizeof head && send(fd, head, n, MSG_DONTWAIT | MSG_NOSIGNAL | MSG_MORE) == (ssize_t)n)
        (void)send(fd, response->body, response->body_size, MSG_DONTWAIT | MSG_NOSIGNAL);
    shutdown(fd, SHUT_WR);
}

void request_send_refusal(int fd, int status, const char *detail)
{
    struct request refusal = {.close = true};
    request_refuse(&refusal, status, detail);
    request_send_raw(&refusal, fd);
    api_response_clear(&refusal.response);
}

size_t request_answer_size(const struct request *request)
{
    return request->response.stream ? request->streamed : request->response.body_size;
}

static long long span(int64_t from_us, int64_t to_us)
{
    return from_us && to_us > from_us ? (long long)(to_us - from_us) : 0;
}

void request_log(const struct request *request, const char *end)
{
    if (!log_requests()) return;
    char path[256], method[sizeof request->method * 4 + 3];
    const struct api_response *response = &request->response;
    const struct api_trace *trace = &response->trace;
    log_line("event=request id=%s%s%s method=%s path=%s status=%d in=%zu out=%zu us_receive=%lld "
             "us_queue=%lld us_decode=%.1f us_compute=%.1f us_encode=%.1f us_total=%lld tier=%s "
             "evaluations=%zu end=%s",
             request->id[0] ? request->id : "-", request->trace[0] ? " trace=" : "", request->trace,
             log_quote(request->method, method, sizeof method),
             log_quote(request->path, path, sizeof path), response->status, request->body_size,
             request_answer_size(request), span(request->started_us, request->received_us),
             span(request->received_us, request->began_us), trace->decode_us, trace->compute_us,
             trace->encode_us, span(request->started_us, request->done_us),
             trace->tier ? trace->tier : "-", trace->evaluations, end);
}
