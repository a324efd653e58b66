#include "check.h"
#include "field.h"
#include "json.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct inner {
    double a, b;
};

struct shape {
    int form;
    double radius;
    struct inner *box;
};

struct thing {
    double alpha, open;
    int64_t n;
    bool flag;
    int kind;
    uint32_t outputs;
    const char *title;
    struct colour colour;
    struct numbers list, vectors;
    struct matrix rows;
    struct inner inner;
    struct inner *option;
    struct list items;
    struct shape shape;
};

static const char *const kinds[] = {"first", "second", "true", NULL};

static bool check_inner(void *object, const struct place *place, struct decoder *decoder)
{
    struct inner *inner = object;
    struct place at = {place, "b", 0};
    if (inner->a == inner->b) return api_problem_at(decoder->problem, &at, "equals a");
    return true;
}

static const struct field inner_fields[] = {
    {MEMBER(struct inner, a), FIELD_NUMBER, FIELD_MUST},
    {MEMBER(struct inner, b), FIELD_NUMBER},
    {0},
};

static const struct field shape_forms[] = {
    {.name = "none", .type = FIELD_WORD},
    {MEMBER(struct shape, radius), FIELD_NUMBER, .min = 0, .max = 1},
    {MEMBER(struct shape, box), FIELD_OPTION, .fields = inner_fields, .size = sizeof(struct inner),
     .one_of = true},
    {0},
};

static const struct field thing_fields[] = {
    {MEMBER(struct thing, alpha), FIELD_NUMBER, .min = 1e-8, .max = 1e4},
    {MEMBER(struct thing, open), FIELD_NUMBER, FIELD_DEFAULT, .min = 0, .max = 1, .open_min = true,
     .open_max = true, .initial = 0.5},
    {MEMBER(struct thing, n), FIELD_INTEGER, .min = 1, .max = 1 << 21},
    {MEMBER(struct thing, flag), FIELD_BOOL, FIELD_DEFAULT, .initial = 1},
    {MEMBER(struct thing, kind), FIELD_ENUM, .names = kinds},
    {MEMBER(struct thing, outputs), FIELD_SET, .names = kinds},
    {MEMBER(struct thing, title), FIELD_TEXT},
    {MEMBER(struct thing, colour), FIELD_COLOUR, .min = 0, .max = 1},
    {MEMBER(struct thing, list), FIELD_NUMBERS, .min_items = 2, .max_items = 3},
    {MEMBER(struct thing, vectors), FIELD_VECTORS, .width = 3, .min_items = 1, .max_items = 4},
    {MEMBER(struct thing, rows), FIELD_MATRIX},
    {MEMBER(struct thing, inner), FIELD_OBJECT, .fields = inner_fields, .check = check_inner},
    {MEMBER(struct thing, option), FIELD_OPTION, .fields = inner_fields,
     .size = sizeof(struct inner)},
    {MEMBER(struct thing, items), FIELD_LIST, .fields = inner_fields, .size = sizeof(struct inner)},
    {MEMBER(struct thing, shape), FIELD_UNION, FIELD_DEFAULT, .fields = shape_forms},
    {0},
};

struct trial {
    struct arena arena;
    struct problem problem;
    struct thing thing;
    bool ok;
};

static struct trial decode(const char *json, const char *query)
{
    struct trial trial = {.ok = false};
    api_arena_open(&trial.arena, 1 << 20);
    struct document document = {0};
    struct decoder decoder = {.arena = &trial.arena, .problem = &trial.problem};
    if (!json || api_json_read(json, strlen(json), &trial.arena, &trial.problem, &document))
        trial.ok = api_decode_query(query, document.root, thing_fields, &trial.thing, &decoder);
    json_decref(document.root);
    return trial;
}

/* What the first error of this body is: "POINTER DETAIL". */
static void check_error(const char *json, const char *expected)
{
    struct trial trial = decode(json, NULL);
    char text[500];
    snprintf(text, sizeof text, "%s %s", trial.problem.errors[0].pointer,
             trial.problem.errors[0].detail);
    CHECK(!trial.ok);
    CHECK_INT(trial.problem.status, 422);
    CHECK_STR(text, expected);
    api_arena_close(&trial.arena);
}

