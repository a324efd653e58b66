/*
 * facet_client - a black-box client of facetd: runs case files against any base URL.
 *
 *   facet_client (--base-url URL | --daemon PROGRAM) --cases DIR
 *                [--filter TEXT] [--jobs N] [--report FILE]
 *
 * A case is DIR/<endpoint>/<case>.json: {"doc":..., "request":{...}, "expect":{...}}; see body.h,
 * expect.h and CONTRIBUTING.md.  "then":[{"request":{...,"json":{"material":{"answer":"/material"}}},
 * "expect":{...}}, ...] sends more, with that part of the first answer in place of the member.  Prints "ok|FAIL|skip client/<endpoint>/<case>"; exits 0 only if
 * none failed. Knows the daemon by its wire alone: shares no code with it.
 */
#include "body.h"
#include "cases.h"
#include "daemon.h"
#include "expect.h"
#include "http.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct options {
    const char *base_url, *daemon, *cases, *filter, *report;
    long jobs;
};

/* What the workers share: the next case to take, and the output. */
struct run {
    const struct options *options;
    const struct cases *cases;
    pthread_mutex_t lock;
    size_t next, failed;
    FILE *report;
};

static void print_result(struct run *run, const struct test_case *c, const char *verdict,
                         const char *why, const struct findings *findings,
                         const struct http_answer *answer)
{
    pthread_mutex_lock(&run->lock);
    fputs(findings->text, stdout);
    printf("%s client/%s%s%s\n", verdict, c->name, *why ? ": " : "", why);
    fflush(stdout);
    run->failed += !strcmp(verdict, "FAIL");
    if (run->report)
        fprintf(run->report,
                "{\"case\":\"%s\",\"result\":\"%s\",\"status\":%ld,\"ms\":%.3f,\"bytes\":%zu}\n",
                c->name, verdict, answer->status, answer->ms, answer->body_size);
    pthread_mutex_unlock(&run->lock);
}

/* One request and its answer; false: there is nothing to send, body->why. */
static bool exchange(struct run *run, const json_t *step, CURL *curl, struct body *body,
                     struct http_answer *answer, struct findings *findings)
{
    const json_t *request = json_object_get(step, "request");
    enum body_result made = body_make(request, body);
    if (made == BODY_ABSENT) return false;
    if (made == BODY_BAD) {
        finding(findings, "%s", body->why);
        return true;
    }
    cases_send(curl, run->options->base_url, request, body, answer);
    expect_check(json_object_get(step, "expect"), answer, findings);
    return true;
}

/* A step with each {"answer":pointer} of its json replaced by what stands there. */
static json_t *filled_step(const json_t *step, const struct http_answer *answer,
                           struct findings *findings)
{
    json_t *filled = json_deep_copy(step), *member;
    json_t *root = json_loadb(answer->body, answer->body_size, 0, NULL);
    const char *key;
    void *rest;
    json_object_foreach_safe(json_object_get(json_object_get(filled, "request"), "json"), rest, key,
                             member)
    {
        const char *pointer = json_string_value(json_object_get(member, "answer"));
        if (!pointer) continue;
        const json_t *part = expect_at(root, pointer);
        if (!part) finding(findings, "%s is not in the answer", pointer);
        json_object_set_new(json_object_get(json_object_get(filled, "request"), "json"), key,
                            json_deep_copy(part));
    }
    json_decref(root);
    return filled;
}

static void run_case(struct run *run, const struct test_case *c, CURL *curl)
{
    struct findings findings = {{0}, 0};
    struct http_answer answer = {0};
    struct body body;
    if (!exchange(run, c->root, curl, &body, &answer, &findings)) {
        print_result(run, c, "skip", body.why, &findings, &answer);
        return;
    }
    const json_t *step;
    size_t i;
    json_array_foreach(json_object_get(c->root, "then"), i, step)
    {
        struct http_answer next = {0};
        struct body sent = {0};
        json_t *filled = findings.length ? NULL : filled_step(step, &answer, &findings);
        if (!findings.length && !exchange(run, filled, curl, &sent, &next, &findings))
            finding(&findings, "%s", sent.why);
        json_decref(filled);
        http_clear(&next);
        body_clear(&sent);
    }
    print_result(run, c, findings.length ? "FAIL" : "ok", "", &findings, &answer);
    http_clear(&answer);
    body_clear(&body);
}

static void *work(void *user)
{
    struct run *run = user;
    CURL *curl = curl_easy_init();
    for (;;) {
        pthread_mutex_lock(&run->lock);
        size_t i = run->next++;
        pthread_mutex_unlock(&run->lock);
        if (!curl || i >= run->cases->count) break;
        run_case(run, &run->cases->list[i], curl);
    }
    curl_easy_cleanup(curl);
    return NULL;
}

static bool run_all(const struct options *options, const struct cases *cases)
{
    enum { JOBS_MAX = 64 };
    pthread_t threads[JOBS_MAX];
    struct run run = {.options = options, .cases = cases, .lock = PTHREAD_MUTEX_INITIALIZER};
    long jobs = options->jobs < 1 ? 1 : options->jobs > JOBS_MAX ? JOBS_MAX : options->jobs, n = 0;
    if (options->report && !(run.report = fopen(options->report, "w"))) {
        perror(options->report);
        return false;
    }
    while (n < jobs && !pthread_create(&threads[n], NULL, work, &run)) n++;
    for (long i = 0; i < n; i++) pthread_join(threads[i], NULL);
    if (run.report) fclose(run.report);
    return n && !run.failed;
}

static bool parse(int argc, char **argv, struct options *options)
{
    for (int i = 1; i < argc; i += 2) {
        const char *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (!value)
            return false;
        else if (!strcmp(argv[i], "--base-url"))
            options->base_url = value;
        else if (!strcmp(argv[i], "--daemon"))
            options->daemon = value;
        else if (!strcmp(argv[i], "--cases"))
            options->cases = value;
        else if (!strcmp(argv[i], "--filter"))
            options->filter = value;
        else if (!strcmp(argv[i], "--report"))
            options->report = value;
        else if (!strcmp(argv[i], "--jobs"))
            options->jobs = strtol(value, NULL, 10);
        else
            return false;
    }
    return options->cases && !options->base_url != !options->daemon;
}

int main(int argc, char **argv)
{
    struct options options = {.jobs = 1};
    struct cases cases = {0};
    struct daemon daemon = {0};
    if (!parse(argc, argv, &options)) {
        fprintf(stderr, "usage: facet_client (--base-url URL | --daemon PROGRAM) --cases DIR "
                        "[--filter TEXT] [--jobs N] [--report FILE]\n");
        return 2;
    }
    if (!cases_load(options.cases, options.filter, &cases)) return 2;
    if (options.daemon && !daemon_start(options.daemon, &daemon)) return 2;
    if (options.daemon) options.base_url = daemon.url;
    curl_global_init(CURL_GLOBAL_DEFAULT);
    bool good = run_all(&options, &cases);
    if (options.daemon) {
        int ended = daemon_stop(&daemon);
        printf("%s client/daemon_ends: exit %d after SIGTERM\n", ended ? "FAIL" : "ok", ended);
        good = good && !ended;
    }
    curl_global_cleanup();
    cases_clear(&cases);
    return good ? 0 : 1;
}
