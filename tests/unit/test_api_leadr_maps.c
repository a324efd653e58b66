/* POST /v1/leadr beyond displacement: normal and slope maps, CLEAN, raw half, one texel, pictures. */
#include "ask.h"
#include "check.h"
#include "exr.h"
#include "exr_file.h"
#include "png_read.h"
#include "png_write.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static struct answer post(const char *query, const char *accept, const void *body, size_t size)
{
    return ask_with((struct api_request){.method = "POST",
                                         .path = "/v1/leadr",
                                         .query = query,
                                         .accept = accept,
                                         .body = body,
                                         .body_size = size});
}

static struct answer post_json(const char *query, const void *body, size_t size)
{
    return post(query, "application/json", body, size);
}

static void check_refused(const char *query, const void *body, size_t size, const char *pointer,
                          const char *words)
{
    struct answer a = post_json(query, body, size);
    CHECK_INT(a.response.status, 422);
    if (pointer) CHECK_STR(answer_error(&a, "pointer"), pointer);
    const char *detail = pointer ? answer_error(&a, "detail") : answer_text(&a, "detail");
    if (!detail || !strstr(detail, words))
        check_fail(__FILE__, __LINE__, "%s: \"%s\" does not say \"%s\"", query, detail, words);
    answer_clear(&a);
}

/* ---- One surface in three kinds ------------------------------------------------------------- */

enum { W = 48, H = 30 };

static struct {
    float z[W * H], x[W * H], y[W * H], n[3][W * H];
} surface;

/* Smooth waves, their central slopes in units of texel 1, and normals of some length. */
static void make_surface(void)
{
    const double t = 2 * acos(-1);
    for (int i = 0; i < W * H; i++)
        surface.z[i] = (float)(sin(t * 3 * (i % W) / W) * cos(t * 2 * (i / W) / H) +
                               0.3 * cos(t * 7 * (i % W) / W + 1));
    for (int i = 0; i < W * H; i++) {
        const int p = i % W, q = i / W;
        const float *z = surface.z;
        surface.x[i] = 0.5f * (z[q * W + (p + 1) % W] - z[q * W + (p + W - 1) % W]);
        surface.y[i] = 0.5f * (z[(q + 1) % H * W + p] - z[(q + H - 1) % H * W + p]);
        const double length = 1 + 0.5 * (i % 3);
        surface.n[0][i] = (float)(-surface.x[i] * length);
        surface.n[1][i] = (float)(-surface.y[i] * length);
        surface.n[2][i] = (float)length;
    }
}

static unsigned char *exr_of(const char *const names[4], const float *a, const float *b,
                             const float *c, size_t *size)
{
    const struct exr_file f = {.width = W,
                               .height = H,
                               .channels = {names[0], names[1], names[2]},
                               .type = EXR_FILE_FLOAT,
                               .planes = {a, b, c}};
    return exr_file(&f, size);
}

static void check_moments(const struct answer *a, const struct answer *b, double bound)
{
    CHECK_INT(a->response.status, 200);
    for (size_t k = 0; k < 5; k++)
        CHECK_REL(answer_number(a, "moments", k), answer_number(b, "moments", k), bound, 0.1);
}

TEST(height_normal_and_slope_maps_of_a_surface_agree)
{
    size_t size[3];
    make_surface();
    unsigned char *height = exr_file_of_heights(surface.z, W, H, &size[0]);
    /* Channels stand in a file by name: B holds n_z. */
    unsigned char *normal = exr_of((const char *const[4]){"B", "G", "R"}, surface.n[2],
                                   surface.n[1], surface.n[0], &size[1]);
    unsigned char *slope = exr_of((const char *const[4]){"sx", "sy"}, surface.x, surface.y, NULL,
                                  &size[2]);
    struct answer h = post_json("stencil=central&texel=1&scale=2&base_alpha=0.1", height, size[0]);
    struct answer n = post_json("kind=normal&scale=2&base_alpha=0.1", normal, size[1]);
    struct answer s = post_json("kind=slope&channel=sx,sy&scale=2&base_alpha=0.1", slope, size[2]);
    CHECK_INT(h.response.status, 200);
    check_moments(&n, &h, 1e-6);
    check_moments(&s, &h, 1e-6);
    CHECK_STR(answer_text(&n, "encoding"), "signed");
    CHECK(!json_object_get(n.json, "stencils") && !json_object_get(n.json, "texel"));
    answer_clear(&h);
    answer_clear(&n);
    answer_clear(&s);
    check_refused("kind=slope", slope, size[2], "/channel", "only: sx, sy");
    check_refused("kind=slope&channel=sx", slope, size[2], "/channel", "names 1 channels");
    check_refused("kind=normal&texel=1", normal, size[1], "/texel", "displacement");
    check_refused("encoding=unorm", height, size[0], "/encoding", "normal and slope");
    check_refused("kind=normal", "{\"heights\":[[0,1],[1,0]]}", 25, "/kind", "file");
    free(normal);
    surface.n[2][5 * W + 3] = 0;
    surface.n[2][9 * W + 1] = -1;
    normal = exr_of((const char *const[4]){"B", "G", "R"}, surface.n[2], surface.n[1], surface.n[0],
                    &size[1]);
    check_refused("kind=normal", normal, size[1], NULL,
                  "2 normals are not finite or do not point up, the first in column 3 of row 5");
    free(height);
    free(normal);
    free(slope);
}

