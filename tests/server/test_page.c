/* The page at GET /: its headers, its tags, gzip, who may see it, and how to be without. */
#include "check.h"
#include "daemon.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define FAKE "facetd-fake"
#define FACETD "../../facetd" /* whose API knows Accept-Encoding */

static struct answer answer; /* large; each test fills it anew */

static int status_of(const struct daemon *daemon, const char *method, const char *path,
                     const char *headers)
{
    return daemon_ask(daemon, method, path, headers, NULL, 0, &answer) ? answer.status : 0;
}

/* The value of a header of the last answer; "" if absent. */
static const char *header(const char *name)
{
    const char *value = answer_header(&answer, name);
    return value ? value : "";
}

TEST(the_page_is_html_that_runs_nothing_from_elsewhere)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK_INT(status_of(&daemon, "GET", "/", ""), 200);
    CHECK_STR(header("Content-Type"), "text/html; charset=utf-8");
    CHECK_STR(header("X-Content-Type-Options"), "nosniff");
    CHECK_STR(header("Vary"), "Accept-Encoding");
    CHECK(!answer_header(&answer, "Content-Encoding"));
    CHECK(strstr(answer.body, "<!doctype html>") == answer.body);
    const char *policy = header("Content-Security-Policy");
    CHECK(strstr(policy, "default-src 'none'") && strstr(policy, "script-src 'self'"));
    CHECK(!strstr(policy, "unsafe") && !strstr(policy, "http"));
    CHECK(!strstr(answer.body, "://")); /* names no host */
    CHECK_INT(status_of(&daemon, "GET", "/page/main.js", ""), 200);
    CHECK_STR(header("Content-Type"), "text/javascript; charset=utf-8");
    CHECK_INT(status_of(&daemon, "GET", "/page/page.css", ""), 200);
    CHECK_STR(header("Content-Type"), "text/css; charset=utf-8");
    CHECK_INT(status_of(&daemon, "GET", "/page/embed.sh", ""), 404);
    CHECK_INT(status_of(&daemon, "GET", "/page/", ""), 404);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(the_page_comes_gzipped_to_who_takes_it)
{
    static const struct {
        const char *accepted;
        bool packed;
    } cases[] = {
        {"gzip", true},      {"deflate, gzip;q=0.5", true}, {"GZIP", true},       {"br, *", true},
        {"gzip;q=0", false}, {"gzip ; q=0.0, *", false},    {"br", false},        {"", false},
        {"*;q=0", false},    {"xgzip, gzipx", false},       {"*;q=0, gzip", true}};
    struct daemon daemon;
    if (!daemon_start(&daemon, FACETD, NULL)) return;
    CHECK_INT(status_of(&daemon, "GET", "/page/main.js", ""), 200);
    const size_t plain = answer.body_size;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char line[64];
        snprintf(line, sizeof line, "Accept-Encoding: %s\r\n", cases[i].accepted);
        bool packed = status_of(&daemon, "GET", "/page/main.js", line) == 200 &&
                      !strcmp(header("Content-Encoding"), "gzip");
        if (packed != cases[i].packed) check_fail(__FILE__, __LINE__, "\"%s\"", cases[i].accepted);
        CHECK(packed ? answer.body_size < plain && !memcmp(answer.body, "\x1f\x8b", 2)
                     : answer.body_size == plain);
    }
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(each_form_of_a_file_has_its_tag)
{
    struct daemon daemon;
    char plain[64], packed[64], line[160];
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK_INT(status_of(&daemon, "GET", "/", ""), 200);
    snprintf(plain, sizeof plain, "%s", header("ETag"));
    CHECK_INT(status_of(&daemon, "GET", "/", "Accept-Encoding: gzip\r\n"), 200);
    snprintf(packed, sizeof packed, "%s", header("ETag"));
    CHECK(plain[0] == '"' && packed[0] == '"' && strcmp(plain, packed));
    snprintf(line, sizeof line, "Accept-Encoding: gzip\r\nIf-None-Match: %s\r\n", packed);
    CHECK_INT(status_of(&daemon, "GET", "/", line), 304);
    CHECK_INT(answer.body_size, 0);
    CHECK_STR(header("ETag"), packed);
    CHECK(strstr(header("Content-Security-Policy"),
                 "'self'")); /* RFC 9110 section 15.4.5 lets it come along */
    snprintf(line, sizeof line, "If-None-Match: %s\r\n", packed);
    CHECK_INT(status_of(&daemon, "GET", "/", line), 200);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(head_is_the_page_without_its_bytes)
{
    struct daemon daemon;
    char text[2048] = "";
    size_t n = 0;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    int fd = daemon_connect(&daemon);
    CHECK(daemon_send(fd, "HEAD / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"));
    for (ssize_t got; n + 1 < sizeof text && (got = read(fd, text + n, sizeof text - 1 - n)) > 0;)
        n += (size_t)got;
    close(fd);
    CHECK(!strncmp(text, "HTTP/1.1 200 ", 13));
    CHECK(strstr(text, "\r\nETag: \"") && strstr(text, "\r\nContent-Length: ") &&
          !strstr(text, "Content-Length: 0"));
    CHECK(n > 4 && !strcmp(text + n - 4, "\r\n\r\n"));
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(all_files_of_the_page_have_one_count)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK_INT(status_of(&daemon, "GET", "/", ""), 200);
    CHECK_INT(status_of(&daemon, "GET", "/page/main.js", ""), 200);
    CHECK_INT(status_of(&daemon, "GET", "/metrics", ""), 200);
    CHECK(strstr(answer.body, "facetd_requests_total{path=\"/\",code=\"200\"} 2\n"));
    CHECK(!strstr(answer.body, "/page/"));
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(the_page_is_only_read)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK_INT(status_of(&daemon, "POST", "/", ""), 405);
    CHECK_STR(header("Allow"), "GET, HEAD, OPTIONS");
    CHECK_INT(status_of(&daemon, "DELETE", "/page/main.js", ""), 405);
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* It cannot carry a token before it has asked for one. */
TEST(the_page_needs_no_token)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--token", "s3cret"))) return;
    CHECK_INT(status_of(&daemon, "GET", "/", ""), 200);
    CHECK_INT(status_of(&daemon, "GET", "/page/main.js", ""), 200);
    CHECK_INT(status_of(&daemon, "GET", "/v1/document", ""), 401);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(without_the_page)
{
    static const char *const flags[] = {"--no-page", "--no-page=1"};
    char out[64];
    for (size_t i = 0; i < sizeof flags / sizeof *flags; i++) {
        struct daemon daemon;
        if (!daemon_start(&daemon, FAKE, FLAGS(flags[i]))) return;
        CHECK_INT(status_of(&daemon, "GET", "/", ""), 404);
        CHECK_INT(status_of(&daemon, "GET", "/page/main.js", ""), 404);
        CHECK_INT(daemon_stop(&daemon), 0);
    }
    CHECK_INT(daemon_run(FAKE, FLAGS("--no-page=maybe"), out, sizeof out), 2);
}

TEST(the_admin_listener_has_no_page)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--admin", "127.0.0.1:0"))) return;
    CHECK(daemon_ask_over(daemon_connect_port(daemon.admin_port),
                          "GET / HTTP/1.1\r\nHost: x\r\n\r\n", &answer));
    CHECK_INT(answer.status, 404);
    CHECK_INT(daemon_stop(&daemon), 0);
}
