/* POST /v1/leadr through the one door: real maps with known slopes, options, refusals, bad files. */
#include "api.h"
#include "ask.h"
#include "check.h"
#include "exr.h"
#include "exr_file.h"
#include "facet_leadr.h"
#include "files.h"
#include "pfm.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/*
 * api_open gives jansson an allocator that counts; what this file parses and
 * prints itself goes by the plain one, restored around each call.
 */
static void handle(const struct api_request *request, struct api_response *response)
{
    static json_malloc_t counted;
    static json_free_t uncounted;
    if (!counted) {
        api_open();
        json_get_alloc_funcs(&counted, &uncounted);
    }
    json_set_alloc_funcs(counted, uncounted);
    api_handle(request, response);
    json_set_alloc_funcs(malloc, free);
}

static struct api_response post(const char *path, const char *query, const char *accept,
                                const void *body, size_t size)
{
    const struct api_request request = {.method = "POST",
                                        .path = path,
                                        .query = query,
                                        .accept = accept,
                                        .body = body,
                                        .body_size = size};
    struct api_response response;
    handle(&request, &response);
    return response;
}

static json_t *post_json(const char *path, const char *query, const void *body, size_t size,
                         int expected_status)
{
    struct api_response r = post(path, query, "application/json", body, size);
    CHECK_INT(r.status, expected_status);
    json_t *json = json_loadb(r.body, r.body_size, 0, NULL);
    CHECK(json);
    api_response_clear(&r);
    return json;
}

static double number_at(const json_t *json, const char *list, size_t index)
{
    return answer_value(json_array_get(json_object_get(json, list), index));
}

/* E1..E5 of the coarsest level, as stored. */
static void coarsest(const json_t *json, double e[5])
{
    const json_t *levels = json_object_get(json, "levels");
    const json_t *last = json_array_get(levels, json_array_size(levels) - 1);
    CHECK_INT(json_integer_value(json_object_get(last, "width")), 1);
    CHECK_INT(json_integer_value(json_object_get(last, "height")), 1);
    const json_t *texel = json_array_get(json_object_get(last, "moments"), 0);
    CHECK_INT(json_array_size(texel), 5);
    for (size_t k = 0; k < 5; k++) e[k] = answer_value(json_array_get(texel, k));
}

struct surface {
    float *z;
    size_t width, height, size;
    unsigned char *exr;
    const struct microsurface *known;
};

static bool open_surface(int i, struct surface *s)
{
    const char *path = check_data(microsurfaces[i].path);
    *s = (struct surface){.known = &microsurfaces[i]};
    s->z = path ? pfm_read(path, &s->width, &s->height) : NULL;
    s->exr = s->z ? exr_file_of_heights(s->z, s->width, s->height, &s->size) : NULL;
    if (!s->exr) check_skip("no shared data");
    return s->exr;
}

static void close_surface(struct surface *s)
{
    free(s->z);
    free(s->exr);
}

/*
 * The published rms slopes leave out the last row and column, where a forward
 * difference needs a border: that is border=trim, whose level 0 is (n-1)^2.
 */
TEST(known_slopes_of_microsurfaces)
{
    struct surface s;
    for (int i = 0; i < 3 && open_surface(i, &s); i++) {
        char query[128];
        snprintf(query, sizeof query, "stencil=forward&border=trim&texel=%.17g", s.known->texel);
        json_t *json = post_json("/v1/leadr", query, s.exr, s.size, 200);
        double e[5];
        coarsest(json, e);
        CHECK_REL(sqrt(e[2] + e[3]), s.known->rms_slope, 1e-6, 0);
        check_note("relative error", fabs(sqrt(e[2] + e[3]) / s.known->rms_slope - 1));
        json_decref(json);
        close_surface(&s);
    }
}