/* The same through 8 bits: what a code is worth. */
TEST(normal_map_of_8_bits)
{
    static unsigned char rgb[3 * W * H];
    void *png = NULL;
    size_t size = 0, exr_size;
    struct image_problem problem;
    make_surface();
    for (int i = 0; i < W * H; i++) {
        const double x = -surface.x[i], y = -surface.y[i], l = sqrt(x * x + y * y + 1);
        rgb[3 * i] = (unsigned char)rint(127.5 + 127.5 * x / l);
        rgb[3 * i + 1] = (unsigned char)rint(127.5 + 127.5 * y / l);
        rgb[3 * i + 2] = (unsigned char)rint(127.5 + 127.5 / l);
    }
    CHECK_INT(api_png_write(rgb, W, H, &png, &size, &problem), IMAGE_OK);
    unsigned char *exr = exr_file_of_heights(surface.z, W, H, &exr_size);
    struct answer h = post_json("stencil=central&texel=1", exr, exr_size);
    struct answer n = post_json("kind=normal", png, size);
    check_moments(&n, &h, 0.02);
    CHECK_STR(answer_text(&n, "encoding"), "unorm");
    answer_clear(&h);
    answer_clear(&n);
    free(exr);
    free(png);
    /* Flat with 128 for 0: exactly flat as unorm_mid, and off by half a code as unorm. */
    for (int i = 0; i < W * H; i++) rgb[3 * i] = rgb[3 * i + 1] = 128, rgb[3 * i + 2] = 255;
    CHECK_INT(api_png_write(rgb, W, H, &png, &size, &problem), IMAGE_OK);
    n = post_json("kind=normal&encoding=unorm_mid", png, size);
    for (size_t k = 0; k < 5; k++) CHECK(fabs(answer_number(&n, "moments", k)) < 1e-15);
    answer_clear(&n);
    n = post_json("kind=normal", png, size);
    CHECK_REL(answer_number(&n, "moments", 0), -1 / 255.0, 1e-7, 0);
    answer_clear(&n);
    free(png);
}

TEST(real_normal_maps_convert)
{
    static const char *const maps[] = {"normals/materialx_mesh_wire_norm.png"};
    for (size_t i = 0; i < sizeof maps / sizeof *maps; i++) {
        const char *path = check_data(maps[i]);
        size_t size = 0;
        void *file = path ? check_read_file(path, &size) : NULL;
        if (!file) {
            check_skip("no shared data");
            return;
        }
        struct answer a = post_json("kind=normal&y=up", file, size);
        CHECK_INT(a.response.status, 200);
        CHECK(answer_number(&a, "moments", 2) > 1e-4 && answer_number(&a, "moments", 2) < 10);
        CHECK(json_object_get(a.json, "material"));
        answer_clear(&a);
        free(file);
    }
}

/* ---- Storing
 * -------------------------------------------------------------------------------------- */

static unsigned char *steep(size_t *size)
{
    enum { N = 64 };
    static float z[N * N];
    struct rng rng;
    rng_seed(&rng, 2);
    for (int i = 0; i < N * N; i++) z[i] = 4 * (float)(i % N) + 0.05f * (float)rng_uniform(&rng);
    return exr_file_of_heights(z, N, N, size);
}

