/*
 * report_leadr.c - does filtering slopes give what the surface looks like?  (`make report-leadr`)
 *
 * The claim of Dupuy's chapter 3, put to the test: reliefs rendered by brute force
 * (relief.h) against the BRDF of their filtered slopes, over levels, directions,
 * roughness and stencils, and with a measured base of which the service fits the
 * roughness (chapter 5).  Writes tables (leadr.md), pictures (leadr_<surface>.png)
 * and curves (leadr_lobes.dat).
 */
#include "api.h"
#include "check.h"
#include "filtered.h"
#include "measured.h"
#include "merl.h"
#include "png_write.h"
#include "relief.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 512, POINTS = 48, PATCHES = 24, VIEWS = FILTERED_MAX };

/* ---- Directions ---------------------------------------------------------------------------- */

static double directions[RELIEF_DIRECTIONS][3];
static size_t direction_count;
static struct view views[VIEWS];
static size_t view_count;

static size_t direction(double theta, double phi)
{
    const double degree = acos(-1) / 180;
    double *k = directions[direction_count];
    k[0] = sin(theta * degree) * cos(phi * degree);
    k[1] = sin(theta * degree) * sin(phi * degree);
    k[2] = cos(theta * degree);
    return direction_count++;
}

/* Viewers at 0, 30, 60 and 75 degrees; lights at the same in three planes. */
static void make_views(void)
{
    static const double thetas[] = {0, 30, 60, 75}, phis[] = {20, 110, 200};
    size_t lights[10], n = 0;
    lights[n++] = direction(0, 0);
    for (int t = 1; t < 4; t++)
        for (int p = 0; p < 3; p++) lights[n++] = direction(thetas[t], phis[p]);
    for (int t = 0; t < 4; t++) {
        const size_t o = direction(thetas[t], 20);
        for (size_t i = 0; i < n; i++) views[view_count++] = (struct view){lights[i], o};
    }
}

/* ---- Tables ------------------------------------------------------------------------------------ */

static const char *const way_names[] = {"central", "forward", "bilinear", "CLEAN", "mean normal"};

static void shade_views(const facet_moments *m, double base_alpha, double out[VIEWS])
{
    double wi[VIEWS][3], wo[VIEWS][3];
    for (size_t v = 0; v < view_count; v++) {
        memcpy(wi[v], directions[views[v].i], sizeof wi[v]);
        memcpy(wo[v], directions[views[v].o], sizeof wo[v]);
    }
    filtered_shade(m, base_alpha, (const double(*)[3])wi, (const double(*)[3])wo, view_count, out);
}

struct error {
    double square, truth_square, sum, truth_sum;
};

static void add_error(struct error *e, const double *got, const double *truth, size_t n)
{
    for (size_t v = 0; v < n; v++) {
        if (isnan(truth[v])) continue;
        e->square += (got[v] - truth[v]) * (got[v] - truth[v]);
        e->truth_square += truth[v] * truth[v];
        e->sum += got[v];
        e->truth_sum += truth[v];
    }
}

static double rms(const struct error *e)
{
    return sqrt(e->square / e->truth_square);
}

/* Texels of a level spread over the inside of the map. */
static void patch(size_t level, size_t index, size_t *p, size_t *q)
{
    const size_t n = SIDE >> level, margin = n > 8 ? n / 8 : 0;
    *p = margin + (index * 7 + 3) * 37 % (n - 2 * margin);
    *q = margin + (index * 11 + 5) * 53 % (n - 2 * margin);
}

