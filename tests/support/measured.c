#include "measured.h"

#include "check.h"

#include <stdio.h>
#include <stdlib.h>

static char folder[] = "/tmp/merlXXXXXX";

static void remove_folder(void)
{
    char command[64];
    snprintf(command, sizeof command, "rm -r %s", folder);
    if (system(command)) fprintf(stderr, "%s is left behind\n", folder);
}

/* Compile the tool into the folder, once. */
static bool make_tool(void)
{
    static bool tried, made;
    char command[200];
    if (tried) return made;
    tried = true;
    FILE *tool = fopen("../shared/tools/make_merl.c", "r");
    if (!tool) return false;
    fclose(tool);
    if (!mkdtemp(folder)) return false;
    atexit(remove_folder);
    snprintf(command, sizeof command, "cc -O2 -o %s/make ../shared/tools/make_merl.c -lm", folder);
    made = !system(command);
    return made;
}

unsigned char *measured_merl(const char *material, size_t *size)
{
    char command[4400], path[64];
    const char *csv = check_data("brdf/nbrdf/merl_nbrdf.csv");
    if (!csv || !make_tool()) return NULL;
    snprintf(path, sizeof path, "%s/m.binary", folder);
    snprintf(command, sizeof command, "%s/make '%s' %s %s", folder, csv, material, path);
    return system(command) ? NULL : check_read_file(path, size);
}
