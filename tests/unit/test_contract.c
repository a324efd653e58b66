/* Every endpoint: its example works, its answers decode by its own table, hostile bodies are
 * refused. */
#include "ask.h"
#include "check.h"
#include "endpoint.h"
#include "json.h"
#include "limits.h"
#include "tolerance.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>

static const char golden[] = "api/openapi.json";

static struct answer ask_example(const struct endpoint *endpoint)
{
    return ask(endpoint->method, endpoint->path, endpoint->example);
}

/* The answer, strictly: unknown, missing and out-of-range members fail. */
static void check_answer(const struct endpoint *endpoint, const struct answer *answer)
{
    struct arena arena;
    struct problem problem = {0};
    api_arena_open(&arena, LIMIT_REQUEST_MEMORY);
    struct document document = {0};
    struct decoder decoder = {.arena = &arena, .problem = &problem};
    void *out = api_arena_array(&arena, 1, endpoint->response_size);
    if (!api_json_read(answer->response.body, answer->response.body_size, &arena, &problem,
                       &document) ||
        !api_decode(document.root, endpoint->response, out, NULL, &decoder))
        check_fail(__FILE__, __LINE__, "%s: %s", endpoint->path, problem.detail);
    json_decref(document.root);
    api_arena_close(&arena);
}

TEST(every_endpoint_answers_as_its_table_says)
{
    for (size_t i = 0; api_endpoint(i); i++) {
        const struct endpoint *endpoint = api_endpoint(i);
        if (endpoint->request && !endpoint->example)
            check_fail(__FILE__, __LINE__, "%s has no example", endpoint->path);
        struct answer answer = ask_example(endpoint);
        if (answer.response.status != 200)
            check_fail(__FILE__, __LINE__, "%s: %.300s", endpoint->path,
                       (char *)answer.response.body);
        else if (endpoint->response && answer.json)
            check_answer(endpoint, &answer);
        answer_clear(&answer);
    }
}

TEST(every_output_decodes)
{
    struct answer answer = ask_post(
        "/v1/eval",
        "{\"material\":{\"alpha\":0.3,\"fresnel\":{\"conductor\":{\"metal\":\"Cu\"}}},"
        "\"wi\":{\"random\":{\"n\":5}},\"wo\":{\"random\":{\"n\":5,\"seed\":1}},"
        "\"outputs\":[\"fr\","
        "\"fr_cos\",\"pdf\",\"D\",\"D_vis\",\"G\",\"G1_i\",\"G1_o\",\"F\",\"sigma_o\"]}");
    CHECK_INT(answer.response.status, 200);
    CHECK_INT(json_object_size(answer.json), 13); /* with sampler, count, accuracy */
    check_answer(api_endpoint(0), &answer);
    answer_clear(&answer);
}

TEST(tier_names_are_those_of_lib)
{
    for (int i = 0; i < FACET_TIER_COUNT; i++)
        CHECK_STR(api_tier_names[i], facet_tier_name((facet_tier)i));
}

/* However many limits the server announces. */
TEST(capabilities_list_every_limit)
{
    enum { MANY = 100 };
    static struct api_limit many[MANY];
    for (int i = 0; i < MANY; i++) many[i] = (struct api_limit){"a_limit", i, "of a test"};
    api_announce_limits(many, MANY);
    struct answer a = ask("GET", "/v1/capabilities", NULL);
    CHECK_INT(answer_count(&a, "limits"), api_limit_count());
    CHECK(api_limit_count() > MANY);
    answer_clear(&a);
    api_announce_limits(NULL, 0);
}

