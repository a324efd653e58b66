#include "stream.h"

#include "limits.h"

#include <stdlib.h>
#include <string.h>

void api_stream_close(struct api_stream *stream)
{
    if (!stream) return;
    free(stream->block);
    api_arena_close(&stream->arena);
    free(stream);
}

enum { BLOCK_MIN = 65536 }; /* bytes: less is not worth a turn of a worker */

/* One more block, in an arena of its own: its pieces go when they are copied. */
static bool refill(struct api_stream *stream)
{
    struct arena arena;
    api_arena_open(&arena, LIMIT_REQUEST_MEMORY);
    struct text text = api_text(&arena);
    free(stream->block);
    stream->block = NULL;
    stream->block_size = stream->taken = 0;
    bool ok = true;
    while (ok && !stream->ended && text.size < BLOCK_MIN)
        ok = stream->call.produce(&stream->call, &text, &stream->ended);
    if (ok) {
        stream->block = api_text_take(&text, &stream->block_size);
        ok = stream->block;
    }
    api_arena_close(&arena);
    return ok;
}

long api_stream_next(struct api_stream *stream, char *out, size_t room)
{
    while (stream->taken == stream->block_size) {
        if (stream->ended) return 0;
        if (!refill(stream)) return -1;
    }
    size_t left = stream->block_size - stream->taken, n = left < room ? left : room;
    memcpy(out, stream->block + stream->taken, n);
    stream->taken += n;
    return (long)n;
}
