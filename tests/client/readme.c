/*
 * facet_readme - are the requests and answers of README.md true?
 *
 *   facet_readme (--base-url URL | --daemon PROGRAM) --cases DIR (--check FILE | --print yes)
 *
 * Every case marked "readme":true must stand in FILE as its curl line, followed by the answer in
 * the next fenced block.  There, "…" stands for anything left out; numbers may differ by a
 * millionth.
 * --print writes those blocks, long arrays shortened, to be pasted.
 */
#include "cases.h"
#include "daemon.h"
#include "expect.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ELLIPSIS "\xe2\x80\xa6"

/* ---- the curl line of a case ---------------------------------------------------------------- */

static bool curl_line(const json_t *request, char *line, size_t size)
{
    const char *path = json_string_value(json_object_get(request, "path")), *name;
    const char *query = json_string_value(json_object_get(request, "query"));
    struct body body;
    enum body_result made = body_make(request, &body);
    if (made == BODY_ABSENT || made == BODY_BAD || json_object_get(request, "generate"))
        return false;
    int n = snprintf(line, size,
                     query ? "curl -s 'localhost:8080%s?%s'" : "curl -s localhost:8080%s", path,
                     query);
    json_t *value;
    json_object_foreach(json_object_get(request, "headers"), name, value)
        n += snprintf(line + n, size - (size_t)n, " -H '%s: %s'", name, json_string_value(value));
    if (made == BODY_OK) n += snprintf(line + n, size - (size_t)n, " -d '%s'", body.bytes);
    body_clear(&body);
    return (size_t)n < size;
}

/* ---- answers as tokens
 * ---------------------------------------------------------------------------- */

struct token {
    const char *at;
    size_t length;
    bool is_number;
    double number;
};

/* The next token, or length 0 at the end. */
static struct token next_token(const char **cursor)
{
    const char *at = *cursor;
    while (isspace((unsigned char)*at)) at++;
    struct token t = {at, 0, false, 0};
    if (!*at) return t;
    if (*at == '-' || isdigit((unsigned char)*at)) {
        char *end;
        t.number = strtod(at, &end);
        t.is_number = end > at;
        t.length = end > at ? (size_t)(end - at) : 1;
    } else if (*at == '"') {
        const char *end = at + 1;
        while (*end && *end != '"') end += *end == '\\' && end[1] ? 2 : 1;
        t.length = (size_t)(end - at) + (*end == '"');
    } else if (!strncmp(at, ELLIPSIS, strlen(ELLIPSIS))) {
        t.length = strlen(ELLIPSIS);
    } else {
        t.length = 1;
        while (isalpha((unsigned char)*at) && isalpha((unsigned char)at[t.length])) t.length++;
    }
    *cursor = at + t.length;
    return t;
}

static bool same_token(struct token a, struct token b)
{
    if (a.is_number && b.is_number)
        return a.number == b.number || fabs(a.number - b.number) <= 1e-6 * fabs(b.number);
    return a.length == b.length && !memcmp(a.at, b.at, a.length);
}

static bool is_ellipsis(struct token t)
{
    return t.length == strlen(ELLIPSIS) && !memcmp(t.at, ELLIPSIS, t.length);
}

/* Does shown, up to its next ellipsis or end, stand at *actual?  Moves both past it if so. */
static bool matches_here(const char **shown, const char **actual)
{
    const char *s = *shown, *a = *actual;
    for (;;) {
        const char *before = s;
        struct token t = next_token(&s);
        if (!t.length || is_ellipsis(t)) {
            *shown = before;
            *actual = a;
            return true;
        }
        if (!same_token(t, next_token(&a))) return false;
    }
}

static bool answer_matches(const char *shown, const char *actual)
{
    bool anywhere = false;
    for (;;) {
        while (!matches_here(&shown, &actual))
            if (!anywhere || !next_token(&actual).length) return false;
        struct token t = next_token(&shown);
        if (!t.length) return anywhere || !next_token(&actual).length;
        anywhere = true;
    }
}

/* ---- shortened answers for --print
 * ----------------------------------------------------------------- */

static bool is_timing(const char *key)
{
    size_t n = strlen(key);
    return strstr(key, "ns_per") || (n > 3 && !strcmp(key + n - 3, "_ms"));
}

