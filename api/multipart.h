/* multipart.h - the parts of a multipart/form-data body (RFC 7578), where they stand. */
#ifndef API_MULTIPART_H
#define API_MULTIPART_H

#include "problem.h"

enum { PART_NAME_ROOM = 64, PARTS_MAX = 32 };

struct part {
    char name[PART_NAME_ROOM];
    const char *bytes; /* in the body */
    size_t size;
};

/*
 * Fills parts and *count; false: 400 for what is no such body, 422 for more parts, longer names or
 * other encodings than are taken.
 */
bool api_multipart(const char *content_type, const char *body, size_t size,
                   struct part parts[PARTS_MAX], size_t *count, struct problem *problem);

#endif
