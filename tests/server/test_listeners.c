/* Where the daemon listens: unix socket, sockets passed by systemd, the admin listener. */
#include "check.h"
#include "daemon.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#define FAKE "facetd-fake"
#define GET(path) "GET " path " HTTP/1.1\r\nHost: x\r\n\r\n"

static struct answer answer; /* large; each test fills it anew */

static const char *a_path(const char *name)
{
    static char path[64];
    snprintf(path, sizeof path, "/tmp/facetd-test-%ld-%s", (long)getpid(), name);
    return path;
}

TEST(a_unix_socket_serves_and_is_removed)
{
    struct daemon daemon;
    const char *path = a_path("s");
    char out[64];
    if (!daemon_start(&daemon, FAKE, FLAGS("--socket", path))) return;
    CHECK(daemon_ask_over(daemon_connect_path(path), GET("/healthz"), &answer));
    CHECK_INT(answer.status, 200);
    CHECK_INT(daemon_run(FAKE, FLAGS("--healthcheck", "--bind=", "--socket", path), out, 64), 0);
    CHECK_INT(daemon_run(FAKE, FLAGS("--port=0", "--socket", path), out, 64), 1); /* it is taken */
    CHECK_INT(daemon_stop(&daemon), 0);
    CHECK_INT(access(path, F_OK), -1);
}

