#define _GNU_SOURCE /* CLOCK_PROCESS_CPUTIME_ID is POSIX; open_memstream too */
#include "metrics.h"

#include <fcntl.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { PATHS_MAX = 32, TIERS_MAX = 8, LEFT_STATUS = 499 };

/* Every status the daemon gives; 499, as nginx has it: the client left before the answer. */
static const int statuses[] = {200, 204, 304, 400, 401, 404, 405, 406, 408, 411, 413,
                               414, 415, 422, 429, 431, 499, 500, 501, 503, 505, 0};
static const double bounds_s[] = {1e-4, 2.5e-4, 1e-3, 2.5e-3, .01, .025, .1, .25, 1, 2.5, 10};

enum { STATUSES = sizeof statuses / sizeof *statuses, BOUNDS = sizeof bounds_s / sizeof *bounds_s };

typedef atomic_ullong counter;

struct histogram {
    counter bucket[BOUNDS + 1], sum_us;
};

static const struct {
    const char *type, *name, *help;
} rows[] = {
#define METRIC(id, type, name, help) {type, name, help},
#include "metrics.def"
#undef METRIC
};

/* Paths and tiers are the API's: a few static strings, each given a place when first seen. */
static struct {
    atomic_llong plain[METRIC_COUNT];
    _Atomic(const char *) path[PATHS_MAX], tier[TIERS_MAX];
    counter requests[PATHS_MAX][STATUSES];
    struct histogram total[PATHS_MAX], queue, compute;
    counter evaluations[TIERS_MAX], tier_requests[TIERS_MAX];
    int statm_fd;
} all = {.statm_fd = -1};

void metrics_open(void)
{
    all.statm_fd = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
}

void metrics_close(void)
{
    if (all.statm_fd >= 0) close(all.statm_fd);
    all.statm_fd = -1;
}

void metrics_add(enum metric metric, long long by)
{
    atomic_fetch_add_explicit(&all.plain[metric], by, memory_order_relaxed);
}

void metrics_set(enum metric metric, long long value)
{
    atomic_store_explicit(&all.plain[metric], value, memory_order_relaxed);
}

long long metrics_get(enum metric metric)
{
    return atomic_load_explicit(&all.plain[metric], memory_order_relaxed);
}

static void count(counter *at, unsigned long long by)
{
    atomic_fetch_add_explicit(at, by, memory_order_relaxed);
}

static unsigned long long value_of(const counter *at)
{
    return atomic_load_explicit(at, memory_order_relaxed);
}

/* The place of a text; the last one is for all that come when the table is full. */
static size_t place_of(_Atomic(const char *) *table, size_t size, const char *text)
{
    for (size_t i = 0; i + 1 < size; i++) {
        const char *there = atomic_load(&table[i]);
        if (!there && atomic_compare_exchange_strong(&table[i], &there, text)) return i;
        if (there == text || !strcmp(there, text)) return i;
    }
    const char *none = NULL;
    atomic_compare_exchange_strong(&table[size - 1], &none, "other");
    return size - 1;
}

static void observe(struct histogram *histogram, double us)
{
    size_t i = 0;
    if (us < 0) us = 0;
    while (i < BOUNDS && us > 1e6 * bounds_s[i]) i++;
    count(&histogram->bucket[i], 1);
    count(&histogram->sum_us, (unsigned long long)us);
}

void metrics_request(const struct request *request, bool client_left)
{
    const struct api_response *response = &request->response;
    const struct api_trace *trace = &response->trace;
    const char *name = request->route.path ? request->route.path : "other";
    size_t path = place_of(all.path, PATHS_MAX, name), i = 0;
    int status = client_left ? LEFT_STATUS : response->status;
    while (statuses[i] && statuses[i] != status) i++;
    count(&all.requests[path][i], 1);
    observe(&all.total[path], (double)(request->done_us - request->started_us));
    if (request->was_queued && request->began_us)
        observe(&all.queue, (double)(request->began_us - request->received_us));
    metrics_add(METRIC_RECEIVED_BYTES, (long long)request->body_size);
    metrics_add(METRIC_SENT_BYTES, (long long)request_answer_size(request));
    if (!trace->tier) return;
    size_t tier = place_of(all.tier, TIERS_MAX, trace->tier);
    count(&all.tier_requests[tier], 1);
    count(&all.evaluations[tier], trace->evaluations);
    observe(&all.compute, trace->compute_us);
}

static void print_head(FILE *f, const char *name, const char *type, const char *help)
{
    fprintf(f, "# HELP %s %s\n# TYPE %s %s\n", name, help, name, type);
}

