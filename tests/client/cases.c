#include "cases.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static bool add(struct cases *cases, const char *dir, const char *endpoint, const char *file)
{
    char path[4096], name[512];
    json_error_t error;
    snprintf(path, sizeof path, "%s/%s/%s", dir, endpoint, file);
    snprintf(name, sizeof name, "%s/%.*s", endpoint, (int)(strlen(file) - strlen(".json")), file);
    json_t *root = json_load_file(path, JSON_REJECT_DUPLICATES, &error);
    if (!root || !json_object_get(root, "request") ||
        !json_object_get(json_object_get(root, "expect"), "status")) {
        fprintf(stderr, "%s:%d: %s\n", path, root ? 1 : error.line,
                root ? "a case needs request and expect.status" : error.text);
        json_decref(root);
        return false;
    }
    struct test_case *more = realloc(cases->list, (cases->count + 1) * sizeof *more);
    if (!more) return false;
    cases->list = more;
    more[cases->count].name = strdup(name);
    more[cases->count++].root = root;
    return true;
}

static bool load_endpoint(const char *dir, const char *endpoint, const char *filter,
                          struct cases *cases)
{
    char path[4096], name[512];
    bool good = true;
    snprintf(path, sizeof path, "%s/%s", dir, endpoint);
    DIR *d = opendir(path);
    for (struct dirent *e; d && (e = readdir(d));) {
        const char *dot = strrchr(e->d_name, '.');
        if (!dot || strcmp(dot, ".json")) continue;
        snprintf(name, sizeof name, "%s/%s", endpoint, e->d_name);
        if (filter && !strstr(name, filter)) continue;
        good &= add(cases, dir, endpoint, e->d_name);
    }
    if (d) closedir(d);
    return good;
}

static int by_name(const void *a, const void *b)
{
    return strcmp(((const struct test_case *)a)->name, ((const struct test_case *)b)->name);
}

bool cases_load(const char *dir, const char *filter, struct cases *cases)
{
    bool good = true;
    DIR *d = opendir(dir);
    if (!d) perror(dir);
    for (struct dirent *e; d && (e = readdir(d));)
        if (e->d_name[0] != '.') good &= load_endpoint(dir, e->d_name, filter, cases);
    if (d) closedir(d);
    if (cases->count)
        qsort(cases->list, cases->count, sizeof *cases->list, by_name);
    else
        fprintf(stderr, "%s: no case\n", dir);
    return good && cases->count;
}

void cases_clear(struct cases *cases)
{
    for (size_t i = 0; i < cases->count; i++) {
        free(cases->list[i].name);
        json_decref(cases->list[i].root);
    }
    free(cases->list);
}

static const char *text_or(const json_t *object, const char *key, const char *otherwise)
{
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : otherwise;
}

void cases_send(CURL *curl, const char *base_url, const json_t *request, const struct body *body,
                struct http_answer *answer)
{
    enum { HEADERS_MAX = 16, LINE = 256 };
    char url[4096], lines[HEADERS_MAX][LINE];
    const char *headers[HEADERS_MAX], *query = text_or(request, "query", ""), *name;
    size_t n = 0;
    bool typed = false;
    json_t *value;
    snprintf(url, sizeof url, "%s%s%s%s", base_url, text_or(request, "path", "/"),
             *query ? "?" : "", query);
    json_object_foreach(json_object_get(request, "headers"), name, value)
    {
        if (n + 1 >= HEADERS_MAX) break;
        typed |= !strcasecmp(name, "content-type");
        snprintf(lines[n++], LINE, "%s: %s", name, json_string_value(value));
    }
    if (body->bytes && !typed) snprintf(lines[n++], LINE, "Content-Type: %s", body->type);
    for (size_t i = 0; i < n; i++) headers[i] = lines[i];
    struct http_request out = {text_or(request, "method", body->bytes ? "POST" : "GET"),
                               url,
                               headers,
                               n,
                               body->bytes,
                               body->size};
    http_send(curl, &out, answer);
}
