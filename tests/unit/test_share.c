/* Large evaluations and maps shared among threads: the same bytes, whoever computes which chunk. */
#include "ask.h"
#include "check.h"
#include "exr_file.h"
#include "rng.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

static const char body[] = "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3,\"diffuse\":0.2},\"wi\":{\"grid\":{\"theta\":300,\"phi\":200}},"
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
    pthread_t threads[64];
    struct task tasks[64];
    (void)crew;
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
    for (long n; bytes && answer->response.stream && (n = api_stream_next(answer->response.stream, bytes + *size, 1 << 16)) > 0;)
        *size += (size_t)n;
    if (bytes && !answer->response.stream) memcpy(bytes, answer->response.body, *size = answer->response.body_size);
    return bytes;
}

static void same_bytes(const char *accept, bool can_stream)
{
    struct api_request request = {.method = "POST", .path = "/v1/eval", .body = body, .body_size = strlen(body),
                                  .accept = accept, .can_stream = can_stream};
    struct answer alone = ask_with(request);
    request.share = share;
    struct answer together = ask_with(request);
    size_t a, b;
    char *first = whole_body(&alone, &a), *second = whole_body(&together, &b);
    CHECK_INT(alone.response.status, 200);
    CHECK(first && second && a == b && a > 100000 && !memcmp(first, second, a));
    free(first);
    free(second);
    answer_clear(&alone);
    answer_clear(&together);
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
    static const char *const queries[] = {"", "compression=none&stencil=central&border=trim",
                                          "model=clean_max&type=half&form=central&border=mirror&scale=0.1",
                                          "at=0.3,0.8&level=2&stencil=forward&border=clamp"};
    enum { W = 515, H = 1030 };
    struct rng rng;
    rng_seed(&rng, 5);
    float *z = malloc(W * H * sizeof *z);
    for (size_t i = 0; z && i < W * H; i++) z[i] = (float)(i / W % 100 < 50 ? rng_uniform(&rng) : 0.5);
    size_t size = 0;
    unsigned char *exr = z ? exr_file_of_heights(z, W, H, &size) : NULL;
    for (size_t q = 0; exr && q < sizeof queries / sizeof *queries; q++) {
        struct api_request request = {.method = "POST", .path = "/v1/leadr", .query = queries[q], .accept = "*/*",
                                      .body = exr, .body_size = size};
        struct api_response alone, together;
        api_handle(&request, &alone);
        shared = 0;
        request.share = share;
        api_handle(&request, &together);
        CHECK_INT(alone.status, 200);
        CHECK(alone.body_size == together.body_size && !memcmp(alone.body, together.body, alone.body_size));
        CHECK(shared > 100);
        api_response_clear(&alone);
        api_response_clear(&together);
    }
    CHECK(exr);
    free(exr);
    free(z);
}