TEST(raw_half_is_refused_where_it_loses_variance)
{
    size_t size = 0;
    unsigned char *exr = steep(&size);
    check_refused("border=clamp&texel=1&type=half", exr, size, "/form", "form=central");
    const char *const kept[] = {
        "border=clamp&texel=1&type=half&form=central", "border=clamp&texel=1&type=half&force=true",
        "border=clamp&texel=1&type=half&base_alpha=2", "border=clamp&texel=1"};
    for (int i = 0; i < 4; i++) {
        struct answer a = post(kept[i], NULL, exr, size);
        CHECK_INT(a.response.status, 200);
        CHECK_STR(a.response.content_type, "image/x-exr");
        answer_clear(&a);
        a = post_json(kept[i], exr, size);
        const json_t *error = json_object_get(a.json, "variance_error");
        const double level = answer_value(json_object_get(error, "level"));
        CHECK(i == 1 ? level > 0.01 : level < 0.01);
        if (i == 1 || i == 2) CHECK((answer_text(&a, "warning") != NULL) == (i == 1));
        answer_clear(&a);
    }
    /* Slopes of 1e-5 have variances below what half holds. */
    check_refused("border=clamp&texel=1&type=half&form=central&scale=1e-5", exr, size, "/type",
                  "use type=float");
    struct answer a = post("border=clamp&texel=1&type=half", NULL, exr, size);
    CHECK_INT(a.response.status, 422);
    answer_clear(&a);
    free(exr);
}

static float first_value(const struct answer *a, const char *channel)
{
    struct image image;
    struct image_problem problem = {0};
    CHECK_INT(
        api_exr_read(a->response.body, a->response.body_size, channel, NULL, &image, &problem),
        IMAGE_OK);
    const float value = image.values ? image.values[0] : NAN;
    api_image_clear(&image);
    return value;
}

TEST(clean_maps)
{
    static const char body[] = "{\"heights\":[[0,1,3],[0,2,3],[0,1,4]]}";
    static const char query[] = "stencil=bilinear&border=trim&texel=1";
    char text[160];
    double alpha2[2];
    for (int max = 0; max < 2; max++) {
        snprintf(text, sizeof text, "%s&model=clean%s&form=central", query, max ? "_max" : "");
        struct answer a = post(text, "image/x-exr", body, strlen(body));
        CHECK_INT(a.response.status, 200);
        alpha2[max] = first_value(&a, "A2");
        const float x = first_value(&a, "E1"), y = first_value(&a, "E2");
        answer_clear(&a);
        snprintf(text, sizeof text, "%s&model=clean%s", query, max ? "_max" : "");
        a = post(text, "image/x-exr", body, strlen(body));
        CHECK_REL(first_value(&a, "E3"), alpha2[max] + x * x + y * y, 1e-6, 0);
        answer_clear(&a);
    }
    /* The cell of 0 1 / 0 2: x 1 .. 2, y 0 .. 1, each of variance 1/12, uncorrelated. */
    CHECK_REL(alpha2[0], 1.0 / 6, 1e-6, 0);
    CHECK_REL(alpha2[1], 1.0 / 6, 1e-6, 0);
}

TEST(a_base_of_any_form)
{
    static const char flat[] = "{\"heights\":[[0,0],[0,0]]}";
    const char *const queries[] = {"base_alpha=0.3",
                                   "base_alpha_x=0.3&base_alpha_y=0.2&base_rho=0.5",
                                   "base_alpha=0.3&base_ndf=ggx"};
    const double xx[] = {0.045, 0.045, 0.045 * 1.113287129283 * 1.113287129283};
    for (int i = 0; i < 3; i++) {
        struct answer a = post_json(queries[i], flat, strlen(flat));
        CHECK_INT(a.response.status, 200);
        CHECK_REL(answer_number(&a, "moments", 2), xx[i], 1e-14, 0);
        CHECK((answer_text(&a, "base_note") != NULL) == (i == 2));
        if (i == 1) CHECK_REL(answer_number(&a, "moments", 4), 0.5 * 0.3 * 0.2 / 2, 1e-14, 0);
        answer_clear(&a);
    }
    check_refused("base_alpha_x=0.1", flat, strlen(flat), "/base_alpha_y", "required");
    check_refused("base_rho=0.1", flat, strlen(flat), "/base_alpha_x", "required");
    check_refused("base_alpha=1&base_alpha_x=0.1&base_alpha_y=1", flat, strlen(flat), "/base_alpha",
                  "beside");
}

/* ---- One texel
 * ----------------------------------------------------------------------------------- */

