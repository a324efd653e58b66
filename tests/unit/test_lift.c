/* Arrays of numbers lifted out of JSON: what is lifted, what is wrong where, how much memory. */
#include "check.h"
#include "json.h"
#include "limits.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct trial {
    struct arena arena;
    struct problem problem;
    struct document document;
    bool ok;
};

static struct trial read_bytes(const char *bytes, size_t size)
{
    struct trial t = {.ok = false};
    api_json_open();
    api_arena_open(&t.arena, LIMIT_REQUEST_MEMORY);
    t.ok = api_json_read(bytes, size, &t.arena, &t.problem, &t.document);
    return t;
}

static struct trial read_text(const char *text)
{
    return read_bytes(text, strlen(text));
}

static void clear(struct trial *t)
{
    json_decref(t->document.root);
    api_arena_close(&t->arena);
}

/* "count rows columns flaw row column found what" of the only array. */
static void check_array(const char *text, const char *expected)
{
    struct trial t = read_text(text);
    char got[200] = "none";
    if (t.document.count == 1) {
        const struct number_array *a = t.document.arrays;
        snprintf(got, sizeof got, "%zu %zu %zu %d %zu %zu %zu %s", a->count, a->rows, a->columns,
                 (int)a->flaw, a->row, a->column, a->found, a->what ? a->what : "-");
    }
    CHECK(t.ok);
    CHECK_STR(got, expected);
    clear(&t);
}

TEST(arrays_and_their_flaws)
{
    check_array("[1,2,3]", "3 0 0 0 0 0 0 -");
    check_array(" [ 1 , 2\n,\t3 ] ", "3 0 0 0 0 0 0 -");
    check_array("{\"a\":[[1,2],[3,4],[5,6]]}", "6 3 2 0 0 0 0 -");
    check_array("[[1, 2] , [3,4]]", "4 2 2 0 0 0 0 -");
    check_array("[1,null,3]", "2 0 0 1 0 1 0 null");
    check_array("[1,2,true,null]", "2 0 0 1 0 2 0 a boolean");
    check_array("[[1,2],[3,null],[1]]", "4 3 2 1 1 1 0 null");
    check_array("[[1,2],3]", "2 2 2 2 1 0 0 a number");
    check_array("[[1,2],null]", "2 2 2 2 1 0 0 null");
    check_array("[[1,2],[3]]", "3 2 2 3 1 0 1 -");
    check_array("[[1,2],[]]", "2 2 2 3 1 0 0 -");
    check_array("[[1,2],[3,4,5],[6]]", "6 3 2 3 1 0 3 -");
}

TEST(what_holds_more_than_numbers_is_left)
{
    static const char *const left[] = {
        "[]",   "[[]]",     "[\"a\"]",  "[1,\"a\"]", "[1,{}]",
        "[{}]", "[null,1]", "[[],[1]]", "\"[1,2]\"", "{\"[1]\":\"[1,2,3]\"}"};
    for (size_t i = 0; i < sizeof left / sizeof *left; i++) {
        struct trial t = read_text(left[i]);
        CHECK(t.ok);
        if (t.document.count != (i == 7)) check_fail(__FILE__, __LINE__, "%s", left[i]);
        clear(&t);
    }
}

static bool has_integer(json_t *json)
{
    const char *key;
    json_t *value;
    size_t i;
    bool found = json_is_integer(json);
    json_object_foreach(json, key, value) found |= has_integer(value);
    json_array_foreach(json, i, value) found |= has_integer(value);
    return found;
}

/* An integer stands for an array of the document: no text may spell one. */
TEST(no_text_makes_an_integer)
{
    static const char *const texts[] = {"0",
                                        "-0",
                                        "7",
                                        "[0,{}]",
                                        "{\"a\":1,\"b\":[\"x\",2]}",
                                        "{\"a\":12345678901234567890}",
                                        "[{},-3]",
                                        "1e0",
                                        "0e0",
                                        "[[[0]],{}]",
                                        "{\"0\":0}",
                                        "[\"0\",0]"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        struct trial t = read_text(texts[i]);
        CHECK(t.ok);
        if (has_integer(t.document.root) != (t.document.count > 0))
            check_fail(__FILE__, __LINE__, "%s", texts[i]);
        clear(&t);
    }
}

