#include "draw.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const struct draw_domain draw_everywhere = {
    .alpha_min = FACET_ALPHA_MIN,
    .alpha_max = FACET_ALPHA_MAX,
    .rho_max = FACET_RHO_MAX,
    .slope_max = FACET_MEAN_SLOPE_MAX,
    .cosine_min = 1e-9,
    .below = true,
};

const struct draw_domain draw_ordinary = {
    .alpha_min = 1e-2,
    .alpha_max = 10,
    .rho_max = 0.98,
    .slope_max = 1,
    .cosine_min = 1e-3,
};

size_t draw_count(size_t n)
{
    const char *scale = getenv("FACET_TEST_SCALE");
    double scaled = scale ? (double)n * strtod(scale, NULL) : (double)n;
    return scaled > 1 ? (size_t)scaled : 1;
}

static double draw_sign(struct rng *rng)
{
    return rng_uniform(rng) < 0.5 ? -1 : 1;
}

static int draw_int(struct rng *rng, int n)
{
    return (int)(rng_uniform(rng) * n);
}

/* One draw a statement here and below: the order of two in one expression is the compiler's. */
static double draw_near_one(struct rng *rng, double low, double high)
{
    double sign = draw_sign(rng);
    return 1 + sign * rng_log(rng, low, high);
}

static double draw_slope(struct rng *rng, double largest)
{
    double size = rng_uniform(rng) < 0.5 ? fmin(1, largest) * rng_uniform(rng)
                                         : rng_log(rng, fmin(1e-3, largest), largest);
    return fmin(size, largest) * draw_sign(rng);
}

void draw_roughness(struct rng *rng, const struct draw_domain *domain, facet_roughness *r)
{
    int kind = draw_int(rng, 4); /* isotropic, anisotropic, correlated, isotropic with shear */
    memset(r, 0, sizeof *r);
    /* half of them in the range people use */
    double low = domain->alpha_min, high = domain->alpha_max;
    if (draw_int(rng, 2)) {
        low = fmax(low, 1e-3);
        high = fmin(high, 3);
    }
    r->alpha_x = r->alpha_y = fmin(fmax(rng_log(rng, low, high), low), high);
    if (kind == 1 || kind == 2) r->alpha_y = fmin(fmax(rng_log(rng, low, high), low), high);
    if (kind == 2) {
        double rest = draw_int(rng, 2) ? rng_uniform(rng) : rng_log(rng, 1 - domain->rho_max, 1);
        r->rho = fmin(1 - rest, domain->rho_max) * draw_sign(rng);
    }
    if (kind == 3 || (kind == 2 && draw_int(rng, 2))) {
        r->slope_x = draw_slope(rng, domain->slope_max);
        r->slope_y = draw_int(rng, 4) ? draw_slope(rng, domain->slope_max) : 0;
    }
}

void draw_fresnel(struct rng *rng, facet_fresnel_kind kind, facet_fresnel *f)
{
    static double nodes[9], values[3][9];
    memset(f, 0, sizeof *f);
    f->kind = kind;
    f->channels = draw_int(rng, 2) ? 3 : 1;
    for (int j = 0; j < 3; j++) {
        double special[] = {0, 1, 1e-6, 0.04};
        f->f0[j] = draw_int(rng, 2) ? rng_uniform(rng) : special[draw_int(rng, 4)];
        double low = draw_int(rng, 3) ? 0.3 : FACET_ETA_MIN,
               high = draw_int(rng, 3) ? 4 : FACET_ETA_MAX;
        f->eta[j] = rng_log(rng, low, high);
        if (!draw_int(rng, 8)) f->eta[j] = draw_near_one(rng, 1e-9, 1e-1);
        f->eta[j] = fmin(fmax(f->eta[j], FACET_ETA_MIN), FACET_ETA_MAX);
        f->k[j] = draw_int(rng, 4) ? fmin(rng_log(rng, 1e-9, FACET_K_MAX), FACET_K_MAX) : 0;
    }
    if (kind != FACET_FRESNEL_TABLE) return;
    f->count = (size_t)(2 + draw_int(rng, 8));
    f->cos_theta_d = nodes;
    double at = draw_int(rng, 2) ? 0 : 0.2 * rng_uniform(rng), last = 0.7 + 0.3 * rng_uniform(rng);
    for (size_t i = 0; i < f->count; i++) {
        nodes[i] = at + (last - at) * (double)i / (double)(f->count - 1);
        for (int j = 0; j < 3; j++) values[j][i] = 0.02 + rng_uniform(rng);
    }
    for (int j = 0; j < 3; j++) f->values[j] = values[j];
}

static void from_polar(double z, double phi, double k[3])
{
    double s = sqrt((1 - z) * (1 + z));
    k[0] = s * cos(phi);
    k[1] = s * sin(phi);
    k[2] = z;
}

void draw_direction(struct rng *rng, double cosine_min, double k[3])
{
    const double turn = 2 * acos(-1);
    double z = draw_int(rng, 2) ? rng_uniform(rng) : rng_log(rng, cosine_min, 1);
    from_polar(fmin(fmax(z, cosine_min), 1), turn * rng_uniform(rng), k);
}

