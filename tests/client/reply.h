/* reply.h - the answer to a shot, taken over a plain socket. */
#ifndef REPLY_H
#define REPLY_H

#include "shot.h"

enum { REPLY_WAIT_MS = 5000 };

/* One answer, its body without chunks. */
struct reply {
    char *bytes, *body;
    size_t size, body_size;
    int status;         /* 0: none, or not whole */
    bool hung, is_head; /* is_head: of a HEAD, whose length announces a body that does not come */
};

/* On a connection of its own, until its end. */
void reply_ask(int port, const struct shot *shot, struct reply *reply);
void reply_clear(struct reply *reply);

/* Hides the numbers: for answers that hold times. */
void reply_mask(struct reply *reply);

/* Whether both say the same: status and body. */
bool reply_is(const struct reply *a, const struct reply *b);

#endif
