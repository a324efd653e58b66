/*
 * arena.h - memory that lives as long as one request.
 *
 * Everything a request allocates comes from here and goes at once, on every path
 * out.  Things with their own destructor (a facet_brdf) are handed over with
 * api_arena_defer.
 */
#ifndef API_ARENA_H
#define API_ARENA_H

#include <stddef.h>

struct arena {
    struct arena_block *blocks;
    struct arena_deferred *deferred;
    size_t room;                     /* bytes it may still take from the system */
    const struct document *document; /* the request it was opened for (array.h), once it is read */
};

/* limit: bytes the arena may hold in all. */
void api_arena_open(struct arena *arena, size_t limit);
void api_arena_close(struct arena *arena);

/* What an empty arena takes first: the caller's bytes, which stay his.  It uses all but the overhead. */
enum { ARENA_OVERHEAD = 128 };
void api_arena_lend(struct arena *arena, void *bytes, size_t size);

/* Aligned to a cache line, not zeroed; NULL when memory or the limit is exhausted. */
void *api_arena_alloc(struct arena *arena, size_t size);
/* count * size bytes, zeroed. */
void *api_arena_array(struct arena *arena, size_t count, size_t size);
double *api_arena_doubles(struct arena *arena, size_t count);
/* A copy of the first size bytes of text, NUL-terminated. */
char *api_arena_text(struct arena *arena, const char *text, size_t size);

/*
 * Takes over malloc'd bytes: freed when the arena closes, counted against its limit.  On failure
 * they are freed at once and NULL returned.
 */
void *api_arena_adopt(struct arena *arena, void *bytes, size_t size);

/* destroy(object) when the arena closes; on failure it is called at once and NULL returned. */
void *api_arena_defer(struct arena *arena, void (*destroy)(void *), void *object);

#endif
