#include "answer.h"

#include "clock.h"
#include "waiting.h"

#include <string.h>

enum {
    DROP_BODY_MAX = 65536, /* of a refused request: read, so that the connection survives */
    LINGER_US = 2000000    /* for a client to read an answer sent amid its upload */
};

int64_t answer_deadline(const struct http *http, int64_t now_us, size_t bytes)
{
    return now_us + seconds(http->options->header_timeout) +
           (int64_t)(1e6 * (double)bytes / (double)http->options->min_rate);
}

/* What is computed of a streamed answer; a worker computes the rest, block by block. */
static ssize_t send_block(void *user, uint64_t position, char *out, size_t room)
{
    struct client *client = user;
    struct http *http = client->http;
    struct request *request = client->request;
    (void)position;
    while (request->block_taken == request->block_size) {
        if (atomic_load(&request->gone) || request->block_failed)
            return MHD_CONTENT_READER_END_WITH_ERROR;
        if (request->block_last) return MHD_CONTENT_READER_END_OF_STREAM;
        request->deadline_us = clock_us() + seconds(http->options->deadline);
        if (!api_stream_is_ready(request->response.stream) &&
            pool_submit(http->pool, &request->job)) {
            waiting_add(http, client);
            return 0;
        }
        request_next_block(request); /* a copy; or no worker is free: some milliseconds */
        client->deadline_us = answer_deadline(http, http->now_us, REQUEST_BLOCK);
    }
    size_t left = request->block_size - request->block_taken, n = left < room ? left : room;
    memcpy(out, request->block + request->block_taken, n);
    request->block_taken += n;
    request->streamed += n;
    return (ssize_t)n;
}

/* The body stays ours until exchange_end: libmicrohttpd neither copies nor frees it. */
static struct MHD_Response *response_of(struct client *client)
{
    struct request *request = client->request;
    if (!request->response.stream)
        return MHD_create_response_from_buffer(request->response.body_size, request->response.body,
                                               MHD_RESPMEM_PERSISTENT);
    if (!request_start_stream(request)) return NULL;
    uint64_t size = request->response.body_size == API_SIZE_UNKNOWN ? MHD_SIZE_UNKNOWN
                                                                    : request->response.body_size;
    return MHD_create_response_from_callback(size, REQUEST_BLOCK, send_block, client, NULL);
}

/*
 * libmicrohttpd puts the answer's head behind the request's, and closes the connection without a
 * word where there is no room for it.
 */
static bool has_room(const struct client *client, const struct request_header *headers,
                     size_t count)
{
    enum { OTHERS = 256 }; /* status line, Date, Content-Length, Connection, the empty line */
    size_t size = client->head_memory + OTHERS;
    if (!client->head_memory) return true;
    for (size_t i = 0; i < count; i++)
        size += strlen(headers[i].name) + strlen(headers[i].value) + 4;
    return size <= REQUEST_HEAD_MEMORY;
}

static enum MHD_Result refuse_head(struct http *http, struct client *client)
{
    const bool body_follows = client->phase == CLIENT_HEADERS; /* or may */
    request_refuse(client->request, 431,
                   "the head leaves no room for the answer's: fewer or shorter headers, please");
    answer_raw(http, client);
    return body_follows ? MHD_YES : MHD_NO;
}

enum MHD_Result answer_send(struct http *http, struct client *client)
{
    struct request *request = client->request;
    if (http->draining) request->close = true;
    struct request_header headers[REQUEST_HEADERS_MAX];
    size_t count = request_headers(request, headers);
    if (!has_room(client, headers, count)) return refuse_head(http, client);
    struct MHD_Response *response = response_of(client);
    if (!response) return MHD_NO;
    enum MHD_Result result = MHD_YES;
    for (size_t i = 0; i < count && result == MHD_YES; i++)
        result = MHD_add_response_header(response, headers[i].name, headers[i].value);
    if (result == MHD_YES)
        result = MHD_queue_response(client->connection, (unsigned)request->response.status,
                                    response);
    MHD_destroy_response(response);
    client->phase = CLIENT_ANSWER;
    client->deadline_us = answer_deadline(
        http, http->now_us, request->response.stream ? REQUEST_BLOCK : request->response.body_size);
    return result; /* MHD_NO, for want of memory, closes the connection */
}

enum MHD_Result answer_raw(struct http *http, struct client *client)
{
    request_drop_body(client->request, &http->budget);
    client->request->close = true;
    request_send_raw(client->request, client->fd);
    client->raw = true;
    client->phase = CLIENT_DROP;
    client->deadline_us = clock_us() + LINGER_US;
    return MHD_YES;
}

enum MHD_Result answer_early(struct http *http, struct client *client, const struct head *head)
{
    if (head->fault || head->expects_continue) return answer_send(http, client);
    if (head->chunked || head->length > DROP_BODY_MAX) return answer_raw(http, client);
    client->phase = CLIENT_DROP;
    return MHD_YES;
}
