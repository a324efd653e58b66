/*
 * page.h - the page for people at GET /: the files of page/, embedded at build by page/embed.sh, which
 * writes page_files.
 */
#ifndef PAGE_H
#define PAGE_H

#include "api.h"

struct page_bytes {
    const char *begin, *end;
};

struct page_file {
    const char *path, *type;
    struct page_bytes plain, gzip;
};

/* Ended by a NULL path.  Hidden, so that no table of addresses stands between. */
#pragma GCC visibility push(hidden)
extern const struct page_file page_files[];
#pragma GCC visibility pop

/* Before the first request: false serves none (--no-page). */
void page_open(bool serves);

/* NULL if there is none at this path, or none at all. */
const struct page_file *page_find(const char *path);

/* GET and HEAD; anything else is refused with 405. */
void page_answer(const struct page_file *file, const struct api_request *request,
                 struct api_response *response);

#endif
