/*
 * facet_torture - fails every allocation and every fallible system call of a daemon, one at a time,
 * and looks at what the client gets.
 *
 *   facet_torture --daemon PROGRAM --fault LIBRARY --cases DIR [--all yes] [--jobs N] [--flags "..."]
 *
 * For each request (one per endpoint and kind of body; with --all every case that is quick) the n-th
 * call fails, n = 0, 1, ... until the request needs no more calls: on a fresh connection, from accept
 * to close.  Then the answer is the right one, or a refusal that says so, or the connection ends; the
 * daemon lives, and holds as many blocks as before.  The same for the daemon's start and its end.
 * N (1) daemons share the requests: after many a failure a daemon does nothing but wait.
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include "../torture/fault.h"
#include "reply.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { SITES_MAX = 20000, SETTLE_MS = 1500, START_SITES_MAX = 2000 };

/* Calls failed and what came of it; faults are what must not be. */
struct tally {
    size_t sites, right, refused, ended, faults;
};

struct torture {
    const char *program, *library, *flags;
    char page_path[64], out_path[64], err_path[64];
    struct fault_page *page;
    pid_t pid;
    int port;
    struct tally *tally;
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
    if (t->tally->faults++ < SHOWN)
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
    for (double end = now_ms() + REPLY_WAIT_MS; t->pid > 0 && now_ms() < end; pause_ms(1)) {
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
    for (double end = now_ms() + 2 * REPLY_WAIT_MS; now_ms() < end; pause_ms(1))
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

/* Whether it comes back to `live` blocks when the connection has gone. */
static bool settles(const struct torture *t, long *live)
{
    enum { STEADY_MS = 50 };
    long held = -1;
    double since = 0;
    for (double end = now_ms() + SETTLE_MS; now_ms() < end; pause_ms(1)) {
        const long now = atomic_load(&t->page->live);
        if (now == *live) return true;
        if (now != held) held = now, since = now_ms();
        if (now > *live || now_ms() - since < STEADY_MS) continue;
        *live = now; /* it was counted too early: a busy machine had not let go of all yet */
        return true;
    }
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
        reply_ask(t->port, shot, &again);
        reply_clear(&again);
    }
    pause_ms(5);
    reply_ask(t->port, shot, &target->right);
    reply_ask(t->port, shot, &again);
    target->volatile_ = target->right.status && !reply_is(&target->right, &again);
    if (target->volatile_) {
        reply_mask(&target->right);
        reply_mask(&again);
    }
    bool well = target->right.status && reply_is(&target->right, &again);
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
    reply_ask(t->port, shot, &reply);
    bool quiet = settles(t, &target->live);
    atomic_store(&t->page->left, -1);
    bool hit = atomic_load(&t->page->hit);
    if (reply.status && target->volatile_) reply_mask(&reply);
    if (waitpid(t->pid, &status, WNOHANG) == t->pid) {
        t->pid = 0;
        fail(t, shot->name, site, is_crash(status) ? "the daemon crashed" : "the daemon ended");
    } else if (reply.hung) {
        fail(t, shot->name, site, "no answer, and the connection stays");
    } else if (reply.status && reply.status < 300 && !reply_is(&reply, &target->right)) {
        fail(t, shot->name, site, "a wrong 200");
    } else if (reply.status && !reply_is(&reply, &target->right) && reply.status < 400) {
        fail(t, shot->name, site, "neither an answer nor a refusal");
    } else if (!hit && !reply_is(&reply, &target->right)) {
        fail(t, shot->name, site, "nothing failed, and yet the answer is another one");
    } else if (!quiet && !settles(t, &target->live)) {
        char text[96];
        snprintf(text, sizeof text, "%ld blocks held, %ld before",
                 (long)atomic_load(&t->page->live), target->live);
        fail(t, shot->name, site, text);
        target->live = atomic_load(&t->page->live);
    }
    t->tally->sites += hit;
    t->tally->right += hit && reply_is(&reply, &target->right);
    t->tally->refused += hit && reply.status >= 400 && !reply_is(&reply, &target->right);
    t->tally->ended += hit && !reply.status;
    reply_clear(&reply);
    return hit;
}

static void torment(struct torture *t, const struct shot *shot)
{
    struct target target = {0};
    size_t failed = t->tally->faults, sites = t->tally->sites;
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
    printf("%s torture/%s: %zu calls failed, %.0f ms\n", t->tally->faults > failed ? "FAIL" : "ok",
           shot->name, t->tally->sites - sites, now_ms() - begin);
    fflush(stdout);
}

/* ---- Which requests --------------------------------------------------------------------------- */

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

static bool make_shot(const struct test_case *c, struct shot *shot)
{
    enum { BODY_LARGEST = 300000 };
    return shot_make(c, "Connection: close\r\n", BODY_LARGEST, shot);
}

/* Quick, and in the short form the first of its kind. */
static bool is_wanted(const struct torture *t, const struct test_case *c, bool all)
{
    const double slowest_ms = all ? 60 : 10;
    const json_t *expected = json_object_get(json_object_get(c->root, "expect"), "status");
    struct shot shot;
    struct reply reply;
    if (!make_shot(c, &shot)) return false;
    double begin = now_ms();
    for (int i = 0; i < 2; i++) {
        reply_ask(t->port, &shot, &reply);
        reply_clear(&reply);
    }
    bool wanted = now_ms() - begin < 2 * slowest_ms &&
                  (all || is_new(shot.path, &shot.body, (int)json_integer_value(expected)));
    shot_clear(&shot);
    return wanted;
}

/* Moves the cases that are wanted to the front; how many. */
static size_t choose(struct torture *t, struct cases *cases, bool all)
{
    int status;
    size_t n = 0;
    if (!start(t, -1, &status)) return 0;
    for (size_t i = 0; i < cases->count; i++) {
        const struct test_case c = cases->list[i];
        if (!is_wanted(t, &c, all)) continue;
        cases->list[i] = cases->list[n];
        cases->list[n++] = c;
    }
    stop(t);
    return n;
}

/* ---- Start and end ---------------------------------------------------------------------------- */

static size_t torment_start(struct torture *t)
{
    static const char get[] = "GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
    const struct shot shot = {.name = "start", .bytes = (char *)get, .size = sizeof get - 1};
    long site = 0;
    for (bool hit = true; hit && site < START_SITES_MAX; site++) {
        struct reply reply = {0};
        int status = 0;
        atomic_store(&t->page->hit, 0);
        bool listens = start(t, site, &status);
        hit = atomic_load(&t->page->hit);
        if (listens) {
            atomic_store(&t->page->left, -1);
            reply_ask(t->port, &shot, &reply);
            if (reply.status != 200) fail(t, "start", site, "it listens, but is not well");
            status = stop(t);
            if (status) fail(t, "start", site, "it listened, but did not end with 0");
        } else if (status == -1) {
            fail(t, "start", site, "it neither listens nor ends");
            stop(t);
        } else if (is_crash(status) || !WEXITSTATUS(status)) {
            fail(t, "start", site, "it did not end with an error");
        }
        t->tally->sites += hit;
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
        t->tally->sites += hit;
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
    if (!t->tally->faults) unlink(t->err_path);
    munmap(t->page, sizeof *t->page);
}

/* ---- Jobs -------------------------------------------------------------------------------------- */

static void torment_edges(struct torture *t)
{
    size_t starts = torment_start(t), faults = t->tally->faults;
    printf("%s torture/start: %zu calls failed\n", faults ? "FAIL" : "ok", starts);
    size_t ends = torment_end(t);
    printf("%s torture/end: %zu calls failed\n", t->tally->faults > faults ? "FAIL" : "ok", ends);
    fflush(stdout);
}

/* Job 0 takes start and end, the others the cases in turn; one that is alone takes all. */
static bool run_job(struct torture *t, const struct test_case *cases, size_t count, size_t job,
                    size_t jobs)
{
    const size_t others = jobs > 1 ? jobs - 1 : 1;
    if (!open_page(t)) return false;
    if (!job) torment_edges(t);
    for (size_t i = job ? job - 1 : jobs > 1 ? count : 0; i < count; i += others) {
        struct shot shot;
        if (!make_shot(&cases[i], &shot)) continue;
        torment(t, &shot);
        shot_clear(&shot);
    }
    if (t->pid > 0 && stop(t)) fail(t, "all", -1, "the daemon did not end with 0");
    close_page(t);
    return true;
}

static void run_jobs(struct torture *t, const struct test_case *cases, size_t count, size_t jobs)
{
    struct tally *tallies = mmap(NULL, jobs * sizeof *tallies, PROT_READ | PROT_WRITE,
                                 MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (tallies == MAP_FAILED) exit(2);
    fflush(stdout);
    for (size_t job = 0; job < jobs; job++) {
        if (fork()) continue;
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        t->tally = &tallies[job];
        _exit(run_job(t, cases, count, job, jobs) && !fflush(stdout) ? 0 : 1);
    }
    for (int status; wait(&status) > 0;) t->tally->faults += status != 0;
    for (size_t job = 0; job < jobs; job++) {
        t->tally->sites += tallies[job].sites;
        t->tally->right += tallies[job].right;
        t->tally->refused += tallies[job].refused;
        t->tally->ended += tallies[job].ended;
        t->tally->faults += tallies[job].faults;
    }
    munmap(tallies, jobs * sizeof *tallies);
}

int main(int argc, char **argv)
{
    struct tally tally = {0};
    struct torture t = {.flags = "", .tally = &tally};
    struct cases cases = {0};
    const char *dir = NULL;
    bool all = false;
    size_t jobs = 1;
    for (int i = 1; i + 1 < argc; i += 2) {
        if (!strcmp(argv[i], "--daemon")) t.program = argv[i + 1];
        if (!strcmp(argv[i], "--fault")) t.library = argv[i + 1];
        if (!strcmp(argv[i], "--cases")) dir = argv[i + 1];
        if (!strcmp(argv[i], "--flags")) t.flags = argv[i + 1];
        if (!strcmp(argv[i], "--all")) all = !strcmp(argv[i + 1], "yes");
        if (!strcmp(argv[i], "--jobs")) jobs = strtoul(argv[i + 1], NULL, 10);
    }
    if (!t.program || !t.library || !dir || !jobs || !cases_load(dir, NULL, &cases) ||
        !open_page(&t)) {
        fprintf(stderr, "usage: facet_torture --daemon PROGRAM --fault LIBRARY --cases DIR "
                        "[--all yes] [--jobs N] [--flags \"...\"]\n");
        return 2;
    }
    size_t count = choose(&t, &cases, all);
    close_page(&t);
    run_jobs(&t, cases.list, count, jobs);
    tally.faults += !count;
    printf(
        "%s torture/all: %zu calls failed one by one: %zu right answers, %zu refusals, %zu ended "
        "connections; %zu faults\n",
        tally.faults ? "FAIL" : "ok", tally.sites, tally.right, tally.refused, tally.ended,
        tally.faults);
    cases_clear(&cases);
    return tally.faults ? 1 : 0;
}
