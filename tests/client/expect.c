#include "expect.h"

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void finding(struct findings *findings, const char *format, ...)
{
    size_t room = sizeof findings->text - findings->length;
    if (room < 512) return; /* enough said */
    char line[500];
    va_list list;
    va_start(list, format);
    vsnprintf(line, sizeof line, format, list);
    va_end(list);
    for (size_t n = strlen(line); n && line[n - 1] == '\n'; n--) line[n - 1] = 0;
    findings->length += (size_t)snprintf(findings->text + findings->length, room, "  %s\n", line);
}

const json_t *expect_at(const json_t *root, const char *pointer)
{
    while (root && *pointer == '/') {
        char token[256];
        size_t n = 0;
        for (pointer++; *pointer && *pointer != '/' && n + 1 < sizeof token; pointer++) {
            char c = *pointer;
            if (c == '~' && (pointer[1] == '0' || pointer[1] == '1'))
                c = *++pointer == '0' ? '~' : '/';
            token[n++] = c;
        }
        token[n] = 0;
        root = json_is_array(root) ? json_array_get(root, strtoul(token, NULL, 10))
                                   : json_object_get(root, token);
    }
    return root;
}

static const char *type_name(const json_t *value)
{
    switch (json_typeof(value)) {
    case JSON_OBJECT: return "object";
    case JSON_ARRAY: return "array";
    case JSON_STRING: return "string";
    case JSON_INTEGER:
    case JSON_REAL: return "number";
    case JSON_TRUE:
    case JSON_FALSE: return "boolean";
    default: return "null";
    }
}

struct tolerance {
    double rel, floor, abs;
};

/* Arrays element by element, numbers within the tolerance, everything else equal. */
static void compare(const char *at, const json_t *actual, const json_t *expected,
                    struct tolerance t, struct findings *findings)
{
    if (json_is_number(expected) && json_is_number(actual)) {
        double a = json_number_value(actual), e = json_number_value(expected);
        double allowed = fmax(t.rel * fmax(fabs(e), t.floor), t.abs);
        if (!(a == e || fabs(a - e) <= allowed))
            finding(findings, "%s is %.17g, not %.17g (allowed %.3g, off by %.3g)", at, a, e,
                    allowed, a - e);
    } else if (json_is_array(expected) && json_is_array(actual)) {
        if (json_array_size(expected) != json_array_size(actual)) {
            finding(findings, "%s has %zu entries, not %zu", at, json_array_size(actual),
                    json_array_size(expected));
            return;
        }
        for (size_t i = 0; i < json_array_size(expected); i++) {
            char deeper[300];
            snprintf(deeper, sizeof deeper, "%s/%zu", at, i);
            compare(deeper, json_array_get(actual, i), json_array_get(expected, i), t, findings);
        }
    } else if (!json_equal(actual, expected)) {
        char *a = json_dumps(actual, JSON_ENCODE_ANY), *e = json_dumps(expected, JSON_ENCODE_ANY);
        finding(findings, "%s is %.100s, not %.100s", at, a ? a : "?", e ? e : "?");
        free(a);
        free(e);
    }
}

static void check_range(const char *at, const json_t *value, const json_t *check,
                        struct findings *findings)
{
    const json_t *min = json_object_get(check, "min"), *max = json_object_get(check, "max");
    if (!min && !max) return;
    if (json_is_array(value)) {
        for (size_t i = 0; i < json_array_size(value); i++) {
            char deeper[300];
            snprintf(deeper, sizeof deeper, "%s/%zu", at, i);
            check_range(deeper, json_array_get(value, i), check, findings);
        }
        return;
    }
    double x = json_number_value(value);
    if (!json_is_number(value) || (min && !(x >= json_number_value(min))) ||
        (max && !(x <= json_number_value(max))))
        finding(findings, "%s is %s %.17g, outside [%g, %g]", at, type_name(value), x,
                min ? json_number_value(min) : -INFINITY, max ? json_number_value(max) : INFINITY);
}

static double total(const json_t *value)
{
    double sum = json_number_value(value);
    for (size_t i = 0; i < json_array_size(value); i++) sum += total(json_array_get(value, i));
    return sum;
}

static double allowance(const json_t *check, const char *key, const json_t *root)
{
    const json_t *rel = json_object_get(check, key);
    if (!json_is_string(rel)) return json_number_value(rel);
    return json_number_value(expect_at(root, "/accuracy/bound"));
}

static bool is_check(const json_t *value)
{
    static const char *const keys[] = {"is",  "type",     "count",  "min",
                                       "max", "contains", "absent", "sum"};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        if (json_object_get(value, keys[i])) return true;
    return false;
}

