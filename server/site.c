#include "site.h"

#include "metrics.h"
#include "page.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define HEALTHZ "/healthz" /* the API's */
#define READYZ "/readyz"
#define METRICS "/metrics"
#define PAGE "/" /* all its files have one count */

/* The static string, NULL if the daemon itself serves nothing there. */
static const char *own_path(const char *path)
{
    static const char *const own[] = {READYZ, METRICS};
    for (size_t i = 0; i < sizeof own / sizeof *own; i++)
        if (!strcmp(path, own[i])) return own[i];
    return NULL;
}

static bool reads(const char *method)
{
    return !strcmp(method, "GET") || !strcmp(method, "HEAD");
}

struct api_route site_lookup(enum site site, const char *method, const char *path,
                             const char *content_type)
{
    const char *own = own_path(path);
    if (own) return (struct api_route){.found = reads(method), .path = own};
    if (site == SITE_ADMIN && strcmp(path, HEALTHZ)) return (struct api_route){0};
    if (page_find(path)) return (struct api_route){.found = reads(method), .path = PAGE};
    return api_lookup(method, path, content_type);
}

bool site_is_open(enum site site, const char *path)
{
    return site == SITE_ADMIN || !strcmp(path, HEALTHZ) || !strcmp(path, READYZ) || page_find(path);
}

void site_put_header(struct api_response *response, const char *name, const char *value)
{
    if (response->header_count == API_HEADERS_MAX) return;
    struct api_header *header = &response->headers[response->header_count++];
    header->name = name;
    snprintf(header->value, sizeof header->value, "%s", value);
}

#define READ_METHODS "GET, HEAD, OPTIONS"

void site_refuse_method(const char *path, struct api_response *response)
{
    char detail[128]; /* the paths are our own, and short */
    snprintf(detail, sizeof detail, "%s allows " READ_METHODS, path);
    api_refuse(405, detail, response);
    site_put_header(response, "Allow", READ_METHODS);
}

static bool methods_of(enum site site, const char *path, char methods[API_METHODS_SIZE])
{
    const bool is_main = site == SITE_MAIN, is_all = !strcmp(path, "*");
    snprintf(methods, API_METHODS_SIZE,
             is_all && is_main ? "GET, HEAD, POST, OPTIONS" : READ_METHODS);
    if (is_all || own_path(path)) return true;
    if (!is_main && strcmp(path, HEALTHZ)) return false;
    return page_find(path) || api_methods(path, methods);
}

bool site_answer_options(enum site site, const char *path, struct api_response *response)
{
    char methods[API_METHODS_SIZE];
    if (!methods_of(site, path, methods)) return false;
    *response = (struct api_response){.status = 204};
    site_put_header(response, "Allow", methods);
    return true;
}

/* Takes over the text; NULL: out of memory. */
static void answer(struct api_response *response, const char *type, char *text, size_t size)
{
    if (!text) {
        api_refuse(503, "out of memory", response);
        return;
    }
    *response = (struct api_response){
        .status = 200, .content_type = type, .body = text, .body_size = size};
    site_put_header(response, "Cache-Control", "no-store");
}

/* Ready: another long request would be taken. */
static void handle_readyz(struct api_response *response)
{
    static const char ready[] = "{\"status\":\"ready\"}\n";
    if (metrics_get(METRIC_DRAINING)) {
        api_refuse(503, "draining: running requests finish, new ones are not taken", response);
    } else if (metrics_get(METRIC_QUEUE_DEPTH) >= metrics_get(METRIC_QUEUE_MAX)) {
        api_refuse(503, "all workers are busy and the queue is full", response);
    } else {
        answer(response, "application/json", strdup(ready), sizeof ready - 1);
    }
}

static void handle_metrics(struct api_response *response)
{
    size_t size = 0;
    char *text = metrics_print(&size);
    answer(response, "text/plain; version=0.0.4; charset=utf-8", text, size);
}

void site_handle(enum site site, const struct api_request *request, struct api_response *response)
{
    const char *own = own_path(request->path);
    const struct page_file *file;
    if (own && !reads(request->method)) {
        site_refuse_method(own, response);
    } else if (own) {
        *response = (struct api_response){0};
        if (!strcmp(own, READYZ))
            handle_readyz(response);
        else
            handle_metrics(response);
    } else if (site == SITE_ADMIN && strcmp(request->path, HEALTHZ)) {
        api_refuse(404, "the admin listener serves /healthz, /readyz and /metrics", response);
    } else if ((file = page_find(request->path))) {
        page_answer(file, request, response);
    } else {
        api_handle(request, response);
    }
}
