#include "page.h"

#include "site.h"

#include <stdlib.h>
#include <string.h>

static bool serves_page = true;

void page_open(bool serves)
{
    serves_page = serves;
}

const struct page_file *page_find(const char *path)
{
    if (!serves_page || *path != '/') return NULL;
    for (const struct page_file *file = page_files; file->path;
         file++) /* the first letter: every request asks thrice */
        if (file->path[1] == path[1] && !strcmp(file->path, path)) return file;
    return NULL;
}

/*
 * Nothing but what this daemon serves, no inline code or style; blob: are the pictures it computes
 * (previews of maps, the lobes of a fit).
 */
static const char policy[] =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; "
    "require-trusted-types-for 'script'";

void page_answer(const struct page_file *file, const struct api_request *request,
                 struct api_response *response)
{
    if (strcmp(request->method, "GET")) { /* HEAD comes as GET */
        site_refuse_method(file->path, response);
        return;
    }
    const bool packed = api_takes_gzip(request->accept_encoding);
    const struct page_bytes bytes = packed ? file->gzip : file->plain;
    const size_t size = (size_t)(bytes.end - bytes.begin);
    char *body = malloc(size ? size : 1);
    if (!body) {
        api_refuse(503, "out of memory", response);
        return;
    }
    memcpy(body, bytes.begin, size);
    *response = (struct api_response){
        .status = 200, .content_type = file->type, .body = body, .body_size = size};
    if (packed) site_put_header(response, "Content-Encoding", "gzip");
    site_put_header(response, "Vary", "Accept-Encoding");
    site_put_header(response, "Content-Security-Policy", policy);
    site_put_header(response, "X-Content-Type-Options", "nosniff");
    site_put_header(response, "Referrer-Policy", "no-referrer");
}