TEST(one_texel_is_the_stored_one)
{
    size_t size = 0;
    make_surface();
    unsigned char *exr = exr_file_of_heights(surface.z, W, H, &size);
    /* 48 x 30: level 3 is 6 x 3, level 4 is 3 x 1. */
    struct answer all = post_json("texel=1&form=central", exr, size);
    for (int column = 0; column < 3; column++) {
        char query[80];
        snprintf(query, sizeof query, "texel=1&form=central&level=4&at=%.3f,0.99",
                 (column + 0.5) / 3);
        struct answer a = post(query, NULL, exr, size);
        CHECK_INT(a.response.status, 200);
        CHECK_STR(a.response.content_type, "application/json");
        const json_t *probe = json_object_get(a.json, "probe");
        CHECK_INT(json_integer_value(json_object_get(probe, "column")), column);
        CHECK_INT(json_integer_value(json_object_get(probe, "row")), 0);
        CHECK_INT(json_integer_value(json_object_get(probe, "width")), 3);
        const json_t *level = json_array_get(json_object_get(all.json, "levels"), 4);
        const json_t *want = json_array_get(json_object_get(level, "moments"), (size_t)column);
        double e[5], v[5];
        for (size_t k = 0; k < 5; k++) {
            e[k] = answer_value(json_array_get(json_object_get(probe, "moments"), k));
            v[k] = answer_value(json_array_get(want, k));
        }
        CHECK(e[0] == v[0] && e[1] == v[1]);
        CHECK_REL(e[2] - e[0] * e[0], v[2], 1e-12, 1e-3);
        CHECK_REL(e[4] - e[0] * e[1], v[4], 1e-12, 1e-3);
        const json_t *material = json_object_get(probe, "material");
        CHECK_REL(answer_value(json_object_get(material, "alpha_x")), sqrt(2 * v[2]), 1e-9, 0);
        answer_clear(&a);
    }
    answer_clear(&all);
    check_refused("at=1,0", exr, size, "/at", "[0, 1)");
    check_refused("at=0.5", exr, size, "/at", "u,v");
    check_refused("at=0.5,0.5,1", exr, size, "/at", "u,v");
    check_refused("at=nan,0", exr, size, "/at", "u,v");
    check_refused("at=0,0&level=6", exr, size, "/level", "[0, 5]");
    check_refused("level=2", exr, size, "/level", "needs at");
    check_refused("at=0,0&preview=normal", exr, size, "/at", "preview");
    free(exr);
}

/* ---- Pictures
 * ------------------------------------------------------------------------------------ */

TEST(pictures_of_levels)
{
    static const char *const kinds[] = {"roughness", "normal", "anisotropy"};
    size_t size = 0;
    make_surface();
    unsigned char *exr = exr_file_of_heights(surface.z, W, H, &size);
    for (int i = 0; i < 3; i++) {
        char query[80];
        snprintf(query, sizeof query, "texel=1&preview=%s&level=1", kinds[i]);
        struct answer a = post(query, NULL, exr, size);
        CHECK_INT(a.response.status, 200);
        CHECK_STR(a.response.content_type, "image/png");
        struct image image;
        struct image_problem problem = {0};
        CHECK_INT(api_png_read(a.response.body, a.response.body_size, "R", NULL, &image, &problem),
                  IMAGE_OK);
        CHECK(image.width == W / 2 && image.height == H / 2);
        float least = 1, most = 0;
        for (size_t p = 0; image.values && p < W * H / 4; p++) {
            least = fminf(least, image.values[p]);
            most = fmaxf(most, image.values[p]);
        }
        CHECK(least < 0.9f * most);
        if (i == 0) CHECK(most == 1 && a.response.header_count == 1);
        api_image_clear(&image);
        answer_clear(&a);
    }
    struct answer a = post("texel=1", "image/png", exr, size);
    CHECK_STR(a.response.content_type, "image/png");
    answer_clear(&a);
    check_refused("preview=normal&level=9", exr, size, "/level", "[0, 5]");
    free(exr);
    /* Flat: the normal points up. */
    static const char flat[] = "{\"heights\":[[1,1],[1,1]]}";
    a = post("preview=normal", NULL, flat, strlen(flat));
    const float want[] = {128 / 255.f, 128 / 255.f, 1};
    for (int c = 0; c < 3; c++) {
        struct image image;
        struct image_problem problem = {0};
        CHECK_INT(api_png_read(a.response.body, a.response.body_size,
                               (const char *const[]){"R", "G", "B"}[c], NULL, &image, &problem),
                  IMAGE_OK);
        CHECK(image.values && image.values[3] == want[c]);
        api_image_clear(&image);
    }
    answer_clear(&a);
}

/* ---- Files
 * ------------------------------------------------------------------------------------------ */

