#define _GNU_SOURCE /* POLLRDHUP */
#include "http.h"

#include "client.h"
#include "clock.h"
#include "log.h"
#include "metrics.h"
#include "token.h"

#include <microhttpd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <unistd.h>

enum {
    CONNECTION_MEMORY = 32768, /* half of it is what a body comes in; zeroed for each request, so that more costs caches */
    MEMORY_INCREMENT = 8192,
    DROP_BODY_MAX = 65536, /* of a refused request: read, so that the connection survives */
    LINGER_US = 2000000    /* for a client to read an answer sent amid its upload */
};

/*
 * 0.9.75: our own look at the head (head.c) is stricter than its strictness, and answers with a
 * problem where it would just close.  Later versions have levels.
 */
#define STRICTNESS (MHD_VERSION < 0x00097600 ? 0 : 1)

struct http {
    struct http_config config;
    const struct options *options;
    struct pool *pool;
    struct MHD_Daemon *daemon;
    int epoll_fd;
    bool draining;
    struct client *clients; /* all */
    size_t client_count, active_count;
    struct client **working; /* those that wait for a worker */
    size_t working_count;
    int64_t now_us; /* when this turn began: one look at the clock for all its requests */
    struct body_budget budget;
    uint64_t random_state;
};

/* Gauges are the main listener's. */
static void gauge(const struct http *http, enum metric metric, size_t value)
{
    if (http->config.site == SITE_MAIN) metrics_set(metric, (long long)value);
}

static int64_t seconds(long s)
{
    return (int64_t)s * 1000000;
}

/* ---- Connections --------------------------------------------------------------------------- */

static void on_connection(void *user, struct MHD_Connection *connection, void **context,
                          enum MHD_ConnectionNotificationCode code)
{
    struct http *http = user;
    struct client *client = *context;
    if (code == MHD_CONNECTION_NOTIFY_CLOSED) {
        if (!client) return;
        request_clear(&client->request, &http->budget);
        *(client->previous ? &client->previous->next : &http->clients) = client->next;
        if (client->next) client->next->previous = client->previous;
        http->client_count--;
        gauge(http, METRIC_CONNECTIONS, http->client_count);
        free(client);
        return;
    }
    client = calloc(1, sizeof *client);
    *context = client; /* NULL: on_request closes it */
    if (!client) return;
    client->http = http;
    client->connection = connection;
    client->fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
    client->deadline_us = clock_us() + seconds(http->options->header_timeout); /* between turns */
    client->next = http->clients;
    if (client->next) client->next->previous = client;
    http->clients = client;
    http->client_count++;
    gauge(http, METRIC_CONNECTIONS, http->client_count);
    const union MHD_ConnectionInfo *peer =
        MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
    if (peer) client_set_address(client, peer->client_addr);
    if (http->draining) client_cut(client, false);
}

static void stop_working(struct http *http, struct client *client)
{
    struct client *last = http->working[--http->working_count];
    http->working[client->place] = last;
    last->place = client->place;
    gauge(http, METRIC_QUEUE_DEPTH, http->working_count);
}

static void wait_for_worker(struct http *http, struct client *client)
{
    client->phase = CLIENT_WORK;
    client->deadline_us = CLIENT_NEVER; /* the request has its own */
    client->place = http->working_count;
    http->working[http->working_count++] = client;
    gauge(http, METRIC_QUEUE_DEPTH, http->working_count);
    MHD_suspend_connection(client->connection);
}

/* ---- Answers ------------------------------------------------------------------------------- */

static int64_t sending_deadline(const struct http *http, int64_t now_us, size_t bytes)
{
    return now_us + seconds(http->options->header_timeout) +
           (int64_t)(1e6 * (double)bytes / (double)http->options->min_rate);
}

/* What is computed of a streamed answer; a worker computes the rest, block by block. */
static ssize_t send_block(void *user, uint64_t position, char *out, size_t room)
{
    struct client *client = user;
    struct http *http = client->http;
    struct request *request = &client->request;
    (void)position;
    while (request->block_taken == request->block_size) {
        if (atomic_load(&request->gone) || request->block_failed)
            return MHD_CONTENT_READER_END_WITH_ERROR;
        if (request->block_last) return MHD_CONTENT_READER_END_OF_STREAM;
        request->deadline_us = clock_us() + seconds(http->options->deadline);
        if (!api_stream_is_ready(request->response.stream) && pool_submit(http->pool, &request->job)) {
            wait_for_worker(http, client);
            return 0;
        }
        request_next_block(request); /* a copy; or no worker is free: some milliseconds */
        client->deadline_us = sending_deadline(http, http->now_us, REQUEST_BLOCK);
    }
    size_t left = request->block_size - request->block_taken, n = left < room ? left : room;
    memcpy(out, request->block + request->block_taken, n);
    request->block_taken += n;
    request->streamed += n;
    return (ssize_t)n;
}

