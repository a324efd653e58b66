#include "arena.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { LINE = 64, BLOCK = 16384 };

struct arena_block {
    struct arena_block *next;
    size_t used, size; /* of the bytes that follow the header's line */
    bool is_lent;
};

struct arena_deferred {
    struct arena_deferred *next;
    void (*destroy)(void *);
    void *object;
};

_Static_assert(sizeof(struct arena_block) <= LINE, "the header of a block fits its line");
_Static_assert(2 * LINE <= ARENA_OVERHEAD, "the header and what alignment takes");

void api_arena_open(struct arena *arena, size_t limit)
{
    *arena = (struct arena){.room = limit};
}

void api_arena_close(struct arena *arena)
{
    for (struct arena_deferred *d = arena->deferred; d; d = d->next) d->destroy(d->object);
    for (struct arena_block *b = arena->blocks, *next; b; b = next) {
        next = b->next;
        if (!b->is_lent) free(b);
    }
    *arena = (struct arena){0};
}

void api_arena_lend(struct arena *arena, void *bytes, size_t size)
{
    char *line = (char *)(((uintptr_t)bytes + LINE - 1) / LINE * LINE);
    struct arena_block *block = (struct arena_block *)(void *)line;
    if (size < ARENA_OVERHEAD) return;
    *block = (struct arena_block){.size = (size - ARENA_OVERHEAD) / LINE * LINE, .is_lent = true};
    arena->blocks = block;
}

static struct arena_block *block_of(struct arena *arena, size_t size)
{
    size_t bytes = size > BLOCK ? size : BLOCK;
    if (bytes > arena->room) return NULL;
    struct arena_block *block = aligned_alloc(LINE, LINE + bytes);
    if (!block) return NULL;
    arena->room -= bytes;
    *block = (struct arena_block){.next = arena->blocks, .size = bytes};
    arena->blocks = block;
    return block;
}

void *api_arena_alloc(struct arena *arena, size_t size)
{
    if (size > SIZE_MAX / 2) return NULL;
    size = (size + LINE - 1) / LINE * LINE;
    struct arena_block *block = arena->blocks;
    if (!block || block->size - block->used < size) block = block_of(arena, size);
    if (!block) return NULL;
    void *bytes = (char *)block + LINE + block->used;
    block->used += size;
    return bytes;
}

void *api_arena_array(struct arena *arena, size_t count, size_t size)
{
    if (size && count > SIZE_MAX / 2 / size) return NULL;
    void *bytes = api_arena_alloc(arena, count * size);
    if (bytes) memset(bytes, 0, count * size);
    return bytes;
}

double *api_arena_doubles(struct arena *arena, size_t count)
{
    if (count > SIZE_MAX / 2 / sizeof(double)) return NULL;
    return api_arena_alloc(arena, count * sizeof(double));
}

char *api_arena_text(struct arena *arena, const char *text, size_t size)
{
    char *copy = api_arena_alloc(arena, size + 1);
    if (!copy) return NULL;
    memcpy(copy, text, size);
    copy[size] = 0;
    return copy;
}

void *api_arena_defer(struct arena *arena, void (*destroy)(void *), void *object)
{
    struct arena_deferred *deferred = api_arena_alloc(arena, sizeof *deferred);
    if (!deferred) {
        destroy(object);
        return NULL;
    }
    *deferred = (struct arena_deferred){arena->deferred, destroy, object};
    arena->deferred = deferred;
    return object;
}

void *api_arena_adopt(struct arena *arena, void *bytes, size_t size)
{
    if (size > arena->room) {
        free(bytes);
        return NULL;
    }
    bytes = api_arena_defer(arena, free, bytes);
    if (bytes) arena->room -= size;
    return bytes;
}
