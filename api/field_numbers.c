#include "field_numbers.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

bool api_json_is_number(const json_t *json)
{
    return json_is_real(json);
}

bool api_json_is_array(const json_t *json)
{
    return json_is_array(json) || json_is_integer(json);
}

const char *api_json_type_name(const json_t *json)
{
    switch (json_typeof(json)) {
    case JSON_OBJECT: return "an object";
    case JSON_ARRAY:
    case JSON_INTEGER: /* array.h */ return "an array";
    case JSON_STRING: return "a string";
    case JSON_REAL: return "a number";
    case JSON_TRUE:
    case JSON_FALSE: return "a boolean";
    default: return "null";
    }
}

bool api_wrong_type(const json_t *json, const char *expected, const struct place *place,
                    struct decoder *decoder)
{
    if (json_is_string(json))
        return api_problem_at(decoder->problem, place, "must be %s, not \"%.40s\"", expected,
                              json_string_value(json));
    return api_problem_at(decoder->problem, place, "must be %s, not %s", expected,
                          api_json_type_name(json));
}

bool api_check_count(size_t count, const struct field *field, const struct place *place,
                     struct decoder *decoder)
{
    if (count >= field->min_items && (!field->max_items || count <= field->max_items)) return true;
    if (field->min_items == field->max_items)
        return api_problem_at(decoder->problem, place, "has %zu elements, must have %zu", count,
                              field->min_items);
    bool few = count < field->min_items;
    return api_problem_at(decoder->problem, place, "has %zu elements, must have at %s %zu", count,
                          few ? "least" : "most", few ? field->min_items : field->max_items);
}

/* The closed interval of doubles that are finite and in range. */
static void interval(const struct field *field, double *low, double *high)
{
    *low = -DBL_MAX;
    *high = DBL_MAX;
    if (!(field->min < field->max)) return;
    *low = field->open_min ? nextafter(field->min, INFINITY) : field->min;
    *high = field->open_max ? nextafter(field->max, -INFINITY) : field->max;
}

bool api_check_number(double x, const struct field *field, const struct place *place,
                      struct decoder *decoder)
{
    double low, high;
    char value[NUMBER_ROOM], range[2 * NUMBER_ROOM + 8];
    interval(field, &low, &high);
    if (x >= low && x <= high) return true;
    if (!isfinite(x)) return api_problem_at(decoder->problem, place, "is not a finite number");
    api_number_print(value, x);
    api_field_range(field, range, sizeof range);
    return api_problem_at(decoder->problem, place, "%s is outside %s", value, range);
}

/* ---- The array behind a JSON value ----------------------------------------------------------- */

static bool array_of(const json_t *json, struct decoder *decoder, struct number_array *out);

/* Rows of an array that was not lifted: something in it is no number, or it is empty. */
static void find_flaw_in_rows(const json_t *json, struct decoder *decoder,
                              struct number_array *array)
{
    array->nested = true;
    for (size_t i = 0; i < array->rows && !array->flaw; i++) {
        struct number_array row;
        const json_t *item = json_array_get(json, i);
        array->row = i;
        if (!api_json_is_array(item)) {
            array->flaw = ARRAY_NO_ROW;
            array->what = api_json_type_name(item);
            continue;
        }
        array_of(item, decoder, &row);
        array->found = row.nested ? row.rows : row.count;
        if (!i) array->columns = array->found;
        if (row.flaw || row.nested) {
            array->flaw = ARRAY_NO_NUMBER;
            array->column = row.nested ? 0 : row.column;
            array->what = row.nested ? "an array" : row.what;
        } else if (array->found != array->columns) {
            array->flaw = ARRAY_RAGGED;
        }
    }
}

/* The array of the document that json stands for, or what is wrong with one that was not lifted. */
static bool array_of(const json_t *json, struct decoder *decoder, struct number_array *out)
{
    if (json_is_integer(json)) { /* made by api_lift or api_json_form alone */
        *out = decoder->arena->document->arrays[json_integer_value(json)];
        return true;
    }
    size_t n = json_array_size(json);
    *out = (struct number_array){.rows = n, .count = n};
    if (n && api_json_is_array(json_array_get(json, 0))) {
        find_flaw_in_rows(json, decoder, out);
        return out->flaw || !out->columns;
    }
    for (size_t i = 0; i < n && !out->flaw; i++) {
        const json_t *item = json_array_get(json, i);
        if (api_json_is_number(item)) continue;
        out->flaw = ARRAY_NO_NUMBER;
        out->column = i;
        out->what = api_json_type_name(item);
    }
    return out->flaw || !n;
}