static void compare(FILE *out, const char *name, const struct relief *r, double alpha,
                    struct error totals[WAY_COUNT])
{
    const struct base base = {base_beckmann, &alpha};
    facet_leadr *levels[WAY_COUNT];
    for (int w = 0; w < WAY_COUNT; w++) levels[w] = filtered_pyramid(r, (enum way)w);
    for (size_t level = 2; level <= 9; level += level == 4 ? 2 : level == 6 ? 3 : 1) {
        struct error errors[WAY_COUNT] = {{0, 0, 0, 0}};
        const size_t count = level == 9 ? 1 : PATCHES;
        for (size_t i = 0; i < count; i++) {
            size_t p, q;
            double truth[VIEWS], got[VIEWS];
            patch(level, i, &p, &q);
            const double size = (double)((size_t)1 << level);
            relief_radiance(r, &base, (double)p * size, (double)q * size, size,
                            level == 9 ? 6 * POINTS : POINTS, (const double(*)[3])directions,
                            direction_count, views, view_count, truth);
            for (int w = 0; w < WAY_COUNT; w++) {
                const facet_moments m = filtered_texel(levels[w], (enum way)w, level, p, q);
                shade_views(&m, alpha, got);
                add_error(&errors[w], got, truth, view_count);
                add_error(&totals[w], got, truth, view_count);
            }
        }
        fprintf(out, "| %s | %g | %zu", name, alpha, level);
        for (int w = 0; w < WAY_COUNT; w++)
            fprintf(out, " | %.3f (%+.3f)", rms(&errors[w]),
                    errors[w].sum / errors[w].truth_sum - 1);
        fprintf(out, " |\n");
        fflush(out);
    }
    for (int w = 0; w < WAY_COUNT; w++) facet_leadr_destroy(levels[w]);
}

/* ---- A measured base ------------------------------------------------------------------------ */

static double base_merl(const void *data, const double wi[3], const double wo[3])
{
    double fr[3];
    bool valid = false;
    double *const to[3] = {&fr[0], &fr[1], &fr[2]};
    const facet_vec3_in i = {&wi[0], &wi[1], &wi[2]}, o = {&wo[0], &wo[1], &wo[2]};
    if (api_merl_evaluate(data, i, o, 1, to, &valid) != FACET_OK || !valid) return 0;
    return fr[1];
}

static json_t *ask_json(const char *path, const char *query, const void *body, size_t size)
{
    const struct api_request request = {
        .method = "POST", .path = path, .query = query, .body = body, .body_size = size};
    struct api_response response;
    api_handle(&request, &response);
    json_t *json = response.status == 200 ? json_loadb(response.body, response.body_size, 0, NULL)
                                          : NULL;
    if (!json) fprintf(stderr, "%s: %d\n", path, response.status);
    api_response_clear(&response);
    return json;
}

/* The fitted base's Fresnel term and roughness below these moments, through /v1/eval. */
static bool eval_with_base(const json_t *fitted, const facet_moments *m, double out[VIEWS])
{
    json_t *wi = json_array(), *wo = json_array();
    for (size_t v = 0; v < view_count; v++) {
        const double *i = directions[views[v].i], *o = directions[views[v].o];
        json_array_append_new(wi, json_pack("[f,f,f]", i[0], i[1], i[2]));
        json_array_append_new(wo, json_pack("[f,f,f]", o[0], o[1], o[2]));
    }
    json_t *request = json_pack("{s:{s:s,s:[f,f,f,f,f],s:{s:O},s:O},s:[s],s:o,s:o}", "material",
                                "ndf", "beckmann", "moments", m->e1, m->e2, m->e3, m->e4, m->e5,
                                "base", "alpha", json_object_get(fitted, "alpha"), "fresnel",
                                json_object_get(fitted, "fresnel"), "outputs", "fr_cos", "wi", wi,
                                "wo", wo);
    char *text = request ? json_dumps(request, 0) : NULL;
    json_t *answer = text ? ask_json("/v1/eval", NULL, text, strlen(text)) : NULL;
    const json_t *values = json_object_get(answer, "fr_cos");
    const bool ok = json_array_size(values) == view_count;
    for (size_t v = 0; ok && v < view_count; v++) {
        const json_t *x = json_array_get(values, v);
        out[v] = json_number_value(json_is_array(x) ? json_array_get(x, 1) : x);
    }
    json_decref(answer);
    json_decref(request);
    /* api_open gave jansson an allocator of its own. */
    json_free_t release = free;
    json_get_alloc_funcs(NULL, &release);
    if (text) release(text);
    return ok;
}

