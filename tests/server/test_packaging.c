/* The unit file and the nginx example, as far as they can be tried without systemd as process 1. */
#include "check.h"
#include "daemon.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#define FAKE "facetd-fake"

static struct answer answer;

/* The command's exit code; its output, cut to the buffer, in `out`. */
static int run(const char *command, char *out, size_t size)
{
    size_t used = 0, n;
    FILE *f = popen(command, "r");
    if (!f) return -1;
    while (used + 1 < size && (n = fread(out + used, 1, size - 1 - used, f)) > 0) used += n;
    out[used] = 0;
    int status = pclose(f);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(the_unit_is_hardened)
{
    static char out[65536];
    double exposure = 10;
    if (run("systemd-analyze security --offline=yes server/facetd.service 2>&1", out, sizeof out) ==
        127) {
        check_skip("no systemd-analyze");
        return;
    }
    const char *found = strstr(out, "Overall exposure level for facetd.service: ");
    if (!found) {
        check_skip("this systemd-analyze judges no file (needs version 250)");
        return;
    }
    sscanf(found, "Overall exposure level for facetd.service: %lf", &exposure);
    check_note("exposure", exposure);
    CHECK(exposure <= 1.5);
}

TEST(the_units_are_understood)
{
    static char out[65536];
    /* Its complaint that the binary is not installed is not about the file. */
    int status = run("systemd-analyze verify server/facetd.service server/facetd.socket 2>&1 | "
                     "grep -E '^/.*(facetd.service|facetd.socket):[0-9]+:'",
                     out, sizeof out);
    CHECK(status == 1 || status == 127);
    CHECK_STR(out, "");
}

/* ---- nginx in front ------------------------------------------------------------------------- */

/* server/nginx.conf with the words between @ put in, inside a whole configuration. */
static bool write_configuration(const char *dir, int port)
{
    char command[2048], out[256];
    snprintf(command, sizeof command,
             "{ echo '%sdaemon off; worker_processes 1; error_log %s/error.log; pid %s/pid; "
             "events {} http { access_log off; client_body_temp_path %s/b; proxy_temp_path %s/p; "
             "fastcgi_temp_path %s/f; uwsgi_temp_path %s/u; scgi_temp_path %s/s;'; "
             "sed -e 's|@SOCKET@|%s/facetd.sock|; s|@LISTEN@|127.0.0.1:%d|; "
             "s|@CERTIFICATE@|%s/cert.pem|; s|@KEY@|%s/key.pem|' server/nginx.conf; echo '}'; } "
             ">%s/nginx.conf && openssl req -x509 -newkey rsa:2048 -nodes -subj /CN=localhost "
             "-days 2 -keyout %s/key.pem -out %s/cert.pem 2>/dev/null",
             getuid() ? "" : "user root; ", dir, dir, dir, dir, dir, dir, dir, dir, port, dir, dir,
             dir, dir, dir);
    return run(command, out, sizeof out) == 0;
}

static pid_t start_nginx(const char *dir)
{
    char path[128];
    snprintf(path, sizeof path, "%s/nginx.conf", dir);
    pid_t pid = fork();
    if (pid) return pid;
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    execl("/usr/sbin/nginx", "nginx", "-p", dir, "-c", path, "-e", "/dev/null", (char *)NULL);
    _exit(127);
}

static void ask_over_tls(const char *dir, int port)
{
    static char out[65536];
    char command[512];
    snprintf(command, sizeof command,
             "curl -sS --max-time 10 --cacert %s/cert.pem --resolve localhost:%d:127.0.0.1 -D - "
             "https://localhost:%d/v1/document -w '%%{ssl_verify_result}' 2>&1",
             dir, port, port);
    CHECK_INT(run(command, out, sizeof out), 0);
    CHECK(strstr(out, " 200") && strstr(out, "a document0"));
    CHECK(strstr(out, "X-Request-Id: ") && strstr(out, "ETag: "));
    snprintf(command, sizeof command,
             "head -c 1000000 /dev/zero | curl -sS --max-time 10 -k --data-binary @- "
             "https://127.0.0.1:%d/echo 2>&1 | wc -c",
             port);
    CHECK_INT(run(command, out, sizeof out), 0);
    CHECK_INT(atoi(out), 1000000);
    snprintf(command, sizeof command,
             "curl -sk --max-time 10 -o /dev/null -w '%%{http_code}' https://127.0.0.1:%d/metrics",
             port);
    CHECK_INT(run(command, out, sizeof out), 0);
    CHECK_STR(out, "404");
}

TEST(nginx_in_front_speaks_tls)
{
    char dir[] = "/tmp/facetd-test-tls-XXXXXX", command[128], path[96], out[64];
    struct daemon daemon, other;
    int fd = -1, status;
    if (access("/usr/sbin/nginx", X_OK) || system("command -v openssl curl >/dev/null")) {
        check_skip("nginx, openssl or curl is not installed (make test-extras)");
        return;
    }
    /* A port that was free a moment ago. */
    if (!mkdtemp(dir) || !daemon_start(&other, FAKE, NULL)) return;
    daemon_stop(&other);
    snprintf(path, sizeof path, "%s/facetd.sock", dir);
    if (!daemon_start(&daemon, FAKE, FLAGS("--socket", path))) return;
    CHECK(write_configuration(dir, other.port));
    pid_t pid = start_nginx(dir);
    for (int i = 0; i < 100 && (fd = daemon_connect_port(other.port)) < 0; i++) sleep_ms(50);
    CHECK(fd >= 0);
    if (fd >= 0) close(fd);
    if (fd >= 0) ask_over_tls(dir, other.port);
    kill(pid, SIGTERM);
    CHECK_INT(waitpid(pid, &status, 0), pid);
    CHECK(daemon_get(&daemon, "/healthz", &answer));
    CHECK_INT(daemon_stop(&daemon), 0);
    snprintf(command, sizeof command, "rm -r %s", dir);
    CHECK_INT(run(command, out, sizeof out), 0);
}
