/*
 * facetd - microfacet BRDFs over HTTP.
 */
#include "accept.h"
#include "admin.h"
#include "api.h"
#include "health.h"
#include "http.h"
#include "listen.h"
#include "log.h"
#include "loop.h"
#include "memory.h"
#include "metrics.h"
#include "options.h"
#include "page.h"
#include "pool.h"
#include "sandbox.h"
#include "systemd.h"
#include "token.h"
#include "urgent.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

enum { EXIT_USAGE = 2, SPARE_DESCRIPTORS = 32, ADMIN_DESCRIPTORS = 128 };

/* One thread per CPU this process may use, when the user does not say. */
static void choose_workers(struct options *options)
{
    long cpus = sysconf(_SC_NPROCESSORS_ONLN);
    if (!options->workers) options->workers = cpus < 1 ? 1 : cpus > 256 ? 256 : cpus;
}

/*
 * Every connection needs a descriptor.  Where the system allows fewer (containers often have 1024)
 * the daemon takes fewer connections and says so: better than to learn it from a failing accept.
 */
static bool reserve_descriptors(struct options *options)
{
    const rlim_t spare = ACCEPT_LINGER_MAX + SPARE_DESCRIPTORS +
                         (*options->admin ? ADMIN_DESCRIPTORS : 0);
    rlim_t needed = (rlim_t)options->max_connections + spare;
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit)) {
        fprintf(stderr, "facetd: getrlimit: %s\n", strerror(errno));
        return false;
    }
    if (limit.rlim_cur >= needed) return true;
    rlim_t allowed = limit.rlim_max < needed ? limit.rlim_max : needed;
    limit.rlim_cur = allowed;
    if (allowed <= spare || setrlimit(RLIMIT_NOFILE, &limit)) {
        fprintf(stderr, "facetd: ulimit -n allows %llu descriptors, too few to serve\n",
                (unsigned long long)allowed);
        return false;
    }
    if (allowed < needed) {
        options->max_connections = (long)(allowed - spare);
        log_line("event=limited max_connections=%ld reason=\"ulimit -n is %llu\"",
                 options->max_connections, (unsigned long long)allowed);
    }
    return true;
}

static size_t put_name(char *to, size_t size, const char *what, const struct listener *listener)
{
    log_line("event=start %s=%s version=%s", what, listener->name, FACET_VERSION);
    int n = snprintf(to, size, "%s on %s\n", what, listener->name);
    return n < 0 ? 0 : (size_t)n;
}

/*
 * In one piece, for a reader may go after the first line; without stdio, whose printf forgets its
 * text when it gets no memory.
 */
static bool announce(const struct listeners *main_ones, const struct listeners *admin)
{
    char text[2 * LISTEN_MAX * (LISTEN_NAME_MAX + 16)];
    size_t size = 0, done = 0;
    for (size_t i = 0; i < main_ones->count; i++)
        size += put_name(text + size, sizeof text - size, "listening", &main_ones->list[i]);
    for (size_t i = 0; i < admin->count; i++)
        size += put_name(text + size, sizeof text - size, "admin", &admin->list[i]);
    while (done < size) {
        ssize_t n = write(STDOUT_FILENO, text + done, size - done);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) {
            fprintf(stderr, "facetd: stdout: %s\n", strerror(errno));
            return false;
        }
        done += (size_t)n;
    }
    log_flush();
    systemd_notify("READY=1");
    return true;
}

/* All that runs, in the order in which it begins; ends in the other. */
struct parts {
    const struct options *options;
    const char *token;
    int signal_fd;
    struct listeners main_ones, admin_ones;
    struct pool *pool;
    struct http *http;
    struct loop *loop;
    struct admin *admin;
};

static bool begin(struct parts *parts)
{
    const struct options *options = parts->options;
    if (!listeners_open(options, &parts->main_ones, &parts->admin_ones)) return false;
    if (!sandbox_files(options->sandbox, &parts->main_ones, &parts->admin_ones)) return false;
    parts->pool = pool_create((unsigned)options->workers, (unsigned)options->queue);
    if (!parts->pool) {
        fprintf(stderr, "facetd: cannot start %ld workers: %s\n", options->workers,
                strerror(errno));
        return false;
    }
    parts->http = http_create(&(struct http_config){
        .options = options,
        .pool = parts->pool,
        .token = parts->token,
        .site = SITE_MAIN,
        .max_connections = (size_t)options->max_connections,
    });
    if (!parts->http) return false;
    parts->loop = loop_create(parts->http, parts->pool, &parts->main_ones, parts->signal_fd,
                              options);
    if (!parts->loop) return false;
    if (parts->admin_ones.count && !(parts->admin = admin_start(options, &parts->admin_ones)))
        return false;
    urgent_thread(); /* after the workers, which would inherit it */
    return sandbox_calls(options->sandbox) && announce(&parts->main_ones, &parts->admin_ones);
}

/* The exit code. */
static int serve(struct parts *parts)
{
    const bool well = begin(parts);
    if (well) {
        /* To cut what outlasts --drain is to do as told, and no failure. */
        log_line("event=stop clean=%s", loop_run(parts->loop) ? "yes" : "no");
        log_flush();
    }
    admin_stop(parts->admin);
    loop_destroy(parts->loop);
    http_destroy(parts->http);
    pool_destroy(parts->pool);
    listeners_close(&parts->main_ones);
    listeners_close(&parts->admin_ones);
    return well ? 0 : 1;
}

int main(int argc, char **argv)
{
    struct options options;
    char token[TOKEN_SIZE];
    struct api_limit limits[OPTIONS_LIMITS + REQUEST_LIMITS];
    struct parts parts = {.options = &options};
    switch (options_read(argc, argv, &options)) {
    case OPTIONS_BAD: return EXIT_USAGE;
    case OPTIONS_DONE: return 0;
    case OPTIONS_HEALTHCHECK: return health_check(&options);
    case OPTIONS_SERVE: break;
    }
    if (!api_select_isa(options.isa)) {
        fprintf(
            stderr,
            "facetd: --isa: this processor does not run \"%s\"; base, avx2, avx512 or nothing\n",
            options.isa);
        return EXIT_USAGE;
    }
    memory_open();
    choose_workers(&options);
    log_open(options.log);
    if (!token_read(options.token, token, &parts.token) || !reserve_descriptors(&options)) return 1;
    parts.signal_fd = loop_signals(); /* before any thread, so that all inherit the mask */
    if (parts.signal_fd < 0) return 1;
    if (!api_open()) {
        fputs("facetd: out of memory\n", stderr);
        close(parts.signal_fd);
        return 1;
    }
    options_limits(&options, limits);
    memcpy(limits + OPTIONS_LIMITS, request_limits, sizeof request_limits);
    api_announce_limits(limits, OPTIONS_LIMITS + REQUEST_LIMITS);
    systemd_open();
    metrics_open();
    page_open(!options.no_page);
    int result = serve(&parts);
    metrics_close();
    systemd_close();
    api_close();
    close(parts.signal_fd);
    return result;
}
