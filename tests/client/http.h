/* http.h - one request, one answer, over libcurl. */
#ifndef CLIENT_HTTP_H
#define CLIENT_HTTP_H

#include <curl/curl.h>
#include <stddef.h>

struct http_request {
    const char *method;
    const char *url;
    const char *const *headers; /* "Name: value" lines */
    size_t header_count;
    const void *body; /* NULL: none */
    size_t body_size;
};

struct http_answer {
    long status;    /* 0: no answer came, see error */
    char type[128]; /* Content-Type, "" if none */
    char *headers;  /* raw header lines; NUL-terminated */
    size_t header_size;
    char *body; /* NUL-terminated */
    size_t body_size;
    double ms;
    char error[CURL_ERROR_SIZE];
};

void http_send(CURL *curl, const struct http_request *request, struct http_answer *answer);
/* Copies the value of a header, first occurrence; false if absent. */
int http_header(const struct http_answer *answer, const char *name, char *value, size_t size);
void http_clear(struct http_answer *answer);

#endif
