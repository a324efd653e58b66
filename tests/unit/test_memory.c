/* Every allocation of every endpoint's example fails once: an answer all the same, and nothing
 * leaks (asan). */
#include "ask.h"
#include "check.h"
#include "draw.h"
#include "endpoint.h"
#include "exr_file.h"
#include "form.h"

#include <execinfo.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

/* Linked with --wrap: the calls of lib and api come here. */
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *pointer, size_t size);
void *__wrap_aligned_alloc(size_t alignment, size_t size);
void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *pointer, size_t size);
void *__real_aligned_alloc(size_t alignment, size_t size);

static long left = -1; /* allocations until one fails; negative: none fails */
static bool all_after, hit;

/* By which calls each allocation was reached: a hash of the stack; while `paths` is there. */
enum { PATHS_MAX = 10000 };
static uint64_t *paths;
static size_t path_count;

static void note_path(void)
{
    void *frame[48];
    uint64_t hash = 14695981039346656037u;
    int n = backtrace(frame, 48);
    for (int i = 0; i < n; i++) hash = (hash ^ (uintptr_t)frame[i]) * 1099511628211u;
    if (path_count < PATHS_MAX) paths[path_count++] = hash;
}

static bool fails(void)
{
    if (paths) note_path();
    if (left < 0) return false;
    if (left) return left--, false;
    hit = true;
    if (!all_after) left = -1;
    return true;
}

void *__wrap_malloc(size_t size)
{
    return fails() ? NULL : __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size)
{
    return fails() ? NULL : __real_calloc(count, size);
}

void *__wrap_realloc(void *pointer, size_t size)
{
    return fails() ? NULL : __real_realloc(pointer, size);
}

void *__wrap_aligned_alloc(size_t alignment, size_t size)
{
    return fails() ? NULL : __real_aligned_alloc(alignment, size);
}

/* The example with its n-th allocation failing; true while there was one to fail. */
static bool fail_at(const struct endpoint *endpoint, long n, bool and_after)
{
    struct api_request request = {.method = endpoint->method,
                                  .path = endpoint->path,
                                  .body = endpoint->example,
                                  .body_size = endpoint->example ? strlen(endpoint->example) : 0};
    struct api_response response;
    left = n;
    all_after = and_after;
    hit = false;
    api_handle(&request, &response);
    left = -1;
    if (hit ? response.status != 503 : response.status != 200)
        check_fail(__FILE__, __LINE__, "%s: %d with allocation %ld failing: %.200s", endpoint->path,
                   response.status, n, response.body ? (char *)response.body : "");
    CHECK(response.body || (!response.body_size && and_after));
    api_response_clear(&response);
    return hit;
}

TEST(a_failed_allocation_is_an_answer)
{
    struct answer warm = ask("GET", "/healthz", NULL); /* opens the API */
    answer_clear(&warm);
    for (size_t i = 0; api_endpoint(i); i++) {
        long n = 0;
        while (n < 5000 && fail_at(api_endpoint(i), n, false)) n++;
        CHECK(n > 0); /* one of a tiny answer, whose stream is a spare one */
        check_note("allocations", (double)n);
        for (n = 0; n < 5000 && fail_at(api_endpoint(i), n, true); n += 1 + n / 8) continue;
    }
}

/* The table of the sampler "table" is made by the first request that names it. */
TEST(a_table_that_finds_no_memory_is_no_missing_bound)
{
    static const char *const bodies[][2] = {
        {"/v1/sample",
         "{\"material\":{\"alpha\":0.3},\"wo\":[[0,0,1]],\"n\":2,\"sampler\":\"table\",\"tolerance\":1e-5}"},
        {"/v1/pdf",
         "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3},\"wi\":[[0,0,1]],\"wo\":[[0,0,1]],\"sampler\":\"table\",\"tolerance\":1e-5}"},
    };
    for (size_t i = 0; i < sizeof bodies / sizeof *bodies; i++) {
        const struct endpoint endpoint = {
            .method = "POST", .path = bodies[i][0], .example = bodies[i][1]};
        long n = 0;
        while (n < 5000 && fail_at(&endpoint, n, false)) n++;
        CHECK(n > 1);
        check_note("allocations", (double)n);
    }
}

/* The same for a form of arrays, answered as an archive of arrays. */
static bool fail_in_form(const char *path, const struct form *form, const char *accept, long n)
{
    const struct api_request request = {.method = "POST",
                                        .path = path,
                                        .content_type = FORM_TYPE,
                                        .accept = accept,
                                        .body = form->bytes,
                                        .body_size = form->size};
    struct api_response response;
    left = n;
    all_after = hit = false;
    api_handle(&request, &response);
    left = -1;
    if (hit ? response.status != 503 : response.status != 200)
        check_fail(__FILE__, __LINE__, "%d with allocation %ld failing: %.200s", response.status, n,
                   response.status == 200 ? "an answer" : (char *)response.body);
    api_response_clear(&response);
    return hit;
}

