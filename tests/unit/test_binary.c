/* Numbers as bytes: forms in, raw numbers, .npy and .npz out; the same numbers as JSON gives. */
#include "ask.h"
#include "check.h"
#include "form.h"
#include "multipart.h"
#include "representation.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define REQUEST                                                                                    \
    "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3,\"fresnel\":{\"schlick\":{\"f0\":[0.9,0.8,0.7]}}}"

static struct answer ask_form(const char *path, const struct form *form, const char *accept)
{
    return ask_with((struct api_request){.method = "POST",
                                         .path = path,
                                         .content_type = FORM_TYPE,
                                         .accept = accept,
                                         .body = form->bytes,
                                         .body_size = form->size});
}

static const char *header(const struct answer *answer, const char *name)
{
    for (size_t i = 0; i < answer->response.header_count; i++)
        if (!strcmp(answer->response.headers[i].name, name))
            return answer->response.headers[i].value;
    return "";
}

enum { N = 300 };

static void directions(float *v, struct rng *rng)
{
    for (int i = 0; i < N; i++) {
        double z = 0.1 + 0.9 * rng_uniform(rng), phi = 6.28 * rng_uniform(rng), s = sqrt(1 - z * z);
        v[3 * i] = (float)(s * cos(phi));
        v[3 * i + 1] = (float)(s * sin(phi));
        v[3 * i + 2] = (float)z;
    }
}

/* wi and wo as parts: how says raw, npy or float64. */
static struct form form_of(const char *request, const float *wi, const float *wo, int how)
{
    struct form form = {0};
    double *wide = malloc(3 * N * sizeof *wide);
    for (int i = 0; i < 3 * N; i++) wide[i] = wi[i];
    form_add_text(&form, "request", request);
    if (how == 0) form_add(&form, "wi", wi, 3 * N * sizeof *wi);
    if (how == 1) form_add_npy(&form, "wi", wi, N, 3);
    if (how == 2) form_add(&form, "wi", wide, 3 * N * sizeof *wide);
    if (how == 2)
        form_add(&form, "wo", (double[]){wo[0], wo[1], wo[2]}, 3 * sizeof(double));
    else
        form_add_npy(&form, "wo", wo, 3, 0);
    form_end(&form);
    free(wide);
    return form;
}

static char *json_of(const float *wi, const float *wo)
{
    char *text = malloc(N * 80 + 1000), *p = text;
    p += sprintf(
        p,
        REQUEST
        ",\"outputs\":[\"fr\",\"pdf\"],\"tolerance\":1e-12,\"wo\":[%.17g,%.17g,%.17g],\"wi\":[",
        wo[0], wo[1], wo[2]);
    for (int i = 0; i < 3 * N; i++) p += sprintf(p, "%s%.17g", i ? "," : "", wi[i]);
    strcpy(p, "]}");
    return text;
}

TEST(every_encoding_gives_the_same_numbers)
{
    static const char *const requests[] = {
        REQUEST ",\"outputs\":[\"fr\",\"pdf\"],\"tolerance\":1e-12}",
        REQUEST ",\"outputs\":[\"fr\",\"pdf\"],\"tolerance\":1e-12}",
        REQUEST ",\"outputs\":[\"fr\",\"pdf\"],\"tolerance\":1e-12,\"dtype\":\"float64\"}"};
    float wi[3 * N], wo[3] = {0.6f, 0, 0.8f};
    struct rng rng;
    rng_seed(&rng, 4);
    directions(wi, &rng);
    char *json = json_of(wi, wo);
    struct answer expected = ask_post("/v1/eval", json);
    CHECK_INT(expected.response.status, 200);
    for (int how = 0; how < 3; how++) {
        struct form form = form_of(requests[how], wi, wo, how);
        struct answer a = ask_form("/v1/eval", &form, NULL);
        CHECK_INT(a.response.status, 200);
        CHECK(json_equal(a.json, expected.json));
        answer_clear(&a);
        a = ask_form("/v1/eval", &form, "application/octet-stream");
        CHECK_STR(
            header(&a, "Facet-Layout"),
            "[{\"name\":\"fr\",\"dtype\":\"<f8\",\"shape\":[300,3]},{\"name\":\"pdf\",\"dtype\":\"<f8\",\"shape\":[300]}]");
        CHECK(strstr(header(&a, "Facet-Answer"),
                     "\"count\":300,\"accuracy\":{\"tier\":\"precise\",\"bound\":"));
        CHECK_INT(a.response.body_size, N * 4 * sizeof(double));
        const double *got = a.response.body;
        for (size_t i = 0; i < N && a.response.status == 200; i++) {
            for (size_t k = 0; k < 3; k++)
                CHECK_REL(got[3 * i + k], answer_component(&expected, "fr", i, k), 1e-12, 0);
            CHECK_REL(got[3 * N + i], answer_number(&expected, "pdf", i), 1e-12, 0);
        }
        answer_clear(&a);
        form_clear(&form);
    }
    answer_clear(&expected);
    free(json);
}

