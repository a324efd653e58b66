/* daemon.h - start a daemon on a free port, watch its memory, stop it and learn how it ended. */
#ifndef CLIENT_DAEMON_H
#define CLIENT_DAEMON_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

struct daemon {
    pid_t pid; /* 0: none */
    char url[128];
    int admin_port; /* 0: none */
};

/* Runs PROGRAM --port 0 and waits for its line "listening on URL"; false, with a message, if none
 * comes. */
bool daemon_start(const char *program, struct daemon *daemon);
/* Resident memory in kB, 0 if unknown. */
size_t daemon_resident(const struct daemon *daemon);
/* SIGTERM, then the exit status; 128 + n if signal n ended it, -1 if it did not end in 30 s and was
 * killed. */
int daemon_stop(struct daemon *daemon);

#endif
