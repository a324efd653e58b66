#include "nearest.h"

#include <stdint.h>
#include <stdio.h>
#include <string.h>

enum {
    LENGTH_MAX = 40
}; /* of what is compared: names are shorter, and what is longer resembles none */

static size_t least(size_t a, size_t b)
{
    return a < b ? a : b;
}

/* Insertions, deletions, replacements (Levenshtein's distance). */
static size_t distance(const char *a, const char *b)
{
    size_t row[LENGTH_MAX + 1], na = strnlen(a, LENGTH_MAX), nb = strnlen(b, LENGTH_MAX);
    for (size_t j = 0; j <= nb; j++) row[j] = j;
    for (size_t i = 1; i <= na; i++) {
        size_t corner = row[0];
        row[0] = i;
        for (size_t j = 1; j <= nb; j++) {
            size_t replaced = corner + (a[i - 1] != b[j - 1]);
            corner = row[j];
            row[j] = least(replaced, 1 + least(row[j], row[j - 1]));
        }
    }
    return row[nb];
}

void api_join_nearest(const char *name, const char *const *names, size_t count, char *out,
                      size_t room)
{
    static const char more[] = ", ...";
    size_t far[NEAREST_MAX], used = 0;
    if (count > NEAREST_MAX) count = NEAREST_MAX;
    for (size_t i = 0; i < count; i++) far[i] = distance(name, names[i]);
    *out = 0;
    for (size_t done = 0; done < count; done++) {
        size_t next = 0;
        for (size_t i = 1; i < count; i++)
            if (far[i] < far[next]) next = i;
        far[next] = SIZE_MAX;
        size_t tail = done + 1 < count ? sizeof more : 1;
        if (used + strlen(names[next]) + 2 + tail > room) {
            snprintf(out + used, room - used, "%s", used ? more : "");
            return;
        }
        used += (size_t)snprintf(out + used, room - used, "%s%s", used ? ", " : "", names[next]);
    }
}
