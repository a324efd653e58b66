/* From a request's bytes to an endpoint and back: path, method, media types, decode, handle,
 * encode. */
#include "compress.h"
#include "endpoint.h"
#include "json_form.h"
#include "limits.h"
#include "media.h"
#include "stream.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define JSON_TYPE "application/json"
#define FORM_TYPE "multipart/form-data"

#define ENDPOINT(name) extern const struct endpoint api_endpoint_##name;
#include "endpoints.def"
#undef ENDPOINT

static const struct endpoint *const endpoints[] = {
#define ENDPOINT(name) &api_endpoint_##name,
#include "endpoints.def"
#undef ENDPOINT
    NULL,
};

const struct endpoint *api_endpoint(size_t index)
{
    return index < sizeof endpoints / sizeof *endpoints ? endpoints[index] : NULL;
}

double api_clock(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec * 1e6 + (double)now.tv_nsec * 1e-3;
}

bool api_open(void)
{
    api_json_open();
    return true;
}

void api_close(void)
{
}

bool api_select_isa(const char *name)
{
    return facet_isa_select(*name ? name : NULL) == FACET_OK;
}

/* ---- Finding the endpoint -------------------------------------------------------------- */

static bool has_method(const struct endpoint *endpoint, const char *method)
{
    return !strcmp(endpoint->method, method) ||
           (!strcmp(endpoint->method, "GET") && !strcmp(method, "HEAD"));
}

static const struct endpoint *find(const char *method, const char *path)
{
    for (size_t i = 0; endpoints[i]; i++)
        if (!strcmp(endpoints[i]->path, path) && has_method(endpoints[i], method))
            return endpoints[i];
    return NULL;
}

bool api_methods(const char *path, char methods[API_METHODS_SIZE])
{
    size_t used = 0;
    for (size_t i = 0; endpoints[i]; i++)
        if (!strcmp(endpoints[i]->path, path))
            used += (size_t)snprintf(methods + used, API_METHODS_SIZE - used, "%s%s, ",
                                     endpoints[i]->method,
                                     strcmp(endpoints[i]->method, "GET") ? "" : ", HEAD");
    if (used) snprintf(methods + used, API_METHODS_SIZE - used, "OPTIONS"); /* the server's */
    return used;
}

/* Nothing serves this: 405 with Allow where another method would do, else 404. */
static void not_found(const struct api_request *request, struct api_response *response,
                      struct problem *problem)
{
    char allow[API_METHODS_SIZE];
    if (!api_methods(request->path, allow)) {
        api_problem(problem, 404, "nothing is served at %.100s; see /v1/openapi.json",
                    request->path);
        return;
    }
    api_answer_header(response, "Allow", "%s", allow);
    api_problem(problem, 405, "%.100s allows %s", request->path, allow);
}

struct api_route api_lookup(const char *method, const char *path, const char *content_type)
{
    const struct endpoint *endpoint = find(method, path);
    if (!endpoint) return (struct api_route){.body_max = LIMIT_JSON_BODY};
    bool is_raw = (endpoint->bodies && !api_media_is(content_type, JSON_TYPE)) ||
                  (endpoint->request && api_media_is(content_type, FORM_TYPE));
    return (struct api_route){
        .found = true,
        .is_long = endpoint->is_long,
        .body_max = !endpoint->request ? 0
                    : is_raw           ? LIMIT_BINARY_BODY
                                       : LIMIT_JSON_BODY,
        .path = endpoint->path,
    };
}

/* What makes a few bytes much work: descriptions of directions, every pair, samples by number, tables. */
static const char *const growing_words[] = {"grid", "random", "outer", "n", "slopes", "table"};

/* An escape could spell any word: it counts as one. */
static bool says_growing_word(const char *body, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        if (body[i] == '\\') return true;
        if (body[i] != '"') continue;
        for (size_t k = 0; k < sizeof growing_words / sizeof *growing_words; k++) {
            size_t n = strlen(growing_words[k]);
            if (size - i > n + 1 && body[i + n + 1] == '"' &&
                !memcmp(body + i + 1, growing_words[k], n))
                return true;
        }
    }
    return false;
}

bool api_is_short(const struct api_request *request)
{
    enum { SHORT_BODY_MAX = 2048 }; /* at most 340 directions: well below a millisecond */
    const struct endpoint *endpoint = find(request->method, request->path);
    return endpoint && endpoint->grows_by_words && request->body_size <= SHORT_BODY_MAX &&
           !(request->query && *request->query) &&
           !says_growing_word(request->body, request->body_size);
}

/* ---- The body ---------------------------------------------------------------------------- */

/* Types a client sends without meaning them: curl -d, curl --data-binary, fetch with a Blob. */
static bool says_nothing(const char *type)
{
    return !type || !*type || api_media_is(type, "application/x-www-form-urlencoded") ||
           api_media_is(type, "application/octet-stream");
}

