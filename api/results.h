/* results.h - arrays of results, printed chunk by chunk while they are computed. */
#ifndef API_RESULTS_H
#define API_RESULTS_H

#include "text.h"

#include <stdbool.h>

struct results {
    struct text text;
    size_t width; /* numbers per element */
    bool flat;    /* [x,y,z,x,..] instead of [[x,y,z],..] */
    int digits;
    size_t count; /* elements so far */
};

void api_results_open(struct results *results, struct arena *arena, size_t width, bool flat,
                      int digits);
/* n more elements, column k of each in columns[k]; false where one is not finite (count says
 * which). */
bool api_results_add(struct results *results, double *const columns[], size_t n);
void api_results_close(struct results *results);

#endif
