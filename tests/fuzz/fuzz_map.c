/*
 * fuzz_map.c - libFuzzer over the readers of map files (`make fuzz`).
 *
 * The first byte picks kind, channel and options; the rest is the file.  What the
 * readers accept and is small goes on through the whole endpoint.
 */
#include "api.h"
#include "exr.h"
#include "png_read.h"

#include <stdint.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { SMALL = 1 << 11 }; /* pixels */

static const char *const queries[8] = {
    "",
    "type=half&form=central&border=clamp",
    "kind=normal&model=clean_max",
    "kind=slope&channel=R,G&encoding=unorm_mid",
    "channel=Y&border=mirror&stencil=central&compression=none",
    "at=0.3,0.7&level=1&model=clean",
    "preview=anisotropy",
    "border=trim&stencil=forward&type=half&force=true&base_alpha=0.1&base_ndf=ggx",
};
/* Those the queries read, so that what is large is known before the endpoint sees it. */
static const char *const channels[8] = {NULL, NULL, "R", "G", "Y", NULL, NULL, NULL};

static void read_one(const uint8_t *data, size_t size, const char *channel, size_t *pixels)
{
    struct image image = {0};
    struct image_problem problem = {0};
    const enum image_status status = (api_png_is(data, size) ? api_png_read : api_exr_read)(
        data, size, channel, NULL, &image, &problem);
    *pixels = status == IMAGE_OK ? image.width * image.height : 0;
    /* Half an answer is a bug. */
    if (status == IMAGE_OK ? !image.values : image.values || !*problem.text) abort();
    /* Every value is there. */
    float sum = 0;
    for (size_t i = 0; i < *pixels; i++) sum += image.values[i] * 0;
    if (*pixels && image.released) abort();
    if (sum > 0) abort();
    api_image_clear(&image);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static bool is_open;
    size_t pixels;
    if (!is_open) is_open = api_open();
    if (size < 1) return 0;
    /* A copy of its own, so that a byte read past the end is seen. */
    uint8_t *body = malloc(size - 1 ? size - 1 : 1);
    if (!body) return 0;
    for (size_t i = 1; i < size; i++) body[i - 1] = data[i];
    read_one(body, size - 1, channels[*data % 8], &pixels);
    if (pixels <= SMALL) {
        const struct api_request request = {.method = "POST",
                                            .path = "/v1/leadr",
                                            .query = queries[*data % 8],
                                            .body = body,
                                            .body_size = size - 1};
        struct api_response response;
        api_handle(&request, &response);
        if (response.status == 500) abort();
        api_response_clear(&response);
    }
    free(body);
    return 0;
}
