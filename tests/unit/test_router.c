#include "ask.h"
#include "check.h"
#include "endpoint.h"
#include "limits.h"
#include "media.h"

#include <stdlib.h>
#include <zlib.h>
#include <zstd.h>

#define EVAL "{\"material\":{\"alpha\":0.3},\"wi\":[[0,0,1]],\"wo\":[[0,0,1]]}"

static int status_of(struct api_request request)
{
    struct answer a = ask_with(request);
    int status = a.response.status;
    if (status >= 400) {
        CHECK_STR(a.response.content_type, "application/problem+json");
        CHECK_INT(json_integer_value(json_object_get(a.json, "status")), status);
        CHECK(answer_text(&a, "title") && answer_text(&a, "detail") && answer_text(&a, "type"));
    }
    answer_clear(&a);
    return status;
}

TEST(health_answers_get_and_head)
{
    struct answer a = ask("GET", "/healthz", NULL);
    CHECK_INT(a.response.status, 200);
    CHECK_STR(answer_text(&a, "status"), "ok");
    answer_clear(&a);
    a = ask("HEAD", "/healthz", NULL);
    CHECK_INT(a.response.status, 200);
    answer_clear(&a);
}

TEST(unknown_paths_and_methods)
{
    CHECK_INT(status_of((struct api_request){.method = "GET", .path = "/v1/nothing"}), 404);
    CHECK_INT(status_of((struct api_request){.method = "GET", .path = ""}), 404);
    CHECK_INT(status_of((struct api_request){.method = "GET", .path = "/v1/eval/"}), 404);
    struct answer a = ask("GET", "/v1/eval", NULL);
    CHECK_INT(a.response.status, 405);
    CHECK_INT(a.response.header_count, 1);
    CHECK_STR(a.response.headers[0].name, "Allow");
    CHECK_STR(a.response.headers[0].value, "POST, OPTIONS");
    answer_clear(&a);
    a = ask("POST", "/healthz", "{}");
    CHECK_INT(a.response.status, 405);
    CHECK_STR(a.response.headers[0].value, "GET, HEAD, OPTIONS");
    answer_clear(&a);
}

