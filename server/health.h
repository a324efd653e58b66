/*
 * health.h - facetd --healthcheck: asks the daemon that runs with the same options.
 *
 * In the binary because the container image has no curl, and needs none for anything else.
 */
#ifndef HEALTH_H
#define HEALTH_H

#include "options.h"

/* Exit code: 0 if GET /healthz answers 200 within two seconds; else 1 with a message. */
int health_check(const struct options *options);

#endif
