/*
 * fit_spread.c - how many different things samples say.
 *
 * A sample is an equation for the parameters of a surface, and two samples at one pair of
 * directions (or at two that the surface cannot tell apart) are the same one: together they
 * show noise, not a second point of a lobe.  As many equations as parameters are met by any
 * data; only one more shows whether the model is the right one.
 */
#include "fit_pairs.h"

#include <math.h>

/* Components written with five decimals move the angle between two directions by so much. */
#define SAME 4e-5

enum { NUMBERS = 6 };

struct told {
    size_t count;
    double pair[FACET_FIT_SPREAD_MAX][NUMBERS];
};

static double difference(const double a[], const double b[], size_t n)
{
    double most = 0;
    for (size_t k = 0; k < n; k++) most = fmax(most, fabs(a[k] - b[k]));
    return most;
}

/* Turned about the normal, mirrored and exchanged a pair has the same three angles. */
static bool same_round(const double a[NUMBERS], const double b[NUMBERS])
{
    return difference(a, b, 3) <= SAME;
}

/* Exchanged, and both turned by 180 degrees (slopes have no mean), it shows the same. */
static bool same_turned(const double a[NUMBERS], const double b[NUMBERS])
{
    for (int image = 0; image < 4; image++) {
        double sign = image & 1 ? -1 : 1;
        const double *i = image & 2 ? b + 3 : b, *o = image & 2 ? b : b + 3;
        const double c[NUMBERS] = {sign * i[0], sign * i[1], i[2], sign * o[0], sign * o[1], o[2]};
        if (difference(a, c, NUMBERS) <= SAME) return true;
    }
    return false;
}

static void count(struct told *told, const double pair[NUMBERS],
                  bool (*same)(const double a[NUMBERS], const double b[NUMBERS]))
{
    if (told->count == FACET_FIT_SPREAD_MAX) return;
    for (size_t k = 0; k < told->count; k++)
        if (same(pair, told->pair[k])) return;
    for (size_t k = 0; k < NUMBERS; k++) told->pair[told->count][k] = pair[k];
    told->count++;
}

static double polar_angle(const double k[3])
{
    return atan2(hypot(k[0], k[1]), k[2]);
}

void facet_fit_spread_of(const facet_fit_samples *s, facet_fit_spread *spread)
{
    struct told round = {.count = 0}, turned = {.count = 0};
    *spread = (facet_fit_spread){0};
    for (size_t i = 0; i < s->count; i++) {
        if (!facet_fit_sample_is_used(s, i)) continue;
        spread->used++;
        const double both[NUMBERS] = {s->wi.x[i], s->wi.y[i], s->wi.z[i],
                                      s->wo.x[i], s->wo.y[i], s->wo.z[i]};
        double apart = 0, along = 0, a = polar_angle(both), b = polar_angle(both + 3);
        for (int k = 0; k < 3; k++) {
            apart += pow(both[k] - both[k + 3], 2);
            along += pow(both[k] + both[k + 3], 2);
        }
        const double angles[NUMBERS] = {fmin(a, b), fmax(a, b),
                                        2 * atan2(sqrt(apart), sqrt(along))};
        count(&round, angles, same_round);
        count(&turned, both, same_turned);
    }
    spread->round = round.count;
    spread->turned = turned.count;
}

bool facet_fit_is_told(const facet_fit_spread *spread, size_t parameters, bool anisotropic,
                       bool elongated)
{
    if (!anisotropic) return spread->round > parameters;
    return spread->turned > parameters + 2 &&
           (spread->round > parameters || (spread->round == parameters && elongated));
}
