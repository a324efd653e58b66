#include "health.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

/* The address to ask for one that may be "all": the loopback of the same family; without one the
 * unix socket. */
static socklen_t address_of(const struct options *options, struct sockaddr_storage *to)
{
    struct sockaddr_in *v4 = (struct sockaddr_in *)to;
    struct sockaddr_in6 *v6 = (struct sockaddr_in6 *)to;
    struct sockaddr_un *path = (struct sockaddr_un *)to;
    memset(to, 0, sizeof *to);
    if (!*options->bind && *options->socket) {
        path->sun_family = AF_UNIX;
        if (strlen(options->socket) >= sizeof path->sun_path) return 0;
        memcpy(path->sun_path, options->socket, strlen(options->socket));
        return sizeof *path;
    }
    if (inet_pton(AF_INET, options->bind, &v4->sin_addr) == 1) {
        if (v4->sin_addr.s_addr == htonl(INADDR_ANY)) v4->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        v4->sin_family = AF_INET;
        v4->sin_port = htons((unsigned short)options->port);
        return sizeof *v4;
    }
    if (inet_pton(AF_INET6, options->bind, &v6->sin6_addr) == 1) {
        if (IN6_IS_ADDR_UNSPECIFIED(&v6->sin6_addr)) v6->sin6_addr = in6addr_loopback;
        v6->sin6_family = AF_INET6;
        v6->sin6_port = htons((unsigned short)options->port);
        return sizeof *v6;
    }
    return 0;
}

static bool ask(int fd, const struct sockaddr_storage *address, socklen_t length)
{
    static const char request[] =
        "GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    static const char well[] = "HTTP/1.1 200 ";
    const struct timeval limit = {.tv_sec = 2};
    char answer[sizeof well - 1];
    return !setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit) &&
           !setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit) &&
           !connect(fd, (const struct sockaddr *)address, length) &&
           send(fd, request, sizeof request - 1, MSG_NOSIGNAL) == sizeof request - 1 &&
           recv(fd, answer, sizeof answer, MSG_WAITALL) == sizeof answer &&
           !memcmp(answer, well, sizeof answer);
}

int health_check(const struct options *options)
{
    struct sockaddr_storage address;
    socklen_t length = address_of(options, &address);
    errno = 0;
    int fd = length ? socket(address.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0) : -1;
    bool well = fd >= 0 && ask(fd, &address, length);
    if (!well)
        fprintf(stderr, "facetd: no healthy answer from %s port %ld: %s\n", options->bind,
                options->port, errno ? strerror(errno) : "not 200");
    if (fd >= 0) close(fd);
    return well ? 0 : 1;
}
