/* loop.h - the network thread: polls, serves, reaps, and ends when a signal says so. */
#ifndef LOOP_H
#define LOOP_H

#include "http.h"
#include "listen.h"

/* Blocks SIGTERM, SIGINT and SIGHUP for all threads to come and ignores SIGPIPE; -1 with a message. */
int loop_signals(void);

/*
 * Serves the listeners, which it closes when it drains.  Runs until a signal, then drains.  0: all that ran was finished; 1: some was cut when the time
 * to drain was over.  -1: it could not start.  A second signal ends the process at once.
 */
int loop_run(struct http *http, struct pool *pool, struct listeners *listeners, int signal_fd,
             const struct options *options);

#endif