/* The bound that /v1/eval answers for the fr of a table of 25 nodes, rows of them or none, in a tier. */
static double bound_of_table(const char *tier, size_t rows)
{
    enum { NODES = 25 };
    char body[2048] = "{\"material\":{\"ndf\":\"tabulated\",\"alpha\":0.3,\"slopes\":{\"scale\":1,"
                      "\"log_D\":[";
    for (size_t k = 0; k < NODES * (rows ? rows : 1); k++) {
        const char *before = !rows || k % NODES ? k ? ",0" : "0" : k ? "],[0" : "[0";
        strcat(body, before);
    }
    snprintf(body + strlen(body), sizeof body - strlen(body),
             "%s]}},\"wi\":[[0,0,1]],\"wo\":[[0,0.6,0.8]],\"outputs\":[\"fr\"],\"tier\":\"%s\"}",
             rows ? "]" : "", tier);
    struct answer a = ask_post("/v1/eval", body);
    CHECK_INT(a.response.status, 200);
    double bound = answer_bound(&a);
    answer_clear(&a);
    return bound;
}

/* Closed forms, a radial table and one over the azimuth, in every tier, and the same the next time. */
TEST(capabilities_tell_what_every_model_costs)
{
    static const char *const ndfs[] = {"ggx", "beckmann", "tabulated", "tabulated"};
    struct answer a = ask("GET", "/v1/capabilities", NULL),
                  b = ask("GET", "/v1/capabilities", NULL);
    json_t *tiers = json_object_get(a.json, "tiers"), *tier;
    size_t i, k, q;
    CHECK(json_equal(tiers, json_object_get(b.json, "tiers")));
    CHECK_INT(json_array_size(tiers), FACET_TIER_COUNT);
    json_array_foreach(tiers, i, tier)
    {
        const char *name = json_string_value(json_object_get(tier, "name"));
        json_t *models = json_object_get(tier, "models"), *model, *quantity;
        CHECK_INT(json_array_size(models), 4);
        json_array_foreach(models, k, model)
        {
            json_t *list = json_object_get(model, "quantities"),
                   *rows = json_object_get(model, "azimuths");
            double bound = answer_value(json_object_get(model, "bound"));
            CHECK_STR(json_string_value(json_object_get(model, "ndf")), ndfs[k]);
            CHECK_INT(json_integer_value(rows), k == 3 ? 12 : 0);
            CHECK_INT(json_array_size(list), FACET_QUANTITY_COUNT);
            json_array_foreach(list, q, quantity)
            {
                CHECK(answer_value(json_object_get(quantity, "ns")) > 0 || q == FACET_F);
                CHECK(answer_value(json_object_get(quantity, "bound")) < 1e-2);
            }
            if (k < 2) continue;
            double asked = bound_of_table(name, k == 3 ? 12 : 0); /* printed digits included */
            CHECK(bound > 0 && asked >= bound && asked <= 1.2 * bound);
        }
    }
    answer_clear(&a);
    answer_clear(&b);
}

/* malloc'd text of a JSON value. */
static char *dump(const json_t *json, size_t flags)
{
    size_t size = json_dumpb(json, NULL, 0, flags);
    char *text = calloc(size + 1, 1);
    if (text) json_dumpb(json, text, size, flags);
    return text;
}

TEST(openapi_is_the_golden_copy)
{
    struct answer answer = ask("GET", "/v1/openapi.json", NULL);
    char *text = dump(answer.json, JSON_INDENT(1));
    if (getenv("FACET_REWRITE")) {
        FILE *f = fopen(golden, "w");
        CHECK(f && fprintf(f, "%s\n", text) > 0 && !fclose(f));
    }
    size_t size;
    char *kept = check_read_file(golden, &size);
    CHECK(kept && text && !strncmp(kept, text, strlen(text)) && size == strlen(text) + 1);
    if (kept && text && strncmp(kept, text, strlen(text)))
        check_fail(__FILE__, __LINE__, "the API changed: `make openapi` rewrites %s, commit it",
                   golden);
    free(kept);
    free(text);
    answer_clear(&answer);
}

