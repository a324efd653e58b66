/* listen.h - the listening socket, and a polite no for clients beyond the connection limit. */
#ifndef LISTEN_H
#define LISTEN_H

#include <stdbool.h>
#include <stddef.h>

/* A non-blocking socket on a numeric address; -1 with a message on stderr. */
int listen_open(const char *address, unsigned short port);

/* "http://127.0.0.1:8080" of an open socket; false with a message on stderr. */
bool listen_url(int fd, char *url, size_t size);

/*
 * libmicrohttpd leaves clients beyond its limit in the backlog, where they hang.  This accepts
 * them, answers 503 and closes a second later (at once would reset what they have not read).
 */
void listen_refuse(int fd);
/* Closes those refused more than a second ago, or all; how many are left. */
size_t listen_linger(bool all);

enum { LISTEN_LINGER_MAX = 64 }; /* descriptors that listen_refuse may hold */

#endif
