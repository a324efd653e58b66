/* waiting.h - the requests that a worker has, or will have: their connections are suspended. */
#ifndef WAITING_H
#define WAITING_H

#include "http_state.h"

/* The pool has taken the client's job. */
void waiting_add(struct http *http, struct client *client);

/* So many of its requests are waiting or running that others would starve. */
bool waiting_has_too_many(const struct http *http, const struct client *client);

#endif
