/* What the daemon can no longer do once it serves. */
#define _GNU_SOURCE /* syscall */
#include "check.h"
#include "daemon.h"

#include "../../server/urgent.h"

#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <unistd.h>

#define FAKE "facetd-fake"

static struct answer answer; /* large; each test fills it anew */

/* How many threads of the daemon have a line `word` = value in their status, and how many there are. */
static int threads_with(const struct daemon *daemon, const char *format, int value, int *all)
{
    char path[96], line[256];
    int found = 0, number;
    *all = 0;
    snprintf(path, sizeof path, "/proc/%ld/task", (long)daemon->pid);
    DIR *dir = opendir(path);
    for (struct dirent *e; dir && (e = readdir(dir));) {
        if (e->d_name[0] == '.') continue;
        snprintf(path, sizeof path, "/proc/%ld/task/%.16s/status", (long)daemon->pid, e->d_name);
        FILE *f = fopen(path, "r");
        while (f && fgets(line, sizeof line, f))
            found += sscanf(line, format, &number) == 1 && number == value;
        if (f) fclose(f);
        ++*all;
    }
    if (dir) closedir(dir);
    return found;
}

TEST(what_serving_does_not_need_is_refused)
{
    struct daemon daemon;
    int all;
    if (SANITIZED) {
        check_skip("built with a sanitizer, which the sandbox would stop");
        return;
    }
    if (!daemon_start(&daemon, FAKE, FLAGS("--sandbox=off"))) return;
    CHECK(daemon_get(&daemon, "/forbidden", &answer));
    CHECK_STR(answer.body, "open write socket fork mmap access ");
    CHECK_INT(daemon_stop(&daemon), 0);

    if (!daemon_start(&daemon, FAKE,
                      FLAGS("--sandbox=on", "--admin", "127.0.0.1:0", "--workers=2")))
        return;
    CHECK(daemon_get(&daemon, "/forbidden", &answer));
    CHECK_STR(answer.body, "");
    CHECK_INT(threads_with(&daemon, "Seccomp: %d", 2, &all), all);
    CHECK_INT(all, 4); /* two workers, admin, network */
    CHECK_INT(threads_with(&daemon, "NoNewPrivs: %d", 1, &all), all);
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* Threads that have the slice of urgent_thread; the kernel tells it since 6.12. */
static int urgent_threads(const struct daemon *daemon)
{
    char path[64];
    int found = 0;
    snprintf(path, sizeof path, "/proc/%ld/task", (long)daemon->pid);
    DIR *dir = opendir(path);
    for (struct dirent *e; dir && (e = readdir(dir));) {
        uint64_t attributes[6] = {
            0}; /* struct sched_attr, version 0: the fourth is sched_runtime */
        long tid = strtol(e->d_name, NULL, 10);
        if (tid > 0 && !syscall(SYS_sched_getattr, tid, attributes, sizeof attributes, 0))
            found += attributes[3] == URGENT_SLICE_NS;
    }
    if (dir) closedir(dir);
    return found;
}

/* What the sandbox refuses must have been asked before: a thread that starts late asks in vain. */
TEST(network_threads_are_urgent_before_the_sandbox_closes)
{
    enum { STARTS = 20, NETWORK_THREADS = 2 };
    struct daemon daemon;
    int urgent = 0;
    if (SANITIZED) {
        check_skip("built with a sanitizer, which the sandbox would stop");
        return;
    }
    if (!daemon_start(&daemon, FAKE, FLAGS("--sandbox=off", "--admin", "127.0.0.1:0"))) return;
    bool is_told = urgent_threads(&daemon) > 0;
    CHECK_INT(daemon_stop(&daemon), 0);
    if (!is_told) {
        check_skip("this kernel does not tell a thread's slice");
        return;
    }
    for (int i = 0; i < STARTS; i++) {
        if (!daemon_start(&daemon, FAKE, FLAGS("--sandbox=on", "--admin", "127.0.0.1:0"))) return;
        urgent += urgent_threads(&daemon);
        CHECK_INT(daemon_stop(&daemon), 0);
    }
    CHECK_INT(urgent, NETWORK_THREADS * STARTS);
}

TEST(the_log_says_what_the_sandbox_is)
{
    struct daemon daemon;
    size_t size;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK(daemon_get(&daemon, "/healthz", &answer));
    char *log = check_read_file(daemon.log, &size);
    CHECK(log && strstr(log, "event=sandbox part=landlock state="));
    CHECK(log && strstr(log, "event=sandbox part=seccomp state="));
    free(log);
    CHECK_INT(daemon_stop(&daemon), 0);
}
