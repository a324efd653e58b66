#include "files.h"
#include "check.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

size_t files_each(const char *folder,
                  void (*visit)(const char *path, const void *bytes, size_t size))
{
    DIR *dir = opendir(folder);
    size_t count = 0;
    for (const struct dirent *entry; dir && (entry = readdir(dir));) {
        char path[1024];
        if (entry->d_name[0] == '.') continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        const size_t below = files_each(path, visit);
        size_t size = 0;
        void *bytes = below ? NULL : check_read_file(path, &size);
        if (bytes) visit(path, bytes, size);
        count += below + (bytes != NULL);
        free(bytes);
    }
    if (dir) closedir(dir);
    return count;
}
