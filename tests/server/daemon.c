#include "daemon.h"

#include "check.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { FLAGS_MAX = 32, PATH_SIZE = 512 };

double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

void sleep_ms(long ms)
{
    struct timespec t = {.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000};
    while (nanosleep(&t, &t) && errno == EINTR) {
    }
}

static void beside(const char *program, char *path)
{
    ssize_t n = readlink("/proc/self/exe", path, PATH_SIZE - 1);
    path[n < 0 ? 0 : n] = 0;
    char *slash = strrchr(path, '/');
    size_t start = slash ? (size_t)(slash + 1 - path) : 0;
    snprintf(path + start, PATH_SIZE - start, "%s", program);
}

/* Starts the program with its stdout in a pipe, whose reading end is returned. */
static int spawn(const char *program, const char *const *flags, const char *log, pid_t *pid)
{
    char path[PATH_SIZE];
    const char *arguments[FLAGS_MAX] = {program};
    int n = 1, ends[2];
    beside(program, path);
    while (flags && *flags && n < FLAGS_MAX - 1) arguments[n++] = *flags++;
    if (pipe(ends)) return -1;
    fflush(stdout);
    *pid = fork();
    if (*pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL); /* no daemon outlives a test that was killed */
        int err = open(log, O_WRONLY | O_CREAT | O_TRUNC, 0600);
        dup2(ends[1], STDOUT_FILENO);
        if (err >= 0) dup2(err, STDERR_FILENO);
        close(ends[0]);
        close(ends[1]);
        execv(path, (char *const *)arguments);
        _exit(127);
    }
    close(ends[1]);
    return ends[0];
}

bool daemon_start(struct daemon *daemon, const char *program, const char *const *flags)
{
    const char *all[FLAGS_MAX] = {"--port", "0"};
    for (int i = 0; flags && flags[i] && i < FLAGS_MAX - 3; i++) all[i + 2] = flags[i];
    snprintf(daemon->log, sizeof daemon->log, "/tmp/facetd-test-%ld.log", (long)getpid());
    int fd = spawn(program, all, daemon->log, &daemon->pid);
    FILE *out = fd < 0 ? NULL : fdopen(fd, "r");
    char line[256] = "", more[256];
    bool wants_admin = false;
    daemon->port = daemon->admin_port = 0;
    for (int i = 0; all[i]; i++) wants_admin = wants_admin || !strcmp(all[i], "--admin");
    if (out && !fgets(line, sizeof line, out)) line[0] = 0;
    while (out && wants_admin && fgets(more, sizeof more, out))
        if (sscanf(more, "admin on http://127.0.0.1:%d", &daemon->admin_port) == 1) break;
    if (out) fclose(out);
    if (sscanf(line, "listening on http://127.0.0.1:%d", &daemon->port) == 1) return true;
    check_fail(__FILE__, __LINE__, "%s said \"%s\" instead of listening", program, line);
    daemon_stop(daemon);
    return false;
}

int daemon_wait(struct daemon *daemon)
{
    int status;
    while (waitpid(daemon->pid, &status, 0) < 0)
        if (errno != EINTR) return -1;
    unlink(daemon->log);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

int daemon_stop(struct daemon *daemon)
{
    kill(daemon->pid, SIGTERM);
    return daemon_wait(daemon);
}

int daemon_run(const char *program, const char *const *flags, char *out, size_t size)
{
    struct daemon daemon;
    snprintf(daemon.log, sizeof daemon.log, "/tmp/facetd-test-run-%ld.log", (long)getpid());
    int fd = spawn(program, flags, daemon.log, &daemon.pid);
    size_t used = 0;
    ssize_t n;
    while (fd >= 0 && used + 1 < size && (n = read(fd, out + used, size - 1 - used)) > 0)
        used += (size_t)n;
    out[used] = 0;
    close(fd);
    return daemon_wait(&daemon);
}

static int connect_to(const void *address, socklen_t length, int family)
{
    const struct timeval limit = {.tv_sec = 10};
    int fd = socket(family, SOCK_STREAM, 0);
    if (fd < 0) return -1;
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
    if (!connect(fd, address, length)) return fd;
    close(fd);
    return -1;
}

int daemon_connect_port(int port)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((unsigned short)port)};
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return connect_to(&to, sizeof to, AF_INET);
}

int daemon_connect(const struct daemon *daemon)
{
    return daemon_connect_port(daemon->port);
}

int daemon_connect_path(const char *path)
{
    struct sockaddr_un to = {.sun_family = AF_UNIX};
    snprintf(to.sun_path, sizeof to.sun_path, "%s", path);
    return connect_to(&to, sizeof to, AF_UNIX);
}

static bool send_all(int fd, const char *data, size_t size)
{
    while (size) {
        ssize_t n = send(fd, data, size, MSG_NOSIGNAL);
        if (n <= 0) return false;
        data += n;
        size -= (size_t)n;
    }
    return true;
}

