/* files.h - every file below a folder. */
#ifndef FILES_H
#define FILES_H

#include <stddef.h>

/* Calls visit with the bytes of each file, in no order; how many there were. */
size_t files_each(const char *folder,
                  void (*visit)(const char *path, const void *bytes, size_t size));

#endif
