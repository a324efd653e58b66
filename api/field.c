#include "field.h"

#include "field_numbers.h"
#include "nearest.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool decode_value(const json_t *json, const struct field *field, void *object,
                         const struct place *place, struct decoder *decoder);

void api_field_range(const struct field *field, char *out, size_t room)
{
    char low[NUMBER_ROOM], high[NUMBER_ROOM];
    api_number_print(low, field->min);
    api_number_print(high, field->max);
    snprintf(out, room, "%c%s, %s%c", field->open_min ? '(' : '[', low, high,
             field->open_max ? ')' : ']');
}

/* ---- Messages --------------------------------------------------------------------- */

enum { NAMES_ROOM = 170 }; /* of a detail */

static bool wrong_name(const char *name, const struct field *field, const struct place *place,
                       struct decoder *decoder)
{
    char names[NAMES_ROOM];
    size_t n = 0;
    while (field->names[n]) n++;
    api_join_nearest(name, field->names, n, names, sizeof names);
    return api_problem_at(decoder->problem, place, "\"%.40s\" is not one of %s", name, names);
}

/* The names of the members or alternatives of a table; how many. */
static size_t names_of(const struct field *fields, const char *names[NEAREST_MAX])
{
    size_t n = 0;
    for (; fields->type && n < NEAREST_MAX; fields++) names[n++] = fields->name;
    return n;
}

static bool wrong_member(const char *name, const struct field *fields, const struct place *place,
                         struct decoder *decoder)
{
    const char *names[NEAREST_MAX];
    char list[NAMES_ROOM];
    api_join_nearest(name, names, names_of(fields, names), list, sizeof list);
    return api_problem_at(decoder->problem, place, "is not a known member; known: %s",
                          *list ? list : "none");
}

/* A word where only others may stand, or an object with one of the members known. */
static bool wrong_word(const char *word, const struct field *alternatives,
                       const struct place *place, struct decoder *decoder)
{
    const char *names[NEAREST_MAX];
    char list[NAMES_ROOM], keys[NAMES_ROOM] = "";
    size_t n = 0;
    for (; alternatives->type; alternatives++) {
        if (alternatives->type == FIELD_WORD && n < NEAREST_MAX) names[n++] = alternatives->name;
        for (size_t i = 0;
             alternatives->type == FIELD_ENUM && alternatives->names[i] && n < NEAREST_MAX; i++)
            names[n++] = alternatives->names[i];
        if ((alternatives->type != FIELD_OBJECT && alternatives->type != FIELD_OPTION) || *keys)
            continue;
        const char *members[NEAREST_MAX];
        api_join_nearest(word, members, names_of(alternatives->fields, members), keys,
                         sizeof keys / 2);
    }
    api_join_nearest(word, names, n, list, sizeof list / 2);
    return api_problem_at(decoder->problem, place, "\"%.40s\" is not one of %s%s%s", word, list,
                          *keys ? "; or an object of " : "", keys);
}

/* ---- Scalars ----------------------------------------------------------------------- */

static bool decode_number(const json_t *json, const struct field *field, double *out,
                          const struct place *place, struct decoder *decoder)
{
    if (!api_json_is_number(json)) return api_wrong_type(json, "a number", place, decoder);
    *out = json_real_value(json);
    return api_check_number(*out, field, place, decoder);
}

static bool decode_integer(const json_t *json, const struct field *field, int64_t *out,
                           const struct place *place, struct decoder *decoder)
{
    double x = 0;
    if (!decode_number(json, field, &x, place, decoder)) return false;
    *out = (int64_t)fmax(-0x1p53, fmin(x, 0x1p53));
    if (x == floor(x) && fabs(x) <= 0x1p53) return true;
    char value[NUMBER_ROOM];
    api_number_print(value, x);
    return api_problem_at(decoder->problem, place, "%s is not an integer of up to 53 bits", value);
}

static int index_of(const char *name, const char *const *names)
{
    for (int i = 0; names[i]; i++)
        if (!strcmp(names[i], name)) return i;
    return -1;
}

