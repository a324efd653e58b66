#include "exchange.h"

#include "answer.h"
#include "clock.h"
#include "memory.h"
#include "token.h"
#include "waiting.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { SMALL_BODY = 65536 }; /* so many bytes are no reason to give memory back */

/* Each takes memory of the connection's as soon as the request line is parsed. */
static bool has_too_many_parameters(const char *query)
{
    size_t count = 1;
    for (const char *at = query; (at = strchr(at, '&')); at++) count++;
    return count > REQUEST_PARAMETERS_MAX;
}

static struct request *take_request(struct http *http)
{
    struct request *request = http->spare ? http->spare : calloc(1, sizeof *request);
    http->spare = NULL;
    return request;
}

static void give_back(struct http *http, struct request *request)
{
    request_clear(request, &http->budget);
    if (http->spare)
        free(request);
    else
        http->spare = request;
}

void *exchange_begin(void *user, const char *target, struct MHD_Connection *connection)
{
    struct http *http = user;
    struct client *client = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT)
                                ->socket_context;
    if (!client || !target) return NULL;
    struct request *request = take_request(http);
    if (!request) return NULL;
    if (!request_start(request, target, http->now_us)) {
        give_back(http, request);
        return NULL;
    }
    client->request = request;
    request->owner = client;
    request->site = http->config.site;
    head_note_target(&client->line, target);
    client->phase = CLIENT_HEADERS;
    client->deadline_us = http->now_us + seconds(http->options->header_timeout);
    http_gauge(http, METRIC_ACTIVE, ++http->active_count);
    if (has_too_many_parameters(request->query)) {
        char detail[64];
        snprintf(detail, sizeof detail, "the query has more than %d parameters",
                 REQUEST_PARAMETERS_MAX);
        request_refuse(request, 414, detail);
        answer_raw(http, client);
    }
    return client;
}

static bool cors_allows(const struct http *http, const char *origin)
{
    const char *allowed = http->options->cors;
    return origin && *allowed && (!strcmp(allowed, "*") || !strcmp(allowed, origin));
}

static enum MHD_Result answer_now(struct http *http, struct client *client)
{
    request_run(client->request);
    request_tag(client->request);
    return answer_send(http, client);
}

static enum MHD_Result dispatch(struct http *http, struct client *client)
{
    struct request *request = client->request;
    request->received_us = request->body_size ? clock_us() : http->now_us; /* in this turn */
    if (!http->pool || request_is_short(request)) return answer_now(http, client);
    request->deadline_us = request->received_us + seconds(http->options->deadline);
    if (waiting_has_too_many(http, client)) {
        request_refuse(request, 429, "this address has too many long requests running");
        return answer_send(http, client);
    }
    request->was_queued = true; /* before, as the worker reads it */
    request->crew = http->pool;
    if (!pool_submit(http->pool, &request->job)) {
        request->was_queued = false;
        request->crew = NULL;
        request_refuse(request, 503, "all workers are busy and the queue is full");
        return answer_send(http, client);
    }
    waiting_add(http, client);
    return MHD_YES;
}

static void refuse_size(struct request *request)
{
    char detail[96] = "no body is taken here";
    if (request->route.body_max)
        snprintf(detail, sizeof detail,
                 "the body is larger than the %zu bytes that this endpoint takes",
                 request->route.body_max);
    request_refuse(request, 413, detail);
}

/* Bodies are taken as they are; true if this one was refused.  The value may be no UTF-8, so it is
 * not quoted. */
static bool refuse_encoded(struct client *client, const struct head *head)
{
    const char *encoding = head->value[HEAD_CONTENT_ENCODING];
    if (!encoding || !*encoding || !strcasecmp(encoding, "identity")) return false;
    request_refuse(client->request, 415,
                   "Content-Encoding must be identity or absent: send the body as it is");
    return true;
}

/* What the head alone decides; true if the request is refused or answered. */
static bool settle_by_head(struct http *http, struct client *client, const struct head *head)
{
    struct request *request = client->request;
    const char *method = request->method;
    if (head->fault) {
        request->close = true;
        request_refuse(request, 400, head->fault);
        return true;
    }
    if (strlen(request->path) + strlen(request->query) > REQUEST_TARGET_MAX) {
        char detail[80];
        snprintf(detail, sizeof detail, "the path and query have %zu bytes, at most %d are taken",
                 strlen(request->path) + strlen(request->query), REQUEST_TARGET_MAX);
        request_refuse(request, 414, detail);
        return true;
    }
    if (request->cors && !strcmp(method, "OPTIONS")) {
        request->response.status = 204;
        return true;
    }
    if (http->config.token && !site_is_open(request->site, request->path) &&
        !token_matches(http->config.token, head->value[HEAD_AUTHORIZATION])) {
        request_refuse(request, 401, "this asks for the header Authorization: Bearer TOKEN");
        return true;
    }
    if (!strcmp(method, "OPTIONS") &&
        site_answer_options(request->site, request->path, &request->response))
        return true;
    request->route = site_lookup(request->site, strcmp(method, "HEAD") ? method : "GET",
                                 request->path, request->content_type);
    if (!request->route.found) {
        request_run(request);
        return true;
    }
    if (head->length > request->route.body_max) {
        refuse_size(request);
        return true;
    }
    return request->route.body_max && refuse_encoded(client, head);
}

