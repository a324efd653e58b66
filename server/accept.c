#define _GNU_SOURCE /* accept4 */
#include "accept.h"

#include "clock.h"
#include "log.h"
#include "metrics.h"
#include "request.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { LINGER_US = 1000000, ONE_TURN = 64 /* clients at a time: then the loop has other work */ };

size_t accept_watch(const struct acceptor *acceptor, struct pollfd *fds)
{
    const struct listeners *listeners = acceptor->listeners;
    for (size_t i = 0; i < listeners->count; i++) {
        fds[i].fd = acceptor->paused ? -1 : listeners->list[i].fd; /* -1: poll skips it */
        fds[i].events = POLLIN;
        fds[i].revents = 0;
    }
    return listeners->count;
}

static void close_oldest(struct acceptor *acceptor)
{
    close(acceptor->refused[acceptor->start].fd);
    acceptor->start = (acceptor->start + 1) % ACCEPT_LINGER_MAX;
    acceptor->count--;
}

size_t accept_tick(struct acceptor *acceptor)
{
    int64_t now = clock_us();
    acceptor->paused = false;
    while (acceptor->count && acceptor->refused[acceptor->start].until_us <= now)
        close_oldest(acceptor);
    return acceptor->count;
}

void accept_end(struct acceptor *acceptor)
{
    while (acceptor->count) close_oldest(acceptor);
}

static void refuse(struct acceptor *acceptor, int client)
{
    request_send_refusal(client, 503, "too many connections");
    if (acceptor->count == ACCEPT_LINGER_MAX) close_oldest(acceptor);
    size_t end = (acceptor->start + acceptor->count++) % ACCEPT_LINGER_MAX;
    acceptor->refused[end].fd = client;
    acceptor->refused[end].until_us = clock_us() + LINGER_US;
    metrics_add(METRIC_REFUSED_CONNECTIONS, 1);
}

/* Errors of one client's connection, which accept(2) asks to be passed over. */
static bool is_passing(int error)
{
    return error == EINTR || error == ECONNABORTED || error == EPROTO || error == EPERM ||
           error == ENETDOWN || error == EHOSTDOWN || error == EHOSTUNREACH ||
           error == ENETUNREACH || error == ENOPROTOOPT || error == EOPNOTSUPP || error == ENONET;
}

static void accept_from(struct acceptor *acceptor, int fd)
{
    int refused = 0;
    for (int i = 0; i < ONE_TURN; i++) {
        struct sockaddr_storage peer;
        socklen_t length = sizeof peer;
        int client = accept4(fd, (struct sockaddr *)&peer, &length, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (client < 0 && is_passing(errno)) continue;
        if (client < 0) {
            if (errno == EAGAIN || errno == EWOULDBLOCK) break;
            log_line("event=failure call=accept reason=\"%s\"", strerror(errno));
            acceptor->paused = true;
            break;
        }
        if (http_is_full(acceptor->http)) {
            refuse(acceptor, client);
            refused++;
        } else {
            http_add(acceptor->http, client, (struct sockaddr *)&peer, length);
        }
    }
    if (refused) log_line("event=refused connections=%d reason=\"too many connections\"", refused);
}

void accept_watched(struct acceptor *acceptor, const struct pollfd *fds, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (fds[i].fd >= 0 && fds[i].revents) accept_from(acceptor, fds[i].fd);
}