/* The body stays ours until on_completed: libmicrohttpd neither copies nor frees it. */
static struct MHD_Response *response_of(struct client *client)
{
    struct request *request = &client->request;
    if (!request->response.stream)
        return MHD_create_response_from_buffer(request->response.body_size, request->response.body,
                                               MHD_RESPMEM_PERSISTENT);
    if (!request_start_stream(request)) return NULL;
    uint64_t size = request->response.body_size == API_SIZE_UNKNOWN ? MHD_SIZE_UNKNOWN
                                                                    : request->response.body_size;
    return MHD_create_response_from_callback(size, REQUEST_BLOCK, send_block, client, NULL);
}

static enum MHD_Result answer(struct http *http, struct client *client)
{
    struct request *request = &client->request;
    if (http->draining) request->close = true;
    struct MHD_Response *response = response_of(client);
    if (!response) return MHD_NO;
    struct request_header headers[REQUEST_HEADERS_MAX];
    size_t count = request_headers(request, headers);
    enum MHD_Result result = MHD_YES;
    for (size_t i = 0; i < count && result == MHD_YES; i++)
        result = MHD_add_response_header(response, headers[i].name, headers[i].value);
    if (result == MHD_YES)
        result =
            MHD_queue_response(client->connection, (unsigned)request->response.status, response);
    MHD_destroy_response(response);
    client->phase = CLIENT_ANSWER;
    client->deadline_us = sending_deadline(
        http, http->now_us, request->response.stream ? REQUEST_BLOCK : request->response.body_size);
    return result; /* MHD_NO, for want of memory, closes the connection */
}

/* The answer is settled in the middle of an upload: send it now, let the client read it. */
static enum MHD_Result answer_raw(struct http *http, struct client *client)
{
    request_drop_body(&client->request, &http->budget);
    client->request.close = true;
    request_send_raw(&client->request, client->fd);
    client->raw = true;
    client->phase = CLIENT_DROP;
    client->deadline_us = clock_us() + LINGER_US;
    return MHD_YES;
}

/* The answer is settled before the body has been read. */
static enum MHD_Result answer_early(struct http *http, struct client *client,
                                    const struct head *head)
{
    if (head->fault || head->expects_continue) return answer(http, client);
    if (head->chunked || head->length > DROP_BODY_MAX) return answer_raw(http, client);
    client->phase = CLIENT_DROP;
    return MHD_YES;
}

/* ---- Requests ------------------------------------------------------------------------------ */

/* Called with the request line, before libmicrohttpd decodes it in place. */
static void *on_target(void *user, const char *target, struct MHD_Connection *connection)
{
    struct http *http = user;
    struct client *client =
        MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT)->socket_context;
    if (!client || !target) return NULL;
    if (!request_start(&client->request, target, http->now_us)) return NULL;
    client->request.site = http->config.site;
    head_note_target(&client->line, target);
    client->phase = CLIENT_HEADERS;
    client->deadline_us = http->now_us + seconds(http->options->header_timeout);
    gauge(http, METRIC_ACTIVE, ++http->active_count);
    return client;
}

static bool cors_allows(const struct http *http, const char *origin)
{
    const char *allowed = http->options->cors;
    return origin && *allowed && (!strcmp(allowed, "*") || !strcmp(allowed, origin));
}

/* So many of its long requests are waiting or running that others would starve. */
static bool has_too_many(const struct http *http, const struct client *client)
{
    const size_t allowed = (size_t)http->options->per_client;
    size_t count = 0;
    if (!allowed || !client_has_address(client)) return false;
    for (size_t i = 0; i < http->working_count; i++)
        count += !memcmp(http->working[i]->address, client->address, sizeof client->address);
    return count >= allowed;
}

static enum MHD_Result answer_now(struct http *http, struct client *client)
{
    request_run(&client->request);
    request_tag(&client->request, client_header(client, "If-None-Match"));
    return answer(http, client);
}

