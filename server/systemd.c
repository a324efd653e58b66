#include "systemd.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum { FIRST_PASSED = 3, NAME_SIZE = 64 };

static int notify_fd = -1;

static long number(const char *variable)
{
    const char *text = getenv(variable);
    return text ? strtol(text, NULL, 10) : 0;
}

int systemd_socket(int index, const char **name)
{
    static char buffer[NAME_SIZE];
    const char *names = getenv("LISTEN_FDNAMES");
    *name = buffer;
    buffer[0] = 0;
    /* The variables may have been meant for the process that started this one. */
    if (number("LISTEN_PID") != (long)getpid() || index >= number("LISTEN_FDS")) return -1;
    for (int i = 0; names && i < index; i++) {
        names = strchr(names, ':');
        if (names) names++;
    }
    if (names) snprintf(buffer, sizeof buffer, "%.*s", (int)strcspn(names, ":"), names);
    return FIRST_PASSED + index;
}

void systemd_open(void)
{
    const char *path = getenv("NOTIFY_SOCKET");
    struct sockaddr_un to = {.sun_family = AF_UNIX};
    if (!path || (*path != '/' && *path != '@') || strlen(path) >= sizeof to.sun_path) return;
    memcpy(to.sun_path, path, strlen(path));
    if (*path == '@') to.sun_path[0] = 0; /* the abstract name space */
    notify_fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    socklen_t length = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + strlen(path));
    if (notify_fd >= 0 && connect(notify_fd, (struct sockaddr *)&to, length)) systemd_close();
}

void systemd_notify(const char *state)
{
    /* If nobody hears it, nobody waits for it. */
    if (notify_fd >= 0) (void)send(notify_fd, state, strlen(state), MSG_NOSIGNAL | MSG_DONTWAIT);
}

void systemd_close(void)
{
    if (notify_fd >= 0) close(notify_fd);
    notify_fd = -1;
}