static void check_refused(const char *text, int status, const char *detail)
{
    struct trial t = read_text(text);
    CHECK(!t.ok && !t.document.root);
    CHECK_INT(t.problem.status, status);
    if (!strstr(t.problem.detail, detail))
        check_fail(__FILE__, __LINE__, "%s: %s", text, t.problem.detail);
    clear(&t);
}

TEST(refusals_say_where)
{
    check_refused("[1,,2]", 400, "line 1 column 4: a number is expected");
    check_refused("[1,2", 400, "line 1 column 5: , or ] is expected");
    check_refused("[1,\n2 3]", 400, "line 2 column 3: , or ] is expected");
    check_refused("[1,]", 400, "line 1 column 4: a number is expected");
    check_refused("[1,1e999]", 400, "line 1 column 4: the number is too large");
    check_refused("[1,NaN]", 400, "line 1 column 4: a number is expected");
    check_refused("[[1,2],[3,-]]", 400, "line 1 column 11: a number is expected");
    check_refused("[[1,2] [3]]", 400, "line 1 column 8: , or ] is expected");
    /* What stands for an array joins nothing. */
    check_refused("{\"a\":[1],\"b\":[2][3]}", 400, "line 1 column ");
    check_refused("[\"\",[0.9,[1]25]]", 400, "line 1 column ");
    check_refused("[\"\",[1].5]", 400, "line 1 column ");
    check_refused("[\"\",1[1]]", 400, "line 1 column ");
    check_refused("[\"\",-[1]]", 400, "line 1 column ");
    /* Behind arrays, and integers, that the text does not hold: the place in what was sent. */
    check_refused("{\"a\":[1,2,3],\"b\":[[1,2],[3,4]],\n \"c\":7,\"d\":8 \"e\"}", 400,
                  "line 2 column 16");
    check_refused("{\"a\":[1,2,\n3],\n\"b\":[4],}", 400, "line 3 column 9");
}

TEST(memory_is_that_of_the_numbers)
{
    enum { BYTES = 4 << 20 };
    char *text = malloc(BYTES);
    static const char *const units[] = {"1,", "[1],", "[0.25,-0.5,1e-3],", "{},", "[\"\"],"};
    for (size_t k = 0; k < sizeof units / sizeof *units; k++) {
        size_t n = 1, unit = strlen(units[k]);
        for (*text = '['; n + unit + 1 < BYTES; n += unit) memcpy(text + n, units[k], unit);
        text[n - 1] = ']';
        struct trial t = read_bytes(text, n);
        size_t held = LIMIT_REQUEST_MEMORY - t.arena.room;
        if (k < 3) {
            CHECK(t.ok);
            CHECK(held <= LIMIT_JSON_MEMORY * (size_t)BYTES + 65536);
            CHECK_INT(t.document.arrays[0].count,
                      t.document.arrays[0].nested
                          ? t.document.arrays[0].rows * t.document.arrays[0].columns
                          : t.document.arrays[0].count);
        } else {
            CHECK_INT(t.problem.status, 413);
        }
        clear(&t);
    }
    free(text);
}

TEST(numbers_are_those_of_strtod)
{
    enum { N = 5000 };
    struct rng rng;
    rng_seed(&rng, 3);
    char *text = malloc(N * 40), *p = text;
    double *sent = malloc(N * sizeof *sent);
    for (int i = 0; i < N; i++) {
        sent[i] = (rng_uniform(&rng) - 0.5) * rng_log(&rng, 1e-300, 1e300);
        p += sprintf(p, "%c%.17g", i ? ',' : '[', sent[i]);
    }
    *p++ = ']';
    struct trial t = read_bytes(text, (size_t)(p - text));
    CHECK(t.ok && t.document.count == 1 && t.document.arrays[0].count == N);
    CHECK(!t.ok || !memcmp(t.document.arrays[0].data, sent, N * sizeof *sent));
    clear(&t);
    free(text);
    free(sent);
}
