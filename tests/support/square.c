#include "square.h"

#include <math.h>
#include <string.h>

/* Monotone in the azimuth of (x, y), from 0 to 4. */
static double turn_of(double x, double y)
{
    double d = y / (fabs(x) + fabs(y));
    return x < 0 ? 2 - d : d < 0 ? 4 + d : d;
}

/* From the beginnings of the p and q of normals_at, or of COSINE. */
static void find_beginnings(struct square *s)
{
    const struct normals_map *map = &s->map;
    const double pi = acos(-1);
    for (int k = 0; k < 16; k++) {
        double part = (k + 1.0) / SQUARE_SIDE, p = map->low + (map->high - map->low) * part,
               turn = 2 * pi * part;
        s->p_at[k] = s->q_at[k] = INFINITY;
        if (k >= SQUARE_SIDE - 1) continue;
        if (s->sampler == FACET_SAMPLER_COSINE) {
            s->p_at[k] = part;
            s->q_at[k] = turn_of(cos(turn), sin(turn));
        } else {
            s->p_at[k] = map->ggx ? tan(p) : p;
            s->q_at[k] = map->ggx ? tan(pi * (part - 0.5)) : NORMALS_BECKMANN_END * (2 * part - 1);
        }
    }
}

struct square square_of(facet_sampler sampler, const facet_material *m, const double wo[3])
{
    struct square s = {.sampler = sampler, .map = normals_map(m, wo)};
    bool vcavity = sampler == FACET_SAMPLER_VCAVITY;
    s.is_all = sampler == FACET_SAMPLER_NDF || (vcavity && !(s.map.c > 0));
    s.is_bent = vcavity || sampler == FACET_SAMPLER_BOUNDED;
    if (s.is_all) s.map = normals_map(m, NULL);
    memcpy(s.wo, wo, sizeof s.wo);
    find_beginnings(&s);
    return s;
}

double square_direction(const struct square *s, double p, double q, double wi[3])
{
    if (s->sampler == FACET_SAMPLER_COSINE) {
        double turn = 2 * acos(-1) * q;
        wi[0] = sqrt(p) * cos(turn), wi[1] = sqrt(p) * sin(turn), wi[2] = sqrt(1 - p);
        return acos(-1) / wi[2];
    }
    struct normals_node node = normals_at(&s->map, p, q);
    double dot = s->is_all ? s->wo[0] * node.h[0] + s->wo[1] * node.h[1] + s->wo[2] * node.h[2]
                           : node.cosine;
    for (int j = 0; j < 3; j++) wi[j] = 2 * dot * node.h[j] - s->wo[j];
    return 4 * fabs(dot) * node.area;
}

/* How many of the beginnings are not above x, without a branch. */
static inline size_t slot_of(const double at[16], double x)
{
    size_t k = (size_t)(x >= at[7]) * 8;
    k += (size_t)(x >= at[k + 3]) * 4;
    k += (size_t)(x >= at[k + 1]) * 2;
    return k + (x >= at[k]);
}

static void count_normals(const struct square *s, size_t n, double *const wi[3], double *const h[3],
                          double counts[SQUARE_CELLS + 1])
{
    const struct normals_map *map = &s->map;
    const facet_roughness *r = &map->roughness;
    const double kappa = sqrt((1 - r->rho) * (1 + r->rho)), per_x = 1 / r->alpha_x,
                 per_y = 1 / (r->alpha_y * kappa);
    const double tilt = r->rho / kappa, end = NORMALS_BECKMANN_END;
    const double most = map->ggx ? tan(map->high) : map->high;
    for (size_t k = 0; k < n; k++) {
        double v[3];
        for (int j = 0; j < 3; j++) v[j] = h ? h[j][k] : wi[j][k] + s->wo[j];
        double up = s->is_all && !h ? fabs(v[2]) : v[2], inverse = -1 / v[2];
        double sx = (v[0] * inverse - r->slope_x) * per_x,
               sy = (v[1] * inverse - r->slope_y) * per_y - tilt * sx;
        double x = sx * map->cosine + sy * map->sine, y = sy * map->cosine - sx * map->sine;
        bool is_in = up > 0 && x < most && (map->ggx || (x >= map->low && fabs(y) < end));
        size_t cell = slot_of(s->p_at, x) * SQUARE_SIDE +
                      slot_of(s->q_at, map->ggx ? y / sqrt(1 + x * x) : y);
        counts[is_in ? cell : SQUARE_CELLS]++;
    }
}

void square_count(const struct square *s, size_t n, double *const wi[3], double *const h[3],
                  double counts[SQUARE_CELLS + 1])
{
    if (s->sampler != FACET_SAMPLER_COSINE) {
        count_normals(s, n, wi, h, counts);
        return;
    }
    for (size_t k = 0; k < n; k++) {
        double x = wi[0][k], y = wi[1][k], p = x * x + y * y;
        size_t cell = slot_of(s->p_at, p) * SQUARE_SIDE + slot_of(s->q_at, turn_of(x, y));
        counts[wi[2][k] > 0 && p < 1 ? cell : SQUARE_CELLS]++;
    }
}
