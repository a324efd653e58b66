/*
 * Requests that two servers could read differently, or that try what a parser forgets.  Each row
 * says how many of the requests in it may be answered by 2xx.  Where nginx is installed it gets the
 * same bytes: what it refuses must be refused here.  The rows follow RFC 9112 sections 2.2, 3, 5, 6
 * and 11.2, the published smuggling families, and the AFL dictionary's ideas.
 */
#include "check.h"
#include "daemon.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#define FAKE "facetd-fake"

/* The request that must not be answered: hidden in the body of another. */
#define HIDDEN "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n"

struct row {
    const char *name, *bytes;
    size_t size;
    int answered; /* 2xx */
};

#define ROW(answered, name, bytes)                                                                 \
    {                                                                                              \
        name, bytes, sizeof(bytes) - 1, answered                                                   \
    }
#define POST(headers, body) "POST /echo HTTP/1.1\r\nHost: x\r\n" headers "\r\n" body
#define GET(headers) "GET /healthz HTTP/1.1\r\nHost: x\r\n" headers "\r\n"

static const struct row rows[] = {
    /* controls: these are fine, and a test that refuses everything shows here */
    ROW(1, "plain GET", GET("")),
    ROW(1, "plain POST", POST("Content-Length: 4\r\n", "abcd")),
    ROW(2, "pipelined", GET("") GET("")),
    ROW(1, "chunked", POST("Transfer-Encoding: chunked\r\n", "4\r\nabcd\r\n0\r\n\r\n")),
    ROW(1, "chunked in capitals", POST("TRANSFER-ENCODING: Chunked\r\n", "4\r\nabcd\r\n0\r\n\r\n")),
    ROW(1, "an empty line before", "\r\n" GET("")),
    ROW(1, "blanks around a value", GET("X: \t a b\r\n")),
    ROW(1, "an empty value", GET("X:\r\n")),
    ROW(1, "high bytes in a value", GET("X: \xc3\xa4\xff\r\n")),
    ROW(1, "HTTP/1.0 without Host", "GET /healthz HTTP/1.0\r\n\r\n"),
    /* two lengths */
    ROW(0, "two lengths that differ",
        POST("Content-Length: 4\r\nContent-Length: 38\r\n", "abcd" HIDDEN)),
    ROW(0, "two lengths, the second hides",
        POST("Content-Length: 0\r\nContent-Length: 35\r\n", HIDDEN)),
    ROW(0, "two equal lengths", POST("Content-Length: 4\r\nContent-Length: 4\r\n", "abcd")),
    ROW(0, "a list of lengths", POST("Content-Length: 4, 4\r\n", "abcd")),
    ROW(0, "a length with a sign", POST("Content-Length: +4\r\n", "abcd")),
    ROW(0, "a negative length", POST("Content-Length: -4\r\n", "abcd")),
    ROW(0, "a hexadecimal length", POST("Content-Length: 0x4\r\n", "abcd")),
    ROW(0, "an empty length", POST("Content-Length: \r\n", "abcd")),
    ROW(0, "a length beyond 2^64", POST("Content-Length: 18446744073709551620\r\n", "abcd")),
    ROW(0, "a length with digits apart", POST("Content-Length: 3 5\r\n", HIDDEN)),
    ROW(0, "a length that is quoted", POST("Content-Length: \"4\"\r\n", "abcd")),
    /* lengths and encodings */
    ROW(0, "length and chunked",
        POST("Content-Length: 4\r\nTransfer-Encoding: chunked\r\n", "0\r\n\r\n" HIDDEN)),
    ROW(0, "chunked and length",
        POST("Transfer-Encoding: chunked\r\nContent-Length: 40\r\n", "0\r\n\r\n" HIDDEN)),
    ROW(0, "an unknown encoding", POST("Transfer-Encoding: gzip\r\n", "abcd")),
    ROW(0, "identity", POST("Transfer-Encoding: identity\r\nContent-Length: 4\r\n", "abcd")),
    ROW(0, "chunked twice", POST("Transfer-Encoding: chunked, chunked\r\n", "0\r\n\r\n")),
    ROW(0, "two encodings",
        POST("Transfer-Encoding: chunked\r\nTransfer-Encoding: identity\r\n", "0\r\n\r\n" HIDDEN)),
    ROW(0, "chunked not last", POST("Transfer-Encoding: chunked, gzip\r\n", "0\r\n\r\n")),
    ROW(0, "xchunked", POST("Transfer-Encoding: xchunked\r\nContent-Length: 4\r\n", "abcd")),
    ROW(0, "chunked after a vertical tab",
        POST("Transfer-Encoding: \x0b"
             "chunked\r\n",
             "0\r\n\r\n")),
    ROW(0, "chunked in quotes", POST("Transfer-Encoding: \"chunked\"\r\n", "0\r\n\r\n")),
    ROW(0, "a blank before the colon",
        POST("Transfer-Encoding : chunked\r\nContent-Length: 4\r\n", "abcd")),
    ROW(0, "a tab before the colon", POST("Content-Length\t: 4\r\n", "abcd")),
    ROW(0, "chunked in HTTP/1.0",
        "POST /echo HTTP/1.0\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"),
    /* lines */
    ROW(0, "a folded value", GET("X: a\r\n b\r\n")),
    ROW(0, "a folded encoding",
        POST("Transfer-Encoding:\r\n chunked\r\nContent-Length: 4\r\n", "abcd")),
    ROW(0, "a fold that makes a length", POST("Content-Leng: 35\r\n th\r\n", HIDDEN)),
    ROW(0, "a fold with a tab", GET("X: a\r\n\tb\r\n")),
    ROW(0, "a fold after the request line", "GET /healthz HTTP/1.1\r\n Host: x\r\nHost: y\r\n\r\n"),
    ROW(0, "LF alone", "GET /healthz HTTP/1.1\nHost: x\n\n"),
    ROW(0, "LF alone after one header", "GET /healthz HTTP/1.1\r\nHost: x\nX: y\r\n\r\n"),
    ROW(0, "LF alone at the end", "GET /healthz HTTP/1.1\r\nHost: x\r\n\n"),
    ROW(0, "CR in a value", GET("X: a\rTransfer-Encoding: chunked\r\n")),
    ROW(0, "CR before CR LF", GET("X: a\r\r\n")),
    ROW(0, "a header without a colon", GET("nonsense\r\n")),
    ROW(0, "a header without a name", GET(": x\r\n")),
    ROW(0, "a name with a control", GET("X\x01Y: z\r\n")),
    ROW(0, "a name with brackets", GET("X(Y): z\r\n")),
    ROW(0, "a name with high bytes", GET("X\xff: z\r\n")),
    ROW(0, "a control in a value", GET("X: a\x01\r\n")),
    ROW(0, "DEL in a value", GET("X: a\x7f\r\n")),
    /* NULs */
    ROW(0, "NUL in a value", GET("X: a\0b\r\n")),
    ROW(0, "NUL at the end of a value", GET("X: a\0\r\nY: z\r\n")),
    ROW(0, "NUL at the end of the last value", GET("X: a\0\r\n")),
    ROW(0, "NUL in a name", GET("X\0Y: z\r\n")),
    ROW(0, "NUL in a length",
        POST("Content-Length: 4\0"
             "0\r\n",
             "abcd")),
    ROW(0, "NUL in the target", "GET /healthz\0x HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "NUL in the method", "GET\0 /healthz HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "NUL in the version", "GET /healthz HTTP/1.1\0\r\nHost: x\r\n\r\n"),
    ROW(0, "%00 in the path", "GET /healthz%00 HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "%00 in the query", "GET /healthz?a=%00 HTTP/1.1\r\nHost: x\r\n\r\n"),
    /* hosts */
    ROW(0, "no Host", "GET /healthz HTTP/1.1\r\n\r\n"),
    ROW(0, "two Hosts", GET("Host: y\r\n")),
    ROW(0, "two equal Hosts", GET("Host: x\r\n")),
    ROW(0, "an empty Host", "GET /healthz HTTP/1.1\r\nHost:\r\n\r\n"),
    ROW(0, "a Host with a path", "GET /healthz HTTP/1.1\r\nHost: x/y\r\n\r\n"),
    ROW(0, "a Host with a blank", "GET /healthz HTTP/1.1\r\nHost: x y\r\n\r\n"),
    ROW(0, "a Host with an at", "GET /healthz HTTP/1.1\r\nHost: x@y\r\n\r\n"),
    /* request lines */
    ROW(0, "a blank in the target", "GET /healthz x HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "two blanks before the target", "GET  /healthz HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "two blanks after the target", "GET /healthz  HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "a blank after the version", "GET /healthz HTTP/1.1 \r\nHost: x\r\n\r\n"),
    ROW(0, "a tab in the request line", "GET\t/healthz\tHTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "no version", "GET /healthz\r\n\r\n"),
    ROW(0, "nothing but a method", "GET\r\n\r\n"),
    ROW(0, "a method and blanks", "GET  \r\n\r\n"),
    ROW(0, "no method", " /healthz HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "HTTP/2.0", "GET /healthz HTTP/2.0\r\nHost: x\r\n\r\n"),
    ROW(0, "HTTP/0.9", "GET /healthz HTTP/0.9\r\nHost: x\r\n\r\n"),
    ROW(0, "HTTP/1.10", "GET /healthz HTTP/1.10\r\nHost: x\r\n\r\n"),
    ROW(0, "http/1.1 in small letters", "GET /healthz http/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "the preface of HTTP/2", "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"),
    ROW(0, "TLS", "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03 abcdefgh\r\n\r\n"),
    ROW(0, "a control in the target", "GET /healthz\x01 HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "a high byte in the target", "GET /healthz\xff HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "a method with a control", "G\x01T /healthz HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "CONNECT", "CONNECT x:80 HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "TRACE", "TRACE /healthz HTTP/1.1\r\nHost: x\r\n\r\n"),
    ROW(0, "a path upwards", "GET /../../etc/passwd HTTP/1.1\r\nHost: x\r\n\r\n"),
    /* chunks */
    ROW(0, "a chunk size that is no number",
        POST("Transfer-Encoding: chunked\r\n", "zz\r\nabcd\r\n0\r\n\r\n")),
    ROW(0, "a chunk size with 0x",
        POST("Transfer-Encoding: chunked\r\n", "0x4\r\nabcd\r\n0\r\n\r\n")),
    ROW(0, "a chunk size with a sign",
        POST("Transfer-Encoding: chunked\r\n", "-1\r\nabcd\r\n0\r\n\r\n")),
    ROW(0, "a chunk size beyond 2^64",
        POST("Transfer-Encoding: chunked\r\n", "10000000000000004\r\nabcd\r\n0\r\n\r\n")),
    ROW(0, "a chunk longer than it says",
        POST("Transfer-Encoding: chunked\r\n", "2\r\nabcd\r\n0\r\n\r\n")),
    ROW(0, "a huge chunk", POST("Transfer-Encoding: chunked\r\n", "7fffffffffffffff\r\nabcd")),
    ROW(0, "no chunk size", POST("Transfer-Encoding: chunked\r\n", "\r\nabcd\r\n0\r\n\r\n")),
};

enum { ROWS = sizeof rows / sizeof *rows, SETTLE_MS = 400 };

struct outcome {
    int answered, refused; /* 2xx; 4xx and 5xx */
    bool fault;            /* 5xx but 501 and 505 */
};

static struct outcome count_answers(const char *text, size_t size)
{
    struct outcome outcome = {0};
    for (size_t i = 0; i + 12 < size; i++) {
        if (memcmp(text + i, "HTTP/1.", 7) || text[i + 8] != ' ') continue;
        int status = atoi(text + i + 9);
        outcome.answered += status >= 200 && status < 300;
        outcome.refused += status >= 400;
        outcome.fault = outcome.fault || (status >= 500 && status != 501 && status != 505);
    }
    return outcome;
}

/* All rows at once, each over a connection of its own. */
static void ask_all(int port, struct outcome *outcomes)
{
    static char text[65536];
    int fds[ROWS];
    for (size_t i = 0; i < ROWS; i++) {
        fds[i] = daemon_connect_port(port);
        if (fds[i] >= 0) send(fds[i], rows[i].bytes, rows[i].size, MSG_NOSIGNAL);
    }
    sleep_ms(SETTLE_MS);
    for (size_t i = 0; i < ROWS; i++) {
        size_t used = 0;
        ssize_t n;
        while (fds[i] >= 0 && used < sizeof text &&
               (n = recv(fds[i], text + used, sizeof text - used, MSG_DONTWAIT)) > 0)
            used += (size_t)n;
        outcomes[i] = count_answers(text, used);
        close(fds[i]);
    }
}

TEST(hostile_requests_are_refused)
{
    static struct outcome ours[ROWS];
    struct daemon daemon;
    struct answer *answer = calloc(1, sizeof *answer);
    int hostile = 0;
    if (!answer || !daemon_start(&daemon, FAKE, NULL)) return free(answer);
    ask_all(daemon.port, ours);
    for (size_t i = 0; i < ROWS; i++) {
        hostile += rows[i].answered == 0;
        if (ours[i].answered != rows[i].answered || ours[i].fault)
            check_fail(__FILE__, __LINE__, "%s: %d answered, not %d%s", rows[i].name,
                       ours[i].answered, rows[i].answered, ours[i].fault ? ", and a 5xx" : "");
    }
    check_note("hostile", hostile);
    CHECK(daemon_get(&daemon, "/healthz", answer));
    CHECK_INT(answer->status, 200);
    CHECK_INT(daemon_stop(&daemon), 0);
    free(answer);
}

/* nginx with a body-reading front and a backend that says 200 to everything; its pid, or 0. */
static pid_t start_nginx(const char *dir, int port)
{
    char path[128];
    snprintf(path, sizeof path, "%s/nginx.conf", dir);
    FILE *f = fopen(path, "w");
    if (!f) return 0;
    fprintf(f,
            "%sdaemon off; worker_processes 1; error_log %s/error.log; pid %s/pid;\n"
            "events { worker_connections 1024; }\n"
            "http { access_log off; client_body_temp_path %s/b; proxy_temp_path %s/p;\n"
            "  fastcgi_temp_path %s/f; uwsgi_temp_path %s/u; scgi_temp_path %s/s;\n"
            "  server { listen unix:%s/back; return 200; }\n"
            "  server { listen 127.0.0.1:%d; location / { proxy_pass http://unix:%s/back; } } }\n",
            getuid() ? "" : "user root; ", dir, dir, dir, dir, dir, dir, dir, dir, port, dir);
    fclose(f);
    pid_t pid = fork();
    if (pid) return pid;
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (!freopen("/dev/null", "w", stderr)) _exit(127);
    execl("/usr/sbin/nginx", "nginx", "-p", dir, "-c", path, (char *)NULL);
    _exit(127);
}

static int free_port(void)
{
    struct daemon daemon; /* the kernel chooses well, and REUSEADDR lets the next one have it */
    if (!daemon_start(&daemon, FAKE, NULL)) return 0;
    daemon_stop(&daemon);
    return daemon.port;
}

static void compare(int port)
{
    static struct outcome ours[ROWS], theirs[ROWS];
    struct daemon daemon;
    int stricter = 0;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    ask_all(daemon.port, ours);
    ask_all(port, theirs);
    for (size_t i = 0; i < ROWS; i++) {
        if (ours[i].answered > theirs[i].answered)
            check_fail(__FILE__, __LINE__, "%s: %d answered here, %d by nginx", rows[i].name,
                       ours[i].answered, theirs[i].answered);
        stricter += ours[i].answered < theirs[i].answered;
    }
    check_note("requests", ROWS);
    check_note("stricter_than_nginx", stricter);
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(what_nginx_refuses_is_refused)
{
    char dir[] = "/tmp/facetd-test-nginx-XXXXXX", command[128];
    int port, fd = -1, status;
    if (access("/usr/sbin/nginx", X_OK)) {
        check_skip("nginx is not installed (make test-extras)");
        return;
    }
    if (!mkdtemp(dir) || !(port = free_port())) return;
    pid_t pid = start_nginx(dir, port);
    for (int i = 0; i < 100 && (fd = daemon_connect_port(port)) < 0; i++) sleep_ms(50);
    CHECK(fd >= 0);
    if (fd >= 0) close(fd);
    if (fd >= 0) compare(port);
    kill(pid, SIGTERM);
    CHECK_INT(waitpid(pid, &status, 0), pid);
    snprintf(command, sizeof command, "rm -r %s", dir);
    CHECK_INT(system(command), 0);
}
