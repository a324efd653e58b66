#include "loop.h"

#include "clock.h"
#include "listen.h"
#include "log.h"

#include <errno.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <unistd.h>

enum {
    TICK_MS = 250,      /* how often slow clients are looked for */
    CANCEL_US = 5000000 /* how long cancelled work gets to notice */
};

enum { POLL_HTTP, POLL_SIGNAL, POLL_POOL, POLL_LISTEN, POLL_WATCHED };

struct loop {
    struct http *http;
    struct pool *pool;
    const struct options *options;
    int signal_fd;
    bool draining, cancelled;
    int64_t reap_us, drained_us; /* when to reap next; when the time to drain is over */
    struct pollfd *fds;
};

int loop_signals(void)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    const struct sigaction ignore = {.sa_handler = SIG_IGN};
    int fd = -1;
    if (sigaction(SIGPIPE, &ignore, NULL) || sigprocmask(SIG_BLOCK, &set, NULL) ||
        (fd = signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK)) < 0)
        fprintf(stderr, "facetd: cannot set up signals: %s\n", strerror(errno));
    return fd;
}

static void on_signal(struct loop *loop)
{
    struct signalfd_siginfo info;
    while (read(loop->signal_fd, &info, sizeof info) == sizeof info) {
        if (loop->draining) {
            log_line("event=killed signal=%u", info.ssi_signo);
            log_flush();
            _exit(128 + (int)info.ssi_signo);
        }
        log_line("event=drain signal=%u active=%zu connections=%zu", info.ssi_signo,
                 http_active(loop->http), http_connections(loop->http));
        loop->draining = true;
        loop->drained_us = clock_us() + (int64_t)loop->options->drain * 1000000;
        http_quiesce(loop->http);
    }
}

static int timeout_ms(const struct loop *loop)
{
    int ms = http_timeout_ms(loop->http);
    const bool tick = http_connections(loop->http) || listen_linger(false) || loop->draining;
    return tick && (ms < 0 || ms > TICK_MS) ? TICK_MS : ms;
}

static void turn(struct loop *loop)
{
    struct http *http = loop->http;
    struct pollfd *fds = loop->fds;
    fds[POLL_HTTP] = (struct pollfd){.fd = http_fd(http), .events = POLLIN};
    fds[POLL_SIGNAL] = (struct pollfd){.fd = loop->signal_fd, .events = POLLIN};
    fds[POLL_POOL] = (struct pollfd){.fd = pool_fd(loop->pool), .events = POLLIN};
    fds[POLL_LISTEN] = (struct pollfd){.fd = http_overflow_fd(http), .events = POLLIN};
    size_t watched = http_watch(http, fds + POLL_WATCHED);
    if (poll(fds, POLL_WATCHED + watched, timeout_ms(loop)) < 0) {
        if (errno == EINTR) return;
        log_line("event=failure call=poll reason=\"%s\"", strerror(errno));
        log_flush();
        _exit(1); /* blind: the workers' requests could not even be given back */
    }
    http_watched(http, fds + POLL_WATCHED, watched);
    if (fds[POLL_POOL].revents) http_collect(http);
    if (fds[POLL_SIGNAL].revents) on_signal(loop);
    if (fds[POLL_LISTEN].revents && !loop->draining) listen_refuse(fds[POLL_LISTEN].fd);
    http_turn(http);
    int64_t now = clock_us();
    if (now >= loop->reap_us) {
        loop->reap_us = now + TICK_MS * 1000;
        http_reap(http);
    }
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

int loop_run(struct http *http, struct pool *pool, int signal_fd, const struct options *options)
{
    struct loop loop = {.http = http, .pool = pool, .options = options, .signal_fd = signal_fd};
    loop.fds = calloc(POLL_WATCHED + (size_t)(options->workers + options->queue), sizeof *loop.fds);
    if (!loop.fds) {
        log_line("event=failure call=calloc reason=\"out of memory\"");
        return -1;
    }
    while (!drained(&loop)) turn(&loop);
    listen_linger(true);
    free(loop.fds);
    return loop.cancelled;
}
