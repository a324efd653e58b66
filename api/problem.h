/*
 * problem.h - every error the API answers, as problem+json (RFC 9457).
 *
 * Functions that fail fill a problem and return false:
 *     return api_problem_at(problem, place, "has length %g, must have 1", length);
 */
#ifndef API_PROBLEM_H
#define API_PROBLEM_H

#include "api.h"
#include "facet.h"

#include <stdbool.h>
#include <stddef.h>

/*
 * Where in the request something stands: a list on the C stack, innermost first,
 * written as a JSON pointer (RFC 6901) only when something is wrong there.
 * name NULL: the index-th element.  A NULL place is the whole request.
 */
struct place {
    const struct place *up;
    const char *name;
    size_t index;
};

enum { PROBLEM_ERRORS_MAX = 8 };

struct problem_error {
    char pointer[160], detail[240];
};

struct problem {
    int status; /* HTTP; 0: none yet */
    char detail[420];
    size_t count; /* of errors; those past the array are not kept */
    struct problem_error errors[PROBLEM_ERRORS_MAX];
};

/* Sets status and detail unless there is a problem already.  Returns false. */
__attribute__((format(printf, 3, 4))) bool api_problem(struct problem *problem, int status,
                                                       const char *format, ...);
/* Adds an error at a place: 422.  Returns false. */
__attribute__((format(printf, 3, 4))) bool
api_problem_at(struct problem *problem, const struct place *place, const char *format, ...);
/* What lib said, about this place (NULL: the whole request).  Returns false. */
bool api_problem_status(struct problem *problem, facet_status status, const struct place *place);
/* 503: out of memory.  Returns false. */
bool api_problem_memory(struct problem *problem);

/* The reason phrase of an HTTP status. */
const char *api_status_title(int status);

/* Writes the problem as the response's body; headers already there stay. */
void api_problem_answer(const struct problem *problem, struct api_response *response);

#endif