/* With any other border the same texels of level 0 hold the same: read back from the EXR answered. */
TEST(known_slopes_from_level_0_of_the_exr)
{
    struct surface s;
    for (int i = 0; i < 3 && open_surface(i, &s); i++) {
        char query[128];
        snprintf(query, sizeof query, "stencil=forward&compression=zip&texel=%.17g",
                 s.known->texel);
        struct api_response r = post("/v1/leadr", query, "*/*", s.exr, s.size);
        CHECK_INT(r.status, 200);
        CHECK_STR(r.content_type, "image/x-exr");
        double sum = 0;
        for (int k = 3; k <= 4; k++) {
            struct image plane;
            struct image_problem problem = {0};
            CHECK_INT(
                api_exr_read(r.body, r.body_size, k == 3 ? "E3" : "E4", NULL, &plane, &problem),
                IMAGE_OK);
            CHECK(plane.width == s.width && plane.height == s.height);
            for (size_t p = 0; plane.values && p < s.width * s.height; p++)
                if (p % s.width < s.width - 1 && p / s.width < s.height - 1) sum += plane.values[p];
            api_image_clear(&plane);
        }
        const double n = (double)(s.width - 1) * (double)(s.height - 1);
        CHECK_REL(sqrt(sum / n), s.known->rms_slope, 1e-6, 0);
        api_response_clear(&r);
        close_surface(&s);
    }
}

/* Central differences, periodic, summed here in double straight from the heights. */
TEST(coarsest_level_is_the_direct_sum)
{
    struct surface s;
    for (int i = 0; i < 3 && open_surface(i, &s); i++) {
        const size_t w = s.width, h = s.height;
        char query[96];
        snprintf(query, sizeof query, "stencil=central&texel=%.17g", s.known->texel);
        json_t *json = post_json("/v1/leadr", query, s.exr, s.size, 200);
        double e[5], sum = 0;
        coarsest(json, e);
        for (size_t q = 0; q < h; q++)
            for (size_t p = 0; p < w; p++) {
                const double x = (double)s.z[q * w + (p + 1) % w] - s.z[q * w + (p + w - 1) % w];
                const double y = (double)s.z[(q + 1) % h * w + p] - s.z[(q + h - 1) % h * w + p];
                sum += x * x + y * y;
            }
        const double rms = sqrt(sum / (double)(w * h)) / (2 * s.known->texel);
        CHECK_REL(sqrt(e[2] + e[3]), rms, 1e-6, 0);
        check_note("relative error", fabs(sqrt(e[2] + e[3]) / rms - 1));
        CHECK_REL(sqrt(number_at(json, "moments", 2) + number_at(json, "moments", 3)), rms, 1e-12,
                  0);
        json_decref(json);
        close_surface(&s);
    }
}

/* On measured microsurfaces: central differences keep 47 %, 75 % and 78 % of the variance forward
 * ones see. */
TEST(stencils_are_compared)
{
    const double kept[] = {0.47, 0.75, 0.78};
    struct surface s;
    for (int i = 0; i < 3 && open_surface(i, &s); i++) {
        json_t *json = post_json("/v1/leadr", "border=trim", s.exr, s.size, 200);
        const json_t *stencils = json_object_get(json, "stencils");
        CHECK_INT(json_array_size(stencils), FACET_STENCIL_COUNT);
        for (size_t k = 0; k < FACET_STENCIL_COUNT; k++) {
            const double ratio = answer_value(
                json_object_get(json_array_get(stencils, k), "ratio"));
            if (k == FACET_CENTRAL) CHECK(fabs(ratio - kept[i]) < 0.01);
            if (k == FACET_FORWARD) CHECK(ratio == 1);
            if (k == FACET_BILINEAR) CHECK(ratio > kept[i] && ratio < 1);
        }
        json_decref(json);
        close_surface(&s);
    }
}

TEST(flat_map_is_zero)
{
    static const char body[] = "{\"heights\":[[0.1,0.1,0.1],[0.1,0.1,0.1],[0.1,0.1,0.1]]}";
    json_t *json = post_json("/v1/leadr", NULL, body, strlen(body), 200);
    const json_t *levels = json_object_get(json, "levels");
    CHECK_INT(json_array_size(levels), 2);
    for (size_t l = 0; l < 2; l++) {
        const json_t *moments = json_object_get(json_array_get(levels, l), "moments");
        CHECK_INT(json_array_size(moments), l ? 1 : 9);
        for (size_t i = 0; i < json_array_size(moments); i++)
            for (size_t k = 0; k < 5; k++)
                CHECK(answer_value(json_array_get(json_array_get(moments, i), k)) == 0);
    }
    CHECK(json_is_true(json_object_get(json, "floored")));
    json_decref(json);

    float z[64];
    for (int i = 0; i < 64; i++) z[i] = 0.1f;
    size_t size = 0;
    unsigned char *exr = exr_file_of_heights(z, 8, 8, &size);
    struct api_response r = post("/v1/leadr", "stencil=bilinear&border=mirror", NULL, exr, size);
    CHECK_INT(r.status, 200);
    for (int k = 0; k < 5; k++) {
        static const char *const names[] = {"E1", "E2", "E3", "E4", "E5"};
        struct image plane;
        struct image_problem problem = {0};
        CHECK_INT(api_exr_read(r.body, r.body_size, names[k], NULL, &plane, &problem), IMAGE_OK);
        for (int i = 0; plane.values && i < 64; i++) CHECK(plane.values[i] == 0);
        api_image_clear(&plane);
    }
    api_response_clear(&r);
    free(exr);
}

