/*
 * ndf_table.h - a tabulated distribution: struct kernel_table says what its cubics and
 * sheets hold.  Their variables are bounded, and only that of the azimuth needs trigonometry.
 */
#ifndef FACET_NDF_TABLE_H
#define FACET_NDF_TABLE_H

#include "surface.h"
#include "vmath.h"

/* Lane by lane: looking up does not vectorise. */
INLINE real cubic_at(struct kernel_cubic f, real u)
{
    lane at[LANES];
    memcpy(at, &u, sizeof at);
    for (size_t k = 0; k < LANES; k++) {
        lane x = at[k] * R(f.cells);
        x = x > 0 ? x : 0;
        size_t last = f.cells - 1, i = x < R(last) ? (size_t)x : last;
        lane t = x - R(i);
        const double *c = f.c + 4 * i;
        at[k] = ((R(c[3]) * t + R(c[2])) * t + R(c[1])) * t + R(c[0]);
    }
    memcpy(&u, at, sizeof u);
    return u;
}

/* The same of two variables. */
INLINE real sheet_at(struct kernel_sheet f, real u, real turn)
{
    lane at[LANES], by[LANES];
    memcpy(at, &u, sizeof at);
    memcpy(by, &turn, sizeof by);
    for (size_t k = 0; k < LANES; k++) {
        lane x = at[k] * R(f.cells), y = by[k] * R(f.turns), sum = 0;
        x = x > 0 ? x : 0;
        size_t last = f.cells - 1, i = x < R(last) ? (size_t)x : last;
        size_t end = f.turns - 1, j = y < R(end) ? (size_t)y : end;
        lane t = x - R(i), s = y - R(j);
        const double *c = f.c + 16 * (f.cells * j + i);
        for (size_t m = 16; m > 0; m -= 4)
            sum = sum * s + (((R(c[m - 1]) * t + R(c[m - 2])) * t + R(c[m - 3])) * t + R(c[m - 4]));
        at[k] = sum;
    }
    memcpy(&u, at, sizeof u);
    return u;
}

/* The azimuth of (x, y) or of (-x, -y) in units of pi, in [0, 1]. */
INLINE real half_turn_of(real x, real y)
{
    real ax = real_abs(x), ay = real_abs(y);
    real q = quotient(real_min(ax, ay), real_max(real_max(ax, ay), splat(REAL_MIN)));
    real beyond = quotient(q - splat(1), q + splat(1)); /* tan of what is left of the eighth */
    real z = select(less(splat(R(ATAN_END)), q), beyond, q);
    real a = madd(z, POLY(ATAN_PRECISE, z * z),
                  select(less(splat(R(ATAN_END)), q), splat(R(0.25)), splat(0)));
    a = select(less(ax, ay), splat(R(0.5)) - a, a);
    return select(less(x * y, splat(0)), splat(1) - a, a);
}

INLINE real exp_any(real x)
{
    real e = exp_minus(real_abs(x));
    return select(less(splat(0), x), quotient(splat(1), real_max(e, splat(REAL_MIN))), e);
}

/* Even in H, as the other distributions are: pdf_ndf turns it up. */
INLINE real table_density(const struct kernel_surface *s, struct half h)
{
    real r = root_from_zero(madd(h.x, h.x, h.y * h.y)),
         bz = R(s->table->slope_scale) * real_abs(h.z);
    real inverse = recip(bz + r), near = R(s->table->slope_scale) * inverse;
    real q = R(SQRT_PI) * h.hh * near * near, u = r * inverse;
    struct kernel_sheet sheet = s->table->turned_q;
    real log_q = sheet.turns ? sheet_at(sheet, u, half_turn_of(h.x, h.y))
                             : cubic_at(s->table->log_q, u);
    return q * q * exp_any(log_q);
}

INLINE real table_excess(const struct kernel_surface *s, struct direction k)
{
    real length = R(s->table->slope_scale) * root_from_zero(k.s2);
    real whole = real_max(length + real_abs(k.c), splat(REAL_MIN)), w = quotient(length, whole);
    struct kernel_sheet sheet = s->table->turned_psi;
    real log_psi = sheet.turns
                       ? sheet_at(sheet, quotient(real_abs(k.c), whole), half_turn_of(k.a, k.b))
                       : cubic_at(s->table->log_psi, w);
    return length * w * exp_any(log_psi);
}

#endif
