#include "json.h"

#include "limits.h"

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/*
 * "[[[]]]" costs a hundred times its bytes once parsed.  So jansson's memory is
 * counted per thread, and parsing stops at a budget proportional to the body.
 */
static _Thread_local struct {
    int64_t used, limit; /* limit 0: none */
    bool refused,
        exhausted; /* by the limit; by the system.  jansson does not say which error was which */
} memory;

enum { HEADER = 16, MEMORY_FREE = 65536 };

static void *counted_malloc(size_t size)
{
    if (size > PTRDIFF_MAX - HEADER) return NULL;
    if (memory.limit && memory.used + (int64_t)size + HEADER > memory.limit) {
        memory.refused = true;
        return NULL;
    }
    char *bytes = malloc(size + HEADER);
    if (!bytes) {
        memory.exhausted = true;
        return NULL;
    }
    memcpy(bytes, &size, sizeof size);
    memory.used += (int64_t)size + HEADER;
    return bytes + HEADER;
}

static void counted_free(void *pointer)
{
    if (!pointer) return;
    char *bytes = (char *)pointer - HEADER;
    size_t size;
    memcpy(&size, bytes, sizeof size);
    memory.used -= (int64_t)size + HEADER;
    free(bytes);
}

void api_json_open(void)
{
    json_set_alloc_funcs(counted_malloc, counted_free);
}

bool api_json_exhausted(void)
{
    bool exhausted = memory.exhausted;
    memory.exhausted = false;
    return exhausted;
}

/*
 * What jansson lets pass: brackets nested up to 2048 deep, on its stack, and a NUL
 * byte, which ends the text for it.  400 for both.
 */
static bool check_bytes(const unsigned char *bytes, size_t size, struct problem *problem)
{
    int depth = 0, line = 1;
    size_t line_start = 0;
    bool in_string = false;
    for (size_t i = 0; i < size; i++) {
        unsigned char c = bytes[i];
        const char *wrong = NULL;
        if (c == '\n') {
            line++;
            line_start = i + 1;
        } else if (!c) {
            wrong = "a NUL byte";
        } else if (in_string) {
            in_string = c != '"';
            i += c == '\\' && i + 1 < size && bytes[i + 1];
        } else if (c == '"') {
            in_string = true;
        } else if (c == '[' || c == '{') {
            if (++depth > LIMIT_JSON_DEPTH) wrong = "nested too deeply";
        } else if (c == ']' || c == '}') {
            depth--;
        }
        if (wrong)
            return api_problem(problem, 400, "not JSON: line %d column %zu: %s", line,
                               i - line_start + 1, wrong);
    }
    return true;
}

json_t *api_json_parse(const void *bytes, size_t size, struct problem *problem)
{
    if (!size) {
        api_problem(problem, 400, "not JSON: line 1 column 1: the body is empty");
        return NULL;
    }
    if (!check_bytes(bytes, size, problem)) return NULL;
    json_error_t error;
    memory.refused = memory.exhausted = false;
    memory.limit = memory.used + MEMORY_FREE + (int64_t)size * LIMIT_JSON_MEMORY;
    json_t *json = json_loadb(
        bytes, size, JSON_REJECT_DUPLICATES | JSON_DECODE_ANY | JSON_DECODE_INT_AS_REAL, &error);
    memory.limit = 0;
    /* jansson's lexer drops characters of a long number when it gets no memory, and goes on. */
    if (json && !memory.refused && !memory.exhausted) return json;
    json_decref(json);
    if (memory.refused)
        api_problem(problem, 413,
                    "the JSON holds more values than its size allows (%d bytes of memory per byte)",
                    LIMIT_JSON_MEMORY);
    else if (api_json_exhausted())
        api_problem_memory(problem);
    else
        api_problem(problem, 400, "not JSON: line %d column %d: %s", error.line, error.column,
                    error.text);
    return NULL;
}
