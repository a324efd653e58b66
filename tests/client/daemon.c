#include "daemon.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { START_SECONDS = 20, STOP_SECONDS = 30 };

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Its output goes to a file, so that a talkative daemon never blocks on a full pipe. */
static bool find_url(const char *path, const char *what, char *url, size_t size)
{
    char line[1024];
    bool found = false;
    const size_t length = strlen(what);
    FILE *f = fopen(path, "r");
    while (f && !found && fgets(line, sizeof line, f)) {
        const char *at = line + length;
        if (strncmp(line, what, length) || strncmp(at, "http://", 7) || !strchr(line, '\n'))
            continue;
        size_t n = strlen("http://") + strcspn(at + strlen("http://"), " \r\n/");
        if (n >= size) n = size - 1;
        memcpy(url, at, n);
        url[n] = 0;
        found = true;
    }
    if (f) fclose(f);
    return found;
}

bool daemon_start(const char *program, struct daemon *daemon)
{
    char path[] = "/tmp/facetd-test-XXXXXX", admin[sizeof daemon->url];
    int out = mkstemp(path);
    memset(daemon, 0, sizeof *daemon);
    if (out < 0) return false;
    daemon->pid = fork();
    if (daemon->pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGTERM); /* no daemon outlives a harness that was killed */
        dup2(out, 1);
        dup2(open("/dev/null", O_RDONLY), 0);
        const char *log = getenv(
            "FACET_DAEMON_LOG"); /* its stderr: sanitizer reports, request log */
        int err = log ? open(log, O_WRONLY | O_CREAT | O_APPEND, 0644) : -1;
        dup2(err >= 0 ? err : open("/dev/null", O_WRONLY), 2);
        execl(program, program, "--port", "0", (char *)NULL);
        _exit(127);
    }
    close(out);
    bool ready = false;
    for (double end = now() + START_SECONDS; daemon->pid > 0 && !ready && now() < end;) {
        ready = find_url(path, "listening on ", daemon->url, sizeof daemon->url);
        if (!ready && waitpid(daemon->pid, NULL, WNOHANG) == daemon->pid) daemon->pid = 0;
        if (!ready) poll(NULL, 0, 20);
    }
    if (find_url(path, "admin on ", admin, sizeof admin))
        daemon->admin_port = atoi(strrchr(admin, ':') + 1);
    unlink(path);
    if (!ready) {
        fprintf(stderr, "%s did not say \"listening on\"\n", program);
        if (daemon->pid > 0) daemon_stop(daemon);
    }
    return ready;
}

size_t daemon_resident(const struct daemon *daemon)
{
    char path[64];
    unsigned long pages = 0;
    snprintf(path, sizeof path, "/proc/%ld/statm", (long)daemon->pid);
    FILE *f = fopen(path, "r");
    if (!f) return 0;
    if (fscanf(f, "%*u %lu", &pages) != 1) pages = 0;
    fclose(f);
    return pages * (size_t)sysconf(_SC_PAGESIZE) / 1024;
}

int daemon_stop(struct daemon *daemon)
{
    int status = 0, result = -1;
    pid_t pid = daemon->pid, ended = 0;
    if (pid <= 0) return -1;
    daemon->pid = 0;
    kill(pid, SIGTERM);
    for (double end = now() + STOP_SECONDS; now() < end && !ended;) {
        ended = waitpid(pid, &status, WNOHANG);
        if (!ended) poll(NULL, 0, 10);
    }
    if (ended == pid) {
        if (WIFEXITED(status)) result = WEXITSTATUS(status);
        if (WIFSIGNALED(status)) result = 128 + WTERMSIG(status);
    } else {
        kill(pid, SIGKILL);
        waitpid(pid, &status, 0);
    }
    return result;
}
