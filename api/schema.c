#include "schema.h"

#include "directions.h"
#include "material.h"
#include "tolerance.h"

#include <stdlib.h>

/* Written once and referred to by name. */
static const struct {
    const char *name;
    const struct field *fields;
    bool is_union;
} shared[] = {
    {"Material", api_material_fields, false},
    {"Directions", api_direction_forms, true},
    {"Accuracy", api_accuracy_fields, false},
};

enum { SHARED_COUNT = sizeof shared / sizeof *shared };

static void member(struct text *text, const char *name, const char *value)
{
    api_text_print(text, ",\"%s\":", name);
    api_text_string(text, value);
}

static void number_member(struct text *text, const char *name, double value)
{
    api_text_print(text, ",\"%s\":", name);
    api_text_number(text, value, NUMBER_SHORTEST);
}

/* {"type":"number", range}: of a scalar, or of each element. */
static void number_schema(struct text *text, const struct field *field, const char *type)
{
    api_text_print(text, "{\"type\":\"%s\"", type);
    if (field->min < field->max) {
        number_member(text, field->open_min ? "exclusiveMinimum" : "minimum", field->min);
        number_member(text, field->open_max ? "exclusiveMaximum" : "maximum", field->max);
    }
    api_text_put(text, "}");
}

static void array_of_numbers(struct text *text, const struct field *field, size_t min, size_t max)
{
    api_text_put(text, "{\"type\":\"array\",\"items\":");
    number_schema(text, field, "number");
    if (min) api_text_print(text, ",\"minItems\":%zu", min);
    if (max) api_text_print(text, ",\"maxItems\":%zu", max);
    api_text_put(text, "}");
}

static void array_of_vectors(struct text *text, const struct field *field, size_t width)
{
    api_text_put(text, "{\"type\":\"array\",\"items\":");
    array_of_numbers(text, field, width, width);
    if (field->min_items) api_text_print(text, ",\"minItems\":%zu", field->min_items);
    if (field->max_items) api_text_print(text, ",\"maxItems\":%zu", field->max_items);
    api_text_put(text, "}");
}

static void names_schema(struct text *text, const char *const *names)
{
    for (api_text_put(text, "{\"enum\":["); *names; names++) {
        api_text_string(text, *names);
        if (names[1]) api_text_put(text, ",");
    }
    api_text_put(text, "]}");
}

static void body_schema(struct text *text, const struct field *field);

static void one_of(struct text *text, const struct field *alternatives)
{
    for (api_text_put(text, "{\"oneOf\":["); alternatives->type; alternatives++) {
        body_schema(text, alternatives);
        if (alternatives[1].type) api_text_put(text, ",");
    }
    api_text_put(text, "]}");
}

static bool reference(struct text *text, const struct field *fields)
{
    for (int i = 0; i < SHARED_COUNT; i++) {
        if (shared[i].fields != fields) continue;
        api_text_print(text, "{\"$ref\":\"#/components/schemas/%s\"}", shared[i].name);
        return true;
    }
    return false;
}

static void object_members(struct text *text, const struct field *fields, bool exactly_one)
{
    const struct field *first = fields;
    api_text_put(text, "{\"type\":\"object\",\"additionalProperties\":false");
    if (exactly_one) api_text_put(text, ",\"minProperties\":1,\"maxProperties\":1");
    const char *separator = ",\"required\":[";
    for (; fields->type; fields++) {
        if (fields->presence != FIELD_MUST) continue;
        api_text_put(text, separator);
        api_text_string(text, fields->name);
        separator = ",";
    }
    api_text_put(text, separator[1] ? ",\"properties\":{" : "],\"properties\":{");
    for (fields = first; fields->type; fields++) {
        if (fields != first) api_text_put(text, ",");
        api_text_string(text, fields->name);
        api_text_put(text, ":");
        api_schema_field(text, fields);
    }
    api_text_put(text, "}}");
}

