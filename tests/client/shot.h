/* shot.h - a case's request as bytes for a plain socket. */
#ifndef SHOT_H
#define SHOT_H

#include "cases.h"

#include <stdbool.h>
#include <stddef.h>

struct shot {
    const char *name, *path; /* the case's */
    char *bytes;             /* head and body; owned */
    size_t head_size, size;
    struct body body;
};

/*
 * `headers` ("A: b\r\n" or "") are added.  False, and nothing to clear: the case has no plain request,
 * its data is absent, or the body is larger than body_max.
 */
bool shot_make(const struct test_case *c, const char *headers, size_t body_max, struct shot *shot);
void shot_clear(struct shot *shot);

/* A blocking connection to the loopback; -1: none. */
int shot_connect(int port);
/* A socket that listens on a free port of the loopback; -1: none. */
int shot_listen(int *port);

#endif
