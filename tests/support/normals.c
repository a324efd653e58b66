#include "normals.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct normals_map normals_map(const facet_material *m, const double wo[3])
{
    const facet_roughness *r = &m->roughness;
    struct normals_map map = {.roughness = *r, .ggx = m->ndf != FACET_BECKMANN, .cosine = 1};
    double v = INFINITY;
    if (wo) {
        double a = r->alpha_x * wo[0] + r->rho * r->alpha_y * wo[1];
        double b = r->alpha_y * sqrt((1 - r->rho) * (1 + r->rho)) * wo[1];
        map.s = hypot(a, b);
        map.c = wo[2] - wo[0] * r->slope_x - wo[1] * r->slope_y;
        if (map.s > 0) {
            map.cosine = a / map.s;
            map.sine = b / map.s;
            v = map.c / map.s;
        }
    }
    if (map.ggx) {
        map.low = -acos(-1) / 2;
        map.high = atan(v);
    } else {
        map.low = v < 0 ? -sqrt(v * v + NORMALS_BECKMANN_END * NORMALS_BECKMANN_END)
                        : -NORMALS_BECKMANN_END;
        map.high = fmin(v, NORMALS_BECKMANN_END);
    }
    return map;
}

struct normals_node normals_at(const struct normals_map *map, double p, double q)
{
    const double half_turn = acos(-1);
    const facet_roughness *r = &map->roughness;
    double kappa = sqrt((1 - r->rho) * (1 + r->rho)), x, y, stretch;
    if (map->ggx) {
        double psi = map->low + (map->high - map->low) * p, chi = half_turn * (q - 0.5);
        x = tan(psi);
        y = tan(chi) / cos(psi);
        stretch = (map->high - map->low) * half_turn / (pow(cos(psi), 3) * pow(cos(chi), 2));
    } else {
        x = map->low + (map->high - map->low) * p;
        y = NORMALS_BECKMANN_END * (2 * q - 1);
        stretch = (map->high - map->low) * 2 * NORMALS_BECKMANN_END;
    }
    double sx = x * map->cosine - y * map->sine, sy = x * map->sine + y * map->cosine;
    double hx = -(r->alpha_x * sx + r->slope_x);
    double hy = -(r->alpha_y * (r->rho * sx + kappa * sy) + r->slope_y);
    double z = 1 / sqrt(1 + hx * hx + hy * hy);
    struct normals_node node = {.h = {hx * z, hy * z, z}};
    node.area = z * z * z * r->alpha_x * r->alpha_y * kappa * stretch;
    node.cosine = (map->c - map->s * x) * z;
    return node;
}

/* Roots of the Legendre polynomial by Newton's method. */
void normals_gauss(double node[GAUSS_NODES], double weight[GAUSS_NODES])
{
    const int n = GAUSS_NODES;
    for (int i = 0; i < n; i++) {
        double x = cos(acos(-1) * (i + 0.75) / (n + 0.5)), slope = 1;
        for (int step = 0; step < 8; step++) {
            double before = 1, now = x;
            for (int k = 2; k <= n; k++) {
                double next = ((2 * k - 1) * x * now - (k - 1) * before) / k;
                before = now;
                now = next;
            }
            slope = n * (x * now - before) / (x * x - 1);
            x -= now / slope;
        }
        node[i] = (1 - x) / 2;
        weight[i] = 1 / ((1 - x * x) * slope * slope);
    }
}

static void fill(const struct normals_map *map, const double wo[3], int panels,
                 struct normals_rule *rule)
{
    double x[GAUSS_NODES], w[GAUSS_NODES];
    normals_gauss(x, w);
    int side = panels * GAUSS_NODES;
    for (int k = 0; k < side * side; k++) {
        int i = k / side, j = k % side;
        double p = (i / GAUSS_NODES + x[i % GAUSS_NODES]) / panels;
        double q = (j / GAUSS_NODES + x[j % GAUSS_NODES]) / panels;
        struct normals_node node = normals_at(map, p, q);
        rule->weight[k] = w[i % GAUSS_NODES] * w[j % GAUSS_NODES] * node.area / (panels * panels);
        rule->cosine[k] = wo ? node.cosine : 1;
        for (int c = 0; c < 3; c++) {
            rule->h[c][k] = node.h[c];
            rule->o[c][k] = wo ? wo[c] : node.h[c];
            rule->i[c][k] = wo ? 2 * node.cosine * node.h[c] - wo[c] : node.h[c];
        }
    }
}

bool normals_rule_create(const facet_material *material, const double wo[3], int panels,
                         struct normals_rule *rule)
{
    size_t n = (size_t)panels * GAUSS_NODES * (size_t)panels * GAUSS_NODES;
    memset(rule, 0, sizeof *rule);
    rule->n = n;
    double *memory = malloc(11 * n * sizeof *memory);
    if (!memory) return false;
    for (int c = 0; c < 3; c++) {
        rule->i[c] = memory + (size_t)c * n;
        rule->o[c] = memory + (size_t)(c + 3) * n;
        rule->h[c] = memory + (size_t)(c + 6) * n;
    }
    rule->weight = memory + 9 * n;
    rule->cosine = memory + 10 * n;
    struct normals_map map = normals_map(material, wo);
    fill(&map, wo, panels, rule);
    return true;
}

void normals_rule_destroy(struct normals_rule *rule)
{
    free(rule->i[0]);
}
