#include "check.h"
#include "facet.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TESTS_MAX = 256, NOTES_MAX = 128 };

static struct {
    const char *name;
    check_fn *fn;
} tests[TESTS_MAX];
static size_t test_count;
static struct {
    char name[48];
    double value;
} notes[NOTES_MAX];
static size_t note_count;
static int failures;
static const char *skipped;

void check_register(const char *name, check_fn *fn)
{
    if (test_count == TESTS_MAX) {
        fprintf(stderr, "more than %d tests in one program\n", TESTS_MAX);
        exit(2);
    }
    tests[test_count].name = name;
    tests[test_count++].fn = fn;
}

void check_fail(const char *file, int line, const char *format, ...)
{
    enum { SHOWN = 10 };
    if (failures++ < SHOWN) {
        va_list list;
        va_start(list, format);
        printf("  %s:%d: ", file, line);
        vprintf(format, list);
        putchar('\n');
        va_end(list);
    }
}

void check_skip(const char *why)
{
    skipped = why;
}

void check_note(const char *name, double value)
{
    size_t i = 0;
    while (i < note_count && strcmp(notes[i].name, name)) i++;
    if (i == NOTES_MAX) return;
    if (i == note_count) {
        snprintf(notes[note_count++].name, sizeof notes[0].name, "%s", name);
        notes[i].value = value;
    }
    notes[i].value = check_worse(notes[i].value, value);
}

double check_worse(double a, double b)
{
    return b > a || isnan(b) ? b : a;
}

bool check_within(double actual, double expected, double bound, double floor_)
{
    double size = fabs(expected) > floor_ ? fabs(expected) : floor_;
    return actual == expected || fabs(actual - expected) <= bound * size;
}

bool check_same_text(const char *a, const char *b)
{
    return a == b || (a && b && !strcmp(a, b));
}

void *check_read_file(const char *path, size_t *size)
{
    FILE *f = fopen(path, "rb");
    if (!f) return NULL;
    char *bytes = NULL;
    long end;
    if (!fseek(f, 0, SEEK_END) && (end = ftell(f)) >= 0 && !fseek(f, 0, SEEK_SET) &&
        (bytes = malloc((size_t)end + 1))) {
        *size = fread(bytes, 1, (size_t)end, f);
        bytes[*size] = 0;
    }
    fclose(f);
    return bytes;
}

const char *check_data(const char *relative)
{
    static char path[4096];
    const char *root = getenv("FACET_DATA");
    snprintf(path, sizeof path, "%s/%s", root ? root : "../shared/data", relative);
    FILE *f = fopen(path, "rb");
    if (!f) return NULL;
    fclose(f);
    return path;
}

int main(int argc, char **argv)
{
    const char *program = strrchr(argv[0], '/'), *isa = getenv("FACET_ISA");
    program = program ? program + 1 : argv[0];
    if (isa && !strcmp(isa, "best")) isa = NULL;
    if (isa && facet_isa_select(isa) != FACET_OK) {
        printf("skip %s: this processor does not run %s\n", program, isa);
        return 0;
    }
    int bad = 0;
    for (size_t i = 0; i < test_count; i++) {
        if (argc > 1 && strcmp(argv[1], tests[i].name)) continue;
        failures = 0;
        skipped = NULL;
        note_count = 0;
        tests[i].fn();
        if (failures > 10) printf("  ... %d failed checks in all\n", failures);
        printf("%s %s/%s%s%s",
               failures  ? "FAIL"
               : skipped ? "skip"
                         : "ok",
               program, tests[i].name, isa ? " " : "", isa ? isa : "");
        if (skipped && !failures) printf(": %s", skipped);
        for (size_t k = 0; k < note_count; k++) printf(" %s=%.3g", notes[k].name, notes[k].value);
        putchar('\n');
        fflush(stdout);
        bad += failures > 0;
    }
    return bad != 0;
}
