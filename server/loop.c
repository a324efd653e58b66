#include "loop.h"

#include "accept.h"
#include "clock.h"
#include "log.h"
#include "memory.h"
#include "systemd.h"

#include <errno.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <time.h>
#include <unistd.h>

enum {
    TICK_MS = 250,      /* how often slow clients are looked for */
    CANCEL_US = 5000000 /* how long cancelled work gets to notice */
};

enum {
    POLL_HTTP,
    POLL_SIGNAL = POLL_HTTP + HTTP_SIDES,
    POLL_POOL,
    POLL_LISTEN,
    POLL_MIN = POLL_LISTEN + LISTEN_MAX
};

struct loop {
    struct http *http;
    struct pool *pool;
    const struct options *options;
    struct acceptor acceptor;
    int signal_fd;
    bool draining, cancelled, lingering;
    int64_t reap_us, drained_us; /* when to reap next; when the time to drain is over */
    struct pollfd fds[];
};

int loop_signals(void)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGHUP);
    const struct sigaction ignore = {.sa_handler = SIG_IGN};
    int fd = -1;
    if (sigaction(SIGPIPE, &ignore, NULL) || sigprocmask(SIG_BLOCK, &set, NULL) ||
        (fd = signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK)) < 0)
        fprintf(stderr, "facetd: cannot set up signals: %s\n", strerror(errno));
    return fd;
}

static void drain(struct loop *loop, unsigned signal)
{
    log_line("event=drain signal=%u active=%zu connections=%zu", signal, http_active(loop->http),
             http_connections(loop->http));
    systemd_notify("STOPPING=1");
    loop->draining = true;
    loop->drained_us = clock_us() + (int64_t)loop->options->drain * 1000000;
    listeners_close(loop->acceptor.listeners);
    http_quiesce(loop->http);
}

static void on_signal(struct loop *loop)
{
    struct signalfd_siginfo info;
    while (read(loop->signal_fd, &info, sizeof info) == sizeof info) {
        /* There is no file to read again.  But who closes a terminal wants its programs to end. */
        if (info.ssi_signo == SIGHUP && !isatty(STDIN_FILENO)) {
            log_line("event=hangup reason=\"ignored\"");
        } else if (loop->draining) {
            log_line("event=killed signal=%u", info.ssi_signo);
            log_flush();
            _exit(128 + (int)info.ssi_signo);
        } else {
            drain(loop, info.ssi_signo);
        }
    }
}

static int timeout_ms(const struct loop *loop)
{
    int ms = http_timeout_ms(loop->http);
    const bool tick = http_connections(loop->http) || loop->lingering || loop->draining ||
                      loop->acceptor.paused || memory_is_kept();
    return tick && (ms < 0 || ms > TICK_MS) ? TICK_MS : ms;
}

static void tick(struct loop *loop)
{
    int64_t now = clock_us();
    if (now < loop->reap_us) return;
    loop->reap_us = now + TICK_MS * 1000;
    http_reap(loop->http);
    loop->lingering = accept_tick(&loop->acceptor) > 0;
    memory_tick();
}

static void turn(struct loop *loop)
{
    struct http *http = loop->http;
    struct pollfd *fds = loop->fds;
    http_poll(http, fds + POLL_HTTP);
    fds[POLL_SIGNAL] = (struct pollfd){.fd = loop->signal_fd, .events = POLLIN};
    fds[POLL_POOL] = (struct pollfd){.fd = pool_fd(loop->pool), .events = POLLIN};
    const size_t listening = accept_watch(&loop->acceptor, fds + POLL_LISTEN),
                 first = POLL_LISTEN + listening, watched = http_watch(http, fds + first);
    if (poll(fds, first + watched, timeout_ms(loop)) < 0) {
        const struct timespec pause = {.tv_nsec = 1000000};
        if (errno == EINTR) return;
        log_line("event=failure call=poll reason=\"%s\"", strerror(errno));
        log_flush();
        nanosleep(&pause, NULL); /* ENOMEM is the only honest reason, and it passes */
        return;
    }
    http_watched(http, fds + first, watched);
    /* At every tick as well: should the workers' wake-up fail, a request waits that long at most. */
    if (fds[POLL_POOL].revents || clock_us() >= loop->reap_us) http_collect(http);
    accept_watched(&loop->acceptor, fds + POLL_LISTEN, listening);
    if (fds[POLL_SIGNAL].revents) on_signal(loop);
    http_turn(http, fds + POLL_HTTP);
    tick(loop);
    log_flush();
}

/* True when the daemon may end. */
static bool drained(struct loop *loop)
{
    if (!loop->draining) return false;
    if (!http_active(loop->http) && !pool_pending(loop->pool)) return true;
    int64_t now = clock_us();
    if (now < loop->drained_us) return false;
    if (loop->cancelled) {
        log_line("event=killed reason=\"work does not stop\" pending=%u", pool_pending(loop->pool));
        log_flush();
        _exit(1); /* a thread that runs cannot be freed from under itself */
    }
    log_line("event=cut active=%zu reason=\"the time to drain is over\"", http_active(loop->http));
    loop->cancelled = true;
    loop->drained_us = now + CANCEL_US;
    http_cancel(loop->http);
    return false;
}

struct loop *loop_create(struct http *http, struct pool *pool, struct listeners *listeners,
                         int signal_fd, const struct options *options)
{
    const size_t fds = POLL_MIN + (size_t)(options->workers + options->queue);
    struct loop *loop = calloc(1, sizeof *loop + fds * sizeof *loop->fds);
    if (!loop) {
        fputs("facetd: out of memory\n", stderr);
        return NULL;
    }
    loop->http = http;
    loop->pool = pool;
    loop->options = options;
    loop->signal_fd = signal_fd;
    loop->acceptor = (struct acceptor){.http = http, .listeners = listeners};
    return loop;
}

bool loop_run(struct loop *loop)
{
    while (!drained(loop)) turn(loop);
    accept_end(&loop->acceptor);
    return !loop->cancelled;
}

void loop_destroy(struct loop *loop)
{
    free(loop);
}
