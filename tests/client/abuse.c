/*
 * facet_abuse - sends a daemon everything bad that shared data holds, and looks what is left of it.
 *
 *   facet_abuse --daemon PROGRAM [--cases DIR] [--memory no]
 *
 * Every parsing file of JSONTestSuite goes to every POST endpoint, every file of the EXR and PNG
 * sets to /v1/leadr and /v1/fit, every JSON body of the case files cut short.  No answer may be 5xx
 * or missing, refusals are problem+json, n_ files are refused with 400; the daemon lives, does not
 * grow, and ends 0 on SIGTERM.  Times are reported, not judged.
 */
#include "body.h"
#include "cases.h"
#include "daemon.h"
#include "expect.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static const char *const post_paths[] = {"/v1/eval",     "/v1/pdf", "/v1/sample",
                                         "/v1/material", "/v1/fit", "/v1/leadr"};
enum { POST_PATHS = sizeof post_paths / sizeof *post_paths };

struct files {
    char **path;
    size_t count;
};

struct attack {
    CURL *curl;
    struct daemon daemon;
    bool quiet; /* the rounds that only watch the memory, without the large files */
    size_t failed;
};

/* One endpoint under one suite. */
struct tally {
    struct findings findings;
    size_t sent, accepted, refused;
    double slowest_refusal, slowest;
    char slowest_name[128];
};

static bool ends_with(const char *text, const char *end)
{
    size_t n = strlen(text), m = strlen(end);
    return n >= m && !strcmp(text + n - m, end);
}

static void find_files(const char *dir, const char *end, struct files *files)
{
    DIR *d = opendir(dir);
    for (struct dirent *e; d && (e = readdir(d));) {
        char path[4096];
        struct stat st;
        snprintf(path, sizeof path, "%s/%s", dir, e->d_name);
        if (e->d_name[0] == '.' || stat(path, &st)) continue;
        if (S_ISDIR(st.st_mode)) {
            find_files(path, end, files);
        } else if (ends_with(path, end)) {
            char **more = realloc(files->path, (files->count + 1) * sizeof *more);
            if (!more) break;
            files->path = more;
            if ((more[files->count] = strdup(path))) files->count++;
        }
    }
    if (d) closedir(d);
}

static void files_clear(struct files *files)
{
    for (size_t i = 0; i < files->count; i++) free(files->path[i]);
    free(files->path);
}

static const char *base_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

static void judge(struct tally *t, const char *name, const struct http_answer *answer)
{
    t->sent++;
    if (answer->ms > t->slowest) {
        t->slowest = answer->ms;
        snprintf(t->slowest_name, sizeof t->slowest_name, "%s", name);
    }
    if (answer->status >= 200 && answer->status < 300) {
        t->accepted++;
        return;
    }
    if (answer->status < 400 || answer->status >= 500) {
        finding(&t->findings, "%s: status %ld %.200s", name, answer->status,
                answer->status ? answer->body ? answer->body : "" : answer->error);
        return;
    }
    t->refused++;
    if (answer->ms > t->slowest_refusal) t->slowest_refusal = answer->ms;
    if (strncmp(answer->type, "application/problem+json", 24))
        finding(&t->findings, "%s: a refusal of type \"%s\"", name, answer->type);
    if (!strncmp(name, "n_", 2) && answer->status != 400)
        finding(&t->findings, "%s: not JSON, but status %ld", name, answer->status);
}

static void attack_send(struct attack *attack, const char *path, const char *type, const char *name,
                        const void *body, size_t size, struct tally *t)
{
    char url[512], header[128];
    const char *headers[] = {header};
    struct http_answer answer;
    snprintf(url, sizeof url, "%s%s", attack->daemon.url, path);
    snprintf(header, sizeof header, "Content-Type: %s", type);
    http_send(attack->curl, &(struct http_request){"POST", url, headers, 1, body, size}, &answer);
    judge(t, name, &answer);
    http_clear(&answer);
}

static void report(struct attack *attack, const char *suite, const char *path,
                   const struct tally *t)
{
    bool bad = t->findings.length || !t->sent;
    attack->failed += bad;
    if (attack->quiet && !bad) return;
    fputs(t->findings.text, stdout);
    printf(
        "%s abuse/%s %s: %zu bodies, %zu accepted, %zu refused, slowest refusal %.1f ms, slowest "
        "%.1f ms (%s)\n",
        bad ? "FAIL" : "ok", suite, path, t->sent, t->accepted, t->refused, t->slowest_refusal,
        t->slowest, t->slowest_name);
    fflush(stdout);
}

static void suite_of_files(struct attack *attack, const char *suite, const char *path,
                           const char *type, const struct files *files)
{
    enum { LARGE = 300000 };
    struct tally t = {0};
    for (size_t i = 0; i < files->count; i++) {
        size_t size = 0;
        char *bytes = body_read(files->path[i], &size);
        if (bytes && !(attack->quiet && size > LARGE))
            attack_send(attack, path, type, base_name(files->path[i]), bytes, size, &t);
        free(bytes);
    }
    report(attack, suite, path, &t);
}

