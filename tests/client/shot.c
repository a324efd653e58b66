#include "shot.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <unistd.h>

static bool write_head(const json_t *request, const char *headers, struct shot *shot)
{
    const struct body *body = &shot->body;
    const char *method = json_string_value(json_object_get(request, "method")), *key;
    json_t *value;
    bool has_type = false;
    FILE *f = open_memstream(&shot->bytes, &shot->head_size);
    if (!f) return false;
    fprintf(f, "%s %s HTTP/1.1\r\nHost: x\r\n%s",
            method        ? method
            : body->bytes ? "POST"
                          : "GET",
            shot->path, headers);
    json_object_foreach(json_object_get(request, "headers"), key, value)
    {
        fprintf(f, "%s: %s\r\n", key, json_string_value(value));
        has_type = has_type || !strcasecmp(key, "Content-Type");
    }
    if (body->bytes && !has_type) fprintf(f, "Content-Type: %s\r\n", body->type);
    if (body->bytes) fprintf(f, "Content-Length: %zu\r\n", body->size);
    fputs("\r\n", f);
    return !fclose(f);
}

bool shot_make(const struct test_case *c, const char *headers, size_t body_max, struct shot *shot)
{
    const json_t *request = json_object_get(c->root, "request");
    memset(shot, 0, sizeof *shot);
    shot->name = c->name;
    shot->path = json_string_value(json_object_get(request, "path"));
    if (!shot->path) return false;
    const enum body_result made = body_make(request, &shot->body);
    if (made == BODY_BAD || made == BODY_ABSENT) return false;
    bool well = shot->body.size <= body_max && write_head(request, headers, shot);
    if (well && shot->body.bytes) {
        char *all = realloc(shot->bytes, shot->head_size + shot->body.size);
        well = all;
        if (all) memcpy((shot->bytes = all) + shot->head_size, shot->body.bytes, shot->body.size);
    }
    shot->size = shot->head_size + (shot->body.bytes ? shot->body.size : 0);
    if (!well) shot_clear(shot);
    return well;
}

void shot_clear(struct shot *shot)
{
    free(shot->bytes);
    body_clear(&shot->body);
    memset(shot, 0, sizeof *shot);
}

static struct sockaddr_in loopback(int port)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((unsigned short)port)};
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
}

int shot_listen(int *port)
{
    enum { BACKLOG = 128 };
    struct sockaddr_in at = loopback(0);
    socklen_t length = sizeof at;
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    if (fd >= 0 && !bind(fd, (struct sockaddr *)&at, length) && !listen(fd, BACKLOG) &&
        !getsockname(fd, (struct sockaddr *)&at, &length)) {
        *port = ntohs(at.sin_port);
        return fd;
    }
    if (fd >= 0) close(fd);
    return -1;
}

int shot_connect(int port)
{
    const struct sockaddr_in to = loopback(port);
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    if (fd >= 0 && !connect(fd, (const struct sockaddr *)&to, sizeof to)) return fd;
    if (fd >= 0) close(fd);
    return -1;
}