/* Heights on a large offset: only the differences matter, to the last bit. */
TEST(plane_on_an_offset)
{
    static const char body[] =
        "{\"heights\":[[1000000.5,1000000.25],[1000000.625,1000000.375],[1000000.75,1000000.5]],"
        "\"texel\":0.5,\"border\":\"clamp\",\"y\":\"up\",\"base_alpha\":0.5}";
    json_t *json = post_json("/v1/leadr", NULL, body, strlen(body), 200);
    const double want[] = {-0.5, -0.25, 0.25 + 0.125, 0.0625 + 0.125, 0.125};
    for (size_t k = 0; k < 5; k++) CHECK(number_at(json, "moments", k) == want[k]);
    const json_t *material = json_object_get(json, "material");
    CHECK(answer_value(json_object_get(material, "alpha_x")) == 0.5);
    CHECK(answer_value(json_object_get(material, "alpha_y")) == 0.5);
    CHECK(answer_value(json_object_get(material, "rho")) == 0);
    json_decref(json);
}

/* The material goes back as it came. */
TEST(material_is_ready_for_eval)
{
    static const char body[] = "{\"heights\":[[0,1,0,1],[1,0,2,0],[0,1,0,1],[1,0,1,0]],"
                               "\"scale\":0.1,\"stencil\":\"bilinear\",\"form\":\"central\"}";
    json_t *json = post_json("/v1/leadr", NULL, body, strlen(body), 200);
    json_t *request = json_pack("{s:O,s:[[f,f,f]],s:[[f,f,f]]}", "material",
                                json_object_get(json, "material"), "wi", 0.6, 0.0, 0.8, "wo", 0.0,
                                0.6, 0.8);
    char *text = request ? json_dumps(request, 0) : NULL;
    CHECK(text);
    if (text) {
        json_t *answer = post_json("/v1/eval", NULL, text, strlen(text), 200);
        CHECK(number_at(answer, "fr", 0) > 0);
        json_decref(answer);
    }
    free(text);
    json_decref(request);
    json_decref(json);
}

static void check_refusal(const char *query, const void *body, size_t size, int status,
                          const char *pointer)
{
    json_t *json = post_json("/v1/leadr", query, body, size, status);
    const json_t *errors = json_object_get(json, "errors");
    if (pointer)
        CHECK_STR(json_string_value(json_object_get(json_array_get(errors, 0), "pointer")),
                  pointer);
    json_decref(json);
}

TEST(refusals)
{
    float z[64] = {0};
    size_t size = 0, bad_size = 0;
    unsigned char *exr = exr_file_of_heights(z, 8, 8, &size);
    z[19] = NAN;
    unsigned char *bad = exr_file_of_heights(z, 8, 8, &bad_size);
    check_refusal(NULL, bad, bad_size, 422, NULL);
    check_refusal("kind=normal", exr, size, 422, "/channel");
    check_refusal("kind=slope", exr, size, 422, "/channel");
    check_refusal("kind=bump", exr, size, 422, "/kind");
    check_refusal("type=double", exr, size, 422, "/type");
    check_refusal("texel=0", exr, size, 422, "/texel");
    check_refusal("texel=nan", exr, size, 422, "/texel");
    check_refusal("scale=inf", exr, size, 422, "/scale");
    check_refusal("base_alpha=-1", exr, size, 422, "/base_alpha");
    check_refusal("channel=R", exr, size, 422, "/channel");
    check_refusal("heights=1", exr, size, 422, "/heights");
    check_refusal("sclae=1", exr, size, 422, "/sclae");
    check_refusal(NULL, "{}", 2, 422, "/heights");
    check_refusal(NULL, "{\"heights\":[[0,1],[0]]}", 23, 422, NULL);
    check_refusal(NULL, "{\"heights\":[[0,1e300],[0,1]]}", 29, 422, "/heights/0/1");
    check_refusal("border=trim&stencil=central", "{\"heights\":[[0,1],[0,1]]}", 25, 422, "/border");
    check_refusal(NULL, exr, size / 2, 422, NULL);
    check_refusal(NULL, "no map at all", 13, 415, NULL);
    free(exr);
    free(bad);
}

