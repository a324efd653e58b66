/* Structs printed as JSON by their field tables. */
#include "field.h"

#include <math.h>

static void encode_value(struct text *text, const struct field *field, const void *object);

static void encode_run(struct text *text, const double *values, size_t n)
{
    api_text_put(text, "[");
    for (size_t i = 0; i < n; i++) {
        if (i) api_text_put(text, ",");
        api_text_number(text, values[i], NUMBER_SHORTEST);
    }
    api_text_put(text, "]");
}

static void encode_rows(struct text *text, const double *values, size_t rows, size_t width)
{
    api_text_put(text, "[");
    for (size_t i = 0; i < rows; i++) {
        if (i) api_text_put(text, ",");
        encode_run(text, values + i * width, width);
    }
    api_text_put(text, "]");
}

static void encode_set(struct text *text, const struct field *field, uint32_t set)
{
    const char *separator = "[";
    for (int i = 0; field->names[i]; i++) {
        if (!(set >> i & 1)) continue;
        api_text_put(text, separator);
        api_text_string(text, field->names[i]);
        separator = ",";
    }
    api_text_put(text, "]");
}

static void encode_list(struct text *text, const struct field *field, const struct list *list)
{
    api_text_put(text, "[");
    for (size_t i = 0; i < list->count; i++) {
        if (i) api_text_put(text, ",");
        api_encode(text, field->fields, (const char *)list->items + i * field->size);
    }
    api_text_put(text, "]");
}

static bool is_absent(const struct field *field, const void *object)
{
    const void *at = (const char *)object + field->offset;
    switch (field->type) {
    case FIELD_NUMBER: return isnan(*(const double *)at);
    case FIELD_INTEGER: return *(const int64_t *)at == -1;
    case FIELD_BOOL:
        return field->presence == FIELD_DEFAULT && *(const bool *)at == (field->initial != 0);
    case FIELD_ENUM:
    case FIELD_UNION: return *(const int *)at < 0;
    case FIELD_SET: return !*(const uint32_t *)at;
    case FIELD_TEXT: return !*(const char *const *)at;
    case FIELD_COLOUR: return !((const struct colour *)at)->channels;
    case FIELD_NUMBERS:
    case FIELD_VECTORS: return !((const struct numbers *)at)->values;
    case FIELD_MATRIX: return !((const struct matrix *)at)->values;
    case FIELD_OPTION: return !*(const void *const *)at;
    case FIELD_LIST: return !((const struct list *)at)->items;
    case FIELD_PRINTED: return !*(struct text *const *)at;
    default: return false;
    }
}

bool api_field_is_given(const struct field *field, const void *object)
{
    const bool has_index = field->type == FIELD_ENUM || field->type == FIELD_UNION;
    if (is_absent(field, object)) return false;
    return !(has_index && field->presence == FIELD_DEFAULT &&
             *(const int *)((const char *)object + field->offset) == (int)field->initial);
}

static void encode_value(struct text *text, const struct field *field, const void *object)
{
    const void *at = (const char *)object + field->offset;
    const struct numbers *numbers = at;
    const struct matrix *matrix = at;
    const struct colour *colour = at;
    switch (field->type) {
    case FIELD_NUMBER: api_text_number(text, *(const double *)at, NUMBER_SHORTEST); break;
    case FIELD_INTEGER: api_text_print(text, "%lld", (long long)*(const int64_t *)at); break;
    case FIELD_BOOL: api_text_put(text, *(const bool *)at ? "true" : "false"); break;
    case FIELD_ENUM: api_text_string(text, field->names[*(const int *)at]); break;
    case FIELD_SET: encode_set(text, field, *(const uint32_t *)at); break;
    case FIELD_TEXT: api_text_string(text, *(const char *const *)at); break;
    case FIELD_COLOUR:
        if (colour->channels == 1)
            api_text_number(text, colour->value[0], NUMBER_SHORTEST);
        else
            encode_run(text, colour->value, 3);
        break;
    case FIELD_NUMBERS: encode_run(text, numbers->values, numbers->count); break;
    case FIELD_VECTORS: encode_rows(text, numbers->values, numbers->count, field->width); break;
    case FIELD_MATRIX:
        if (field->width == 1 && matrix->columns == 1)
            encode_run(text, matrix->values, matrix->rows);
        else
            encode_rows(text, matrix->values, matrix->rows, matrix->columns);
        break;
    case FIELD_OBJECT: api_encode(text, field->fields, at); break;
    case FIELD_OPTION: api_encode(text, field->fields, *(const void *const *)at); break;
    case FIELD_LIST: encode_list(text, field, at); break;
    case FIELD_UNION: encode_value(text, &field->fields[*(const int *)at], at); break;
    case FIELD_WORD: api_text_string(text, field->name); break;
    case FIELD_PRINTED: api_text_join(text, *(struct text *const *)at); break;
    case FIELD_END: break;
    }
}

void api_encode(struct text *text, const struct field *fields, const void *object)
{
    const char *separator = "{";
    for (; fields->type; fields++) {
        if (is_absent(fields, object)) continue;
        api_text_put(text, separator);
        api_text_string(text, fields->name);
        api_text_put(text, ":");
        encode_value(text, fields, object);
        separator = ",";
    }
    api_text_put(text, *separator == '{' ? "{}" : "}");
}