static bool starts_like_json(const unsigned char *bytes, size_t size)
{
    size_t i = 0;
    while (i < size &&
           (bytes[i] == ' ' || bytes[i] == '\t' || bytes[i] == '\n' || bytes[i] == '\r'))
        i++;
    return i == size || bytes[i] == '{' || bytes[i] == '[';
}

static bool unsupported(const struct endpoint *endpoint, struct problem *problem)
{
    char types[200] = JSON_TYPE ", " FORM_TYPE;
    for (const struct medium *m = endpoint->bodies; m && m->type; m++) {
        size_t used = strlen(types);
        snprintf(types + used, sizeof types - used, ", %s", m->type);
    }
    return api_problem(problem, 415, "%s takes %s", endpoint->path, types);
}

/* Sets call->medium, NULL for JSON. */
static bool find_medium(struct call *call)
{
    const char *type = call->request->content_type;
    const unsigned char *bytes = call->request->body;
    size_t size = call->request->body_size;
    if (api_media_is(type, JSON_TYPE) || api_media_is(type, FORM_TYPE)) return true;
    bool by_content = says_nothing(type);
    for (const struct medium *m = call->endpoint->bodies; m && m->type; m++) {
        if (by_content ? m->matches(bytes, size) : api_media_is(type, m->type)) {
            call->medium = m;
            return true;
        }
    }
    if (!by_content) return unsupported(call->endpoint, call->problem);
    if (!call->endpoint->bodies || starts_like_json(bytes, size)) return true;
    return unsupported(call->endpoint, call->problem);
}

/* JSON, or a form of JSON and arrays; document->root is the caller's. */
static bool read_document(struct call *call, struct document *document)
{
    const struct api_request *request = call->request;
    size_t size = request->body_size;
    if (api_media_is(request->content_type, FORM_TYPE)) {
        if (size > LIMIT_BINARY_BODY)
            return api_problem(call->problem, 413, "a body may have %d bytes", LIMIT_BINARY_BODY);
        return api_json_form(request->content_type, request->body, size, call->arena, call->problem,
                             document);
    }
    if (size > LIMIT_JSON_BODY)
        return api_problem(call->problem, 413, "a JSON body may have %d bytes", LIMIT_JSON_BODY);
    return api_json_read(request->body, size, call->arena, call->problem, document);
}

static bool decode_document(struct call *call, void *in, struct decoder *decoder)
{
    const struct endpoint *endpoint = call->endpoint;
    const struct api_request *request = call->request;
    struct document *document = api_arena_array(call->arena, 1, sizeof *document);
    if (!document) return api_problem_memory(call->problem);
    document->share = request->share;
    document->crew = request->crew;
    if (!read_document(call, document)) return false;
    bool ok = request->query && *request->query
                  ? api_decode_query(request->query, document->root, endpoint->request, in, decoder)
                  : api_decode(document->root, endpoint->request, in, NULL, decoder);
    json_decref(document->root);
    return ok;
}

/* Every parameter is one that is not known. */
static bool decode_no_members(const struct call *call)
{
    static const struct field none[] = {{0}};
    struct decoder decoder = api_decoder(call);
    const char *query = call->request->query;
    return !query || !*query || api_decode_query(query, NULL, none, NULL, &decoder);
}

static bool decode_request(struct call *call)
{
    const struct endpoint *endpoint = call->endpoint;
    if (!endpoint->request) return endpoint->is_probe || decode_no_members(call);
    if (!find_medium(call)) return false;
    void *in = api_arena_array(call->arena, 1, endpoint->request_size);
    if (!in) return api_problem_memory(call->problem);
    call->in = in;
    struct decoder decoder = api_decoder(call);
    if (!call->medium) return decode_document(call, in, &decoder);
    if (call->request->body_size > LIMIT_BINARY_BODY)
        return api_problem(call->problem, 413, "a body may have %d bytes", LIMIT_BINARY_BODY);
    return api_decode_query(call->request->query, NULL, endpoint->request, in, &decoder);
}

/* ---- The answer ---------------------------------------------------------------------------- */

bool api_still_wanted(struct call *call)
{
    const struct api_request *request = call->request;
    if (!request->cancelled || !request->cancelled(request->user)) return true;
    return api_problem_status(call->problem, FACET_CANCELLED, NULL);
}

facet_watch api_watch(const struct call *call)
{
    return (facet_watch){call->request->cancelled, call->request->user};
}

const char *api_answer_type(const struct call *call, const char *preferred)
{
    const char *accept = call->request->accept, *best = preferred;
    double quality = api_media_quality(accept, preferred);
    const char *const *answers = call->endpoint->answers;
    if (api_media_quality(accept, JSON_TYPE) > quality) {
        best = JSON_TYPE;
        quality = api_media_quality(accept, best);
    }
    for (; answers && *answers; answers++) {
        if (api_media_quality(accept, *answers) <= quality) continue;
        best = *answers;
        quality = api_media_quality(accept, best);
    }
    return best;
}

