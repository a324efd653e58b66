#include "listen.h"

#include "systemd.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

enum { BACKLOG = 4096, ADDRESS_MAX = 64, PORT_MAX = 8 };

static bool complain(const char *what, const char *why)
{
    fprintf(stderr, "facetd: cannot listen on %s: %s\n", what, why);
    return false;
}

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

static int open_tcp(const char *address, unsigned short port)
{
    char service[PORT_MAX];
    snprintf(service, sizeof service, "%hu", port);
    const struct addrinfo hints = {.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE,
                                   .ai_socktype = SOCK_STREAM};
    struct addrinfo *info;
    int error = getaddrinfo(address, service, &hints, &info);
    if (error) {
        complain(address, error == EAI_SYSTEM ? strerror(errno)
                          : error == EAI_NONAME
                              ? "the address must be a number, as 127.0.0.1 or ::1"
                              : gai_strerror(error));
        return -1;
    }
    int fd = open_on(info);
    if (fd < 0)
        fprintf(stderr, "facetd: cannot listen on %s port %hu: %s\n", address, port,
                strerror(errno));
    freeaddrinfo(info);
    return fd;
}

/* A socket that nobody listens on any more was left by a daemon that was killed. */
static bool is_stale(const struct sockaddr_un *address)
{
    struct stat st;
    if (lstat(address->sun_path, &st) || !S_ISSOCK(st.st_mode)) return false;
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return false;
    bool stale = connect(fd, (const struct sockaddr *)address, sizeof *address) < 0 &&
                 errno == ECONNREFUSED;
    close(fd);
    return stale;
}

static int open_unix(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof address.sun_path) {
        complain(path, "the path of a unix socket has at most 107 bytes");
        return -1;
    }
    memcpy(address.sun_path, path, strlen(path));
    if (is_stale(&address)) unlink(path);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd >= 0 && !bind(fd, (const struct sockaddr *)&address, sizeof address)) {
        if (!listen(fd, BACKLOG)) return fd;
        unlink(path);
    }
    complain(path, strerror(errno));
    if (fd >= 0) close(fd);
    return -1;
}

/*
 * Connections come with their first bytes, or after a second without: then what they begin with can be
 * seen (http_add), and those that send nothing cost nothing here.  Unix sockets have no such thing.
 */
static void wait_for_data(int fd)
{
    const int seconds = 1;
    (void)setsockopt(fd, IPPROTO_TCP, TCP_DEFER_ACCEPT, &seconds, sizeof seconds);
}

/* The name of an open socket; false with a message. */
static bool name_of(int fd, char *name)
{
    struct sockaddr_storage address = {0};
    socklen_t length = sizeof address;
    char host[ADDRESS_MAX], port[PORT_MAX];
    if (getsockname(fd, (struct sockaddr *)&address, &length))
        return complain("a socket", strerror(errno));
    if (address.ss_family == AF_UNIX) {
        snprintf(name, LISTEN_NAME_MAX, "unix:%s", ((struct sockaddr_un *)&address)->sun_path);
        return true;
    }
    int error = getnameinfo((struct sockaddr *)&address, length, host, sizeof host, port,
                            sizeof port, NI_NUMERICHOST | NI_NUMERICSERV);
    if (error) return complain("a socket", gai_strerror(error));
    const bool brackets = strchr(host, ':');
    snprintf(name, LISTEN_NAME_MAX, "http://%s%s%s:%s", brackets ? "[" : "", host,
             brackets ? "]" : "", port);
    return true;
}

static bool add(struct listeners *to, int fd, const char *path)
{
    if (fd < 0) return false;
    if (to->count == LISTEN_MAX) {
        close(fd);
        return complain("a socket", "there are too many");
    }
    struct listener *new = &to->list[to->count++];
    new->fd = fd;
    new->path = path;
    return name_of(fd, new->name);
}

static bool add_admin(const char *where, struct listeners *admin)
{
    char address[ADDRESS_MAX];
    unsigned short port;
    if (strchr(where, '/')) return add(admin, open_unix(where), where);
    if (listen_split(where, address, sizeof address, &port))
        return add(admin, open_tcp(address, port), NULL);
    fprintf(stderr, "facetd: --admin takes ADDRESS:PORT or the path of a unix socket, not \"%s\"\n",
            where);
    return false;
}

bool listen_split(const char *text, char *address, size_t size, unsigned short *port)
{
    const char *colon = strrchr(text, ':');
    char *end;
    if (!colon || colon == text || !colon[1]) return false;
    size_t n = (size_t)(colon - text);
    if (*text == '[' && colon[-1] == ']') {
        text++;
        n -= 2;
    } else if (memchr(text, ':', n)) {
        return false; /* an IPv6 address stands in brackets */
    }
    errno = 0;
    unsigned long number = strtoul(colon + 1, &end, 10);
    if (*end || errno || number > 65535 || n >= size) return false;
    memcpy(address, text, n);
    address[n] = 0;
    *port = (unsigned short)number;
    return true;
}

static bool take_passed(struct listeners *main_ones, struct listeners *admin)
{
    const char *name;
    int fd;
    for (int i = 0; (fd = systemd_socket(i, &name)) >= 0; i++) {
        int flags = fcntl(fd, F_GETFL);
        if (flags < 0 || fcntl(fd, F_SETFL, flags | O_NONBLOCK) || fcntl(fd, F_SETFD, FD_CLOEXEC))
            return complain("a passed socket", strerror(errno));
        if (!add(strcmp(name, "admin") ? main_ones : admin, fd, NULL)) return false;
    }
    return true;
}

bool listeners_open(const struct options *options, struct listeners *main_ones,
                    struct listeners *admin)
{
    if (!take_passed(main_ones, admin)) return false;
    if (!main_ones->count && *options->bind &&
        !add(main_ones, open_tcp(options->bind, (unsigned short)options->port), NULL))
        return false;
    if (*options->socket && !add(main_ones, open_unix(options->socket), options->socket))
        return false;
    if (!admin->count && *options->admin && !add_admin(options->admin, admin)) return false;
    for (size_t i = 0; i < main_ones->count; i++) wait_for_data(main_ones->list[i].fd);
    if (main_ones->count) return true;
    fputs("facetd: nowhere to listen: neither --bind nor --socket\n", stderr);
    return false;
}

void listeners_close(struct listeners *listeners)
{
    for (size_t i = 0; i < listeners->count; i++) {
        close(listeners->list[i].fd);
        if (listeners->list[i].path) unlink(listeners->list[i].path);
    }
    listeners->count = 0;
}