/* `label` is empty or ends with a comma. */
static void print_histogram(FILE *f, const char *name, const char *label,
                            const struct histogram *histogram)
{
    unsigned long long so_far = 0;
    for (size_t i = 0; i <= BOUNDS; i++) {
        so_far += value_of(&histogram->bucket[i]);
        if (i < BOUNDS)
            fprintf(f, "%s_bucket{%sle=\"%g\"} %llu\n", name, label, bounds_s[i], so_far);
        else
            fprintf(f, "%s_bucket{%sle=\"+Inf\"} %llu\n", name, label, so_far);
    }
    const int n = (int)strlen(label) - 1;
    const char *open = n > 0 ? "{" : "", *close = n > 0 ? "}" : "";
    fprintf(f, "%s_sum%s%.*s%s %.6f\n", name, open, n > 0 ? n : 0, label, close,
            1e-6 * (double)value_of(&histogram->sum_us));
    fprintf(f, "%s_count%s%.*s%s %llu\n", name, open, n > 0 ? n : 0, label, close, so_far);
}

static void print_requests(FILE *f)
{
    const char *path;
    print_head(f, "facetd_requests_total", "counter", "Requests, by path and status.");
    for (size_t p = 0; p < PATHS_MAX; p++)
        for (size_t i = 0; (path = atomic_load(&all.path[p])) && i < STATUSES; i++)
            if (value_of(&all.requests[p][i]))
                fprintf(f, "facetd_requests_total{path=\"%s\",code=\"%d\"} %llu\n", path,
                        statuses[i], value_of(&all.requests[p][i]));
    print_head(f, "facetd_request_duration_seconds", "histogram",
               "From the request line to the last byte of the answer.");
    for (size_t p = 0; p < PATHS_MAX; p++) {
        char label[96];
        if (!(path = atomic_load(&all.path[p]))) continue;
        snprintf(label, sizeof label, "path=\"%s\",", path);
        print_histogram(f, "facetd_request_duration_seconds", label, &all.total[p]);
    }
    print_head(f, "facetd_queue_duration_seconds", "histogram",
               "Long requests: waiting for a worker.");
    print_histogram(f, "facetd_queue_duration_seconds", "", &all.queue);
    print_head(f, "facetd_compute_duration_seconds", "histogram", "Computing, without the codecs.");
    print_histogram(f, "facetd_compute_duration_seconds", "", &all.compute);
}

static void print_tiers(FILE *f)
{
    const char *tier;
    print_head(f, "facetd_tier_requests_total", "counter", "Requests, by tier.");
    for (size_t t = 0; t < TIERS_MAX; t++)
        if ((tier = atomic_load(&all.tier[t])))
            fprintf(f, "facetd_tier_requests_total{tier=\"%s\"} %llu\n", tier,
                    value_of(&all.tier_requests[t]));
    print_head(f, "facetd_evaluations_total", "counter", "Evaluated pairs and samples, by tier.");
    for (size_t t = 0; t < TIERS_MAX; t++)
        if ((tier = atomic_load(&all.tier[t])))
            fprintf(f, "facetd_evaluations_total{tier=\"%s\"} %llu\n", tier,
                    value_of(&all.evaluations[t]));
}

static void print_process(FILE *f)
{
    struct timespec cpu = {0};
    char text[128];
    unsigned long pages;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &cpu);
    print_head(f, "process_cpu_seconds_total", "counter", "CPU time.");
    fprintf(f, "process_cpu_seconds_total %.6f\n", (double)cpu.tv_sec + 1e-9 * (double)cpu.tv_nsec);
    ssize_t n = all.statm_fd < 0 ? -1 : pread(all.statm_fd, text, sizeof text - 1, 0);
    if (n > 0 && (text[n] = 0, sscanf(text, "%*u %lu", &pages)) == 1) {
        print_head(f, "process_resident_memory_bytes", "gauge", "Resident memory.");
        fprintf(f, "process_resident_memory_bytes %llu\n",
                (unsigned long long)pages * (unsigned long long)sysconf(_SC_PAGESIZE));
    }
    print_head(f, "facetd_build_info", "gauge", "Always 1; the version is the label.");
    fprintf(f, "facetd_build_info{version=\"%s\"} 1\n", FACET_VERSION);
}

char *metrics_print(size_t *size)
{
    char *text = NULL;
    FILE *f = open_memstream(&text, size);
    if (!f) return NULL;
    for (size_t i = 0; i < METRIC_COUNT; i++) {
        print_head(f, rows[i].name, rows[i].type, rows[i].help);
        fprintf(f, "%s %lld\n", rows[i].name, metrics_get((enum metric)i));
    }
    print_requests(f);
    print_tiers(f);
    print_process(f);
    bool failed = ferror(f);
    if (!fclose(f) && !failed) return text;
    free(text);
    return NULL;
}