static enum MHD_Result dispatch(struct http *http, struct client *client)
{
    struct request *request = &client->request;
    request->received_us = clock_us();
    if (!http->pool || request_is_short(request)) return answer_now(http, client);
    request->deadline_us = request->received_us + seconds(http->options->deadline);
    if (has_too_many(http, client)) {
        request_refuse(request, 429, "this address has too many long requests running");
        return answer(http, client);
    }
    request->was_queued = true; /* before, as the worker reads it */
    request->crew = http->pool;
    if (!pool_submit(http->pool, &request->job)) {
        request->was_queued = false;
        request->crew = NULL;
        request_refuse(request, 503, "all workers are busy and the queue is full");
        return answer(http, client);
    }
    wait_for_worker(http, client);
    return MHD_YES;
}

/* What the head alone decides; true if the request is refused or answered. */
static bool settle_by_head(struct http *http, struct client *client, const struct head *head)
{
    struct request *request = &client->request;
    const char *method = request->method;
    if (head->fault) {
        request->close = true;
        request_refuse(request, 400, head->fault);
        return true;
    }
    if (strlen(request->path) + strlen(request->query) > REQUEST_TARGET_MAX) {
        request_refuse(request, 414, "the request line is too long");
        return true;
    }
    if (request->cors && !strcmp(method, "OPTIONS")) {
        request->response.status = 204;
        return true;
    }
    if (http->config.token && !site_is_open(request->site, request->path) &&
        !token_matches(http->config.token, client_header(client, "Authorization"))) {
        request_refuse(request, 401, "this asks for the header Authorization: Bearer TOKEN");
        return true;
    }
    request->route = site_lookup(request->site, strcmp(method, "HEAD") ? method : "GET",
                                 request->path, request->content_type);
    if (!request->route.found) {
        request_run(request);
        return true;
    }
    if (head->length > request->route.body_max) {
        request_refuse(request, 413, "the body is larger than this endpoint takes");
        return true;
    }
    return false;
}

/* The headers are complete. */
static enum MHD_Result begin(struct http *http, struct client *client, const char *method,
                             const char *version)
{
    struct request *request = &client->request;
    client->line.method = method;
    client->line.version = version;
    const struct head head = head_read(client->connection, &client->line);
    snprintf(request->method, sizeof request->method, "%s", method);
    request_set_id(request, client_header(client, "X-Request-Id"), &http->random_state);
    request_set_trace(request, client_header(client, "traceparent"));
    request->content_type = client_header(client, "Content-Type");
    request->accept = client_header(client, "Accept");
    request->accept_encoding = client_header(client, "Accept-Encoding");
    request->body_expected = head.length;
    client->deadline_us = http->now_us + seconds(http->options->header_timeout);
    if (cors_allows(http, client_header(client, "Origin"))) request->cors = http->options->cors;
    if (settle_by_head(http, client, &head)) return answer_early(http, client, &head);
    client->phase = CLIENT_BODY;
    return MHD_YES;
}

static enum MHD_Result collect(struct http *http, struct client *client, const char *data,
                               size_t size)
{
    struct request *request = &client->request;
    if (client->phase == CLIENT_DROP) return MHD_YES;
    client_extend(client, size, http->options->min_rate, seconds(http->options->header_timeout));
    switch (request_add_body(request, data, size, &http->budget)) {
    case BODY_OK:
        return MHD_YES;
    case BODY_TOO_LARGE:
        request_refuse(request, 413, "the body is larger than this endpoint takes");
        break;
    case BODY_NO_MEMORY:
        request_refuse(request, 503, "too many bodies are being received");
        break;
    }
    return answer_raw(http, client);
}

static enum MHD_Result on_request(void *user, struct MHD_Connection *connection, const char *url,
                                  const char *method, const char *version, const char *data,
                                  size_t *size, void **context)
{
    struct http *http = user;
    struct client *client = *context;
    (void)connection, (void)url;
    if (!client) return MHD_NO;
    if (client->phase == CLIENT_HEADERS) return begin(http, client, method, version);
    if (*size) {
        size_t arrived = *size;
        *size = 0;
        return collect(http, client, data, arrived);
    }
    if (client->raw) return MHD_NO; /* answered; the whole upload has come: close */
    if (client->phase == CLIENT_DROP) return answer(http, client);
    if (client->phase == CLIENT_BODY) return dispatch(http, client);
    if (atomic_load(&client->request.gone)) return MHD_NO;
    return answer(http, client); /* back from the worker */
}

