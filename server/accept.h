/*
 * accept.h - takes clients in, and says a polite no to those beyond the limit.
 *
 * libmicrohttpd would leave them in the backlog, where they hang; and it knows one listening socket.
 */
#ifndef ACCEPT_H
#define ACCEPT_H

#include "http.h"
#include "listen.h"

#include <poll.h>

enum { ACCEPT_LINGER_MAX = 64 }; /* descriptors that refused clients may hold */

struct acceptor {
    struct http *http;
    struct listeners *listeners;
    bool paused; /* out of descriptors or memory: until accept_tick */
    struct {
        int fd;
        int64_t until_us;
    } refused[ACCEPT_LINGER_MAX]; /* a ring, oldest first from `start` */
    size_t start, count;
};

/* Fills fds (room for LISTEN_MAX) with what to poll; the number. */
size_t accept_watch(const struct acceptor *acceptor, struct pollfd *fds);
void accept_watched(struct acceptor *acceptor, const struct pollfd *fds, size_t count);

/*
 * To be called a few times a second: tries again after a failure, and closes the clients that were
 * refused more than a second ago (at once would reset what they have not read).  How many are left.
 */
size_t accept_tick(struct acceptor *acceptor);

/* Closes all refused clients. */
void accept_end(struct acceptor *acceptor);

#endif
