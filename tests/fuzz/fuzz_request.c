/*
 * Any bytes as a request: the first chooses endpoint, content type and accept, the rest is the body.
 * Every answer has a status that is documented, and the API's own reader takes every JSON answer.
 */
#include "api.h"
#include "fuzz.h"
#include "json.h"
#include "limits.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool is_documented(int status)
{
    static const int known[] = {200, 400, 406, 413, 415, 422, 503};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (status == known[i]) return true;
    return false;
}

static void check_json(const struct api_response *response)
{
    struct arena arena;
    struct problem problem = {0};
    struct document document = {0};
    api_arena_open(&arena, LIMIT_REQUEST_MEMORY);
    if (!api_json_read(response->body, response->body_size, &arena, &problem, &document)) {
        fprintf(stderr, "%s: %.300s\n", problem.detail, (char *)response->body);
        abort();
    }
    json_decref(document.root);
    api_arena_close(&arena);
}

/* Work is cut: a grid of a million directions teaches nothing. */
static bool is_over(void *user)
{
    return ++*(int *)user > 2;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const paths[] = {"/v1/eval", "/v1/sample", "/v1/pdf", "/v1/material"};
    static const char *const types[] = {"application/json", "multipart/form-data; boundary=b", NULL,
                                        "multipart/form-data"};
    static const char *const accepts[] = {NULL, "application/octet-stream", "application/zip",
                                          "application/x-npy"};
    static bool is_open;
    int asked = 0;
    if (!is_open) is_open = api_open();
    if (!size) return 0;
    struct api_request request = {.method = "POST",
                                  .path = paths[*data & 3],
                                  .content_type = types[*data >> 2 & 3],
                                  .accept = accepts[*data >> 4 & 3],
                                  .body = data + 1,
                                  .body_size = size - 1,
                                  .cancelled = is_over,
                                  .user = &asked};
    struct api_response response;
    api_is_short(&request);
    api_handle(&request, &response);
    if (!is_documented(response.status) || !response.body) {
        fprintf(stderr, "%d %.300s for %.*s\n", response.status, (char *)response.body, (int)size,
                (const char *)data);
        abort();
    }
    if (strstr(response.content_type, "json")) check_json(&response);
    api_response_clear(&response);
    return 0;
}