static void check_value(const char *at, const json_t *root, const json_t *check,
                        struct findings *findings)
{
    const json_t *value = expect_at(root, at), *part;
    if (json_is_true(json_object_get(check, "absent"))) {
        if (value) finding(findings, "%s is there, but should not be", at);
        return;
    }
    if (!value) {
        finding(findings, "%s is missing", at);
        return;
    }
    if (!is_check(check)) {
        compare(at, value, check, (struct tolerance){0, 0, 0}, findings);
        return;
    }
    const json_t *floor_ = json_object_get(check, "floor");
    struct tolerance t = {allowance(check, "rel", root), floor_ ? json_number_value(floor_) : 1e-30,
                          allowance(check, "abs", root)};
    if ((part = json_object_get(check, "is"))) compare(at, value, part, t, findings);
    if ((part = json_object_get(check, "type")) &&
        strcmp(json_string_value(part), type_name(value)))
        finding(findings, "%s is of type %s, not %s", at, type_name(value),
                json_string_value(part));
    if ((part = json_object_get(check, "count"))) {
        size_t n = json_is_array(value) ? json_array_size(value) : json_object_size(value);
        if (n != (size_t)json_integer_value(part))
            finding(findings, "%s has %zu entries, not %lld", at, n,
                    (long long)json_integer_value(part));
    }
    check_range(at, value, check, findings);
    if ((part = json_object_get(check, "sum"))) {
        json_t *sum = json_real(total(value));
        compare(at, sum, part, t, findings);
        json_decref(sum);
    }
    if ((part = json_object_get(check, "contains"))) {
        const char *text = json_string_value(value);
        if (!text || !strstr(text, json_string_value(part)))
            finding(findings, "%s is \"%.100s\", which lacks \"%s\"", at, text ? text : "(no text)",
                    json_string_value(part));
    }
}

static void check_status(const json_t *status, const struct http_answer *answer,
                         struct findings *findings)
{
    bool good = json_is_integer(status) && json_integer_value(status) == answer->status;
    for (size_t i = 0; i < json_array_size(status); i++)
        good |= json_integer_value(json_array_get(status, i)) == answer->status;
    if (good) return;
    char *wanted = json_dumps(status, JSON_ENCODE_ANY | JSON_COMPACT);
    finding(findings, "status is %ld, not %s: %.200s", answer->status, wanted ? wanted : "?",
            answer->status ? answer->body ? answer->body : "" : answer->error);
    free(wanted);
}

static void check_headers(const json_t *expect, const struct http_answer *answer,
                          struct findings *findings)
{
    const char *type = json_string_value(json_object_get(expect, "type")), *name;
    if (type && strncmp(answer->type, type, strlen(type)))
        finding(findings, "content type is \"%s\", not \"%s\"", answer->type, type);
    json_t *value;
    json_object_foreach(json_object_get(expect, "headers"), name, value)
    {
        char actual[256];
        if (!http_header(answer, name, actual, sizeof actual))
            finding(findings, "header %s is missing", name);
        else if (!strstr(actual, json_string_value(value)))
            finding(findings, "header %s is \"%s\", which lacks \"%s\"", name, actual,
                    json_string_value(value));
    }
}

/* The pointer must be among errors[].pointer of the problem. */
static void check_error(const char *pointer, const json_t *root, struct findings *findings)
{
    const json_t *errors = json_object_get(root, "errors");
    for (size_t i = 0; i < json_array_size(errors); i++) {
        const char *at = json_string_value(json_object_get(json_array_get(errors, i), "pointer"));
        if (at && !strcmp(at, pointer)) return;
    }
    char *text = errors ? json_dumps(errors, JSON_COMPACT) : NULL;
    finding(findings, "no error points at \"%s\": %.300s", pointer,
            text ? text : "no errors member");
    free(text);
}

static void check_text(const json_t *expect, const struct http_answer *answer,
                       struct findings *findings)
{
    const json_t *contains = json_object_get(expect, "contains"), *bytes;
    for (size_t i = 0; i < json_array_size(contains); i++) {
        const char *text = json_string_value(json_array_get(contains, i));
        if (!answer->body || !strstr(answer->body, text))
            finding(findings, "the body lacks \"%s\": %.200s", text,
                    answer->body ? answer->body : "");
    }
    if ((bytes = json_object_get(expect, "bytes"))) {
        json_t *size = json_integer((json_int_t)answer->body_size);
        check_range("body size", size, bytes, findings);
        json_decref(size);
    }
}

void expect_check(const json_t *expect, const struct http_answer *answer, struct findings *findings)
{
    const char *error = json_string_value(json_object_get(expect, "error"));
    json_t *checks = json_object_get(expect, "json");
    check_status(json_object_get(expect, "status"), answer, findings);
    if (findings->length) return; /* the rest would only repeat it */
    check_headers(expect, answer, findings);
    check_text(expect, answer, findings);
    if (!error && !checks) return;
    json_error_t where;
    json_t *root = json_loadb(answer->body ? answer->body : "", answer->body_size,
                              JSON_DECODE_ANY | JSON_REJECT_DUPLICATES, &where);
    if (!root) {
        finding(findings, "the body is not JSON (%s): %.100s", where.text,
                answer->body ? answer->body : "");
        return;
    }
    if (error) check_error(error, root, findings);
    const char *at;
    json_t *check;
    json_object_foreach(checks, at, check) check_value(at, root, check, findings);
    json_decref(root);
}
