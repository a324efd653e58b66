#define _GNU_SOURCE /* accept4 */
#include "listen.h"

#include "clock.h"
#include "log.h"
#include "request.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { BACKLOG = 1024, ADDRESS_MAX = 64, PORT_MAX = 8, LINGER_US = 1000000 };

static int open_on(const struct addrinfo *info)
{
    const int on = 1;
    int fd = socket(info->ai_family, info->ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) return -1;
    if (setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) ||
        bind(fd, info->ai_addr, info->ai_addrlen) || listen(fd, BACKLOG)) {
        int error = errno;
        close(fd);
        errno = error;
        return -1;
    }
    return fd;
}

int listen_open(const char *address, unsigned short port)
{
    char service[PORT_MAX];
    snprintf(service, sizeof service, "%hu", port);
    const struct addrinfo hints = {.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE,
                                   .ai_socktype = SOCK_STREAM};
    struct addrinfo *info;
    int error = getaddrinfo(address, service, &hints, &info);
    if (error) {
        fprintf(stderr, "facetd: cannot listen on \"%s\": %s\n", address,
                error == EAI_SYSTEM ? strerror(errno) : gai_strerror(error));
        return -1;
    }
    int fd = open_on(info);
    if (fd < 0)
        fprintf(stderr, "facetd: cannot listen on %s port %hu: %s\n", address, port,
                strerror(errno));
    freeaddrinfo(info);
    return fd;
}

bool listen_url(int fd, char *url, size_t size)
{
    struct sockaddr_storage address;
    socklen_t length = sizeof address;
    char host[ADDRESS_MAX], port[PORT_MAX];
    if (getsockname(fd, (struct sockaddr *)&address, &length)) {
        fprintf(stderr, "facetd: getsockname: %s\n", strerror(errno));
        return false;
    }
    int error = getnameinfo((struct sockaddr *)&address, length, host, sizeof host, port,
                            sizeof port, NI_NUMERICHOST | NI_NUMERICSERV);
    if (error) {
        fprintf(stderr, "facetd: getnameinfo: %s\n", gai_strerror(error));
        return false;
    }
    const bool brackets = strchr(host, ':');
    snprintf(url, size, "http://%s%s%s:%s", brackets ? "[" : "", host, brackets ? "]" : "", port);
    return true;
}

/* Refused clients, oldest first from `start`. */
static struct {
    struct {
        int fd;
        int64_t until_us;
    } ring[LISTEN_LINGER_MAX];
    size_t start, count;
} lingering;

static void close_oldest(void)
{
    close(lingering.ring[lingering.start].fd);
    lingering.start = (lingering.start + 1) % LISTEN_LINGER_MAX;
    lingering.count--;
}

size_t listen_linger(bool all)
{
    int64_t now = clock_us();
    while (lingering.count && (all || lingering.ring[lingering.start].until_us <= now))
        close_oldest();
    return lingering.count;
}

void listen_refuse(int fd)
{
    enum { ONE_TURN = 16 }; /* then the loop has other things to do */
    struct request refusal = {.close = true};
    struct body_budget none = {0, 0};
    int refused = 0, client;
    request_refuse(&refusal, 503, "too many connections");
    while (refused < ONE_TURN && (client = accept4(fd, NULL, NULL, SOCK_CLOEXEC)) >= 0) {
        request_send_raw(&refusal, client);
        if (lingering.count == LISTEN_LINGER_MAX) close_oldest();
        size_t end = (lingering.start + lingering.count++) % LISTEN_LINGER_MAX;
        lingering.ring[end].fd = client;
        lingering.ring[end].until_us = clock_us() + LINGER_US;
        refused++;
    }
    if (refused) log_line("event=refused connections=%d reason=\"too many connections\"", refused);
    request_clear(&refusal, &none);
}