TEST(decodes_every_type)
{
    struct trial t = decode(
        "{\"alpha\":0.25,\"n\":7,\"flag\":false,\"kind\":\"second\",\"outputs\":[\"first\","
        "\"true\"],"
        "\"title\":\"x\",\"colour\":[1,0.5,0],\"list\":[1,2,3],\"vectors\":[[1,2,3],[4,5,6]],"
        "\"rows\":[[1,2],[3,4],[5,6]],\"inner\":{\"a\":1,\"b\":2},\"option\":{\"a\":3},"
        "\"items\":[{\"a\":1},{\"a\":2}],\"shape\":{\"a\":9}}",
        NULL);
    CHECK(t.ok);
    CHECK(t.thing.alpha == 0.25 && t.thing.open == 0.5 && t.thing.n == 7 && !t.thing.flag);
    CHECK_INT(t.thing.kind, 1);
    CHECK_INT(t.thing.outputs, 5);
    CHECK_STR(t.thing.title, "x");
    CHECK(t.thing.colour.channels == 3 && t.thing.colour.value[1] == 0.5);
    CHECK(t.thing.list.count == 3 && t.thing.list.values[2] == 3);
    CHECK(t.thing.vectors.count == 2 && t.thing.vectors.values[5] == 6);
    CHECK(t.thing.rows.rows == 3 && t.thing.rows.columns == 2 && t.thing.rows.values[4] == 5);
    CHECK(t.thing.option && t.thing.option->a == 3 && isnan(t.thing.option->b));
    CHECK(t.thing.items.count == 2 && ((const struct inner *)t.thing.items.items)[1].a == 2);
    CHECK(t.thing.shape.form == 2 && t.thing.shape.box->a == 9);
    api_arena_close(&t.arena);
}

TEST(absent_members_are_absent)
{
    struct trial t = decode("{}", NULL);
    CHECK(t.ok);
    CHECK(isnan(t.thing.alpha) && t.thing.open == 0.5 && t.thing.n == -1 && t.thing.flag);
    CHECK(t.thing.kind == -1 && !t.thing.outputs && !t.thing.title && !t.thing.colour.channels);
    CHECK(!t.thing.list.values && !t.thing.rows.values && !t.thing.option && !t.thing.items.items);
    CHECK_INT(t.thing.shape.form, 0);
    api_arena_close(&t.arena);
}

TEST(flat_and_nested_vectors_agree)
{
    struct trial t = decode("{\"vectors\":[1,2,3,4,5,6]}", NULL);
    CHECK(t.ok && t.thing.vectors.count == 2 && t.thing.vectors.values[4] == 5);
    api_arena_close(&t.arena);
}

