#include "stream.h"

#include <stdatomic.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/*
 * The last one that was closed, for the next request: too large for malloc's quick lists, and all
 * that a tiny request allocates but a few bytes.  Sanitizers see each come and go.
 */
static _Atomic(struct api_stream *) spare;

struct api_stream *api_stream_open(size_t memory_limit)
{
    struct api_stream *stream = atomic_exchange(&spare, NULL);
    if (!stream) stream = malloc(sizeof *stream);
    if (!stream) return NULL;
    memset(stream, 0, offsetof(struct api_stream, problem.errors));
    api_arena_open(&stream->arena, memory_limit);
    api_arena_lend(&stream->arena, stream->first, sizeof stream->first);
    return stream;
}

void api_stream_close(struct api_stream *stream)
{
    if (!stream) return;
    api_arena_close(&stream->arena);
    free(SANITIZED ? stream : atomic_exchange(&spare, stream));
}

void api_stream_end(void)
{
    free(atomic_exchange(&spare, NULL));
}

static bool has_pieces(const struct api_stream *stream)
{
    return stream->piece < stream->pieces.count;
}

bool api_stream_is_ready(const struct api_stream *stream)
{
    return has_pieces(stream) || stream->pieces.ended || stream->failed;
}

/* What is there of the pieces, at most `room` bytes. */
static size_t take(struct api_stream *stream, char *out, size_t room)
{
    size_t taken = 0;
    while (has_pieces(stream) && taken < room) {
        const struct piece *piece = &stream->pieces.list[stream->piece];
        size_t left = piece->size - stream->taken, n = left < room - taken ? left : room - taken;
        memcpy(out + taken, piece->bytes + stream->taken, n);
        taken += n;
        stream->taken += n;
        if (stream->taken < piece->size) break;
        stream->piece++;
        stream->taken = 0;
    }
    return taken;
}

long api_stream_next(struct api_stream *stream, char *out, size_t room)
{
    while (!has_pieces(stream)) {
        if (stream->failed) return -1;
        if (stream->pieces.ended) return 0;
        stream->piece = stream->pieces.count = 0;
        stream->failed = !stream->call.produce(&stream->call, &stream->pieces);
    }
    return (long)take(stream, out, room);
}
