#include "json.h"

#include "lift.h"
#include "limits.h"

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
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

enum { HEADER = 16, MEMORY_FREE = 1 << 20 };

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

/* jansson's tree of a text that holds no number arrays; NULL and a problem. */
static json_t *parse_structure(const char *bytes, size_t size, const struct lifted *lifted,
                               struct problem *problem)
{
    json_error_t error;
    char why[JSON_ERROR_TEXT_LENGTH + 8];
    memory.refused = memory.exhausted = false;
    memory.limit = memory.used + MEMORY_FREE + (int64_t)size * LIMIT_JSON_MEMORY;
    json_t *json = json_loadb(lifted->text, lifted->size, JSON_REJECT_DUPLICATES | JSON_DECODE_ANY,
                              &error);
    memory.limit = 0;
    /* jansson's lexer drops characters of a long number when it gets no memory, and goes on. */
    if (json && !memory.refused && !memory.exhausted) return json;
    json_decref(json);
    if (memory.refused) {
        api_problem(
            problem, 413,
            "the JSON holds more values than its size allows (%d bytes of memory per byte); "
            "only arrays of nothing but numbers may be large",
            LIMIT_JSON_MEMORY);
    } else if (api_json_exhausted()) {
        api_problem_memory(problem);
    } else {
        size_t at = error.position > 0 ? (size_t)error.position - 1 : 0;
        snprintf(why, sizeof why, "%s", error.text);
        /* It quotes the text up to the fault, which may be in the middle of a character. */
        for (char *c = why; *c; c++)
            if ((unsigned char)*c >= 0x80) *c = '?';
        api_lift_refuse(bytes, api_lift_origin(bytes, size, lifted, at), why, problem);
    }
    return NULL;
}

bool api_json_read(const void *bytes, size_t size, struct arena *arena, struct problem *problem,
                   struct document *document)
{
    struct lifted lifted = {NULL, 0};
    if (!size) return api_problem(problem, 400, "not JSON: line 1 column 1: the body is empty");
    if (!api_lift(bytes, size, arena, document, problem, &lifted)) return false;
    document->root = parse_structure(bytes, size, &lifted, problem);
    arena->document = document;
    free(lifted.text);
    return document->root;
}