static bool decode_enum(const json_t *json, const struct field *field, int *out,
                        const struct place *place, struct decoder *decoder)
{
    const char *name = json_string_value(json);
    if (json_is_boolean(json)) name = json_is_true(json) ? "true" : "false";
    if (!name || (json_is_boolean(json) && index_of(name, field->names) < 0))
        return api_wrong_type(json, "a string", place, decoder);
    int index = index_of(name, field->names);
    if (index < 0) return wrong_name(name, field, place, decoder);
    *out = index;
    return true;
}

static bool decode_set(const json_t *json, const struct field *field, uint32_t *out,
                       const struct place *place, struct decoder *decoder)
{
    if (!json_is_array(json)) return api_wrong_type(json, "an array of names", place, decoder);
    uint32_t set = 0;
    for (size_t i = 0; i < json_array_size(json); i++) {
        struct place at = {place, NULL, i};
        int index = -1;
        if (!decode_enum(json_array_get(json, i), field, &index, &at, decoder)) return false;
        if (set >> index & 1)
            return api_problem_at(decoder->problem, &at, "\"%s\" stands twice",
                                  field->names[index]);
        set |= UINT32_C(1) << index;
    }
    if (!set)
        return api_problem_at(decoder->problem, place, "has 0 elements, must have at least 1");
    *out = set;
    return true;
}

static bool decode_text(const json_t *json, const char **out, const struct place *place,
                        struct decoder *decoder)
{
    if (!json_is_string(json)) return api_wrong_type(json, "a string", place, decoder);
    *out = api_arena_text(decoder->arena, json_string_value(json), json_string_length(json));
    return *out || api_problem_memory(decoder->problem);
}

/* ---- Structures ------------------------------------------------------------------------ */

static bool decode_option(const json_t *json, const struct field *field, void **out,
                          const struct place *place, struct decoder *decoder)
{
    void *object = api_arena_array(decoder->arena, 1, field->size);
    if (!object) return api_problem_memory(decoder->problem);
    struct field in_place = *field;
    in_place.type = FIELD_OBJECT;
    in_place.offset = 0;
    if (!decode_value(json, &in_place, object, place, decoder)) return false;
    *out = object;
    return true;
}

static bool decode_list(const json_t *json, const struct field *field, struct list *out,
                        const struct place *place, struct decoder *decoder)
{
    if (!json_is_array(json)) return api_wrong_type(json, "an array of objects", place, decoder);
    size_t n = json_array_size(json);
    if (!api_check_count(n, field, place, decoder)) return false;
    char *items = api_arena_array(decoder->arena, n ? n : 1, field->size);
    if (!items) return api_problem_memory(decoder->problem);
    for (size_t i = 0; i < n; i++) {
        struct place at = {place, NULL, i};
        if (!api_decode(json_array_get(json, i), field->fields, items + i * field->size, &at,
                        decoder))
            return false;
    }
    *out = (struct list){n, items};
    return true;
}

static bool is_alternative(const json_t *json, const struct field *field)
{
    switch (field->type) {
    case FIELD_WORD: return json_is_string(json) && !strcmp(json_string_value(json), field->name);
    case FIELD_ENUM:
    case FIELD_TEXT: return json_is_string(json);
    case FIELD_NUMBER:
    case FIELD_INTEGER: return api_json_is_number(json);
    case FIELD_BOOL: return json_is_boolean(json);
    case FIELD_OBJECT:
    case FIELD_OPTION: return json_is_object(json);
    default: return api_json_is_array(json);
    }
}

static bool decode_union(const json_t *json, const struct field *field, void *object,
                         const struct place *place, struct decoder *decoder)
{
    for (int i = 0; field->fields[i].type; i++) {
        if (!is_alternative(json, &field->fields[i])) continue;
        *(int *)object = i;
        return decode_value(json, &field->fields[i], object, place, decoder);
    }
    if (json_is_string(json))
        return wrong_word(json_string_value(json), field->fields, place, decoder);
    return api_problem_at(decoder->problem, place, "cannot be %s", api_json_type_name(json));
}

static bool decode_object(const json_t *json, const struct field *field, void *object,
                          const struct place *place, struct decoder *decoder)
{
    if (!api_decode(json, field->fields, object, place, decoder)) return false;
    if (field->one_of && json_object_size(json) != 1)
        return api_problem_at(decoder->problem, place, "must have exactly one member, has %zu",
                              json_object_size(json));
    return !field->check || field->check(object, place, decoder);
}