static const char *end_text(const struct client *client, enum MHD_RequestTerminationCode code)
{
    if (client->cut) return "cut";
    if (client->request.gone) return "gone";
    if (client->raw) return "refused";
    switch (code) {
    case MHD_REQUEST_TERMINATED_COMPLETED_OK:
        return "ok";
    case MHD_REQUEST_TERMINATED_TIMEOUT_REACHED:
        return "timeout";
    case MHD_REQUEST_TERMINATED_DAEMON_SHUTDOWN:
        return "shutdown";
    case MHD_REQUEST_TERMINATED_CLIENT_ABORT:
        return "aborted";
    case MHD_REQUEST_TERMINATED_READ_ERROR:
        return "aborted";
    case MHD_REQUEST_TERMINATED_WITH_ERROR:
        break;
    }
    return "error";
}

static void on_completed(void *user, struct MHD_Connection *connection, void **context,
                         enum MHD_RequestTerminationCode code)
{
    struct http *http = user;
    struct client *client = *context;
    (void)connection;
    if (!client) return;
    *context = NULL;
    client->request.done_us = clock_us();
    metrics_request(&client->request, client->request.gone);
    if (http->config.site == SITE_MAIN) request_log(&client->request, end_text(client, code));
    request_clear(&client->request, &http->budget);
    gauge(http, METRIC_ACTIVE, --http->active_count);
    gauge(http, METRIC_BODY_MEMORY, http->budget.used);
    client->phase = CLIENT_IDLE;
    client->used = true;
    client->deadline_us = http->now_us + seconds(http->options->timeout);
}

/* ---- Called by the loop -------------------------------------------------------------------- */

static struct client *client_of(struct pool_job *job)
{
    return (struct client *)job; /* job is the first member of request, request that of client */
}

void http_collect(struct http *http)
{
    struct pool_job *job;
    while (http->pool && (job = pool_collect(http->pool))) {
        struct client *client = client_of(job);
        stop_working(http, client);
        if (client->request.response.stream && client->request.block) { /* in the middle of it */
            client->phase = CLIENT_ANSWER;
            client->deadline_us = sending_deadline(http, clock_us(), REQUEST_BLOCK);
        }
        MHD_resume_connection(client->connection);
    }
}

size_t http_watch(const struct http *http, struct pollfd *fds)
{
    for (size_t i = 0; i < http->working_count; i++) {
        const struct client *client = http->working[i];
        fds[i].fd = atomic_load(&client->request.gone) ? -1 : client->fd; /* -1: poll skips it */
        fds[i].events = POLLRDHUP;
        fds[i].revents = 0;
    }
    return http->working_count;
}

static void cancel(struct http *http, struct client *client)
{
    atomic_store(&client->request.gone, true);
    metrics_add(METRIC_CANCELLED, 1);
    if (!pool_withdraw(http->pool, &client->request.job)) return; /* http_collect will resume it */
    stop_working(http, client);
    MHD_resume_connection(client->connection);
}

/* Downwards, because stop_working moves the last client into the place that becomes free. */
void http_watched(struct http *http, const struct pollfd *fds, size_t count)
{
    for (size_t i = count; i-- > 0;)
        if (fds[i].fd >= 0 && fds[i].revents) cancel(http, http->working[i]);
}

void http_cancel(struct http *http)
{
    for (size_t i = http->working_count; i-- > 0;) cancel(http, http->working[i]);
}

/* A client that ended in the middle of its request; libmicrohttpd would wait for the rest. */
static bool has_left(const struct client *client)
{
    char byte;
    return (client->phase == CLIENT_HEADERS || client->phase == CLIENT_BODY) && !client->cut &&
           recv(client->fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT) == 0;
}

void http_reap(struct http *http)
{
    int64_t now = clock_us();
    for (struct client *client = http->clients; client; client = client->next) {
        if (now > client->deadline_us)
            client_cut(client, true);
        else if (has_left(client))
            client_cut(client, false);
    }
}

int http_fd(const struct http *http)
{
    return http->epoll_fd;
}

int http_timeout_ms(const struct http *http)
{
    MHD_UNSIGNED_LONG_LONG ms;
    if (MHD_get_timeout(http->daemon, &ms) != MHD_YES) return -1;
    return ms < 60000 ? (int)ms : 60000;
}

