/* listen.h - the listening sockets: TCP, unix, or what systemd passed. */
#ifndef LISTEN_H
#define LISTEN_H

#include "options.h"

#include <stdbool.h>
#include <stddef.h>

enum { LISTEN_MAX = 8, LISTEN_NAME_MAX = 160 };

/* Each has a name to tell people: "http://127.0.0.1:8080", "unix:/run/facetd.sock". */
struct listeners {
    struct listener {
        int fd; /* non-blocking */
        char name[LISTEN_NAME_MAX];
        const char *path; /* of a unix socket made here, removed at the end; else NULL */
    } list[LISTEN_MAX];
    size_t count;
};

/*
 * Opens what the options ask for; sockets passed by systemd (sd_listen_fds(3)) take the place of
 * the address and the port, and one named "admin" that of the admin option.  False with a message
 * on stderr; listeners_close is due all the same.
 */
bool listeners_open(const struct options *options, struct listeners *main_ones,
                    struct listeners *admin);

/* Closes and removes them; for those of systemd, only closes. */
void listeners_close(struct listeners *listeners);

/* Splits "127.0.0.1:9080" or "[::1]:9080"; false if it is neither. */
bool listen_split(const char *text, char *address, size_t size, unsigned short *port);

#endif