static bool decode_value(const json_t *json, const struct field *field, void *object,
                         const struct place *place, struct decoder *decoder)
{
    void *out = (char *)object + field->offset;
    switch (field->type) {
    case FIELD_NUMBER: return decode_number(json, field, out, place, decoder);
    case FIELD_INTEGER: return decode_integer(json, field, out, place, decoder);
    case FIELD_BOOL:
        if (!json_is_boolean(json)) return api_wrong_type(json, "true or false", place, decoder);
        *(bool *)out = json_is_true(json);
        return true;
    case FIELD_ENUM: return decode_enum(json, field, out, place, decoder);
    case FIELD_SET: return decode_set(json, field, out, place, decoder);
    case FIELD_TEXT: return decode_text(json, out, place, decoder);
    case FIELD_COLOUR:
    case FIELD_NUMBERS:
    case FIELD_VECTORS:
    case FIELD_MATRIX:
    case FIELD_PRINTED: return api_decode_numbers(json, field, out, place, decoder);
    case FIELD_OBJECT: return decode_object(json, field, out, place, decoder);
    case FIELD_OPTION: return decode_option(json, field, out, place, decoder);
    case FIELD_LIST: return decode_list(json, field, out, place, decoder);
    case FIELD_UNION: return decode_union(json, field, out, place, decoder);
    case FIELD_WORD:
    case FIELD_END: break;
    }
    return true;
}

/* ---- Objects ------------------------------------------------------------------------------ */

static void clear_value(const struct field *field, void *object)
{
    void *out = (char *)object + field->offset;
    bool given = field->presence == FIELD_DEFAULT;
    switch (field->type) {
    case FIELD_NUMBER: *(double *)out = given ? field->initial : NAN; break;
    case FIELD_INTEGER: *(int64_t *)out = given ? (int64_t)field->initial : -1; break;
    case FIELD_BOOL: *(bool *)out = given && field->initial != 0; break;
    case FIELD_ENUM:
    case FIELD_UNION: *(int *)out = given ? (int)field->initial : -1; break;
    case FIELD_SET: *(uint32_t *)out = given ? (uint32_t)field->initial : 0; break;
    case FIELD_TEXT: *(const char **)out = NULL; break;
    case FIELD_COLOUR:
        *(struct colour *)out = (struct colour){given, {given ? field->initial : NAN}};
        break;
    case FIELD_NUMBERS:
    case FIELD_VECTORS:
        *(struct numbers *)out = (struct numbers){0};
        if (field->as_sent) *(struct sent_numbers *)out = (struct sent_numbers){.floats = NULL};
        break;
    case FIELD_MATRIX: *(struct matrix *)out = (struct matrix){0}; break;
    case FIELD_OBJECT: api_field_clear(field->fields, out); break;
    case FIELD_OPTION: *(void **)out = NULL; break;
    case FIELD_LIST: *(struct list *)out = (struct list){0}; break;
    case FIELD_PRINTED: *(struct text **)out = NULL; break;
    case FIELD_WORD:
    case FIELD_END: break;
    }
}

void api_field_clear(const struct field *fields, void *object)
{
    for (; fields->type; fields++) clear_value(fields, object);
}

bool api_decode(const json_t *json, const struct field *fields, void *object,
                const struct place *place, struct decoder *decoder)
{
    if (!json_is_object(json)) return api_wrong_type(json, "an object", place, decoder);
    api_field_clear(fields, object);
    bool ok = true;
    const char *name;
    json_t *value;
    json_object_foreach((json_t *)json, name, value)
    {
        struct place at = {place, name, 0};
        const struct field *field = fields;
        while (field->type && strcmp(field->name, name)) field++;
        if (field->type)
            ok &= decode_value(value, field, object, &at, decoder);
        else
            ok = wrong_member(name, fields, &at, decoder);
        if (decoder->problem->count >= PROBLEM_ERRORS_MAX) return false;
    }
    for (; fields->type; fields++) {
        struct place at = {place, fields->name, 0};
        if (fields->presence == FIELD_MUST && !json_object_get(json, fields->name))
            ok = api_problem_at(decoder->problem, &at, "is required");
    }
    return ok;
}