TEST(a_map_65537_wide)
{
    enum { WIDE = 65537 };
    float *z = calloc(WIDE, sizeof *z);
    for (int i = 0; z && i < WIDE; i++) z[i] = (float)(i % 7);
    size_t size = 0;
    unsigned char *exr = exr_file_of_heights(z, WIDE, 1, &size);
    struct answer a = post(NULL, NULL, exr, size);
    CHECK_INT(a.response.status, 200);
    CHECK_STR(a.response.content_type, "image/x-exr");
    answer_clear(&a);
    /* Seven not finite: counted, and the first is placed. */
    for (int i = 0; z && i < 7; i++) z[40000 + i] = i % 2 ? NAN : INFINITY;
    free(exr);
    exr = exr_file_of_heights(z, WIDE, 1, &size);
    check_refused("texel=1", exr, size, NULL,
                  "7 heights are not finite, the first in column 40000 of row 0");
    free(exr);
    free(z);
}

/* A reader that is not ours says what is in the answer. */
TEST(exrheader_reads_the_answer)
{
    char path[] = "/tmp/facet_test_leadr_XXXXXX", line[128];
    size_t size = 0;
    make_surface();
    unsigned char *exr = exr_file_of_heights(surface.z, W, H, &size);
    struct answer a = post("texel=0.5&scale=2&type=half&form=central&base_alpha=0.25", NULL, exr,
                           size);
    const int fd = mkstemp(path);
    CHECK(fd >= 0 &&
          write(fd, a.response.body, a.response.body_size) == (ssize_t)a.response.body_size);
    snprintf(line, sizeof line, "exrheader %s 2>&1", path);
    char *text = calloc(1, 1 << 16);
    if (system("command -v exrheader >/dev/null 2>&1") != 0) {
        check_skip("the package openexr is not installed");
    } else if (text) {
        FILE *pipe = popen(line, "r");
        CHECK(pipe && fread(text, 1, (1 << 16) - 1, pipe) > 0);
        CHECK_INT(pipe ? pclose(pipe) : -1, 0);
        static const char *const says[] = {"E1, 16-bit floating-point, sampling 1 1",
                                           "V12, 16-bit floating-point, sampling 1 1",
                                           "mip-map",
                                           "tile size 64 by 64 pixels",
                                           "(0 0) - (47 29)",
                                           "zip",
                                           "leadrScale (type double): 2",
                                           "leadrTexel (type double): 0.5",
                                           "leadrBaseAlpha (type double): 0.25",
                                           "leadrForm (type string): \"central\"",
                                           "leadrStencil (type string): \"bilinear\"",
                                           "leadrVarianceError (type double)",
                                           "leadrBilinearOverForward (type double)",
                                           "software (type string): \"facetd"};
        for (size_t i = 0; i < sizeof says / sizeof *says; i++)
            if (!strstr(text, says[i]))
                check_fail(__FILE__, __LINE__, "exrheader does not say \"%s\"", says[i]);
    }
    free(text);
    if (fd >= 0) close(fd);
    unlink(path);
    answer_clear(&a);
    free(exr);
}

/* Lines, points and sizes about a tile go through the file and come back. */
TEST(odd_sizes_in_files)
{
    static const size_t sizes[][2] = {{1, 1}, {1, 70}, {129, 1}, {64, 65}, {3, 2}};
    for (size_t s = 0; s < 2 * sizeof sizes / sizeof *sizes; s++) {
        const size_t w = sizes[s / 2][0], h = sizes[s / 2][1];
        float *z = calloc(w * h, sizeof *z);
        for (size_t i = 0; z && i < w * h; i++) z[i] = (float)(i % w * 5 % 7 + i / w * 3 % 5);
        size_t size = 0;
        unsigned char *exr = exr_file_of_heights(z, w, h, &size);
        struct answer a = post(s % 2 ? "texel=1&stencil=forward"
                                     : "texel=1&stencil=forward&compression=none",
                               NULL, exr, size);
        CHECK_INT(a.response.status, 200);
        struct image image;
        struct image_problem problem = {0};
        CHECK_INT(api_exr_read(a.response.body, a.response.body_size, "E1", NULL, &image, &problem),
                  IMAGE_OK);
        CHECK(image.width == w && image.height == h);
        for (size_t i = 0; image.values && i < w * h; i++)
            CHECK(image.values[i] == z[i / w * w + (i % w + 1) % w] - z[i]);
        api_image_clear(&image);
        answer_clear(&a);
        free(exr);
        free(z);
    }
}