/* Among many of length 1: one that is normalised as in JSON, one that is refused by its place. */
TEST(lengths_of_floats)
{
    static float wi[3 * N], wo[3] = {0.6f, 0, 0.8f};
    static const float factors[] = {1.0005f, 1.01f};
    struct rng rng;
    rng_seed(&rng, 9);
    for (int i = 0; i < 6; i++) {
        int at = i < 3 ? 200 : 297 + i - 3; /* within four of them, and behind */
        float factor = factors[i % 2];
        directions(wi, &rng);
        for (int k = 0; k < 3; k++) wi[3 * at + k] *= factor;
        struct form form = form_of(REQUEST ",\"outputs\":[\"fr\",\"pdf\"],\"tolerance\":1e-12}", wi,
                                   wo, 0);
        char *json = json_of(wi, wo), place[16];
        struct answer a = ask_form("/v1/eval", &form, NULL), b = ask_post("/v1/eval", json);
        snprintf(place, sizeof place, "/wi/%d", at);
        CHECK_INT(a.response.status, i % 2 ? 422 : 200);
        if (i % 2) CHECK_STR(answer_error(&a, "pointer"), place);
        CHECK(json_equal(a.json, b.json));
        answer_clear(&a);
        answer_clear(&b);
        form_clear(&form);
        free(json);
    }
}

TEST(floats_where_the_tolerance_lets_them)
{
    float wi[3 * N], wo[3] = {0, 0, 1};
    struct rng rng;
    rng_seed(&rng, 5);
    directions(wi, &rng);
    static const struct {
        const char *request, *dtype;
        int status;
    } cases[] = {
        {"{\"material\":{\"alpha\":0.3}}", "<f4", 200},
        {"{\"material\":{\"alpha\":0.3},\"tolerance\":1e-8}", "<f8", 200},
        {"{\"material\":{\"alpha\":0.3},\"tolerance\":1e-7,\"dtype\":\"float32\"}", "<f4", 200},
        {"{\"material\":{\"alpha\":0.3},\"tolerance\":1e-8,\"dtype\":\"float32\"}", "", 422},
        {"{\"material\":{\"alpha\":0.3},\"dtype\":\"float16\"}", "", 422}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct form form = form_of(cases[i].request, wi, wo, 1);
        struct answer a = ask_form("/v1/eval", &form, "application/x-npy");
        CHECK_INT(a.response.status, cases[i].status);
        if (cases[i].status == 200) {
            const char *npy = a.response.body;
            CHECK(!memcmp(npy, "\x93NUMPY\1\0\x76\0", 10) && strstr(npy + 10, cases[i].dtype) &&
                  strstr(npy + 10, "(300,)"));
            CHECK_INT(a.response.body_size, 128 + N * (cases[i].dtype[2] - '0'));
        } else {
            CHECK_STR(answer_error(&a, "pointer"), "/dtype");
        }
        answer_clear(&a);
        form_clear(&form);
    }
}