TEST(a_socket_left_by_a_killed_daemon_is_taken_over)
{
    struct daemon daemon;
    const char *path = a_path("s");
    if (!daemon_start(&daemon, FAKE, FLAGS("--socket", path))) return;
    kill(daemon.pid, SIGKILL);
    daemon_wait(&daemon);
    CHECK_INT(access(path, F_OK), 0);
    if (!daemon_start(&daemon, FAKE, FLAGS("--socket", path))) return;
    CHECK(daemon_ask_over(daemon_connect_path(path), GET("/healthz"), &answer));
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(a_file_in_the_way_stays)
{
    char out[64];
    const char *path = a_path("f");
    int fd = open(path, O_CREAT | O_WRONLY, 0600);
    CHECK(fd >= 0);
    close(fd);
    CHECK_INT(daemon_run(FAKE, FLAGS("--port=0", "--socket", path), out, sizeof out), 1);
    CHECK_INT(unlink(path), 0);
}

TEST(nowhere_to_listen_is_an_error)
{
    char out[64];
    CHECK_INT(daemon_run(FAKE, FLAGS("--bind="), out, sizeof out), 1);
    CHECK_INT(daemon_run(FAKE, FLAGS("--port=0", "--bind=localhost"), out, sizeof out), 1);
    CHECK_INT(daemon_run(FAKE, FLAGS("--port=0", "--admin", "9080"), out, sizeof out), 1);
    CHECK_INT(daemon_run(FAKE, FLAGS("--port=0", "--admin", "::1:9080"), out, sizeof out), 1);
}

/* As systemd does it: descriptors from 3 on, and the variables that name them. */
static pid_t start_with_sockets(int main_fd, int admin_fd)
{
    pid_t pid = fork();
    if (pid) return pid;
    char path[512], number[16];
    ssize_t n = readlink("/proc/self/exe", path, sizeof path - 1);
    path[n < 0 ? 0 : n] = 0;
    *(strrchr(path, '/') + 1) = 0;
    strncat(path, FAKE, sizeof path - strlen(path) - 1);
    const int a = fcntl(main_fd, F_DUPFD, 10), b = fcntl(admin_fd, F_DUPFD, 10);
    dup2(a, 3);
    dup2(b, 4);
    snprintf(number, sizeof number, "%ld", (long)getpid());
    setenv("LISTEN_PID", number, 1);
    setenv("LISTEN_FDS", "2", 1);
    setenv("LISTEN_FDNAMES", "facetd.socket:admin", 1);
    int null = open("/dev/null", O_WRONLY);
    dup2(null, STDOUT_FILENO);
    dup2(null, STDERR_FILENO);
    execl(path, FAKE, (char *)NULL);
    _exit(127);
}

static int listening_socket(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    CHECK(fd >= 0 && !bind(fd, (struct sockaddr *)&address, sizeof address) && !listen(fd, 16));
    return fd;
}

TEST(sockets_of_systemd_are_taken)
{
    char main_path[64], admin_path[64];
    int status;
    snprintf(main_path, sizeof main_path, "%s", a_path("m"));
    snprintf(admin_path, sizeof admin_path, "%s", a_path("a"));
    int main_fd = listening_socket(main_path), admin_fd = listening_socket(admin_path);
    pid_t pid = start_with_sockets(main_fd, admin_fd);
    /* The backlog holds the client until the daemon is there. */
    CHECK(daemon_ask_over(daemon_connect_path(main_path), GET("/healthz"), &answer));
    CHECK_INT(answer.status, 200);
    CHECK(daemon_ask_over(daemon_connect_path(admin_path), GET("/readyz"), &answer));
    CHECK_INT(answer.status, 200);
    kill(pid, SIGTERM);
    CHECK_INT(waitpid(pid, &status, 0), pid);
    CHECK_INT(status, 0);
    CHECK_INT(access(main_path, F_OK), 0); /* systemd's, not ours to remove */
    close(main_fd);
    close(admin_fd);
    unlink(main_path);
    unlink(admin_path);
}

TEST(systemd_hears_that_it_is_ready)
{
    struct daemon daemon;
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    char said[64] = "";
    const char *path = a_path("n");
    const struct timeval limit = {.tv_sec = 10};
    int fd = socket(AF_UNIX, SOCK_DGRAM, 0);
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    CHECK(!bind(fd, (struct sockaddr *)&address, sizeof address));
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    setenv("NOTIFY_SOCKET", path, 1);
    bool well = daemon_start(&daemon, FAKE, NULL);
    unsetenv("NOTIFY_SOCKET");
    CHECK(recv(fd, said, sizeof said - 1, 0) > 0);
    CHECK_STR(said, "READY=1");
    if (well) CHECK_INT(daemon_stop(&daemon), 0);
    memset(said, 0, sizeof said);
    CHECK(recv(fd, said, sizeof said - 1, 0) > 0);
    CHECK_STR(said, "STOPPING=1");
    close(fd);
    unlink(path);
}

TEST(the_admin_listener_serves_probes_and_nothing_else)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, FLAGS("--admin", "127.0.0.1:0", "--token", "secret"))) return;
    static const struct {
        const char *request;
        int status;
    } asked[] = {
        {GET("/healthz"), 200},
        {GET("/readyz"), 200},
        {GET("/metrics"), 200},
        {GET("/v1/document"), 404},
        {"POST /spin?ms=1 HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\n\r\nx", 404},
        {"POST /metrics HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\n\r\nx", 405},
    };
    for (size_t i = 0; i < sizeof asked / sizeof *asked; i++) {
        CHECK(daemon_ask_over(daemon_connect_port(daemon.admin_port), asked[i].request, &answer));
        if (answer.status != asked[i].status)
            check_fail(__FILE__, __LINE__, "%s gives %d", asked[i].request, answer.status);
    }
    CHECK_INT(daemon_stop(&daemon), 0);
}

TEST(readyz_says_when_the_queue_is_full_and_while_it_drains)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE,
                      FLAGS("--admin", "127.0.0.1:0", "--workers", "1", "--queue", "1")))
        return;
    int running = daemon_post(&daemon, "/spin?ms=700", "x"),
        queued = daemon_post(&daemon, "/spin?ms=1", "x");
    sleep_ms(100);
    CHECK(daemon_get(&daemon, "/readyz", &answer));
    CHECK_INT(answer.status, 503);
    CHECK(daemon_get(&daemon, "/healthz", &answer));
    CHECK_INT(answer.status, 200);
    kill(daemon.pid, SIGTERM);
    sleep_ms(100);
    CHECK(daemon_ask_over(daemon_connect_port(daemon.admin_port), GET("/readyz"), &answer));
    CHECK_INT(answer.status, 503);
    CHECK(strstr(answer.body, "draining"));
    CHECK(daemon_ask_over(daemon_connect_port(daemon.admin_port), GET("/healthz"), &answer));
    CHECK_INT(answer.status, 200);
    CHECK(daemon_read(running, &answer) && daemon_read(queued, &answer));
    CHECK_INT(daemon_wait(&daemon), 0);
    close(running);
    close(queued);
}