/* The number types: scalars and the arrays of them. */
static void numeric_schema(struct text *text, const struct field *field)
{
    struct field element = *field;
    switch (field->type) {
    case FIELD_INTEGER: number_schema(text, field, "integer"); break;
    case FIELD_COLOUR:
        api_text_put(text, "{\"oneOf\":[");
        number_schema(text, field, "number");
        api_text_put(text, ",");
        array_of_numbers(text, field, 3, 3);
        api_text_put(text, "]}");
        break;
    case FIELD_NUMBERS: array_of_numbers(text, field, field->min_items, field->max_items); break;
    case FIELD_VECTORS:
        api_text_put(text, "{\"anyOf\":[");
        array_of_vectors(text, field, field->width);
        api_text_put(text, ",");
        array_of_numbers(text, field, field->min_items * field->width,
                         field->max_items * field->width);
        api_text_put(text, "]}");
        break;
    case FIELD_MATRIX:
        if (field->width == 1) api_text_put(text, "{\"anyOf\":[");
        api_text_put(text, "{\"type\":\"array\",\"items\":");
        array_of_numbers(text, field, 1, 0);
        api_text_put(text, ",\"minItems\":1}");
        if (field->width == 1) {
            api_text_put(text, ",");
            array_of_numbers(text, field, 1, 0);
            api_text_put(text, "]}");
        }
        break;
    case FIELD_PRINTED:
        element.type = field->width == 1 ? FIELD_NUMBER : FIELD_COLOUR;
        api_text_put(text, "{\"type\":\"array\",\"items\":");
        numeric_schema(text, &element);
        api_text_put(text, "}");
        break;
    default: number_schema(text, field, "number"); break;
    }
}

static void body_schema(struct text *text, const struct field *field)
{
    switch (field->type) {
    case FIELD_BOOL: api_text_put(text, "{\"type\":\"boolean\"}"); break;
    case FIELD_ENUM: names_schema(text, field->names); break;
    case FIELD_SET:
        api_text_put(text, "{\"type\":\"array\",\"minItems\":1,\"uniqueItems\":true,\"items\":");
        names_schema(text, field->names);
        api_text_put(text, "}");
        break;
    case FIELD_TEXT: api_text_put(text, "{\"type\":\"string\"}"); break;
    case FIELD_OBJECT:
    case FIELD_OPTION:
        if (!reference(text, field->fields)) object_members(text, field->fields, field->one_of);
        break;
    case FIELD_LIST:
        api_text_put(text, "{\"type\":\"array\",\"items\":");
        if (!reference(text, field->fields)) object_members(text, field->fields, false);
        if (field->max_items) api_text_print(text, ",\"maxItems\":%zu", field->max_items);
        api_text_put(text, "}");
        break;
    case FIELD_UNION:
        if (!reference(text, field->fields)) one_of(text, field->fields);
        break;
    case FIELD_WORD:
        api_text_put(text, "{\"const\":");
        api_text_string(text, field->name);
        api_text_put(text, "}");
        break;
    default: numeric_schema(text, field); break;
    }
}

/* ,"default":...: what clear_value in field.c leaves. */
static void default_member(struct text *text, const struct field *field)
{
    if (field->presence != FIELD_DEFAULT) return;
    if (field->type == FIELD_ENUM)
        member(text, "default", field->names[(int)field->initial]);
    else if (field->type == FIELD_UNION)
        member(text, "default", field->fields[(int)field->initial].name);
    else if (field->type == FIELD_BOOL)
        api_text_print(text, ",\"default\":%s", field->initial != 0 ? "true" : "false");
    else if (field->type == FIELD_SET) {
        const char *separator = ",\"default\":[";
        for (int i = 0; field->names[i]; i++) {
            if (!((uint32_t)field->initial >> i & 1)) continue;
            api_text_put(text, separator);
            api_text_string(text, field->names[i]);
            separator = ",";
        }
        api_text_put(text, "]");
    } else
        number_member(text, "default", field->initial);
}

void api_schema_field(struct text *text, const struct field *field)
{
    if (!field->doc && !field->unit && field->presence != FIELD_DEFAULT) {
        body_schema(text, field);
        return;
    }
    size_t size;
    struct text body = api_text(text->arena);
    body_schema(&body, field);
    char *bytes = api_text_take(&body, &size);
    if (!bytes) {
        text->failed = true;
        return;
    }
    api_text_put(text, "{\"description\":");
    api_text_string(text, field->doc ? field->doc : "");
    default_member(text, field);
    if (field->unit) member(text, "x-unit", field->unit);
    api_text_put(text, ",");
    api_text_bytes(text, bytes + 1, size - 1); /* the members without their opening brace */
    free(bytes);
}

void api_schema_object(struct text *text, const struct field *fields)
{
    if (!reference(text, fields)) object_members(text, fields, false);
}

void api_schema_shared(struct text *text)
{
    for (int i = 0; i < SHARED_COUNT; i++) {
        if (i) api_text_put(text, ",");
        api_text_string(text, shared[i].name);
        api_text_put(text, ":");
        if (shared[i].is_union)
            one_of(text, shared[i].fields);
        else
            object_members(text, shared[i].fields, false);
    }
}
