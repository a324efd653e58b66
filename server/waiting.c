#define _GNU_SOURCE /* POLLRDHUP */
#include "waiting.h"

#include "answer.h"
#include "clock.h"

#include <string.h>

static void stop_waiting(struct http *http, struct client *client)
{
    struct client *last = http->working[--http->working_count];
    http->working[client->place] = last;
    last->place = client->place;
    http_gauge(http, METRIC_QUEUE_DEPTH, http->working_count);
}

void waiting_add(struct http *http, struct client *client)
{
    client->phase = CLIENT_WORK;
    client->deadline_us = CLIENT_NEVER; /* the request has its own */
    client->place = http->working_count;
    http->working[http->working_count++] = client;
    http_gauge(http, METRIC_QUEUE_DEPTH, http->working_count);
    MHD_suspend_connection(client->connection);
}

bool waiting_has_too_many(const struct http *http, const struct client *client)
{
    const size_t allowed = (size_t)http->options->per_client;
    size_t count = 0;
    if (!allowed || !client_has_address(client)) return false;
    for (size_t i = 0; i < http->working_count; i++)
        count += !memcmp(http->working[i]->address, client->address, sizeof client->address);
    return count >= allowed;
}

static struct client *client_of(struct pool_job *job)
{
    return ((struct request *)job)->owner; /* job is its first member */
}

void http_collect(struct http *http)
{
    struct pool_job *job;
    while (http->pool && (job = pool_collect(http->pool))) {
        struct client *client = client_of(job);
        stop_waiting(http, client);
        if (client->request->response.stream && client->request->block) { /* in the middle of it */
            client->phase = CLIENT_ANSWER;
            client->deadline_us = answer_deadline(http, clock_us(), REQUEST_BLOCK);
        }
        http->stirred = true;
        MHD_resume_connection(client->connection);
    }
}

size_t http_watch(const struct http *http, struct pollfd *fds)
{
    for (size_t i = 0; i < http->working_count; i++) {
        const struct client *client = http->working[i];
        fds[i].fd = atomic_load(&client->request->gone) ? -1 : client->fd; /* -1: poll skips it */
        fds[i].events = POLLRDHUP;
        fds[i].revents = 0;
    }
    return http->working_count;
}

static void cancel(struct http *http, struct client *client)
{
    atomic_store(&client->request->gone, true);
    metrics_add(METRIC_CANCELLED, 1);
    if (!pool_withdraw(http->pool, &client->request->job)) return; /* http_collect will resume it */
    stop_waiting(http, client);
    http->stirred = true;
    MHD_resume_connection(client->connection);
}

/* Downwards, because stop_waiting moves the last client into the place that becomes free. */
void http_watched(struct http *http, const struct pollfd *fds, size_t count)
{
    for (size_t i = count; i-- > 0;)
        if (fds[i].fd >= 0 && fds[i].revents) cancel(http, http->working[i]);
}

void http_cancel(struct http *http)
{
    for (size_t i = http->working_count; i-- > 0;) cancel(http, http->working[i]);
    for (struct client *client = http->clients; client; client = client->next)
        if (client->phase != CLIENT_WORK) client_cut(client, false);
}
