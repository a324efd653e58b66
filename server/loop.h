/* loop.h - the network thread: polls, serves, reaps, and ends when a signal says so. */
#ifndef LOOP_H
#define LOOP_H

#include "http.h"
#include "listen.h"

/* Blocks SIGTERM, SIGINT and SIGHUP for all threads to come and ignores SIGPIPE; -1 with a message. */
int loop_signals(void);

struct loop;

/* NULL: out of memory.  The listeners are closed when it drains. */
struct loop *loop_create(struct http *http, struct pool *pool, struct listeners *listeners,
                         int signal_fd, const struct options *options);

/*
 * Runs until a signal, then drains.  True: all that ran was finished; false: some was cut when the
 * time to drain was over.  A second signal ends the process at once, and so does work that does not
 * stop when it is told to.
 */
bool loop_run(struct loop *loop);

/* NULL is fine. */
void loop_destroy(struct loop *loop);

#endif
