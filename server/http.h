/*
 * http.h - connections and requests on libmicrohttpd, driven by a poll loop of ours (loop.c).
 *
 * libmicrohttpd's own epoll loop stalls when a multiple of 128 connections is ready at once, so
 * the daemon runs without a thread: everything here belongs to one network thread.
 */
#ifndef HTTP_H
#define HTTP_H

#include "options.h"
#include "pool.h"
#include "site.h"

#include <poll.h>
#include <stdbool.h>
#include <stddef.h>
#include <sys/socket.h>

struct http;

struct http_config {
    const struct options *options;
    struct pool *pool; /* NULL: everything is answered on the network thread */
    const char *token; /* that requests must carry; NULL: none */
    enum site site;
    size_t max_connections;
};

/* NULL, with a message on stderr, if there is no memory or no descriptor left. */
struct http *http_create(const struct http_config *config);

/* Takes over an accepted, non-blocking socket, even if there is no memory left for it. */
void http_add(struct http *http, int fd, const struct sockaddr *peer, socklen_t length);
bool http_is_full(const struct http *http);

enum { HTTP_SIDES = 2 };

/* Fills fds with what to poll, for http_turn; which has work after at most so many ms (-1: for ever) too. */
void http_poll(const struct http *http, struct pollfd fds[HTTP_SIDES]);
int http_timeout_ms(const struct http *http);
void http_turn(struct http *http, const struct pollfd fds[HTTP_SIDES]);

/* Resumes the requests whose jobs are done.  Call http_turn afterwards. */
void http_collect(struct http *http);

/*
 * libmicrohttpd does not look at the sockets of requests that wait for a worker.  Fills fds with
 * them (room for workers + queue); http_watched takes the array back after poll and cancels the
 * requests whose client left.
 */
size_t http_watch(const struct http *http, struct pollfd *fds);
void http_watched(struct http *http, const struct pollfd *fds, size_t count);

/* Cuts the clients that are too slow; cheap, to be called a few times a second. */
void http_reap(struct http *http);

/* Closes the idle connections; running requests go on, and their connections end with them. */
void http_quiesce(struct http *http);
/* Tells all long requests to stop and closes every connection, answered or not. */
void http_cancel(struct http *http);

size_t http_connections(const struct http *http);
size_t http_active(const struct http *http); /* requests begun and not answered */

/* Nothing may be active.  NULL is fine. */
void http_destroy(struct http *http);

#endif
