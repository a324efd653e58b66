/* The server alone: its API is the stand-in of fake_api.c. */
#include "check.h"
#include "daemon.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define FAKE "facetd-fake"

static struct answer answer; /* large; each test fills it anew */

TEST(port_0_prints_where_it_listens)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK(daemon.port > 0);
    CHECK(daemon_get(&daemon, "/healthz", &answer));
    CHECK_INT(answer.status, 200);
    CHECK_STR(answer.body, "well");
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_taken_port_is_an_error)
{
    struct daemon daemon;
    char out[4096], port[16];
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    snprintf(port, sizeof port, "%d", daemon.port);
    CHECK_INT(daemon_run(FAKE, FLAGS("--port", port), out, sizeof out), 1);
    CHECK_STR(out, "");
    daemon_stop(&daemon);
}

TEST(options_are_checked)
{
    char out[8192];
    CHECK_INT(daemon_run(FAKE, FLAGS("--port", "65536"), out, sizeof out), 2);
    CHECK_INT(daemon_run(FAKE, FLAGS("--port", "80x"), out, sizeof out), 2);
    CHECK_INT(daemon_run(FAKE, FLAGS("--port"), out, sizeof out), 2);
    CHECK_INT(daemon_run(FAKE, FLAGS("--prot", "1"), out, sizeof out), 2);
    CHECK_INT(daemon_run(FAKE, FLAGS("--log", "loud"), out, sizeof out), 2);
    CHECK_INT(daemon_run(FAKE, FLAGS("--bind", "example.org"), out, sizeof out), 1);
    CHECK_INT(daemon_run(FAKE, FLAGS("--help"), out, sizeof out), 0);
    CHECK(strstr(out, "--max-connections"));
    CHECK_INT(daemon_run(FAKE, FLAGS("--version"), out, sizeof out), 0);
    CHECK(!strncmp(out, "facetd ", 7));
    setenv("FACETD_PORT", "nonsense", 1);
    CHECK_INT(daemon_run(FAKE, FLAGS("--log=none"), out, sizeof out), 2);
    unsetenv("FACETD_PORT");
}

TEST(healthcheck_tells_a_daemon_from_none)
{
    struct daemon daemon;
    char out[64], port[16];
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    snprintf(port, sizeof port, "%d", daemon.port);
    CHECK_INT(daemon_run(FAKE, FLAGS("--healthcheck", "--port", port), out, sizeof out), 0);
    setenv("FACETD_PORT", port, 1);
    CHECK_INT(daemon_run(FAKE, FLAGS("--healthcheck", "--bind=0.0.0.0"), out, sizeof out), 0);
    unsetenv("FACETD_PORT");
    CHECK_INT(daemon_stop(&daemon), 0);
    CHECK_INT(daemon_run(FAKE, FLAGS("--healthcheck", "--port", port), out, sizeof out), 1);
}

TEST(sigterm_finishes_what_runs)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    int idle = daemon_connect(&daemon);
    int fd = daemon_post(&daemon, "/spin?ms=500", "x");
    CHECK(daemon_send(idle, "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n"));
    CHECK(daemon_read(idle, &answer));
    sleep_ms(100);
    kill(daemon.pid, SIGTERM);
    sleep_ms(100);
    CHECK_INT(daemon_connect(&daemon), -1);
    char byte;
    CHECK_INT(recv(idle, &byte, 1, MSG_DONTWAIT), 0); /* ended already */
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 200);
    CHECK_STR(answer.body, "done");
    CHECK_STR(answer_header(&answer, "Connection"), "close");
    CHECK_INT(daemon_wait(&daemon), 0);
    close(fd);
    close(idle);
}

TEST(sigint_does_not_wait_for_idle_connections)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    int fd = daemon_connect(&daemon);
    CHECK(daemon_send(fd, "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n"));
    CHECK(daemon_read(fd, &answer));
    kill(daemon.pid, SIGINT);
    CHECK_INT(daemon_wait(&daemon), 0);
    CHECK(daemon_ends(fd, 1000));
    close(fd);
}

TEST(a_second_signal_ends_at_once)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    int fd = daemon_post(&daemon, "/stubborn?ms=5000", "x");
    sleep_ms(100);
    kill(daemon.pid, SIGTERM);
    sleep_ms(100);
    kill(daemon.pid, SIGTERM);
    double start = now_ms();
    CHECK_INT(daemon_wait(&daemon), 128 + SIGTERM);
    CHECK(now_ms() - start < 2000);
    close(fd);
}

TEST(the_drain_time_is_bounded)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--drain", "0", "--workers", "1"))) return;
    int running = daemon_post(&daemon, "/spin?ms=20000", "x"),
        queued = daemon_post(&daemon, "/spin?ms=20000", "x");
    sleep_ms(200);
    double start = now_ms();
    CHECK_INT(daemon_stop(&daemon), 0); /* as it was told */
    CHECK(now_ms() - start < 5000);
    close(running);
    close(queued);
}

