/*
 * admin.h - the admin listener: a thread of its own that serves the probes whatever the others do.
 */
#ifndef ADMIN_H
#define ADMIN_H

#include "listen.h"
#include "options.h"

struct admin;

/* Starts the thread; NULL with a message on stderr.  The listeners stay the caller's. */
struct admin *admin_start(const struct options *options, struct listeners *listeners);

/* Ends it; NULL is fine. */
void admin_stop(struct admin *admin);

#endif
