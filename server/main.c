/*
 * facetd - microfacet BRDFs over HTTP.
 */
#include "api.h"
#include "health.h"
#include "http.h"
#include "listen.h"
#include "log.h"
#include "loop.h"
#include "options.h"
#include "pool.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

enum { EXIT_USAGE = 2, URL_MAX = 96, SPARE_DESCRIPTORS = 32 };

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
    const rlim_t spare = LISTEN_LINGER_MAX + SPARE_DESCRIPTORS;
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

static bool announce(int listen_fd)
{
    char url[URL_MAX];
    if (!listen_url(listen_fd, url, sizeof url)) return false;
    printf("listening on %s\n", url);
    if (fflush(stdout)) {
        fprintf(stderr, "facetd: stdout: %s\n", strerror(errno));
        return false;
    }
    log_line("event=start url=%s version=%s", url, FACET_VERSION);
    log_flush();
    return true;
}

/* Owns nothing but what it starts; the exit code. */
static int serve(const struct options *options, int signal_fd)
{
    struct pool *pool = pool_create((unsigned)options->workers, (unsigned)options->queue);
    if (!pool) {
        fprintf(stderr, "facetd: cannot start %ld workers: %s\n", options->workers,
                strerror(errno));
        return 1;
    }
    int result = -1;
    int listen_fd = listen_open(options->bind, (unsigned short)options->port);
    struct http *http = listen_fd < 0 ? NULL : http_create(options, listen_fd, pool);
    if (http && announce(listen_fd)) {
        result = loop_run(http, pool, signal_fd, options);
        log_line("event=stop clean=%s", result ? "no" : "yes");
        log_flush();
    }
    http_destroy(http);
    pool_destroy(pool);
    return result ? 1 : 0;
}

int main(int argc, char **argv)
{
    struct options options;
    switch (options_read(argc, argv, &options)) {
    case OPTIONS_BAD:
        return EXIT_USAGE;
    case OPTIONS_DONE:
        return 0;
    case OPTIONS_HEALTHCHECK:
        return health_check(&options);
    case OPTIONS_SERVE:
        break;
    }
    choose_workers(&options);
    log_open(options.log);
    if (!reserve_descriptors(&options)) return 1;
    int signal_fd = loop_signals(); /* before any thread, so that all inherit the mask */
    if (signal_fd < 0) return 1;
    if (!api_open()) {
        fputs("facetd: out of memory\n", stderr);
        close(signal_fd);
        return 1;
    }
    int result = serve(&options, signal_fd);
    api_close();
    close(signal_fd);
    return result;
}
