/*
 * facet_torture - fails every allocation and every fallible system call of a daemon, one at a time,
 * and looks at what the client gets.
 *
 *   facet_torture --daemon PROGRAM --fault LIBRARY --cases DIR [--all yes] [--flags "..."]
 *
 * For each request (one per endpoint and kind of body; with --all every case that is quick) the n-th
 * call fails, n = 0, 1, ... until the request needs no more calls: on a fresh connection, from accept
 * to close.  Then the answer is the right one, or a refusal that says so, or the connection ends; the
 * daemon lives, and holds as many blocks as before.  The same for the daemon's start and its end.
 */
#define _GNU_SOURCE /* memmem */
#include "../torture/fault.h"
#include "cases.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { SITES_MAX = 20000, HANG_MS = 5000, SETTLE_MS = 1500, START_SITES_MAX = 2000 };

struct torture {
    const char *program, *library, *flags;
    char page_path[64], out_path[64], err_path[64];
    struct fault_page *page;
    pid_t pid;
    int port;
    size_t sites, right, refused, ended, failed;
};

/* One answer, its body without chunks. */
struct reply {
    char *bytes, *body;
    size_t size, body_size;
    int status; /* 0: none, or not whole */
    bool hung, is_head; /* is_head: of a HEAD, whose length announces a body that does not come */
};

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static void pause_ms(int ms)
{
    poll(NULL, 0, ms);
}

static void fail(struct torture *t, const char *name, long site, const char *what)
{
    enum { SHOWN = 20 };
    if (t->failed++ < SHOWN)
        printf("  %s: call %ld (%s): %s\n", name, site, t->page->what, what);
    fflush(stdout);
}

/* ---- The daemon ------------------------------------------------------------------------------ */

static void run_daemon(const struct torture *t, long at)
{
    char number[32], flags[512], port[] = "--port", zero[] = "0";
    char *words[40] = {(char *)t->program, port, zero};
    int n = 3;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    setenv("LD_PRELOAD", t->library, 1);
    setenv(FAULT_PAGE, t->page_path, 1);
    snprintf(number, sizeof number, "%ld", at);
    if (at >= 0) setenv(FAULT_AT, number, 1);
    dup2(open(t->out_path, O_WRONLY | O_TRUNC | O_CREAT, 0600), STDOUT_FILENO);
    dup2(open(t->err_path, O_WRONLY | O_APPEND | O_CREAT, 0600), STDERR_FILENO);
    snprintf(flags, sizeof flags, "%s", t->flags);
    for (char *word = strtok(flags, " "); word && n < 39; word = strtok(NULL, " "))
        words[n++] = word;
    execv(t->program, words);
    _exit(127);
}

static int read_port(const struct torture *t)
{
    char text[256] = "";
    int fd = open(t->out_path, O_RDONLY), port = 0;
    ssize_t n = fd < 0 ? 0 : read(fd, text, sizeof text - 1);
    if (fd >= 0) close(fd);
    if (n > 0 && strchr(text, '\n')) sscanf(text, "listening on http://127.0.0.1:%d", &port);
    return port;
}

/* True if it listens; else it has ended, with `status`. */
static bool start(struct torture *t, long at, int *status)
{
    unlink(t->out_path);
    t->port = 0;
    t->pid = fork();
    if (t->pid == 0) run_daemon(t, at);
    for (double end = now_ms() + HANG_MS; t->pid > 0 && now_ms() < end; pause_ms(1)) {
        if ((t->port = read_port(t))) return true;
        if (waitpid(t->pid, status, WNOHANG) == t->pid) {
            t->pid = 0;
            return false;
        }
    }
    *status = -1; /* neither listens nor ends */
    return false;
}

