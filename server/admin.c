#include "admin.h"

#include "accept.h"
#include "clock.h"
#include "http.h"
#include "log.h"
#include "urgent.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

enum { TICK_MS = 250, CONNECTIONS = 64, SECONDS = 5 };
enum { POLL_HTTP, POLL_STOP = POLL_HTTP + HTTP_SIDES, POLL_LISTEN };

struct admin {
    struct options options; /* of the daemon, with times that suit probes */
    struct http *http;
    struct acceptor acceptor;
    int stop_fd;
    pthread_t thread;
    sem_t urgent; /* the thread has asked for what the sandbox forbids later */
};

/* False when the thread shall end. */
static bool turn(struct admin *admin, int64_t *tick_us)
{
    struct pollfd fds[POLL_LISTEN + LISTEN_MAX];
    http_poll(admin->http, fds + POLL_HTTP);
    fds[POLL_STOP] = (struct pollfd){.fd = admin->stop_fd, .events = POLLIN};
    size_t listening = accept_watch(&admin->acceptor, fds + POLL_LISTEN);
    int ms = http_timeout_ms(admin->http);
    if (ms < 0 || ms > TICK_MS) ms = TICK_MS;
    if (poll(fds, POLL_LISTEN + listening, ms) < 0) {
        const struct timespec pause = {.tv_nsec = 1000000}; /* no memory in the kernel: try again */
        if (errno != EINTR) nanosleep(&pause, NULL);
        return true;
    }
    if (fds[POLL_STOP].revents) return false;
    accept_watched(&admin->acceptor, fds + POLL_LISTEN, listening);
    http_turn(admin->http, fds + POLL_HTTP);
    int64_t now = clock_us();
    if (now < *tick_us) return true;
    *tick_us = now + TICK_MS * 1000;
    http_reap(admin->http);
    accept_tick(&admin->acceptor);
    return true;
}

static void *run(void *user)
{
    struct admin *admin = user;
    int64_t tick_us = 0;
    urgent_thread();
    sem_post(&admin->urgent);
    while (turn(admin, &tick_us)) continue;
    accept_end(&admin->acceptor);
    return NULL;
}

struct admin *admin_start(const struct options *options, struct listeners *listeners)
{
    struct admin *admin = calloc(1, sizeof *admin);
    if (!admin) goto failed;
    admin->options = *options;
    admin->options.header_timeout = admin->options.timeout = SECONDS;
    admin->stop_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (admin->stop_fd < 0) goto failed;
    admin->http = http_create(&(struct http_config){
        .options = &admin->options, .site = SITE_ADMIN, .max_connections = CONNECTIONS});
    admin->acceptor = (struct acceptor){.http = admin->http, .listeners = listeners};
    if (!admin->http) goto failed;
    sem_init(&admin->urgent, 0, 0); /* fails for values and kinds that these are not */
    if (!(errno = pthread_create(&admin->thread, NULL, run, admin))) {
        while (sem_wait(&admin->urgent)) continue; /* EINTR */
        return admin;
    }
    sem_destroy(&admin->urgent);
failed:
    fprintf(stderr, "facetd: cannot start the admin listener: %s\n", strerror(errno));
    if (admin) {
        http_destroy(admin->http);
        if (admin->stop_fd >= 0) close(admin->stop_fd);
    }
    free(admin);
    return NULL;
}

void admin_stop(struct admin *admin)
{
    const uint64_t one = 1;
    if (!admin) return;
    while (write(admin->stop_fd, &one, sizeof one) < 0 && errno == EINTR) {
    }
    pthread_join(admin->thread, NULL);
    http_destroy(admin->http);
    close(admin->stop_fd);
    sem_destroy(&admin->urgent);
    free(admin);
}
