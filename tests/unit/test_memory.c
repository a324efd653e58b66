/* Every allocation of every endpoint's example fails once: an answer all the same, and nothing
 * leaks (asan). */
#include "ask.h"
#include "check.h"
#include "endpoint.h"

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

static bool fails(void)
{
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
        CHECK(n > 1);
        check_note("allocations", (double)n);
        for (n = 0; n < 5000 && fail_at(api_endpoint(i), n, true); n += 1 + n / 8) continue;
    }
}
