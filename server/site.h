/*
 * site.h - what a listener serves: the API, the page and the daemon's own /readyz and /metrics, or,
 * for the admin listener, nothing but the probes.
 */
#ifndef SITE_H
#define SITE_H

#include "api.h"

enum site { SITE_MAIN, SITE_ADMIN };

struct api_route site_lookup(enum site site, const char *method, const char *path,
                             const char *content_type);

void site_handle(enum site site, const struct api_request *request, struct api_response *response);

/*
 * Whether it may be asked for without the token: the probes, for load balancers, and the page, which
 * holds no secret and asks its user for the token.
 */
bool site_is_open(enum site site, const char *path);

/* OPTIONS: 204 with Allow; false, and nothing done, where nothing is served. */
bool site_answer_options(enum site site, const char *path, struct api_response *response);

/* 405 for a path of the daemon's own, which are only read. */
void site_refuse_method(const char *path, struct api_response *response);

/* A header of an answer that the daemon itself makes; no-op when there are API_HEADERS_MAX already. */
void site_put_header(struct api_response *response, const char *name, const char *value);

#endif
