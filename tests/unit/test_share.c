/* Large evaluations and maps shared among threads: the same bytes, whoever computes which chunk. */
#include "ask.h"
#include "check.h"
#include "exr_file.h"
#include "form.h"
#include "rng.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char body[] =
    "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3,\"diffuse\":0.2},\"wi\":{\"grid\":{\"theta\":300,\"phi\":200}},"
    "\"wo\":[[-0.6,0,0.8]],\"outputs\":[\"fr\",\"pdf\"],\"tolerance\":1e-4}";

static size_t shared;

struct task {
    void (*run)(void *arg, size_t index);
    void *arg;
    size_t index;
};

static void *run_task(void *task_)
{
    const struct task *task = task_;
    task->run(task->arg, task->index);
    return NULL;
}

/* A thread each, the last first. */
static void share(void *crew, size_t count, void (*run)(void *arg, size_t index), void *arg)
{
    enum { MOST = 64 };
    pthread_t threads[MOST];
    struct task tasks[MOST];
    (void)crew;
    CHECK(count <= MOST);
    if (count > MOST) return;
    for (size_t i = count; i-- > 0;) {
        tasks[i] = (struct task){run, arg, i};
        CHECK_INT(pthread_create(&threads[i], NULL, run_task, &tasks[i]), 0);
    }
    for (size_t i = 0; i < count; i++) pthread_join(threads[i], NULL);
    shared += count;
}

static char *whole_body(struct answer *answer, size_t *size)
{
    char *bytes = malloc(16 << 20);
    *size = 0;
    for (long n; bytes && answer->response.stream &&
                 (n = api_stream_next(answer->response.stream, bytes + *size, 1 << 16)) > 0;)
        *size += (size_t)n;
    if (bytes && !answer->response.stream)
        memcpy(bytes, answer->response.body, *size = answer->response.body_size);
    return bytes;
}

/* The answer alone and shared; both are the caller's. */
static void ask_both(struct api_request request, struct answer *alone, struct answer *together)
{
    *alone = ask_with(request);
    request.share = share;
    *together = ask_with(request);
}

static void same_answer(struct api_request request)
{
    struct answer alone, together;
    ask_both(request, &alone, &together);
    size_t a, b;
    char *first = whole_body(&alone, &a), *second = whole_body(&together, &b);
    CHECK_INT(alone.response.status, 200);
    CHECK(first && second && a == b && a > 100000 && !memcmp(first, second, a));
    free(first);
    free(second);
    answer_clear(&alone);
    answer_clear(&together);
}

static void same_bytes(const char *accept, bool can_stream)
{
    same_answer((struct api_request){.method = "POST",
                                     .path = "/v1/eval",
                                     .body = body,
                                     .body_size = strlen(body),
                                     .accept = accept,
                                     .can_stream = can_stream});
}

TEST(sharing_changes_no_byte)
{
    same_bytes(NULL, false);
    same_bytes(NULL, true);
    same_bytes("application/octet-stream", false);
    same_bytes("application/octet-stream", true);
    CHECK(shared > 4 * 7);
}

/* Rows and tiles of a map, of odd sides, large enough that batches have several rows. */
TEST(sharing_changes_no_byte_of_a_map)
{
    static const char *const queries[] = {
        "", "compression=none&stencil=central&border=trim",
        "model=clean_max&type=half&form=central&border=mirror&scale=0.1",
        "at=0.3,0.8&level=2&stencil=forward&border=clamp"};
    enum { W = 515, H = 1030 };
    struct rng rng;
    rng_seed(&rng, 5);
    float *z = malloc(W * H * sizeof *z);
    for (size_t i = 0; z && i < W * H; i++)
        z[i] = (float)(i / W % 100 < 50 ? rng_uniform(&rng) : 0.5);
    size_t size = 0;
    unsigned char *exr = z ? exr_file_of_heights(z, W, H, &size) : NULL;
    for (size_t q = 0; exr && q < sizeof queries / sizeof *queries; q++) {
        struct api_request request = {.method = "POST",
                                      .path = "/v1/leadr",
                                      .query = queries[q],
                                      .accept = "*/*",
                                      .body = exr,
                                      .body_size = size};
        struct api_response alone, together;
        api_handle(&request, &alone);
        shared = 0;
        request.share = share;
        api_handle(&request, &together);
        CHECK_INT(alone.status, 200);
        CHECK(alone.body_size == together.body_size &&
              !memcmp(alone.body, together.body, alone.body_size));
        CHECK(shared > 100);
        api_response_clear(&alone);
        api_response_clear(&together);
    }
    CHECK(exr);
    free(exr);
    free(z);
}

/* ---- Directions that are sent ----------------------------------------------------------------------- */

enum { SENT = 80000 };

