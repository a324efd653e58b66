#include "bsdf.h"

#include "bsdf_fields.h"
#include "little.h"

#include <math.h>

/* Wavelengths that stand for red, green and blue, as for metals. */
static const double wavelengths[3] = {630, 532, 465};

/* Numbers over the unit square, one image per (phi_i, theta_i) or for all. */
struct image {
    size_t width, height, size; /* size: width height */
    const double *values;
};

struct bsdf {
    size_t phis, thetas;
    const double *phi_i, *theta_i;
    int reduction; /* symmetric halves or quarters the azimuths leave out; 1: none */
    bool isotropic, jacobian;
    struct image ndf, sigma, vndf, colour; /* colour: 3 images per direction */
    const double *across, *up, *norm;      /* vndf cumulated along rows [slice][y][x], over rows
                                         [slice][y]; what each slice was divided by, inverted */
};

bool api_bsdf_matches(const unsigned char *bytes, size_t size)
{
    return size >= 11 && !memcmp(bytes, "tensor_file", 11);
}

/* ---- Reading ------------------------------------------------------------------------------ */

struct reader {
    struct tensor_file file;
    struct arena *arena;
    struct problem *problem;
};

/* As doubles; NULL and a problem where one is not finite. */
static double *numbers(struct reader *r, const char *name, const struct tensor *t)
{
    double *out = api_arena_doubles(r->arena, t->count);
    if (!out) {
        api_problem_memory(r->problem);
        return NULL;
    }
    for (size_t i = 0; i < t->count; i++) {
        out[i] = api_little_float(t->bytes + 4 * i);
        if (isfinite(out[i])) continue;
        api_problem(r->problem, 422, "number %zu of field \"%s\" is not finite", i, name);
        return NULL;
    }
    return out;
}

static bool read_axis(struct reader *r, const char *name, size_t *count, const double **values)
{
    struct tensor t;
    if (!api_tensor_find(&r->file, name, TENSOR_FLOAT32, 1, &t, r->problem)) return false;
    *count = t.count;
    if (!(*values = numbers(r, name, &t))) return false;
    for (size_t i = 1; i < t.count; i++)
        if (!((*values)[i] > (*values)[i - 1]))
            return api_problem(r->problem, 422, "field \"%s\" does not increase at %zu", name, i);
    return true;
}

static bool make_image(struct reader *r, const char *name, const struct tensor *t, size_t leading,
                       struct image *image)
{
    size_t h = t->shape[t->dimensions - 2], w = t->shape[t->dimensions - 1];
    if (w < 2 || h < 2 || t->count != leading * h * w)
        return api_problem(r->problem, 422,
                           "field \"%s\" has %zu numbers; %zu images of at least 2 x 2 are needed",
                           name, t->count, leading);
    *image = (struct image){w, h, w * h, numbers(r, name, t)};
    return image->values != NULL;
}

static bool read_image(struct reader *r, const char *name, size_t dimensions, size_t leading,
                       struct image *image)
{
    struct tensor t;
    return api_tensor_find(&r->file, name, TENSOR_FLOAT32, dimensions, &t, r->problem) &&
           make_image(r, name, &t, leading, image);
}

/* Three images out of a spectrum's many, straight between its wavelengths. */
static bool thin_spectra(struct reader *r, const double *nm, size_t bands, size_t slices,
                         struct image *image)
{
    double *out = api_arena_doubles(r->arena, slices * 3 * image->size);
    if (!out) return api_problem_memory(r->problem);
    for (size_t c = 0; c < 3; c++) {
        size_t k = 0;
        while (k + 2 < bands && nm[k + 1] < wavelengths[c]) k++;
        double t = bands < 2 ? 0 : (wavelengths[c] - nm[k]) / (nm[k + 1] - nm[k]);
        t = fmax(0, fmin(1, t));
        for (size_t s = 0; s < slices; s++) {
            const double *a = image->values + (s * bands + k) * image->size;
            const double *b = bands < 2 ? a : a + image->size;
            for (size_t i = 0; i < image->size; i++)
                out[(3 * s + c) * image->size + i] = (1 - t) * a[i] + t * b[i];
        }
    }
    image->values = out;
    return true;
}

