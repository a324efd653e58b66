#include "compress.h"

#include "endpoint.h"
#include "media.h"

#include <libdeflate.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE_MIN = 1024, SIZE_MAX_GZIP = 1 << 20, LEVEL = 1 };

/* The gzip of bytes, malloc'd; NULL: no memory, or no shorter. */
static void *gzip(const void *bytes, size_t size, size_t *out_size)
{
    struct libdeflate_compressor *compressor = libdeflate_alloc_compressor(LEVEL);
    void *out = compressor ? malloc(size) : NULL;
    *out_size = out ? libdeflate_gzip_compress(compressor, bytes, size, out, size) : 0;
    if (compressor) libdeflate_free_compressor(compressor);
    if (*out_size) return out;
    free(out);
    return NULL;
}

bool api_takes_gzip(const char *accept_encoding)
{
    /* Without the header, and with an empty one, as it is. */
    return accept_encoding && accept_encoding[strspn(accept_encoding, " \t")] &&
           api_media_quality(accept_encoding, "gzip") > 0;
}

void api_compress(const char *accept_encoding, struct api_response *response)
{
    size_t size;
    bool is_fit = response->body && response->body_size >= SIZE_MIN &&
                  response->body_size <= SIZE_MAX_GZIP && response->content_type &&
                  !strcmp(response->content_type, "application/json");
    if (!is_fit) return;
    api_answer_header(response, "Vary", "Accept-Encoding");
    if (!api_takes_gzip(accept_encoding)) return;
    void *body = gzip(response->body, response->body_size, &size);
    if (!body) return;
    free(response->body);
    response->body = body;
    response->body_size = size;
    api_answer_header(response, "Content-Encoding", "gzip");
}
