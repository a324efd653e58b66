/*
 * sandbox.h - what the daemon gives up once its sockets are open, so that a fault in a decoder is not
 * a door: Landlock takes the file system and the making of connections, seccomp every system call
 * that serving does not need.
 *
 * Modes: "auto" takes what the kernel has and logs it, "on" fails if something is missing, "off".
 */
#ifndef SANDBOX_H
#define SANDBOX_H

#include "listen.h"

#include <stdbool.h>

/* Before any thread starts, for threads inherit it.  Unix sockets can still be removed at the end.
 * False with a message on stderr. */
bool sandbox_files(const char *mode, const struct listeners *main_ones,
                   const struct listeners *admin);

/* After the last thread has started: for all of them. */
bool sandbox_calls(const char *mode);

#endif
