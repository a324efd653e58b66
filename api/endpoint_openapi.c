/* GET /v1/openapi.json: the API as OpenAPI 3.1, printed from the tables that decode and encode. */
#include "endpoint.h"
#include "representation.h"
#include "schema.h"

#include <stdlib.h>
#include <string.h>

static const char description[] =
    "Evaluates, samples, fits and filters microfacet BRDFs, and says with every number how "
    "accurate it is. Angles are in radians; directions are unit vectors in the tangent frame, +z "
    "the normal; wi points towards the light, wo towards the viewer. Members and query "
    "parameters of a request that are not known are refused.";

static void string_member(struct text *text, const char *name, const char *value)
{
    api_text_string(text, name);
    api_text_put(text, ":");
    api_text_string(text, value);
}

/* "post" of "POST". */
static void lower_case(struct text *text, const char *word)
{
    for (; *word; word++) {
        char c = *word >= 'A' && *word <= 'Z' ? (char)(*word - 'A' + 'a') : *word;
        api_text_bytes(text, &c, 1);
    }
}

/* "eval" of "/v1/eval", "openapi" of "/v1/openapi.json". */
static void operation_id(struct text *text, const char *path)
{
    const char *name = strrchr(path, '/') + 1;
    api_text_put(text, ",\"operationId\":\"");
    api_text_bytes(text, name, strcspn(name, "."));
    api_text_put(text, "\"");
}

/* What a query can hold of a member: all of it, of a union one alternative; NULL: nothing. */
static const struct field *in_query(const struct field *field)
{
    switch (field->type) {
    case FIELD_NUMBER:
    case FIELD_INTEGER:
    case FIELD_BOOL:
    case FIELD_ENUM:
    case FIELD_TEXT: return field;
    case FIELD_UNION:
        for (const struct field *form = field->fields; form->type; form++)
            if (in_query(form)) return form;
        return NULL;
    default: return NULL;
    }
}

/* Flat members may also stand in the query; that is how a raw body gets its options. */
static void parameters(struct text *text, const struct endpoint *endpoint)
{
    const char *separator = ",\"parameters\":[";
    if (!endpoint->bodies) return;
    for (const struct field *field = endpoint->request; field->type; field++) {
        const struct field *held = in_query(field);
        if (!held) continue;
        api_text_put(text, separator);
        api_text_put(text, "{\"in\":\"query\",");
        string_member(text, "name", field->name);
        api_text_put(text, ",\"schema\":");
        api_schema_field(text, held);
        api_text_put(text, "}");
        separator = ",";
    }
    if (!separator[1]) api_text_put(text, "]");
}

/* Members whose numbers may come as a part of a form. */
static bool fits_part(const struct field *field)
{
    switch (field->type) {
    case FIELD_NUMBERS:
    case FIELD_VECTORS:
    case FIELD_MATRIX: return true;
    case FIELD_UNION: return fits_part(field->fields);
    default: return false;
    }
}

static void form(struct text *text, const struct endpoint *endpoint)
{
    bool any = false;
    for (const struct field *f = endpoint->request; f->type; f++) any |= fits_part(f);
    if (!any) return;
    api_text_put(
        text, ",\"multipart/form-data\":{\"schema\":{\"type\":\"object\","
              "\"description\":\"The JSON without the arrays, and each array as .npy or, where its "
              "type here is application/octet-stream, as raw little-endian numbers of type dtype\","
              "\"required\":[\"request\"],"
              "\"properties\":{\"request\":{\"type\":\"object\"}");
    for (const struct field *f = endpoint->request; f->type; f++) {
        if (!fits_part(f)) continue;
        api_text_put(text, ",");
        api_text_string(text, f->name);
        api_text_put(text, ":{");
        if (f->doc) {
            string_member(text, "description", f->doc);
            api_text_put(text, ",");
        }
        bool has_rows = f->type == FIELD_MATRIX &&
                        f->width != 1; /* which raw numbers do not tell */
        api_text_print(text, "\"type\":\"string\",\"contentMediaType\":\"application/%s\"}",
                       has_rows ? "x-npy" : "octet-stream");
    }
    api_text_put(text, "}},\"encoding\":{\"request\":{\"contentType\":\"application/json\"}}}");
}

static void request_body(struct text *text, const struct endpoint *endpoint)
{
    if (!endpoint->request) return;
    api_text_put(
        text, ",\"requestBody\":{\"required\":true,\"content\":{\"application/json\":{\"schema\":");
    api_schema_object(text, endpoint->request);
    if (endpoint->example) {
        api_text_put(text, ",\"example\":");
        api_text_put(text, endpoint->example);
    }
    api_text_put(text, "}");
    form(text, endpoint);
    for (const struct medium *m = endpoint->bodies; m && m->type; m++) {
        api_text_put(text, ",");
        api_text_string(text, m->type);
        api_text_put(text, ":{}");
    }
    api_text_put(text, "}}");
}