/* The good bodies, cut at steps of a thirteenth: nearly right is where parsers trip. */
static void suite_of_stumps(struct attack *attack, const struct cases *cases)
{
    enum { CUTS = 13 };
    struct tally t = {0};
    for (size_t i = 0; i < cases->count; i++) {
        const json_t *request = json_object_get(cases->list[i].root, "request");
        const char *path = json_string_value(json_object_get(request, "path"));
        struct body body;
        if (!json_object_get(request, "json") || !path || body_make(request, &body) != BODY_OK)
            continue;
        for (size_t k = 1; k < CUTS; k++)
            attack_send(attack, path, "application/json", cases->list[i].name, body.bytes,
                        body.size * k / CUTS, &t);
        body_clear(&body);
    }
    report(attack, "stumps", "of every case", &t);
}

struct arsenal {
    struct files json, exr, png;
    struct cases cases;
};

static void one_round(struct attack *attack, const struct arsenal *arsenal)
{
    for (size_t i = 0; i < POST_PATHS && arsenal->json.count; i++)
        suite_of_files(attack, "json", post_paths[i], "application/json", &arsenal->json);
    static const char *const image_paths[] = {"/v1/leadr", "/v1/fit"};
    for (size_t i = 0; i < 2 && arsenal->exr.count; i++) {
        suite_of_files(attack, "exr", image_paths[i], "application/octet-stream", &arsenal->exr);
        suite_of_files(attack, "png", image_paths[i], "application/octet-stream", &arsenal->png);
    }
    if (arsenal->cases.count) suite_of_stumps(attack, &arsenal->cases);
}

static void check_alive(struct attack *attack)
{
    char url[512];
    struct http_answer answer;
    snprintf(url, sizeof url, "%s/healthz", attack->daemon.url);
    http_send(attack->curl, &(struct http_request){"GET", url, NULL, 0, NULL, 0}, &answer);
    attack->failed += answer.status != 200;
    printf("%s abuse/alive: /healthz answers %ld\n", answer.status == 200 ? "ok" : "FAIL",
           answer.status);
    http_clear(&answer);
}

/*
 * The allocator keeps what it once had, so memory rises at first; what leaks rises for ever. Passes
 * as soon as a round leaves nothing behind.
 */
static void check_memory(struct attack *attack, const struct arsenal *arsenal)
{
    enum { ROUNDS = 8, NOISE_KB = 256 };
    size_t first = daemon_resident(&attack->daemon), before = 0, now = first;
    int round = 0;
    attack->quiet = true;
    do {
        before = now;
        one_round(attack, arsenal);
        now = daemon_resident(&attack->daemon);
    } while (++round < ROUNDS && now > before + NOISE_KB);
    bool bad = !first || now > before + NOISE_KB;
    attack->failed += bad;
    printf(
        "%s abuse/memory: %zu kB resident, %zu kB after %d more rounds, the last adding %ld kB\n",
        bad ? "FAIL" : "ok", first, now, round, (long)now - (long)before);
}

static void load(const char *cases, struct arsenal *arsenal)
{
    char dir[4096];
    body_data_path("json/JSONTestSuite/test_parsing", dir, sizeof dir);
    find_files(dir, ".json", &arsenal->json);
    body_data_path("exr", dir, sizeof dir);
    find_files(dir, "", &arsenal->exr);
    body_data_path("png", dir, sizeof dir);
    find_files(dir, "", &arsenal->png);
    if (cases) cases_load(cases, NULL, &arsenal->cases);
    if (!arsenal->json.count || !arsenal->exr.count || !arsenal->png.count)
        printf("skip abuse/shared: shared data is absent\n");
}

int main(int argc, char **argv)
{
    const char *program = NULL, *cases = NULL;
    bool memory = true;
    for (int i = 1; i + 1 < argc; i += 2) {
        if (!strcmp(argv[i], "--daemon")) program = argv[i + 1];
        if (!strcmp(argv[i], "--cases")) cases = argv[i + 1];
        if (!strcmp(argv[i], "--memory")) memory = strcmp(argv[i + 1], "no");
    }
    struct attack attack = {0};
    struct arsenal arsenal = {0};
    if (!program) {
        fprintf(stderr, "usage: facet_abuse --daemon PROGRAM [--cases DIR] [--memory no]\n");
        return 2;
    }
    load(cases, &arsenal);
    if (!daemon_start(program, &attack.daemon)) return 2;
    curl_global_init(CURL_GLOBAL_DEFAULT);
    attack.curl = curl_easy_init();
    one_round(&attack, &arsenal);
    if (memory) check_memory(&attack, &arsenal);
    check_alive(&attack);
    curl_easy_cleanup(attack.curl);
    int ended = daemon_stop(&attack.daemon);
    attack.failed += ended != 0;
    printf("%s abuse/ends: exit %d after SIGTERM\n", ended ? "FAIL" : "ok", ended);
    curl_global_cleanup();
    files_clear(&arsenal.json);
    files_clear(&arsenal.exr);
    files_clear(&arsenal.png);
    cases_clear(&arsenal.cases);
    return attack.failed ? 1 : 0;
}
