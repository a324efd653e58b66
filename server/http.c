#define _GNU_SOURCE /* EPOLLRDHUP, strcasestr */
#include "exchange.h"

#include "clock.h"
#include "log.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <unistd.h>

enum {
    MEMORY_INCREMENT = 8192,
    UPLOAD_MEMORY = 131072, /* half of it read at a time: more gains little */
    UPLOADS_MAX = 256       /* connections that may have it */
};

/*
 * 0.9.75: our own look at the head (head.c) is stricter than its strictness, and answers with a
 * problem where it would just close.  Later versions have levels.
 */
#define STRICTNESS (MHD_VERSION < 0x00097600 ? 0 : 1)

/* ---- Connections --------------------------------------------------------------------------- */

static void on_connection(void *user, struct MHD_Connection *connection, void **context,
                          enum MHD_ConnectionNotificationCode code)
{
    struct http *http = user;
    struct client *client = *context;
    if (code == MHD_CONNECTION_NOTIFY_CLOSED) {
        if (!client) return;
        /* A query that it has no memory for: libmicrohttpd closes, and tells nobody that the
         * request ended. */
        if (client->phase != CLIENT_IDLE)
            exchange_end(http, connection, &(void *){client}, MHD_REQUEST_TERMINATED_WITH_ERROR);
        *(client->previous ? &client->previous->next : &http->clients) = client->next;
        if (client->next) client->next->previous = client->previous;
        http->client_count--;
        http_gauge(http, METRIC_CONNECTIONS, http->client_count);
        free(client);
        return;
    }
    client = calloc(1, sizeof *client);
    *context = client; /* NULL: exchange_step closes it */
    if (!client) return;
    client->http = http;
    client->connection = connection;
    client->fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
    client->deadline_us = clock_us() + seconds(http->options->header_timeout); /* between turns */
    client->next = http->clients;
    if (client->next) client->next->previous = client;
    http->clients = client;
    http->client_count++;
    http_gauge(http, METRIC_CONNECTIONS, http->client_count);
    const union MHD_ConnectionInfo *peer = MHD_get_connection_info(
        connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
    if (peer) client_set_address(client, peer->client_addr);
    struct epoll_event end = {.events = EPOLLRDHUP | EPOLLET, .data.ptr = client};
    epoll_ctl(http->ends_fd, EPOLL_CTL_ADD, client->fd, &end); /* else its deadline ends it */
    if (http->draining) client_cut(client, false);
}

/* ---- Called by the loop -------------------------------------------------------------------- */

/*
 * libmicrohttpd does not see a client's end that came together with its last bytes: having read
 * those it waits for the rest of the request.
 */
static void note_ends(struct http *http)
{
    struct epoll_event ends[64];
    int n;
    do {
        n = epoll_wait(http->ends_fd, ends, sizeof ends / sizeof *ends, 0);
        for (int i = 0; i < n; i++) ((struct client *)ends[i].data.ptr)->ended = true;
    } while (n == sizeof ends / sizeof *ends);
}

/* In the middle of its request, all of which that it sent is read. */
static bool has_left(const struct client *client)
{
    char byte;
    return client->ended && client->phase <= CLIENT_BODY && !client->cut &&
           recv(client->fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT) == 0;
}

void http_reap(struct http *http)
{
    int64_t now = clock_us();
    note_ends(http);
    for (struct client *client = http->clients; client; client = client->next) {
        if (now > client->deadline_us)
            client_cut(client, true);
        else if (has_left(client))
            client_cut(client, false);
    }
}

void http_poll(const struct http *http, struct pollfd fds[HTTP_SIDES])
{
    for (int i = 0; i < HTTP_SIDES; i++) { /* -1, of a side that is not: poll skips it */
        fds[i] = (struct pollfd){.fd = http->epoll_fds[i], .events = POLLIN};
    }
}

/* Of one of the two. */
static int wait_ms(struct MHD_Daemon *daemon)
{
    MHD_UNSIGNED_LONG_LONG ms;
    if (!daemon || MHD_get_timeout(daemon, &ms) != MHD_YES) return -1;
    return ms < 60000 ? (int)ms : 60000;
}

int http_timeout_ms(const struct http *http)
{
    int plain = wait_ms(http->daemons[HTTP_PLAIN]), uploads = wait_ms(http->daemons[HTTP_UPLOADS]);
    return plain < 0 || (uploads >= 0 && uploads < plain) ? uploads : plain;
}

static void run(struct http *http, struct MHD_Daemon *daemon)
{
    enum { RUNS = 32, ENOUGH = 262144 /* bytes */ }; /* then others have their turn */
    http->received = 0;
    for (int i = 0; i < RUNS && http->received < ENOUGH; i++) {
        const size_t before = http->received;
        MHD_run(daemon);
        if (http->received == before) break; /* else more is there, as a rule */
    }
}

void http_turn(struct http *http, const struct pollfd fds[HTTP_SIDES])
{
    bool all = http->stirred;
    http->stirred = false;
    http->now_us = clock_us();
    for (int i = 0; i < HTTP_SIDES; i++) {
        struct MHD_Daemon *daemon = http->daemons[i];
        if (daemon && (all || fds[i].revents || !wait_ms(daemon))) run(http, daemon);
    }
}

bool http_is_full(const struct http *http)
{
    return http->client_count >= http->config.max_connections;
}

/* Whether what has come begins a request with a large body.  Nothing but speed hangs on it. */
static bool brings_much(int fd)
{
    enum { PEEK = 2048, MUCH = 65536 };
    static const char name[] = "\nContent-Length:";
    char head[PEEK];
    ssize_t n = recv(fd, head, sizeof head - 1, MSG_PEEK | MSG_DONTWAIT);
    if (n <= 0) return false;
    head[n] = 0;
    const char *length = strcasestr(head, name);
    return length && strtoull(length + sizeof name - 1, NULL, 10) >= MUCH;
}

static enum http_side side_of(const struct http *http, int fd)
{
    struct MHD_Daemon *uploads = http->daemons[HTTP_UPLOADS];
    if (!uploads || !brings_much(fd)) return HTTP_PLAIN;
    const union MHD_DaemonInfo *count = MHD_get_daemon_info(uploads,
                                                            MHD_DAEMON_INFO_CURRENT_CONNECTIONS);
    return count && count->num_connections < UPLOADS_MAX ? HTTP_UPLOADS : HTTP_PLAIN;
}

void http_add(struct http *http, int fd, const struct sockaddr *peer, socklen_t length)
{
    http->stirred = true;
    /* It closes the socket when it fails, for want of memory or a descriptor. */
    if (MHD_add_connection(http->daemons[side_of(http, fd)], fd, peer, length) == MHD_YES)
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

static bool start_daemon(struct http *http, enum http_side side, size_t memory, size_t connections)
{
    enum {
        SLACK = 64, /* closed connections that libmicrohttpd still counts */
        LATER_S = 5 /* its own timeout, which counts nothing, is there should http_reap fail */
    };
    const struct options *options = http->options;
    struct MHD_Daemon *daemon = MHD_start_daemon(
        MHD_USE_EPOLL | MHD_USE_ITC | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_NO_LISTEN_SOCKET, 0, NULL,
        NULL, exchange_step, http, MHD_OPTION_CONNECTION_LIMIT, (unsigned)(connections + SLACK),
        MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)options->timeout + LATER_S,
        MHD_OPTION_CONNECTION_MEMORY_LIMIT, memory, MHD_OPTION_CONNECTION_MEMORY_INCREMENT,
        (size_t)MEMORY_INCREMENT, MHD_OPTION_SIGPIPE_HANDLED_BY_APP, 1,
        MHD_OPTION_NOTIFY_CONNECTION, on_connection, http, MHD_OPTION_URI_LOG_CALLBACK,
        exchange_begin, http, MHD_OPTION_NOTIFY_COMPLETED, exchange_end, http,
        MHD_OPTION_STRICT_FOR_CLIENT, STRICTNESS, MHD_OPTION_END);
    http->daemons[side] = daemon;
    if (!daemon) return false;
    const union MHD_DaemonInfo *info = MHD_get_daemon_info(daemon, MHD_DAEMON_INFO_EPOLL_FD);
    if (!info) return false;
    http->epoll_fds[side] = info->epoll_fd;
    return true;
}

/* Nobody uploads to the admin listener. */
static bool start_daemons(struct http *http)
{
    const size_t most = http->config.max_connections;
    MHD_set_panic_func(on_panic, NULL);
    for (int i = 0; i < HTTP_SIDES; i++) http->epoll_fds[i] = -1;
    return start_daemon(http, HTTP_PLAIN, REQUEST_HEAD_MEMORY, most) &&
           (http->config.site != SITE_MAIN ||
            start_daemon(http, HTTP_UPLOADS, UPLOAD_MEMORY, UPLOADS_MAX));
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
    http_gauge(http, METRIC_QUEUE_MAX, (size_t)(options->workers + options->queue));
    http_gauge(http, METRIC_WORKERS, (size_t)options->workers);
    http_gauge(http, METRIC_BODY_MEMORY_MAX, http->budget.max);
    http->ends_fd = epoll_create1(EPOLL_CLOEXEC);
    if (!http->working || http->ends_fd < 0 || !start_daemons(http)) {
        fputs("facetd: cannot start the HTTP server: out of memory or descriptors\n", stderr);
        http_destroy(http);
        return NULL;
    }
    return http;
}

void http_quiesce(struct http *http)
{
    http->draining = true;
    http_gauge(http, METRIC_DRAINING, 1);
    for (struct client *client = http->clients; client; client = client->next)
        if (client->phase == CLIENT_IDLE) client_cut(client, false);
}

void http_destroy(struct http *http)
{
    if (!http) return;
    for (int i = 0; i < HTTP_SIDES; i++)
        if (http->daemons[i]) MHD_stop_daemon(http->daemons[i]);
    if (http->ends_fd >= 0) close(http->ends_fd);
    free(http->spare);
    free(http->working);
    free(http);
}
