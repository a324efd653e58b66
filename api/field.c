#include "field.h"

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

static const char *type_name(const json_t *json)
{
    switch (json_typeof(json)) {
    case JSON_OBJECT:
        return "an object";
    case JSON_ARRAY:
        return "an array";
    case JSON_STRING:
        return "a string";
    case JSON_INTEGER:
    case JSON_REAL:
        return "a number";
    case JSON_TRUE:
    case JSON_FALSE:
        return "a boolean";
    default:
        return "null";
    }
}

static bool wrong_type(const json_t *json, const char *expected, const struct place *place,
                       struct decoder *decoder)
{
    return api_problem_at(decoder->problem, place, "must be %s, not %s", expected, type_name(json));
}

/* "a, b, c" as far as it fits. */
static void join_names(const char *const *names, char *out, size_t room)
{
    size_t used = 0;
    for (*out = 0; *names && used < room; names++) {
        int n = snprintf(out + used, room - used, "%s%s", used ? ", " : "", *names);
        used += n > 0 ? (size_t)n : 0;
    }
}

static bool wrong_name(const char *name, const struct field *field, const struct place *place,
                       struct decoder *decoder)
{
    char names[160];
    join_names(field->names, names, sizeof names);
    return api_problem_at(decoder->problem, place, "\"%.40s\" is not one of %s", name, names);
}

static bool wrong_count(size_t count, const struct field *field, const struct place *place,
                        struct decoder *decoder)
{
    if (field->min_items == field->max_items)
        return api_problem_at(decoder->problem, place, "has %zu elements, must have %zu", count,
                              field->min_items);
    if (count < field->min_items)
        return api_problem_at(decoder->problem, place, "has %zu elements, must have at least %zu",
                              count, field->min_items);
    return api_problem_at(decoder->problem, place, "has %zu elements, must have at most %zu", count,
                          field->max_items);
}

static bool count_fits(size_t count, const struct field *field)
{
    return count >= field->min_items && (!field->max_items || count <= field->max_items);
}

/* ---- Scalars ----------------------------------------------------------------------- */

static bool in_range(double x, const struct field *field)
{
    if (!(field->min < field->max)) return true;
    return (field->open_min ? x > field->min : x >= field->min) &&
           (field->open_max ? x < field->max : x <= field->max);
}

static bool decode_number(const json_t *json, const struct field *field, double *out,
                          const struct place *place, struct decoder *decoder)
{
    if (!json_is_number(json)) return wrong_type(json, "a number", place, decoder);
    double x = json_number_value(json);
    if (!in_range(x, field)) {
        char value[NUMBER_ROOM], range[2 * NUMBER_ROOM + 8];
        api_number_print(value, x);
        api_field_range(field, range, sizeof range);
        return api_problem_at(decoder->problem, place, "%s is outside %s", value, range);
    }
    *out = x;
    return true;
}

static bool decode_integer(const json_t *json, const struct field *field, int64_t *out,
                           const struct place *place, struct decoder *decoder)
{
    double x;
    if (!decode_number(json, field, &x, place, decoder)) return false;
    if (x != floor(x) || fabs(x) > 0x1p53)
        return api_problem_at(decoder->problem, place, "%.17g is not an integer of up to 53 bits",
                              x);
    *out = (int64_t)x;
    return true;
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
        return wrong_type(json, "a string", place, decoder);
    int index = index_of(name, field->names);
    if (index < 0) return wrong_name(name, field, place, decoder);
    *out = index;
    return true;
}

static bool decode_set(const json_t *json, const struct field *field, uint32_t *out,
                       const struct place *place, struct decoder *decoder)
{
    if (!json_is_array(json)) return wrong_type(json, "an array of names", place, decoder);
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
    if (!json_is_string(json)) return wrong_type(json, "a string", place, decoder);
    *out = api_arena_text(decoder->arena, json_string_value(json), json_string_length(json));
    return *out || api_problem_memory(decoder->problem);
}

static bool decode_colour(const json_t *json, const struct field *field, struct colour *out,
                          const struct place *place, struct decoder *decoder)
{
    if (json_is_number(json)) {
        out->channels = 1;
        return decode_number(json, field, out->value, place, decoder);
    }
    if (!json_is_array(json)) return wrong_type(json, "a number or [r,g,b]", place, decoder);
    if (json_array_size(json) != 3)
        return api_problem_at(decoder->problem, place, "has %zu elements, must have 3",
                              json_array_size(json));
    for (size_t i = 0; i < 3; i++) {
        struct place at = {place, NULL, i};
        if (!decode_number(json_array_get(json, i), field, &out->value[i], &at, decoder))
            return false;
    }
    out->channels = 3;
    return true;
}

/* ---- Arrays of numbers --------------------------------------------------------------- */

