/* cases.h - the case files of a directory, and sending one of them. */
#ifndef CLIENT_CASES_H
#define CLIENT_CASES_H

#include "body.h"
#include "http.h"

#include <stdbool.h>

struct test_case {
    char *name;   /* "<endpoint>/<case>" */
    json_t *root; /* the file */
};

struct cases {
    struct test_case *list; /* sorted by name */
    size_t count;
};

/* Every <endpoint>/<case>.json below dir whose name holds filter (NULL: all); false, with a
 * message, on a bad file. */
bool cases_load(const char *dir, const char *filter, struct cases *cases);
void cases_clear(struct cases *cases);

void cases_send(CURL *curl, const char *base_url, const json_t *request, const struct body *body,
                struct http_answer *answer);

#endif
