/*
 * facet_wire - what large evaluations cost over HTTP, against the figures that are promised.
 *
 *   facet_wire --daemon PROGRAM [--rounds N] [--only cost|threads|upload]
 *
 * Processor time of the daemon a direction (1e5 directions, GGX), JSON and float32; wall time of 1e6
 * Beckmann directions with two workers and with one, in turns; memory, and the time until work
 * starts, of 1e6 directions as JSON.  Best of N rounds (default 15): others share the machine.
 * Timings are printed beside what is asked, not judged; an answer that is no answer fails.
 */
#define _GNU_SOURCE /* memmem */
#include "daemon.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <math.h>
#include <netinet/in.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { MANY = 100000, MILLION = 1000000 };

/* A request as it goes over the wire. */
struct shot {
    char *bytes;
    size_t size;
    bool is_second; /* on its connection, after a small one */
};

/* What came of one: all its bytes, and the daemon's and the clock's time. */
struct spent {
    size_t bytes;
    double cpu_s, wall_s;
};

static int rounds = 15;
static bool failed;

static double clock_s(clockid_t id)
{
    struct timespec t = {0};
    clock_gettime(id, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double uniform(void)
{
    static uint64_t state = 7;
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (double)(state >> 11) * 0x1p-53;
}

/* ---- Requests ------------------------------------------------------------------------------------ */

static void direction(float v[3])
{
    double z = uniform(), phi = 6.28318530717958648 * uniform(), s = sqrt(1 - z * z);
    v[0] = (float)(s * cos(phi)), v[1] = (float)(s * sin(phi)), v[2] = (float)z;
}

/* What a client sends that has n directions as floats, and prints them so that they are read back. */
static char *json_body(const char *rest, size_t n, size_t *size)
{
    char *body = malloc(48 * n + strlen(rest) + 64), *p = body;
    if (!body) exit(2);
    p += sprintf(p, "{%s,\"wi\":[", rest);
    for (size_t i = 0; i < n; i++) {
        float v[3];
        direction(v);
        p += sprintf(p, "%s[%.9g,%.9g,%.9g]", i ? "," : "", (double)v[0], (double)v[1],
                     (double)v[2]);
    }
    p += sprintf(p, "]}");
    *size = (size_t)(p - body);
    return body;
}

static char *form_body(const char *rest, size_t n, size_t *size)
{
    char *body = malloc(12 * n + strlen(rest) + 256), *p = body;
    if (!body) exit(2);
    p += sprintf(p,
                 "--b\r\nContent-Disposition: form-data; name=\"request\"\r\n\r\n{%s}\r\n"
                 "--b\r\nContent-Disposition: form-data; name=\"wi\"\r\n\r\n",
                 rest);
    for (size_t i = 0; i < n; i++, p += 12) {
        float v[3];
        direction(v);
        memcpy(p, v, sizeof v);
    }
    p += sprintf(p, "\r\n--b--\r\n");
    *size = (size_t)(p - body);
    return body;
}

/* n directions, in the request or (n = 0) described by it. */
static struct shot shot_of(const char *rest, size_t n, bool is_form, const char *accept)
{
    size_t size;
    char *body = n && is_form ? form_body(rest, n, &size) : json_body(rest, n, &size);
    struct shot shot = {.bytes = malloc(size + 400)};
    if (!shot.bytes) exit(2);
    if (!n) size = (size_t)sprintf(body, "{%s}", rest);
    shot.size = (size_t)sprintf(
        shot.bytes,
        "POST /v1/eval HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Type: %s\r\n"
        "Accept: %s\r\nContent-Length: %zu\r\n\r\n",
        n && is_form ? "multipart/form-data; boundary=b" : "application/json", accept, size);
    memcpy(shot.bytes + shot.size, body, size);
    shot.size += size;
    free(body);
    return shot;
}

/* ---- Asking --------------------------------------------------------------------------------------- */

static int connect_to(const struct daemon *daemon)
{
    struct sockaddr_in to = {.sin_family = AF_INET};
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to.sin_port = htons((unsigned short)atoi(strrchr(daemon->url, ':') + 1));
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    if (fd >= 0 && !connect(fd, (struct sockaddr *)&to, sizeof to)) return fd;
    perror(daemon->url);
    exit(2);
}

/* Sends and reads to the end: the head, then the rest without looking at it. */
static struct spent ask(const struct daemon *daemon, const struct shot *shot)
{
    char head[4096];
    size_t sent = 0;
    clockid_t cpu;
    if (clock_getcpuclockid(daemon->pid, &cpu)) exit(2);
    int fd = connect_to(daemon);
    static const char small[] = "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n";
    if (shot->is_second && (send(fd, small, sizeof small - 1, MSG_NOSIGNAL) < 0 ||
                            recv(fd, head, sizeof head, 0) <= 0)) {
        perror("send");
        exit(2);
    }
    struct spent spent = {0, -clock_s(cpu), -clock_s(CLOCK_MONOTONIC)};
    ssize_t n;
    while (sent < shot->size &&
           (n = send(fd, shot->bytes + sent, shot->size - sent, MSG_NOSIGNAL)) > 0)
        sent += (size_t)n;
    n = recv(fd, head, sizeof head - 1, 0);
    head[n > 0 ? n : 0] = 0;
    for (; n > 0; n = recv(fd, NULL, 1 << 22, MSG_TRUNC))
        spent.bytes += (size_t)n; /* TCP: thrown away */
    spent.wall_s += clock_s(CLOCK_MONOTONIC);
    close(fd);
    spent.cpu_s += clock_s(cpu);
    if (sent == shot->size && !strncmp(head, "HTTP/1.1 200", 12)) return spent;
    printf("%.300s\nFAIL wire: no answer\n", head);
    failed = true;
    return spent;
}

static struct spent best(struct spent a, struct spent b)
{
    return (struct spent){b.bytes, fmin(a.cpu_s, b.cpu_s), fmin(a.wall_s, b.wall_s)};
}

static struct spent best_of(const struct daemon *daemon, const struct shot *shot, int times)
{
    struct spent spent = ask(daemon, shot);
    for (int i = 1; i < times; i++) spent = best(spent, ask(daemon, shot));
    return spent;
}

static void start(const char *program, const char *workers, struct daemon *daemon)
{
    if (setenv("FACETD_WORKERS", workers, 1) || !daemon_start(program, daemon)) exit(2);
}

/* ---- What is measured ------------------------------------------------------------------------------- */

#define BYTES "application/octet-stream"
#define JSON "application/json"

static void cost(const char *program)
{
    static const struct {
        const char *name, *rest;
        bool is_form;
        const char *accept;
        const char *asked;
        bool is_second;
    } kinds[] = {
        {"JSON", "\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[-0.6,0,0.8]]", false, JSON,
         "90", false},
        {"float32, wo as a float", "\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[0,0,1]]",
         true, BYTES, "8", false},
        {"float32", "\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[-0.6,0,0.8]]", true,
         BYTES, "8", false},
        {"float32, tolerance 1e-3",
         "\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[0,0,1]],\"tolerance\":1e-3", true,
         BYTES, "8", false},
        {"float32, after a GET",
         "\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[-0.6,0,0.8]]", true, BYTES, "-",
         true},
        {"float32 in, JSON out", "\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[0,0,1]]",
         true, JSON, "-", false},
    };
    enum { KINDS = sizeof kinds / sizeof *kinds };
    struct daemon daemon;
    struct shot shots[KINDS];
    struct spent least[KINDS];
    start(program, "2", &daemon);
    printf("1e5 directions, GGX: daemon's processor time a direction, all of it (ns)\n");
    for (size_t i = 0; i < KINDS; i++) {
        shots[i] = shot_of(kinds[i].rest, MANY, kinds[i].is_form, kinds[i].accept);
        shots[i].is_second = kinds[i].is_second;
    }
    /* In turns: what disturbs this machine may do so for a second. */
    for (int r = 0; r < 10 * rounds; r++)
        for (size_t i = 0; i < KINDS; i++) {
            struct spent spent = ask(&daemon, &shots[i]);
            least[i] = r ? best(least[i], spent) : spent;
        }
    for (size_t i = 0; i < KINDS; i++) {
        printf("  %-26s %6.1f   asked <= %-3s  wall %.1f\n", kinds[i].name,
               1e9 * least[i].cpu_s / MANY, kinds[i].asked, 1e9 * least[i].wall_s / MANY);
        free(shots[i].bytes);
    }
    if (daemon_stop(&daemon)) failed = true;
}

#define BECKMANN                                                                                   \
    "\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3},\"outputs\":[\"fr\",\"pdf\"],\"wo\":[[-0.6,0,0.8]]"
#define GRID ",\"wi\":{\"grid\":{\"theta\":1000,\"phi\":1000}}"

static void threads(const char *program)
{
    static const struct {
        const char *name, *rest;
        size_t n;
        bool is_form;
        const char *accept;
    } kinds[] = {
        {"grid, JSON out", BECKMANN GRID, 0, false, JSON},
        {"grid, float32 out", BECKMANN GRID, 0, false, BYTES},
        {"grid, float32 out, 1e-3", BECKMANN GRID ",\"tolerance\":1e-3", 0, false, BYTES},
        {"grid, float64 out, 1e-9", BECKMANN GRID ",\"tolerance\":1e-9", 0, false, BYTES},
        {"JSON in and out", BECKMANN, MILLION, false, JSON},
        {"float32 in and out", BECKMANN, MILLION, true, BYTES},
    };
    struct daemon one, two;
    start(program, "1", &one);
    start(program, "2", &two);
    printf(
        "1e6 directions, Beckmann, fr and pdf: wall time with 1 and 2 workers (ms)   asked >= 1.8\n");
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        struct shot shot = shot_of(kinds[i].rest, kinds[i].n, kinds[i].is_form, kinds[i].accept);
        struct spent a = ask(&one, &shot), b = ask(&two, &shot);
        for (int r = 1; r < rounds; r++)
            a = best(a, ask(&one, &shot)), b = best(b, ask(&two, &shot));
        printf("  %-26s %7.1f %7.1f   ratio %.2f   processor %.1f %.1f, %zu bytes\n", kinds[i].name,
               1e3 * a.wall_s, 1e3 * b.wall_s, a.wall_s / b.wall_s, 1e3 * a.cpu_s, 1e3 * b.cpu_s,
               b.bytes);
        free(shot.bytes);
    }
    if (daemon_stop(&one) || daemon_stop(&two)) failed = true;
}

static double megabytes_at_most(const struct daemon *daemon)
{
    char path[64], line[256];
    double kb = NAN;
    snprintf(path, sizeof path, "/proc/%ld/status", (long)daemon->pid);
    FILE *f = fopen(path, "r");
    while (f && fgets(line, sizeof line, f)) sscanf(line, "VmHWM: %lf", &kb);
    if (f) fclose(f);
    return kb / 1024;
}

/* From the log of requests: the fewest milliseconds between the first byte of a request and its work. */
static double best_start_ms(const char *log)
{
    char line[2048];
    double ms = INFINITY, receive, queue;
    FILE *f = fopen(log, "r");
    while (f && fgets(line, sizeof line, f)) {
        const char *at = strstr(line, " us_receive=");
        if (at && sscanf(at, " us_receive=%lf us_queue=%lf", &receive, &queue) == 2)
            ms = fmin(ms, 1e-3 * (receive + queue));
    }
    if (f) fclose(f);
    return ms;
}

static void upload(const char *program)
{
    char log[] = "/tmp/facet-wire-XXXXXX";
    int fd = mkstemp(log);
    struct daemon daemon;
    if (fd < 0 || setenv("FACET_DAEMON_LOG", log, 1)) exit(2);
    close(fd);
    start(program, "2", &daemon);
    struct shot shot = shot_of("\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[-0.6,0,0.8]]",
                               MILLION, false, JSON);
    struct spent spent = ask(&daemon, &shot);
    double most = megabytes_at_most(&daemon);
    spent = best(spent, best_of(&daemon, &shot, rounds));
    printf("1e6 directions as JSON, %.1f MB: memory %.0f MB   asked <= 300\n",
           1e-6 * (double)shot.size, most);
    if (daemon_stop(&daemon)) failed = true;
    printf(
        "  from its first byte to the start of work %.1f ms   asked <= 60 for 35 MB; all of it %.0f ms\n",
        best_start_ms(log), 1e3 * spent.wall_s);
    unlink(log);
    free(shot.bytes);
}

int main(int argc, char **argv)
{
    const char *program = NULL, *only = "";
    for (int i = 1; i + 1 < argc; i += 2) {
        if (!strcmp(argv[i], "--daemon")) program = argv[i + 1];
        if (!strcmp(argv[i], "--rounds")) rounds = atoi(argv[i + 1]);
        if (!strcmp(argv[i], "--only")) only = argv[i + 1];
    }
    if (!program || rounds < 1) {
        fprintf(stderr,
                "usage: facet_wire --daemon PROGRAM [--rounds N] [--only cost|threads|upload]\n");
        return 2;
    }
    if (!*only || !strcmp(only, "cost")) cost(program);
    if (!*only || !strcmp(only, "threads")) threads(program);
    if (!*only || !strcmp(only, "upload")) upload(program);
    return failed;
}
