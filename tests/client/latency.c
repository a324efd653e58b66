/*
 * facet_latency - how soon the daemon answers probes when it has other things to do.
 *
 *   facet_latency --daemon PROGRAM [--asked N] [--tricklers N]
 *
 * GET /healthz on a connection of its own, N times (1000), while every worker fits and more wait; then
 * of the admin listener, while so many tricklers (1000) send a byte in turn and the workers fit as
 * before.  Each question is also put to a bare server in a process of its own, which answers as soon as
 * it gets the processor: what its clients wait, nobody on this machine can do without.
 */
#include "daemon.h"
#include "shot.h"

#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { ASKED_MAX = 100000, TRICKLERS_MAX = 20000, BUSY = 6 };

static const char get[] = "GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* ---- The yardstick ------------------------------------------------------------------------------ */

static void serve_bare(int listener)
{
    static const char answer[] =
        "HTTP/1.1 200 OK\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
    char question[1024];
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (;;) {
        int fd = accept(listener, NULL, NULL);
        if (fd < 0) continue;
        if (recv(fd, question, sizeof question, 0) > 0)
            (void)send(fd, answer, sizeof answer - 1, MSG_NOSIGNAL);
        close(fd);
    }
}

static int start_bare(pid_t *pid)
{
    int port = 0, listener = shot_listen(&port);
    if (listener < 0) return -1;
    *pid = fork();
    if (*pid == 0) serve_bare(listener);
    close(listener);
    return port;
}

/* ---- Work for all workers ------------------------------------------------------------------------- */

struct busy {
    int port;
    atomic_bool stop;
    pthread_t threads[BUSY];
};

static void *keep_busy(void *user)
{
    static const char body[] = "{\"source\":{\"ndf\":\"ggx\",\"alpha\":0.2,\"fresnel\":"
                               "{\"schlick\":{\"f0\":[0.95,0.64,0.54]}}}}";
    struct busy *busy = user;
    char request[512], answer[65536];
    snprintf(
        request, sizeof request,
        "POST /v1/fit HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Length: %zu\r\n\r\n%s",
        sizeof body - 1, body);
    while (!atomic_load(&busy->stop)) {
        int fd = shot_connect(busy->port);
        if (fd < 0) break;
        (void)send(fd, request, strlen(request), MSG_NOSIGNAL);
        while (recv(fd, answer, sizeof answer, 0) > 0) continue;
        close(fd);
    }
    return NULL;
}

/* ---- Questions -------------------------------------------------------------------------------------- */

static double ask_ms(int port)
{
    char answer[4096];
    double begun = now_ms();
    int fd = shot_connect(port);
    bool well = fd >= 0 && send(fd, get, sizeof get - 1, MSG_NOSIGNAL) > 0 &&
                recv(fd, answer, sizeof answer, 0) > 12 && !memcmp(answer + 9, "200", 3);
    if (fd >= 0) close(fd);
    return well ? now_ms() - begun : -1;
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Asks the daemon and the bare server in turns; prints both.  False: an answer was wrong or none. */
static bool measure(const char *name, int port, int bare, const int *tricklers, int trickler_count,
                    int asked)
{
    static double ms[2][ASKED_MAX];
    for (int i = 0; i < asked; i++) {
        for (int k = i % 50; k < trickler_count; k += 50) send(tricklers[k], "a", 1, MSG_NOSIGNAL);
        ms[0][i] = ask_ms(port);
        ms[1][i] = ask_ms(bare);
        poll(NULL, 0, 2); /* as a probe, which comes from sleep */
    }
    bool well = true;
    for (int i = 0; i < asked; i++) well = well && ms[0][i] >= 0 && ms[1][i] >= 0;
    for (int s = 0; s < 2; s++) qsort(ms[s], (size_t)asked, sizeof ms[s][0], by_size);
    const int middle = asked / 2, late = asked * 99 / 100;
    printf(
        "%s latency/%s: %d tricklers, median %.2f ms, p99 %.2f ms; a bare server %.2f ms, %.2f ms\n",
        well ? "ok" : "FAIL", name, trickler_count, ms[0][middle], ms[0][late], ms[1][middle],
        ms[1][late]);
    fflush(stdout);
    return well;
}

static int open_tricklers(int port, int wanted, int *fds)
{
    int n = 0;
    for (; n < wanted && (fds[n] = shot_connect(port)) >= 0; n++)
        (void)send(fds[n], "GET /healthz HTTP/1.1\r\nX: ", 26, MSG_NOSIGNAL);
    return n;
}

int main(int argc, char **argv)
{
    static int tricklers[TRICKLERS_MAX];
    const char *program = NULL;
    struct daemon daemon;
    struct rlimit limit;
    long asked = 1000, wanted = 1000;
    for (int i = 1; i + 1 < argc; i += 2) {
        if (!strcmp(argv[i], "--daemon")) program = argv[i + 1];
        if (!strcmp(argv[i], "--asked")) asked = strtol(argv[i + 1], NULL, 10);
        if (!strcmp(argv[i], "--tricklers")) wanted = strtol(argv[i + 1], NULL, 10);
    }
    if (!getrlimit(RLIMIT_NOFILE, &limit)) {
        limit.rlim_cur = limit.rlim_max;
        setrlimit(RLIMIT_NOFILE, &limit);
    }
    setenv("FACETD_ADMIN", "127.0.0.1:0", 1);
    setenv("FACETD_MAX_CONNECTIONS", "30000", 1);
    setenv("FACETD_HEADER_TIMEOUT", "600", 1); /* else the reaper soon ends the tricklers */
    if (!program || asked < 1 || asked > ASKED_MAX || wanted < 0 || wanted > TRICKLERS_MAX ||
        !daemon_start(program, &daemon)) {
        fprintf(stderr, "usage: facet_latency --daemon PROGRAM [--asked N] [--tricklers N]\n");
        return 2;
    }
    pid_t bare_pid = 0;
    const int bare = start_bare(&bare_pid);
    struct busy busy = {.port = atoi(strrchr(daemon.url, ':') + 1)};
    bool well = bare > 0 && measure("idle", busy.port, bare, NULL, 0, (int)asked);
    for (int i = 0; i < BUSY; i++) pthread_create(&busy.threads[i], NULL, keep_busy, &busy);
    well = measure("health_while_all_workers_fit", busy.port, bare, NULL, 0, (int)asked) && well;
    const int count = open_tricklers(busy.port, (int)wanted, tricklers);
    well = measure("admin_among_tricklers_while_all_workers_fit", daemon.admin_port, bare,
                   tricklers, count, (int)asked) &&
           well;
    atomic_store(&busy.stop, true);
    for (int i = 0; i < BUSY; i++) pthread_join(busy.threads[i], NULL);
    well = measure("admin_among_tricklers", daemon.admin_port, bare, tricklers, count,
                   (int)asked) &&
           well;
    if (bare_pid > 0) kill(bare_pid, SIGKILL);
    for (int i = 0; i < count; i++) close(tricklers[i]);
    return !daemon_stop(&daemon) && well ? 0 : 1;
}