static bool read_colour(struct reader *r, struct bsdf *bsdf)
{
    struct tensor t;
    size_t slices = bsdf->phis * bsdf->thetas, bands;
    const double *nm;
    if (!api_tensor_look(&r->file, "rgb", TENSOR_FLOAT32, 5, &t, r->problem)) return false;
    if (t.bytes) return make_image(r, "rgb", &t, 3 * slices, &bsdf->colour);
    return read_axis(r, "wavelengths", &bands, &nm) &&
           read_image(r, "spectra", 5, bands * slices, &bsdf->colour) &&
           thin_spectra(r, nm, bands, slices, &bsdf->colour);
}

/* The cumulated vndf of every slice, each normalised to 1, its integral of bilinear cells. */
static bool cumulate(struct reader *r, struct bsdf *bsdf)
{
    const struct image *v = &bsdf->vndf;
    size_t slices = bsdf->phis * bsdf->thetas;
    double *across = api_arena_doubles(r->arena, slices * v->size);
    double *up = api_arena_doubles(r->arena, slices * v->height);
    double *norm = api_arena_doubles(r->arena, slices);
    if (!across || !up || !norm) return api_problem_memory(r->problem);
    for (size_t s = 0; s < slices; s++) {
        const double *in = v->values + s * v->size;
        double *row = across + s * v->size, *rows = up + s * v->height;
        for (size_t y = 0; y < v->height; y++) {
            row[y * v->width] = 0;
            for (size_t x = 1; x < v->width; x++) {
                size_t i = y * v->width + x;
                row[i] = row[i - 1] + (fmax(in[i], 0) + fmax(in[i - 1], 0)) / 2;
            }
            size_t end = y * v->width + v->width - 1;
            rows[y] = y ? rows[y - 1] + (row[end] + row[end - v->width]) / 2 : 0;
        }
        double sum = rows[v->height - 1];
        if (!(sum > 0))
            return api_problem(r->problem, 422, "image %zu of field \"vndf\" is empty", s);
        norm[s] = 1 / sum;
        for (size_t i = 0; i < v->size; i++) row[i] /= sum;
        for (size_t y = 0; y < v->height; y++) rows[y] /= sum;
    }
    bsdf->across = across;
    bsdf->up = up;
    bsdf->norm = norm;
    return true;
}

static bool count_colours(struct reader *r, const struct bsdf *bsdf, struct data_counts *counts)
{
    const struct image *c = &bsdf->colour;
    size_t slices = bsdf->phis * bsdf->thetas, positive = 0;
    counts->values = (int64_t)(slices * c->size);
    for (size_t s = 0; s < slices; s++) {
        for (size_t i = 0; i < c->size; i++) {
            const double *at = c->values + 3 * s * c->size + i;
            counts->negative += at[0] < 0 || at[c->size] < 0 || at[2 * c->size] < 0;
            positive += at[0] > 0 || at[c->size] > 0 || at[2 * c->size] > 0;
        }
    }
    return positive ||
           api_problem(r->problem, 422, "the file holds no data: no colour is positive");
}

static bool read_jacobian(struct reader *r, struct bsdf *bsdf)
{
    struct tensor t;
    if (!api_tensor_look(&r->file, "jacobian", TENSOR_UINT8, 1, &t, r->problem)) return false;
    bsdf->jacobian = t.bytes && t.bytes[0];
    return true;
}

static facet_status evaluate(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                             double *const fr[3], bool *valid);

/* How often the directions of incidence go around: 1, 2 or 4 in the files there are. */
static bool read_reduction(struct reader *r, struct bsdf *b)
{
    enum { REDUCTION_MAX = 1000 };
    const double span = b->phi_i[b->phis - 1] - b->phi_i[0];
    if (!(span * REDUCTION_MAX >= 2 * FACET_PI))
        return api_problem(r->problem, 422, "phi_i spans %g; it must span at least %g", span,
                           2 * FACET_PI / REDUCTION_MAX);
    b->reduction = (int)fmax(1, rint(2 * FACET_PI / span));
    return true;
}

