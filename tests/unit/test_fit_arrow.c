/* The arrow against the same normal equations solved whole. */
#include "check.h"
#include "fit_arrow.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SHARED = 4, OWN = 6, ALL = SHARED + OWN, ROWS = 60 };

static double draw(unsigned *state)
{
    *state = *state * 1664525u + 1013904223u;
    return (*state >> 8) / 8388608. - 1;
}

/* Gaussian elimination with pivots. */
static void solve(double a[ALL][ALL + 1])
{
    for (int c = 0; c < ALL; c++) {
        int best = c;
        for (int r = c; r < ALL; r++)
            if (fabs(a[r][c]) > fabs(a[best][c])) best = r;
        double row[ALL + 1];
        memcpy(row, a[c], sizeof row);
        memcpy(a[c], a[best], sizeof row);
        memcpy(a[best], row, sizeof row);
        for (int r = 0; r < ALL; r++) {
            double factor = r == c ? 0 : a[r][c] / a[c][c];
            for (int k = c; factor != 0 && k <= ALL; k++) a[r][k] -= factor * a[c][k];
        }
    }
    for (int r = 0; r < ALL; r++) a[r][ALL] /= a[r][r];
}

/* Random rows, each of two shared parameters and at most one private; frozen: SHARED or one. */
static void compare(unsigned seed, double damping, size_t frozen)
{
    struct fit_arrow arrow;
    double a[ALL][ALL + 1] = {{0}}, step[ARROW_SHARED_MAX], own_step[OWN];
    CHECK(facet_fit_arrow_create(&arrow, SHARED, OWN));
    for (int r = 0; r < ROWS; r++) {
        double j[ALL] = {0}, residual = draw(&seed);
        size_t own = (size_t)r % (OWN + 1); /* the last: none */
        for (int k = 0; k < 2; k++) j[(r + k) % SHARED] = draw(&seed);
        if (own < OWN) j[SHARED + own] = draw(&seed);
        for (size_t i = 0; i < ALL; i++) {
            for (size_t k = 0; k < ALL; k++) a[i][k] += j[i] * j[k];
            a[i][ALL] += j[i] * residual;
        }
        for (size_t i = 0; i < SHARED; i++) {
            arrow.right[i] += j[i] * residual;
            for (size_t k = 0; k < SHARED; k++) arrow.square[i][k] += j[i] * j[k];
            if (own < OWN) arrow.cross[own][i] += j[i] * j[SHARED + own];
        }
        if (own == OWN) continue;
        arrow.own_square[own] += j[SHARED + own] * j[SHARED + own];
        arrow.own_right[own] += j[SHARED + own] * residual;
    }
    for (size_t i = 0; i < ALL; i++) a[i][i] *= 1 + damping;
    for (size_t i = 0; i <= ALL && frozen < SHARED; i++) {
        a[frozen][i] = i == frozen;
        if (i < ALL) a[i][frozen] = i == frozen;
    }
    if (frozen < SHARED) a[frozen][ALL] = 0, arrow.frozen[frozen] = true;
    CHECK(facet_fit_arrow_solve(&arrow, damping, step, own_step));
    solve(a);
    for (size_t i = 0; i < SHARED; i++) CHECK_REL(step[i], a[i][ALL], 1e-9, 1e-3);
    for (size_t i = 0; i < OWN; i++) CHECK_REL(own_step[i], a[SHARED + i][ALL], 1e-9, 1e-3);
    facet_fit_arrow_reset(&arrow);
    CHECK(arrow.own_square[0] == 0 && arrow.square[0][0] == 0 && arrow.right[0] == 0);
    facet_fit_arrow_clear(&arrow);
}

TEST(as_the_whole_system)
{
    for (unsigned seed = 1; seed < 20; seed++) {
        compare(seed, 0, SHARED);
        compare(seed, 0.3, SHARED);
        compare(seed, 0.01, seed % SHARED);
    }
}

TEST(what_nothing_sees_stays)
{
    struct fit_arrow arrow;
    double step[ARROW_SHARED_MAX], own_step[2];
    CHECK(facet_fit_arrow_create(&arrow, 2, 2));
    arrow.square[0][0] = arrow.own_square[0] = 4;
    arrow.right[0] = arrow.own_right[0] = 2;
    CHECK(facet_fit_arrow_solve(&arrow, 0, step, own_step));
    CHECK_REL(step[0], .5, 1e-15, 0);
    CHECK(step[1] == 0 && own_step[1] == 0);
    CHECK_REL(own_step[0], .5, 1e-15, 0);
    facet_fit_arrow_clear(&arrow);
}