/* The exit status after SIGTERM; -1 if it does not end. */
static int stop(struct torture *t)
{
    int status = -1;
    if (t->pid <= 0) return -1;
    kill(t->pid, SIGTERM);
    for (double end = now_ms() + 2 * HANG_MS; now_ms() < end; pause_ms(1))
        if (waitpid(t->pid, &status, WNOHANG) == t->pid) return t->pid = 0, status;
    kill(t->pid, SIGKILL);
    waitpid(t->pid, &status, 0);
    t->pid = 0;
    return -1;
}

static bool is_crash(int status)
{
    return status == -1 || WIFSIGNALED(status) || WEXITSTATUS(status) > 2;
}

/* ---- One request ----------------------------------------------------------------------------- */

static bool unchunk(struct reply *reply)
{
    char *from = reply->body, *to = reply->body, *end = reply->bytes + reply->size;
    for (;;) {
        char *after;
        unsigned long n = strtoul(from, &after, 16);
        if (after == from || after + 2 > end) return false;
        from = after + 2;
        if (!n) break;
        if (from + n + 2 > end) return false;
        memmove(to, from, n);
        to += n;
        from += n + 2;
    }
    reply->body_size = (size_t)(to - reply->body);
    return true;
}

static void parse(struct reply *reply)
{
    char *head = reply->bytes, *body = reply->size ? memmem(head, reply->size, "\r\n\r\n", 4) : NULL;
    if (!body || sscanf(head, "HTTP/1.1 %d", &reply->status) != 1) {
        reply->status = 0;
        return;
    }
    *body = 0;
    reply->body = body + 4;
    reply->body_size = reply->size - (size_t)(reply->body - head);
    const char *length = strcasestr(head, "\r\nContent-Length:");
    bool whole = true;
    if (length && !reply->is_head) whole = strtoul(length + 17, NULL, 10) == reply->body_size;
    if (strcasestr(head, "\r\nTransfer-Encoding: chunked")) whole = unchunk(reply);
    if (!whole) reply->status = 0;
}

static void receive(int fd, struct reply *reply)
{
    size_t room = 0;
    struct pollfd p = {.fd = fd, .events = POLLIN};
    for (;;) {
        if (reply->size + 65536 > room) {
            char *more = realloc(reply->bytes, (room = 2 * room + 131072) + 1);
            if (!more) abort();
            reply->bytes = more;
        }
        if (poll(&p, 1, HANG_MS) <= 0) {
            reply->hung = true;
            break;
        }
        ssize_t n = recv(fd, reply->bytes + reply->size, 65536, 0);
        if (n <= 0) break;
        reply->size += (size_t)n;
    }
    reply->bytes[reply->size] = 0;
}

struct shot {
    const char *name;
    char *head;
    size_t head_size;
    struct body body;
};

static void ask(const struct torture *t, const struct shot *shot, struct reply *reply)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((unsigned short)t->port)};
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    memset(reply, 0, sizeof *reply);
    reply->is_head = !strncmp(shot->head, "HEAD ", 5);
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    if (fd >= 0 && !connect(fd, (struct sockaddr *)&to, sizeof to)) {
        size_t sent = 0;
        ssize_t n = send(fd, shot->head, shot->head_size, MSG_NOSIGNAL);
        while (n > 0 && sent < shot->body.size)
            if ((n = send(fd, shot->body.bytes + sent, shot->body.size - sent, MSG_NOSIGNAL)) > 0)
                sent += (size_t)n;
        receive(fd, reply);
        parse(reply);
    }
    if (fd >= 0) close(fd);
}

static void reply_clear(struct reply *reply)
{
    free(reply->bytes);
}

/* Numbers hidden: for answers that hold times. */
static void mask(struct reply *reply)
{
    char *to = reply->body;
    for (size_t i = 0; i < reply->body_size; i++) {
        char c = reply->body[i];
        if (isdigit((unsigned char)c)) c = '0';
        if (strchr(".+-e", c) && to > reply->body && to[-1] == '0') continue;
        if (c == '0' && to > reply->body && to[-1] == '0') continue;
        *to++ = c;
    }
    reply->body_size = (size_t)(to - reply->body);
}

