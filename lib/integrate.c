#include "integrate.h"

#include <float.h>
#include <math.h>

enum { HALF = INTEGRATE_POINTS / 2 };

/* Nodes of the Kronrod rule on [-1, 1] from the end inwards; every second one is Gauss's. */
static const double nodes[HALF + 1] = {
    0.991455371120812639206854697526329, 0.949107912342758524526189684047851,
    0.864864423359769072789712788640926, 0.741531185599394439863864773280788,
    0.586087235467691130294144691693313, 0.405845151377397166906606412076961,
    0.207784955007898467600689403773245, 0,
};
static const double kronrod[HALF + 1] = {
    0.022935322010529224963732008058970, 0.063092092629978553290700663189204,
    0.104790010322250183839876322541518, 0.140653259715525918745189590510238,
    0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
    0.204432940075298892414161999234649, 0.209482141084727828012999174891714,
};
static const double gauss[HALF + 1] = {
    0, 0.129484966168869693270611432679082, 0, 0.279705391489276667901467771423780,
    0, 0.381830050505118944950369775488975, 0, 0.417959183673469387755102040816327,
};

/* Node i of 15 is outward[i] of the table above, on the side of its sign. */
static int outward(int i)
{
    return i <= HALF ? i : INTEGRATE_POINTS - 1 - i;
}

/* Roundings of a sum of 15 terms and of the terms. */
#define ROUNDING (4 * DBL_EPSILON)

/*
 * QUADPACK's estimate: the rules' difference d, which is far above the error of the better rule
 * on smooth integrands, to the power 1.5 in units of the integrand's spread.  QUADPACK has 200 for
 * CAUTION; with 1000 the estimate is no less than d down to 1e-9, so that it holds for kinks too.
 */
#define CAUTION 1000
#define CAUTION_SMOOTH 200
static double rule_error(double caution, double difference, double spread, double magnitude)
{
    double error = difference;
    if (spread > 0 && difference > 0)
        error = spread * fmin(1, pow(caution * difference / spread, 1.5));
    return fmax(error, ROUNDING * magnitude);
}

static facet_status measure(const struct integrate *rule, struct integrate_panel *panel)
{
    double at[INTEGRATE_POINTS], half = 0.5 * (panel->high - panel->low),
                                 middle = panel->low + half;
    struct integral of[INTEGRATE_POINTS] = {{{0}, {0}}};
    for (int i = 0; i < INTEGRATE_POINTS; i++)
        at[i] = middle + (i < HALF ? -half : half) * nodes[outward(i)];
    facet_status status = rule->fn(rule->user, at, of);
    const double caution = rule->is_smooth ? CAUTION_SMOOTH : CAUTION;
    for (size_t v = 0; v < rule->values; v++) {
        double fine = 0, coarse = 0, spread = 0, magnitude = 0, own = 0;
        for (int i = 0; i < INTEGRATE_POINTS; i++) {
            double y = of[i].value[v], w = kronrod[outward(i)];
            fine += w * y;
            coarse += gauss[outward(i)] * y;
            magnitude += w * fabs(y);
            own += w * of[i].error[v];
        }
        for (int i = 0; i < INTEGRATE_POINTS; i++)
            spread += kronrod[outward(i)] * fabs(of[i].value[v] - 0.5 * fine);
        panel->sum.value[v] = fine * half;
        panel->sum.error[v] = half *
                              (rule_error(caution, fabs(fine - coarse), spread, magnitude) + own);
    }
    return status;
}

static struct integral total(const struct integrate *rule, size_t count)
{
    struct integral sum = {{0}, {0}};
    for (size_t p = 0; p < count; p++)
        for (size_t v = 0; v < rule->values; v++) {
            sum.value[v] += rule->panel[p].sum.value[v];
            sum.error[v] += rule->panel[p].sum.error[v];
        }
    return sum;
}

/* How far an error is from its target; at most 1: met. */
static double excess(const struct integrate *rule, const struct integral *sum,
                     const struct integral *of)
{
    double worst = 0;
    for (size_t v = 0; v < rule->values; v++) {
        double target = fmax(rule->absolute[v], rule->relative * fabs(sum->value[v]));
        if (of->error[v] > 0) worst = fmax(worst, of->error[v] / fmax(target, DBL_MIN));
    }
    return worst;
}

static size_t worst_panel(const struct integrate *rule, const struct integral *sum, size_t count)
{
    size_t worst = 0;
    double most = -1;
    for (size_t p = 0; p < count; p++) {
        double e = excess(rule, sum, &rule->panel[p].sum);
        if (e > most) {
            most = e;
            worst = p;
        }
    }
    return worst;
}

/* Halves the worst panel until the target is met, nothing is gained any more, or room is out. */
static facet_status refine(const struct integrate *rule, size_t count, struct integral *sum)
{
    enum { FUTILE_MAX = 60 };
    for (int futile = 0; futile < FUTILE_MAX && count < rule->panels; count++) {
        *sum = total(rule, count);
        if (excess(rule, sum, sum) <= 1 || (rule->budget && *rule->budget == 0)) return FACET_OK;
        struct integrate_panel *worst = &rule->panel[worst_panel(rule, sum, count)];
        struct integrate_panel *other = &rule->panel[count];
        double middle = worst->low + 0.5 * (worst->high - worst->low);
        if (!(middle > worst->low && middle < worst->high)) return FACET_OK;
        double before = excess(rule, sum, &worst->sum);
        *other = (struct integrate_panel){.low = middle, .high = worst->high};
        worst->high = middle;
        facet_status status = measure(rule, worst);
        if (!status) status = measure(rule, other);
        if (status) return status;
        double after = excess(rule, sum, &worst->sum) + excess(rule, sum, &other->sum);
        if (after > 0.9 * before) futile++;
    }
    *sum = total(rule, count);
    return FACET_OK;
}

facet_status facet_integrate(const struct integrate *rule, const double *breaks, size_t count,
                             struct integral *sum)
{
    size_t panels = 0;
    *sum = (struct integral){{0}, {0}};
    for (size_t i = 1; i < count; i++) {
        if (!(breaks[i] > breaks[i - 1])) continue;
        struct integrate_panel *panel = &rule->panel[panels++];
        *panel = (struct integrate_panel){.low = breaks[i - 1], .high = breaks[i]};
        facet_status status = measure(rule, panel);
        if (status) return status;
    }
    return refine(rule, panels, sum);
}