/* The largest double that rounds to a float, the next one, and no number: which element it is. */
TEST(what_no_float_holds_is_refused)
{
    static const struct {
        double value;
        enum results_format format;
        enum results_fault fault;
    } cases[] = {{0x1.fffffefffffffp127, RESULTS_FLOAT32, RESULTS_SOUND},
                 {0x1.ffffffp127, RESULTS_FLOAT32, RESULTS_TOO_LARGE},
                 {-1e300, RESULTS_FLOAT32, RESULTS_TOO_LARGE},
                 {-1e300, RESULTS_FLOAT64, RESULTS_SOUND},
                 {1e300, RESULTS_JSON, RESULTS_SOUND},
                 {INFINITY, RESULTS_FLOAT64, RESULTS_NOT_FINITE},
                 {NAN, RESULTS_FLOAT32, RESULTS_NOT_FINITE},
                 {NAN, RESULTS_JSON, RESULTS_NOT_FINITE}};
    for (size_t i = 0; i < 5 * (sizeof cases / sizeof *cases); i++) {
        const size_t at = i % 5;
        double x[5] = {1, 2, 3, 4, 5}, y[5] = {0};
        char told[32];
        x[at] = cases[i / 5].value;
        snprintf(told, sizeof told, "D of pair %zu is", at);
        double *const columns[] = {y, x};
        struct arena arena;
        struct results results;
        struct problem problem = {0};
        api_arena_open(&arena, 1 << 20);
        api_results_open_as(&results, &arena, cases[i / 5].format, 2, false, 9);
        enum results_fault fault = cases[i / 5].fault;
        CHECK(api_results_add(&results, columns, 5) == !fault);
        CHECK_INT(results.fault, fault);
        CHECK_INT(results.count, fault ? at : 5);
        CHECK(api_results_check(&results, "D", "pair", &problem) == !fault);
        if (fault)
            CHECK(strstr(fault == RESULTS_TOO_LARGE ? problem.errors[0].detail : problem.detail,
                         told));
        api_arena_close(&arena);
    }
}

/* One number each and three, by the four and the rest. */
TEST(doubles_are_written_as_floats)
{
    enum { ROWS = 7, WIDTH = 3 };
    double columns[WIDTH][ROWS], *const of[WIDTH] = {columns[0], columns[1], columns[2]};
    for (size_t k = 0; k < WIDTH; k++)
        for (size_t i = 0; i < ROWS; i++)
            columns[k][i] = (i % 2 ? -1.3 : 0.7) * (double)(10 * k + i + 1);
    for (size_t width = 1; width <= WIDTH; width++) {
        char bytes[ROWS * WIDTH * sizeof(float)];
        const struct results results = {.format = RESULTS_FLOAT32, .width = width};
        char *end = bytes;
        size_t at;
        CHECK(api_results_put(&results, of, ROWS, true, &end, &at) == RESULTS_SOUND);
        CHECK(end == bytes + ROWS * width * sizeof(float));
        for (size_t i = 0; i < ROWS * width; i++) {
            float x;
            memcpy(&x, bytes + i * sizeof x, sizeof x);
            CHECK(x == (float)columns[i % width][i / width]);
        }
    }
}

/* The largest float is one, and what is no number or beyond it is told where it is, by the four and the rest. */
TEST(doubles_that_no_float_is_are_told)
{
    enum { ROWS = 7 };
    static const struct {
        double x;
        enum results_fault fault;
    } cases[] = {{FLT_MAX, RESULTS_SOUND},
                 {-0x1.fffffefffffffp127, RESULTS_SOUND},
                 {0x1.ffffffp127, RESULTS_TOO_LARGE},
                 {-1e300, RESULTS_TOO_LARGE},
                 {NAN, RESULTS_NOT_FINITE},
                 {-INFINITY, RESULTS_NOT_FINITE}};
    const struct results results = {.format = RESULTS_FLOAT32, .width = 1};
    for (size_t i = 0; i < ROWS * sizeof cases / sizeof *cases; i++) {
        const size_t where = i % ROWS;
        double column[ROWS] = {1, 2, 3, 4, 5, 6, 7}, *const of[] = {column};
        char bytes[sizeof column], *end = bytes;
        size_t at = ROWS;
        column[where] = cases[i / ROWS].x;
        CHECK_INT(api_results_put(&results, of, ROWS, true, &end, &at), cases[i / ROWS].fault);
        if (cases[i / ROWS].fault) CHECK_INT(at, where);
    }
}

