/* What the server refuses, cuts or bounds; its API is the stand-in of fake_api.c. */
#include "check.h"
#include "daemon.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#define FAKE "facetd-fake"

static struct answer answer; /* large; each test fills it anew */

/* Sends the head of an upload and nothing of its body; the status of the answer. */
static int status_before_body(const struct daemon *daemon, const char *headers)
{
    char head[512];
    int fd = daemon_connect(daemon);
    snprintf(head, sizeof head, "POST /echo HTTP/1.1\r\nHost: x\r\n%s\r\n", headers);
    CHECK(daemon_send(fd, head));
    CHECK(daemon_read(fd, &answer));
    CHECK(daemon_ends(fd, 5000));
    close(fd);
    return answer.status;
}

/* A GET whose one header has so many bytes; the status of the answer. */
static int status_with_header(const struct daemon *daemon, size_t size)
{
    static char text[32768];
    int start = snprintf(text, sizeof text, "GET /v1/document HTTP/1.1\r\nHost: x\r\nX: ");
    memset(text + start, 'a', size);
    strcpy(text + start + size, "\r\n\r\n");
    CHECK(daemon_ask_over(daemon_connect(daemon), text, &answer));
    return answer.status;
}

TEST(a_head_of_14_kb_is_taken)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK_INT(status_with_header(&daemon, 13650), 200);
    CHECK_INT(status_with_header(&daemon, 14750), 431);
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* libmicrohttpd would close without a word where its memory has no room for the answer's head. */
TEST(every_head_that_is_too_large_is_told_so)
{
    static char text[32768];
    int told = 0;
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    for (size_t size = 13750; size < 14450; size += 4) {
        int status = status_with_header(&daemon, size);
        told += status == 431 && !strstr(answer.body, "<html>"); /* ours */
        if (status != 200 && status != 431)
            check_fail(__FILE__, __LINE__, "%zu bytes give %d", size, status);
    }
    check_note("told", told);
    CHECK(told > 20);
    for (int count = 192; count < 222; count++) { /* many small ones */
        char *end = stpcpy(text, "GET /v1/document HTTP/1.1\r\nHost: x\r\n");
        for (int i = 0; i < count; i++) end = stpcpy(end, "a:b\r\n");
        strcpy(end, "\r\n");
        CHECK(daemon_ask_over(daemon_connect(&daemon), text, &answer));
        if (answer.status != 200 && answer.status != 431)
            check_fail(__FILE__, __LINE__, "%d headers give %d", count, answer.status);
    }
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* The status of a GET with so many parameters. */
static int status_with_parameters(const struct daemon *daemon, int count)
{
    static char text[32768];
    char *end = stpcpy(text, "GET /v1/document?a");
    for (int i = 1; i < count; i++) end = stpcpy(end, "&a");
    strcpy(end, " HTTP/1.1\r\nHost: x\r\n\r\n");
    daemon_ask_over(daemon_connect(daemon), text, &answer);
    return answer.status;
}

TEST(a_query_of_many_parameters_is_414_and_over)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK_INT(status_with_parameters(&daemon, 128), 200);
    CHECK_INT(status_with_parameters(&daemon, 129), 414);
    CHECK(!strstr(answer.body, "<html>"));
    CHECK_INT(status_with_parameters(&daemon, 400), 414);
    CHECK_INT(status_with_parameters(&daemon, 1000), 414);
    CHECK_INT(status_with_parameters(&daemon, 3000), 414);
    CHECK(daemon_get(&daemon, "/metrics", &answer));
    CHECK(strstr(answer.body, "\nfacetd_requests_active 1\n")); /* this one */
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(idle_connections_end_and_are_counted)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--timeout", "1"))) return;
    int fd = daemon_connect(&daemon);
    CHECK(daemon_send(fd, "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n"));
    CHECK(daemon_read(fd, &answer));
    CHECK(daemon_ends(fd, 3000));
    close(fd);
    CHECK(daemon_get(&daemon, "/metrics", &answer));
    CHECK(strstr(answer.body, "\nfacetd_idle_connections_total 1\n"));
    CHECK(strstr(answer.body, "\nfacetd_cut_connections_total 0\n"));
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_body_too_large_is_413_before_it_comes)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK_INT(status_before_body(&daemon, "Content-Length: 1048577\r\n"), 413);
    CHECK_INT(status_before_body(&daemon, "Content-Length: 99999999999\r\n"), 413);
    CHECK_INT(status_before_body(&daemon, "Content-Length: 1048577\r\nExpect: 100-continue\r\n"),
              413);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_body_at_the_limit_is_taken_and_one_beyond_is_not)
{
    enum { LIMIT = 1 << 20 };
    struct daemon daemon;
    char *body = malloc(LIMIT + 1);
    if (!body || !daemon_start(&daemon, FAKE, NULL)) return free(body);
    memset(body, 'b', LIMIT + 1);
    CHECK(daemon_ask(&daemon, "POST", "/echo", "", body, LIMIT, &answer));
    CHECK_INT(answer.status, 200);
    CHECK_INT(answer.body_size, LIMIT);
    CHECK(daemon_ask(&daemon, "POST", "/echo", "", body, LIMIT + 1, &answer));
    CHECK_INT(answer.status, 413);
    CHECK(strstr(answer.body, "larger than the 1048576 bytes that") != NULL);
    CHECK_INT(daemon_stop(&daemon), 0);
    free(body);
}

