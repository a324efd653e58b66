#include "stream.h"

#include <stdatomic.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/*
 * One is there for whoever comes first: it is too large for malloc's quick lists, and all that a
 * tiny request allocates but a few bytes.  Not of the heap, where one that lives long would keep
 * the memory of large requests apart.  Sanitizers see each come and go.
 */
static struct api_stream ready;
static atomic_flag ready_is_taken = ATOMIC_FLAG_INIT;

struct api_stream *api_stream_open(size_t memory_limit)
{
    struct api_stream *stream = SANITIZED || atomic_flag_test_and_set(&ready_is_taken)
                                    ? malloc(sizeof *stream)
                                    : &ready;
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
    if (stream == &ready)
        atomic_flag_clear(&ready_is_taken);
    else
        free(stream);
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