TEST(openapi_names_every_endpoint_and_no_missing_schema)
{
    struct answer answer = ask("GET", "/v1/openapi.json", NULL);
    json_t *paths = json_object_get(answer.json, "paths");
    json_t *schemas = json_object_get(json_object_get(answer.json, "components"), "schemas");
    for (size_t i = 0; api_endpoint(i); i++) CHECK(json_object_get(paths, api_endpoint(i)->path));
    static const char prefix[] = "\"$ref\":\"#/components/schemas/";
    char *text = dump(answer.json, JSON_COMPACT);
    int seen = 0;
    for (char *at = text; (at = strstr(at, prefix)); seen++) {
        at += sizeof prefix - 1;
        char name[64] = "";
        sscanf(at, "%63[^\"]", name);
        if (!json_object_get(schemas, name)) check_fail(__FILE__, __LINE__, "no schema %s", name);
    }
    CHECK(seen > 4);
    free(text);
    answer_clear(&answer);
}

/* Whatever the body: an answer with a status that is documented. */
static void check_survives(const char *path, const void *body, size_t size)
{
    struct answer a = ask_with(
        (struct api_request){.method = "POST", .path = path, .body = body, .body_size = size});
    int s = a.response.status;
    if (s != 200 && s != 400 && s != 413 && s != 415 && s != 422)
        check_fail(__FILE__, __LINE__, "%s answers %d: %.200s", path, s, (char *)a.response.body);
    CHECK(a.response.body);
    answer_clear(&a);
}

TEST(mutated_examples_are_answered)
{
    struct rng rng;
    rng_seed(&rng, 5);
    static const char alphabet[] = "{}[]\",:0123456789.-+eE \\un\x80\xff\0abc";
    for (size_t i = 0; api_endpoint(i); i++) {
        const struct endpoint *endpoint = api_endpoint(i);
        if (!endpoint->example) continue;
        size_t size = strlen(endpoint->example);
        for (int k = 0; k < 400; k++) {
            char *body = malloc(size + 1);
            memcpy(body, endpoint->example, size + 1);
            size_t cut = rng_uniform(&rng) < 0.2 ? (size_t)(rng_uniform(&rng) * (double)size)
                                                 : size;
            for (int edits = 1 + (int)(rng_uniform(&rng) * 4); edits; edits--)
                body[(size_t)(rng_uniform(&rng) * (double)size)] =
                    alphabet[(size_t)(rng_uniform(&rng) * (double)sizeof alphabet)];
            check_survives(endpoint->path, body, cut);
            free(body);
        }
    }
}

TEST(the_bodies_of_jsontestsuite_are_answered)
{
    if (!check_data("json/JSONTestSuite/LICENSE")) {
        check_skip("no shared data");
        return;
    }
    char directory[4096];
    snprintf(directory, sizeof directory, "%s", check_data("json/JSONTestSuite/LICENSE"));
    snprintf(strrchr(directory, '/'), 20, "/test_parsing");
    DIR *dir = opendir(directory);
    CHECK(dir);
    int files = 0;
    for (struct dirent *entry; dir && (entry = readdir(dir));) {
        char path[5000];
        size_t size;
        if (*entry->d_name == '.') continue;
        snprintf(path, sizeof path, "%s/%s", directory, entry->d_name);
        char *body = check_read_file(path, &size);
        if (!body) continue;
        struct answer a = ask_with((struct api_request){
            .method = "POST", .path = "/v1/eval", .body = body, .body_size = size});
        int status = a.response.status;
        /* n_: not JSON.  y_: JSON, but not a request, except for what jansson leaves out (\u0000,
         * huge numbers). */
        if (*entry->d_name == 'n' ? status != 400 : status != 422 && status != 400)
            check_fail(__FILE__, __LINE__, "%s: %d %.200s", entry->d_name, status,
                       (char *)a.response.body);
        if (status == 400 &&
            (!strstr(a.response.body, "line ") || !strstr(a.response.body, "column ")))
            check_fail(__FILE__, __LINE__, "%s: %.200s", entry->d_name, (char *)a.response.body);
        answer_clear(&a);
        for (size_t i = 0; api_endpoint(i); i++)
            if (api_endpoint(i)->request) check_survives(api_endpoint(i)->path, body, size);
        free(body);
        files++;
    }
    if (dir) closedir(dir);
    CHECK(files >= 318);
}
