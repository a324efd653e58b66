/*
 * Nanoseconds per number of the codec, and per direction of whole requests through api_handle (no
 * socket), and how much faster two threads are than one: read ratios.  bench_wire [DIRECTIONS]
 */
#include "api.h"
#include "number.h"

#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { NUMBERS = 300000, REPEATS = 5 };

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static uint64_t state = 7;

static double uniform(void)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (double)(state >> 11) * 0x1p-53;
}

static char *text;
static double values[NUMBERS];

/* Best of a few runs: others share the machine. */
#define MEASURE(best, count, statement)                                                            \
    do {                                                                                           \
        best = INFINITY;                                                                           \
        for (int r_ = 0; r_ < REPEATS; r_++) {                                                     \
            double begin_ = now_ns();                                                              \
            statement;                                                                             \
            best = fmin(best, (now_ns() - begin_) / (double)(count));                              \
        }                                                                                          \
    } while (0)

static size_t write_all(int digits, int how)
{
    char *p = text;
    for (int i = 0; i < NUMBERS; i++) {
        if (how == 0)
            p += digits ? api_number_print_digits(p, values[i], digits)
                        : api_number_print(p, values[i]);
        else
            p += snprintf(p, 40, "%.*g", digits ? digits : 17, values[i]);
        *p++ = ',';
    }
    *p = 0;
    return (size_t)(p - text);
}

static double read_all(size_t size, int how)
{
    double sum = 0, x = 0;
    const char *p = text, *end = text + size;
    while (p < end) {
        if (how == 0) {
            p = api_number_parse(p, end, &x);
        } else {
            char *next;
            x = strtod(p, &next);
            p = next;
        }
        sum += x;
        p++;
    }
    return sum;
}

static void codec(int digits)
{
    double ours, libc;
    size_t size;
    double sum[2];
    MEASURE(libc, NUMBERS, size = write_all(digits, 1));
    MEASURE(ours, NUMBERS, size = write_all(digits, 0));
    printf("print %2d digits: %5.1f ns a number (printf %.0f), %.1f bytes%s\n", digits, ours, libc,
           (double)size / NUMBERS, digits == 9 ? "   asked <= 12" : "");
    MEASURE(ours, NUMBERS, sum[0] = read_all(size, 0));
    MEASURE(libc, NUMBERS, sum[1] = read_all(size, 1));
    printf("parse %2d digits: %5.1f ns a number (strtod %.0f)%s%s\n", digits, ours, libc,
           digits == 9 ? "   asked <= 15" : "", sum[0] == sum[1] ? "" : "  DIFFERENT");
}

static void ask(const struct api_request *request, size_t directions, const char *name)
{
    double best, decode = 0, compute = 0, encode = 0;
    struct api_response response;
    size_t size = 0;
    int status = 0;
    MEASURE(best, directions, {
        api_handle(request, &response);
        size = response.body_size;
        status = response.status;
        decode = response.trace.decode_us;
        compute = response.trace.compute_us;
        encode = response.trace.encode_us;
        if (status != 200) printf("%.300s\n", (char *)response.body);
        api_response_clear(&response);
    });
    double n = 1e-3 * (double)directions;
    printf(
        "%-32s %4d: %6.1f ns a direction; decode %.1f, compute %.1f, encode %.1f; %zu bytes in, %zu out\n",
        name, status, best, decode / n, compute / n, encode / n, request->body_size, size);
}

static void direction(double v[3])
{
    double z = uniform(), phi = 6.28318530717958648 * uniform(), s = sqrt(1 - z * z);
    v[0] = s * cos(phi);
    v[1] = s * sin(phi);
    v[2] = z;
}

static void json(size_t n, int digits)
{
    char *body = malloc(n * 80 + 200), *p = body, name[64];
    p += sprintf(p, "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[0,0,1]],\"wi\":[");
    for (size_t i = 0; i < n; i++) {
        double v[3];
        direction(v);
        for (int k = 0; k < 3; k++) {
            *p++ = k ? ',' : '[';
            p += digits ? api_number_print_digits(p, v[k], digits) : api_number_print(p, v[k]);
        }
        *p++ = ']';
        *p++ = i + 1 < n ? ',' : ']';
    }
    *p++ = '}';
    struct api_request request = {
        .method = "POST", .path = "/v1/eval", .body = body, .body_size = (size_t)(p - body)};
    snprintf(name, sizeof name, "JSON, %d digits", digits);
    ask(&request, n, name);
    free(body);
}

static void form(size_t n, const char *accept)
{
    static const char head[] = "--b\r\nContent-Disposition: form-data; name=\"request\"\r\n\r\n"
                               "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[0,0,1]]}\r\n"
                               "--b\r\nContent-Disposition: form-data; name=\"wi\"\r\n\r\n";
    char *body = malloc(sizeof head + 12 * n + 20), *p = body, name[64];
    p += sprintf(p, "%s", head);
    for (size_t i = 0; i < n; i++) {
        double v[3];
        direction(v);
        for (int k = 0; k < 3; k++, p += 4) memcpy(p, &(float){(float)v[k]}, 4);
    }
    p += sprintf(p, "\r\n--b--\r\n");
    struct api_request request = {.method = "POST",
                                  .path = "/v1/eval",
                                  .content_type = "multipart/form-data; boundary=b",
                                  .accept = accept,
                                  .body = body,
                                  .body_size = (size_t)(p - body)};
    snprintf(name, sizeof name, "float32, %s", strchr(accept, '/') + 1);
    ask(&request, n, name);
    free(body);
}

