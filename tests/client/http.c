#include "http.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

struct grow {
    char **data;
    size_t *size;
};

static size_t append(char *bytes, size_t one, size_t count, void *user)
{
    struct grow *to = user;
    size_t n = one * count;
    char *more = realloc(*to->data, *to->size + n + 1);
    if (!more) return 0;
    memcpy(more + *to->size, bytes, n);
    *to->data = more;
    *to->size += n;
    more[*to->size] = 0;
    return n;
}

static struct curl_slist *header_list(const struct http_request *request)
{
    struct curl_slist *list = curl_slist_append(NULL, "Expect:"); /* the daemon must cope without */
    for (size_t i = 0; list && i < request->header_count; i++) {
        struct curl_slist *longer = curl_slist_append(list, request->headers[i]);
        if (!longer) break;
        list = longer;
    }
    return list;
}

static void set_body(CURL *curl, const struct http_request *request)
{
    if (request->body) {
        curl_easy_setopt(curl, CURLOPT_POSTFIELDSIZE_LARGE, (curl_off_t)request->body_size);
        curl_easy_setopt(curl, CURLOPT_POSTFIELDS, request->body);
    } else if (!strcmp(request->method, "POST")) {
        curl_easy_setopt(curl, CURLOPT_POSTFIELDSIZE, 0L);
        curl_easy_setopt(curl, CURLOPT_POSTFIELDS, "");
    }
    if (!strcmp(request->method, "HEAD")) curl_easy_setopt(curl, CURLOPT_NOBODY, 1L);
    curl_easy_setopt(curl, CURLOPT_CUSTOMREQUEST, request->method);
}

void http_send(CURL *curl, const struct http_request *request, struct http_answer *answer)
{
    memset(answer, 0, sizeof *answer);
    struct grow body = {&answer->body, &answer->body_size};
    struct grow head = {&answer->headers, &answer->header_size};
    struct curl_slist *list = header_list(request);
    curl_easy_reset(curl);
    curl_easy_setopt(curl, CURLOPT_URL, request->url);
    curl_easy_setopt(curl, CURLOPT_PROXY, "");
    curl_easy_setopt(curl, CURLOPT_PATH_AS_IS, 1L);
    curl_easy_setopt(curl, CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(curl, CURLOPT_TIMEOUT, 120L);
    curl_easy_setopt(curl, CURLOPT_BUFFERSIZE, 256L * 1024);
    curl_easy_setopt(curl, CURLOPT_HTTPHEADER, list);
    curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, append);
    curl_easy_setopt(curl, CURLOPT_WRITEDATA, &body);
    curl_easy_setopt(curl, CURLOPT_HEADERFUNCTION, append);
    curl_easy_setopt(curl, CURLOPT_HEADERDATA, &head);
    curl_easy_setopt(curl, CURLOPT_ERRORBUFFER, answer->error);
    set_body(curl, request);
    CURLcode code = curl_easy_perform(curl);
    curl_slist_free_all(list);
    double seconds = 0;
    char *type = NULL;
    curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &answer->status);
    curl_easy_getinfo(curl, CURLINFO_TOTAL_TIME, &seconds);
    curl_easy_getinfo(curl, CURLINFO_CONTENT_TYPE, &type);
    answer->ms = seconds * 1e3;
    if (type) strncpy(answer->type, type, sizeof answer->type - 1);
    /* An early refusal may close the connection while the rest of a large body is still on its way.
     */
    if (code != CURLE_OK && !(code == CURLE_SEND_ERROR && answer->status >= 400)) {
        answer->status = 0;
        if (!answer->error[0])
            strncpy(answer->error, curl_easy_strerror(code), sizeof answer->error - 1);
    }
}

int http_header(const struct http_answer *answer, const char *name, char *value, size_t size)
{
    size_t length = strlen(name);
    for (const char *line = answer->headers; line && *line; line = strchr(line, '\n')) {
        if (*line == '\n') line++;
        if (strncasecmp(line, name, length) || line[length] != ':') continue;
        const char *from = line + length + 1;
        while (*from == ' ') from++;
        size_t n = strcspn(from, "\r\n");
        if (n >= size) n = size - 1;
        memcpy(value, from, n);
        value[n] = 0;
        return 1;
    }
    return 0;
}

void http_clear(struct http_answer *answer)
{
    free(answer->headers);
    free(answer->body);
    memset(answer, 0, sizeof *answer);
}
