/*
 * metrics.h - what the daemon has done and is doing, as Prometheus reads it (GET /metrics).
 *
 * Written by the network threads, read by any; every number is an atomic of its own.
 */
#ifndef METRICS_H
#define METRICS_H

#include "request.h"

enum metric {
#define METRIC(id, type, name, help) METRIC_##id,
#include "metrics.def"
#undef METRIC
    METRIC_COUNT
};

/* Keeps what must be opened before the sandbox closes. */
void metrics_open(void);
void metrics_close(void);

void metrics_add(enum metric metric, long long by);
void metrics_set(enum metric metric, long long value);
long long metrics_get(enum metric metric);

/* A request that ended: status, path, tier, evaluations, times. */
void metrics_request(const struct request *request, bool client_left);

/* The text format of Prometheus, to be freed; NULL: out of memory. */
char *metrics_print(size_t *size);

#endif