TEST(a_failed_allocation_in_a_form)
{
    enum { N = 5000 };
    static const char text[] = "{\"material\":{\"alpha\":0.3},\"outputs\":[\"fr\",\"pdf\"],"
                               "\"wo\":[[0,0,1],[0,0,1.0005]],\"pairing\":\"outer\"}";
    float *wi = malloc(3 * N * sizeof *wi);
    for (int i = 0; i < 3 * N; i++) wi[i] = i % 3 == 2;
    struct form form = {0}, sample = {0};
    form_add_text(&form, "request", text);
    form_add_npy(&form, "wi", wi, N, 3);
    form_end(&form);
    form_add_text(&sample, "request", "{\"material\":{\"alpha\":0.3},\"dtype\":\"float64\"}");
    form_add_npy(&sample, "wo", wi, N, 3);
    form_add(&sample, "u", (double[]){0.25, 0.5}, 2 * sizeof(double));
    form_end(&sample);
    struct answer warm = ask("GET", "/healthz", NULL);
    answer_clear(&warm);
    static const char *const accept[] = {"application/zip", "application/octet-stream",
                                         "application/json"};
    for (size_t k = 0; k < sizeof accept / sizeof *accept; k++) {
        for (long n = 0; n < 5000 && fail_in_form("/v1/eval", &form, accept[k], n); n++)
            check_note("allocations, eval", (double)n);
        for (long n = 0; n < 5000 && fail_in_form("/v1/sample", &sample, accept[k], n); n++)
            check_note("allocations, sample", (double)n);
    }
    form_clear(&form);
    form_clear(&sample);
    free(wi);
}

/* The same for a stream: what fails before it begins is an answer, what fails later ends it. */
static bool fail_in_stream(const char *accept, long n)
{
    static const char body[] =
        "{\"material\":{\"alpha\":0.3},\"wo\":[[0,0,1]],\"outputs\":[\"fr\",\"D\"],"
        "\"dtype\":\"float64\",\"wi\":{\"grid\":{\"theta\":256,\"phi\":270}}}";
    const struct api_request request = {.method = "POST",
                                        .path = "/v1/eval",
                                        .accept = accept,
                                        .body = body,
                                        .body_size = sizeof body - 1,
                                        .can_stream = true};
    static char bytes[1 << 16];
    struct api_response response;
    left = n;
    all_after = hit = false;
    api_handle(&request, &response);
    bool early = hit;
    long got = 1;
    while (response.stream && got > 0) got = api_stream_next(response.stream, bytes, sizeof bytes);
    left = -1;
    if (early ? response.status != 503 : response.status != 200 || got != (hit ? -1 : 0))
        check_fail(__FILE__, __LINE__, "%d, then %ld, with allocation %ld failing", response.status,
                   got, n);
    api_response_clear(&response);
    return hit;
}

TEST(a_failed_allocation_in_a_stream)
{
    struct answer warm = ask("GET", "/healthz", NULL);
    answer_clear(&warm);
    for (long n = 0; n < 5000 && fail_in_stream("application/json", n); n++)
        check_note("allocations, JSON", (double)n);
    for (long n = 0; n < 5000 && fail_in_stream("application/octet-stream", n); n++)
        check_note("allocations, bytes", (double)n);
}

/* The same for the readers and the writer of image files. */
static bool fail_in_file(const void *body, size_t size, long n)
{
    const struct api_request request = {.method = "POST",
                                        .path = "/v1/leadr",
                                        .query = "type=half&form=central&compression=zip",
                                        .body = body,
                                        .body_size = size};
    struct api_response response;
    left = n;
    all_after = hit = false;
    api_handle(&request, &response);
    left = -1;
    if (hit ? response.status != 503 : response.status != 200)
        check_fail(__FILE__, __LINE__, "%d with allocation %ld failing: %.200s", response.status, n,
                   response.status == 200 ? "a file" : (char *)response.body);
    api_response_clear(&response);
    return hit;
}

TEST(a_failed_allocation_in_a_file)
{
    float heights[70 * 3] = {0, 1, 0, 2};
    size_t size = 0;
    unsigned char *exr = exr_file_of_heights(heights, 70, 3, &size);
    struct answer warm = ask("GET", "/healthz", NULL);
    answer_clear(&warm);
    for (long n = 0; exr && n < 5000 && fail_in_file(exr, size, n); n++)
        check_note("allocations, EXR", (double)n);
    free(exr);
    const char *path = check_data("heights/dem/crater_dat.png");
    void *png = path ? check_read_file(path, &size) : NULL;
    for (long n = 0; png && n < 5000 && fail_in_file(png, size, n); n++)
        check_note("allocations, PNG", (double)n);
    if (!png) check_skip("no shared data");
    free(png);
}

/* The same for a measurement: few samples, every model that samples have, an export. */
static bool fail_in_fit(const char *csv, const char *query, const char *accept, long n)
{
    const struct api_request request = {.method = "POST",
                                        .path = "/v1/fit",
                                        .query = query,
                                        .accept = accept,
                                        .content_type = "text/csv",
                                        .body = csv,
                                        .body_size = strlen(csv)};
    struct api_response response;
    left = n;
    all_after = hit = false;
    api_handle(&request, &response);
    left = -1;
    if (hit ? response.status != 503 : response.status != 200)
        check_fail(__FILE__, __LINE__, "%d with allocation %ld failing: %.200s", response.status, n,
                   (char *)response.body);
    api_response_clear(&response);
    return hit;
}

