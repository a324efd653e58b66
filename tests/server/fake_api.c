/*
 * fake_api.c - a stand-in behind the server's door, so that tests decide how long a request takes.
 *
 *   GET  /healthz            at once, on the network thread
 *   GET  /v1/document        a text that never changes, said to be encoded and to vary
 *   GET  /forbidden          the names of those things a sandbox forbids that could be done
 *   POST /echo               the body, on the network thread; 1 MiB at most
 *   POST /spin?ms=N          busy for N ms on a worker, ending early when cancelled
 *   POST /stubborn?ms=N      the same, deaf to cancellation
 *   GET  /cancelled          how many /spin were cancelled
 *   POST /big?bytes=N        an answer of N bytes
 */
#define _GNU_SOURCE /* MAP_ANONYMOUS */
#include "api.h"

#include <fcntl.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static atomic_int cancelled_count;

bool api_open(void)
{
    return true;
}

void api_close(void)
{
}

bool api_select_isa(const char *name)
{
    (void)name;
    return true;
}

void api_announce_limits(const struct api_limit *limits, size_t count)
{
    (void)limits, (void)count;
}

struct api_route api_lookup(const char *method, const char *path, const char *content_type)
{
    const bool post = !strcmp(method, "POST"), get = !strcmp(method, "GET");
    (void)content_type;
    if (get && (!strcmp(path, "/healthz") || !strcmp(path, "/cancelled")))
        return (struct api_route){.found = true, .path = "/healthz"};
    if (get && !strcmp(path, "/forbidden")) return (struct api_route){.found = true};
    if (get && !strcmp(path, "/v1/document"))
        return (struct api_route){.found = true, .path = "/v1/document"};
    if (post && !strcmp(path, "/echo"))
        return (struct api_route){.found = true, .body_max = 1 << 20, .path = "/echo"};
    if (post && !strcmp(path, "/big"))
        return (struct api_route){.found = true, .body_max = 1024, .path = "/big"};
    if (post && (!strcmp(path, "/spin") || !strcmp(path, "/stubborn")))
        return (struct api_route){
            .found = true, .is_long = true, .body_max = 64 << 20, .path = "/spin"};
    return (struct api_route){0};
}

bool api_methods(const char *path, char methods[API_METHODS_SIZE])
{
    const bool get = api_lookup("GET", path, NULL).found;
    snprintf(methods, API_METHODS_SIZE, get ? "GET, HEAD, OPTIONS" : "POST, OPTIONS");
    return get || api_lookup("POST", path, NULL).found;
}

bool api_takes_gzip(const char *accept_encoding)
{
    return accept_encoding && !strcmp(accept_encoding, "gzip");
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

static const char *const own_directory = "/tmp";

static bool opens_a_file(void)
{
    int fd = open("/etc/passwd", O_RDONLY);
    return fd >= 0 && !close(fd);
}

static bool writes_a_file(void)
{
    char path[64];
    snprintf(path, sizeof path, "%s/facetd-escaped-%ld", own_directory, (long)getpid());
    int fd = open(path, O_CREAT | O_WRONLY, 0600);
    return fd >= 0 && !close(fd) && !unlink(path);
}

static bool opens_a_socket(void)
{
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    return fd >= 0 && !close(fd);
}

static bool forks(void)
{
    pid_t pid = fork();
    if (pid == 0) _exit(0);
    return pid > 0;
}

static bool maps_code(void)
{
    void *page = mmap(NULL, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return page != MAP_FAILED && !munmap(page, 4096);
}

static bool lists_root(void)
{
    return !access("/", R_OK);
}

static void answer_forbidden(struct api_response *response)
{
    char done[128];
    snprintf(done, sizeof done, "%s%s%s%s%s%s", opens_a_file() ? "open " : "",
             writes_a_file() ? "write " : "", opens_a_socket() ? "socket " : "",
             forks() ? "fork " : "", maps_code() ? "mmap " : "", lists_root() ? "access " : "");
    answer(response, 200, done, strlen(done));
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
    } else if (!strcmp(request->path, "/forbidden")) {
        answer_forbidden(response);
    } else if (!strcmp(request->path, "/v1/document")) {
        answer(response, 200, "a document", 10);
        response->headers[0] = (struct api_header){"Vary", "Accept-Encoding"};
        response->headers[1] = (struct api_header){"Content-Encoding", "identity"};
        response->header_count = 2;
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
bool api_stream_is_ready(const struct api_stream *stream)
{
    (void)stream;
    return true;
}

long api_stream_next(struct api_stream *stream, char *out, size_t room)
{
    (void)stream, (void)out, (void)room;
    return -1;
}
