/*
 * stream.h - an answer that is computed while it is sent: what outlives api_handle.
 *
 * A handler that can goes on block by block sets call->produce; the arena and the call then live
 * until the response is cleared.
 */
#ifndef API_STREAM_H
#define API_STREAM_H

#include "endpoint.h"

/* Answers that may be larger than this are worth it. */
enum { STREAM_MIN = 1 << 20 };

struct api_stream {
    struct arena arena;         /* the request's */
    struct api_request request; /* a copy: what it points to is the caller's */
    struct call call;
    struct pieces pieces;
    size_t piece, taken; /* pieces that are gone, and bytes of the next */
    bool failed;
    struct problem
        problem; /* from its errors on nothing is zeroed: for a tiny answer it would be much work */
    struct api_response scratch;       /* the call's response once api_handle has returned */
    char first[4096 + ARENA_OVERHEAD]; /* of the arena */
};

/* NULL: out of memory. */
struct api_stream *api_stream_open(size_t memory_limit);

/* NULL is fine. */
void api_stream_close(struct api_stream *stream);

#endif
