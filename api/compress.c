#include "compress.h"

#include "endpoint.h"
#include "media.h"

#include <libdeflate.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <zstd.h>

enum { SIZE_MIN = 1024, SIZE_MAX_PACKED = 1 << 20, LEVEL = 1 };

/* Bytes packed into as many; how many it took, 0: no memory, or no fewer. */
static size_t gzip(void *out, const void *bytes, size_t size)
{
    struct libdeflate_compressor *compressor = libdeflate_alloc_compressor(LEVEL);
    if (!compressor) return 0;
    size_t packed = libdeflate_gzip_compress(compressor, bytes, size, out, size);
    libdeflate_free_compressor(compressor);
    return packed;
}

static size_t zstd(void *out, const void *bytes, size_t size)
{
    size_t packed = ZSTD_compress(out, size, bytes, size, LEVEL);
    return ZSTD_isError(packed) ? 0 : packed;
}

/* Without the header, and with an empty one, as it is. */
static double quality_of(const char *accept_encoding, const char *name)
{
    bool asks = accept_encoding && accept_encoding[strspn(accept_encoding, " \t")];
    return asks ? api_media_quality(accept_encoding, name) : 0;
}

bool api_takes_gzip(const char *accept_encoding)
{
    return quality_of(accept_encoding, "gzip") > 0;
}

static bool is_named(const char *accept_encoding, const char *name)
{
    for (const char *at = accept_encoding; at && *at; at += strcspn(at, ",")) {
        at += strspn(at, ", \t");
        size_t n = strcspn(at, ",; \t");
        if (n == strlen(name) && !strncasecmp(at, name, n)) return true;
    }
    return false;
}

/* Who takes anything gets what everybody unpacks. */
static bool prefers_zstd(const char *accept_encoding)
{
    double quality = quality_of(accept_encoding, "zstd");
    return quality > 0 && quality >= quality_of(accept_encoding, "gzip") &&
           is_named(accept_encoding, "zstd");
}

void api_compress(const char *accept_encoding, struct api_response *response)
{
    bool is_fit = response->body && response->body_size >= SIZE_MIN &&
                  response->body_size <= SIZE_MAX_PACKED && response->content_type &&
                  !strcmp(response->content_type, "application/json");
    if (!is_fit) return;
    api_answer_header(response, "Vary", "Accept-Encoding");
    const bool is_zstd = prefers_zstd(accept_encoding);
    if (!is_zstd && !api_takes_gzip(accept_encoding)) return;
    void *body = malloc(response->body_size);
    size_t size = body ? (is_zstd ? zstd : gzip)(body, response->body, response->body_size) : 0;
    if (!size) {
        free(body);
        return;
    }
    free(response->body);
    response->body = body;
    response->body_size = size;
    api_answer_header(response, "Content-Encoding", is_zstd ? "zstd" : "gzip");
}