TEST(samples_as_bytes)
{
    float u[2 * N], wo[3] = {0.6f, 0, 0.8f};
    struct rng rng;
    rng_seed(&rng, 6);
    for (int i = 0; i < 2 * N; i++) u[i] = (float)(0.999 * rng_uniform(&rng));
    struct form form = {0};
    form_add_text(&form, "request", "{\"material\":{\"alpha\":0.3}}");
    form_add_npy(&form, "u", u, N, 2);
    form_add(&form, "wo", wo, sizeof wo);
    form_end(&form);
    struct answer json = ask_form("/v1/sample", &form, "application/json");
    struct answer raw = ask_form("/v1/sample", &form, "application/octet-stream");
    CHECK_INT(raw.response.status, 200);
    CHECK_INT(raw.response.body_size, N * 5 * sizeof(float));
    CHECK(strstr(header(&raw, "Facet-Answer"), "\"wasted\":"));
    const float *got = raw.response.body;
    for (size_t i = 0; i < N && raw.response.status == 200; i++) {
        CHECK_REL(got[3 * i], answer_component(&json, "wi", i, 0), 1e-6, 1);
        CHECK_REL(got[3 * N + i], answer_number(&json, "weight", i), 1e-6, 1e-30);
        CHECK_REL(got[4 * N + i], answer_number(&json, "pdf", i), 1e-6, 1e-30);
    }
    answer_clear(&json);
    answer_clear(&raw);
    form_clear(&form);
}

/* What the float tiers draw and weigh is as far from the truth as they say, and what doubles make of it. */
TEST(samples_in_floats)
{
    static const char *const requests[] = {
        "{\"material\":{\"alpha\":0.3},\"outputs\":[\"wi\",\"weight\",\"pdf\",\"h\"],\"tolerance\":%s}",
        "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3,\"fresnel\":{\"schlick\":{\"f0\":[0.9,0.8,0.7]}}},\"outputs\":[\"wi\",\"weight\",\"pdf\",\"h\"],\"tolerance\":%s}",
        "{\"material\":{\"alpha\":0.3},\"sampler\":\"ndf\",\"outputs\":[\"wi\",\"weight\",\"pdf\",\"h\"],\"tolerance\":%s}"};
    static const char *const tolerances[] = {"1e-6", "3e-4", "1e-2"};
    static float u[2 * N], wo[3] = {0.6f, 0, 0.8f};
    struct rng rng;
    rng_seed(&rng, 8);
    for (int i = 0; i < 2 * N; i++) u[i] = (float)(0.05 + 0.9 * rng_uniform(&rng));
    for (size_t i = 0; i < 9; i++) {
        struct answer answers[2];
        size_t width = i / 3 == 1 ? 3 : 1;
        double bound = atof(tolerances[i % 3]);
        for (int which = 0; which < 2; which++) { /* exact, and the tier's */
            char request[400];
            struct form form = {0};
            snprintf(request, sizeof request, requests[i / 3], which ? tolerances[i % 3] : "1e-9");
            form_add_text(&form, "request", request);
            form_add(&form, "u", u, sizeof u);
            form_add(&form, "wo", wo, sizeof wo);
            form_end(&form);
            answers[which] = ask_form("/v1/sample", &form, "application/octet-stream");
            CHECK_INT(answers[which].response.status, 200);
            CHECK_INT(answers[which].response.body_size,
                      N * (7 + width) * (which ? sizeof(float) : sizeof(double)));
            form_clear(&form);
        }
        const double *x = answers[0].response.body;
        const float *y = answers[1].response.body;
        for (size_t k = 0; k < N * (7 + width); k++) {
            bool is_direction = k < 3 * N || k >= N * (4 + width);
            CHECK_REL(y[k], x[k], bound, is_direction ? 1 : 1e-6);
        }
        answer_clear(&answers[0]);
        answer_clear(&answers[1]);
    }
}

/* The status and first pointer (or a word of the detail) of a form with one part beside the request. */
static void check_form(const char *name, const void *bytes, size_t size, int status,
                       const char *what)
{
    struct form form = {0};
    form_add_text(&form, "request", "{\"material\":{\"alpha\":0.3},\"wo\":[[0,0,1]]}");
    form_add(&form, name, bytes, size);
    form_end(&form);
    struct answer a = ask_form("/v1/eval", &form, NULL);
    CHECK_INT(a.response.status, status);
    if (!a.response.body || !strstr(a.response.body, what))
        check_fail(__FILE__, __LINE__, "%s: %.300s", what, (char *)a.response.body);
    answer_clear(&a);
    form_clear(&form);
}