bool daemon_send(int fd, const char *text)
{
    return send_all(fd, text, strlen(text));
}

/* Byte by byte up to the empty line, so that what follows stays in the socket. */
static bool read_head(int fd, struct answer *answer)
{
    size_t n = 0;
    while (n < sizeof answer->head - 1) {
        if (recv(fd, answer->head + n, 1, 0) != 1) return false;
        answer->head[++n] = 0;
        if (n >= 4 && !memcmp(answer->head + n - 4, "\r\n\r\n", 4)) return true;
    }
    return false;
}

static bool read_bytes(int fd, size_t left, struct answer *answer)
{
    while (left) {
        char piece[65536];
        ssize_t n = recv(fd, piece, left < sizeof piece ? left : sizeof piece, 0);
        if (n <= 0) return false;
        size_t room = ANSWER_BODY_MAX > answer->body_size ? ANSWER_BODY_MAX - answer->body_size : 0;
        memcpy(answer->body + ANSWER_BODY_MAX - room, piece, (size_t)n < room ? (size_t)n : room);
        answer->body_size += (size_t)n;
        left -= (size_t)n;
    }
    return true;
}

/* A line of a chunked body, up to its line break. */
static bool read_line(int fd, char *line, size_t room)
{
    for (size_t n = 0; n + 1 < room; n++) {
        if (recv(fd, line + n, 1, 0) != 1) return false;
        if (line[n] == '\n') return line[n] = 0, true;
    }
    return false;
}

static bool read_body(int fd, struct answer *answer)
{
    const char *length = answer_header(answer, "Content-Length");
    const char *encoding = answer_header(answer, "Transfer-Encoding");
    if (!encoding && length && !read_bytes(fd, strtoul(length, NULL, 10), answer)) return false;
    for (size_t chunk = 1; encoding && chunk;) {
        char line[64];
        if (!read_line(fd, line, sizeof line)) return false;
        chunk = strtoul(line, NULL, 16);
        if (!read_bytes(fd, chunk, answer) || !read_line(fd, line, sizeof line)) return false;
    }
    answer->body[answer->body_size < ANSWER_BODY_MAX ? answer->body_size : ANSWER_BODY_MAX] = 0;
    return true;
}

bool daemon_read(int fd, struct answer *answer)
{
    do {
        memset(answer, 0, sizeof *answer);
        if (!read_head(fd, answer) || sscanf(answer->head, "HTTP/1.1 %d", &answer->status) != 1) {
            answer->status = 0;
            return false;
        }
    } while (answer->status == 100);
    return answer->status == 204 || answer->status == 304 || read_body(fd, answer);
}

bool daemon_ask(const struct daemon *daemon, const char *method, const char *path,
                const char *headers, const void *body, size_t size, struct answer *answer)
{
    char head[2048];
    memset(answer, 0, sizeof *answer);
    int fd = daemon_connect(daemon);
    if (fd < 0) return false;
    snprintf(head, sizeof head, "%s %s HTTP/1.1\r\nHost: x\r\nContent-Length: %zu\r\n%s\r\n",
             method, path, size, headers);
    /* An early refusal may end the sending; the answer is there all the same. */
    if (daemon_send(fd, head) && size) send_all(fd, body, size);
    bool well = daemon_read(fd, answer);
    close(fd);
    return well;
}

bool daemon_ask_over(int fd, const char *text, struct answer *answer)
{
    memset(answer, 0, sizeof *answer);
    bool well = fd >= 0 && daemon_send(fd, text) && daemon_read(fd, answer);
    if (fd >= 0) close(fd);
    return well;
}

bool daemon_get(const struct daemon *daemon, const char *path, struct answer *answer)
{
    return daemon_ask(daemon, "GET", path, "", NULL, 0, answer);
}

int daemon_post(const struct daemon *daemon, const char *path, const char *text)
{
    char request[512];
    int fd = daemon_connect(daemon);
    snprintf(request, sizeof request,
             "POST %s HTTP/1.1\r\nHost: x\r\nContent-Length: %zu\r\n\r\n%s", path, strlen(text),
             text);
    CHECK(fd >= 0 && daemon_send(fd, request));
    return fd;
}

bool daemon_ends(int fd, double ms)
{
    char piece[4096];
    double start = now_ms();
    while (recv(fd, piece, sizeof piece, 0) > 0 && now_ms() - start < ms) {
    }
    return now_ms() - start < ms;
}

const char *answer_header(const struct answer *answer, const char *name)
{
    static char value[512];
    size_t length = strlen(name);
    for (const char *line = strstr(answer->head, "\r\n"); line; line = strstr(line + 2, "\r\n")) {
        if (strncasecmp(line + 2, name, length) || line[2 + length] != ':') continue;
        const char *start = line + 3 + length + strspn(line + 3 + length, " ");
        size_t n = strcspn(start, "\r\n");
        snprintf(value, sizeof value, "%.*s", (int)n, start);
        return value;
    }
    return NULL;
}