TEST(a_client_that_reads_past_the_drain_is_cut)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--drain", "0"))) return;
    int fd = daemon_post(&daemon, "/big?bytes=60000000", "x");
    sleep_ms(100);
    double start = now_ms();
    CHECK_INT(daemon_stop(&daemon), 0);
    CHECK(now_ms() - start < 3000);
    close(fd);
}

TEST(health_is_answered_while_all_workers_are_busy)
{
    enum { JOBS = 6 };
    struct daemon daemon;
    int jobs[JOBS];
    if (!daemon_start(&daemon, FAKE, FLAGS("--workers", "2"))) return;
    for (int i = 0; i < JOBS; i++) jobs[i] = daemon_post(&daemon, "/spin?ms=400", "x");
    sleep_ms(50);
    double worst = 0;
    for (int i = 0; i < 100; i++) {
        double start = now_ms();
        CHECK(daemon_get(&daemon, "/healthz", &answer));
        CHECK_INT(answer.status, 200);
        if (now_ms() - start > worst) worst = now_ms() - start;
    }
    check_note("healthz_ms_worst_of_100", worst);
    char byte;
    CHECK(recv(jobs[JOBS - 1], &byte, 1, MSG_DONTWAIT) <
          0); /* the last had not been answered yet */
    for (int i = 0; i < JOBS; i++) {
        CHECK(daemon_read(jobs[i], &answer));
        CHECK_INT(answer.status, 200);
        close(jobs[i]);
    }
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_full_queue_is_503_with_retry_after)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--workers", "1", "--queue", "1"))) return;
    int running = daemon_post(&daemon, "/spin?ms=400", "x"),
        queued = daemon_post(&daemon, "/spin?ms=1", "x");
    sleep_ms(100);
    CHECK(daemon_ask(&daemon, "POST", "/spin?ms=1", "", "x", 1, &answer));
    CHECK_INT(answer.status, 503);
    CHECK(answer_header(&answer, "Retry-After"));
    CHECK(daemon_read(running, &answer));
    CHECK_INT(answer.status, 200);
    CHECK(daemon_read(queued, &answer));
    CHECK_INT(answer.status, 200);
    close(running);
    close(queued);
    CHECK_INT(daemon_stop(&daemon), 0);
}

static int cancelled(const struct daemon *daemon)
{
    return daemon_get(daemon, "/cancelled", &answer) ? atoi(answer.body) : -1;
}