static void compare_measured(FILE *out, const char *name, const struct relief *r,
                             const char *material)
{
    size_t size = 0;
    unsigned char *file = measured_merl(material, &size);
    json_t *fit = file ? ask_json("/v1/fit", "model=beckmann", file, size) : NULL;
    const json_t *fitted = json_object_get(fit, "material");
    struct merl merl = {file};
    const struct base base = {base_merl, &merl};
    facet_leadr *levels = fit ? filtered_pyramid(r, WAY_BILINEAR) : NULL;
    for (size_t level = 2; levels && level <= 6; level += 2) {
        struct error filtered = {0, 0, 0, 0}, flat = {0, 0, 0, 0}, alone = {0, 0, 0, 0};
        for (size_t i = 0; i < PATCHES / 2; i++) {
            size_t p, q;
            double truth[VIEWS], got[VIEWS], measured[VIEWS];
            patch(level, i, &p, &q);
            const double side = (double)((size_t)1 << level);
            relief_radiance(r, &base, (double)p * side, (double)q * side, side, POINTS / 2,
                            (const double(*)[3])directions, direction_count, views, view_count,
                            truth);
            const facet_moments m = filtered_texel(levels, WAY_BILINEAR, level, p, q),
                                none = {0, 0, 0, 0, 0};
            if (eval_with_base(fitted, &m, got)) add_error(&filtered, got, truth, view_count);
            if (eval_with_base(fitted, &none, got)) add_error(&flat, got, truth, view_count);
            for (size_t v = 0; v < view_count; v++) {
                const double *wi = directions[views[v].i], *wo = directions[views[v].o];
                measured[v] = base_merl(&merl, wi, wo) * wi[2];
            }
            add_error(&alone, got, measured, view_count);
        }
        fprintf(out, "| %s | %s | %.3g | %zu | %.3f (%+.3f) | %.3f (%+.3f) | %.3f (%+.3f) |\n",
                name, material, json_number_value(json_object_get(fitted, "alpha")), level,
                rms(&filtered), filtered.sum / filtered.truth_sum - 1, rms(&flat),
                flat.sum / flat.truth_sum - 1, rms(&alone), alone.sum / alone.truth_sum - 1);
        fflush(out);
    }
    facet_leadr_destroy(levels);
    json_decref(fit);
    free(file);
    if (!fit) fprintf(out, "| %s | %s | no shared data | | | | |\n", name, material);
}

/* ---- Pictures
 * ------------------------------------------------------------------------------------ */

enum { PIXELS = 96, ZOOM = 3, PANELS = 5, ROWS = 3, GAP = 6 };
static const char *const panels = "brute force | LEADR | CLEAN | mean normal | 4 x |LEADR - brute|";

struct picture {
    double panel[ROWS][PANELS][PIXELS][PIXELS];
};

