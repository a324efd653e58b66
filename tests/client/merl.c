#include "merl.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { HALVES = 90, DIFFERENCES = 90, TURNS = 180, CELLS = HALVES * DIFFERENCES * TURNS };

static double ggx(double alpha, double th, double zi, double zo)
{
    const double pi = acos(-1);
    double a2 = alpha * alpha, c = cos(th), s = sin(th), flat = c * c + s * s / a2;
    double ri = sqrt(zi * zi + a2 * (1 - zi * zi)), ro = sqrt(zo * zo + a2 * (1 - zo * zo));
    return 1 / (pi * a2 * flat * flat) / (2 * (ro * zi + ri * zo));
}

static void fill(const json_t *from, double *cells)
{
    const double pi = acos(-1), scale[3] = {1. / 1500, 1.15 / 1500, 1.66 / 1500};
    double alpha = json_number_value(json_object_get(from, "alpha"));
    for (int i = 0; i < CELLS; i++) {
        int h = i / (DIFFERENCES * TURNS), d = i / TURNS % DIFFERENCES, p = i % TURNS;
        double th = pi / 2 * h * h / (HALVES * HALVES), td = pi / 2 * d / DIFFERENCES,
               pd = pi * p / TURNS;
        double lean = sin(th) * sin(td) * cos(pd), zi = cos(th) * cos(td) - lean,
               zo = cos(th) * cos(td) + lean;
        for (int k = 0; k < 3; k++) {
            double f0 = json_number_value(json_array_get(json_object_get(from, "f0"), (size_t)k));
            double f = (f0 + (1 - f0) * pow(1 - cos(td), 5)) * ggx(alpha, th, zi, zo);
            cells[k * CELLS + i] = zi > 0 && zo > 0 ? f / scale[k] : -1;
        }
    }
}

char *merl_make(const json_t *from, size_t *size)
{
    bool constant = !json_object_get(from, "alpha");
    int dims[3] = {HALVES, DIFFERENCES, TURNS};
    size_t at = sizeof dims, bytes = at + 3 * (size_t)CELLS * sizeof(double);
    if (constant) bytes = (size_t)json_integer_value(json_object_get(from, "bytes"));
    double value = json_number_value(json_object_get(from, "value"));
    char *data = calloc(1, bytes > at ? bytes : at);
    double *cells = constant || !data ? NULL : malloc(bytes - at);
    if (!data || (!constant && !cells)) {
        free(data);
        return NULL;
    }
    for (size_t i = 0; i < 3 && constant; i++)
        dims[i] = (int)json_integer_value(json_array_get(json_object_get(from, "dims"), i));
    memcpy(data, dims, at);
    if (constant) {
        for (; at + 8 <= bytes; at += 8) memcpy(data + at, &value, 8);
    } else {
        fill(from, cells);
        memcpy(data + at, cells, bytes - at);
    }
    free(cells);
    *size = bytes;
    return data;
}