static bool same(const struct reply *a, const struct reply *b)
{
    return a->status == b->status && a->body_size == b->body_size &&
           !memcmp(a->body, b->body, a->body_size);
}

/* Whether it comes back to `live` blocks when the connection has gone. */
static bool settles(const struct torture *t, long live)
{
    for (double end = now_ms() + SETTLE_MS; now_ms() < end; pause_ms(1))
        if (atomic_load(&t->page->live) == live) return true;
    return false;
}

/* ---- Every site of a request ------------------------------------------------------------------ */

struct target {
    struct reply right;
    bool volatile_; /* holds times: numbers are not compared */
    long live;
};

static bool learn(struct torture *t, const struct shot *shot, struct target *target)
{
    struct reply again;
    for (int i = 0; i < 3; i++) { /* what is kept for good is made now */
        ask(t, shot, &again);
        reply_clear(&again);
    }
    pause_ms(5);
    ask(t, shot, &target->right);
    ask(t, shot, &again);
    target->volatile_ = target->right.status && !same(&target->right, &again);
    if (target->volatile_) {
        mask(&target->right);
        mask(&again);
    }
    bool well = target->right.status && same(&target->right, &again);
    reply_clear(&again);
    for (int i = 0; i < 50; i++) { /* steady? */
        target->live = atomic_load(&t->page->live);
        pause_ms(4);
        if (atomic_load(&t->page->live) == target->live) break;
    }
    return well;
}

/* True while there was a call to fail. */
static bool strike(struct torture *t, const struct shot *shot, struct target *target, long site)
{
    struct reply reply;
    int status;
    atomic_store(&t->page->hit, 0);
    atomic_store(&t->page->left, site);
    ask(t, shot, &reply);
    bool quiet = settles(t, target->live);
    atomic_store(&t->page->left, -1);
    bool hit = atomic_load(&t->page->hit);
    if (reply.status && target->volatile_) mask(&reply);
    if (waitpid(t->pid, &status, WNOHANG) == t->pid) {
        t->pid = 0;
        fail(t, shot->name, site, is_crash(status) ? "the daemon crashed" : "the daemon ended");
    } else if (reply.hung) {
        fail(t, shot->name, site, "no answer, and the connection stays");
    } else if (reply.status && reply.status < 300 && !same(&reply, &target->right)) {
        fail(t, shot->name, site, "a wrong 200");
    } else if (reply.status && !same(&reply, &target->right) && reply.status < 400) {
        fail(t, shot->name, site, "neither an answer nor a refusal");
    } else if (!hit && !same(&reply, &target->right)) {
        fail(t, shot->name, site, "nothing failed, and yet the answer is another one");
    } else if (!quiet && !settles(t, target->live)) {
        char text[96];
        snprintf(text, sizeof text, "%ld blocks held, %ld before",
                 (long)atomic_load(&t->page->live), target->live);
        fail(t, shot->name, site, text);
        target->live = atomic_load(&t->page->live);
    }
    t->sites += hit;
    t->right += hit && same(&reply, &target->right);
    t->refused += hit && reply.status >= 400 && !same(&reply, &target->right);
    t->ended += hit && !reply.status;
    reply_clear(&reply);
    return hit;
}

static void torment(struct torture *t, const struct shot *shot)
{
    struct target target = {0};
    size_t failed = t->failed, sites = t->sites;
    int status;
    double begin = now_ms();
    if (t->pid <= 0 && !start(t, -1, &status)) {
        fail(t, shot->name, -1, "the daemon does not start again");
    } else if (!learn(t, shot, &target)) {
        fail(t, shot->name, -1, "not answered the same way twice");
    } else {
        for (long site = 0; site < SITES_MAX && t->pid > 0; site++)
            if (!strike(t, shot, &target, site)) break;
    }
    reply_clear(&target.right);
    printf("%s torture/%s: %zu calls failed, %.0f ms\n", t->failed > failed ? "FAIL" : "ok",
           shot->name, t->sites - sites, now_ms() - begin);
    fflush(stdout);
}