/* ---- Threads ------------------------------------------------------------------------------------- */

/* One helper, as a worker of the daemon with nothing else to do. */
static struct crew {
    pthread_mutex_t mutex;
    pthread_cond_t changed;
    void (*task)(void *arg, size_t index);
    void *arg;
    size_t taken, count, helping;
    double busy_ns; /* processor time of all tasks */
} crew = {.mutex = PTHREAD_MUTEX_INITIALIZER, .changed = PTHREAD_COND_INITIALIZER};

static double thread_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static void take_tasks(void)
{
    while (crew.taken < crew.count) {
        size_t index = crew.taken++;
        pthread_mutex_unlock(&crew.mutex);
        double begin = thread_ns();
        crew.task(crew.arg, index);
        double end = thread_ns();
        pthread_mutex_lock(&crew.mutex);
        crew.busy_ns += end - begin;
    }
}

static void *help(void *unused)
{
    pthread_mutex_lock(&crew.mutex);
    for (;;) {
        while (crew.taken == crew.count) pthread_cond_wait(&crew.changed, &crew.mutex);
        crew.helping++;
        take_tasks();
        crew.helping--;
        pthread_cond_broadcast(&crew.changed);
    }
    return unused;
}

static void share(void *unused, size_t count, void (*task)(void *arg, size_t index), void *arg)
{
    (void)unused;
    pthread_mutex_lock(&crew.mutex);
    crew.task = task;
    crew.arg = arg;
    crew.taken = 0;
    crew.count = count;
    pthread_cond_broadcast(&crew.changed);
    take_tasks();
    while (crew.helping) pthread_cond_wait(&crew.changed, &crew.mutex);
    pthread_mutex_unlock(&crew.mutex);
}

static double wall_ms(const struct api_request *request)
{
    static char block[1 << 17];
    struct timespec a, b;
    struct api_response response;
    clock_gettime(CLOCK_MONOTONIC, &a);
    api_handle(request, &response);
    if (response.status != 200) printf("%.300s\n", (char *)response.body);
    while (response.stream && api_stream_next(response.stream, block, sizeof block) > 0) continue;
    clock_gettime(CLOCK_MONOTONIC, &b);
    api_response_clear(&response);
    return 1e3 * (double)(b.tv_sec - a.tv_sec) + 1e-6 * (double)(b.tv_nsec - a.tv_nsec);
}

/*
 * The answer of 1e6 Beckmann directions, fr and pdf, block by block; in turns, best of some.  The wall
 * tells only on a quiet machine; by processor time: what is shared counts half, the rest is one thread's.
 */
static void threads(const char *accept)
{
    static const char body[] =
        "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3},\"outputs\":[\"fr\",\"pdf\"],"
        "\"wo\":[[-0.6,0,0.8]],\"wi\":{\"grid\":{\"theta\":1000,\"phi\":1000}}}";
    struct api_request request = {.method = "POST",
                                  .path = "/v1/eval",
                                  .accept = accept,
                                  .body = body,
                                  .body_size = sizeof body - 1,
                                  .can_stream = true};
    double one = INFINITY, two = INFINITY, shared_ns = INFINITY, all_ns = INFINITY;
    for (int i = 0; i < 3 * REPEATS; i++) {
        request.share = NULL;
        one = fmin(one, wall_ms(&request));
        request.share = share;
        crew.busy_ns = 0;
        double begin = now_ns();
        two = fmin(two, wall_ms(&request));
        double spent = now_ns() - begin;
        if (spent < all_ns) all_ns = spent, shared_ns = crew.busy_ns;
    }
    printf(
        "1e6 Beckmann fr and pdf, %s: 1 thread %.1f ms, 2 threads %.1f ms, ratio %.2f   asked >= 1.8; "
        "by processor time %.2f\n",
        strchr(accept, '/') + 1, one, two, one / two, all_ns / (all_ns - shared_ns / 2));
}

int main(int argc, char **argv)
{
    size_t n = argc > 1 ? (size_t)strtoul(argv[1], NULL, 10) : 100000;
    text = malloc(NUMBERS * 40);
    if (!text || !api_open()) return 1;
    for (int i = 0; i < NUMBERS; i++) values[i] = 2 * uniform() - 1;
    static const int digits[] = {4, 6, 8, 9, 12, 17, 0};
    for (size_t i = 0; i < sizeof digits / sizeof *digits; i++) codec(digits[i]);
    json(n, 9);
    json(n, 0);
    form(n, "application/octet-stream");
    form(n, "application/x-npy");
    form(n, "application/zip");
    form(n, "application/json");
    pthread_t helper;
    if (pthread_create(&helper, NULL, help, NULL)) return 1;
    threads("application/json");
    threads("application/octet-stream");
    free(text);
    api_close();
    return 0;
}
