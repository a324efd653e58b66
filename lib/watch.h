/* watch.h - whether somebody who waits for long work has left (internal). */
#ifndef FACET_WATCH_H
#define FACET_WATCH_H

#include "facet.h"

static inline bool facet_is_cancelled(const facet_watch *watch)
{
    return watch && watch->cancelled && watch->cancelled(watch->user);
}

#endif