/* ---- Which requests --------------------------------------------------------------------------- */

static char *head_of(const json_t *request, const struct body *body, size_t *size)
{
    const char *path = json_string_value(json_object_get(request, "path")),
               *method = json_string_value(json_object_get(request, "method")), *key;
    json_t *value;
    char *text = NULL;
    bool has_type = false;
    FILE *f = open_memstream(&text, size);
    if (!f) return NULL;
    fprintf(f, "%s %s HTTP/1.1\r\nHost: x\r\nConnection: close\r\n",
            method ? method : body->bytes ? "POST" : "GET", path);
    json_object_foreach(json_object_get(request, "headers"), key, value)
    {
        fprintf(f, "%s: %s\r\n", key, json_string_value(value));
        has_type = has_type || !strcasecmp(key, "Content-Type");
    }
    if (body->bytes && !has_type) fprintf(f, "Content-Type: %s\r\n", body->type);
    if (body->bytes) fprintf(f, "Content-Length: %zu\r\n", body->size);
    fputs("\r\n", f);
    fclose(f);
    return text;
}

/* Endpoint and kind of body: one of each is enough for the short form. */
static bool is_new(const char *path, const struct body *body, int status)
{
    enum { KINDS_MAX = 256 };
    static char kinds[KINDS_MAX][128];
    static size_t count;
    char kind[128];
    const bool good = status == 200;
    const char *magic = body->bytes && body->bytes[0] != '{' ? body->bytes : "";
    if (good)
        snprintf(kind, sizeof kind, "%.*s %s %.3s", (int)strcspn(path, "?"), path,
                 body->bytes ? body->type : "-", magic);
    else
        snprintf(kind, sizeof kind, "refused %s", body->bytes ? "body" : "path");
    for (size_t i = 0; i < count; i++)
        if (!strcmp(kinds[i], kind)) return false;
    if (count < KINDS_MAX) memcpy(kinds[count++], kind, sizeof kind);
    return true;
}

static void torment_case(struct torture *t, const struct test_case *c, bool all)
{
    enum { BODY_LARGEST = 300000 };
    const double slowest_ms = all ? 60 : 10;
    const json_t *request = json_object_get(c->root, "request"),
                 *expected = json_object_get(json_object_get(c->root, "expect"), "status");
    const char *path = json_string_value(json_object_get(request, "path"));
    struct shot shot = {.name = c->name};
    struct reply reply;
    int ended;
    enum body_result made = path ? body_make(request, &shot.body) : BODY_BAD;
    if (made == BODY_ABSENT || made == BODY_BAD || shot.body.size > BODY_LARGEST)
        return body_clear(&shot.body);
    if (t->pid <= 0 && !start(t, -1, &ended)) return body_clear(&shot.body);
    shot.head = head_of(request, &shot.body, &shot.head_size);
    double begin = now_ms();
    ask(t, &shot, &reply);
    reply_clear(&reply);
    ask(t, &shot, &reply);
    bool quick = now_ms() - begin < 2 * slowest_ms;
    if (quick && (all || is_new(path, &shot.body, (int)json_integer_value(expected))))
        torment(t, &shot);
    reply_clear(&reply);
    free(shot.head);
    body_clear(&shot.body);
}

/* ---- Start and end ---------------------------------------------------------------------------- */

static size_t torment_start(struct torture *t)
{
    static const char get[] = "GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
    struct shot shot = {.name = "start", .head = (char *)get, .head_size = sizeof get - 1};
    long site = 0;
    for (bool hit = true; hit && site < START_SITES_MAX; site++) {
        struct reply reply = {0};
        int status = 0;
        atomic_store(&t->page->hit, 0);
        bool listens = start(t, site, &status);
        hit = atomic_load(&t->page->hit);
        if (listens) {
            atomic_store(&t->page->left, -1);
            ask(t, &shot, &reply);
            if (reply.status != 200) fail(t, "start", site, "it listens, but is not well");
            status = stop(t);
            if (status) fail(t, "start", site, "it listened, but did not end with 0");
        } else if (status == -1) {
            fail(t, "start", site, "it neither listens nor ends");
            stop(t);
        } else if (is_crash(status) || !WEXITSTATUS(status)) {
            fail(t, "start", site, "it did not end with an error");
        }
        t->sites += hit;
        reply_clear(&reply);
    }
    return (size_t)site - 1;
}

