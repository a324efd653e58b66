#include "json_form.h"

#include "field_numbers.h"
#include "lift.h"
#include "multipart.h"
#include "npy.h"

#include <string.h>

/* An invalid dtype is refused later, by the endpoint's table. */
static enum array_type raw_type(const json_t *root)
{
    const char *dtype = json_string_value(json_object_get(root, "dtype"));
    return dtype && !strcmp(dtype, "float64") ? ARRAY_DOUBLE : ARRAY_FLOAT;
}

static bool array_of(const struct part *part, enum array_type type, const struct place *place,
                     struct arena *arena, struct problem *problem, struct number_array *array)
{
    size_t item = type == ARRAY_FLOAT ? sizeof(float) : sizeof(double);
    if (api_npy_is(part->bytes, part->size))
        return api_npy_read(part->bytes, part->size, place, arena, problem, array);
    *array = (struct number_array){.type = type, .data = part->bytes, .count = part->size / item};
    if (part->size % item) { /* for the table to tell, which knows first whether this is an array */
        array->flaw = ARRAY_CUT;
        array->found = part->size;
        array->columns = item;
    }
    return true;
}

static bool add_array(const struct part *part, enum array_type type, struct arena *arena,
                      struct problem *problem, struct document *document)
{
    struct place at = {NULL, part->name, 0};
    struct number_array array;
    if (json_object_get(document->root, part->name))
        return api_problem_at(problem, &at, "is given twice");
    if (!array_of(part, type, &at, arena, problem, &array)) return false;
    json_t *index = json_integer((json_int_t)document->count);
    if (!index || !api_document_add(document, arena, &array)) {
        json_decref(index);
        return api_problem_memory(problem);
    }
    if (!json_object_set_new(document->root, part->name, index)) return true;
    /* jansson refuses a name that is not UTF-8, and an empty memory. */
    return api_json_exhausted() ? api_problem_memory(problem)
                                : api_problem_at(problem, &at, "is not a known member");
}

static bool add_arrays(const struct part *parts, size_t count, struct arena *arena,
                       struct problem *problem, struct document *document)
{
    enum array_type type = raw_type(document->root);
    struct place request = {NULL, "request", 0};
    struct decoder decoder = {.arena = arena, .problem = problem};
    if (count > 1 && !json_is_object(document->root))
        return api_wrong_type(document->root, "an object", &request, &decoder);
    for (size_t i = 0; i < count; i++)
        if (strcmp(parts[i].name, "request") &&
            !add_array(&parts[i], type, arena, problem, document))
            return false;
    return true;
}

bool api_json_form(const char *content_type, const void *body, size_t size, struct arena *arena,
                   struct problem *problem, struct document *document)
{
    struct part *parts = api_arena_array(arena, PARTS_MAX, sizeof *parts);
    struct place at = {NULL, "request", 0};
    size_t count, request = 0;
    if (!parts) return api_problem_memory(problem);
    if (!api_multipart(content_type, body, size, parts, &count, problem)) return false;
    while (request < count && strcmp(parts[request].name, "request")) request++;
    if (request == count)
        return api_problem_at(problem, &at, "is a part that is required: the JSON of the request");
    if (!api_json_read(parts[request].bytes, parts[request].size, arena, problem, document))
        return false;
    if (add_arrays(parts, count, arena, problem, document)) return true;
    json_decref(document->root);
    document->root = NULL;
    return false;
}
