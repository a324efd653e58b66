/* Answers block by block: the same bytes as in one piece, in little memory, until someone stops them. */
#include "ask.h"
#include "check.h"

#include <stdlib.h>

#define HEAD                                                                                       \
    "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3,\"fresnel\":{\"schlick\":{\"f0\":[0.9,0.8,0.7]}}},\"wo\":[[0,0,1]],"

static struct api_request request_of(const char *path, const char *body, const char *accept)
{
    return (struct api_request){
        .method = "POST", .path = path, .accept = accept, .body = body, .body_size = strlen(body)};
}

/* The whole stream, in pieces of odd sizes. */
static char *drain(struct api_response *response, size_t *size)
{
    size_t room = 1 << 20;
    char *bytes = malloc(room);
    long n;
    *size = 0;
    while ((n = api_stream_next(response->stream, bytes + *size, 77777)) > 0) {
        *size += (size_t)n;
        if (room - *size < 77777) bytes = realloc(bytes, room *= 2);
    }
    CHECK_INT(n, 0);
    CHECK_INT(api_stream_next(response->stream, bytes, 1), 0);
    return bytes;
}

static void check_same(const char *path, const char *body, const char *accept)
{
    struct api_request request = request_of(path, body, accept);
    struct api_response whole, blocks;
    size_t size = 0;
    api_handle(&request, &whole);
    request.can_stream = true;
    api_handle(&request, &blocks);
    CHECK_INT(whole.status, 200);
    CHECK_INT(blocks.status, 200);
    CHECK(!whole.stream && blocks.stream && !blocks.body);
    if (blocks.stream) {
        char *bytes = drain(&blocks, &size);
        CHECK_STR(blocks.content_type, whole.content_type);
        CHECK_INT(size, whole.body_size);
        CHECK(size == whole.body_size && !memcmp(bytes, whole.body, size));
        CHECK(blocks.body_size == size || blocks.body_size == API_SIZE_UNKNOWN);
        CHECK_INT(blocks.header_count, whole.header_count);
        for (size_t i = 0; i < whole.header_count; i++)
            CHECK_STR(blocks.headers[i].value, whole.headers[i].value);
        free(bytes);
    }
    api_response_clear(&whole);
    api_response_clear(&blocks);
}

TEST(blocks_are_the_whole)
{
    static const char *const bodies[] = {
        HEAD
        "\"wi\":{\"grid\":{\"theta\":300,\"phi\":300}},\"outputs\":[\"fr\",\"D\",\"pdf\"],\"tolerance\":1e-9}",
        HEAD "\"wi\":{\"random\":{\"n\":90001}},\"flat\":true}",
        HEAD
        "\"wi\":{\"grid\":{\"theta\":400,\"phi\":400}},\"outputs\":[\"pdf\"],\"dtype\":\"float64\"}",
        HEAD
        "\"wi\":{\"grid\":{\"theta\":512,\"phi\":512}},\"outputs\":[\"pdf\"],\"tolerance\":1e-9}",
        HEAD "\"wi\":{\"grid\":{\"theta\":16,\"phi\":8192}},\"outputs\":[\"fr\"]}"};
    struct answer warm = ask("GET", "/healthz", NULL); /* opens the API */
    answer_clear(&warm);
    for (size_t i = 0; i < sizeof bodies / sizeof *bodies; i++) {
        check_same("/v1/eval", bodies[i], "application/json");
        check_same("/v1/eval", bodies[i], "application/octet-stream");
        if (i) check_same("/v1/eval", bodies[i], "application/x-npy");
    }
    check_same("/v1/pdf",
               "{\"material\":{\"alpha\":0.3},\"wo\":[[0,0,1]],\"wi\":{\"random\":{\"n\":300000}}}",
               NULL);
}

static bool has_stream(const char *path, const char *body, const char *accept)
{
    struct api_request request = request_of(path, body, accept);
    struct api_response response;
    request.can_stream = true;
    api_handle(&request, &response);
    CHECK_INT(response.status, 200);
    bool has = response.stream;
    CHECK(has == !response.body);
    api_response_clear(&response); /* unread */
    return has;
}

TEST(what_is_worth_a_stream)
{
    CHECK(!has_stream("/v1/eval", HEAD "\"wi\":{\"random\":{\"n\":10000}}}", NULL));
    CHECK(has_stream("/v1/eval", HEAD "\"wi\":{\"random\":{\"n\":100000}}}", NULL));
    CHECK(!has_stream("/v1/eval", HEAD "\"wi\":{\"random\":{\"n\":100000}}}", "application/zip"));
}

static bool is_over(void *user)
{
    return --*(int *)user < 0;
}

TEST(a_stream_can_be_stopped)
{
    struct api_request request = request_of(
        "/v1/eval",
        "{\"material\":{\"alpha\":0.3},\"wo\":[[0,0,1]],\"wi\":{\"random\":{\"n\":2000000}}}",
        NULL);
    int left = 1000;
    char bytes[50000];
    long n = 0;
    request.can_stream = true;
    request.cancelled = is_over;
    request.user = &left;
    struct api_response response;
    api_handle(&request, &response);
    CHECK(response.stream);
    left = 2; /* rounds */
    size_t blocks = 0;
    while (response.stream && (n = api_stream_next(response.stream, bytes, sizeof bytes)) > 0)
        blocks++;
    CHECK_INT(n, -1);
    CHECK(blocks >= 20 && blocks < 80);
    api_response_clear(&response);
}
