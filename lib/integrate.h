/*
 * integrate.h - adaptive quadrature of a few functions at once, each with an error.
 *
 * Gauss-Kronrod rules of 7 and 15 points on panels, the worst panel halved until the
 * target is met (de Doncker's QAG, QUADPACK 1983).  An integrand may itself be an
 * integral: its errors are integrated too, so that nested quadrature adds them up.
 */
#ifndef FACET_INTEGRATE_H
#define FACET_INTEGRATE_H

#include "facet.h"

enum { INTEGRATE_POINTS = 15, INTEGRATE_VALUES_MAX = 3 };

struct integral {
    double value[INTEGRATE_VALUES_MAX], error[INTEGRATE_VALUES_MAX];
};

/* Values (and their own errors) at all points of one panel. */
typedef facet_status integrand_fn(void *user, const double at[INTEGRATE_POINTS],
                                  struct integral of[INTEGRATE_POINTS]);

struct integrate_panel {
    double low, high;
    struct integral sum;
};

struct integrate {
    integrand_fn *fn;
    void *user;
    size_t values; /* 1 .. INTEGRATE_VALUES_MAX */
    /* Ends when every error is at most max(absolute[i], relative |value|); 0 where not wanted. */
    double absolute[INTEGRATE_VALUES_MAX], relative;
    struct integrate_panel *panel; /* room for panels, at least the number of pieces */
    size_t panels;
    bool is_smooth;       /* no kinks between the breaks: the error is estimated less cautiously */
    const size_t *budget; /* refinement ends where this is 0; NULL: never */
};

/*
 * The integral over [breaks[0], breaks[count - 1]], its pieces apart; breaks ascend and repeat
 * freely.  A target not met is no failure: sum->error says so.
 */
facet_status facet_integrate(const struct integrate *rule, const double *breaks, size_t count,
                             struct integral *sum);

#endif