TEST(errors_name_pointer_and_range)
{
    check_error("{\"alpha\":-1}", "/alpha -1 is outside [1e-8, 1e4]");
    check_error("{\"open\":1}", "/open 1 is outside (0, 1)");
    check_error("{\"open\":0}", "/open 0 is outside (0, 1)");
    check_error("{\"n\":10000000}", "/n 1e7 is outside [1, 2097152]");
    check_error("{\"n\":1.5}", "/n 1.5 is not an integer of up to 53 bits");
    check_error("{\"n\":1.1}", "/n 1.1 is not an integer of up to 53 bits");
    check_error("{\"alpha\":\"NaN\"}", "/alpha must be a number, not \"NaN\"");
    check_error("{\"alpha\":null}", "/alpha must be a number, not null");
    check_error("{\"flag\":1}", "/flag must be true or false, not a number");
    check_error("{\"kind\":\"third\"}", "/kind \"third\" is not one of first, true, second");
    check_error("{\"kind\":false}", "/kind must be a string, not a boolean");
    check_error("{\"outputs\":[\"first\",\"first\"]}", "/outputs/1 \"first\" stands twice");
    check_error("{\"outputs\":[]}", "/outputs has 0 elements, must have at least 1");
    check_error("{\"colour\":[1,2,3]}", "/colour/1 2 is outside [0, 1]");
    check_error("{\"colour\":[1,1]}", "/colour has 2 elements, must have 3");
    check_error("{\"list\":[1]}", "/list has 1 elements, must have at least 2");
    check_error("{\"list\":[1,\"x\",2]}", "/list/1 must be a number, not a string");
    check_error("{\"vectors\":[]}", "/vectors has 0 elements, must have at least 1");
    check_error("{\"vectors\":[1,2]}", "/vectors has 2 numbers, must have a multiple of 3");
    check_error("{\"vectors\":[[1,2,3],[1,2]]}", "/vectors/1 has 2 elements, must have 3");
    check_error("{\"vectors\":[[1,2,3],[1,{},3]]}", "/vectors/1/1 must be a number, not an object");
    check_error("{\"rows\":[[1,2],[3]]}", "/rows/1 has 1 elements, must have 2");
    check_error("{\"rows\":[]}", "/rows has 0 rows, must have at least 1");
    check_error("{\"inner\":{\"b\":1}}", "/inner/a is required");
    check_error("{\"inner\":{\"a\":1,\"b\":1}}", "/inner/b equals a");
    check_error("{\"items\":[{\"a\":1},{\"a\":[]}]}", "/items/1/a must be a number, not an array");
    check_error("{\"shape\":\"some\"}", "/shape \"some\" is not one of none; or an object of a, b");
    check_error("{\"shape\":true}", "/shape cannot be a boolean");
    check_error("{\"shape\":2}", "/shape 2 is outside [0, 1]");
    check_error("{\"shape\":{\"a\":1,\"b\":2}}", "/shape must have exactly one member, has 2");
    check_error(
        "{\"alhpa\":1}",
        "/alhpa is not a known member; known: alpha, flag, list, shape, open, n, kind, title, "
        "colour, rows, inner, items, outputs, option, vectors");
    check_error(
        "{\"w~/x\":1}",
        "/w~0~1x is not a known member; known: open, n, flag, kind, list, rows, alpha, title, "
        "inner, items, shape, colour, option, outputs, vectors");
    check_error("[]", " must be an object, not an array");
    check_error("3", " must be an object, not a number");
}

TEST(several_errors_are_reported_together)
{
    struct trial t = decode("{\"alpha\":-1,\"nonsense\":1,\"inner\":{\"c\":0}}", NULL);
    CHECK(!t.ok);
    CHECK_INT(t.problem.count, 4);
    CHECK_STR(t.problem.errors[1].pointer, "/nonsense");
    CHECK_STR(t.problem.errors[3].pointer, "/inner/a");
    api_arena_close(&t.arena);
}

static void check_syntax(const char *json, const char *beginning)
{
    struct trial t = decode(json, NULL);
    CHECK(!t.ok);
    CHECK_INT(t.problem.status, 400);
    if (strncmp(t.problem.detail, beginning, strlen(beginning)))
        CHECK_STR(t.problem.detail, beginning);
    api_arena_close(&t.arena);
}

TEST(syntax_errors_have_line_and_column)
{
    check_syntax("{\n \"alpha\": }", "not JSON: line 2 column 11: ");
    check_syntax("{\"alpha\":NaN}", "not JSON: line 1 column ");
    check_syntax("{\"alpha\":-Infinity}", "not JSON: line 1 column ");
    check_syntax("{\"alpha\":1e999}", "not JSON: line 1 column ");
    check_syntax("{\"alpha\":1,\"alpha\":1}", "not JSON: line 1 column 18: duplicate object key");
    check_syntax("{} {}", "not JSON: line 1 column 4: ");
    check_syntax("", "not JSON: line 1 column 1: the body is empty");
    check_syntax("[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]",
                 "not JSON: line 1 column 33: nested too deeply");
}

TEST(memory_is_bounded_by_the_body)
{
    enum { BYTES = 1 << 20 };
    CHECK(api_open());
    char *body = malloc(BYTES + 1);
    for (int i = 0; i + 2 < BYTES; i += 3) memcpy(body + i, i ? ",{}" : "[{}", 3);
    memcpy(body + BYTES - 1, "]", 2);
    struct problem problem = {0};
    struct arena arena;
    struct document document = {0};
    api_arena_open(&arena, 8 * BYTES);
    CHECK(!api_json_read(body, BYTES, &arena, &problem, &document));
    CHECK(!document.root);
    CHECK_INT(problem.status, 413);
    /* Numbers as directions carry them do fit. */
    memset(&problem, 0, sizeof problem);
    size_t n = 0;
    body[n++] = '[';
    while (n < BYTES - 16) n += (size_t)sprintf(body + n, "%s[0,0,1]", n > 1 ? "," : "");
    strcpy(body + n, "]");
    CHECK(api_json_read(body, n + 1, &arena, &problem, &document));
    CHECK(document.count == 1 && document.arrays[0].rows > 100000 &&
          document.arrays[0].columns == 3);
    json_decref(document.root);
    api_arena_close(&arena);
    free(body);
}

