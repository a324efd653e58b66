/* Query members (a=1&b=x) decoded by a field table: made into JSON first, so that one decoder
 * judges both. */
#include "field.h"
#include "json.h"
#include "limits.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

static int hex_digit(char c)
{
    static const char digits[] = "0123456789abcdef0123456789ABCDEF";
    const char *at = c ? strchr(digits, c) : NULL;
    return at ? (int)((at - digits) % 16) : -1;
}

/* Percent-decode size bytes; NULL where a % is not followed by two digits, or for %00. */
static char *unescape(const char *from, size_t size, struct arena *arena)
{
    char *out = api_arena_text(arena, from, size), *to = out;
    if (!out) return NULL;
    for (const char *in = out; *in; in++) {
        char c = *in == '+' ? ' ' : *in;
        if (c == '%') {
            int high = hex_digit(in[1]), low = high < 0 ? -1 : hex_digit(in[2]);
            if (low < 0 || !(high | low)) return NULL;
            c = (char)(high << 4 | low);
            in += 2;
        }
        *to++ = c;
    }
    *to = 0;
    return out;
}

static const struct field *find(const struct field *fields, const char *name)
{
    while (fields->type && strcmp(fields->name, name)) fields++;
    return fields->type ? fields : NULL;
}

/* The JSON value that `text` stands for in a member of this type; NULL: out of memory or no UTF-8. */
static json_t *value_of(const struct field *field, const char *text)
{
    bool is_number = field && (field->type == FIELD_NUMBER || field->type == FIELD_INTEGER ||
                               field->type == FIELD_COLOUR);
    if (is_number) {
        json_t *number = json_loads(text, JSON_DECODE_ANY | JSON_DECODE_INT_AS_REAL, NULL);
        if (json_is_number(number)) return number;
        json_decref(number);
    }
    if (field && field->type == FIELD_BOOL && !strcmp(text, "true")) return json_true();
    if (field && field->type == FIELD_BOOL && !strcmp(text, "false")) return json_false();
    return json_string(text);
}

static bool add_member(json_t *object, const char *item, size_t size, const struct field *fields,
                       struct decoder *decoder)
{
    const char *equals = memchr(item, '=', size);
    size_t name_size = equals ? (size_t)(equals - item) : size;
    const char *value_at = equals ? equals + 1 : item + size;
    char *name = unescape(item, name_size, decoder->arena);
    char *text = unescape(value_at, size - (size_t)(value_at - item), decoder->arena);
    if (!name || !text)
        return api_problem(decoder->problem, 400, "the query is not percent-encoded text");
    struct place at = {NULL, name, 0};
    if (json_object_get(object, name))
        return api_problem_at(decoder->problem, &at, "is given twice");
    json_t *value = value_of(find(fields, name), text);
    if (!json_object_set_new(object, name, value)) return true;
    /* json_string and json_object_set refuse what is not UTF-8, and an empty memory. */
    return api_json_exhausted() ? api_problem_memory(decoder->problem)
                                : api_problem(decoder->problem, 400, "the query is not UTF-8");
}

static json_t *object_of(const char *query, const json_t *json, const struct field *fields,
                         struct decoder *decoder)
{
    json_t *object = json ? json_copy((json_t *)json) : json_object();
    if (!object) {
        api_problem_memory(decoder->problem);
        return NULL;
    }
    while (query && *query) {
        size_t size = strcspn(query, "&");
        if (size && !add_member(object, query, size, fields, decoder)) {
            json_decref(object);
            return NULL;
        }
        query += size + (query[size] == '&');
    }
    return object;
}

bool api_decode_query(const char *query, const json_t *json, const struct field *fields,
                      void *object, struct decoder *decoder)
{
    if (query && strlen(query) > LIMIT_QUERY)
        return api_problem(decoder->problem, 414, "the query is longer than %d bytes", LIMIT_QUERY);
    if (json && !json_is_object(json)) return api_decode(json, fields, object, NULL, decoder);
    json_t *members = object_of(query, json, fields, decoder);
    if (!members) return false;
    bool ok = api_decode(members, fields, object, NULL, decoder);
    json_decref(members);
    return ok;
}