static bool decode_run(const json_t *array, const struct field *field, double *out,
                       const struct place *place, struct decoder *decoder)
{
    for (size_t i = 0, n = json_array_size(array); i < n; i++) {
        struct place at = {place, NULL, i};
        if (!decode_number(json_array_get(array, i), field, &out[i], &at, decoder)) return false;
    }
    return true;
}

static bool decode_numbers(const json_t *json, const struct field *field, struct numbers *out,
                           const struct place *place, struct decoder *decoder)
{
    if (!json_is_array(json)) return wrong_type(json, "an array of numbers", place, decoder);
    size_t n = json_array_size(json);
    if (!count_fits(n, field)) return wrong_count(n, field, place, decoder);
    double *values = api_arena_doubles(decoder->arena, n);
    if (!values) return api_problem_memory(decoder->problem);
    if (!decode_run(json, field, values, place, decoder)) return false;
    *out = (struct numbers){n, values};
    return true;
}

/* Whether json is an array of rows of `width` numbers each. */
static bool check_rows(const json_t *json, size_t width, const struct place *place,
                       struct decoder *decoder)
{
    for (size_t i = 0, n = json_array_size(json); i < n; i++) {
        const json_t *row = json_array_get(json, i);
        struct place at = {place, NULL, i};
        if (!json_is_array(row)) return wrong_type(row, "an array of numbers", &at, decoder);
        if (json_array_size(row) != width)
            return api_problem_at(decoder->problem, &at, "has %zu elements, must have %zu",
                                  json_array_size(row), width);
    }
    return true;
}

static bool decode_rows(const json_t *json, size_t width, const struct field *field, double *out,
                        const struct place *place, struct decoder *decoder)
{
    for (size_t i = 0, n = json_array_size(json); i < n; i++) {
        struct place at = {place, NULL, i};
        if (!decode_run(json_array_get(json, i), field, out + i * width, &at, decoder))
            return false;
    }
    return true;
}

static bool decode_vectors(const json_t *json, const struct field *field, struct numbers *out,
                           const struct place *place, struct decoder *decoder)
{
    if (!json_is_array(json)) return wrong_type(json, "an array of vectors", place, decoder);
    size_t n = json_array_size(json);
    bool flat = n && json_is_number(json_array_get(json, 0));
    if (flat && n % field->width)
        return api_problem_at(decoder->problem, place,
                              "has %zu numbers, must have a multiple of %zu", n, field->width);
    size_t count = flat ? n / field->width : n;
    if (!count_fits(count, field)) return wrong_count(count, field, place, decoder);
    if (!flat && !check_rows(json, field->width, place, decoder)) return false;
    double *values = api_arena_doubles(decoder->arena, count * field->width);
    if (!values) return api_problem_memory(decoder->problem);
    if (!(flat ? decode_run(json, field, values, place, decoder)
               : decode_rows(json, field->width, field, values, place, decoder)))
        return false;
    *out = (struct numbers){count, values};
    return true;
}