TEST(admin_answers_while_tricklers_hold_every_connection)
{
    enum { TRICKLERS = 1000, ASKED = 200 };
    static int fds[TRICKLERS];
    static double ms[ASKED];
    struct daemon daemon;
    int open_count = 0;
    if (!daemon_start(&daemon, FAKE, FLAGS("--admin", "127.0.0.1:0", "--log", "none"))) return;
    while (open_count < TRICKLERS && (fds[open_count] = daemon_connect(&daemon)) >= 0)
        daemon_send(fds[open_count++], "GET /healthz HTTP/1.1\r\nX: ");
    double p99 = 0;
    for (int i = 0; i < ASKED; i++) {
        for (int k = i % 10; k < open_count; k += 10) send(fds[k], "a", 1, MSG_NOSIGNAL);
        double start = now_ms();
        CHECK(daemon_ask_over(daemon_connect_port(daemon.admin_port), GET("/metrics"), &answer));
        CHECK_INT(answer.status, 200);
        ms[i] = now_ms() - start;
    }
    for (int rank = 0; rank < 3; rank++) { /* the third largest of 200 */
        int worst = 0;
        for (int i = 0; i < ASKED; i++)
            if (ms[i] > ms[worst]) worst = i;
        p99 = ms[worst];
        ms[worst] = 0;
    }
    check_note("tricklers", open_count);
    check_note("admin_ms_p99", p99);
    CHECK(open_count > TRICKLERS / 2);
    for (int i = 0; i < open_count; i++) close(fds[i]);
    CHECK_INT(daemon_stop(&daemon), 0);
}

/* The checks of promtool, where Debian's prometheus is installed. */
static int promtool(const char *text, size_t size)
{
    FILE *f = popen("promtool check metrics >/dev/null", "w");
    if (!f) return -1;
    fwrite(text, 1, size, f);
    int status = pclose(f);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(metrics_count_and_promtool_accepts_them)
{
    struct daemon daemon;
    if (!daemon_start(&daemon, FAKE, NULL)) return;
    CHECK(daemon_get(&daemon, "/healthz", &answer));
    CHECK(daemon_ask(&daemon, "POST", "/spin?ms=30", "", "xyz", 3, &answer));
    CHECK(daemon_get(&daemon, "/not/here", &answer));
    CHECK(daemon_get(&daemon, "/metrics", &answer));
    CHECK_INT(answer.status, 200);
    CHECK(answer.body_size < ANSWER_BODY_MAX);
    static const char *const lines[] = {
        "\nfacetd_requests_total{path=\"/healthz\",code=\"200\"} 1\n",
        "\nfacetd_requests_total{path=\"/spin\",code=\"200\"} 1\n",
        "\nfacetd_requests_total{path=\"other\",code=\"404\"} 1\n",
        "\nfacetd_evaluations_total{tier=\"fake\"} ",
        "\nfacetd_request_duration_seconds_bucket{path=\"/spin\",le=\"0.025\"} 0\n",
        "\nfacetd_request_duration_seconds_count{path=\"/spin\"} 1\n",
        "\nfacetd_queue_duration_seconds_count 1\n",
        "\nfacetd_connections_total 4\n",
        "\nfacetd_requests_active 1\n",
        "\nfacetd_queue_depth 0\n",
        "\nfacetd_received_bytes_total 3\n",
        "\nprocess_resident_memory_bytes ",
    };
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
        if (!strstr(answer.body, lines[i]))
            check_fail(__FILE__, __LINE__, "no %s in\n%s", lines[i], answer.body);
    CHECK_INT(daemon_stop(&daemon), 0);
    int accepted = promtool(answer.body, answer.body_size);
    if (accepted == 127)
        check_skip("no promtool (Debian's prometheus) to check the text with");
    else
        CHECK_INT(accepted, 0);
}