/* wi = wo mirrored at a normal drawn roughly as the surface has them. */
static void mirror(struct rng *rng, const facet_roughness *r, const double wo[3], double wi[3])
{
    const double turn = 2 * acos(-1);
    double radius = rng_log(rng, 1e-6, 30), phi = turn * rng_uniform(rng);
    double x = radius * cos(phi), y = radius * sin(phi);
    double h[3] = {-(r->alpha_x * x + r->slope_x),
                   -(r->alpha_y * (r->rho * x + sqrt(1 - r->rho * r->rho) * y) + r->slope_y), 1};
    double size = sqrt(h[0] * h[0] + h[1] * h[1] + 1), oh = 0;
    for (int j = 0; j < 3; j++) oh += wo[j] * (h[j] /= size);
    for (int j = 0; j < 3; j++) wi[j] = 2 * oh * h[j] - wo[j];
}

/* On the edge of what the mean facet sees: c = k_z - k_x slope_x - k_y slope_y almost 0. */
static void edge(struct rng *rng, const facet_roughness *r, double k[3])
{
    double phi = 2 * acos(-1) * rng_uniform(rng);
    double g = r->slope_x * cos(phi) + r->slope_y * sin(phi);
    if (g < 0) {
        g = -g;
        phi += acos(-1);
    }
    double z = g / sqrt(1 + g * g) * draw_near_one(rng, 1e-15, 1e-1);
    from_polar(fmin(fmax(z, -1), 1), phi, k);
}

/* wi so that half the angle between wi and wo has the cosine c. */
static void at_difference(struct rng *rng, double c, const double wo[3], double wi[3])
{
    double axis[3], u[3], along = 0, size = 0, angle = 2 * acos(fmin(c, 1));
    draw_direction(rng, 1e-3, axis);
    for (int j = 0; j < 3; j++) along += axis[j] * wo[j];
    for (int j = 0; j < 3; j++) {
        u[j] = axis[j] - along * wo[j];
        size += u[j] * u[j];
    }
    size = size > 0 ? sqrt(size) : 1;
    for (int j = 0; j < 3; j++) wi[j] = cos(angle) * wo[j] + sin(angle) * u[j] / size;
}

static void draw_kind(struct rng *rng, int kind, const struct draw_domain *domain,
                      const facet_material *material, double wi[3], double wo[3])
{
    const facet_roughness *r = &material->roughness;
    double phi;
    int which;
    draw_direction(rng, domain->cosine_min, wo);
    draw_direction(rng, domain->cosine_min, wi);
    switch (kind) {
    case 0:
    case 1:
    case 2: mirror(rng, r, wo, wi); break;
    case 3: /* pole */
        phi = 6 * rng_uniform(rng);
        from_polar(1 - rng_log(rng, 1e-20, 1e-2), phi, wo);
        mirror(rng, r, wo, wi);
        break;
    case 4: at_difference(rng, 1 - rng_log(rng, 1e-20, 1e-2), wo, wi); break; /* nearly equal */
    case 5: /* nearly opposite in azimuth */
        for (int j = 0; j < 3; j++) wi[j] = (j < 2 ? -1 : 1) * wo[j];
        which = draw_int(rng, 3);
        wi[which] *= 1 - rng_log(rng, 1e-16, 1e-2);
        break;
    case 6: edge(rng, r, wi); break;
    case 7: edge(rng, r, wo); break;
    case 8: /* around total reflection */
        if (material->fresnel.eta[0] < 1) {
            double c = sqrt((1 - material->fresnel.eta[0]) * (1 + material->fresnel.eta[0]));
            at_difference(rng, c * draw_near_one(rng, 1e-16, 1e-2), wo, wi);
        }
        break;
    case 9: /* below */
        if (domain->below) (draw_int(rng, 2) ? wi : wo)[2] *= -1;
        break;
    default: break;
    }
}

void draw_pair(struct rng *rng, const struct draw_domain *domain, const facet_material *material,
               double wi[3], double wo[3])
{
    for (int tries = 0; tries < 100; tries++) {
        draw_kind(rng, draw_int(rng, 12), domain, material, wi, wo);
        if (!draw_int(rng, 4))
            for (int j = 0; j < 3; j++) {
                wi[j] = (float)wi[j];
                wo[j] = (float)wo[j];
            }
        if (domain->below) return;
        if (wi[2] >= domain->cosine_min && wo[2] >= domain->cosine_min) return;
    }
    from_polar(0.5, 1, wi);
    from_polar(0.7, 2, wo);
}

const char *draw_text(const facet_material *m)
{
    static char text[640];
    const facet_roughness *r = &m->roughness;
    const facet_fresnel *f = &m->fresnel;
    snprintf(
        text, sizeof text,
        "{.ndf=%d, .roughness={%.17g, %.17g, %.17g, %.17g, %.17g}, .masking=%d, .shear=%d, "
        ".fresnel={.kind=%d, .channels=%zu, .f0={%.17g,%.17g,%.17g}, .eta={%.17g,%.17g,%.17g}, "
        ".k={%.17g,%.17g,%.17g}}}",
        (int)m->ndf, r->alpha_x, r->alpha_y, r->rho, r->slope_x, r->slope_y, (int)m->masking,
        (int)m->shear, (int)f->kind, f->channels, f->f0[0], f->f0[1], f->f0[2], f->eta[0],
        f->eta[1], f->eta[2], f->k[0], f->k[1], f->k[2]);
    return text;
}