/* A floor under a lamp, seen from the front: pixel (x, y) shows `size` texels each way. */
static void look(const struct relief *r, double alpha, size_t level,
                 double panel[PANELS][PIXELS][PIXELS])
{
    static const double eye[3] = {0, 2.2, 1.6}, lamp[3] = {0.3, -1.2, 1.1};
    const struct base base = {base_beckmann, &alpha};
    const struct view view = {0, 1};
    const double size = (double)((size_t)1 << level);
    const size_t n = SIDE >> level;
    facet_leadr *leadr = filtered_pyramid(r, WAY_BILINEAR), *clean = filtered_pyramid(r, WAY_CLEAN);
    for (int i = 0; i < PIXELS * PIXELS; i++) {
        const int x = i % PIXELS, y = i / PIXELS;
        const double at[2] = {2.0 * x / PIXELS - 1, 2.0 * y / PIXELS - 1};
        double k[2][3];
        for (int d = 0; d < 2; d++) {
            const double *from = d ? eye : lamp;
            const double v[3] = {from[0] - at[0], from[1] - at[1], from[2]};
            const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
            for (int c = 0; c < 3; c++) k[d][c] = v[c] / length;
        }
        double truth, got;
        const size_t p = (size_t)x % n, q = (size_t)y % n;
        relief_radiance(r, &base, (double)p * size, (double)q * size, size, 18,
                        (const double(*)[3])k, 2, &view, 1, &truth);
        if (isnan(truth)) truth = 0;
        panel[0][y][x] = truth;
        for (int w = 0; w < 3; w++) {
            const enum way way = w == 0 ? WAY_BILINEAR : w == 1 ? WAY_CLEAN : WAY_NORMAL;
            const facet_moments m = filtered_texel(way == WAY_CLEAN ? clean : leadr, way, level, p,
                                                   q);
            filtered_shade(&m, alpha, (const double(*)[3])k[0], (const double(*)[3])k[1], 1, &got);
            panel[1 + w][y][x] = got;
            if (w == 0) panel[4][y][x] = 4 * fabs(got - truth);
        }
    }
    facet_leadr_destroy(leadr);
    facet_leadr_destroy(clean);
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The 99th percentile of the truth becomes white. */
static double white_of(const double panel[PIXELS][PIXELS])
{
    static double sorted[PIXELS * PIXELS];
    memcpy(sorted, panel, sizeof sorted);
    qsort(sorted, PIXELS * PIXELS, sizeof *sorted, by_value);
    return sorted[PIXELS * PIXELS * 99 / 100];
}

static bool paint(const char *path, const struct picture *picture)
{
    enum { CELL = PIXELS * ZOOM + GAP, WIDTH = PANELS * CELL - GAP, HEIGHT = ROWS * CELL - GAP };
    unsigned char *rgb = calloc(3 * WIDTH, HEIGHT);
    struct image_problem problem;
    void *bytes = NULL;
    size_t size = 0;
    for (int row = 0; rgb && row < ROWS; row++) {
        const double white = white_of(picture->panel[row][0]);
        for (int k = 0; k < PANELS; k++)
            for (int i = 0; i < PIXELS * ZOOM * PIXELS * ZOOM; i++) {
                const int x = i % (PIXELS * ZOOM), y = i / (PIXELS * ZOOM);
                const double value = picture->panel[row][k][y / ZOOM][x / ZOOM] / white;
                memset(rgb + 3 * ((row * CELL + y) * WIDTH + k * CELL + x),
                       (unsigned char)(255 * pow(fmin(fmax(value, 0), 1), 1 / 2.2)), 3);
            }
    }
    bool ok = rgb && api_png_write(rgb, WIDTH, HEIGHT, &bytes, &size, &problem) == IMAGE_OK;
    FILE *file = ok ? fopen(path, "wb") : NULL;
    ok = file && fwrite(bytes, 1, size, file) == size;
    if (file) ok = fclose(file) == 0 && ok;
    free(bytes);
    free(rgb);
    return ok;
}

static void pictures(FILE *out, const char *folder, const char *name, const struct relief *r,
                     double alpha)
{
    static const size_t levels[ROWS] = {2, 4, 6};
    static struct picture picture;
    char path[512];
    for (int row = 0; row < ROWS; row++) look(r, alpha, levels[row], picture.panel[row]);
    snprintf(path, sizeof path, "%s/leadr_%s.png", folder, name);
    if (paint(path, &picture))
        fprintf(out, "\n`leadr_%s.png`, base alpha %g; rows: levels 2, 4, 6; columns: %s.\n", name,
                alpha, panels);
}

/* ---- Lobes ---------------------------------------------------------------------------------- */

/* f_r cos(theta_i) over theta_i in the plane of incidence, theta_o = 45 degrees, of the whole map. */
static void lobes(const char *folder, const struct relief *r, double alpha)
{
    char path[512];
    snprintf(path, sizeof path, "%s/leadr_lobes.dat", folder);
    FILE *file = fopen(path, "w");
    const struct base base = {base_beckmann, &alpha};
    facet_leadr *levels[WAY_COUNT];
    if (!file) return;
    for (int w = 0; w < WAY_COUNT; w++) levels[w] = filtered_pyramid(r, (enum way)w);
    fprintf(file, "# theta_i brute");
    for (int w = 0; w < WAY_COUNT; w++) fprintf(file, " \"%s\"", way_names[w]);
    for (int degree = -80; degree <= 80; degree += 4) {
        const double t = degree * acos(-1) / 180, s = sqrt(0.5);
        const double k[2][3] = {{sin(t), 0, cos(t)}, {-s, 0, s}};
        const struct view view = {0, 1};
        double truth, got;
        relief_radiance(r, &base, 0, 0, SIDE, 200, (const double(*)[3])k, 2, &view, 1, &truth);
        fprintf(file, "\n%d %g", degree, truth);
        for (int w = 0; w < WAY_COUNT; w++) {
            const facet_moments m = filtered_texel(levels[w], (enum way)w, 9, 0, 0);
            filtered_shade(&m, alpha, &k[0], &k[1], 1, &got);
            fprintf(file, " %g", got);
        }
    }
    fprintf(file, "\n");
    fclose(file);
    for (int w = 0; w < WAY_COUNT; w++) facet_leadr_destroy(levels[w]);
}

/* ---- The report
 * ----------------------------------------------------------------------------------- */

static const struct {
    const char *name;
    double length_x, length_y, rms_slope;
} gaussians[] = {
    {"smooth", 12, 12, 0.25},
    {"steep", 10, 10, 0.5},
    {"grooves", 4, 24, 0.35},
    {"rough", 1.5, 1.5, 0.3},
};

/* Of forward differences inside the relief; a Gaussian's is 3. */
static double kurtosis(const struct relief *r, size_t step)
{
    double sum[5] = {0};
    for (size_t q = 0; q + 1 < r->side; q++)
        for (size_t p = 0; p + 1 < r->side; p++) {
            const size_t i = q * r->side + p;
            const double d = (double)r->z[i + step] - r->z[i];
            sum[0] += 1, sum[1] += d, sum[2] += d * d, sum[3] += d * d * d, sum[4] += d * d * d * d;
        }
    const double m = sum[1] / sum[0], m2 = sum[2] / sum[0], m3 = sum[3] / sum[0];
    const double variance = m2 - m * m;
    return (sum[4] / sum[0] - 4 * m * m3 + 6 * m * m * m2 - 3 * m * m * m * m) /
           (variance * variance);
}

static void report(FILE *out, const char *folder)
{
    static const double alphas[] = {0.1, 0.3};
    struct error totals[WAY_COUNT] = {{0, 0, 0, 0}};
    struct relief r, shown;
    fprintf(out,
            "# Filtered slopes against brute force\n\nrms of the error of f_r cos over the rms "
            "of the truth (and the error of the sum), %zu views by %d texels.\n\n"
            "| surface | base alpha | level | central | forward | bilinear | CLEAN | mean "
            "normal |\n|---|---|---|---|---|---|---|---|\n",
            view_count, PATCHES);
    for (size_t g = 0; g < sizeof gaussians / sizeof *gaussians; g++) {
        if (!relief_gaussian(&r, SIDE, gaussians[g].length_x, gaussians[g].length_y,
                             gaussians[g].rms_slope, g + 1))
            return;
        for (int a = 0; a < 2; a++) compare(out, gaussians[g].name, &r, alphas[a], totals);
        relief_free(&r);
    }
    fprintf(out, "| all of these | | ");
    for (int w = 0; w < WAY_COUNT; w++)
        fprintf(out, " | %.3f (%+.3f)", rms(&totals[w]), totals[w].sum / totals[w].truth_sum - 1);
    fprintf(out, " |\n");
    /* Real slopes are no Gaussian: what the second moments miss. */
    if (relief_measured(&r, check_data("heights/microsurface/interferometer_matrix2.pfm"),
                        3.69862e-07, SIDE, 1)) {
        compare(out, "measured", &r, 0.1, totals);
        fprintf(
            out,
            "\nThe measured surface fits no stencil: the kurtosis of its slopes is %.0f along x "
            "and %.0f along y, a Gaussian's is 3. Half of it is far smoother than its variance "
            "says, which is all that moments keep.\n",
            kurtosis(&r, 1), kurtosis(&r, r.side));
    }
    fprintf(out, "\n## On a measured base\n\nThe base is a measured material; the service fits "
                 "its roughness and Fresnel term, and adds the roughness to the moments.\n\n"
                 "| surface | material | fitted alpha | level | filtered on fit | fit without the "
                 "map | fit of the base alone |\n|---|---|---|---|---|---|---|\n");
    if (relief_gaussian(&shown, SIDE, 12, 12, 0.25, 1)) {
        compare_measured(out, "smooth", &shown, "gold-metallic-paint");
        compare_measured(out, "smooth", &shown, "blue-metallic-paint");
        fprintf(out, "\n## Pictures\n");
        pictures(out, folder, "smooth", &shown, 0.1);
        relief_free(&shown);
    }
    if (relief_gaussian(&shown, SIDE, 4, 24, 0.35, 3)) {
        pictures(out, folder, "grooves", &shown, 0.1);
        lobes(folder, &shown, 0.1);
        relief_free(&shown);
    }
    if (r.z) pictures(out, folder, "measured", &r, 0.1);
    relief_free(&r);
}

/* Into $FACET_REPORT, or build/report. */
TEST(filtered_slopes_against_brute_force)
{
    const char *folder = getenv("FACET_REPORT");
    char path[512];
    if (!folder) folder = "build/report";
    snprintf(path, sizeof path, "%s/leadr.md", folder);
    FILE *out = api_open() ? fopen(path, "w") : NULL;
    CHECK(out);
    if (!out) return;
    make_views();
    report(out, folder);
    CHECK_INT(fclose(out), 0);
}