static size_t torment_end(struct torture *t)
{
    long site = 0;
    for (bool hit = true; hit && site < START_SITES_MAX; site++) {
        int status;
        if (!start(t, -1, &status)) {
            fail(t, "end", site, "it does not start");
            break;
        }
        atomic_store(&t->page->hit, 0);
        atomic_store(&t->page->left, site);
        status = stop(t);
        hit = atomic_load(&t->page->hit);
        if (is_crash(status)) fail(t, "end", site, "it did not end well");
        t->sites += hit;
    }
    return (size_t)site - 1;
}

/* ---- All -------------------------------------------------------------------------------------- */

static bool open_page(struct torture *t)
{
    snprintf(t->page_path, sizeof t->page_path, "/tmp/facetd-torture-%ld.page", (long)getpid());
    snprintf(t->out_path, sizeof t->out_path, "/tmp/facetd-torture-%ld.out", (long)getpid());
    snprintf(t->err_path, sizeof t->err_path, "/tmp/facetd-torture-%ld.err", (long)getpid());
    int fd = open(t->page_path, O_RDWR | O_CREAT | O_TRUNC, 0600);
    if (fd < 0 || ftruncate(fd, sizeof *t->page)) return false;
    t->page = mmap(NULL, sizeof *t->page, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    close(fd);
    if (t->page == MAP_FAILED) return false;
    atomic_store(&t->page->left, -1);
    return true;
}

static void close_page(struct torture *t)
{
    unlink(t->page_path);
    unlink(t->out_path);
    if (!t->failed) unlink(t->err_path);
    munmap(t->page, sizeof *t->page);
}

int main(int argc, char **argv)
{
    struct torture t = {.flags = ""};
    struct cases cases = {0};
    const char *dir = NULL;
    bool all = false;
    for (int i = 1; i + 1 < argc; i += 2) {
        if (!strcmp(argv[i], "--daemon")) t.program = argv[i + 1];
        if (!strcmp(argv[i], "--fault")) t.library = argv[i + 1];
        if (!strcmp(argv[i], "--cases")) dir = argv[i + 1];
        if (!strcmp(argv[i], "--flags")) t.flags = argv[i + 1];
        if (!strcmp(argv[i], "--all")) all = !strcmp(argv[i + 1], "yes");
    }
    if (!t.program || !t.library || !dir || !cases_load(dir, NULL, &cases) || !open_page(&t)) {
        fprintf(stderr, "usage: facet_torture --daemon PROGRAM --fault LIBRARY --cases DIR "
                        "[--all yes] [--flags \"...\"]\n");
        return 2;
    }
    size_t failed = 0, starts = torment_start(&t);
    printf("%s torture/start: %zu calls failed\n", t.failed ? "FAIL" : "ok", starts);
    failed = t.failed;
    size_t ends = torment_end(&t);
    printf("%s torture/end: %zu calls failed\n", t.failed > failed ? "FAIL" : "ok", ends);
    for (size_t i = 0; i < cases.count; i++) torment_case(&t, &cases.list[i], all);
    int status = stop(&t);
    if (is_crash(status) || status) fail(&t, "all", -1, "the daemon did not end with 0");
    printf("%s torture/all: %zu calls failed one by one: %zu right answers, %zu refusals, %zu ended "
           "connections; %zu faults\n",
           t.failed ? "FAIL" : "ok", t.sites, t.right, t.refused, t.ended, t.failed);
    cases_clear(&cases);
    close_page(&t);
    return t.failed ? 1 : 0;
}
