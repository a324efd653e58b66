/* daemon.h - starts a daemon for a test and talks to it over plain sockets. */
#ifndef DAEMON_H
#define DAEMON_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

struct daemon {
    pid_t pid;
    int port;
    int admin_port; /* of --admin 127.0.0.1:0; else 0 */
    char log[64];   /* file with its stderr */
};

enum { ANSWER_BODY_MAX = 1 << 16 };

struct answer {
    int status; /* 0: the connection ended without one */
    char head[4096];
    size_t body_size; /* all of it, also what did not fit */
    char body[ANSWER_BODY_MAX + 1];
};

/*
 * Starts `program` (beside the test program: "facetd-fake", "../../facetd") with the given flags
 * (NULL at the end) and --port 0; false, with the test marked failed, if it does not listen.
 */
bool daemon_start(struct daemon *daemon, const char *program, const char *const *flags);

/* Sends SIGTERM and waits; the exit code, or 128 + signal. */
int daemon_stop(struct daemon *daemon);
int daemon_wait(struct daemon *daemon);

/* Exit code of `program` run to its end; its stdout goes to `out`. */
int daemon_run(const char *program, const char *const *flags, char *out, size_t size);

/* -1 if refused. */
int daemon_connect(const struct daemon *daemon);
int daemon_connect_port(int port);
int daemon_connect_path(const char *path);
bool daemon_send(int fd, const char *text);
/* Reads one answer; waits 10 s at most.  False: none came (status 0). */
bool daemon_read(int fd, struct answer *answer);
/* One request on a connection of its own; path and headers ("A: b\r\n" or ""), body or NULL. */
bool daemon_ask(const struct daemon *daemon, const char *method, const char *path,
                const char *headers, const void *body, size_t size, struct answer *answer);

/* Sends text over a connection and takes one answer; closes it. */
bool daemon_ask_over(int fd, const char *text, struct answer *answer);

bool daemon_get(const struct daemon *daemon, const char *path, struct answer *answer);
/* Sends a request and returns its connection, from which daemon_read takes the answer. */
int daemon_post(const struct daemon *daemon, const char *path, const char *text);
/* The connection's end, with or without data before it, comes within `ms`. */
bool daemon_ends(int fd, double ms);

/* Value of a header in an answer, in a static buffer; NULL if absent. */
const char *answer_header(const struct answer *answer, const char *name);

/* Flags for daemon_start and daemon_run. */
#define FLAGS(...)                                                                                 \
    (const char *const[])                                                                          \
    {                                                                                              \
        __VA_ARGS__, NULL                                                                          \
    }

double now_ms(void);
void sleep_ms(long ms);

#endif