bool api_bsdf_open(const void *bytes, size_t size, struct arena *arena, struct problem *problem,
                   struct measurement *m)
{
    struct reader r = {.arena = arena, .problem = problem};
    struct bsdf *b = api_arena_array(arena, 1, sizeof *b);
    if (!b) return api_problem_memory(problem);
    if (!api_tensor_open(bytes, size, &r.file, problem) ||
        !read_axis(&r, "phi_i", &b->phis, &b->phi_i) ||
        !read_axis(&r, "theta_i", &b->thetas, &b->theta_i))
        return false;
    size_t slices = b->phis * b->thetas;
    if (slices > TENSOR_NUMBERS_MAX) return api_problem(problem, 422, "too many directions");
    if (!read_image(&r, "ndf", 2, 1, &b->ndf) || !read_image(&r, "sigma", 2, 1, &b->sigma) ||
        !read_image(&r, "vndf", 4, slices, &b->vndf) || !read_colour(&r, b) ||
        !read_jacobian(&r, b) || !cumulate(&r, b) || !count_colours(&r, b, &m->counts))
        return false;
    b->isotropic = b->phis <= 2;
    b->reduction = 1;
    if (!b->isotropic && !read_reduction(&r, b)) return false;
    m->source = (facet_fit_source){evaluate, b, INFINITY, !b->isotropic, NULL};
    return true;
}

/* ---- Asking ------------------------------------------------------------------------------- */

/* Up to four slices and their weights. */
struct slices {
    size_t at[4];
    double weight[4];
};

static double place(const double *axis, size_t n, double x, size_t *at)
{
    *at = 0;
    if (n < 2) return 0;
    while (*at + 2 < n && axis[*at + 1] <= x) ++*at;
    return fmax(0, fmin(1, (x - axis[*at]) / (axis[*at + 1] - axis[*at])));
}

static struct slices find_slices(const struct bsdf *b, double theta, double phi)
{
    struct slices s;
    size_t p, t;
    double wp = b->isotropic ? 0 : place(b->phi_i, b->phis, phi, &p);
    double wt = place(b->theta_i, b->thetas, theta, &t);
    if (b->isotropic) p = 0;
    for (size_t k = 0; k < 4; k++) {
        size_t i = p + (k >> 1), j = t + (k & 1);
        i = i < b->phis ? i : b->phis - 1;
        j = j < b->thetas ? j : b->thetas - 1;
        s.at[k] = i * b->thetas + j;
        s.weight[k] = (k >> 1 ? wp : 1 - wp) * (k & 1 ? wt : 1 - wt);
    }
    return s;
}

/* A point of the unit square among width x height nodes. */
struct spot {
    size_t x, y;
    double u, v;
};

static struct spot find_spot(const struct image *image, double u, double v)
{
    struct spot s;
    double x = fmax(0, fmin(1, u)) * (double)(image->width - 1);
    double y = fmax(0, fmin(1, v)) * (double)(image->height - 1);
    s.x = x < (double)(image->width - 2) ? (size_t)x : image->width - 2;
    s.y = y < (double)(image->height - 2) ? (size_t)y : image->height - 2;
    s.u = x - (double)s.x;
    s.v = y - (double)s.y;
    return s;
}

static double bilinear(const double *image, size_t width, struct spot s)
{
    const double *at = image + s.y * width + s.x;
    return (1 - s.v) * ((1 - s.u) * at[0] + s.u * at[1]) +
           s.v * ((1 - s.u) * at[width] + s.u * at[width + 1]);
}

