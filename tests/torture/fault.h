/* fault.h - the page that the torture and the daemon it torments share. */
#ifndef FAULT_H
#define FAULT_H

#include <stdatomic.h>

struct fault_page {
    atomic_long left; /* calls until one fails; negative: none fails */
    atomic_long live; /* blocks and mappings that are held */
    atomic_int hit;   /* one has failed */
    char what[32];    /* which call it was */
};

#define FAULT_PAGE "FACET_FAULT_PAGE" /* environment: path of the page */
#define FAULT_AT "FACET_FAULT_AT"     /* environment: the call that fails, counted from the start */

#endif