static bool refuse_flaw(const struct number_array *array, const struct place *place,
                        struct decoder *decoder)
{
    struct place row = {place, NULL, array->row};
    struct place at = {array->nested ? &row : place, NULL, array->column};
    if (array->flaw == ARRAY_NO_NUMBER)
        return api_problem_at(decoder->problem, &at, "must be a number, not %s", array->what);
    if (array->flaw == ARRAY_CUT)
        return api_problem_at(decoder->problem, place,
                              "has %zu bytes, must have a multiple of %zu: raw numbers or .npy "
                              "(JSON stands in the part \"request\")",
                              array->found, array->columns);
    if (array->flaw == ARRAY_NO_ROW)
        return api_problem_at(decoder->problem, &row, "must be an array of numbers, not %s",
                              array->what);
    return api_problem_at(decoder->problem, &row, "has %zu elements, must have %zu", array->found,
                          array->columns);
}

/* Any array without flaw. */
static bool sound_array(const json_t *json, const char *expected, const struct place *place,
                        struct decoder *decoder, struct number_array *array)
{
    if (!api_json_is_array(json)) return api_wrong_type(json, expected, place, decoder);
    bool known = array_of(json, decoder, array);
    if (array->flaw) return refuse_flaw(array, place, decoder);
    return known || api_problem(decoder->problem, 500, "an array of numbers was not lifted");
}

static size_t length_of(const struct number_array *array)
{
    return array->nested ? array->rows : array->count;
}

/* ---- Its numbers -------------------------------------------------------------------------------- */

static double element(const struct number_array *array, size_t i)
{
    double x;
    float f;
    if (array->type == ARRAY_DOUBLE) {
        memcpy(&x, (const char *)array->data + i * sizeof x, sizeof x);
        return x;
    }
    memcpy(&f, (const char *)array->data + i * sizeof f, sizeof f);
    return f;
}

/* Without a branch, so that it costs a fraction of a nanosecond each. */
static bool all_between(const struct number_array *array, double low, double high)
{
    bool good = true;
    if (array->type == ARRAY_DOUBLE)
        for (size_t i = 0; i < array->count; i++) {
            double x;
            memcpy(&x, (const char *)array->data + i * sizeof x, sizeof x);
            good &= (x >= low) & (x <= high);
        }
    else
        for (size_t i = 0; i < array->count; i++) {
            float x;
            memcpy(&x, (const char *)array->data + i * sizeof x, sizeof x);
            good &= (x >= low) & (x <= high);
        }
    return good;
}

/* Finite and in range; columns: of the rows in which an error is told, 0 for none. */
static bool check_elements(const struct number_array *array, const struct field *field,
                           const struct place *place, struct decoder *decoder)
{
    double low, high;
    interval(field, &low, &high);
    if (all_between(array, low, high)) return true;
    size_t columns = array->nested ? array->columns : 0;
    for (size_t i = 0; i < array->count; i++) {
        struct place row = {place, NULL, columns ? i / columns : 0};
        struct place at = {columns ? &row : place, NULL, columns ? i % columns : i};
        if (!api_check_number(element(array, i), field, &at, decoder)) return false;
    }
    return true;
}

/* Checked and as doubles; the document's own where they are. */
static const double *doubles_of(const struct number_array *array, const struct field *field,
                                const struct place *place, struct decoder *decoder)
{
    if (!check_elements(array, field, place, decoder)) return NULL;
    if (array->type == ARRAY_DOUBLE && array->data && (uintptr_t)array->data % sizeof(double) == 0)
        return array->data;
    double *values = api_arena_doubles(decoder->arena, array->count);
    if (!values) {
        api_problem_memory(decoder->problem);
        return NULL;
    }
    for (size_t i = 0; i < array->count; i++) values[i] = element(array, i);
    return values;
}

/* Floats stay floats where the field says so. */
static bool take_numbers(const struct number_array *array, size_t count, const struct field *field,
                         struct numbers *out, const struct place *place, struct decoder *decoder)
{
    *out = (struct numbers){.count = count};
    if (array->type == ARRAY_FLOAT && field->as_sent) {
        ((struct sent_numbers *)(void *)out)->floats = array->data;
        return !(field->min < field->max) || check_elements(array, field, place, decoder);
    }
    out->values = doubles_of(array, field, place, decoder);
    return out->values;
}

/* ---- Members ------------------------------------------------------------------------------------- */