TEST(content_types)
{
    static const struct {
        const char *type;
        int status;
    } cases[] = {{NULL, 200},
                 {"", 200},
                 {"application/json", 200},
                 {"Application/JSON; charset=utf-8", 200},
                 {"application/x-www-form-urlencoded", 200},
                 {"text/csv", 415},
                 {"multipart/form-data; boundary=x", 400},
                 {"application/jsonx", 415}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        CHECK_INT(status_of((struct api_request){.method = "POST",
                                                 .path = "/v1/eval",
                                                 .body = EVAL,
                                                 .body_size = strlen(EVAL),
                                                 .content_type = cases[i].type}),
                  cases[i].status);
}

TEST(accept)
{
    static const struct {
        const char *accept;
        int status;
    } cases[] = {{"*/*", 200},
                 {"application/*", 200},
                 {"text/html, application/json;q=0.1", 200},
                 {"text/html", 406},
                 {"application/json;q=0", 406},
                 {"*/*, application/json;q=0.0", 406}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        CHECK_INT(status_of((struct api_request){
                      .method = "GET", .path = "/healthz", .accept = cases[i].accept}),
                  cases[i].status);
    CHECK(api_media_quality("text/*;q=0.3, text/html;q=0.7, */*;q=0.5", "text/html") == 0.7);
    CHECK(api_media_quality("text/*;q=0.3, text/html;q=0.7, */*;q=0.5", "text/plain") == 0.3);
    CHECK(api_media_quality("text/*;q=0.3, text/html;q=0.7, */*;q=0.5", "image/png") == 0.5);
}

TEST(json_is_compressed_on_demand)
{
    static const struct {
        const char *accept;
        bool is_gzip;
    } cases[] = {{NULL, false},          {"gzip", true},          {"deflate, gzip;q=0.5, br", true},
                 {"gzip;q=0", false},    {"identity", false},     {"", false},
                 {"br, deflate", false}, {"GZIP", true},          {"*", true},
                 {"br, *;q=0.1", true},  {"gzip;q=0, *", false},  {"*;q=0", false},
                 {"*;q=0, gzip", true},  {"xgzip, gzipx", false}, {"gzip ; q=0.0, *", false}};
    struct answer plain = ask("GET", "/v1/openapi.json", NULL);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct answer a = ask_with((struct api_request){
            .method = "GET", .path = "/v1/openapi.json", .accept_encoding = cases[i].accept});
        const unsigned char *bytes = a.response.body;
        bool is_gzip = bytes[0] == 0x1f && bytes[1] == 0x8b;
        if (is_gzip != cases[i].is_gzip)
            check_fail(__FILE__, __LINE__, "%s", cases[i].accept ? cases[i].accept : "NULL");
        CHECK_INT(a.response.header_count, 1 + is_gzip);
        CHECK_STR(a.response.headers[is_gzip].name, is_gzip ? "Content-Encoding" : "Vary");
        CHECK(is_gzip ? a.response.body_size < plain.response.body_size / 3
                      : a.response.body_size == plain.response.body_size);
        char *back = malloc(plain.response.body_size);
        z_stream z = {.next_in = a.response.body,
                      .avail_in = (uInt)a.response.body_size,
                      .next_out = (Bytef *)back,
                      .avail_out = (uInt)plain.response.body_size};
        if (is_gzip && inflateInit2(&z, 15 + 16) == Z_OK) {
            CHECK_INT(inflate(&z, Z_FINISH), Z_STREAM_END);
            inflateEnd(&z);
            CHECK(!memcmp(back, plain.response.body, plain.response.body_size));
        }
        free(back);
        answer_clear(&a);
    }
    answer_clear(&plain);
    /* What is short, and what is bytes, stays as it is. */
    struct answer a = ask_with(
        (struct api_request){.method = "GET", .path = "/healthz", .accept_encoding = "gzip"});
    CHECK(a.json && !a.response.header_count);
    answer_clear(&a);
}

/* The better one where both are named alike; who takes anything gets gzip. */
TEST(zstd)
{
    static const struct {
        const char *accept, *encoding;
    } cases[] = {{"zstd", "zstd"},
                 {"gzip, deflate, br, zstd", "zstd"},
                 {"ZSTD;q=0.5, gzip;q=0.4", "zstd"},
                 {"zstd;q=0.4, gzip;q=0.5", "gzip"},
                 {"zstd;q=0, gzip", "gzip"},
                 {"zstdx, gzip", "gzip"},
                 {"*", "gzip"},
                 {"br, zstd;q=0", NULL}};
    struct answer plain = ask("GET", "/v1/openapi.json", NULL);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct answer a = ask_with((struct api_request){
            .method = "GET", .path = "/v1/openapi.json", .accept_encoding = cases[i].accept});
        CHECK_INT(a.response.header_count, 1 + !!cases[i].encoding);
        if (cases[i].encoding) CHECK_STR(a.response.headers[1].value, cases[i].encoding);
        if (cases[i].encoding && !strcmp(cases[i].encoding, "zstd")) {
            char *back = malloc(plain.response.body_size);
            CHECK_INT(ZSTD_decompress(back, plain.response.body_size, a.response.body,
                                      a.response.body_size),
                      plain.response.body_size);
            CHECK(!memcmp(back, plain.response.body, plain.response.body_size));
            free(back);
        }
        answer_clear(&a);
    }
    answer_clear(&plain);
}

TEST(lookup_tells_the_server_what_to_expect)
{
    struct api_route route = api_lookup("POST", "/v1/eval", NULL);
    CHECK(route.found && route.is_long);
    CHECK_INT(route.body_max, LIMIT_JSON_BODY);
    route = api_lookup("GET", "/healthz", NULL);
    CHECK(route.found && !route.is_long && !route.body_max);
    CHECK(!api_lookup("GET", "/v1/eval", NULL).found);
}

TEST(small_requests_are_short_work)
{
    static const struct {
        const char *path, *query, *body;
        bool is_short;
    } cases[] = {
        {"/v1/eval", "", "{\"wi\":[[0,0,1]]}", true},
        {"/v1/sample", NULL, "{\"u\":[[0.5,0.5]]}", true},
        {"/v1/eval", "", "{\"wi\":{\"grid\":{\"theta\":9,\"phi\":9}}}", false},
        {"/v1/eval", "", "{\"pairing\": \"outer\"}", false},
        {"/v1/eval", "", "{\"wi\":{\"gr\\u0069d\":{\"theta\":9,\"phi\":9}}}", false},
        {"/v1/sample", "", "{\"n\":1000000}", false},
        {"/v1/sample", "n=1000000", "{}", false},
        {"/v1/fit", "", "{}", false},
        {"/v1/eval", "", "{\"n", true},
        {"/v1/nothing", "", "{}", false},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct api_request request = {.method = "POST",
                                      .path = cases[i].path,
                                      .query = cases[i].query,
                                      .body = cases[i].body,
                                      .body_size = strlen(cases[i].body)};
        if (api_is_short(&request) != cases[i].is_short)
            check_fail(__FILE__, __LINE__, "%s %s", cases[i].path, cases[i].body);
    }
    static char large[2049] = "{";
    CHECK(!api_is_short(&(struct api_request){
        .method = "POST", .path = "/v1/eval", .body = large, .body_size = sizeof large}));
}

