/* The daemon as users get it: what the real API and the server do together. */
#include "check.h"
#include "daemon.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define FACETD "../../facetd"

static struct answer answer;

/* A line of /proc/<pid>/status, in KiB; -1: not there. */
static long memory_kib(const struct daemon *daemon, const char *name)
{
    char path[64], line[256], format[32];
    long kib = -1;
    snprintf(path, sizeof path, "/proc/%ld/status", (long)daemon->pid);
    snprintf(format, sizeof format, "%s: %%ld", name);
    FILE *f = fopen(path, "r");
    while (f && fgets(line, sizeof line, f)) sscanf(line, format, &kib);
    if (f) fclose(f);
    return kib;
}

TEST(idle_it_holds_at_most_20_mb)
{
    enum { LIMIT_KIB = 20 * 1024 };
    struct daemon daemon;
    if (SANITIZED) {
        check_skip("a sanitizer's own memory is counted too");
        return;
    }
    if (!daemon_start(&daemon, FACETD, NULL)) return;
    CHECK(daemon_get(&daemon, "/healthz", &answer));
    long kib = memory_kib(&daemon, "VmRSS");
    CHECK(kib > 0 && kib <= LIMIT_KIB);
    check_note("resident_kib", (double)kib);
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* 8 MB of JSON, a million directions; the status. */
static int ask_a_million(const struct daemon *daemon)
{
    enum { COUNT = 1000000 };
    static const char head[] =
        "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[0,0,1]],\"wi\":[",
                      one[] = "[0,0,1],", last[] = "[0,0,1]]}";
    char *body = malloc(sizeof head + COUNT * (sizeof one - 1) + sizeof last), *at = body;
    if (!body) return 0;
    at = (char *)memcpy(at, head, sizeof head - 1) + sizeof head - 1;
    for (int i = 0; i < COUNT - 1; i++)
        at = (char *)memcpy(at, one, sizeof one - 1) + sizeof one - 1;
    at = (char *)memcpy(at, last, sizeof last - 1) + sizeof last - 1;
    CHECK(daemon_ask(daemon, "POST", "/v1/eval", "Content-Type: application/json\r\n", body,
                     (size_t)(at - body), &answer));
    free(body);
    return answer.status;
}

TEST(what_a_large_request_took_is_given_back)
{
    enum { SPARE_KIB = 4096 };
    struct daemon daemon;
    if (SANITIZED) {
        check_skip("a sanitizer keeps memory for itself");
        return;
    }
    if (!daemon_start(&daemon, FACETD, NULL)) return;
    CHECK(daemon_get(&daemon, "/healthz", &answer));
    const long before = memory_kib(&daemon, "RssAnon");
    CHECK_INT(ask_a_million(&daemon), 200);
    const long peak = memory_kib(&daemon, "VmHWM");
    const double start = now_ms();
    while (memory_kib(&daemon, "RssAnon") > before + SPARE_KIB && now_ms() - start < 10000)
        sleep_ms(100);
    check_note("kib_before", (double)before);
    check_note("kib_peak", (double)peak);
    check_note("kib_after", (double)memory_kib(&daemon, "RssAnon"));
    CHECK(before > 0 && peak > before + 16 * 1024 &&
          peak < 64 * 1024); /* there was something to give back */
    CHECK(memory_kib(&daemon, "RssAnon") <= before + SPARE_KIB);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(capabilities_tell_the_limits_of_the_options)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FACETD, FLAGS("--queue", "77", "--max-connections=42"))) return;
    CHECK(daemon_get(&daemon, "/v1/capabilities", &answer));
    CHECK_INT(answer.status, 200);
    CHECK(strstr(answer.body, "{\"name\":\"json_body\",\"value\":67108864,"));
    CHECK(strstr(answer.body, "{\"name\":\"queue\",\"value\":77,"));
    CHECK(strstr(answer.body, "{\"name\":\"max_connections\",\"value\":42,"));
    CHECK(strstr(answer.body, "{\"name\":\"parameters\",\"value\":128,"));
    CHECK(strstr(answer.body, "{\"name\":\"target\",\"value\":8000,"));
    CHECK(!strstr(answer.body, "\"port\""));
    /* Rough dielectrics of analytic distributions alone. */
    CHECK(strstr(answer.body, "\"ndf\":\"tabulated\"") &&
          strstr(answer.body, "\"transmission\":true"));
    const char *tabulated = strstr(answer.body, "\"ndf\":\"tabulated\"");
    const char *its = tabulated ? strstr(tabulated, "\"transmission\":") : NULL;
    CHECK(its && strncmp(its, "\"transmission\":false", 20) == 0);
    /* Costs are measured once: the same answer, so the same ETag, ever after. */
    const char *tag = answer_header(&answer, "ETag");
    char *first = strdup(answer.body), *first_tag = strdup(tag ? tag : "");
    CHECK(daemon_get(&daemon, "/v1/capabilities", &answer));
    CHECK(first && strcmp(first, answer.body) == 0);
    CHECK(first_tag && *first_tag);
    CHECK_STR(answer_header(&answer, "ETag"), first_tag);
    free(first);
    free(first_tag);
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* 20 MB of JSON, and 16 MB of float64: computed while they are sent. */
TEST(a_large_answer_takes_little_memory)
{
    enum { LIMIT_KIB = 14 * 1024 };
    static const char body[] =
        "{\"material\":{\"alpha\":0.3},\"wo\":[[0,0,1]],\"dtype\":\"float64\","
        "\"wi\":{\"grid\":{\"theta\":1000,\"phi\":2000}}}";
    static const char *const accept[] = {"", "Accept: application/octet-stream\r\n"};
    struct daemon daemon;
    if (SANITIZED) {
        check_skip("a sanitizer's own memory is counted too");
        return;
    }
    if (!daemon_start(&daemon, FACETD, NULL)) return;
    for (int i = 0; i < 2; i++) {
        CHECK(daemon_ask(&daemon, "POST", "/v1/eval", accept[i], body, sizeof body - 1, &answer));
        CHECK_INT(answer.status, 200);
        CHECK(i ? answer.body_size == 16000000 : answer.body_size > 16000000);
    }
    long kib = memory_kib(&daemon, "VmHWM");
    CHECK(kib > 0 && kib <= LIMIT_KIB);
    check_note("largest_resident_kib", (double)kib);
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* Large enough that a few of them keep two workers busy while health is asked. */
#define MAP                                                                                        \
    "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3},\"tolerance\":1e-10,"                      \
    "\"wi\":{\"grid\":{\"theta\":500,\"phi\":1000}},\"wo\":[[0,0,1]]}"
#define FIT                                                                                        \
    "{\"source\":{\"ndf\":\"beckmann\",\"alpha\":0.15},\"model\":\"auto\",\"resolution\":360}"

static void health_during(const char *path, const char *body)
{
    enum { JOBS = 8, ASKED = 20 };
    struct daemon daemon;
    int jobs[JOBS], while_busy = 0;
    double worst = 0;
    char byte;
    if (!daemon_start(&daemon, FACETD, (const char *const[]){"--workers", "2", NULL})) return;
    for (int i = 0; i < JOBS; i++) jobs[i] = daemon_post(&daemon, path, body);
    for (int i = 0; i < ASKED; i++) {
        double start = now_ms();
        CHECK(daemon_get(&daemon, "/healthz", &answer));
        CHECK_INT(answer.status, 200);
        if (now_ms() - start > worst) worst = now_ms() - start;
        if (recv(jobs[JOBS - 1], &byte, 1, MSG_DONTWAIT | MSG_PEEK) < 0) while_busy++;
    }
    CHECK(while_busy > 0); /* it did not wait for the work to end */
    check_note("healthz_ms_worst", worst);
    check_note("asked_while_busy", while_busy);
    for (int i = 0; i < JOBS; i++) {
        CHECK(daemon_read(jobs[i], &answer));
        CHECK_INT(answer.status, 200);
        close(jobs[i]);
    }
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(health_is_answered_while_all_workers_evaluate)
{
    health_during("/v1/eval", MAP);
}

TEST(health_is_answered_while_all_workers_fit)
{
    health_during("/v1/fit", FIT);
}

TEST(sigterm_lets_an_evaluation_finish)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FACETD, NULL)) return;
    int fd = daemon_post(&daemon, "/v1/eval", MAP);
    sleep_ms(20);
    kill(daemon.pid, SIGTERM);
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 200);
    CHECK(answer.body_size > 500000);
    CHECK_INT(daemon_wait(&daemon), 0);
    close(fd);
}

