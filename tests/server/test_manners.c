/* Tokens, tags, traces, shares: what a good guest of the network does. */
#include "check.h"
#include "daemon.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define FAKE "facetd-fake"

static struct answer answer; /* large; each test fills it anew */

static int status_of(const struct daemon *daemon, const char *path, const char *headers)
{
    return daemon_ask(daemon, "GET", path, headers, NULL, 0, &answer) ? answer.status : 0;
}

static void check_token(const struct daemon *daemon)
{
    CHECK_INT(status_of(daemon, "/v1/document", ""), 401);
    CHECK_STR(answer_header(&answer, "WWW-Authenticate"), "Bearer realm=\"facetd\"");
    CHECK_INT(status_of(daemon, "/v1/document", "Authorization: Bearer s3cret\r\n"), 200);
    CHECK_INT(status_of(daemon, "/v1/document", "Authorization: bearer s3cret\r\n"), 200);
    static const char *const wrong[] = {"Bearer s3cre",  "Bearer s3crett", "Bearer ",
                                        "Bearer S3cret", "Basic s3cret",   "s3cret"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        char header[64];
        snprintf(header, sizeof header, "Authorization: %s\r\n", wrong[i]);
        if (status_of(daemon, "/v1/document", header) != 401)
            check_fail(__FILE__, __LINE__, "%s gives %d", wrong[i], answer.status);
    }
    CHECK_INT(status_of(daemon, "/not/here", ""), 401); /* who has no token learns no paths */
    CHECK_INT(status_of(daemon, "/metrics", ""), 401);
    CHECK_INT(status_of(daemon, "/healthz", ""), 200);
    CHECK_INT(status_of(daemon, "/readyz", ""), 200);
}

TEST(a_token_is_asked_for)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--token", "s3cret"))) return;
    check_token(&daemon);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_token_comes_from_a_file)
{
    struct daemon daemon;
    char path[64], option[80], out[64];
    snprintf(path, sizeof path, "/tmp/facetd-test-%ld.token", (long)getpid());
    snprintf(option, sizeof option, "@%s", path);
    FILE *f = fopen(path, "w");
    CHECK(f && fputs("s3cret\n", f) >= 0 && !fclose(f));
    if (daemon_start(&daemon, FAKE, FLAGS("--token", option))) {
        check_token(&daemon);
        CHECK_INT(daemon_stop(&daemon), 0);
    }
    unlink(path);
    CHECK_INT(daemon_run(FAKE, FLAGS("--port=0", "--token", option), out, sizeof out), 1);
    CHECK_INT(daemon_run(FAKE, FLAGS("--port=0", "--token", "two words"), out, sizeof out), 1);
}

