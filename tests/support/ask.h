/* ask.h - one request through api_handle, in process; the answer parsed. */
#ifndef ASK_H
#define ASK_H

#include "api.h"

#include <jansson.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

struct answer {
    struct api_response response;
    json_t *json; /* NULL if the body is not JSON */
};

static inline struct answer ask_with(struct api_request request)
{
    struct answer answer;
    static bool is_open;
    if (!is_open) is_open = api_open();
    api_handle(&request, &answer.response);
    answer.json = json_loadb(answer.response.body, answer.response.body_size,
                             JSON_REJECT_DUPLICATES, NULL);
    return answer;
}

static inline struct answer ask(const char *method, const char *path, const char *body)
{
    return ask_with((struct api_request){
        .method = method, .path = path, .body = body, .body_size = body ? strlen(body) : 0});
}

static inline struct answer ask_post(const char *path, const char *body)
{
    return ask("POST", path, body);
}

static inline void answer_clear(struct answer *answer)
{
    json_decref(answer->json);
    api_response_clear(&answer->response);
}

static inline const char *answer_text(const struct answer *answer, const char *name)
{
    return json_string_value(json_object_get(answer->json, name));
}

/* errors[0].pointer or .detail; NULL if there is none. */
static inline const char *answer_error(const struct answer *answer, const char *member)
{
    json_t *first = json_array_get(json_object_get(answer->json, "errors"), 0);
    return json_string_value(json_object_get(first, member));
}

static inline size_t answer_count(const struct answer *answer, const char *name)
{
    return json_array_size(json_object_get(answer->json, name));
}

/* NaN, which fails every comparison, where there is no number. */
static inline double answer_value(const json_t *number)
{
    return json_is_number(number) ? json_number_value(number) : NAN;
}

static inline double answer_number(const struct answer *answer, const char *name, size_t index)
{
    return answer_value(json_array_get(json_object_get(answer->json, name), index));
}

/* Component k of the index-th vector or colour. */
static inline double answer_component(const struct answer *answer, const char *name, size_t index,
                                      size_t k)
{
    return answer_value(
        json_array_get(json_array_get(json_object_get(answer->json, name), index), k));
}

static inline double answer_bound(const struct answer *answer)
{
    return answer_value(json_object_get(json_object_get(answer->json, "accuracy"), "bound"));
}

#endif
