/*
 * http.h - connections and requests on libmicrohttpd, driven by a poll loop of ours (loop.c).
 *
 * libmicrohttpd's own epoll loop stalls when a multiple of 128 connections is ready at once, so
 * the daemon runs without a thread: everything here belongs to the network thread.
 */
#ifndef HTTP_H
#define HTTP_H

#include "options.h"
#include "pool.h"

#include <poll.h>
#include <stdbool.h>
#include <stddef.h>

struct http;

/* Takes over the listening socket, even on failure (NULL, with a message on stderr). */
struct http *http_create(const struct options *options, int listen_fd, struct pool *pool);

/* What to poll: readable means http_turn has work; and after at most so many ms (-1: for ever). */
int http_fd(const struct http *http);
int http_timeout_ms(const struct http *http);
void http_turn(struct http *http);

/* The listening socket when all connections are taken, else -1. */
int http_overflow_fd(const struct http *http);

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

/* Closes the listening socket and the idle connections; running requests go on. */
void http_quiesce(struct http *http);
/* Tells all long requests to stop; their connections are closed without an answer. */
void http_cancel(struct http *http);

size_t http_connections(const struct http *http);
size_t http_active(const struct http *http); /* requests begun and not answered */

/* Nothing may be active.  NULL is fine. */
void http_destroy(struct http *http);

#endif