/* Slopes of 1000 do not fit half: said, not clipped. */
TEST(half_overflow_is_refused)
{
    static const char body[] = "{\"heights\":[[0,1000],[0,1000]],\"texel\":1,\"type\":\"half\","
                               "\"stencil\":\"forward\",\"border\":\"clamp\"}";
    check_refusal(NULL, body, strlen(body), 422, NULL);
}

static bool at_once(void *user)
{
    (void)user;
    return true;
}

TEST(cancelled)
{
    static const char body[] = "{\"heights\":[[0,1],[0,1]]}";
    const struct api_request request = {.method = "POST",
                                        .path = "/v1/leadr",
                                        .body = body,
                                        .body_size = strlen(body),
                                        .cancelled = at_once};
    struct api_response r;
    handle(&request, &r);
    CHECK(r.status >= 400);
    api_response_clear(&r);
}

static double slowest;
static const char *query_of_all;

static void post_file(const char *path, const void *bytes, size_t size)
{
    struct timespec a, b;
    clock_gettime(CLOCK_MONOTONIC, &a);
    struct api_response r = post("/v1/leadr", query_of_all, NULL, bytes, size);
    clock_gettime(CLOCK_MONOTONIC, &b);
    slowest = fmax(slowest,
                   1e3 * (double)(b.tv_sec - a.tv_sec) + 1e-6 * (double)(b.tv_nsec - a.tv_nsec));
    const bool answered = r.status == 200 || r.status == 413 || r.status == 415 || r.status == 422;
    if (!answered || !r.body) check_fail(__FILE__, __LINE__, "%s: status %d", path, r.status);
    if (r.status == 200 && strcmp(r.content_type, "image/x-exr"))
        check_fail(__FILE__, __LINE__, "%s: answered %s", path, r.content_type);
    api_response_clear(&r);
}

static void post_folder(const char *relative, size_t least)
{
    char path[512];
    const char *folder = check_data(relative);
    if (!folder) {
        check_skip("no shared data");
        return;
    }
    snprintf(path, sizeof path, "%s", folder);
    slowest = 0;
    CHECK(files_each(path, post_file) >= least);
    check_note("slowest, ms", slowest);
}

TEST(every_exr_as_body)
{
    query_of_all = NULL;
    post_folder("exr", 200);
}

TEST(every_png_as_body)
{
    query_of_all = "type=half&form=central";
    post_folder("png", 180);
}

TEST(real_height_maps_convert)
{
    static const char *const maps[] = {"heights/dem/Mount1.png",
                                       "heights/dem/crater_dat.png",
                                       "heights/texture/brick.png",
                                       "heights/texture/gravel.png",
                                       "heights/texture/grass.png",
                                       "heights/dem/earth-topology.png",
                                       "heights/texture/materialx_plain_heightmap.png",
                                       "heights/microsurface/interferometer_matrix2_16.png"};
    for (size_t i = 0; i < sizeof maps / sizeof *maps; i++) {
        const char *path = check_data(maps[i]);
        size_t size = 0;
        void *bytes = path ? check_read_file(path, &size) : NULL;
        if (!bytes) {
            check_skip("no shared data");
            return;
        }
        struct api_response r = post("/v1/leadr", "scale=0.05", NULL, bytes, size);
        CHECK_INT(r.status, 200);
        CHECK(r.body && api_exr_is(r.body, r.body_size));
        api_response_clear(&r);
        json_t *json = post_json("/v1/leadr", "scale=0.05", bytes, size, 200);
        CHECK(answer_value(json_object_get(json_object_get(json, "material"), "alpha_x")) > 0);
        json_decref(json);
        free(bytes);
    }
}