TEST(an_upload_without_the_token_is_not_read)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--token", "s3cret"))) return;
    int fd = daemon_connect(&daemon);
    CHECK(
        daemon_send(fd, "POST /spin?ms=1 HTTP/1.1\r\nHost: x\r\nContent-Length: 9000000\r\n\r\n"));
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 401);
    CHECK(daemon_ends(fd, 5000));
    close(fd);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(documents_have_tags_and_are_not_sent_twice)
{
    struct daemon daemon;
    char tag[64], header[256];
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK_INT(status_of(&daemon, "/v1/document", ""), 200);
    const char *given = answer_header(&answer, "ETag");
    CHECK(given && strlen(given) == 18);
    snprintf(tag, sizeof tag, "%s", given ? given : "");
    static const char *const same[] = {"%s", "W/%s", "\"x\", %s", "\"x\",W/\"y\" ,%s", "*"};
    for (size_t i = 0; i < sizeof same / sizeof *same; i++) {
        char list[128];
        snprintf(list, sizeof list, same[i], tag);
        snprintf(header, sizeof header, "If-None-Match: %s\r\n", list);
        if (status_of(&daemon, "/v1/document", header) != 304)
            check_fail(__FILE__, __LINE__, "%s gives %d", list, answer.status);
        CHECK_STR(answer_header(&answer, "ETag"), tag);
        CHECK(!answer_header(&answer, "Content-Encoding") &&
              !answer_header(&answer, "Content-Type"));
        CHECK_STR(answer_header(&answer, "Vary"), "Accept-Encoding");
        CHECK_INT(answer.body_size, 0);
    }
    CHECK_INT(status_of(&daemon, "/v1/document", "If-None-Match: \"x\"\r\n"), 200);
    CHECK_INT(status_of(&daemon, "/v1/document", "If-None-Match: x\r\n"), 200);
    CHECK_INT(status_of(&daemon, "/healthz", ""), 200);
    CHECK(!answer_header(&answer, "ETag"));
    CHECK(daemon_ask(&daemon, "POST", "/echo", "If-None-Match: *\r\n", "x", 1, &answer));
    CHECK_INT(answer.status, 200);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_304_leaves_the_connection_in_order)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    int fd = daemon_connect(&daemon);
    CHECK(daemon_send(fd, "GET /v1/document HTTP/1.1\r\nHost: x\r\nIf-None-Match: *\r\n\r\n"
                          "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n"));
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 304);
    CHECK(daemon_read(fd, &answer));
    CHECK_STR(answer.body, "well");
    close(fd);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(traceparent_is_echoed_if_it_is_one)
{
    static const char good[] = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
    static const char *const bad[] = {"00-00000000000000000000000000000000-00f067aa0ba902b7-01",
                                      "00-4bf92f3577b34da6a3ce929d0e0e4736-0000000000000000-01",
                                      "00-4BF92F3577B34DA6A3CE929D0E0E4736-00f067aa0ba902b7-01",
                                      "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-0",
                                      "ff-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
                                      "x"};
    struct daemon daemon;
    char header[128];
    size_t size;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    snprintf(header, sizeof header, "traceparent: %s\r\n", good);
    CHECK_INT(status_of(&daemon, "/healthz", header), 200);
    CHECK_STR(answer_header(&answer, "traceparent"), good);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        snprintf(header, sizeof header, "traceparent: %s\r\n", bad[i]);
        CHECK_INT(status_of(&daemon, "/healthz", header), 200);
        if (answer_header(&answer, "traceparent")) check_fail(__FILE__, __LINE__, "%s", bad[i]);
    }
    char *log = check_read_file(daemon.log, &size);
    CHECK(log && strstr(log, " trace=00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01 "));
    free(log);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(one_address_does_not_take_the_whole_queue)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--workers", "1", "--per-client", "2"))) return;
    int first = daemon_post(&daemon, "/spin?ms=400", "x"),
        second = daemon_post(&daemon, "/spin?ms=1", "x");
    sleep_ms(100);
    CHECK(daemon_ask(&daemon, "POST", "/spin?ms=1", "", "x", 1, &answer));
    CHECK_INT(answer.status, 429);
    CHECK(answer_header(&answer, "Retry-After"));
    CHECK(daemon_read(first, &answer) && daemon_read(second, &answer));
    CHECK(daemon_ask(&daemon, "POST", "/spin?ms=1", "", "x", 1, &answer));
    CHECK_INT(answer.status, 200);
    close(first);
    close(second);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(sighup_changes_nothing)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    int fd = daemon_post(&daemon, "/spin?ms=200", "x");
    sleep_ms(50);
    kill(daemon.pid, SIGHUP);
    CHECK(daemon_read(fd, &answer));
    CHECK_INT(answer.status, 200);
    CHECK_INT(status_of(&daemon, "/healthz", ""), 200);
    close(fd);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(options_names_the_methods)
{
    static const struct {
        const char *path, *allow; /* NULL: nothing is served there */
    } rows[] = {{"/healthz", "GET, HEAD, OPTIONS"}, {"/metrics", "GET, HEAD, OPTIONS"},
                {"/", "GET, HEAD, OPTIONS"},        {"/echo", "POST, OPTIONS"},
                {"*", "GET, HEAD, POST, OPTIONS"},  {"/nothing", NULL}};
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--admin", "127.0.0.1:0"))) return;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        CHECK(daemon_ask(&daemon, "OPTIONS", rows[i].path, "", NULL, 0, &answer));
        CHECK_INT(answer.status, rows[i].allow ? 204 : 404);
        const char *allow = answer_header(&answer, "Allow");
        if (rows[i].allow)
            CHECK_STR(allow, rows[i].allow);
        else
            CHECK(!allow);
    }
    CHECK(daemon_ask_over(daemon_connect_port(daemon.admin_port),
                          "OPTIONS /echo HTTP/1.1\r\nHost: x\r\n\r\n", &answer));
    CHECK_INT(answer.status, 404);
    CHECK_INT(daemon_stop(&daemon), 0);
}
