#include "image.h"
#include "facet_leadr.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

void api_image_clear(struct image *image)
{
    free(image->values);
    image->values = NULL;
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
    image->values = malloc(width * height * sizeof *image->values);
    if (!image->values) return api_image_problem(problem, IMAGE_NO_MEMORY, "out of memory");
    return IMAGE_OK;
}