static bool decode_matrix(const json_t *json, const struct field *field, struct matrix *out,
                          const struct place *place, struct decoder *decoder)
{
    if (!json_is_array(json)) return wrong_type(json, "an array of rows", place, decoder);
    struct place first = {place, NULL, 0};
    size_t rows = json_array_size(json), columns = json_array_size(json_array_get(json, 0));
    if (field->width == 1 && rows && json_is_number(json_array_get(json, 0))) {
        struct numbers column;
        if (!decode_numbers(json, field, &column, place, decoder)) return false;
        *out = (struct matrix){column.count, 1, column.values};
        return true;
    }
    if (!rows) return api_problem_at(decoder->problem, place, "has 0 rows, must have at least 1");
    if (!columns)
        return api_problem_at(decoder->problem, &first, "must be an array of at least 1 number");
    if (!check_rows(json, columns, place, decoder)) return false;
    double *values = api_arena_array(decoder->arena, rows, columns * sizeof *values);
    if (!values) return api_problem_memory(decoder->problem);
    if (!decode_rows(json, columns, field, values, place, decoder)) return false;
    *out = (struct matrix){rows, columns, values};
    return true;
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
    if (!json_is_array(json)) return wrong_type(json, "an array of objects", place, decoder);
    size_t n = json_array_size(json);
    if (!count_fits(n, field)) return wrong_count(n, field, place, decoder);
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
    case FIELD_WORD:
        return json_is_string(json) && !strcmp(json_string_value(json), field->name);
    case FIELD_ENUM:
    case FIELD_TEXT:
        return json_is_string(json);
    case FIELD_NUMBER:
    case FIELD_INTEGER:
        return json_is_number(json);
    case FIELD_BOOL:
        return json_is_boolean(json);
    case FIELD_OBJECT:
    case FIELD_OPTION:
        return json_is_object(json);
    default:
        return json_is_array(json);
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
        return api_problem_at(decoder->problem, place, "\"%.40s\" is not known here",
                              json_string_value(json));
    return api_problem_at(decoder->problem, place, "cannot be %s", type_name(json));
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

static bool decode_printed(const json_t *json, const struct field *field, const struct place *place,
                           struct decoder *decoder)
{
    struct field element = {.type = FIELD_COLOUR, .min = field->min, .max = field->max};
    if (!json_is_array(json)) return wrong_type(json, "an array", place, decoder);
    for (size_t i = 0; i < json_array_size(json); i++) {
        struct place at = {place, NULL, i};
        struct colour colour;
        const json_t *item = json_array_get(json, i);
        if (field->width == 1 && !json_is_number(item))
            return wrong_type(item, "a number", &at, decoder);
        if (!decode_colour(item, &element, &colour, &at, decoder)) return false;
    }
    return true;
}

static bool decode_value(const json_t *json, const struct field *field, void *object,
                         const struct place *place, struct decoder *decoder)
{
    void *out = (char *)object + field->offset;
    switch (field->type) {
    case FIELD_NUMBER:
        return decode_number(json, field, out, place, decoder);
    case FIELD_INTEGER:
        return decode_integer(json, field, out, place, decoder);
    case FIELD_BOOL:
        if (!json_is_boolean(json)) return wrong_type(json, "true or false", place, decoder);
        *(bool *)out = json_is_true(json);
        return true;
    case FIELD_ENUM:
        return decode_enum(json, field, out, place, decoder);
    case FIELD_SET:
        return decode_set(json, field, out, place, decoder);
    case FIELD_TEXT:
        return decode_text(json, out, place, decoder);
    case FIELD_COLOUR:
        return decode_colour(json, field, out, place, decoder);
    case FIELD_NUMBERS:
        return decode_numbers(json, field, out, place, decoder);
    case FIELD_VECTORS:
        return decode_vectors(json, field, out, place, decoder);
    case FIELD_MATRIX:
        return decode_matrix(json, field, out, place, decoder);
    case FIELD_OBJECT:
        return decode_object(json, field, out, place, decoder);
    case FIELD_OPTION:
        return decode_option(json, field, out, place, decoder);
    case FIELD_LIST:
        return decode_list(json, field, out, place, decoder);
    case FIELD_UNION:
        return decode_union(json, field, out, place, decoder);
    case FIELD_PRINTED:
        return decode_printed(json, field, place, decoder);
    case FIELD_WORD:
    case FIELD_END:
        break;
    }
    return true;
}

/* ---- Objects ------------------------------------------------------------------------------ */

static void clear_value(const struct field *field, void *object)
{
    void *out = (char *)object + field->offset;
    bool given = field->presence == FIELD_DEFAULT;
    switch (field->type) {
    case FIELD_NUMBER:
        *(double *)out = given ? field->initial : NAN;
        break;
    case FIELD_INTEGER:
        *(int64_t *)out = given ? (int64_t)field->initial : -1;
        break;
    case FIELD_BOOL:
        *(bool *)out = given && field->initial != 0;
        break;
    case FIELD_ENUM:
    case FIELD_UNION:
        *(int *)out = given ? (int)field->initial : -1;
        break;
    case FIELD_SET:
        *(uint32_t *)out = given ? (uint32_t)field->initial : 0;
        break;
    case FIELD_TEXT:
        *(const char **)out = NULL;
        break;
    case FIELD_COLOUR:
        *(struct colour *)out = (struct colour){given, {given ? field->initial : NAN}};
        break;
    case FIELD_NUMBERS:
    case FIELD_VECTORS:
        *(struct numbers *)out = (struct numbers){0};
        break;
    case FIELD_MATRIX:
        *(struct matrix *)out = (struct matrix){0};
        break;
    case FIELD_OBJECT:
        api_field_clear(field->fields, out);
        break;
    case FIELD_OPTION:
        *(void **)out = NULL;
        break;
    case FIELD_LIST:
        *(struct list *)out = (struct list){0};
        break;
    case FIELD_PRINTED:
        *(struct text **)out = NULL;
        break;
    case FIELD_WORD:
    case FIELD_END:
        break;
    }
}

void api_field_clear(const struct field *fields, void *object)
{
    for (; fields->type; fields++) clear_value(fields, object);
}

bool api_decode(const json_t *json, const struct field *fields, void *object,
                const struct place *place, struct decoder *decoder)
{
    if (!json_is_object(json)) return wrong_type(json, "an object", place, decoder);
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
            ok = api_problem_at(decoder->problem, &at, "is not a known member");
        if (decoder->problem->count >= PROBLEM_ERRORS_MAX) return false;
    }
    for (; fields->type; fields++) {
        struct place at = {place, fields->name, 0};
        if (fields->presence == FIELD_MUST && !json_object_get(json, fields->name))
            ok = api_problem_at(decoder->problem, &at, "is required");
    }
    return ok;
}
