#include "export_target.h"

#include <math.h>

const facet_fit_candidate *api_export_choose(const facet_fit *fit,
                                             const facet_fit_candidate *chosen, bool beckmann,
                                             bool table)
{
    const facet_fit_candidate *best = NULL;
    for (size_t i = 0; i < fit->count; i++) {
        const facet_fit_candidate *c = &fit->candidate[i];
        bool holds = c->material.ndf == FACET_GGX ||
                     (beckmann && c->material.ndf == FACET_BECKMANN);
        if (!holds || (!table && c->material.fresnel.kind == FACET_FRESNEL_TABLE)) continue;
        if (c == chosen) return c;
        if (!best || c->error.rms_log < best->error.rms_log) best = c;
    }
    return best;
}

/* ---- Conductor ---------------------------------------------------------------------------------- */

static double conductor(double eta, double k, double c)
{
    double s2 = (1 - c) * (1 + c), t = eta * eta - k * k - s2;
    double ab = sqrt(t * t + 4 * eta * eta * k * k), a = sqrt(fmax(0, (ab + t) / 2));
    double rs = (ab - 2 * a * c + c * c) / (ab + 2 * a * c + c * c);
    double rp = rs * (c * c * ab - 2 * a * c * s2 + s2 * s2) /
                (c * c * ab + 2 * a * c * s2 + s2 * s2);
    return (rs + rp) / 2;
}

/* Gulbrandsen 2014, eqs. 7 and 9: reflectance r at normal incidence for every edge tint g. */
static void from_tint(double r, double g, double *eta, double *k)
{
    double low = (1 - r) / (1 + r), high = (1 + sqrt(r)) / (1 - sqrt(r));
    *eta = g * low + (1 - g) * high;
    double square = (r * (*eta + 1) * (*eta + 1) - (*eta - 1) * (*eta - 1)) / (1 - r);
    *k = sqrt(fmax(0, square));
}

static double misfit(double r, double g)
{
    double eta, k, sum = 0;
    from_tint(r, g, &eta, &k);
    if (eta < FACET_ETA_MIN || eta > FACET_ETA_MAX || k > FACET_K_MAX)
        return INFINITY; /* of a mirror */
    for (int i = 1; i < 30; i++) {
        double c = i / 30., q = 1 - c, schlick = r + (1 - r) * q * q * q * q * q;
        double d = conductor(eta, k, c) / schlick - 1;
        sum += d * d * c;
    }
    return sum;
}

void api_export_conductor(const double f0[3], double eta[3], double k[3])
{
    enum { STEPS = 400 };
    for (int c = 0; c < 3; c++) {
        double r = fmax(1e-6, fmin(0.999, f0[c])), best = INFINITY, tint = 0;
        for (int i = 0; i <= STEPS; i++) {
            double g = (double)i / STEPS, sum = misfit(r, g);
            if (sum < best) best = sum, tint = g;
        }
        from_tint(r, tint, &eta[c], &k[c]);
    }
}

/* ---- Loss ------------------------------------------------------------------------------------------ */

enum { THETA_O = 8, THETA_I = 24, PHI = 12, PAIRS = THETA_O * THETA_I * PHI };

/* wi over the hemisphere, denser about the mirror direction, for wo along x. */
static void fill_grid(double *const v[6], double alpha)
{
    size_t n = 0;
    for (int o = 0; o < THETA_O; o++) {
        double to = 1.4 * (o + 0.5) / THETA_O;
        for (int i = 0; i < THETA_I; i++) {
            double u = (i + 0.5) / (THETA_I / 2.) - 1, spread = i % 2 ? fmax(2 * alpha, 0.02) : 1.5;
            double ti = fmax(-1.5, fmin(1.5, to + u * spread));
            for (int p = 0; p < PHI; p++) {
                double phi = 2 * FACET_PI * p / PHI, lean = i % 4 < 2 ? 0.5 * spread * u : 0;
                double y = sin(lean), x = -sin(ti) * cos(lean), z = cos(ti) * cos(lean);
                v[0][n] = x * cos(phi) - y * sin(phi), v[1][n] = x * sin(phi) + y * cos(phi);
                v[2][n] = z;
                v[3][n] = sin(to) * cos(phi), v[4][n] = sin(to) * sin(phi), v[5][n] = cos(to);
                n++;
            }
        }
    }
}

/* fr_cos and F of a material into out[0..2] and out[3..5]. */
static bool evaluate(struct call *call, const facet_material *m, double *const v[6],
                     double *const out[6])
{
    facet_brdf *brdf;
    facet_outputs outputs = {0};
    facet_status status = facet_brdf_create(m, &brdf);
    if (status) return api_problem_status(call->problem, status, NULL);
    for (size_t c = 0; c < m->fresnel.channels; c++) {
        outputs.of[FACET_FR_COS][c] = out[c];
        outputs.of[FACET_F][c] = out[3 + c];
    }
    status = facet_eval(brdf, FACET_PRECISE, (facet_vec3_in){v[0], v[1], v[2]},
                        (facet_vec3_in){v[3], v[4], v[5]}, PAIRS, &outputs);
    facet_brdf_destroy(brdf);
    for (size_t c = m->fresnel.channels; c < 3; c++)
        for (size_t i = 0; i < PAIRS; i++) out[c][i] = out[0][i], out[3 + c][i] = out[3][i];
    return !status || api_problem_status(call->problem, status, NULL);
}

bool api_export_loss(struct call *call, const facet_fit_candidate *candidate,
                     const struct target *target, double *rms)
{
    double *v[6], *a[6], *b[6], sum = 0, count = 0;
    for (int k = 0; k < 6; k++) {
        v[k] = api_arena_doubles(call->arena, PAIRS);
        a[k] = api_arena_doubles(call->arena, PAIRS);
        b[k] = api_arena_doubles(call->arena, PAIRS);
        if (!v[k] || !a[k] || !b[k]) return api_problem_memory(call->problem);
    }
    const facet_roughness *r = &target->material.roughness;
    fill_grid(v, fmin(r->alpha_x, r->alpha_y));
    if (!evaluate(call, &candidate->material, v, a) || !evaluate(call, &target->material, v, b))
        return false;
    for (size_t i = 0; i < PAIRS; i++) {
        if (!(v[2][i] > 1e-3)) continue;
        double most = fmax(b[3][i], fmax(b[4][i], b[5][i]));
        for (int c = 0; c < 3; c++) {
            double kd = candidate->has_diffuse ? candidate->diffuse[c] : 0, z = v[2][i] / FACET_PI;
            double ours = (1 - kd) * a[c][i] + kd * z;
            double dim = target->dimmed ? 1 - most : 1;
            double theirs = target->specular[c] * b[c][i] + target->diffuse[c] * dim * z;
            double d = log((FACET_FIT_EPSILON + ours) / (FACET_FIT_EPSILON + theirs));
            sum += d * d;
            count++;
        }
    }
    *rms = sqrt(sum / count);
    return true;
}