static void check_npy(const char *text, size_t data, int status, const char *what)
{
    char npy[2000] = "\x93NUMPY\1\0";
    size_t n = strlen(text);
    npy[8] = (char)n;
    memcpy(npy + 10, text, n);
    const float up[3] = {0, 0, 1};
    for (size_t i = 0; i * 4 < data; i++) memcpy(npy + 10 + n + 4 * i, &up[i % 3], 4);
    check_form("wi", npy, 10 + n + data, status, what);
}

TEST(bad_parts_are_refused)
{
    const float good[6] = {0, 0, 1, 0, 0, 1}, bad[3] = {0, 0, NAN}, far[3] = {INFINITY, 0, 0},
                longer[3] = {0, 0, 2};
    check_form("wi", good, sizeof good, 200, "\"count\":2");
    check_form("wi", good, 8, 422, "must have a multiple of 3");
    check_form("wi", good, 11, 422, "must have a multiple of 4");
    check_form("wi", "[[0,0,1]]", 9, 422, "JSON stands in the part");
    check_form("wi", good, 0, 422, "has 0 elements");
    check_form("wi", bad, sizeof bad, 422, "/wi/0");
    check_form("wi", far, sizeof far, 422, "has length inf, must have length 1 within 0.001");
    check_form("wi", bad, sizeof bad, 422, "has length nan, must have length 1 within 0.001");
    check_form("wi", longer, sizeof longer, 422, "has length 2");
    check_form("wo", good, sizeof good, 422, "is given twice");
    check_form("wx", good, sizeof good, 422, "is not a known member");
    check_form("wx", good, 11, 422, "/wx is not a known member; known: ");
    check_form("tolerance", "1e-3!", 5, 422, "/tolerance must be a number, not an array");
    check_form("w\xff", good, sizeof good, 422, "printable");
    check_form("material", good, sizeof good, 422, "is given twice");
    check_form("tolerance", good, sizeof good, 422, "must be a number, not an array");
    check_npy("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }", 24, 200,
              "\"count\":2");
    check_npy("{'descr': '<f4', 'fortran_order': False, 'shape': (6,), }", 24, 200, "\"count\":2");
    check_npy("{'descr': '<f4', 'fortran_order': True, 'shape': (1, 3), }", 12, 200, "\"count\":1");
    check_npy("{'descr': '<i4', 'fortran_order': False, 'shape': (2, 3), }", 24, 422,
              "has the dtype '<i4', must have '<f4'");
    check_npy("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (6,), }", 24, 422,
              "has the dtype [('a', '<f4')], must have '<f4'");
    check_npy("{'descr': '>f4', 'fortran_order': False, 'shape': (2, 3), }", 24, 422,
              "must have '<f4'");
    check_npy("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 4), }", 32, 422,
              "has 4 elements");
    check_npy("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }", 20, 422,
              "holds 20 bytes");
    check_npy("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 1, 3), }", 24, 422,
              "has the shape (2, 1, 3), must have 1 or 2 dimensions");
    check_npy("{'descr': '<f4', 'fortran_order': False, 'shape': (), }", 4, 422,
              "has the shape (), must have 1 or 2 dimensions");
    check_npy("{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999, 99999999999), }", 24,
              422, "holds");
    check_npy("{'descr': '<f4', 'fortran_order': False, 'shape': (0, 3), }", 0, 422,
              "has 0 elements");
    check_npy("{'descr': '<f4', 'shape': (2, 3), }", 24, 422, "is no .npy file");
    check_npy("", 0, 422, "is no .npy file");
}

static void check_multipart(const char *type, const char *body, int status, size_t parts,
                            const char *last)
{
    struct part list[PARTS_MAX];
    struct problem problem = {0};
    size_t count = 0, size = strlen(body);
    char *exact = malloc(size ? size : 1); /* so that asan sees a byte too many */
    memcpy(exact, body, size);
    bool ok = api_multipart(type, exact, size, list, &count, &problem);
    if (ok != !status || (status && problem.status != status && !(status == 422 && problem.count)))
        check_fail(__FILE__, __LINE__, "%s: %d %s", body, problem.status, problem.detail);
    if (ok) {
        CHECK_INT(count, parts);
        if (count)
            CHECK(list[count - 1].size == strlen(last) &&
                  !memcmp(list[count - 1].bytes, last, strlen(last)));
    }
    free(exact);
}