/* Those that begin with a large body get more memory to read it into, as far as it goes. */
TEST(more_uploads_than_have_large_buffers_are_all_served)
{
    enum { UPLOADS = 340, BODY = 70000, HALF = 30000 };
    static char body[BODY + 1];
    int fds[UPLOADS];
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    memset(body, 'x', BODY);
    for (int i = 0; i < UPLOADS; i++) {
        fds[i] = daemon_connect(&daemon);
        CHECK(fds[i] >= 0 &&
              daemon_send(fds[i],
                          "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 70000\r\n\r\n") &&
              daemon_send(fds[i], body + BODY - HALF));
    }
    for (int i = 0; i < UPLOADS; i++) {
        CHECK(daemon_send(fds[i], body + HALF) && daemon_read(fds[i], &answer));
        CHECK_INT(answer.status, 200);
        CHECK_INT(answer.body_size, BODY);
        CHECK(daemon_send(fds[i], "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n"));
        CHECK(daemon_read(fds[i], &answer));
        CHECK_INT(answer.status, 200);
        close(fds[i]);
    }
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_chunked_body_is_counted_as_it_comes)
{
    struct daemon daemon;
    char chunk[65536 + 16];
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    int fd = daemon_connect(&daemon);
    static const char head[] =
        "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n";
    CHECK(daemon_send(fd, head));
    CHECK(daemon_send(fd, "3\r\nabc\r\n2\r\nde\r\n0\r\n\r\n"));
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 200);
    CHECK_STR(answer.body, "abcde");

    CHECK(daemon_send(fd, head)); /* the same connection, and now without an end */
    memset(chunk, 'c', sizeof chunk);
    memcpy(chunk, "10000\r\n", 7);
    memcpy(chunk + 7 + 65536, "\r\n", 3);
    int sent = 0;
    while (sent < 64 && daemon_send(fd, chunk)) sent++;
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 413);
    close(fd);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(bodies_share_a_memory_budget)
{
    enum { SIZE = 2 << 20 };
    struct daemon daemon;
    char *body = calloc(1, SIZE);
    if (!body || !daemon_start(&daemon, FAKE, FLAGS("--body-memory", "1"))) return free(body);
    CHECK(daemon_ask(&daemon, "POST", "/spin?ms=0", "", body, SIZE, &answer));
    CHECK_INT(answer.status, 503);
    CHECK(answer_header(&answer, "Retry-After"));
    for (int i = 0; i < 4; i++) { /* what was held is given back */
        CHECK(daemon_ask(&daemon, "POST", "/spin?ms=0", "", body, SIZE / 4, &answer));
        CHECK_INT(answer.status, 200);
    }
    CHECK_INT(daemon_stop(&daemon), 0);
    free(body);
}

/* Drips `text` over `fd` until the server has enough; how long it took in ms, or -1 after `limit`. */
static double drip(int fd, const char *text, long pause_ms, double limit_ms)
{
    double start = now_ms();
    while (now_ms() - start < limit_ms) {
        char byte;
        ssize_t n = recv(fd, &byte, 1, MSG_DONTWAIT);
        if (n >= 0 || !daemon_send(fd, text)) return now_ms() - start;
        sleep_ms(pause_ms);
    }
    return -1;
}

