/*
 * http_state.h - what the files behind http.h share: http.c (connections, the daemon's begin and
 * end), exchange.c (a request from its first line to its log line), answer.c (how answers go out) and
 * waiting.c (the requests that workers have).  One network thread owns it all.
 */
#ifndef HTTP_STATE_H
#define HTTP_STATE_H

#include "client.h"
#include "http.h"
#include "metrics.h"

#include <microhttpd.h>

/*
 * libmicrohttpd gives a connection one memory for all its life: it reads bodies into half of it, and zeroes
 * all of it after each answer.  So there are two of it: with little for most, and with much for those
 * connections whose first request announces a large body.
 */
enum http_side { HTTP_PLAIN, HTTP_UPLOADS };

struct http {
    struct http_config config;
    const struct options *options;
    struct pool *pool;
    struct MHD_Daemon *daemons[HTTP_SIDES];
    int epoll_fds[HTTP_SIDES];
    int ends_fd;  /* epoll: which clients have ended their side (client->ended) */
    bool stirred; /* a connection was added or resumed since the last turn */
    bool draining;
    size_t received;        /* bytes of bodies, in this turn */
    struct client *clients; /* all */
    struct request *spare;  /* the last that ended, clear: its memory is in the cache; or NULL */
    size_t client_count, active_count;
    struct client **working; /* those that wait for a worker */
    size_t working_count;
    int64_t now_us; /* when this turn began: one look at the clock for all its requests */
    struct body_budget budget;
    uint64_t random_state;
};

/* Gauges are the main listener's. */
static inline void http_gauge(const struct http *http, enum metric metric, size_t value)
{
    if (http->config.site == SITE_MAIN) metrics_set(metric, (long long)value);
}

static inline int64_t seconds(long s)
{
    return (int64_t)s * 1000000;
}

#endif