TEST(a_client_that_leaves_cancels_its_work)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--workers", "1", "--queue", "1"))) return;
    int running = daemon_post(&daemon, "/spin?ms=20000", "x"),
        queued = daemon_post(&daemon, "/spin?ms=20000", "x");
    sleep_ms(100);
    close(queued); /* frees its place in the queue */
    sleep_ms(50);
    int next = daemon_post(&daemon, "/spin?ms=1", "x");
    CHECK_INT(cancelled(&daemon), 0); /* the queued one never began */
    close(running);
    double start = now_ms();
    while (cancelled(&daemon) == 0 && now_ms() - start < 5000) sleep_ms(1);
    check_note("cancel_ms", now_ms() - start);
    CHECK_INT(cancelled(&daemon), 1);
    CHECK(daemon_read(next, &answer));
    CHECK_INT(answer.status, 200);
    close(next);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(work_past_the_deadline_is_503)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--deadline", "1"))) return;
    CHECK(daemon_ask(&daemon, "POST", "/spin?ms=20000", "", "x", 1, &answer));
    CHECK_INT(answer.status, 503);
    CHECK_INT(cancelled(&daemon), 1);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_refused_request_keeps_its_connection)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    int fd = daemon_post(&daemon, "/nothing-here", "some body");
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 404);
    CHECK(daemon_send(fd,
                      "GET http://x/healthz?a=b HTTP/1.1\r\nHost: x\r\n\r\n"
                      "HEAD /healthz HTTP/1.1\r\nHost: x\r\n\r\n")); /* absolute form; pipelined */
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 200);
    char head[512] = "";
    CHECK(recv(fd, head, sizeof head - 1, 0) > 0);
    CHECK(!strncmp(head, "HTTP/1.1 200", 12));
    CHECK(strstr(head, "Content-Length: 4") && strstr(head, "\r\n\r\n") && !strstr(head, "well"));
    close(fd);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(request_ids_are_echoed_or_made)
{
    struct daemon daemon;
    char first[128];
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK(daemon_ask(&daemon, "GET", "/healthz", "X-Request-Id: job-7.a_B\r\n", NULL, 0, &answer));
    CHECK_STR(answer_header(&answer, "X-Request-Id"), "job-7.a_B");
    CHECK(daemon_ask(&daemon, "GET", "/healthz", "X-Request-Id: a b\"\r\n", NULL, 0, &answer));
    snprintf(first, sizeof first, "%s", answer_header(&answer, "X-Request-Id"));
    CHECK_INT(strlen(first), 16);
    CHECK(daemon_get(&daemon, "/healthz", &answer));
    CHECK(strcmp(answer_header(&answer, "X-Request-Id"), first));
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* What two servers could cut into requests differently must not be answered as if it were clear. */
TEST(ambiguous_framing_is_refused)
{
    static const char *const bad[] = {
        "Host: x\r\nContent-Length: 4\r\nContent-Length: 5\r\n",
        "Host: x\r\nContent-Length: 4\r\nTransfer-Encoding: chunked\r\n",
        "Host: x\r\nTransfer-Encoding: gzip\r\n",
        "Host: x\r\nTransfer-Encoding : chunked\r\n",
        "Host: x\r\nHost: y\r\n",
    };
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        char head[512];
        int fd = daemon_connect(&daemon);
        snprintf(head, sizeof head, "POST /echo HTTP/1.1\r\n%s\r\nabcd", bad[i]);
        CHECK(daemon_send(fd, head));
        daemon_read(fd, &answer);
        if (answer.status && answer.status != 400)
            check_fail(__FILE__, __LINE__, "%s gives %d", bad[i], answer.status);
        CHECK(daemon_ends(fd, 2000));
        close(fd);
    }
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_long_request_line_is_414)
{
    struct daemon daemon;
    char path[9000];
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    memset(path, 'p', sizeof path);
    path[0] = '/';
    path[8500] = 0;
    int fd = daemon_connect(&daemon);
    CHECK(daemon_send(fd, "GET ") && daemon_send(fd, path) &&
          daemon_send(fd, " HTTP/1.1\r\nHost: x\r\n\r\n"));
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 414);
    CHECK(strstr(answer.body, "bytes, at most 8000 are taken"));
    close(fd);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(cors_only_by_option)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK(daemon_ask(&daemon, "GET", "/healthz", "Origin: http://a\r\n", NULL, 0, &answer));
    CHECK(!answer_header(&answer, "Access-Control-Allow-Origin"));
    CHECK_INT(daemon_stop(&daemon), 0);

    if (!daemon_start(&daemon, FAKE, FLAGS("--cors=http://a"))) return;
    CHECK(daemon_ask(&daemon, "GET", "/healthz", "Origin: http://a\r\n", NULL, 0, &answer));
    CHECK_STR(answer_header(&answer, "Access-Control-Allow-Origin"), "http://a");
    CHECK_STR(answer_header(&answer, "Vary"), "Origin");
    static const char *const others[] = {"Origin: http://b\r\n", ""};
    for (int i = 0; i < 2; i++) {
        CHECK(daemon_ask(&daemon, "GET", "/healthz", others[i], NULL, 0, &answer));
        CHECK(!answer_header(&answer, "Access-Control-Allow-Origin"));
        CHECK_STR(answer_header(&answer, "Vary"), "Origin"); /* no cache gives this to http://a */
    }
    CHECK(daemon_ask(&daemon, "OPTIONS", "/echo", "Origin: http://a\r\n", NULL, 0, &answer));
    CHECK_INT(answer.status, 204);
    CHECK(answer_header(&answer, "Access-Control-Allow-Methods"));
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* libmicrohttpd's own loop stalls for seconds when a multiple of 128 sockets is ready at once. */
TEST(connections_in_multiples_of_128_do_not_stall)
{
    enum { MOST = 512, ROUNDS = 20 };
    static int fds[MOST];
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--log", "none"))) return;
    for (int count = 128; count <= MOST; count *= 2) {
        for (int i = 0; i < count; i++) CHECK((fds[i] = daemon_connect(&daemon)) >= 0);
        double worst = 0;
        for (int round = 0; round < ROUNDS; round++) {
            double start = now_ms();
            kill(daemon.pid, SIGSTOP); /* so that all are ready when it looks */
            for (int i = 0; i < count; i++)
                CHECK(daemon_send(fds[i], "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n"));
            kill(daemon.pid, SIGCONT);
            for (int i = 0; i < count; i++) CHECK(daemon_read(fds[i], &answer));
            if (now_ms() - start > worst) worst = now_ms() - start;
        }
        check_note("round_ms_worst", worst);
        CHECK(worst < 5000); /* a stall lasts until a connection times out: 30 s */
        for (int i = 0; i < count; i++) close(fds[i]);
    }
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_request_leaves_one_line_in_the_log)
{
    struct daemon daemon;
    size_t size;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK(daemon_ask(&daemon, "POST", "/spin?ms=20", "X-Request-Id: abc\r\n", "xyz", 3, &answer));
    sleep_ms(50);
    char *log = check_read_file(daemon.log, &size);
    static const char *const parts[] = {
        "id=abc",    "method=\"POST\"", "path=\"/spin\"", "status=200",     "in=3",
        "out=4",     "us_queue=",       "us_decode=1.0",  "us_compute=2.0", "us_encode=3.0",
        "tier=fake", "evaluations=4",   "end=ok"};
    for (size_t i = 0; log && i < sizeof parts / sizeof *parts; i++)
        if (!strstr(log, parts[i])) check_fail(__FILE__, __LINE__, "no %s in %s", parts[i], log);
    CHECK(log != NULL);
    free(log);
    CHECK_INT(daemon_stop(&daemon), 0);
}
