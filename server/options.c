#include "options.h"

#include <errno.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct row {
    const char *flag, *environment, *help;
    size_t offset;
    const char *text; /* default of a text; NULL for a number */
    long number, min, max;
    bool is_flag; /* a number, 1 where the flag stands without a value */
};

static const struct row rows[] = {
#define OPTION_NUMBER(field, flag, environment, fallback, min, max, help)                          \
    {flag, environment, help, offsetof(struct options, field), NULL, fallback, min, max, false},
#define OPTION_TEXT(field, flag, environment, fallback, help)                                      \
    {flag, environment, help, offsetof(struct options, field), fallback, 0, 0, 0, false},
#define OPTION_FLAG(field, flag, environment, help)                                                \
    {flag, environment, help, offsetof(struct options, field), NULL, 0, 0, 1, true},
#include "options.def"
};

enum { ROW_COUNT = sizeof rows / sizeof *rows };

static void set_text(struct options *options, const struct row *row, const char *text)
{
    *(const char **)((char *)options + row->offset) = text;
}

static void set_number(struct options *options, const struct row *row, long number)
{
    *(long *)((char *)options + row->offset) = number;
}

static void set_defaults(struct options *options)
{
    for (size_t i = 0; i < ROW_COUNT; i++) {
        if (rows[i].text)
            set_text(options, &rows[i], rows[i].text);
        else
            set_number(options, &rows[i], rows[i].number);
    }
}

/* `where` names the flag or the variable in the message, up to a '='. */
static bool set(struct options *options, const struct row *row, const char *where,
                const char *value)
{
    if (row->text) {
        set_text(options, row, value);
        return true;
    }
    char *end;
    errno = 0;
    long number = strtol(value, &end, 10);
    if (errno || end == value || *end || number < row->min || number > row->max) {
        int name = (int)strcspn(where, "=");
        if (row->is_flag)
            fprintf(stderr, "facetd: %.*s takes %s1 or 0, not \"%s\"\n", name, where,
                    *where == '-' ? "no value, or " : "", value);
        else
            fprintf(stderr, "facetd: %.*s takes a whole number from %ld to %ld, not \"%s\"\n", name,
                    where, row->min, row->max, value);
        return false;
    }
    set_number(options, row, number);
    return true;
}

static const struct row *find(const char *flag, size_t length)
{
    for (size_t i = 0; i < ROW_COUNT; i++)
        if (strlen(rows[i].flag) == length && !memcmp(rows[i].flag, flag, length)) return &rows[i];
    return NULL;
}

static void print_help(void)
{
    puts("facetd - microfacet BRDFs over HTTP: evaluate, sample, fit, filter\n\n"
         "usage: facetd [--OPTION VALUE | --OPTION=VALUE]...\n");
    for (size_t i = 0; i < ROW_COUNT; i++) {
        const struct row *row = &rows[i];
        printf("  --%-16s %s\n%21s", row->flag, row->help, "");
        if (row->text)
            printf("default \"%s\", or $%s\n", row->text, row->environment);
        else if (row->is_flag)
            printf("takes no value; or $%s=1\n", row->environment);
        else
            printf("%ld to %ld, default %ld, or $%s\n", row->min, row->max, row->number,
                   row->environment);
    }
    puts("  --healthcheck      ask the daemon that these options describe; exit 0 when it is well\n"
         "  --help, --version\n\n"
         "Sockets that systemd passes are listened on instead of --bind and --port; one named\n"
         "\"admin\" takes the place of --admin.\n\n"
         "SIGTERM and SIGINT: accept nothing new, finish what runs, exit 0; a second one ends at "
         "once.\nSIGHUP: nothing, there is no file to read again; at a terminal as SIGTERM.");
}

static bool read_environment(struct options *options)
{
    for (size_t i = 0; i < ROW_COUNT; i++) {
        const char *value = getenv(rows[i].environment);
        if (value && !set(options, &rows[i], rows[i].environment, value)) return false;
    }
    return true;
}

static bool is_one_of(const char *flag, const char *value, const char *const *choices)
{
    for (size_t i = 0; choices[i]; i++)
        if (!strcmp(value, choices[i])) return true;
    fprintf(stderr, "facetd: --%s is one of", flag);
    for (size_t i = 0; choices[i]; i++) fprintf(stderr, "%s %s", i ? "," : "", choices[i]);
    fprintf(stderr, ", not \"%s\"\n", value);
    return false;
}

static bool check_choices(const struct options *options)
{
    static const char *const levels[] = {"requests", "events", "none", NULL};
    static const char *const sandboxes[] = {"auto", "on", "off", NULL};
    return is_one_of("log", options->log, levels) &&
           is_one_of("sandbox", options->sandbox, sandboxes);
}

enum options_action options_read(int argc, char **argv, struct options *options)
{
    enum options_action action = OPTIONS_SERVE;
    set_defaults(options);
    if (!read_environment(options)) return OPTIONS_BAD;
    for (int i = 1; i < argc; i++) {
        const char *word = argv[i];
        if (!strcmp(word, "--help")) {
            print_help();
            return OPTIONS_DONE;
        }
        if (!strcmp(word, "--version")) {
            puts("facetd " FACET_VERSION);
            return OPTIONS_DONE;
        }
        if (!strcmp(word, "--healthcheck")) {
            action = OPTIONS_HEALTHCHECK;
            continue;
        }
        const char *flag = strncmp(word, "--", 2) ? "" : word + 2;
        const char *value = strchr(flag, '=');
        const struct row *row = find(flag, value ? (size_t)(value - flag) : strlen(flag));
        if (!row) {
            fprintf(stderr, "facetd: unknown option \"%s\"; see facetd --help\n", word);
            return OPTIONS_BAD;
        }
        value = value ? value + 1 : row->is_flag ? "1" : argv[++i]; /* argv ends with NULL */
        if (!value) {
            fprintf(stderr, "facetd: %s needs a value\n", word);
            return OPTIONS_BAD;
        }
        if (!set(options, row, word, value)) return OPTIONS_BAD;
    }
    return check_choices(options) ? action : OPTIONS_BAD;
}

void options_limits(const struct options *options, struct api_limit limits[OPTIONS_LIMITS])
{
    size_t n = 0;
#define OPTION_LIMIT(field, flag, environment, fallback, min, max, help)                           \
    limits[n++] = (struct api_limit){#field, options->field, help};
#include "options.def"
}
