/* expect.h - does an answer hold what a case expects? */
#ifndef CLIENT_EXPECT_H
#define CLIENT_EXPECT_H

#include "http.h"

#include <jansson.h>

/* Lines of "what is wrong", two spaces before each; empty: all is well. */
struct findings {
    char text[4096];
    size_t length;
};

__attribute__((format(printf, 2, 3))) void finding(struct findings *findings, const char *format,
                                                   ...);

/*
 * expect: {"status":200 or [422,413], "type":"...", "headers":{"Allow":"POST"}, "error":"/pointer",
 *   "contains":["text"], "bytes":{"min":n,"max":n}, "json":{"/pointer": check, ...}}
 * check: a plain value (equal), or {"is":value, "rel":1e-12 or "bound", "floor":1e-30, "abs":x,
 *   "type":"array", "count":n, "min":x, "max":x, "contains":"text", "absent":true, "sum":x}
 * "rel":"bound" takes the bound the answer itself promises (/accuracy/bound).
 */
void expect_check(const json_t *expect, const struct http_answer *answer,
                  struct findings *findings);

/* RFC 6901; NULL if it leads nowhere. */
const json_t *expect_at(const json_t *root, const char *pointer);

#endif