TEST(a_failed_allocation_in_a_fit)
{
    char csv[4000], *at = csv;
    struct answer warm = ask("GET", "/healthz", NULL);
    answer_clear(&warm);
    for (int k = 0; k < 24; k++)
        at += sprintf(at, "%g,0,%g,%g,%g,.2,.1\n", .05 * k, .04 * k, 3.1 + .1 * (k % 3),
                      .3 + 1. / (1 + k));
    for (long n = 0; n < 5000 && fail_in_fit(csv, "model=ggx&export=gltf", NULL, n);
         n += 1 + n / 40)
        check_note("allocations", (double)n);
}

/* Both sides of a surface; slopes over the azimuth, and what samples need of them. */
TEST(a_failed_allocation_in_what_few_materials_have)
{
    static const char *const requests[][2] = {
        {"/v1/albedo",
         "{\"material\":{\"alpha\":0.3,\"transmission\":true,\"fresnel\":{\"dielectric\":{\"eta\":1.5}}},"
         "\"wo\":[[0,0,1],[0,0.6,-0.8]],\"tolerance\":0.01}"},
        {"/v1/sample",
         "{\"material\":{\"alpha\":0.3,\"transmission\":true,\"fresnel\":{\"dielectric\":{\"eta\":1.5}}},"
         "\"wo\":[[0,0,1]],\"u\":[[0.5,0.5]],\"u_lobe\":[0.5],\"outputs\":[\"wi\"]}"},
        {"/v1/sample",
         "{\"material\":{\"ndf\":\"tabulated\",\"slopes\":{\"scale\":1,\"log_D\":[[0,-1,-2,-3],[0,-1,-2,-4],"
         "[0,-1,-2,-4],[0,-1,-2,-3]]}},\"wo\":[[0,0,1]],\"u\":[[0.5,0.5]],\"outputs\":[\"wi\"]}"},
    };
    struct answer warm = ask("GET", "/healthz", NULL);
    answer_clear(&warm);
    for (size_t k = 0; k < sizeof requests / sizeof *requests; k++) {
        struct form form = {0};
        long n = 0;
        form_add_text(&form, "request", requests[k][1]);
        form_end(&form);
        while (n < 5000 && fail_in_form(requests[k][0], &form, "application/json", n)) n++;
        CHECK(n > 1);
        check_note(requests[k][0], (double)n);
        form_clear(&form);
    }
}

static bool is_among(const uint64_t *list, size_t count, uint64_t path)
{
    for (size_t k = 0; k < count; k++)
        if (list[k] == path) return true;
    return false;
}

/* By which paths this request allocates. */
static void note_paths(const struct endpoint *endpoint, uint64_t *list)
{
    path_count = 0;
    paths = list;
    CHECK(!fail_at(endpoint, PATHS_MAX, false));
    paths = NULL;
    CHECK(path_count < PATHS_MAX);
}

/*
 * Tables over the azimuth, compact ones and those beside a diffuse part as well.  Such a fit takes
 * a tenth of a second and more, so each path to an allocation fails once, and none that
 * the fits before it had; the first has no tables.
 */
TEST(a_failed_allocation_in_a_fit_of_rows)
{
#define SOURCE "{\"source\":{\"ndf\":\"beckmann\",\"alpha_x\":0.4,\"alpha_y\":0.1,\"diffuse\":0.3},"
    static const char *const bodies[] = {
        SOURCE "\"masking\":\"none\",\"model\":\"ggx\"}",
        SOURCE
        "\"masking\":\"none\",\"model\":\"tabulated\",\"diffuse\":\"false\",\"resolution\":8}",
        SOURCE "\"masking\":\"none\",\"model\":\"tabulated\",\"resolution\":8}",
    };
    uint64_t *list = malloc(PATHS_MAX * sizeof *list), *known = malloc(PATHS_MAX * sizeof *known);
    size_t count = 0;
    struct answer warm = ask("GET", "/healthz", NULL);
    answer_clear(&warm);
    const size_t fits = draw_count(1) > 1 ? 3 : 2; /* the last takes as long as all else */
    for (size_t k = 0; k < fits && list && known; k++) {
        const struct endpoint endpoint = {
            .method = "POST", .path = "/v1/fit", .example = bodies[k]};
        size_t before = count;
        note_paths(&endpoint, list);
        for (size_t n = 0; n < path_count; n++) {
            if (is_among(known, count, list[n])) continue;
            known[count++] = list[n];
            if (k) CHECK(fail_at(&endpoint, (long)n, false));
        }
        CHECK(count > before + 20);
        check_note(k == 2 ? "with a diffuse part"
                   : k    ? "with tables"
                          : "without tables",
                   (double)(count - before));
    }
    free(list);
    free(known);
}
