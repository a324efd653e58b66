/*
 * Requests that others collected (shared data): the exchanges of libhtp, captured and abusive, and
 * the blocks of llhttp's test documents.  Whatever they hold, the daemon answers no 5xx and lives.
 */
#include "check.h"
#include "daemon.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#define FAKE "facetd-fake"

enum { EXCHANGES_MAX = 1024, SETTLE_MS = 400 };

static struct {
    char *bytes;
    size_t size;
    char name[64];
} exchanges[EXCHANGES_MAX];
static size_t exchange_count;

static void add(const char *name, const char *bytes, size_t size)
{
    if (exchange_count == EXCHANGES_MAX) return;
    char *copy = malloc(size + 1);
    if (!copy) return;
    memcpy(copy, bytes, size);
    exchanges[exchange_count].bytes = copy;
    exchanges[exchange_count].size = size;
    snprintf(exchanges[exchange_count++].name, sizeof exchanges[0].name, "%s", name);
}

/* libhtp: what stands between >>> and the next >>> or <<< was sent by the client. */
static void add_libhtp(const char *name, const char *text, size_t size)
{
    char *sent = malloc(size + 1);
    size_t used = 0;
    bool client = false;
    for (size_t i = 0; sent && i < size;) {
        const char *end = memchr(text + i, '\n', size - i);
        size_t n = end ? (size_t)(end + 1 - (text + i)) : size - i;
        const bool mark = n >= 4 && n <= 5 &&
                          (!memcmp(text + i, ">>>", 3) || !memcmp(text + i, "<<<", 3));
        if (mark) {
            client = text[i] == '>';
            used -= used && sent[used - 1] == '\n'; /* the mark's own line end */
        } else if (client) {
            memcpy(sent + used, text + i, n);
            used += n;
        }
        i += n;
    }
    if (sent) add(name, sent, used);
    free(sent);
}

/* llhttp: blocks ```http, whose line ends stand for CR LF and whose \r, \n and \t for themselves. */
static void add_llhttp(const char *name, const char *text, size_t size)
{
    static const char open[] = "```http\n";
    char *sent = malloc(2 * size + 1);
    for (const char *at = text; sent && (at = strstr(at, open));) {
        at += sizeof open - 1;
        const char *end = strstr(at, "```");
        size_t used = 0;
        for (; end && at < end; at++) {
            static const char escapes[] = "r\rn\nt\tf\f";
            const char *escape = *at == '\\' ? strchr(escapes, at[1]) : NULL;
            if (escape && at[1])
                sent[used++] = escape[1], at++;
            else if (*at == '\n')
                memcpy(sent + used, "\r\n", 2), used += 2;
            else
                sent[used++] = *at;
        }
        add(name, sent, used);
    }
    free(sent);
}

static void load(const char *dir, void (*take)(const char *, const char *, size_t))
{
    const char *root = getenv("FACET_DATA");
    char path[512], file[1024];
    size_t size;
    snprintf(path, sizeof path, "%s/http/%s", root ? root : "../shared/data", dir);
    DIR *d = opendir(path);
    for (struct dirent *e; d && (e = readdir(d));) {
        snprintf(file, sizeof file, "%s/%s", path, e->d_name);
        struct stat st;
        if (stat(file, &st) || !S_ISREG(st.st_mode)) continue;
        char *bytes = check_read_file(file, &size);
        if (bytes) take(e->d_name, bytes, size);
        free(bytes);
    }
    if (d) closedir(d);
}

static bool is_fault(int status)
{
    return status >= 500 && status != 501 && status != 505;
}

static void send_all(const struct daemon *daemon)
{
    static char text[65536];
    static int fds[EXCHANGES_MAX];
    int answers = 0;
    for (size_t i = 0; i < exchange_count; i++) {
        fds[i] = daemon_connect(daemon);
        if (fds[i] >= 0) send(fds[i], exchanges[i].bytes, exchanges[i].size, MSG_NOSIGNAL);
    }
    sleep_ms(SETTLE_MS);
    for (size_t i = 0; i < exchange_count; i++) {
        size_t used = 0;
        ssize_t n;
        while (fds[i] >= 0 && used < sizeof text - 1 &&
               (n = recv(fds[i], text + used, sizeof text - 1 - used, MSG_DONTWAIT)) > 0)
            used += (size_t)n;
        text[used] = 0;
        for (const char *at = text; (at = strstr(at, "HTTP/1.1 ")); at += 9, answers++)
            if (is_fault(atoi(at + 9)))
                check_fail(__FILE__, __LINE__, "%s: %.40s", exchanges[i].name, at);
        close(fds[i]);
    }
    check_note("exchanges", (double)exchange_count);
    check_note("answers", answers);
}

TEST(what_others_captured_does_no_harm)
{
    struct daemon daemon;
    struct answer *answer = calloc(1, sizeof *answer);
    load("libhtp_files", add_libhtp);
    load("llhttp/test", add_llhttp);
    load("llhttp/test/request", add_llhttp);
    load("llhttp/test/response", add_llhttp);
    if (!exchange_count) {
        free(answer);
        check_skip("shared data is absent");
        return;
    }
    if (answer && daemon_start(&daemon, FAKE, NULL)) {
        send_all(&daemon);
        CHECK(daemon_get(&daemon, "/healthz", answer));
        CHECK_INT(answer->status, 200);
        CHECK_INT(daemon_stop(&daemon), 0);
    }
    for (size_t i = 0; i < exchange_count; i++) free(exchanges[i].bytes);
    free(answer);
}