static void print_short(json_t *value)
{
    enum { ARRAY_SHOWN = 6, OBJECT_SHOWN = 12 };
    const char *key;
    json_t *member;
    size_t i = 0;
    if (json_is_object(value)) {
        putchar('{');
        json_object_foreach(value, key, member)
        {
            printf("%s\"%s\":", i++ ? "," : "", key);
            if (i > OBJECT_SHOWN || is_timing(key))
                fputs(ELLIPSIS, stdout);
            else
                print_short(member);
        }
        putchar('}');
    } else if (json_is_array(value)) {
        size_t n = json_array_size(value);
        putchar('[');
        for (i = 0; i < n && (n <= ARRAY_SHOWN || i < 2); i++) {
            if (i) putchar(',');
            print_short(json_array_get(value, i));
        }
        printf(n > ARRAY_SHOWN ? "," ELLIPSIS "]" : "]");
    } else {
        char *text = body_json(value);
        fputs(text ? text : "?", stdout);
        free(text);
    }
}

static void print_block(const char *line, const struct http_answer *answer)
{
    json_t *root = json_loadb(answer->body ? answer->body : "", answer->body_size, 0, NULL);
    printf("```sh\n%s\n```\n```json\n", line);
    if (root)
        print_short(root);
    else
        fputs(answer->body ? answer->body : "", stdout);
    printf("\n```\n\n");
    json_decref(root);
}

/* ---- the check
 * --------------------------------------------------------------------------------------- */

/* The next fenced block after the line; owned by the caller, NULL if there is none. */
static char *block_after(const char *at)
{
    const char *open = (at = strstr(at, "\n```")) ? strstr(at + 4, "\n```") : NULL;
    const char *begin = open ? strchr(open + 1, '\n') : NULL;
    const char *end = begin ? strstr(begin, "\n```") : NULL;
    if (!end) return NULL;
    char *block = malloc((size_t)(end - begin) + 1);
    if (!block) return NULL;
    memcpy(block, begin, (size_t)(end - begin));
    block[end - begin] = 0;
    return block;
}

static void check_block(const char *text, const char *line, const struct http_answer *answer,
                        struct findings *findings)
{
    const char *at = strstr(text, line);
    if (!at) {
        finding(findings, "no line: %s", line);
        return;
    }
    char *block = block_after(at);
    if (!block)
        finding(findings, "no answer follows: %s", line);
    else if (!answer_matches(block, answer->body ? answer->body : ""))
        finding(findings, "the answer now is: %.400s", answer->body ? answer->body : answer->error);
    free(block);
}

static size_t run(const char *url, const struct cases *cases, const char *text)
{
    size_t failed = 0;
    CURL *curl = curl_easy_init();
    for (size_t i = 0; curl && i < cases->count; i++) {
        const json_t *request = json_object_get(cases->list[i].root, "request");
        struct findings findings = {{0}, 0};
        struct http_answer answer;
        struct body body;
        char line[4096];
        if (!json_is_true(json_object_get(cases->list[i].root, "readme"))) continue;
        if (!curl_line(request, line, sizeof line)) line[0] = 0;
        body_make(request, &body);
        body.type = "application/x-www-form-urlencoded"; /* as curl -d does */
        cases_send(curl, url, request, &body, &answer);
        body_clear(&body);
        if (!text) {
            print_block(line, &answer);
        } else {
            check_block(text, line, &answer, &findings);
            printf("%s%s readme/%s\n", findings.text, findings.length ? "FAIL" : "ok",
                   cases->list[i].name);
        }
        failed += findings.length > 0;
        http_clear(&answer);
    }
    curl_easy_cleanup(curl);
    return failed;
}

int main(int argc, char **argv)
{
    const char *url = NULL, *program = NULL, *dir = NULL, *file = NULL;
    struct daemon daemon = {0};
    struct cases cases = {0};
    for (int i = 1; i + 1 < argc; i += 2) {
        if (!strcmp(argv[i], "--base-url")) url = argv[i + 1];
        if (!strcmp(argv[i], "--daemon")) program = argv[i + 1];
        if (!strcmp(argv[i], "--cases")) dir = argv[i + 1];
        if (!strcmp(argv[i], "--check")) file = argv[i + 1];
    }
    if (!dir || !url == !program) {
        fprintf(stderr, "usage: facet_readme (--base-url URL | --daemon PROGRAM) --cases DIR "
                        "(--check FILE | --print yes)\n");
        return 2;
    }
    size_t size = 0, failed;
    char *text = file ? body_read(file, &size) : NULL;
    if (file && !text) {
        perror(file);
        return 2;
    }
    if (!cases_load(dir, NULL, &cases) || (program && !daemon_start(program, &daemon))) return 2;
    curl_global_init(CURL_GLOBAL_DEFAULT);
    failed = run(program ? daemon.url : url, &cases, text);
    if (program) daemon_stop(&daemon);
    curl_global_cleanup();
    cases_clear(&cases);
    free(text);
    return failed ? 1 : 0;
}