static bool is_acceptable(struct call *call)
{
    const char *type = api_answer_type(call, JSON_TYPE);
    if (api_media_quality(call->request->accept, type) > 0) return true;
    char types[200] = JSON_TYPE;
    for (const char *const *answer = call->endpoint->answers; answer && *answer; answer++) {
        size_t used = strlen(types);
        snprintf(types + used, sizeof types - used, ", %s", *answer);
    }
    return api_problem(call->problem, 406, "%s answers %s", call->endpoint->path, types);
}

bool api_answer_raw(struct call *call, const char *type, void *bytes, size_t size)
{
    call->response->content_type = type;
    call->response->body = bytes;
    call->response->body_size = size;
    return true;
}

void api_answer_header(struct api_response *response, const char *name, const char *format, ...)
{
    if (response->header_count == API_HEADERS_MAX) return;
    struct api_header *header = &response->headers[response->header_count++];
    header->name = name;
    va_list list;
    va_start(list, format);
    vsnprintf(header->value, sizeof header->value, format, list);
    va_end(list);
}

static bool encode_response(struct call *call)
{
    if (call->response->body || call->produce) return true;
    struct text text = api_text(call->arena);
    api_encode(&text, call->endpoint->response, call->out);
    api_text_put(&text, "\n");
    call->response->content_type = JSON_TYPE;
    call->response->body = api_text_take(&text, &call->response->body_size);
    return call->response->body || api_problem_memory(call->problem);
}

static bool run(struct call *call)
{
    const struct endpoint *endpoint = call->endpoint;
    struct api_trace *trace = &call->response->trace;
    /* Tiny answers have nothing to decode, and a look at the clock is dear to them. */
    double start = endpoint->request ? api_clock() : 0;
    if (!is_acceptable(call) || !decode_request(call)) return false;
    if (endpoint->request) trace->decode_us += api_clock() - start;
    call->out = api_arena_array(call->arena, 1, endpoint->response_size);
    if (!call->out) return api_problem_memory(call->problem);
    if (endpoint->response) api_field_clear(endpoint->response, call->out);
    if (!endpoint->handle(call))
        return api_problem(call->problem, 500, "the endpoint failed without a reason");
    start = api_clock();
    bool ok = encode_response(call);
    trace->encode_us += api_clock() - start;
    return ok;
}

/* All but the headers that do not count: for a tiny answer their zeros would be much work. */
static void reset(struct api_response *response)
{
    memset(response, 0, offsetof(struct api_response, headers));
}

/* The answer is to come in blocks: everything it needs moves into the stream. */
static void keep_stream(struct api_stream *stream, struct api_response *response)
{
    stream->request = *stream->call.request;
    stream->call.request = &stream->request;
    stream->call.response = &stream->scratch;
    reset(&stream->scratch);
    response->stream = stream;
}

static void handle(const struct endpoint *endpoint, const struct api_request *request,
                   struct api_stream *stream, struct api_response *response)
{
    struct problem *problem = &stream->problem;
    stream->call = (struct call){.endpoint = endpoint,
                                 .request = request,
                                 .arena = &stream->arena,
                                 .problem = problem,
                                 .response = response};
    if (!run(&stream->call)) {
        stream->call.produce = NULL;
        if (problem->status == 503) api_answer_header(response, "Retry-After", "1");
        api_problem_answer(problem, response);
    }
    if (!stream->call.produce) api_compress(request->accept_encoding, response);
}

/* Apart, because a problem is large and most requests have none. */
static __attribute__((noinline)) void refuse_early(const struct endpoint *endpoint,
                                                   const struct api_request *request,
                                                   struct api_response *response)
{
    struct problem problem = {0};
    if (!endpoint) {
        not_found(request, response, &problem);
    } else {
        api_problem_memory(&problem);
        api_answer_header(response, "Retry-After", "1");
    }
    api_problem_answer(&problem, response);
}

void api_handle(const struct api_request *request, struct api_response *response)
{
    const struct endpoint *endpoint = find(request->method, request->path);
    struct api_stream *stream = endpoint ? api_stream_open(LIMIT_REQUEST_MEMORY) : NULL;
    reset(response);
    response->status = 200;
    if (!stream) {
        refuse_early(endpoint, request, response);
        return;
    }
    handle(endpoint, request, stream, response);
    if (stream->call.produce)
        keep_stream(stream, response);
    else
        api_stream_close(stream);
}

void api_refuse(int status, const char *detail, struct api_response *response)
{
    struct problem problem = {0};
    *response = (struct api_response){0};
    api_problem(&problem, status, "%s", detail);
    api_problem_answer(&problem, response);
}

void api_response_clear(struct api_response *response)
{
    free(response->body);
    api_stream_close(response->stream);
    reset(response);
}