TEST(query_members_follow_the_same_table)
{
    struct trial t = decode(NULL, "alpha=0.5&kind=true&flag=false&title=a%20b&n=3");
    CHECK(t.ok);
    CHECK(t.thing.alpha == 0.5 && t.thing.n == 3 && !t.thing.flag && t.thing.kind == 2);
    CHECK_STR(t.thing.title, "a b");
    api_arena_close(&t.arena);
    static const char *const bad[][2] = {
        {"alpha=-1", "/alpha"},        {"alpha=x", "/alpha"}, {"beta=1", "/beta"},
        {"alpha=1&alpha=2", "/alpha"}, {"alpha", "/alpha"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        t = decode(NULL, bad[i][0]);
        CHECK(!t.ok);
        CHECK_STR(t.problem.errors[0].pointer, bad[i][1]);
        api_arena_close(&t.arena);
    }
    t = decode(NULL, "alpha=1e400");
    CHECK_STR(t.problem.errors[0].detail, "must be a number, not \"1e400\"");
    api_arena_close(&t.arena);
    t = decode(NULL, "title=%zz");
    CHECK_INT(t.problem.status, 400);
    api_arena_close(&t.arena);
    t = decode("{\"alpha\":1}", "alpha=2");
    CHECK_STR(t.problem.errors[0].detail, "is given twice");
    api_arena_close(&t.arena);
}

TEST(what_was_decoded_prints_as_it_was)
{
    const char *json =
        "{\"alpha\":0.1,\"open\":0.5,\"n\":7,\"flag\":false,\"kind\":\"second\",\"outputs\":["
        "\"first\",\"true\"],"
        "\"title\":\"\\\"\\\\ "
        "\\u0001é\",\"colour\":[1,0.5,0],\"list\":[1e-30,2,3e4],\"vectors\":[[1,2,3]],"
        "\"rows\":[[1],[3]],\"inner\":{\"a\":1,\"b\":2},\"option\":{\"a\":3},"
        "\"items\":[{\"a\":1},{\"a\":2}],\"shape\":\"none\"}";
    struct trial t = decode(json, NULL);
    CHECK(t.ok);
    struct text text = api_text(&t.arena);
    api_encode(&text, thing_fields, &t.thing);
    size_t size;
    char *printed = api_text_take(&text, &size);
    CHECK_STR(printed, json);
    free(printed);
    api_arena_close(&t.arena);
}

TEST(numbers_print_shortest)
{
    static const struct {
        double value;
        const char *text;
    } cases[] = {{1e-8, "1e-8"},
                 {1e4, "1e4"},
                 {0.1, "0.1"},
                 {1e7, "1e7"},
                 {2097152, "2097152"},
                 {-1, "-1"},
                 {100, "100"},
                 {1.0 / 3, "0.3333333333333333"},
                 {123456, "123456"},
                 {1e300, "1e300"},
                 {0, "0"},
                 {5e-324, "5e-324"},
                 {1 - 1e-12, "0.999999999999"},
                 {34992012, "34992012"},
                 {1e-30, "1e-30"},
                 {12000, "12000"},
                 {-0.0, "-0"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[NUMBER_ROOM];
        api_number_print(text, cases[i].value);
        CHECK_STR(text, cases[i].text);
    }
    struct rng rng;
    rng_seed(&rng, 1);
    for (int i = 0; i < 20000; i++) {
        char text[NUMBER_ROOM];
        double x = rng_log(&rng, 1e-300, 1e300) * (i % 2 ? 1 : -1);
        int n = api_number_print(text, x);
        if (strtod(text, NULL) != x || n != (int)strlen(text)) CHECK_STR(text, "the same number");
    }
}
