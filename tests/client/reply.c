#define _GNU_SOURCE /* memmem, strcasestr */
#include "reply.h"

#include <ctype.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static bool unchunk(struct reply *reply)
{
    char *from = reply->body, *to = reply->body, *end = reply->bytes + reply->size;
    for (;;) {
        char *after;
        unsigned long n = strtoul(from, &after, 16);
        if (after == from || after + 2 > end) return false;
        from = after + 2;
        if (!n) break;
        if (from + n + 2 > end) return false;
        memmove(to, from, n);
        to += n;
        from += n + 2;
    }
    reply->body_size = (size_t)(to - reply->body);
    return true;
}

static void parse(struct reply *reply)
{
    char *head = reply->bytes,
         *body = reply->size ? memmem(head, reply->size, "\r\n\r\n", 4) : NULL;
    if (!body || sscanf(head, "HTTP/1.1 %d", &reply->status) != 1) {
        reply->status = 0;
        return;
    }
    *body = 0;
    reply->body = body + 4;
    reply->body_size = reply->size - (size_t)(reply->body - head);
    const char *length = strcasestr(head, "\r\nContent-Length:");
    bool whole = true;
    if (length && !reply->is_head) whole = strtoul(length + 17, NULL, 10) == reply->body_size;
    if (strcasestr(head, "\r\nTransfer-Encoding: chunked")) whole = unchunk(reply);
    if (!whole) reply->status = 0;
}

static void receive(int fd, struct reply *reply)
{
    size_t room = 0;
    struct pollfd p = {.fd = fd, .events = POLLIN};
    for (;;) {
        if (reply->size + 65536 > room) {
            char *more = realloc(reply->bytes, (room = 2 * room + 131072) + 1);
            if (!more) abort();
            reply->bytes = more;
        }
        if (poll(&p, 1, REPLY_WAIT_MS) <= 0) {
            reply->hung = true;
            break;
        }
        ssize_t n = recv(fd, reply->bytes + reply->size, 65536, 0);
        if (n <= 0) break;
        reply->size += (size_t)n;
    }
    reply->bytes[reply->size] = 0;
}

void reply_ask(int port, const struct shot *shot, struct reply *reply)
{
    memset(reply, 0, sizeof *reply);
    reply->is_head = !strncmp(shot->bytes, "HEAD ", 5);
    int fd = shot_connect(port);
    if (fd < 0) return;
    size_t sent = 0;
    ssize_t n = 1;
    while (n > 0 && sent < shot->size)
        if ((n = send(fd, shot->bytes + sent, shot->size - sent, MSG_NOSIGNAL)) > 0)
            sent += (size_t)n;
    receive(fd, reply);
    parse(reply);
    close(fd);
}

void reply_clear(struct reply *reply)
{
    free(reply->bytes);
}

void reply_mask(struct reply *reply)
{
    char *to = reply->body;
    for (size_t i = 0; i < reply->body_size; i++) {
        char c = reply->body[i];
        if (isdigit((unsigned char)c)) c = '0';
        if (strchr(".+-e", c) && to > reply->body && to[-1] == '0') continue;
        if (c == '0' && to > reply->body && to[-1] == '0') continue;
        *to++ = c;
    }
    reply->body_size = (size_t)(to - reply->body);
}

bool reply_is(const struct reply *a, const struct reply *b)
{
    return a->status == b->status && a->body_size == b->body_size &&
           !memcmp(a->body, b->body, a->body_size);
}