TEST(a_client_that_drips_its_headers_is_cut)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--header-timeout", "1"))) return;
    int fd = daemon_connect(&daemon);
    CHECK(daemon_send(fd, "GET /healthz HTTP/1.1\r\nX: "));
    double cut = drip(fd, "a", 50, 8000);
    CHECK(cut > 500);
    check_note("cut_ms", cut);
    CHECK(daemon_ends(fd, 1000));
    close(fd);
    fd = daemon_connect(&daemon); /* and one that says nothing at all */
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 408);
    close(fd);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_slow_upload_is_cut_and_an_honest_one_is_not)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--header-timeout", "1", "--min-rate", "100"))) return;
    int slow = daemon_connect(&daemon), honest = daemon_connect(&daemon);
    static const char head[] = "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 600\r\n\r\n";
    static const char ten[] = "0123456789";
    CHECK(daemon_send(slow, head) && daemon_send(honest, head));
    double start = now_ms();
    sleep_ms(600);                               /* a late start is made up for later */
    for (int sent = 0; sent < 600; sent += 10) { /* 10 bytes each 50 ms: 200 a second */
        CHECK(daemon_send(honest, ten));
        if (sent % 100 == 0) daemon_send(slow, "s");
        sleep_ms(50);
    }
    check_note("honest_upload_ms", now_ms() - start);
    CHECK(daemon_read(honest, &answer));
    CHECK_INT(answer.status, 200);
    CHECK(daemon_read(slow, &answer));
    CHECK_INT(answer.status, 408);
    close(slow);
    close(honest);
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* Its last bytes and its end may come at once, and libmicrohttpd reads the bytes alone. */
TEST(a_client_that_leaves_amid_its_request_is_forgotten)
{
    enum { EACH = 50 };
    static const char whole[] = "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n";
    static const char *const begun[] = {
        "GE", "GET /healthz HTTP/1.1\r\nHo",
        "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 600\r\n\r\nabc"};
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    for (size_t i = 0; i < EACH * sizeof begun / sizeof *begun; i++) {
        int fd = daemon_connect(&daemon);
        if (i % 2) CHECK(daemon_send(fd, whole) && daemon_read(fd, &answer)); /* kept alive */
        CHECK(daemon_send(fd, begun[i / EACH]));
        close(fd);
    }
    double start = now_ms();
    do {
        sleep_ms(50);
        CHECK(daemon_get(&daemon, "/metrics", &answer));
    } while (!strstr(answer.body, "\nfacetd_connections 1\n") && now_ms() - start < 5000);
    check_note("forgotten_ms", now_ms() - start); /* the header timeout is 10 s */
    CHECK(now_ms() - start < 5000);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_client_that_takes_no_answer_is_cut)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE,
                      FLAGS("--header-timeout", "1", "--min-rate", "100000000", "--drain", "20")))
        return;
    int fd = daemon_post(&daemon, "/big?bytes=60000000", "x");
    sleep_ms(200);
    double start = now_ms();
    CHECK_INT(daemon_stop(&daemon), 0); /* would take 20 s, and exit 1, with the client there */
    CHECK(now_ms() - start < 8000);
    close(fd);
}

TEST(a_large_answer_comes_whole)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK(daemon_ask(&daemon, "POST", "/big?bytes=20000000", "", "x", 1, &answer));
    CHECK_INT(answer.status, 200);
    CHECK_INT(answer.body_size, 20000000);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(clients_beyond_the_limit_get_503)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--max-connections", "2"))) return;
    int first = daemon_connect(&daemon), second = daemon_connect(&daemon);
    CHECK(daemon_send(first, "G") && daemon_send(second, "G"));
    sleep_ms(100);
    int third = daemon_connect(&daemon);
    CHECK(daemon_send(third, "G"));
    CHECK(daemon_read(third, &answer));
    CHECK_INT(answer.status, 503);
    CHECK(answer_header(&answer, "Retry-After"));
    close(first);
    sleep_ms(100);
    CHECK(daemon_get(&daemon, "/healthz", &answer));
    CHECK_INT(answer.status, 200);
    close(second);
    close(third);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(few_descriptors_mean_few_connections)
{
    enum { ALLOWED = 128 };
    struct rlimit before, few;
    struct daemon daemon;
    int fds[ALLOWED], open_count = 0;
    CHECK_INT(getrlimit(RLIMIT_NOFILE, &before), 0);
    few = before;
    few.rlim_cur = ALLOWED;
    const pid_t child = fork(); /* a hard limit cannot be raised again: lower it in a child */
    if (child == 0) {
        few.rlim_max = ALLOWED;
        setrlimit(RLIMIT_NOFILE, &few);
        bool well = daemon_start(&daemon, FAKE, NULL);
        while (well && open_count < 40) {
            fds[open_count] = daemon_connect(&daemon);
            if (fds[open_count] < 0 || !daemon_send(fds[open_count], "G")) break;
            open_count++; /* those that send nothing are taken in later, in any order */
        }
        sleep_ms(50);
        /* The last ones are beyond the limit: refused, and not left hanging. */
        bool refused = open_count > 0 && daemon_read(fds[open_count - 1], &answer);
        _exit(well && refused && answer.status == 503 && daemon_stop(&daemon) == 0 ? 0 : 1);
    }
    int status;
    CHECK_INT(waitpid(child, &status, 0), child);
    CHECK_INT(status, 0);
}