#define T "multipart/form-data; boundary=b"
#define D "Content-Disposition: form-data; name="

TEST(multipart_bodies)
{
    check_multipart(T, "--b\r\n" D "a\r\n\r\nhello\r\n--b--\r\n", 0, 1, "hello");
    check_multipart(T,
                    "--b\r\n" D "a\r\n\r\n1\r\n--b\r\n" D
                    "\"c\"; filename=x\r\nX-Y: z\r\n\r\n\r\n2\r\n--b--",
                    0, 2, "\r\n2");
    check_multipart(
        T,
        "preamble\r\n--b \t\r\ncontent-disposition: FORM-DATA; NAME=\"a\\\"b\"\r\n\r\n\r\n--b--epilogue",
        0, 1, "");
    check_multipart(T, "--b\r\n" D "a\r\n\r\n--b--\r\n", 0, 1, "");
    check_multipart(T, "--b\r\n" D "a\r\n\r\n\r\n--bb\r\n\r\n--b--", 400, 0, "");
    check_multipart(T, "--b\r\n" D "a\r\n\r\nx\r\n-b\r\n--\r\n--b--", 0, 1, "x\r\n-b\r\n--");
    check_multipart("multipart/form-data;boundary=\"b\"; charset=utf-8", "--b--", 0, 0, "");
    check_multipart("multipart/form-data; charset=\"a;b\"; Boundary=b", "--b--", 0, 0, "");
    check_multipart("multipart/form-data", "--b--", 400, 0, "");
    check_multipart("multipart/form-data; boundary=", "--b--", 400, 0, "");
    check_multipart("multipart/form-data; boundary=\"b", "--b--", 400, 0, "");
    check_multipart(T "123456789012345678901234567890123456789012345678901234567890123456789012",
                    "--b--", 400, 0, "");
    check_multipart(T, "", 400, 0, "");
    check_multipart(T, "--b", 400, 0, "");
    check_multipart(T, "--b\r\n", 400, 0, "");
    check_multipart(T, "--b\r\n" D "a\r\n", 400, 0, "");
    check_multipart(T, "--b\r\n" D "a\r\n\r\nx", 400, 0, "");
    check_multipart(T, "--b\r\n" D "a\r\n\r\nx\r\n--b", 400, 0, "");
    check_multipart(T, "--b\r\nX: y\r\n\r\nx\r\n--b--", 400, 0, "");
    check_multipart(T, "--b\r\n" D "\r\n\r\nx\r\n--b--", 422, 0, "");
    check_multipart(T, "--b\r\n" D "a\r\n\r\nx\r\n--b\r\n" D "a\r\n\r\nx\r\n--b--", 422, 0, "");
    check_multipart(T, "--b\r\n" D "a\r\nContent-Transfer-Encoding: base64\r\n\r\nx\r\n--b--", 422,
                    0, "");
    check_multipart(T, "--b\r\n" D "a\r\nContent-Transfer-Encoding: binary\r\n\r\nx\r\n--b--", 0, 1,
                    "x");
    check_multipart(T, "\r\r\r\r\n\r\n--\r\n--b", 400, 0, "");
}

TEST(npy_holds_one_array)
{
    static const char request[] = REQUEST
        ",\"wi\":[[0,0,1]],\"wo\":[[0,0,1]],\"outputs\":[\"fr\",\"pdf\"]}";
    struct answer a = ask_with((struct api_request){.method = "POST",
                                                    .path = "/v1/eval",
                                                    .body = request,
                                                    .body_size = sizeof request - 1,
                                                    .accept = "application/x-npy"});
    CHECK_INT(a.response.status, 406);
    answer_clear(&a);
    /* JSON unless something else is preferred. */
    a = ask_with((struct api_request){.method = "POST",
                                      .path = "/v1/eval",
                                      .body = request,
                                      .body_size = sizeof request - 1,
                                      .accept = "*/*, application/zip;q=0.9"});
    CHECK(a.json && a.response.status == 200);
    answer_clear(&a);
}