TEST(bodies_larger_than_the_limit)
{
    size_t size = LIMIT_JSON_BODY + 1;
    char *body = malloc(size);
    memset(body, ' ', size);
    CHECK_INT(status_of((struct api_request){
                  .method = "POST", .path = "/v1/eval", .body = body, .body_size = size}),
              413);
    free(body);
}

TEST(refusals_by_the_server)
{
    struct api_response response;
    api_refuse(408, "the request took too long", &response);
    CHECK_INT(response.status, 408);
    CHECK_STR(response.content_type, "application/problem+json");
    CHECK(strstr(response.body, "\"title\":\"Request Timeout\""));
    CHECK(strstr(response.body, "took too long"));
    api_response_clear(&response);
}

/* RFC 9457: the title of about:blank is the phrase of the status; these are all that the daemon counts. */
TEST(every_refusal_has_its_phrase)
{
    static const int statuses[] = {400, 401, 404, 405, 406, 408, 411, 413, 414,
                                   415, 422, 429, 431, 500, 501, 503, 505};
    for (size_t i = 0; i < sizeof statuses / sizeof *statuses; i++)
        CHECK(strcmp(api_status_title(statuses[i]), "Error") != 0);
    CHECK_STR(api_status_title(401), "Unauthorized");
}

static bool is_utf8_json(const struct api_response *response)
{
    json_t *json = json_loadb(response->body, response->body_size, 0,
                              NULL); /* which refuses what is no UTF-8 */
    json_decref(json);
    return json != NULL;
}

/* Whatever a request holds, a refusal that quotes it is UTF-8. */
TEST(refusals_are_utf8)
{
    static const char *const details[] = {"\xff",
                                          "a\xc3",
                                          "\xc0\xaf",
                                          "\xed\xa0\x80",
                                          "\xf4\x90\x80\x80",
                                          "\xe0\x80\x80",
                                          "\xf0\x80\x80\x80",
                                          "caf\xc3\xa9 \xe2\x82\xac \xf0\x9f\x98\x80\"\\\n",
                                          "\xe2\x82\"",
                                          "\x80"};
    for (size_t i = 0; i < sizeof details / sizeof *details; i++) {
        struct api_response response;
        api_refuse(400, details[i], &response);
        CHECK(is_utf8_json(&response));
        CHECK(!strstr(response.body, "caf") == !strstr(details[i], "caf"));
        CHECK(i != 7 || !strstr(response.body, "\\ufffd"));
        CHECK(i != 8 || strstr(response.body, "\\ufffd"));
        api_response_clear(&response);
    }
    unsigned state = 1;
    for (int i = 0; i < 2000; i++) {
        char text[4][48];
        for (int k = 0; k < 4; k++) {
            size_t n = 0;
            for (; n < sizeof text[k] - 1; n++) {
                state = state * 1664525u + 1013904223u;
                text[k][n] = (char)(1 + (state >> 24) % 255);
            }
            text[k][n] = 0;
        }
        struct api_request request = {.method = i % 2 ? "POST" : text[0],
                                      .path = i % 3 ? "/v1/eval" : text[1],
                                      .query = text[1],
                                      .content_type = i % 5 ? text[2] : "application/json",
                                      .accept = i % 7 ? text[3] : NULL,
                                      .body = EVAL,
                                      .body_size = sizeof EVAL - 1};
        struct api_response response;
        api_handle(&request, &response);
        CHECK(response.status >= 400 && is_utf8_json(&response));
        api_response_clear(&response);
    }
}

TEST(query_members_count_as_body_members)
{
    struct api_request request = {.method = "POST",
                                  .path = "/v1/eval",
                                  .body = EVAL,
                                  .body_size = strlen(EVAL),
                                  .query = "tolerance=0.01"};
    CHECK_INT(status_of(request), 200);
    request.query = "tolerance=2";
    CHECK_INT(status_of(request), 422);
    request.query = "tolrance=0.1";
    CHECK_INT(status_of(request), 422);
}

TEST(what_takes_no_members_takes_no_query)
{
    static const char *const paths[] = {"/v1/capabilities", "/v1/openapi.json"};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        struct api_request request = {.method = "GET", .path = paths[i], .query = "ndf=ggx&x"};
        struct answer a = ask_with(request);
        CHECK_INT(a.response.status, 422);
        CHECK_STR(answer_error(&a, "pointer"), "/ndf");
        CHECK_STR(answer_error(&a, "detail"), "is not a known member; known: none");
        answer_clear(&a);
        request.query = "%zz";
        CHECK_INT(status_of(request), 400);
        request.query = "";
        CHECK_INT(status_of(request), 200);
    }
    struct api_request probe = {.method = "GET", .path = "/healthz", .query = "verbose"};
    CHECK_INT(status_of(probe), 200); /* a probe's own */
}
