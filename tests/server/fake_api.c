/*
 * fake_api.c - a stand-in behind the server's door, so that tests decide how long a request takes.
 *
 *   GET  /healthz            at once, on the network thread
 *   POST /echo               the body, on the network thread; 1 MiB at most
 *   POST /spin?ms=N          busy for N ms on a worker, ending early when cancelled
 *   POST /stubborn?ms=N      the same, deaf to cancellation
 *   GET  /cancelled          how many /spin were cancelled
 *   POST /big?bytes=N        an answer of N bytes
 */
#include "api.h"

#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static atomic_int cancelled_count;

bool api_open(void)
{
    return true;
}

void api_close(void)
{
}

struct api_route api_lookup(const char *method, const char *path, const char *content_type)
{
    const bool post = !strcmp(method, "POST"), get = !strcmp(method, "GET");
    (void)content_type;
    if (get && (!strcmp(path, "/healthz") || !strcmp(path, "/cancelled")))
        return (struct api_route){.found = true};
    if (post && !strcmp(path, "/echo"))
        return (struct api_route){.found = true, .body_max = 1 << 20};
    if (post && !strcmp(path, "/big")) return (struct api_route){.found = true, .body_max = 1024};
    if (post && (!strcmp(path, "/spin") || !strcmp(path, "/stubborn")))
        return (struct api_route){.found = true, .is_long = true, .body_max = 64 << 20};
    return (struct api_route){0};
}

bool api_is_short(const struct api_request *request)
{
    (void)request;
    return false;
}

static long parameter(const struct api_request *request, const char *name)
{
    const char *at = strstr(request->query, name);
    return at ? strtol(at + strlen(name), NULL, 10) : 0;
}

static void spin(const struct api_request *request, long ms, bool deaf)
{
    struct timespec start, now;
    clock_gettime(CLOCK_MONOTONIC, &start);
    do {
        if (!deaf && request->cancelled && request->cancelled(request->user)) {
            atomic_fetch_add(&cancelled_count, 1);
            return;
        }
        clock_gettime(CLOCK_MONOTONIC, &now);
    } while ((now.tv_sec - start.tv_sec) * 1000 + (now.tv_nsec - start.tv_nsec) / 1000000 < ms);
}

static void answer(struct api_response *response, int status, const void *body, size_t size)
{
    response->status = status;
    response->content_type = "text/plain";
    response->body = malloc(size + 1);
    if (!response->body) return;
    if (body)
        memcpy(response->body, body, size);
    else
        memset(response->body, 'x', size);
    response->body_size = size;
}

void api_handle(const struct api_request *request, struct api_response *response)
{
    memset(response, 0, sizeof *response);
    response->trace = (struct api_trace){
        .decode_us = 1, .compute_us = 2, .encode_us = 3, .evaluations = 4, .tier = "fake"};
    char number[16];
    if (!api_lookup(request->method, request->path, NULL).found) {
        answer(response, 404, "no", 2);
    } else if (!strcmp(request->path, "/echo")) {
        answer(response, 200, request->body, request->body_size);
    } else if (!strcmp(request->path, "/big")) {
        answer(response, 200, NULL, (size_t)parameter(request, "bytes="));
    } else if (!strcmp(request->path, "/cancelled")) {
        snprintf(number, sizeof number, "%d", atomic_load(&cancelled_count));
        answer(response, 200, number, strlen(number));
    } else if (!strcmp(request->path, "/healthz")) {
        answer(response, 200, "well", 4);
    } else {
        spin(request, parameter(request, "ms="), !strcmp(request->path, "/stubborn"));
        answer(response, 200, "done", 4);
    }
}

void api_refuse(int status, const char *detail, struct api_response *response)
{
    memset(response, 0, sizeof *response);
    answer(response, status, detail, strlen(detail));
}

void api_response_clear(struct api_response *response)
{
    free(response->body);
    memset(response, 0, sizeof *response);
}

/* No answer of this stand-in is a stream. */
long api_stream_next(struct api_stream *stream, char *out, size_t room)
{
    (void)stream, (void)out, (void)room;
    return -1;
}
