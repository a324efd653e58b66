/* client.h - one connection, its place in a request's life and the time it has left. */
#ifndef CLIENT_H
#define CLIENT_H

#include "head.h"
#include "request.h"

#include <microhttpd.h>

enum client_phase {
    CLIENT_IDLE,    /* no request line yet */
    CLIENT_HEADERS, /* request line read */
    CLIENT_BODY,
    CLIENT_DROP,  /* the answer is settled; what still arrives is thrown away */
    CLIENT_WORK,  /* suspended, a worker has it */
    CLIENT_ANSWER /* queued for sending */
};

struct http;

struct client {
    struct request *request; /* while one is here; else NULL */
    struct http *http;
    struct client *previous, *next;
    struct MHD_Connection *connection;
    int fd;
    struct head_line line;
    size_t head_memory;        /* of CONNECTION_MEMORY */
    unsigned char address[16]; /* IPv6, or IPv4 mapped into it; zero for a unix socket */
    enum client_phase phase;
    bool used;    /* has had a request before */
    bool raw;     /* the answer went out beside libmicrohttpd */
    bool cut;     /* by the reaper or by the end of the daemon */
    bool ended;   /* sends no more; what it has sent may still be unread */
    size_t place; /* in the list of working clients */
    int64_t deadline_us;
};

#define CLIENT_NEVER INT64_MAX

void client_set_address(struct client *client, const struct sockaddr *address);
bool client_has_address(const struct client *client);

/* A token bucket: each piece of an upload buys time at `min_rate`, up to `grace_us` from now. */
void client_extend(struct client *client, int64_t now_us, size_t bytes, long min_rate,
                   int64_t grace_us);

/* Ends the connection; `tell`: with a 408 before, if a request is half here. */
void client_cut(struct client *client, bool tell);

#endif
