#include "memory.h"

#include "clock.h"

#include <malloc.h>
#include <stdint.h>

enum {
    /*
     * Requests of 1e5 directions hold arrays of 0.4 to 3 MB.  As float32 over HTTP a direction took
     * 20 ns of CPU where these come from memory the process has already, 28 to 44 with glibc's moving
     * threshold, 60 where each is mapped anew.  32 MiB is the most glibc takes.
     */
    MAPPED_FROM = 32 << 20,
    KEPT = 32 << 20, /* at the end of the heap, between two requests */
    /*
     * One heap for all threads: of others malloc_trim does not give back the end, and half an hour of
     * mixed load moved the resident memory by 3 % to and fro.  Threads meet at its lock seldom: they
     * have caches for what is small, and requests hold few arrays.
     */
    HEAPS = 1,
    /*
     * Under load too: else the process holds the most that requests ever held at once (64 connections of
     * mixed load: 53, then 61 MB, where 32 do).  A call took 1 to 2 ms.
     */
    KEPT_US = 2000000
};

/* Of the main network thread alone: the first use since memory was given back, or 0. */
static int64_t used_us;

void memory_open(void)
{
#ifdef __GLIBC__
    mallopt(M_ARENA_MAX, HEAPS);
    mallopt(M_MMAP_THRESHOLD, MAPPED_FROM);
    mallopt(M_TRIM_THRESHOLD, KEPT);
#endif
}

void memory_used(void)
{
    if (!used_us) used_us = clock_us();
}

bool memory_is_kept(void)
{
    return used_us != 0;
}

void memory_tick(void)
{
    if (!used_us || clock_us() < used_us + KEPT_US) return;
    used_us = 0;
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}