static void direction(struct rng *rng, float v[3])
{
    double z = rng_uniform(rng), phi = 6.28 * rng_uniform(rng), s = sqrt(1 - z * z);
    v[0] = (float)(s * cos(phi)), v[1] = (float)(s * sin(phi)), v[2] = (float)z;
}

/* wi and wo, each large enough to be parsed by several; with what separates rows in other places too. */
static char *sent_body(size_t *size)
{
    char *text = malloc(SENT * 160 + 400), *p = text;
    struct rng rng;
    rng_seed(&rng, 6);
    p += sprintf(p, "{\"material\":{\"alpha\":0.3},\"outputs\":[\"fr\",\"pdf\"]");
    for (int which = 0; which < 2; which++) {
        p += sprintf(p, ",\"%s\":[", which ? "wo" : "wi");
        for (int i = 0; i < SENT; i++) {
            float v[3];
            direction(&rng, v);
            p += sprintf(p, "%s[%.17g,%.17g, %.17g]",
                         !i      ? ""
                         : i % 7 ? ","
                                 : " ,\n ",
                         (double)v[0], (double)v[1], (double)v[2]);
        }
        *p++ = ']';
    }
    p += sprintf(p, ",\"flat\":false}");
    *size = (size_t)(p - text);
    return text;
}

TEST(arrays_are_read_by_several_as_by_one)
{
    size_t size;
    char *text = sent_body(&size);
    struct api_request request = {
        .method = "POST", .path = "/v1/eval", .body = text, .body_size = size};
    shared = 0;
    same_answer(request);
    CHECK(shared > 16);
    static const struct {
        double where; /* of the body, about: the next comma behind a row, or within one */
        bool within;
        const char *instead;
        int status;
    } faults[] = {{0.2, false, ";", 400},  {0.4, true, "x", 400}, {0.3, true, "]", 400},
                  {0.1, false, "\"", 400}, {0.7, true, " ", 400}, {0.25, false, "]", 400},
                  {0.9, true, "e", 400}};
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        char *at = text + (size_t)(faults[i].where * (double)size), kept;
        while (*at != ',' || (at[-1] == ']') == faults[i].within || at[-1] == ' ') at++;
        kept = *at;
        *at = *faults[i].instead;
        struct answer alone, together;
        ask_both(request, &alone, &together);
        CHECK_INT(alone.response.status, faults[i].status);
        CHECK(alone.response.body_size == together.response.body_size &&
              !memcmp(alone.response.body, together.response.body, alone.response.body_size));
        answer_clear(&alone);
        answer_clear(&together);
        *at = kept;
    }
    free(text);
}

TEST(floats_are_the_same_in_blocks_and_shared)
{
    float *v = malloc(SENT * 3 * sizeof *v);
    struct rng rng;
    rng_seed(&rng, 7);
    for (int i = 0; i < SENT; i++) direction(&rng, v + 3 * i);
    static const char *const answers[] = {"application/octet-stream", "application/zip",
                                          "application/json"};
    for (int i = 0; i < 9; i++) {
        struct form form = {0};
        form_add_text(
            &form, "request",
            i % 3 == 0
                ? "{\"material\":{\"alpha\":0.3},\"wo\":[[0,0,1]],\"outputs\":[\"fr\",\"pdf\",\"D\",\"G\"]}"
            : i % 3 == 1
                ? "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3,\"fresnel\":{\"schlick\":{\"f0\":[0.9,0.8,0.7]}}},\"wo\":[[0.6,0,0.8]],\"outputs\":[\"fr\",\"pdf\",\"D\"],\"tolerance\":1e-3}"
                : "{\"material\":{\"alpha\":0.3,\"diffuse\":0.1},\"wo\":[[0,0,1]],\"outputs\":[\"fr\",\"pdf\",\"D\",\"G\"]}");
        form_add(&form, "wi", v, SENT * 3 * sizeof *v);
        form_end(&form);
        struct api_request request = {.method = "POST",
                                      .path = "/v1/eval",
                                      .content_type = FORM_TYPE,
                                      .accept = answers[i / 3],
                                      .body = form.bytes,
                                      .body_size = form.size};
        struct answer whole = ask_with(request);
        request.can_stream = true;
        request.share = share;
        struct answer blocks = ask_with(request);
        size_t a, b;
        char *first = whole_body(&whole, &a), *second = whole_body(&blocks, &b);
        CHECK_INT(whole.response.status, 200);
        CHECK(i / 3 == 1 || blocks.response.stream);
        CHECK(a == b && a > 500000 && !memcmp(first, second, a));
        free(first);
        free(second);
        answer_clear(&whole);
        answer_clear(&blocks);
        form_clear(&form);
    }
    free(v);
}