/* Where (u, v) falls in the distribution of this wi: the inverse of sampling it. */
static void cumulative(const struct bsdf *b, const struct slices *slices, double *u, double *v)
{
    const struct image *image = &b->vndf;
    struct spot s = find_spot(image, *u, *v);
    double c0 = 0, c1 = 0, row = 0, end0 = 0, end1 = 0, before = 0;
    size_t w = image->width, at = s.y * w + s.x, last = s.y * w + w - 1;
    for (int k = 0; k < 4; k++) {
        double weight = slices->weight[k];
        if (weight == 0) continue;
        const double *d = image->values + slices->at[k] * image->size;
        const double *across = b->across + slices->at[k] * image->size;
        const double *up = b->up + slices->at[k] * image->height;
        double norm = b->norm[slices->at[k]]; /* the slice's numbers, normalised as its sums are */
        c0 += weight * norm * ((1 - s.v) * fmax(d[at], 0) + s.v * fmax(d[at + w], 0));
        c1 += weight * norm * ((1 - s.v) * fmax(d[at + 1], 0) + s.v * fmax(d[at + w + 1], 0));
        row += weight * ((1 - s.v) * across[at] + s.v * across[at + w]);
        end0 += weight * across[last];
        end1 += weight * across[last + w];
        before += weight * up[s.y];
    }
    double x = s.u * (c0 + s.u / 2 * (c1 - c0)) + row, total = (1 - s.v) * end0 + s.v * end1;
    *u = total > 0 ? x / total : 0;
    *v = s.v * (end0 + s.v / 2 * (end1 - end0)) + before;
}

static double to_unit(double theta)
{
    return sqrt(fmax(theta, 0) * (2 / FACET_PI));
}

static void ask(const struct bsdf *b, double i[3], double o[3], double rgb[3])
{
    if (b->reduction >= 2) { /* into the measured part, by symmetry */
        double flip_y = i[1] < 0 ? 1 : -1,
               flip_x = b->reduction == 4 ? (i[0] < 0 ? 1 : -1) : flip_y;
        i[0] *= flip_x, i[1] *= flip_y, o[0] *= flip_x, o[1] *= flip_y;
    }
    double h[3] = {i[0] + o[0], i[1] + o[1], i[2] + o[2]};
    double theta_i = atan2(hypot(i[0], i[1]), i[2]), phi_i = atan2(i[1], i[0]);
    double theta_m = atan2(hypot(h[0], h[1]), h[2]), phi_m = atan2(h[1], h[0]);
    double phi = ((b->isotropic ? phi_m - phi_i : phi_m) + FACET_PI) / (2 * FACET_PI);
    double u = to_unit(theta_m), v = phi - floor(phi), u_i = to_unit(theta_i),
           v_i = (phi_i + FACET_PI) / (2 * FACET_PI);
    struct slices slices = find_slices(b, theta_i, phi_i);
    double scale = 1;
    if (b->jacobian)
        scale = bilinear(b->ndf.values, b->ndf.width, find_spot(&b->ndf, u, v)) /
                (4 * bilinear(b->sigma.values, b->sigma.width, find_spot(&b->sigma, u_i, v_i)));
    cumulative(b, &slices, &u, &v);
    struct spot spot = find_spot(&b->colour, u, v);
    for (size_t c = 0; c < 3; c++) {
        double sum = 0;
        for (int k = 0; k < 4; k++)
            if (slices.weight[k] != 0)
                sum += slices.weight[k] *
                       bilinear(b->colour.values + (3 * slices.at[k] + c) * b->colour.size,
                                b->colour.width, spot);
        rgb[c] = fmax(sum * scale, 0) / o[2]; /* the file holds f_r cos theta_o */
    }
}

static facet_status evaluate(const void *user, facet_vec3_in wi, facet_vec3_in wo, size_t n,
                             double *const fr[3], bool *valid)
{
    for (size_t k = 0; k < n; k++) {
        double i[3] = {wi.x[k], wi.y[k], wi.z[k]}, o[3] = {wo.x[k], wo.y[k], wo.z[k]};
        double rgb[3] = {0, 0, 0};
        valid[k] = i[2] > 0 && o[2] > 0;
        if (valid[k]) ask(user, i, o, rgb);
        for (size_t c = 0; c < 3; c++) {
            fr[c][k] = rgb[c];
            valid[k] = valid[k] && isfinite(rgb[c]);
        }
    }
    return FACET_OK;
}