static void responses(struct text *text, const struct endpoint *endpoint)
{
    api_text_put(text, ",\"responses\":{\"200\":{\"description\":\"Done\",");
    if (endpoint->answers == api_array_answers)
        api_text_put(
            text,
            "\"headers\":{\"Facet-Layout\":{\"description\":\"Binary answers: JSON, a list of "
            "{name, dtype, shape} in the order of the body\",\"schema\":{\"type\":"
            "\"string\"}},\"Facet-Answer\":{\"description\":\"Binary answers: the JSON answer "
            "without its arrays\",\"schema\":{\"type\":\"string\"}}},");
    api_text_put(text, "\"content\":{\"application/json\":{\"schema\":");
    if (endpoint->response)
        api_schema_object(text, endpoint->response);
    else
        api_text_put(text, "{\"type\":\"object\"}");
    api_text_put(text, "}");
    for (const char *const *type = endpoint->answers; type && *type; type++) {
        api_text_put(text, ",");
        api_text_string(text, *type);
        api_text_put(text, ":{}");
    }
    api_text_put(text, "}}");
    /* Who takes no body has none of a wrong type, and refuses a query unless it is a probe. */
    static const char *const refusals[] = {"415", "400", "422", "406", "413", "414", "503"};
    const size_t first = endpoint->request ? 0 : endpoint->is_probe ? 3 : 1;
    for (size_t i = first; i < sizeof refusals / sizeof *refusals; i++)
        api_text_print(text, ",\"%s\":{\"$ref\":\"#/components/responses/Problem\"}", refusals[i]);
    api_text_put(text, "}");
}

static void path_item(struct text *text, const struct endpoint *endpoint)
{
    api_text_string(text, endpoint->path);
    api_text_put(text, ":{\"");
    lower_case(text, endpoint->method);
    api_text_put(text, "\":{");
    string_member(text, "summary", endpoint->summary);
    api_text_put(text, ",");
    string_member(text, "description", endpoint->doc ? endpoint->doc : endpoint->summary);
    api_text_put(text, strcmp(endpoint->method, "POST") ? ",\"tags\":[\"service\"]"
                                                        : ",\"tags\":[\"materials\"]");
    operation_id(text, endpoint->path);
    parameters(text, endpoint);
    request_body(text, endpoint);
    responses(text, endpoint);
    api_text_put(text, "}}");
}

static void components(struct text *text)
{
    api_text_put(text, ",\"components\":{\"schemas\":{");
    api_schema_shared(text);
    api_text_put(
        text, ",\"Problem\":{\"description\":\"RFC 9457\",\"type\":\"object\","
              "\"required\":[\"type\",\"title\",\"status\",\"detail\"],\"properties\":{"
              "\"type\":{\"type\":\"string\"},\"title\":{\"type\":\"string\"},"
              "\"status\":{\"type\":\"integer\"},\"detail\":{\"type\":\"string\"},"
              "\"errors\":{\"type\":\"array\",\"items\":{\"type\":\"object\","
              "\"required\":[\"pointer\",\"detail\"],\"properties\":{"
              "\"pointer\":{\"description\":\"JSON pointer into the request (RFC "
              "6901)\",\"type\":\"string\"},"
              "\"detail\":{\"type\":\"string\"}}}}}}},"
              "\"responses\":{\"Problem\":{\"description\":\"Refused; detail and errors say why\","
              "\"content\":{\"application/problem+json\":{\"schema\":"
              "{\"$ref\":\"#/components/schemas/Problem\"}}}}}}");
}

static bool handle(struct call *call)
{
    struct text text = api_text(call->arena);
    api_text_put(&text, "{\"openapi\":\"3.1.0\",\"info\":{\"title\":\"facetd\",\"version\":\"1\",");
    string_member(&text, "description", description);
    api_text_put(&text,
                 ",\"license\":{\"name\":\"MIT\",\"identifier\":\"MIT\"},"
                 "\"contact\":{\"name\":\"who runs this facetd\"}},"
                 "\"servers\":[{\"url\":\"/\"}],\"security\":[],\"tags\":["
                 "{\"name\":\"materials\",\"description\":\"Materials, measurements and maps\"},"
                 "{\"name\":\"service\",\"description\":\"The service itself\"}],"
                 "\"paths\":{");
    for (size_t i = 0; api_endpoint(i); i++) {
        if (i) api_text_put(&text, ",");
        path_item(&text, api_endpoint(i));
    }
    api_text_put(&text, "}");
    components(&text);
    api_text_put(&text, "}\n");
    size_t size;
    char *bytes = api_text_take(&text, &size);
    if (!bytes) return api_problem_memory(call->problem);
    return api_answer_raw(call, "application/json", bytes, size);
}

const struct endpoint api_endpoint_openapi = {
    .method = "GET",
    .path = "/v1/openapi.json",
    .summary = "This document",
    .handle = handle,
};