static bool decode_colour(const json_t *json, const struct field *field, struct colour *out,
                          const struct place *place, struct decoder *decoder)
{
    if (api_json_is_number(json)) {
        out->channels = 1;
        out->value[0] = json_real_value(json);
        return api_check_number(out->value[0], field, place, decoder);
    }
    struct number_array array;
    if (!sound_array(json, "a number or [r,g,b]", place, decoder, &array)) return false;
    if (length_of(&array) != 3)
        return api_problem_at(decoder->problem, place, "has %zu elements, must have 3",
                              length_of(&array));
    if (array.nested) {
        struct place at = {place, NULL, 0};
        return api_problem_at(decoder->problem, &at, "must be a number, not an array");
    }
    if (!check_elements(&array, field, place, decoder)) return false;
    for (size_t i = 0; i < 3; i++) out->value[i] = element(&array, i);
    out->channels = 3;
    return true;
}

static bool decode_list(const json_t *json, const struct field *field, struct numbers *out,
                        const struct place *place, struct decoder *decoder)
{
    struct number_array array;
    if (!sound_array(json, "an array of numbers", place, decoder, &array)) return false;
    struct place at = {place, NULL, 0};
    if (array.nested && array.columns == 1) array.nested = false; /* a column, as .npy may hold */
    if (array.nested)
        return api_problem_at(decoder->problem, &at, "must be a number, not an array");
    return api_check_count(array.count, field, place, decoder) &&
           take_numbers(&array, array.count, field, out, place, decoder);
}

static bool decode_vectors(const json_t *json, const struct field *field, struct numbers *out,
                           const struct place *place, struct decoder *decoder)
{
    struct number_array array;
    if (!sound_array(json, "an array of vectors", place, decoder, &array)) return false;
    if (!array.nested && array.count % field->width)
        return api_problem_at(decoder->problem, place,
                              "has %zu numbers, must have a multiple of %zu", array.count,
                              field->width);
    size_t count = array.nested ? array.rows : array.count / field->width;
    if (!api_check_count(count, field, place, decoder)) return false;
    struct place row = {place, NULL, 0};
    if (array.nested && array.columns != field->width)
        return api_problem_at(decoder->problem, &row, "has %zu elements, must have %zu",
                              array.columns, field->width);
    return take_numbers(&array, count, field, out, place, decoder);
}

static bool decode_matrix(const json_t *json, const struct field *field, struct matrix *out,
                          const struct place *place, struct decoder *decoder)
{
    struct number_array array;
    if (!sound_array(json, "an array of rows", place, decoder, &array)) return false;
    struct place first = {place, NULL, 0};
    if (!length_of(&array))
        return api_problem_at(decoder->problem, place, "has 0 %s, must have at least %zu",
                              field->width == 1 ? "elements" : "rows",
                              field->min_items ? field->min_items : 1);
    bool is_column = !array.nested && field->width == 1;
    if (!array.nested && !is_column)
        return api_problem_at(
            decoder->problem, &first,
            "must be an array of at least 1 number (in a form: .npy of two dimensions, as raw "
            "numbers have no rows)");
    if (array.nested && !array.columns)
        return api_problem_at(decoder->problem, &first, "must be an array of at least 1 number");
    if (is_column && !api_check_count(array.count, field, place, decoder)) return false;
    const double *values = doubles_of(&array, field, place, decoder);
    *out = (struct matrix){is_column ? array.count : array.rows, is_column ? 1 : array.columns,
                           values};
    return values;
}

/* Of an answer: numbers, or all of them [r,g,b]. */
static bool decode_printed(const json_t *json, const struct field *field, const struct place *place,
                           struct decoder *decoder)
{
    struct number_array array;
    struct place at = {place, NULL, 0};
    if (!sound_array(json, "an array", place, decoder, &array)) return false;
    if (array.nested && (field->width == 1 || array.columns != 3))
        return api_problem_at(decoder->problem, &at, "must be %s",
                              field->width == 1 ? "a number" : "[r,g,b]");
    return check_elements(&array, field, place, decoder);
}

bool api_decode_numbers(const json_t *json, const struct field *field, void *out,
                        const struct place *place, struct decoder *decoder)
{
    switch (field->type) {
    case FIELD_COLOUR: return decode_colour(json, field, out, place, decoder);
    case FIELD_NUMBERS: return decode_list(json, field, out, place, decoder);
    case FIELD_VECTORS: return decode_vectors(json, field, out, place, decoder);
    case FIELD_MATRIX: return decode_matrix(json, field, out, place, decoder);
    default: return decode_printed(json, field, place, decoder);
    }
}