/* The headers are complete. */
static enum MHD_Result begin(struct http *http, struct client *client, const char *method,
                             const char *version)
{
    struct request *request = client->request;
    client->line.method = method;
    client->line.version = version;
    const struct head head = head_read(client->connection, &client->line);
    client->head_memory = head.memory;
    memcpy(request->method, method, strnlen(method, sizeof request->method - 1)); /* into zeros */
    request_set_id(request, head.value[HEAD_REQUEST_ID], &http->random_state);
    request_set_trace(request, head.value[HEAD_TRACEPARENT]);
    request->content_type = head.value[HEAD_CONTENT_TYPE];
    request->accept = head.value[HEAD_ACCEPT];
    request->accept_encoding = head.value[HEAD_ACCEPT_ENCODING];
    request->if_none_match = head.value[HEAD_IF_NONE_MATCH];
    request->body_expected = head.length;
    client->deadline_us = http->now_us + seconds(http->options->header_timeout);
    if (cors_allows(http, head.value[HEAD_ORIGIN])) request->cors = http->options->cors;
    request->varies_by_origin = *http->options->cors && strcmp(http->options->cors, "*");
    if (settle_by_head(http, client, &head)) return answer_early(http, client, &head);
    client->phase = CLIENT_BODY;
    return MHD_YES;
}

static enum MHD_Result collect(struct http *http, struct client *client, const char *data,
                               size_t size)
{
    struct request *request = client->request;
    http->received += size;
    if (client->phase == CLIENT_DROP) return MHD_YES;
    client_extend(client, http->now_us, size, http->options->min_rate,
                  seconds(http->options->header_timeout));
    switch (request_add_body(request, data, size, &http->budget)) {
    case BODY_OK: return MHD_YES;
    case BODY_TOO_LARGE: refuse_size(request); break;
    case BODY_NO_MEMORY: request_refuse(request, 503, "too many bodies are being received"); break;
    }
    return answer_raw(http, client);
}

enum MHD_Result exchange_step(void *user, struct MHD_Connection *connection, const char *url,
                              const char *method, const char *version, const char *data,
                              size_t *size, void **context)
{
    struct http *http = user;
    struct client *client = *context;
    (void)connection, (void)url;
    if (!client) return MHD_NO;
    if (client->phase == CLIENT_HEADERS) return begin(http, client, method, version);
    if (*size) {
        size_t arrived = *size;
        *size = 0;
        return collect(http, client, data, arrived);
    }
    if (client->raw) return MHD_NO; /* answered; the whole upload has come: close */
    if (client->phase == CLIENT_DROP) return answer_send(http, client);
    if (client->phase == CLIENT_BODY) return dispatch(http, client);
    if (atomic_load(&client->request->gone)) return MHD_NO;
    return answer_send(http, client); /* back from the worker */
}

static const char *end_text(const struct client *client, enum MHD_RequestTerminationCode code)
{
    if (client->cut) return "cut";
    if (client->request->gone) return "gone";
    if (client->raw) return "refused";
    switch (code) {
    case MHD_REQUEST_TERMINATED_COMPLETED_OK: return "ok";
    case MHD_REQUEST_TERMINATED_TIMEOUT_REACHED: return "timeout";
    case MHD_REQUEST_TERMINATED_DAEMON_SHUTDOWN: return "shutdown";
    case MHD_REQUEST_TERMINATED_CLIENT_ABORT: return "aborted";
    case MHD_REQUEST_TERMINATED_READ_ERROR: return "aborted";
    case MHD_REQUEST_TERMINATED_WITH_ERROR: break;
    }
    return "error";
}

void exchange_end(void *user, struct MHD_Connection *connection, void **context,
                  enum MHD_RequestTerminationCode code)
{
    struct http *http = user;
    struct client *client = *context;
    (void)connection;
    if (!client) return;
    *context = NULL;
    struct request *request = client->request;
    request->done_us = clock_us();
    metrics_request(request, request->gone);
    if (http->config.site == SITE_MAIN) {
        if (request->was_queued || request->body_size > SMALL_BODY) memory_used();
        request_log(request, end_text(client, code));
    }
    give_back(http, request);
    client->request = NULL;
    http_gauge(http, METRIC_ACTIVE, --http->active_count);
    http_gauge(http, METRIC_BODY_MEMORY, http->budget.used);
    client->phase = CLIENT_IDLE;
    client->used = true;
    client->deadline_us = http->now_us + seconds(http->options->timeout);
}