void http_turn(struct http *http)
{
    enum { RUNS = 8 }; /* a body comes in pieces of a few KB: not a poll for each */
    http->now_us = clock_us();
    MHD_run(http->daemon);
    for (int i = 1; i < RUNS && !http_timeout_ms(http); i++) MHD_run(http->daemon);
}

bool http_is_full(const struct http *http)
{
    return http->client_count >= http->config.max_connections;
}

void http_add(struct http *http, int fd, const struct sockaddr *peer, socklen_t length)
{
    /* It closes the socket when it fails, for want of memory or a descriptor. */
    if (MHD_add_connection(http->daemon, fd, peer, length) == MHD_YES)
        metrics_add(METRIC_CONNECTIONS_TOTAL, 1);
}

size_t http_connections(const struct http *http)
{
    return http->client_count;
}

size_t http_active(const struct http *http)
{
    return http->active_count;
}

/* ---- Begin and end ------------------------------------------------------------------------- */

/* Called when libmicrohttpd finds itself broken; it aborts after this. */
static void on_panic(void *user, const char *file, unsigned line, const char *reason)
{
    (void)user;
    log_line("event=panic file=%s line=%u reason=\"%s\"", file, line, reason ? reason : "");
    log_flush();
    _exit(70); /* EX_SOFTWARE */
}

static bool start_daemon(struct http *http)
{
    enum { SLACK = 64 }; /* closed connections that libmicrohttpd still counts */
    const struct options *options = http->options;
    MHD_set_panic_func(on_panic, NULL);
    http->daemon = MHD_start_daemon(
        MHD_USE_EPOLL | MHD_USE_ITC | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_NO_LISTEN_SOCKET, 0, NULL,
        NULL, on_request, http, MHD_OPTION_CONNECTION_LIMIT,
        (unsigned)(http->config.max_connections + SLACK), MHD_OPTION_CONNECTION_TIMEOUT,
        (unsigned)options->timeout, MHD_OPTION_CONNECTION_MEMORY_LIMIT, (size_t)CONNECTION_MEMORY,
        MHD_OPTION_CONNECTION_MEMORY_INCREMENT, (size_t)MEMORY_INCREMENT,
        MHD_OPTION_SIGPIPE_HANDLED_BY_APP, 1, MHD_OPTION_NOTIFY_CONNECTION, on_connection, http,
        MHD_OPTION_URI_LOG_CALLBACK, on_target, http, MHD_OPTION_NOTIFY_COMPLETED, on_completed,
        http, MHD_OPTION_STRICT_FOR_CLIENT, STRICTNESS, MHD_OPTION_END);
    if (!http->daemon) return false;
    const union MHD_DaemonInfo *info = MHD_get_daemon_info(http->daemon, MHD_DAEMON_INFO_EPOLL_FD);
    if (!info) return false;
    http->epoll_fd = info->epoll_fd;
    return true;
}

struct http *http_create(const struct http_config *config)
{
    const struct options *options = config->options;
    struct http *http = calloc(1, sizeof *http);
    if (!http) {
        fputs("facetd: out of memory\n", stderr);
        return NULL;
    }
    http->config = *config;
    http->options = options;
    http->pool = config->pool;
    http->budget.max = (size_t)options->body_memory << 20;
    http->working = calloc((size_t)(options->workers + options->queue), sizeof *http->working);
    /* Ids need to differ, not to be secret: the clock and an address do if the kernel has none. */
    if (getrandom(&http->random_state, sizeof http->random_state, GRND_NONBLOCK) < 0)
        http->random_state = (uint64_t)clock_us() ^ (uint64_t)(uintptr_t)http;
    gauge(http, METRIC_QUEUE_MAX, (size_t)(options->workers + options->queue));
    gauge(http, METRIC_WORKERS, (size_t)options->workers);
    gauge(http, METRIC_BODY_MEMORY_MAX, http->budget.max);
    if (!http->working || !start_daemon(http)) {
        fputs("facetd: cannot start the HTTP server: out of memory or descriptors\n", stderr);
        http_destroy(http);
        return NULL;
    }
    return http;
}

void http_quiesce(struct http *http)
{
    http->draining = true;
    gauge(http, METRIC_DRAINING, 1);
    for (struct client *client = http->clients; client; client = client->next)
        if (client->phase == CLIENT_IDLE) client_cut(client, false);
}

void http_destroy(struct http *http)
{
    if (!http) return;
    if (http->daemon) MHD_stop_daemon(http->daemon);
    free(http->working);
    free(http);
}