TEST(a_client_that_leaves_ends_its_evaluation)
{
    enum { LEFT = 6 };
    struct daemon daemon;
    if (!daemon_start(&daemon, FACETD, (const char *const[]){"--workers", "1", NULL})) return;
    for (int i = 0; i < LEFT; i++) {
        int fd = daemon_post(&daemon, "/v1/eval", MAP);
        sleep_ms(10);
        close(fd);
    }
    double start = now_ms();
    int fd = daemon_post(&daemon, "/v1/eval",
                         "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},"
                         "\"wi\":[[0,0,1]],\"wo\":[[0,0,1]]}");
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 200);
    check_note("next_answer_ms", now_ms() - start);
    close(fd);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(refusals_of_the_server_are_problems_too)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FACETD, NULL)) return;
    CHECK(daemon_ask(&daemon, "POST", "/v1/eval",
                     "Transfer-Encoding: gzip\r\nX-Request-Id: framing\r\n", NULL, 0, &answer));
    CHECK_INT(answer.status, 400);
    CHECK_STR(answer_header(&answer, "Content-Type"), "application/problem+json");
    CHECK_STR(answer_header(&answer, "X-Request-Id"), "framing");
    CHECK(strstr(answer.body, "\"status\":400"));
    CHECK(daemon_ask(&daemon, "PUT", "/v1/eval", "", "{}", 2, &answer));
    CHECK_INT(answer.status, 405);
    CHECK_STR(answer_header(&answer, "Allow"), "POST, OPTIONS");
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* What a GET would not look at is no request for it: said, and the connection goes on or ends. */
TEST(a_get_takes_no_body)
{
    static const char *const paths[] = {"/readyz",  "/metrics",         "/v1/capabilities",
                                        "/healthz", "/v1/openapi.json", "/"};
    struct daemon daemon;
    if (!daemon_start(&daemon, FACETD, NULL)) return;
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        CHECK(daemon_ask(&daemon, "GET", paths[i], "Content-Type: application/json\r\n", "{}", 2,
                         &answer));
        CHECK_INT(answer.status, 413);
        CHECK(strstr(answer.body, "no body is taken here"));
    }
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(probes_and_the_page_take_any_query)
{
    static const char *const paths[] = {"/readyz", "/metrics", "/healthz", "/"};
    struct daemon daemon;
    char path[64];
    if (!daemon_start(&daemon, FACETD, NULL)) return;
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        snprintf(path, sizeof path, "%s?now=1", paths[i]);
        CHECK(daemon_get(&daemon, path, &answer));
        CHECK_INT(answer.status, 200);
    }
    CHECK(daemon_get(&daemon, "/v1/capabilities?now=1", &answer));
    CHECK_INT(answer.status, 422);
    CHECK_STR(answer_header(&answer, "Content-Type"), "application/problem+json");
    CHECK(strstr(answer.body, "/now is not a known member"));
    CHECK_INT(daemon_stop(&daemon), 0);
}
