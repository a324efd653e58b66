#define _DEFAULT_SOURCE /* madvise, MAP_ANONYMOUS */
#include "image.h"
#include "facet_leadr.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

enum { RELEASED_AT_ONCE = 1 << 18 }; /* bytes */

/*
 * Large planes are the system's own pages: malloc would keep those of a finished
 * request for the next one, beside what that one holds already.  An instrumented
 * build wants to see them as blocks.
 */
enum { OWN_PAGES_MIN = 1 << 20 };

static size_t size_of(const struct image *image)
{
    return image->width * image->height * sizeof *image->values;
}

static bool has_own_pages(const struct image *image)
{
    return !SANITIZED && size_of(image) >= OWN_PAGES_MIN;
}

static float *allocate(const struct image *image)
{
    if (!has_own_pages(image)) return malloc(size_of(image));
    void *pages = mmap(NULL, size_of(image), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS,
                       -1, 0);
    return pages == MAP_FAILED ? NULL : pages;
}

void api_image_clear(struct image *image)
{
    if (image->values && has_own_pages(image))
        munmap(image->values, size_of(image));
    else
        free(image->values);
    image->values = NULL;
}

/*
 * The pages stay the allocator's, but empty: the next reader of them would find
 * zeros.  A hint; where it fails the memory goes with the image.
 */
void api_image_release(struct image *image, size_t rows)
{
    const size_t row = image->width * sizeof *image->values, page = (size_t)sysconf(_SC_PAGESIZE);
    if (!image->values || rows > image->height || (rows - image->released) * row < RELEASED_AT_ONCE)
        return;
    const uintptr_t start = (uintptr_t)image->values;
    const uintptr_t from = (start + image->released * row + page - 1) / page * page;
    const uintptr_t to = (start + rows * row) / page * page;
    if (to > from) (void)madvise((void *)from, to - from, MADV_DONTNEED);
    image->released = rows;
}

enum image_status api_image_problem(struct image_problem *problem, enum image_status status,
                                    const char *format, ...)
{
    va_list list;
    va_start(list, format);
    vsnprintf(problem->text, sizeof problem->text, format, list);
    va_end(list);
    return problem->status = status;
}

enum image_status api_image_check(size_t width, size_t height, struct image_problem *problem)
{
    if (width == 0 || height == 0)
        return api_image_problem(problem, IMAGE_DAMAGED, "the image has no pixels");
    if (width > FACET_MAP_SIDE_MAX || height > FACET_MAP_SIDE_MAX ||
        width * height > FACET_MAP_PIXELS_MAX)
        return api_image_problem(problem, IMAGE_TOO_LARGE,
                                 "the image has %zu x %zu pixels; at most %d a side and %zu in all",
                                 width, height, FACET_MAP_SIDE_MAX, FACET_MAP_PIXELS_MAX);
    return IMAGE_OK;
}

enum image_status api_image_open(struct image *image, size_t width, size_t height,
                                 struct image_problem *problem)
{
    *image = (struct image){.width = width, .height = height};
    const enum image_status status = api_image_check(width, height, problem);
    if (status != IMAGE_OK) return status;
    image->values = allocate(image);
    if (!image->values) return api_image_problem(problem, IMAGE_NO_MEMORY, "out of memory");
    return IMAGE_OK;
}
